"""A pair's orientation in sentences a surveyor acts on: what is off, its effect, what was done."""

from __future__ import annotations

import numpy as np

from bifocal import rays
from bifocal.model.interior_orientation import Cameras
from bifocal.model.pair_media import PairMedia
from bifocal.precision import base_factor
from photocore.camera.pinhole import Pinhole


def orientation_in_words(
    cameras: Cameras,
    deviations: dict[str, float],
    *,
    sigma_px: float,
    media: PairMedia | None = None,
    fits: bool = True,
) -> tuple[str, ...]:
    """Return the orientation in sentences.

    Parameters
    ----------
    cameras : pair of Pinhole
        Far and near camera.
    deviations : dict
        Standard deviations of ``distance1``, ``distance2`` [m], ``scale`` and ``relief_scale``
        (relative); ``relief_offset`` if another plane may be the wall [m].
    sigma_px : float
        Expected precision of a homologous point, for the precision of relief. [px]
    media : PairMedia, optional
        What lies between cameras and wall.
    fits : bool
        Whether the model does; else nothing is said of how good relief is.
    """
    (far, near), media = cameras, media or PairMedia.none()
    d1, d2 = float(far.centre[2]), float(near.centre[2])
    # Near the axis; in air the distances themselves.
    straight1, straight2 = (
        media.near_axis(number, camera)[0] for number, camera in enumerate(cameras)
    )
    base = base_factor(d1=straight1, d2=straight2)
    bent = media.layers.indices[0] / media.layers.indices[-1]
    scales = far.matrix[0, 0] / straight1, near.matrix[0, 0] / straight2
    pixel = max(straight1 / far.matrix[0, 0], straight2 / near.matrix[0, 0]) * bent
    words = [
        f"Far camera {d1:.3f} m ± {_mm(deviations['distance1'])}, near camera {d2:.3f} m ± "
        f"{_mm(deviations['distance2'])} from the wall; {d1 - d2:.3f} m apart in depth.",
        _offset(far, near),
        *(_turn(name, camera) for name, camera in (("Far", far), ("Near", near))),
        _roll(far, near),
        _scale(scales[1] / scales[0], base, deviations.get("scale", 0.0)),
        _zone(d1, pixel, base, sigma_px, deviations.get("relief_scale", 0.0)) if fits else "",
        _plane(deviations.get("relief_offset", 0.0)),
    ]
    return tuple(word for word in words if word)


def _mm(value: float) -> str:
    return f"{1000 * value:.0f} mm" if value < 1 else f"{value:.1f} m"


def _cm(value: float) -> str:
    """Return a length in centimetres, from a metre on in metres."""
    return f"{abs(value):.2f} m" if abs(value) >= 0.995 else f"{abs(100 * value):.0f} cm"


def _offset(far: Pinhole, near: Pinhole) -> str:
    """Say how the near camera stands beside the far one's axis."""
    shift = near.centre[:2] - far.centre[:2]
    sides = [("right", "left"), ("high", "low")]
    parts = [
        f"{_cm(value)} too far {side[int(value < 0)]}"
        if axis == 0
        else f"{_cm(value)} too {side[int(value < 0)]}"
        for axis, (value, side) in enumerate(zip(shift, sides, strict=True))
        if abs(value) >= 0.005
    ]
    if not parts:
        return "Both cameras stand on one axis to within 5 mm."
    centre = rays.zoom_centre(_foot(far), _foot(near)) - far.centre[:2]
    moved = _cm(float(np.linalg.norm(centre)))
    return (
        f"The near camera stands {' and '.join(parts)} of the far camera's axis; relief therefore "
        f"spreads from a point {moved} from the far nadir (taken into account)."
    )


def _turn(name: str, camera: Pinhole) -> str:
    """Say how a camera is turned away from the wall's normal."""
    right, up = np.rad2deg(np.arctan(camera.tilt))
    total = float(np.rad2deg(np.arccos(np.clip(-camera.rotation[2, 2], -1, 1))))
    if total < 0.05:
        return f"{name} camera square to the wall."
    digits = 1 if total >= 0.2 else 2  # the greater part is at least 0.7 of the whole: it shows
    parts = [
        f"{abs(value):.{digits}f}° {words[int(value < 0)]}"
        for value, words in ((right, ("to the right", "to the left")), (up, ("up", "down")))
        if abs(value) >= 0.5 * 10.0**-digits
    ]
    return (
        f"{name} camera tilted {total:.{digits}f}°: it looks {' and '.join(parts)} (corrected by "
        "the homography)."
    )


def _roll(far: Pinhole, near: Pinhole) -> str:
    """Say how much the photos are turned against each other in their own plane."""
    angles = [np.arctan2(c.rotation[0, 1], c.rotation[0, 0]) for c in (far, near)]
    turn = float(np.rad2deg((angles[1] - angles[0] + np.pi) % (2 * np.pi) - np.pi))
    if abs(turn) < 0.05:
        return ""
    side = "clockwise" if turn > 0 else "counter-clockwise"
    return f"The near photo is turned {abs(turn):.1f}° {side} against the far one (corrected)."


def _scale(ratio: float, base: float, sigma: float) -> str:
    """Say how far the photos are from one scale, where that is more than its own uncertainty."""
    off = ratio - 1.0
    if abs(off) < max(2 * sigma, 1e-4):
        return ""
    if abs(off) < 0.05:
        return (
            f"The scales differ by {100 * off:+.2f} % (would read as {1000 * abs(off) * base:.0f} "
            "mm of relief; corrected)."
        )
    bigger = "larger" if ratio > 1 else "smaller"
    shown = ratio if ratio > 1 else 1 / ratio
    return (
        f"The near photo's scale is {shown:.2f} times {bigger} than the far one's (corrected; the "
        "coarser photo limits the precision)."
    )


def _zone(d1: float, pixel: float, base: float, sigma_px: float, relief_scale: float) -> str:
    """Say what precision to expect where, for pixels of a size on the wall. [m]"""
    sigma_m = sigma_px * pixel
    radius = sigma_m * base / 0.01
    at = 0.25 * d1
    # All relief is too large or too small by one factor: what the distances leave open.
    share = (
        f", plus {1000 * relief_scale:.2g} mm for every metre of relief ({100 * relief_scale:.2g} "
        "%: the distances are known no better)"
        if relief_scale >= 5e-5
        else ""
    )
    return (
        f"With {sigma_px:.2g} px per point, relief is good to {1000 * sigma_m * base / at:.1f} mm "
        f"at {at:.1f} m from the centre of zoom{share}; within {_cm(radius)} of it worse "
        "than 1 cm (area of uncertainty)."
    )


def _plane(offset: float) -> str:
    """Say that all relief may be off by one amount, if another plane may be the wall."""
    if not offset:
        return ""
    return (
        f"All relief counts from the plane taken for the wall: its zero is certain only to "
        f"{1000 * offset:.0f} mm, because other planes compete (see the warning); sigma_r counts "
        "it."
    )


def _foot(camera: Pinhole) -> rays.Foot:
    return rays.Foot(camera.centre[:2], float(camera.centre[2]))
