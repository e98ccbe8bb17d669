"""Two photos become a pair: cameras from control points, site distances or the photos alone.

One adjustment serves all three ways; they differ in what is observed. See docs/align.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bifocal.orientation import validation as refusals
from bifocal.orientation.alignment import Control, Interior, SiteMeasures
from bifocal.orientation.bundle import Problem, Solution, evaluate, ray_on_plane
from bifocal.orientation.features import find_features
from bifocal.orientation.orientation_stages import (
    SIGMA_PARALLEL,
    Notes,
    PhotoInput,
    Step,
    adjusted,
    silent,
    without_gross,
)
from bifocal.orientation.pinhole import Pinhole
from bifocal.orientation.reference_plane import Face
from bifocal.orientation.relative_orientation import Ties, find_ties, first_cameras, plane_scale
from bifocal.orientation.space_resection import resect
from bifocal.orientation.tie_points import robust_sigma
from photocore.arrays import BoolArray
from photocore.errors import GeometryError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SetUp:
    """Cameras of both photos, far one first, with everything that led to them.

    Attributes
    ----------
    problem, solution : Problem, Solution
    exchanged : bool
        Whether the photos were given the other way round.
    assumed : tuple of str
        What nothing but an assumption determines.
    remarks : tuple of str
    gross : tuple of str
        Control points left out.
    faces : tuple of Face
        Where no control points define the plane: the wall, and the planes parallel to it.
    wall_named : bool
        Whether the user said which of them is the wall.
    """

    problem: Problem
    solution: Solution
    exchanged: bool
    assumed: tuple[str, ...]
    remarks: tuple[str, ...]
    gross: tuple[str, ...]
    faces: tuple[Face, ...] = ()
    wall_named: bool = False


def set_up(
    photos: tuple[PhotoInput, PhotoInput],
    *,
    control: Control,
    site: SiteMeasures,
    step: Step = silent,
) -> SetUp:
    """Return the cameras of a pair.

    Parameters
    ----------
    photos : pair of PhotoInput
        Far photo first; given the other way round they are exchanged.
    control : Control
        Points measured on site; may be empty.
    site : SiteMeasures
        Distances measured on site.
    step : callable
        Told what is being done.

    Raises
    ------
    GeometryError
        If the photos and measurements do not make a pair; the message says why and what to do.
    """
    notes = Notes()
    known: BoolArray = np.isfinite(control.xyz[:, 0]) & np.isfinite(control.xyz[:, 1])
    enough = all(
        (known & np.isfinite(pixels).all(axis=1)).sum() >= 4
        for pixels in (control.pixels1, control.pixels2)
    )
    step("looking for common points")
    ties = _ties(photos, needed=not enough, notes=notes)
    step("setting up the cameras")
    cameras, agree, interiors = _start(photos, control, site, ties, enough, known)
    if enough and ties is not None:
        misfit = _contradiction(cameras, interiors, ties)
        if misfit > 2 * ties.tolerance and _picks_exchanged(photos, control, site, ties, misfit):
            return _other_photos(photos, control, site, step)
    if cameras[0].centre[2] < cameras[1].centre[2]:
        return _exchanged(photos, control, site, step)
    if enough:
        refusals.check_units(cameras, site)
    elif ties is not None:
        refusals.check_parallax(
            ties, interiors, (photos[0].name, photos[1].name), flat_is_fine=site.parallel
        )
    problem = _problem(interiors, control, site, ties, agree, gauge=known.sum() < 2)
    problem, solution = adjusted(
        problem, cameras, photos, site, step, with_control=enough, notes=notes
    )
    problem, solution, gross = without_gross(problem, solution)
    refusals.check_determined(solution)
    refusals.check_movement(solution)
    _remark_on_control(control, known, problem, solution, notes)
    _remark_on_distances(solution, notes)
    notes.assumed += _assumptions(problem, site)
    return SetUp(
        problem=problem,
        solution=solution,
        exchanged=False,
        assumed=tuple(notes.assumed),
        remarks=tuple(notes.remarks),
        gross=gross,
        faces=tuple(notes.faces),
        wall_named=site.wall is not None,
    )


def _contradiction(
    cameras: tuple[Pinhole, Pinhole], interiors: tuple[Interior, Interior], ties: Ties
) -> float:
    """Return how far the common points are from the cameras' epipolar lines. [px]"""
    problem = _problem(interiors, Control(), SiteMeasures(), ties, np.zeros(0, bool), gauge=True)
    blank = np.zeros(0)
    solution = Solution(
        cameras=cameras,
        radial=(0.0, 0.0),
        plane=np.zeros(3),
        covariance=np.zeros((0, 0)),
        sigma0=1.0,
        control_residuals=np.zeros((0, 4)),
        control_test=blank,
        tie_misfit=blank,
        wall_misfit=blank,
    )
    return robust_sigma(evaluate(problem, solution).tie_misfit)


