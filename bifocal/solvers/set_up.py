"""Two photos become a pair: cameras from control points, site distances or the photos alone.

One adjustment serves all three ways; they differ in what is observed. See docs/align.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from bifocal.domain.alignment import Control, Interior, SiteMeasures
from bifocal.pinhole import Pinhole, plane_transfer, tilt, triangulate
from bifocal.solvers import refusals
from bifocal.solvers.bundle import (
    Problem,
    Solution,
    adjust,
    evaluate,
    onto_plane,
    radial_shift,
    ray_on_plane,
)
from bifocal.solvers.features import find_features
from bifocal.solvers.relative import Ties, find_ties, first_cameras, plane_scale
from bifocal.solvers.resection import resect
from bifocal.solvers.tie_points import (
    ROUGHNESS,
    classify,
    raw_pixels,
    refine_ties,
    robust_sigma,
    settle,
)
from bifocal.solvers.wall_choice import Face, choose_wall, rivals_in_words
from bifocal.solvers.wall_face import even_points
from photocore.arrays import BoolArray, ByteArray, FloatArray
from photocore.errors import GeometryError

#: "Image plane parallel to the wall" when nothing contradicts it. [rad]
SIGMA_PARALLEL = np.deg2rad(0.3)
#: A wall's own face may slope by this against the plane it was meant to be. [m/m]
UNEVEN = 0.004
#: A control point's misfit beyond this many standard deviations is a gross error.
GROSS_LIMIT = 4.0
#: Ties within about this share of d1 of the control points' plane are taken for the wall at first.
PLANE_SHARE = 0.003

Step = Callable[[str], None]


def silent(what: str) -> None:
    """Tell nobody what is being done."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhotoInput:
    """One photo to be set up.

    Attributes
    ----------
    grey : ndarray, shape (h, w), uint8, or None
        None where only control points are to be used.
    interior : Interior
    name : str
        For messages.
    """

    grey: ByteArray | None
    interior: Interior
    name: str


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


@dataclass(slots=True)
class _Notes:
    """What is to be told, gathered on the way."""

    remarks: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)


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
    notes = _Notes()
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
    problem, solution = _adjusted(
        problem, cameras, photos, site, step, with_control=enough, notes=notes
    )
    problem, solution, gross = _without_gross(problem, solution)
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


def _ties(photos: tuple[PhotoInput, PhotoInput], *, needed: bool, notes: _Notes) -> Ties | None:
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


def _adjusted(
    problem: Problem,
    cameras: tuple[Pinhole, Pinhole],
    photos: tuple[PhotoInput, PhotoInput],
    site: SiteMeasures,
    step: Step,
    *,
    with_control: bool,
    notes: _Notes,
) -> tuple[Problem, Solution]:
    """Return the adjustment after ties, wall, lens assumptions and refinement are settled."""
    images = photos[0].grey, photos[1].grey
    if with_control:
        problem, cameras = _control_first(problem, cameras, notes)
    solution = adjust(problem, cameras)
    if with_control:
        problem, solution = _one_zoom(problem, solution)
    if len(problem.tie1) and images[0] is not None and images[1] is not None:
        problem, solution = settle(problem, solution)
        problem, solution = _unbent(problem, solution, notes)
        pictures = images[0], images[1]
        problem, solution = _with_even_points(problem, solution, pictures, site, notes)
        step("refining the common points")
        for _ in range(2):  # the second pass searches around better places
            moved, good = refine_ties(problem, solution, (images[0], images[1]))
            problem = replace(
                problem,
                tie2=np.where(good[:, None], moved, problem.tie2),
                tie_used=problem.tie_used & good,
                wall=problem.wall & good,
            )
            if problem.tie_used.sum() < 20:
                raise GeometryError(
                    f"{photos[0].name} and {photos[1].name} match only roughly: one is blurred, or "
                    "they show different states of the wall. Take sharper photos."
                )
            solution = adjust(
                problem, solution.cameras, radial=solution.radial, plane=solution.plane
            )
            problem, solution = settle(problem, solution, shares=ROUGHNESS[1:])
    if problem.gauge and problem.sigma_tilt is None:
        problem, solution = _parallel_if_so(problem, solution, notes)
    return problem, solution


def _control_first(
    problem: Problem, cameras: tuple[Pinhole, Pinhole], notes: _Notes
) -> tuple[Problem, tuple[Pinhole, Pinhole]]:
    """Return the problem with the ties that fit the control's cameras, and those cameras."""
    none = np.zeros(len(problem.tie1), dtype=bool)
    alone = adjust(replace(problem, tie_used=none, wall=none), cameras)
    if not len(problem.tie1):
        return problem, alone.cameras
    # Control leaves the epipolar lines uncertain by some pixels: the majority shows by how much.
    sigma = max(robust_sigma(alone.tie_misfit), problem.sigma_tie)
    joined = classify(problem, alone, share=PLANE_SHARE, sigma=sigma)
    if joined.wall.sum() < 20:
        notes.remarks.append(
            "Hardly any detail lies on the control points' plane; relief counts from the control "
            "points alone."
        )
        return replace(joined, wall=none), alone.cameras
    flat = problem.control.sigma[np.abs(np.nan_to_num(problem.control.xyz[:, 2])) < 0.05, 2]
    tight = max(float(np.median(flat)) if len(flat) else 0.003, 0.001)
    slope = 2 * tight / float(alone.cameras[0].centre[2])
    return replace(joined, sigma_plane=tight, sigma_slope=slope), alone.cameras


