"""From adjusted cameras to a pair: axes, photos, lens files, standard deviations, words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bifocal.model.lens import Lens
from bifocal.model.pair import Pair, Photo
from bifocal.orientation.absolute_orientation import PhotoInput, SetUp
from bifocal.orientation.alignment import Alignment, Interior
from bifocal.orientation.bundle import PER_CAMERA, radial_shift
from bifocal.orientation.facade_axes import facade_turn, turned
from bifocal.orientation.orientation_report import set_up_words
from bifocal.orientation.pinhole import Pinhole, plane_from_pixel, triangulate
from bifocal.orientation.reference_plane import rivals
from bifocal.orientation.tie_points import raw_pixels, robust_sigma
from photocore.arrays import FloatArray


def make_alignment(
    made: SetUp,
    photos: tuple[PhotoInput, PhotoInput],
    *,
    way: str,
    direction: tuple[FloatArray, bool] | None = None,
) -> Alignment:
    """Return the pair of adjusted cameras with its diagnostics; photo files are not yet named.

    Parameters
    ----------
    made : SetUp
    photos : pair of PhotoInput
        Far one first, as in ``made``.
    way : str
        ``control``, ``site`` or ``auto``.
    direction : (pixels (2, 2), is_vertical), optional
        Two points of photo 1 on a level or upright line of the wall, where the frame is free.
    """
    problem, solution = made.problem, made.solution
    remarks, assumed = list(made.remarks), list(made.assumed)
    cameras = solution.cameras
    if problem.gauge:
        cameras, note = _in_facade_axes(cameras, photos[0], direction)
        assumed.append(note)
    lenses = tuple(
        _lens_of(interior, k)
        for interior, k in zip(problem.interiors, solution.radial, strict=True)
    )
    pair = Pair(
        image1=_photo(cameras[0], problem.interiors[0], lenses[0]),
        image2=_photo(cameras[1], problem.interiors[1], lenses[1]),
    )
    deviations = _deviations(solution.covariance, cameras)
    others = rivals(list(made.faces))
    if others and not made.wall_named:
        deviations["relief_offset"] = max(abs(face.offset) for face in others)
    used = problem.tie_used
    sigma_tie = robust_sigma(solution.tie_misfit[used]) if used.any() else problem.sigma_pick
    words = set_up_words(cameras, deviations, sigma_px=max(sigma_tie, 0.05))
    tie1, tie2, relief = _ties(made, cameras)
    return Alignment(
        pair=pair,
        way=way,
        deviations=deviations,
        control_ids=problem.control.ids,
        control_residuals=solution.control_residuals,
        control_used=problem.pick_used,
        control_test=solution.control_test,
        tie1=tie1[used],
        tie2=tie2[used],
        tie_relief=relief[used],
        wall=problem.wall[used],
        setup=_diagnostics(made, cameras, deviations, way, assumed, words, sigma_tie),
        words=words,
        remarks=tuple(remarks),
    )


def _in_facade_axes(
    cameras: tuple[Pinhole, Pinhole],
    photo: PhotoInput,
    direction: tuple[FloatArray, bool] | None,
) -> tuple[tuple[Pinhole, Pinhole], str]:
    """Return cameras in axes along the façade, origin in the far nadir, and what they rest on."""
    far = cameras[0]
    if direction is not None:
        pixels, vertical = direction
        ends = Photo(
            plane_from_pixel=plane_from_pixel(far), nadir=far.centre[:2], distance=far.centre[2]
        ).plane_from_pixels(photo.interior.ideal(pixels))
        along = ends[1] - ends[0]
        angle = float(np.arctan2(along[1], along[0])) - (np.pi / 2 if vertical else 0.0)
        turn = (angle + np.pi / 2) % np.pi - np.pi / 2
        note = f"{'Y' if vertical else 'X'} axis along the line given"
    else:
        turn, share = (
            (0.0, 0.0) if photo.grey is None else facade_turn(photo.grey, far, photo.interior)
        )
        note = "axes along the façade's straight lines"
        if share < 0.25:
            turn, note = 0.0, "Y axis as upright as the far photo"
    return (turned(far, turn, far.centre[:2]), turned(cameras[1], turn, far.centre[:2])), note


def _lens_of(interior: Interior, k: float) -> Lens | None:
    """Return the lens the pair's pixels need: the file's, or the estimated radial one."""
    if interior.lens is not None or k == 0:
        return interior.lens
    # r_u = r_d / (1 + k r_d²) turned round: r_d / r_u as an even polynomial of r_u.
    reach = np.hypot(*interior.image_size) / 2 / interior.focal
    seen = np.linspace(0, reach, 200)[1:]
    ideal = seen / (1 + k * seen**2)
    powers = np.stack([ideal**2, ideal**4, ideal**6], axis=1)
    terms = np.linalg.lstsq(powers * ideal[:, None], seen - ideal, rcond=None)[0]
    matrix = np.diag([interior.focal, interior.focal, 1.0])
    matrix[:2, 2] = interior.centre
    return Lens(
        camera_matrix=matrix,
        coefficients=np.array([terms[0], terms[1], 0.0, 0.0, terms[2]]),
        image_size=interior.image_size,
        source="estimated from the pair's common points",
    )


def _photo(camera: Pinhole, interior: Interior, lens: Lens | None) -> Photo:
    extra: dict[str, Any] = {}
    if interior.pixel_size is not None:
        extra["principal_distance"] = camera.matrix[0, 0] * interior.pixel_size
        extra["pixel_size"] = interior.pixel_size
    return Photo(
        plane_from_pixel=plane_from_pixel(camera),
        nadir=camera.centre[:2],
        distance=float(camera.centre[2]),
        lens=lens,
        extra=extra,
    )


def _deviations(covariance: FloatArray, cameras: tuple[Pinhole, Pinhole]) -> dict[str, float]:
    """Return standard deviations of what a surveyor asks for."""
    sigma = np.sqrt(np.diag(covariance))
    out: dict[str, float] = {}
    for number, camera in enumerate(cameras, start=1):
        at = PER_CAMERA * (number - 1)
        out[f"distance{number}"] = float(sigma[at + 9])
        out[f"nadir{number}"] = float(np.hypot(sigma[at + 7], sigma[at + 8]) / np.sqrt(2))
        out[f"focal{number}"] = float(sigma[at] * camera.matrix[0, 0])
        out[f"tilt{number}_deg"] = float(
            np.rad2deg(np.hypot(sigma[at + 4], sigma[at + 5]) / np.sqrt(2))
        )
    # Relative scale of the photos on the wall: ln f2 - ln d2 - ln f1 + ln d1.
    row = np.zeros(len(covariance))
    row[[0, PER_CAMERA]] = -1.0, 1.0
    row[9], row[PER_CAMERA + 9] = 1 / cameras[0].centre[2], -1 / cameras[1].centre[2]
    out["scale"] = float(np.sqrt(np.abs(row @ covariance @ row)))
    # Relief is displacement over distance from the centre of zoom, divided by 1/d2 - 1/d1.
    d1, d2 = (float(camera.centre[2]) for camera in cameras)
    row = np.zeros(len(covariance))
    row[9], row[PER_CAMERA + 9] = 1 / d1**2, -1 / d2**2
    out["relief_scale"] = float(np.sqrt(np.abs(row @ covariance @ row)) / abs(1 / d2 - 1 / d1))
    return out


def _ties(
    made: SetUp, cameras: tuple[Pinhole, Pinhole]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the ties as raw pixels, and their relief."""
    problem = made.problem
    straight = [
        radial_shift(x, i, k)
        for x, i, k in zip(
            (problem.tie1, problem.tie2), problem.interiors, made.solution.radial, strict=True
        )
    ]
    relief = triangulate(*cameras, *straight)[:, 2] if len(problem.tie1) else np.zeros(0)
    first, second = problem.interiors
    return raw_pixels(first, problem.tie1), raw_pixels(second, problem.tie2), relief