def _picks_exchanged(
    photos: tuple[PhotoInput, PhotoInput],
    control: Control,
    site: SiteMeasures,
    ties: Ties,
    misfit: float,
) -> bool:
    """Return whether the picks of the two photos were exchanged.

    Raises
    ------
    GeometryError
        If they fit neither way round.
    """
    turned = control.exchanged()
    known = np.isfinite(turned.xyz[:, 0]) & np.isfinite(turned.xyz[:, 1])
    try:
        cameras, _, interiors = _start(photos, turned, site, ties, True, known)
        other = _contradiction(cameras, interiors, ties)
    except GeometryError:
        other = np.inf
    if other < 0.5 * misfit:
        return True
    if misfit > 0.012 * max(photos[0].interior.image_size):
        raise GeometryError(
            "the control points' pixels do not fit the photos: the details common to both photos "
            "contradict them. Check that col1, row1 are pixels of the first photo and col2, row2 "
            "of the second, at full size."
        )
    return False


def _other_photos(
    photos: tuple[PhotoInput, PhotoInput], control: Control, site: SiteMeasures, step: Step
) -> SetUp:
    """Return the set-up with the picks of the two photos exchanged, saying so."""
    made = set_up(photos, control=control.exchanged(), site=site, step=step)
    note = (
        f"col1, row1 of the control points are pixels of {photos[1].name}, col2, row2 of "
        f"{photos[0].name}; the picks were exchanged."
    )
    return replace(made, remarks=(note, *made.remarks))


def _exchanged(
    photos: tuple[PhotoInput, PhotoInput], control: Control, site: SiteMeasures, step: Step
) -> SetUp:
    """Return the set-up with the photos the other way round, saying so."""
    if site.wall is not None:
        raise GeometryError(
            f"{photos[0].name} is the near photo. --wall is a spot of the far photo: give "
            f"{photos[1].name} first, and the spot in it."
        )
    if site.distance1 and site.distance2 and site.distance1 < site.distance2:
        site = replace(site, distance1=site.distance2, distance2=site.distance1)
    made = set_up((photos[1], photos[0]), control=control.exchanged(), site=site, step=step)
    note = (
        f"{photos[0].name} is the near photo; the two were exchanged. Image 1 of the pair file is "
        f"{photos[1].name}, and --distance1 means its distance."
    )
    return replace(made, exchanged=True, remarks=(note, *made.remarks))


def _ties(photos: tuple[PhotoInput, PhotoInput], *, needed: bool, notes: Notes) -> Ties | None:
    """Return the photos' common points; without them only if control points suffice."""
    images = photos[0].grey, photos[1].grey
    if images[0] is None or images[1] is None:
        return None
    try:
        refusals.check_sharp(photos[0].name, images[0])
        refusals.check_sharp(photos[1].name, images[1])
        refusals.check_different(photos[0].name, photos[1].name, (images[0], images[1]))
        return find_ties(
            find_features(images[0]),
            find_features(images[1]),
            (photos[0].interior, photos[1].interior),
            (photos[0].name, photos[1].name),
        )
    except GeometryError as error:
        if needed or isinstance(error, refusals.SamePhotoError):
            raise
        notes.remarks.append(
            f"The pair rests on the control points alone, without common points: {error}"
        )
        return None


