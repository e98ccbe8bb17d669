"""Noise taken out of relief, and steps of a map that run straight."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model.relief_map import Quality
from bifocal.relief_maps import edges, flow
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame
from photocore.arrays import BoolArray, Float32Array
from photocore.shrinkage import WINDOWS, shrink_noise


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothingTuning:
    """Noise taken out of relief."""

    #: Limits of the error across the radius that counts as noise rather than as an edge, else what
    #: is typical of the frame. [px]
    #: Evidence: façade 83, 35/28, beyond 3 cm: 2.44 to 2.15 %; a fixed 0.25 px took small steps for
    #: noise.
    noise_clip: tuple[float, float] = (0.05, 0.25)
    #: Share of the error across the radius that smoothing takes for noise where matching is
    #: precise: the rest stems from edges within its window, or is wider than the windows. Of
    #: imprecise matching it is all.
    #: Evidence: façade 83, 35/28, beyond 3 cm: 1.93 to 1.89 %, loggia 94 1.19 to 1.15, 35/19 as
    #: before; façade 84, poor texture: 13.3 %, with 0.7 13.5.
    noise_share: float = 0.85
    #: Half windows of relief that photos of twice the resolution refined: those of their pixels.
    #: [px]
    #: Evidence: façade 83, fast, beyond 3 cm: 4.1 to 3.8 %.
    refined_windows: tuple[int, int] = (4, 9)
    #: Height from which a step of the map is tidied. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.01 / -0.04, plaster facade -0.02 / +0.04,
    #: church +0.01 / +0.01.
    least_step: float = 0.02
    #: What is narrower is a thin thing, of which a median of 5 x 5 px leaves little. [px]
    thin: int = 9
    #: It stands out by more than this. [m]
    stands_out: float = 0.1
    #: Medians more at steps that were not measured.
    repeats: int = 5


SMOOTHING = SmoothingTuning()


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
    of wrong pixels from 2.05 to 1.91 % and made hidden pixels found right 76 instead of 67 %. Where
    a step was not measured it is repeated: there teeth are the matcher's.
    """
    straight, thin = _straighter(bands.r)
    filled = np.where(np.isfinite(bands.r), bands.r, np.float32(0))
    straight = np.where(thin, cv2.medianBlur(filled, 3), straight)
    made_up = bands.quality != Quality.MEASURED
    for _ in range(SMOOTHING.repeats):
        again, thin = _straighter(straight)
        straight = np.where(made_up & ~thin, again, straight)
    return bands._replace(r=straight)


def _straighter(relief: Float32Array) -> tuple[Float32Array, BoolArray]:
    """Return relief with a 5 x 5 median at steps, and thin things, of which it leaves little."""
    filled = np.where(np.isfinite(relief), relief, np.float32(0))
    step = steps(relief, 5)
    body = cv2.morphologyEx(filled, cv2.MORPH_OPEN, np.ones((SMOOTHING.thin,) * 2, np.uint8))
    thin = step & (filled - body > SMOOTHING.stands_out)
    return np.where(step, cv2.medianBlur(filled, 5), relief), thin


def steps(relief: Float32Array, side: int = 3) -> BoolArray:
    """Return which pixels have a step, and nothing unknown, within a window."""
    unknown = ~np.isfinite(relief)
    filled = np.where(unknown, np.float32(0), relief)
    around = np.ones((side, side), dtype=np.uint8)
    step = cv2.dilate(filled, around) - cv2.erode(filled, around) > SMOOTHING.least_step
    return np.asarray(step & (cv2.dilate(unknown.astype(np.uint8), around) == 0))