def _diagnostics(
    made: SetUp,
    cameras: tuple[Pinhole, Pinhole],
    deviations: Mapping[str, float],
    way: str,
    assumed: list[str],
    words: tuple[str, ...],
    sigma_tie: float,
) -> dict[str, Any]:
    """Return the free diagnostics of the pair file."""
    problem, solution = made.problem, made.solution
    control = problem.control
    out: dict[str, Any] = {
        "way": way,
        "standard_deviations": dict(deviations),
        "sigma0": solution.sigma0,
        "focal_px": [float(camera.matrix[0, 0]) for camera in cameras],
        "principal_point_px": [camera.matrix[:2, 2] for camera in cameras],
        "interior": [interior.source for interior in problem.interiors],
        "common_points": {
            "count": int(problem.tie_used.sum()),
            "on_wall": int((problem.wall & problem.tie_used).sum()),
            "sigma_px": sigma_tie,
        },
        "planes": [
            {"offset": face.offset, "share": face.share, "pixel": list(face.pixel)}
            for face in made.faces
        ],
        "assumed": assumed,
        "words": list(words),
    }
    if control.ids:
        out["control"] = [
            {
                "id": name,
                "residual_px": solution.control_residuals[index],
                "test": solution.control_test[index],
                "used": bool(problem.pick_used[index]),
            }
            for index, name in enumerate(control.ids)
        ]
        seen = Photo(
            plane_from_pixel=plane_from_pixel(cameras[0]),
            nadir=cameras[0].centre[:2],
            distance=float(cameras[0].centre[2]),
        ).plane_from_pixels(control.pixels1)
        out["control_positions"] = seen
    return out


def with_files(
    alignment: Alignment, names: tuple[str, str], lenses: tuple[str | None, str | None]
) -> Alignment:
    """Return the alignment with photo and lens files named, relative to the pair file."""
    photos = [
        replace(photo, file=name, extra={**photo.extra, **({"lens": lens} if lens else {})})
        for photo, name, lens in zip(
            (alignment.pair.image1, alignment.pair.image2), names, lenses, strict=True
        )
    ]
    setup = {key: value for key, value in alignment.setup.items() if key != "control_positions"}
    pair = replace(alignment.pair, image1=photos[0], image2=photos[1], extra={"setup": setup})
    return replace(alignment, pair=pair)