def _start(
    photos: tuple[PhotoInput, PhotoInput],
    control: Control,
    site: SiteMeasures,
    ties: Ties | None,
    enough: bool,
    known: BoolArray,
) -> tuple[tuple[Pinhole, Pinhole], BoolArray, tuple[Interior, Interior]]:
    """Return approximate cameras, the control points that agree, and the interiors used."""
    interiors = (photos[0].interior, photos[1].interior)
    agree = np.ones(len(control.ids), dtype=bool)
    if enough:
        cameras = []
        for pixels, photo in zip((control.pixels1, control.pixels2), photos, strict=True):
            seen = known & np.isfinite(pixels).all(axis=1)
            xyz = np.nan_to_num(control.xyz[seen])
            try:
                camera, fits = resect(xyz, photo.interior.ideal(pixels[seen]), photo.interior)
            except GeometryError as error:
                raise GeometryError(f"{photo.name}: {error}") from None
            cameras.append(camera)
            agree[np.flatnonzero(seen)[~fits]] = False
        return (cameras[0], cameras[1]), agree, interiors
    if ties is None:
        raise GeometryError("too few control points, and no common points to go with them.")
    interiors = _plausible_focals(interiors, ties, site)
    cameras_unit = first_cameras(ties, interiors)
    return _scaled(cameras_unit, control, site, known, interiors), agree, interiors


def _plausible_focals(
    interiors: tuple[Interior, Interior], ties: Ties, site: SiteMeasures
) -> tuple[Interior, Interior]:
    """Return interiors whose unknown focal length follows from the distances and the scale."""
    first, second = interiors
    if not (first.is_assumed or second.is_assumed):
        return interiors
    d1, d2 = site.distance1, site.distance2
    if d1 and site.delta_d and not d2:
        d2 = d1 - site.delta_d
    elif d2 and site.delta_d and not d1:
        d1 = d2 + site.delta_d
    if not (d1 and d2):
        raise GeometryError(
            "the focal lengths are unknown (no EXIF). Give --lens, or --focal1 and --focal2 with "
            "--sensor-width or --pixel-size, or both distances, or four control points."
        )
    # On the wall photo 2 is s times as large: s = (f2 / d2) / (f1 / d1).
    ratio = plane_scale(ties, first.image_size) * d2 / d1
    if second.is_assumed:
        return first, replace(second, focal=first.focal * ratio)
    return replace(first, focal=second.focal / ratio), second


