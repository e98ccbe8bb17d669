"""A coarse first relief: zoom photo 2 by every hypothesis, correlate, smooth along eight paths.

Optical flow follows parallaxes of some ten pixels by itself. Porches two metres deep, oblique
photos and repeated courses of stone need a first value; this one comes from a few hundred pixels
across.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal import rays
from bifocal.relief_maps.frame import Frame, offsets, shown_at
from photocore.arrays import BoolArray, ByteArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedTuning:
    """The first relief."""

    #: Width or height at which the sweep works; more brings little, costs squarely. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.07 / +0.34, plaster facade +0.70 / -1.86,
    #: church -0.33 / +0.14.
    coarse_side: int = 420
    #: The same in `fast`. [px]
    #: Evidence: façades 71 and 83, fast: the same beyond 3 cm from 300 and 420 px.
    fast_side: int = 300
    #: Deepest relief tried, as a share of d2: porches go deeper than cornices stand out.
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / -0.01, plaster facade +0.77 / +0.30,
    #: church -0.18 / -0.14.
    deepest: float = -0.36
    #: Highest relief tried, as a share of d2.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.06 / +0.02, plaster facade -1.31 / +0.53,
    #: church -0.20 / -0.15.
    highest: float = 0.22
    #: Steps per coarse pixel of parallax at the far corner. [1/px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.15 / +0.00, plaster facade +0.02 / -0.54,
    #: church -0.00 / +0.01.
    steps_per_pixel: float = 1.0
    #: The most hypotheses.
    most_steps: int = 128
    #: Grey values this weak are noise: they do not correlate. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.02 / +0.07, plaster facade -0.16 / -0.41,
    #: church -0.09 / +0.13.
    noise: float = 2.0
    #: Cost of a hypothesis that falls outside photo 2, between a good (0) and a bad match (1).
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / +0.01, plaster facade +0.23 / -0.68,
    #: church -0.03 / -0.16.
    outside: float = 0.45
    #: Penalty of the smoothing for one step.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.02 / -0.01, plaster facade -0.02 / -0.22,
    #: church +0.09 / -0.04.
    one_step: float = 0.06
    #: Penalty of the smoothing for any jump.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.08 / +0.01, plaster facade +0.73 / -0.83,
    #: church -0.00 / -0.06.
    jump: float = 0.55


SEED = SeedTuning()


def coarse_relief(
    frame: Frame,
    relief_range: tuple[float, float] | None = None,
    *,
    side: int = SEED.coarse_side,
) -> tuple[Float32Array, int]:
    """Return a first relief of the pixels of photo 1 on a coarser grid, and its factor. [m]

    Parameters
    ----------
    frame : Frame
    relief_range : tuple of float, optional
        Least and greatest relief tried; by default -36 % to 22 % of d2. [m]
    side : int
        Width or height at which to work. [px]

    Notes
    -----
    Hypotheses are uniform in parallax, r / (d2 - r) - r / (d1 - r), not in r. The matching cost is
    1 - ZNCC over two window sizes; semi-global matching (Hirschmueller 2008) on eight paths.
    """
    factor = max(1, round(max(frame.grid.shape) / side))
    size = (frame.grid.width // factor, frame.grid.height // factor)
    if min(size) < 16:
        factor, size = 1, (frame.grid.width, frame.grid.height)

    def shrink(image: ByteArray) -> Float32Array:
        blurred = cv2.resize(
            image[: size[1] * factor, : size[0] * factor], size, interpolation=cv2.INTER_AREA
        )
        return np.asarray(blurred, dtype=np.float32)

    far, near = shrink(frame.image1), shrink(frame.image2)
    inside = shrink(frame.seen2.astype(np.uint8) * 255) > 250
    outside = shrink(frame.seen1.astype(np.uint8) * 255) < 250
    centre = (frame.centre + 0.5) / factor - 0.5
    relief = hypotheses(frame, size, centre, relief_range)
    cost = _cost_volume(far, near, inside, frame, relief, centre)
    cost[outside] = SEED.outside
    best = _semi_global(cost, far)
    coarse = relief[best].astype(np.float32)
    return np.asarray(cv2.medianBlur(coarse, 5)), factor


def usual_range(d2: float) -> tuple[float, float]:
    """Return the least and the greatest relief tried where none are given. [m]"""
    return SEED.deepest * d2, SEED.highest * d2


def hypotheses(
    frame: Frame,
    size: tuple[int, int],
    centre: np.ndarray,
    relief_range: tuple[float, float] | None,
) -> np.ndarray:
    """Return relief values that are uniform in parallax, from low to high, shape (n,). [m]"""
    d1, d2 = frame.distances
    low, high = relief_range or usual_range(d2)
    zoom = rays.zoom_factor(np.array([low, high]), d1=d1, d2=d2)
    corners = np.array([[0, 0], [size[0], 0], [0, size[1]], size]) - centre
    reach = float(np.hypot(*corners.T).max())
    count = int(np.clip((zoom[1] - zoom[0]) * reach * SEED.steps_per_pixel, 8, SEED.most_steps))
    return rays.relief_from_zoom(np.linspace(zoom[0], zoom[1], count), d1=d1, d2=d2)


def _cost_volume(
    far: Float32Array,
    near: Float32Array,
    inside: BoolArray,
    frame: Frame,
    relief: np.ndarray,
    centre: np.ndarray,
) -> Float32Array:
    """Return 1 - ZNCC of every pixel and hypothesis, 0..1, shape (height, width, n)."""
    d1, d2 = frame.distances
    height, width = far.shape
    x, y = np.broadcast_arrays(*offsets((height, width), centre))
    cost = np.empty((height, width, len(relief)), dtype=np.float32)
    windows = (5, 11)
    moments = {n: _moments(far, n) for n in windows}
    content = inside.astype(np.float32)
    for i, zoom in enumerate(rays.zoom_factor(relief, d1=d1, d2=d2).astype(np.float32)):
        maps = (zoom * x + np.float32(centre[0]), zoom * y + np.float32(centre[1]))
        if frame.pair.refracted:
            maps = _coarse_map(frame, (height, width), float(relief[i]))
        moved = cv2.remap(near, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        overlap = cv2.remap(content, *maps, cv2.INTER_LINEAR, borderValue=0.0)
        score = np.zeros_like(far)
        for n in windows:
            mean, variance = moments[n]
            mean2, variance2 = _moments(moved, n)
            shared = cv2.blur(far * moved, (n, n)) - mean * mean2
            score += (
                0.5 * shared / np.sqrt((variance + SEED.noise**2) * (variance2 + SEED.noise**2))
            )
        cost[..., i] = np.where(overlap > 0.99, np.clip(1 - score, 0, 1), SEED.outside)
    return cost


def _coarse_map(
    frame: Frame, shape: tuple[int, int], relief: float
) -> tuple[Float32Array, Float32Array]:
    """Return where photo 2 shows coarse pixels of photo 1 through media, in coarse pixels."""
    factor = np.float32(frame.grid.width // shape[1])
    x, y = offsets(shape)
    column, row = ((axis + np.float32(0.5)) * factor - np.float32(0.5) for axis in (x, y))
    moved = shown_at(frame, column, row, np.float32(relief))
    column, row = ((axis + np.float32(0.5)) / factor - np.float32(0.5) for axis in moved)
    return column, row


def _moments(image: Float32Array, n: int) -> tuple[Float32Array, Float32Array]:
    """Return local mean and variance in an n x n window."""
    mean = cv2.blur(image, (n, n))
    return mean, np.maximum(cv2.blur(image * image, (n, n)) - mean * mean, 0)


def _semi_global(cost: Float32Array, image: Float32Array) -> np.ndarray:
    """Return the best hypothesis per pixel after smoothing along eight paths."""
    total = np.zeros_like(cost)
    for down, across in ((0, 1), (1, 0), (1, 1), (1, -1)):
        for reverse in (False, True):
            _add_path(cost, image, total, down, across, reverse=reverse)
    return np.asarray(total.argmin(-1))


def _add_path(
    cost: Float32Array,
    image: Float32Array,
    total: Float32Array,
    down: int,
    across: int,
    *,
    reverse: bool,
) -> None:
    """Add the smoothed cost of one path direction to the total."""
    if down == 0:  # along rows: the same as along columns of the transposed volume
        cost, image, total = (a.swapaxes(0, 1) for a in (cost, image, total))
        across = 0
    if reverse:
        cost, image, total = cost[::-1], image[::-1], total[::-1]
    before = np.ascontiguousarray(cost[0])
    total[0] += before
    for row in range(1, len(cost)):
        shifted, neighbour = before, image[row - 1]
        if across:
            shifted, neighbour = np.roll(before, across, axis=0), np.roll(neighbour, across)
            edge = 0 if across > 0 else -1
            shifted[edge] = 0.0
        least = shifted.min(1, keepdims=True)
        step = np.abs(image[row] - neighbour)[:, None]
        jump = least + SEED.jump / (1 + step / 12)
        best = np.minimum(shifted, jump)
        np.minimum(best[:, 1:], shifted[:, :-1] + SEED.one_step, out=best[:, 1:])
        np.minimum(best[:, :-1], shifted[:, 1:] + SEED.one_step, out=best[:, :-1])
        before = cost[row] + best - least
        total[row] += before
