"""From an oriented pair to a pair file: axes, photos, lens files, standard deviations, words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal import rays
from bifocal.model import (
    CAMERA,
    MISFITS,
    NAMES,
    Cameras,
    Diagnostics,
    Interior,
    Lens,
    Pair,
    PairMedia,
    Photo,
    WallZone,
    apply_homography,
    doubts_of,
    moved,
    stated_by_photo,
)
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.adjustment.pair_observations import PairObservations, at
from bifocal.orientation.facade_lines import facade_rotation
from bifocal.orientation.media_report import media_in_words
from bifocal.orientation.orientation_report import orientation_in_words
from bifocal.orientation.orientation_stages import OrientedPair, PhotoInput, Photos
from bifocal.orientation.tie_coverage import tie_statistics
from bifocal.orientation.tie_points import tie_positions
from bifocal.orientation.tuning import LINES
from bifocal.orientation.walls.reference_plane import zero_sigma
from bifocal.remarks import remark
from photocore.adjustment.outliers import robust_sigma
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, RadialDivision, camera_matrix, plane_from_pixel
from photocore.remarks import alarms_in


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alignment:
    """A pair oriented, with what stands behind it.

    Attributes
    ----------
    pair : Pair
    way : str
        ``control``, ``site``, ``auto`` or ``as set up``.
    deviations : mapping of str to float
        Standard deviations: ``distance1`` ... [m], ``focal1`` ... [px], ``scale`` (relative).
    control_ids : tuple of str
    control_positions : ndarray, shape (n, 2)
        Where the far photo shows them on the plane. [m]
    control_residuals : ndarray, shape (n, 4)
        Observed minus computed column 1, row 1, column 2, row 2; NaN where not picked. [px]
    control_used : ndarray of bool, shape (n,)
    control_test : ndarray, shape (n,)
        Each point's misfit over its standard deviation.
    tie1, tie2 : ndarray, shape (m, 2)
        Homologous points found automatically, raw pixels. [px]
    wall : ndarray of bool, shape (m,)
        Which of them lie on the wall.
    setup : mapping
        Diagnostics for the pair file.
    words : tuple of str
        The set-up in sentences.
    remarks : tuple of str
        What the user should be warned of.
    exchanged : bool
        Whether the photos were given the other way round.
    """

    pair: Pair
    way: str
    deviations: Mapping[str, float]
    control_ids: tuple[str, ...]
    control_positions: FloatArray
    control_residuals: FloatArray
    control_used: BoolArray
    control_test: FloatArray
    tie1: FloatArray
    tie2: FloatArray
    wall: BoolArray
    setup: Diagnostics
    words: tuple[str, ...]
    remarks: tuple[str, ...] = ()
    exchanged: bool = False


def make_alignment(
    oriented: OrientedPair,
    photos: Photos,
    *,
    way: str,
    direction: tuple[FloatArray, bool] | None = None,
) -> Alignment:
    """Return the pair of adjusted cameras with its diagnostics; photo files are not yet named.

    Parameters
    ----------
    oriented : OrientedPair
    photos : pair of PhotoInput
        Far one first, as in ``oriented``.
    way : str
        ``control``, ``site``, ``auto`` or ``as set up``.
    direction : (pixels (2, 2), is_vertical), optional
        Two points of photo 1 on a level or upright line of the wall, where the frame is free.
    """
    observations, adjusted = oriented.observations, oriented.adjusted
    cameras = adjusted.cameras
    covariance = _of_pixels(adjusted, observations)
    if observations.free_datum:
        axes, note = facade_axes(cameras[0], photos[0], direction)
        origin = cameras[0].centre * [1.0, 1.0, 0.0]
        cameras = cameras[0].moved(axes, origin), cameras[1].moved(axes, origin)
        covariance = moved(covariance, axes)
        oriented = replace(oriented, assumed=(*oriented.assumed, note))
    far, near = (
        photo_of(camera, interior, lens_of(interior, radial), (adjusted.media, number))
        for number, (camera, interior, radial) in enumerate(
            zip(cameras, observations.interiors, adjusted.radial, strict=True)
        )
    )
    deviations = standard_deviations(adjusted)
    if (offset := zero_sigma(oriented.faces)) and not oriented.wall_named:
        deviations["relief_offset"] = offset
    if oriented.aside is not None:
        ends = apply_homography(plane_from_pixel(cameras[0]), oriented.aside)
        deviations = aside(deviations, *np.abs(ends[1:] - ends[0]).max(axis=0).tolist())
    used = observations.tie_used
    sigma_tie = robust_sigma(adjusted.tie_misfit[used]) if used.any() else observations.sigma_pick
    words: tuple[str, ...] = orientation_in_words(
        cameras, deviations, sigma_px=max(sigma_tie, 0.05), media=adjusted.media,
        fits=not doubts_of(MISFITS, oriented.remarks),
    )  # fmt: skip
    words += media_in_words(adjusted, observations.media)
    first, second = observations.interiors
    return Alignment(
        pair=Pair(image1=far, image2=near, orientation=covariance),
        way=way,
        deviations=deviations,
        control_ids=observations.control.ids,
        control_positions=rays.object_rays(
            apply_homography(far.plane_from_pixel, observations.control.pixels1), far.foot
        ).position,
        control_residuals=adjusted.control_residuals,
        control_used=observations.pick_used,
        control_test=adjusted.control_test,
        tie1=first.raw(observations.tie1[used]),
        tie2=second.raw(observations.tie2[used]),
        wall=observations.wall[used],
        setup=_diagnostics(oriented, cameras, deviations, way, words, sigma_tie),
        words=words,
        remarks=oriented.remarks,
        exchanged=oriented.exchanged,
    )


def _of_pixels(adjusted: AdjustedPair, observations: PairObservations) -> FloatArray:
    """Return the covariance of the cameras as the pair file counts it, shape (24, 24)."""
    unit = np.ones(len(adjusted.covariance))
    for number, factors in enumerate(radial_units(adjusted.cameras, observations.interiors)):
        first = number * len(CAMERA) + CAMERA.index("k1")
        unit[first : first + 2] = factors
    return adjusted.covariance * np.outer(unit, unit)


def radial_units(cameras: Sequence[Pinhole], interiors: Sequence[Interior]) -> FloatArray:
    """Return what k1 and k2 of each photo are multiplied by for its file, shape (m, 2).

    The distortion's radius counts in principal distances: there of the camera as adjusted.
    """
    both = zip(cameras, interiors, strict=True)
    ratios = np.array([(camera.matrix[0, 0] / interior.focal) ** 2 for camera, interior in both])
    return np.column_stack([ratios, ratios**2])


def _radial(adjusted: AdjustedPair, observations: PairObservations) -> FloatArray | None:
    """Return k1 and k2 of either photo as the covariance counts them; None where not estimated."""
    if not any(interior.sigma_radial for interior in observations.interiors):
        return None
    return np.asarray(adjusted.radial * radial_units(adjusted.cameras, observations.interiors))


def facade_axes(
    far: Pinhole, photo: PhotoInput, direction: tuple[FloatArray, bool] | None
) -> tuple[FloatArray, str]:
    """Return axes along the façade, shape (3, 3), and what they rest on."""
    if direction is not None:
        pixels, vertical = direction
        ends = apply_homography(plane_from_pixel(far), photo.interior.ideal(pixels))
        along = ends[1] - ends[0]
        angle = float(np.arctan2(along[1], along[0])) - (np.pi / 2 if vertical else 0.0)
        turn = (angle + np.pi / 2) % np.pi - np.pi / 2
        note = remark(f"orientation.axis_{'y' if vertical else 'x'}_along_line")
    else:
        turn, share = (
            (0.0, 0.0) if photo.grey is None else facade_rotation(photo.grey, far, photo.interior)
        )
        note = remark("orientation.axes_along_facade")
        if share < LINES.least_in_line:
            turn, note = 0.0, remark("orientation.axis_as_photo")
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]]), note


def lens_of(interior: Interior, radial: FloatArray) -> Lens | None:
    """Return the lens the pair's pixels need: the file's, or the estimated radial one."""
    if interior.lens is not None or not radial.any():
        return interior.lens
    # r_u = r_d / (1 + k1 r_d² + k2 r_d⁴) turned round: r_d / r_u as an even polynomial of r_u.
    reach = np.hypot(*interior.image_size) / 2 / interior.focal
    distorted = np.linspace(0, reach, 200)[1:]
    along = np.column_stack([distorted, np.zeros_like(distorted)])
    ideal = RadialDivision(radial[0], np.zeros(2), 1.0, radial[1]).undistort(along)[:, 0]
    powers = np.stack([ideal**2, ideal**4, ideal**6], axis=1)
    terms = np.linalg.lstsq(powers * ideal[:, None], distorted - ideal, rcond=None)[0]
    return Lens(
        camera_matrix=camera_matrix(interior.focal, 1.0, *interior.centre),
        coefficients=np.array([terms[0], terms[1], 0.0, 0.0, terms[2]]),
        image_size=interior.image_size,
        source=remark("orientation.estimated_lens"),
    )


def photo_of(
    camera: Pinhole, interior: Interior, lens: Lens | None, seen: tuple[PairMedia, int]
) -> Photo:
    """Return the photo of a camera; ``seen`` are the media and which of their cameras it is."""
    pitch = interior.pixel_size
    media, number = seen
    return Photo(
        plane_from_pixel=plane_from_pixel(camera),
        nadir=camera.centre[:2],
        distance=float(camera.centre[2]),
        lens=lens,
        image_size=interior.image_size,
        principal_distance=None if pitch is None else float(camera.matrix[0, 0]) * pitch,
        pixel_size=pitch,
        **stated_by_photo(media, number, camera),
    )


def standard_deviations(adjusted: AdjustedPair) -> dict[str, float]:
    """Return standard deviations of what a surveyor asks for."""
    size = len(NAMES)
    out = deviations_of(adjusted.cameras, adjusted.covariance[:size, :size], adjusted.media)
    if adjusted.of_unknowns.size:
        for row, name in enumerate(adjusted.media.sigmas, start=size):
            out[name] = float(np.sqrt(adjusted.of_unknowns[row, row]))
    return out


def deviations_of(cameras: Cameras, covariance: FloatArray, media: PairMedia) -> dict[str, float]:
    """Return standard deviations of what a surveyor asks for, from the covariance (24, 24)."""
    out: dict[str, float] = {}
    # Of the relative scale of the photos on the wall, ln f2 - ln d2 - ln f1 + ln d1, and of
    # 1/d2 - 1/d1, which relief is divided by.
    by_scale, by_relief = np.zeros(len(NAMES)), np.zeros(len(NAMES))
    sigmas = np.sqrt(np.diag(covariance))
    for number, (camera, sign) in enumerate(zip(cameras, (-1.0, 1.0), strict=True), start=1):
        places = [at(name, number) for name in ("X", "Y", "turn X", "turn Y")]
        out[f"distance{number}"] = float(sigmas[at("Z", number)])
        out[f"nadir{number}"] = float(np.hypot(*sigmas[places[:2]]) / np.sqrt(2))
        out[f"focal{number}"] = float(sigmas[at("focal length", number)] * camera.matrix[0, 0])
        out[f"tilt{number}_deg"] = float(np.rad2deg(np.hypot(*sigmas[places[2:]]) / np.sqrt(2)))
        by_scale[at("focal length", number)] = sign
        straight, rate = media.near_axis(number - 1, camera)
        by_scale[at("Z", number)] = -sign * rate / straight
        by_relief[at("Z", number)] = -sign * rate / straight**2
    d1, d2 = (media.near_axis(k, camera)[0] for k, camera in enumerate(cameras))
    variances = (abs(float(row @ covariance @ row)) for row in (by_scale, by_relief))
    scale, relief = map(np.sqrt, variances)
    return out | {"scale": float(scale), "relief_scale": float(relief / abs(1 / d2 - 1 / d1))}


def aside(deviations: Mapping[str, float], x: float, y: float) -> dict[str, float]:
    """Return deviations of a pair whose near camera may stand a period of the wall aside. [m]"""
    nadir = float(np.hypot(deviations["nadir2"], np.hypot(x, y)))
    return {**deviations, "aside_x": x, "aside_y": y, "nadir2": nadir}


def _diagnostics(
    oriented: OrientedPair,
    cameras: Cameras,
    deviations: Mapping[str, float],
    way: str,
    words: tuple[str, ...],
    sigma_tie: float,
) -> Diagnostics:
    """Return the free diagnostics of the pair file."""
    observations, adjusted = oriented.observations, oriented.adjusted
    control = observations.control
    out: Diagnostics = {
        "way": way,
        "standard_deviations": dict(deviations),
        "sigma0": adjusted.sigma0,
        "focal_px": [float(camera.matrix[0, 0]) for camera in cameras],
        "principal_point_px": [camera.matrix[:2, 2] for camera in cameras],
        "interior": [interior.source for interior in observations.interiors],
        "common_points": {
            "count": int(observations.tie_used.sum()),
            "on_wall": int((observations.wall & observations.tie_used).sum()),
            "sigma_px": sigma_tie,
            **tie_statistics(observations, adjusted),
        },
        "radial": _radial(adjusted, observations),
        "planes": [
            {"offset": face.offset, "share": face.share, "pixel": list(face.pixel)}
            for face in oriented.faces
        ],
        "facade_lines": [
            {
                "camera": line.camera,
                "name": line.name,
                "count": line.count,
                "out_of_wall_deg": float(
                    np.rad2deg(line.in_frame(adjusted.cameras[line.camera - 1])[2])
                ),
            }
            for line in observations.lines
        ],
        "wall_bend_px": oriented.shape.px if np.isfinite(oriented.shape.px) else None,
        "wall_bend_sigma_px": oriented.shape.sigma if np.isfinite(oriented.shape.px) else None,
        "focal_given_px": [interior.focal for interior in observations.interiors],
        "doubts": alarms_in(oriented.remarks),
        "wall_relief_mm": wall_relief(oriented),
        "assumed": oriented.assumed,
        "words": list(words),
    }
    if control.ids:
        out["control"] = [
            {
                "id": name,
                "residual_px": adjusted.control_residuals[index],
                "test": adjusted.control_test[index],
                "used": bool(observations.pick_used[index]),
            }
            for index, name in enumerate(control.ids)
        ]
    spreads = control.sigma_lengths or (None,) * len(control.lengths)
    out["lengths"] = [
        {"from": control.ids[a], "to": control.ids[b], "length": length, "sigma": sigma}
        for (a, b, length), sigma in zip(control.lengths, spreads, strict=True)
    ]
    return out


def wall_relief(oriented: OrientedPair) -> list[WallZone]:
    """Return the relief of the wall's own points by zone of the far photo.

    Nine zones; those with fewer than five points of the wall are left out. [mm]
    """
    observations = oriented.observations
    wall = observations.wall & observations.tie_used
    if not wall.any():
        return []
    height = 1000 * tie_positions(observations, oriented.adjusted)[wall, 2]
    size = np.array(observations.interiors[0].image_size)
    place = np.clip(observations.interiors[0].raw(observations.tie1[wall]) * 3 // size, 0, 2)
    out: list[WallZone] = []
    for row, line in enumerate(("top", "middle", "bottom")):
        for column, side in enumerate(("left", "centre", "right")):
            inside = height[(place[:, 0] == column) & (place[:, 1] == row)]
            if len(inside) >= 5:
                spread = 1.4826 * float(np.median(np.abs(inside - np.median(inside))))
                out.append(
                    WallZone(
                        zone=f"{line} {side}",
                        points=len(inside),
                        median=float(np.median(inside)),
                        spread=spread,
                    )
                )
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
    pair = replace(
        alignment.pair,
        image1=photos[0],
        image2=photos[1],
        extra={**alignment.pair.extra, "setup": alignment.setup},
    )
    return replace(alignment, pair=pair)
