"""Noise taken out of relief, and steps of a map that run straight."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.relief_maps import edges, flow
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame
from bifocal.relief_maps.tuning import SMOOTHING
from photocore.arrays import BoolArray, Float32Array
from photocore.shrinkage import WINDOWS, shrink_noise


def without_noise(
    frame: Frame, relief: Float32Array, matched: flow.Measurement, typical: float,
    half: Frame | None,
) -> Float32Array:  # fmt: skip
    """Return the relief of photo 1 without noise; plain walls, `half` given, are left alone."""
    if half is not None:
        return relief
    precise = edges.precision(typical)
    share = precise * SMOOTHING.noise_share + (1 - precise)
    quiet = np.float32(share) * np.minimum(
        matched.sigma_px, np.float32(np.clip(typical, *SMOOTHING.noise_clip))
    )
    windows = SMOOTHING.refined_windows if matched.refined else WINDOWS
    return shrink_noise(relief, flow.sigma_of_relief(frame, relief, quiet), windows)


def straightened(bands: MapBands) -> MapBands:
    """Return a relief map whose steps run straight: a 5 x 5 median there, nothing elsewhere.

    Single pixels on the wrong side of a step cast shadows of their own; the median took the share
    of wrong pixels from 2.05 to 1.91 % and made hidden pixels found right 76 instead of 67 %.
    """
    filled = np.where(np.isfinite(bands.r), bands.r, np.float32(0))
    step = steps(bands.r, 5)
    straight = np.where(step, cv2.medianBlur(filled, 5), bands.r)
    # Of thin things a median of 5 x 5 leaves little.
    body = cv2.morphologyEx(filled, cv2.MORPH_OPEN, np.ones((SMOOTHING.thin,) * 2, np.uint8))
    thin = step & (filled - body > SMOOTHING.stands_out)
    straight = np.where(thin, cv2.medianBlur(filled, 3), straight)
    return bands._replace(r=straight)


def steps(relief: Float32Array, side: int = 3) -> BoolArray:
    """Return which pixels have a step, and nothing unknown, within a window."""
    unknown = ~np.isfinite(relief)
    filled = np.where(unknown, np.float32(0), relief)
    around = np.ones((side, side), dtype=np.uint8)
    step = cv2.dilate(filled, around) - cv2.erode(filled, around) > SMOOTHING.least_step
    return np.asarray(step & (cv2.dilate(unknown.astype(np.uint8), around) == 0))