def _one_zoom(problem: Problem, solution: Solution) -> tuple[Problem, Solution]:
    """Return the adjustment with one principal distance if both photos' are the same.

    Two lenses of a bifocal pair differ by a third and more; if the focal lengths agree to within
    their precision and 3 %, the lens was not changed.
    """
    interiors = problem.interiors
    if min(i.sigma_focal for i in interiors) < 0.02 or problem.sigma_body is None:
        return problem, solution
    difference = float(np.log(solution.cameras[0].matrix[0, 0] / solution.cameras[1].matrix[0, 0]))
    sigma = float(np.sqrt(solution.covariance[0, 0] + solution.covariance[11, 11]))
    if abs(difference) > min(3 * sigma, 0.03) or sigma > 0.05:
        return problem, solution
    problem = replace(problem, sigma_zoom=5e-4)
    return problem, adjust(problem, solution.cameras, plane=solution.plane)


def _unbent(problem: Problem, solution: Solution, notes: _Notes) -> tuple[Problem, Solution]:
    """Return the adjustment with estimated lens distortion where the photos clearly show some."""
    if any(i.is_calibrated for i in problem.interiors):
        return problem, solution
    before = robust_sigma(solution.tie_misfit)
    trial = replace(
        problem,
        interiors=tuple(replace(i, sigma_radial=0.1) for i in problem.interiors),  # type: ignore[arg-type]
        tie_used=np.abs(solution.tie_misfit) < 8 * before,
    )
    bent = adjust(trial, solution.cameras, plane=solution.plane)
    wide = max(problem.interiors[0].image_size) / 2
    corner = max(
        abs(k) * (wide / i.focal) ** 2 * wide
        for k, i in zip(bent.radial, problem.interiors, strict=True)
    )
    if robust_sigma(bent.tie_misfit) > 0.85 * before or corner < 3.0:
        return problem, solution
    for k, interior in zip(bent.radial, problem.interiors, strict=True):
        refusals.check_distortion(k, interior)
    trial, bent = settle(trial, bent)
    notes.remarks.append(
        f"The photos show lens distortion of about {corner:.0f} px at the edge; it was estimated "
        "from the common points (k = "
        + ", ".join(f"{k:.4f}" for k in bent.radial)
        + "). A calibrated lens (`bifocal calibrate`, --lens) is more reliable."
    )
    return trial, bent


def _with_even_points(
    problem: Problem,
    solution: Solution,
    images: tuple[ByteArray, ByteArray],
    site: SiteMeasures,
    notes: _Notes,
) -> tuple[Problem, Solution]:
    """Return the adjustment with points from the whole area, on the face that is the wall.

    Where control points define the plane, the frame stays theirs.
    """
    count = len(problem.tie1)
    raw1, raw2 = even_points(problem, solution, images)
    extra = len(raw1)
    problem = replace(
        problem,
        tie1=np.concatenate([problem.tie1, problem.interiors[0].ideal(raw1)]),
        tie2=np.concatenate([problem.tie2, problem.interiors[1].ideal(raw2)]),
        tie_used=np.concatenate([problem.tie_used, np.ones(extra, dtype=bool)]),
        wall=np.concatenate([problem.wall, np.zeros(extra, dtype=bool)]),
        sigma_wall=np.concatenate([problem.sigma_wall, np.ones(extra)]),
    )
    # What the flow suggests is no observation until the patches agree.
    moved, good = refine_ties(problem, solution, images)
    even = np.arange(len(good)) >= count
    problem = replace(
        problem,
        tie2=np.where((good & even)[:, None], moved, problem.tie2),
        tie_used=problem.tie_used & (good | ~even),
    )
    straight = [
        radial_shift(x, i, k)
        for x, i, k in zip(
            (problem.tie1, problem.tie2), problem.interiors, solution.radial, strict=True
        )
    ]
    if not problem.gauge:
        sigma = max(robust_sigma(solution.tie_misfit[:count][problem.tie_used[:count]]), 0.03)
        started = evaluate(problem, solution)
        held = problem.wall.any()
        problem = classify(problem, started, share=ROUGHNESS[1], sigma=sigma)
        if not held:
            problem = replace(problem, wall=np.zeros_like(problem.wall))
        return problem, adjust(
            problem, solution.cameras, radial=solution.radial, plane=solution.plane
        )
    xyz = triangulate(*solution.cameras, *straight)
    d1 = float(solution.cameras[0].centre[2])
    fair = problem.tie_used & even & (np.abs(xyz[:, 2]) < 0.1 * d1)
    if fair.sum() < 200:
        return problem, adjust(problem, solution.cameras, radial=solution.radial)
    seen = raw_pixels(problem.interiors[0], problem.tie1[fair])
    plane, notes.faces = choose_wall(xyz[fair], seen, solution.cameras, problem.interiors, site)
    notes.remarks += [text for text in [rivals_in_words(notes.faces, site)] if text]
    start = evaluate(problem, replace(solution, cameras=onto_plane(solution.cameras, plane)))
    sigma = max(robust_sigma(start.tie_misfit[problem.tie_used]), 0.03)
    problem = classify(problem, start, share=ROUGHNESS[1], sigma=sigma)
    solution = adjust(problem, start.cameras, radial=solution.radial)
    return settle(problem, solution, shares=ROUGHNESS[1:])


