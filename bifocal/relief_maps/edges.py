"""Steps of relief made sharp: near an edge a pixel belongs to the upper or to the lower surface.

Flow runs as a ramp from one surface to the other. Both surfaces are known beside the ramp, so the
question is only which pixel is whose: the photos answer it, smoothed along the image's own edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.relief_maps.frame import Frame, offsets, parallax_per_metre, zoom_map
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeTuning:
    """Steps sharpened."""

    #: Half width of a ramp. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.17 / -0.67, plaster facade +2.11 / -1.24,
    #: church +0.44 / +0.08.
    reach: int = 9
    #: Steps of less parallax are left as measured. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.24 / +0.88, church -0.04 / +0.35.
    least_step: float = 0.5
    #: Nor are steps of less than this many times the precision of matching touched: they are its
    #: noise.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.35, plaster facade -1.17 / +2.80,
    #: church +0.00 / +0.21.
    noise_steps: float = 4.0
    #: Differences of grey value and of its gradient beyond these count alike. [grey levels]
    #: Evidence: façades 81 / 83, beyond 3 cm: 1.28 / 2.33 % with 20 and 14, 1.13 / 2.15 with 12 and
    #: 8, 1.08 / 2.07 with 9 and 6, 1.13 / 2.07 with 7 and 4.5, 1.78 / 2.24 with 5 and 3.
    limits: tuple[float, float] = (9.0, 6.0)
    #: The same where matching is imprecise: there the photos differ by more than relief. [grey
    #: levels]
    #: Evidence: church_1, beyond 10 cm: 9.1 %, with `limits` 10.1.
    imprecise_limits: tuple[float, float] = (12.0, 8.0)
    #: Share of the grey value in the cost; the rest is its gradient's.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.21 / -0.07, plaster facade +0.20 / -0.15,
    #: church +0.06 / +0.25.
    grey_share: float = 0.4
    #: Half window of the guided filter (He et al. 2013). [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.56, plaster facade +0.00 / +0.74,
    #: church +0.00 / +0.40.
    window: int = 3
    #: Regularisation of the guided filter. [grey levels²]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.03 / +0.05, plaster facade +0.00 / -0.03,
    #: church -0.02 / +0.00.
    softness: float = 50.0
    #: By how much the upper surface must fit better than the lower one. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.16 / +0.34, plaster facade +0.03 / +0.06,
    #: church -0.24 / +0.64.
    margin: float = 0.25
    #: By how much more where relief rises outwards: photo 1 sees the step's side face there and its
    #: pixels are nobody's. [grey levels]
    #: Evidence: façade 11: raised parts were too fat in two thirds of the errors at steps.
    margin_rising: float = 1.5
    #: Steps of less parallax fit nearly as well on both sides: their margin is less in proportion.
    #: [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.42 / -0.37, plaster facade +0.34 / -0.04,
    #: church +0.63 / -0.53.
    wide_step: float = 4.0
    #: Plain parts cannot tell: margin and ramps fade out below this contrast. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.05 / +0.10, plaster facade +0.06 / +0.01,
    #: church +0.04 / -0.01.
    contrast: float = 8.0
    #: Side of the window of that contrast. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.04 / -0.06, plaster facade +0.23 / -0.11,
    #: church +0.08 / +0.02.
    contrast_window: int = 15
    #: What the measured value is favoured by. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.07 / +0.08, plaster facade -0.06 / +0.28,
    #: church -0.03 / +0.06.
    favour: float = 0.05
    #: What a ramp is held back by: it fits by what flow bent and stands on no surface. [grey
    #: levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.20 / -0.12, church +0.10 / +0.14.
    ramp: float = 0.6
    #: A measured value that rises or falls by so much parallax a pixel is a ramp. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.06 / +0.13, church -0.01 / +0.03.
    ramp_slope: float = 0.3
    #: Matching is imprecise from this on, and precise up to half of it; where it is imprecise
    #: slopes are noise and no ramps. [px]
    #: Evidence: façade 84, poor texture, beyond 3 cm: 13.4 %, with ramps 14.4.
    imprecise: float = 0.25


EDGES = EdgeTuning()


def sharpen(
    frame: Frame, relief: Float32Array, swept: BoolArray | np.bool, typical: float = 0.0
) -> tuple[Float32Array, Float32Array]:
    """Return the relief of photo 1 with ramps at steps replaced by one of the two surfaces.

    And how badly the photos fit each other at the relief that was measured. [grey levels]

    Parameters
    ----------
    frame : Frame
    relief : ndarray of float32, shape (height, width)
        Measured relief. [m]
    swept : ndarray of bool
        Pixels whose relief a sweep found: they are left alone.
    typical : float
        Precision of matching, typical of the frame. [px]
    """
    median = cv2.medianBlur(relief, 5)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * EDGES.reach + 1, 2 * EDGES.reach + 1))
    upper, lower = cv2.dilate(median, disc), cv2.erode(median, disc)
    per_relief = parallax_per_metre(frame)
    parallax = (upper - lower) * per_relief
    band = ~swept & (parallax > max(EDGES.least_step, EDGES.noise_steps * typical))
    result = relief.copy()
    fit = PhotoFit(frame, typical)
    misfits = [fit.misfit(candidate) for candidate in (relief, upper, lower)]
    misfit_kept, high, low = (fit.smooth(misfit) for misfit in misfits)
    precise = precision(typical)
    textured = textured_share(frame)
    misfit_kept += np.float32(precise) * textured * _ramp(median, per_relief) - np.float32(
        EDGES.favour
    )
    margin = (
        textured * _margin(frame, median) * np.clip(parallax / np.float32(EDGES.wide_step), 0, 1)
    )
    up = band & (high + margin <= low) & (high + margin < misfit_kept)
    down = band & (low - margin < misfit_kept) & (low < high + margin)
    np.copyto(result, upper, where=up)
    np.copyto(result, lower, where=down)
    return result, misfits[0]


def precision(sigma_px: float) -> float:
    """Return how far matching of this precision [px] is precise, 0 to 1."""
    return float(np.clip(2 - 2 * sigma_px / EDGES.imprecise, 0, 1))


def _ramp(median: Float32Array, per_relief: Float32Array) -> Float32Array:
    """Return how much worse a measured value must count, the steeper it runs. [grey levels]"""
    smooth = cv2.blur(median, (3, 3))
    across = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    down = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    steepness = np.sqrt(across * across + down * down) * per_relief
    return np.asarray(
        np.float32(EDGES.ramp) * np.minimum(steepness / np.float32(EDGES.ramp_slope), 1)
    )


def _margin(frame: Frame, median: Float32Array) -> Float32Array:
    """Return by how much the upper surface must fit better than the lower one. [grey levels]"""
    blurred = cv2.blur(median, (9, 9))
    across = cv2.Sobel(blurred, cv2.CV_32F, 1, 0, ksize=3)
    down = cv2.Sobel(blurred, cv2.CV_32F, 0, 1, ksize=3)
    x, y = offsets(frame.grid.shape, frame.grid.pixel_of(frame.foot(1).nadir))
    steepest = np.sqrt((across * across + down * down) * (x * x + y * y)) + np.float32(1e-9)
    rising = np.clip((across * x + down * y) / steepest, 0, 1)
    return np.asarray(
        np.float32(EDGES.margin) + np.float32(EDGES.margin_rising) * rising, dtype=np.float32
    )


def textured_share(frame: Frame) -> Float32Array:
    """Return how far photo 1 has the contrast to tell surfaces by, 0 to 1."""
    grey = frame.image1.astype(np.float32)
    side = (EDGES.contrast_window, EDGES.contrast_window)
    mean = cv2.blur(grey, side)
    spread = np.sqrt(np.maximum(cv2.blur(grey * grey, side) - mean * mean, 0))
    return np.asarray(np.clip(spread / np.float32(EDGES.contrast) - np.float32(0.25), 0, 1))


class PhotoFit:
    """How badly photo 2 fits photo 1 at reliefs, pixel by pixel and averaged between edges.

    Parameters
    ----------
    frame : Frame
    typical : float
        Precision of matching, typical of the frame. [px]
    """

    def __init__(self, frame: Frame, typical: float) -> None:
        self.frame = frame
        precise = precision(typical)
        limits = precise * np.array(EDGES.limits) + (1 - precise) * np.array(EDGES.imprecise_limits)
        self.most_grey, self.most_gradient = limits.astype(np.float32)
        self.far, self.near = _features(frame.image1), _features(frame.image2)
        self.image = self.far[..., 0]
        self.mean = _blur(self.image)
        self.spread = _blur(self.image * self.image) - self.mean * self.mean + EDGES.softness

    def misfit(self, relief: Float32Array) -> Float32Array:
        """Return how badly photo 2 fits photo 1 at a relief. [grey levels]"""
        columns, rows = zoom_map(self.frame, relief)
        mode = cv2.BORDER_REPLICATE
        moved = cv2.remap(self.near, columns, rows, cv2.INTER_LINEAR, borderMode=mode)
        off = cv2.absdiff(moved, self.far)
        total = off[..., 1] + off[..., 2]
        np.minimum(total, self.most_gradient, out=total)
        grey = np.minimum(off[..., 0], self.most_grey)
        grey *= np.float32(EDGES.grey_share)
        total += grey
        return total

    def smooth(self, values: Float32Array) -> Float32Array:
        """Return values averaged within a window, but not across edges of photo 1."""
        mean = _blur(values)
        slope = _blur(self.image * values)
        slope -= self.mean * mean
        slope /= self.spread
        mean -= slope * self.mean
        result = _blur(slope)
        result *= self.image
        result += _blur(mean)
        return result


def _features(image: np.ndarray) -> Float32Array:
    """Return grey value and both derivatives, shape (height, width, 3)."""
    grey = image.astype(np.float32)
    across = cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=3, scale=0.25)
    down = cv2.Sobel(image, cv2.CV_32F, 0, 1, ksize=3, scale=0.25)
    return np.asarray(cv2.merge([grey, across, down]))


def _blur(values: np.ndarray) -> Float32Array:
    side = 2 * EDGES.window + 1
    return np.asarray(cv2.blur(values, (side, side)))
