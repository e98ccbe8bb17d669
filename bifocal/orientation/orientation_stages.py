"""The stages of a set-up: control first, then ties, lens, wall, refinement, gross errors.

Each stage takes the problem and its solution and returns both, better.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from bifocal.orientation import validation as refusals
from bifocal.orientation.alignment import Interior, SiteMeasures
from bifocal.orientation.bundle import Problem, Solution, adjust, evaluate, onto_plane, radial_shift
from bifocal.orientation.dominant_plane import even_points
from bifocal.orientation.pinhole import Pinhole, plane_transfer, tilt, triangulate
from bifocal.orientation.reference_plane import Face, choose_wall, rivals_in_words
from bifocal.orientation.tie_points import (
    ROUGHNESS,
    classify,
    raw_pixels,
    refine_ties,
    robust_sigma,
    settle,
)
from photocore.arrays import ByteArray, FloatArray
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


@dataclass(slots=True)
class Notes:
    """What is to be told, gathered on the way."""

    remarks: list[str] = field(default_factory=list)
    assumed: list[str] = field(default_factory=list)
    faces: list[Face] = field(default_factory=list)


def adjusted(
    problem: Problem,
    cameras: tuple[Pinhole, Pinhole],
    photos: tuple[PhotoInput, PhotoInput],
    site: SiteMeasures,
    step: Step,
    *,
    with_control: bool,
    notes: Notes,
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
    problem: Problem, cameras: tuple[Pinhole, Pinhole], notes: Notes
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


def _unbent(problem: Problem, solution: Solution, notes: Notes) -> tuple[Problem, Solution]:
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
    notes: Notes,
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


def _parallel_if_so(problem: Problem, solution: Solution, notes: Notes) -> tuple[Problem, Solution]:
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


def without_gross(
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


__all__ = ["SIGMA_PARALLEL", "Notes", "PhotoInput", "Step", "adjusted", "silent", "without_gross"]