def _parallel_if_so(
    problem: Problem, solution: Solution, notes: _Notes
) -> tuple[Problem, Solution]:
    """Return the adjustment with image planes taken as parallel, if nothing contradicts it.

    Photos alone give the tilt to the wall to 0.1° to 0.5°; a camera that was set up square to the
    wall with care stands better than that.
    """
    for number, camera in enumerate(solution.cameras):
        size = float(np.linalg.norm(tilt(camera)))
        at = 11 * number + 4
        sigma = float(np.sqrt(solution.covariance[at, at] + solution.covariance[at + 1, at + 1]))
        if size > 3 * np.hypot(sigma, SIGMA_PARALLEL) or size > np.deg2rad(1.5):
            return problem, solution
    sigma = _care(solution.cameras)
    problem = replace(problem, sigma_tilt=sigma)
    if sigma < SIGMA_PARALLEL / 2:
        # Better than any wall is flat: the reference plane is then parallel to the image planes
        # and touches the wall, which may slope against it.
        problem = replace(problem, sigma_plane=1e-4, sigma_slope=UNEVEN)
    notes.assumed.append(
        f"image planes parallel to the wall within {np.rad2deg(sigma):.2g}° (as they are to each "
        "other)"
    )
    return problem, adjust(problem, solution.cameras, radial=solution.radial, plane=solution.plane)


def _care(cameras: tuple[Pinhole, Pinhole]) -> float:
    """Return how carefully the cameras seem to have been set up, from photo against photo. [rad]

    Over the wall, photo 2 is a turned and keystoned photo 1. Set up independently to an accuracy
    sigma, turn and keystone between the photos scatter by about sigma; photos turned by less than
    0.02° against each other, and keystoned no more than an uneven wall explains, were not set up
    to 0.3°.
    """
    far, near = cameras
    matrix = plane_transfer(far, near, np.zeros(3))
    centred = np.linalg.inv(_at_centre(near)) @ matrix @ _at_centre(far)
    centred /= centred[2, 2]
    focal = 1.0 / np.hypot(1.0 / far.matrix[0, 0], 1.0 / near.matrix[0, 0])
    keystone = float(np.abs(centred[2, :2]).max() * focal)
    turn = abs(float(np.arctan2(centred[1, 0] - centred[0, 1], centred[0, 0] + centred[1, 1])))
    if keystone > UNEVEN:
        return SIGMA_PARALLEL
    return float(np.clip(1.5 * turn, np.deg2rad(0.02), SIGMA_PARALLEL))


def _at_centre(camera: Pinhole) -> FloatArray:
    """Return the shift of pixels from the principal point to the photo's corner."""
    shift = np.eye(3)
    shift[:2, 2] = camera.matrix[:2, 2]
    return shift


def _without_gross(
    problem: Problem, solution: Solution
) -> tuple[Problem, Solution, tuple[str, ...]]:
    """Return the adjustment without gross control points, taking out the worst one by one."""
    count = len(problem.control.ids)
    dropped: list[int] = list(np.flatnonzero(~problem.pick_used))
    for _ in range(max(count // 3, 1) if count > 4 else 0):
        test = np.where(problem.pick_used, solution.control_test, 0.0)
        usual = max(
            1.0, float(np.median(test[problem.pick_used])) if problem.pick_used.any() else 1
        )
        worst = int(test.argmax())
        if test[worst] < GROSS_LIMIT * usual or problem.pick_used.sum() <= 4:
            break
        used = problem.pick_used.copy()
        used[worst] = False
        dropped.append(worst)
        problem = replace(problem, pick_used=used)
        solution = adjust(problem, solution.cameras, radial=solution.radial, plane=solution.plane)
    # A point thrown out by the first, rough fit may be good after all.
    back = [i for i in dropped if solution.control_test[i] < GROSS_LIMIT]
    if back:
        used = problem.pick_used.copy()
        used[back] = True
        problem = replace(problem, pick_used=used)
        solution = adjust(problem, solution.cameras, radial=solution.radial, plane=solution.plane)
    gross = tuple(problem.control.ids[i] for i in np.flatnonzero(~problem.pick_used))
    return problem, solution, gross


def _remark_on_control(
    control: Control, known: BoolArray, problem: Problem, solution: Solution, notes: _Notes
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


def _remark_on_distances(solution: Solution, notes: _Notes) -> None:
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