def _scaled(
    cameras: tuple[Pinhole, Pinhole],
    control: Control,
    site: SiteMeasures,
    known: BoolArray,
    interiors: tuple[Interior, Interior],
) -> tuple[Pinhole, Pinhole]:
    """Return cameras of far distance 1 brought to metres and, where known, to X and Y."""
    near = cameras[1].centre[2]
    positions = ray_on_plane(cameras[0], interiors[0].ideal(control.pixels1))[:, :2]
    pairs = [(a, b, length) for a, b, length in control.lengths]
    points = np.flatnonzero(known & np.isfinite(positions).all(axis=1))
    turn, shift = np.eye(2), np.zeros(2)
    if len(points) >= 2:
        here, there = positions[points], control.xyz[points, :2]
        a, b = here - here.mean(0), there - there.mean(0)
        dot, cross = (a * b).sum(), (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum()
        scale = float(np.hypot(dot, cross) / (a * a).sum())
        angle = np.arctan2(cross, dot)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        shift = there.mean(0) - scale * turn @ here.mean(0)
    elif site.distance1:
        scale = site.distance1
    elif site.distance2:
        scale = site.distance2 / near
    elif site.delta_d:
        scale = site.delta_d / (1.0 - near)
    elif pairs:
        ratios = [length / np.linalg.norm(positions[a] - positions[b]) for a, b, length in pairs]
        scale = float(np.median(ratios))
    else:
        raise GeometryError(
            "nothing gives the scale: two photos alone have none. Measure one distance from a "
            "camera to the wall (--distance1 or --distance2), or one length on the wall (--length)."
        )
    full = np.eye(3)
    full[:2, :2] = turn
    moved = [
        camera._replace(
            rotation=camera.rotation @ full.T,
            centre=scale * full @ camera.centre + np.append(shift, 0.0),
        )
        for camera in cameras
    ]
    return moved[0], moved[1]


def _problem(
    interiors: tuple[Interior, Interior],
    control: Control,
    site: SiteMeasures,
    ties: Ties | None,
    agree: BoolArray,
    *,
    gauge: bool,
) -> Problem:
    """Return everything observed, ideal pixels throughout."""
    control = replace(
        control,
        pixels1=interiors[0].ideal(control.pixels1),
        pixels2=interiors[1].ideal(control.pixels2),
    )
    measured = {
        name: (value, site.sigma)
        for name in ("distance1", "distance2", "delta_d")
        if (value := getattr(site, name)) is not None
    }
    base = Problem(
        interiors=interiors,
        control=control,
        pick_used=agree,
        sigma_pick=site.sigma_pick,
        measured=measured,
        sigma_tilt=SIGMA_PARALLEL if site.parallel else None,
        gauge=gauge,
        sigma_body=_same_body(interiors),
    )
    if ties is None:
        return base
    return replace(
        base,
        tie1=ties.pixels1,
        tie2=ties.pixels2,
        sigma_tie=ties.tolerance / 2,
        tie_used=np.ones(len(ties.pixels1), dtype=bool),
        wall=ties.on_plane,
        sigma_wall=np.full(len(ties.pixels1), 2 * ties.tolerance),
    )


def _same_body(interiors: tuple[Interior, Interior]) -> float | None:
    """Return how closely the principal points agree, if both may be of one camera body. [px]"""
    first, second = interiors
    if (
        first.is_calibrated
        or second.is_calibrated
        or sorted(first.image_size) != sorted(second.image_size)
    ):
        return None
    if first.image_size != second.image_size:  # one photo upright, one lying: axes differ
        return None
    return 0.002 * float(np.hypot(*first.image_size))


def _remark_on_control(
    control: Control, known: BoolArray, problem: Problem, solution: Solution, notes: Notes
) -> None:
    """Say what the control points lack."""
    for index in np.flatnonzero(~problem.pick_used):
        notes.remarks.append(
            f"Control point {control.ids[index]} is a gross error "
            f"({solution.control_test[index]:.0f} standard deviations) and was left out. Check its "
            "coordinates and its picks."
        )
    count = int(known.sum())
    if 4 <= count < 9:
        notes.remarks.append(
            f"{count} control points; CIPA advises nine, spread over the photo, so that an error "
            "in one is found."
        )


def _remark_on_distances(solution: Solution, notes: Notes) -> None:
    """Say so when a distance is poorly determined."""
    for number, camera in enumerate(solution.cameras, start=1):
        distance = float(camera.centre[2])
        sigma = float(np.sqrt(solution.covariance[11 * number - 2, 11 * number - 2]))
        if sigma > 0.03 * distance:
            notes.remarks.append(
                f"The distance of camera {number} is poorly determined ({distance:.2f} ± "
                f"{sigma:.2f} m). Give the focal lengths, the distances, or more points off the "
                "wall."
            )


def _assumptions(problem: Problem, site: SiteMeasures) -> list[str]:
    """Return what only the prior holds."""
    out = []
    for number, interior in enumerate(problem.interiors, start=1):
        if interior.is_assumed:
            out.append(f"focal length of photo {number}: {interior.source}")
        if not interior.is_calibrated:
            out.append(
                f"principal point of photo {number} in its centre "
                f"(within {interior.sigma_centre:.0f} px)"
            )
    uncorrected = [i for i in problem.interiors if not i.is_calibrated and not i.sigma_radial]
    if uncorrected:
        out.append("photos free of lens distortion (else calibrate and give --lens)")
    if site.parallel:
        out.append("image planes parallel to the wall within 0.3°")
    if problem.sigma_zoom is not None:
        out.append("one focal length for both photos (they agree)")
    return out


__all__ = ["PhotoInput", "SetUp", "set_up", "silent"]
