"""A pair's orientation in sentences a surveyor acts on: what is off, its effect, what was done."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

import numpy as np

from bifocal import rays
from bifocal.model import Cameras, PairMedia
from bifocal.precision import base_factor
from bifocal.remarks import remark
from photocore.camera import Pinhole
from photocore.remarks import Remark


def orientation_in_words(
    cameras: Cameras,
    deviations: dict[str, float],
    *,
    sigma_px: float,
    media: PairMedia | None = None,
    fits: bool = True,
) -> tuple[Remark, ...]:
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
        remark(
            "orientation.stations", d1=d1, d2=d2, sigma1=_mm(deviations["distance1"]),
            sigma2=_mm(deviations["distance2"]), apart=d1 - d2,
        ),
        _offset(far, near),
        *(_turn(name, camera) for name, camera in (("far", far), ("near", near))),
        *_roll(far, near),
        *_scale(scales[1] / scales[0], base, deviations.get("scale", 0.0)),
    ]  # fmt: skip
    if fits:
        words.append(_zone(d1, pixel, base, sigma_px, deviations.get("relief_scale", 0.0)))
    # Other planes compete for the wall: all relief may be off by one amount.
    if offset := deviations.get("relief_offset"):
        words.append(remark("orientation.plane_unsure", offset=1000 * offset))
    return tuple(words)


def _mm(value: float) -> str:
    return f"{1000 * value:.0f} mm" if value < 1 else f"{value:.1f} m"


def _cm(value: float) -> str:
    """Return a length in centimetres, from a metre on in metres."""
    return f"{abs(value):.2f} m" if abs(value) >= 0.995 else f"{abs(100 * value):.0f} cm"


def _offset(far: Pinhole, near: Pinhole) -> Remark:
    """Say how the near camera stands beside the far one's axis."""
    shift = near.centre[:2] - far.centre[:2]
    sides = ("left", "right"), ("low", "high")
    parts = [
        remark(f"orientation.too_{side[value > 0]}", by=_cm(value))
        for value, side in zip(shift.tolist(), sides, strict=True)
        if abs(value) >= 0.005
    ]
    if not parts:
        return remark("orientation.one_axis")
    centre = rays.zoom_centre(_foot(far), _foot(near)) - far.centre[:2]
    about = dict(zip(("off", "up"), parts, strict=False))
    key = "orientation.off_axis" + ("_both" if len(parts) > 1 else "")
    return remark(key, moved=_cm(float(np.linalg.norm(centre))), **about)


def _turn(name: str, camera: Pinhole) -> Remark:
    """Say how a camera is turned away from the wall's normal."""
    total = float(np.rad2deg(np.arccos(np.clip(-camera.rotation[2, 2], -1, 1))))
    if total < 0.05:
        return remark(f"orientation.{name}_square")
    digits = 1 if total >= 0.2 else 2  # the greater part is at least 0.7 of the whole: it shows
    sides = ("to the left", "to the right"), ("down", "up")
    parts = [
        (f"{abs(value):.{digits}f}", side[value > 0])
        for value, side in zip(np.rad2deg(np.arctan(camera.tilt)).tolist(), sides, strict=True)
        if abs(value) >= 0.5 * 10.0**-digits
    ]
    about = dict(zip(("off", "side", "up", "way"), chain.from_iterable(parts), strict=False))
    key = f"orientation.{name}_tilted" + ("_both" if len(parts) > 1 else "")
    return remark(key, total=f"{total:.{digits}f}", **about)


def _roll(far: Pinhole, near: Pinhole) -> Iterator[Remark]:
    """Say how much the photos are turned against each other in their own plane."""
    angles = [np.arctan2(c.rotation[0, 1], c.rotation[0, 0]) for c in (far, near)]
    turn = float(np.rad2deg((angles[1] - angles[0] + np.pi) % (2 * np.pi) - np.pi))
    if abs(turn) >= 0.05:
        side = "clockwise" if turn > 0 else "counter-clockwise"
        yield remark("orientation.turned_photo", angle=abs(turn), side=side)


def _scale(ratio: float, base: float, sigma: float) -> Iterator[Remark]:
    """Say how far the photos are from one scale, where that is more than its own uncertainty."""
    off = ratio - 1.0
    if abs(off) < max(2 * sigma, 1e-4):
        return
    if abs(off) < 0.05:
        yield remark("orientation.scales_differ", off=100 * off, relief=1000 * abs(off) * base)
        return
    bigger = "larger" if ratio > 1 else "smaller"
    yield remark(f"orientation.scale_{bigger}", times=max(ratio, 1 / ratio))


def _zone(d1: float, pixel: float, base: float, sigma_px: float, relief_scale: float) -> Remark:
    """Say what precision to expect where, for pixels of a size on the wall. [m]"""
    sigma_m, at = sigma_px * pixel, 0.25 * d1
    about: dict[str, object] = {"sigma": sigma_px, "good": 1000 * sigma_m * base / at, "at": at}
    about["radius"] = _cm(sigma_m * base / 0.01)
    if relief_scale < 5e-5:
        return remark("orientation.zone", **about)
    # All relief is too large or too small by one factor: what the distances leave open.
    about |= {"more": 1000 * relief_scale, "share": 100 * relief_scale}
    return remark("orientation.zone_scaled", **about)


def _foot(camera: Pinhole) -> rays.Foot:
    return rays.Foot(camera.centre[:2], float(camera.centre[2]))
