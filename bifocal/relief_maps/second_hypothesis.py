"""A second hypothesis of relief where optical flow is not sure: a plane sweep, tile by tile.

Railings, handrails and grilles are narrower than their own parallax: flow from coarse to fine finds
what is behind them. Where the sweep fits better, and fits nothing else in photo 2, it is believed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from bifocal.model.image import QUIET_BLUR
from bifocal.relief_maps import coarse_level, evidence, forward_projection, plane_sweep
from bifocal.relief_maps.flow import Measurement, is_inside, sigma_of_relief
from bifocal.relief_maps.frame import Frame, parallax_per_metre, zoom_map
from bifocal.relief_maps.plane_sweep import Box, Hypotheses, Swept
from bifocal.relief_maps.tuning import HYPOTHESIS
from photocore.arrays import BoolArray, Float32Array


def with_swept(frame: Frame, matched: Measurement) -> tuple[Measurement, BoolArray]:
    """Return a measurement with the relief of a sweep where that fits better, and where it does.

    Notes
    -----
    Of two pixels that a relief shows at one place of photo 2 the one that fits worse is hidden
    there. Plain walls are swept in photos blurred like those of their flow.
    """
    valid = _valid(frame, matched)
    photos = frame
    if matched.plain:
        first, second = (
            cv2.GaussianBlur(image, (0, 0), QUIET_BLUR) for image in (frame.image1, frame.image2)
        )
        photos = replace(frame, image1=first, image2=second)
    found = _swept(photos, matched.r, valid)
    known = np.isfinite(found.relief)
    if not known.any():
        return matched, known
    relief = np.where(known, found.relief, matched.r)
    parallax = parallax_per_metre(frame)
    other = known & (np.abs(relief - matched.r) * parallax > HYPOTHESIS.differs)
    other &= _alone_in_second(frame, relief, found.cost, parallax) & is_inside(frame, relief)
    own, new = (
        cv2.blur(plane_sweep.misfit(photos, np.nan_to_num(values)), (3, 3))
        for values in (matched.r, relief)
    )
    better = np.where(valid, np.float32(HYPOTHESIS.better), np.float32(HYPOTHESIS.better_invalid))
    taken = _large(other & (new + better < own))
    swept = {"r": relief, "loop": 0, "across": 0, "sigma_px": HYPOTHESIS.sigma}
    bands: dict[str, Any] = {
        name: np.where(taken, np.float32(new), getattr(matched, name))
        for name, new in swept.items()
    }
    return replace(matched, **bands), taken


def _valid(frame: Frame, matched: Measurement) -> BoolArray:
    """Return which pixels flow validates."""
    sigma = sigma_of_relief(frame, matched.r, matched.sigma_px)
    return evidence.validated(matched.across, matched.loop, sigma, frame.distances[1])


def _large(mask: BoolArray) -> BoolArray:
    """Return a mask without small parts."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    keep = stats[:, cv2.CC_STAT_AREA] >= HYPOTHESIS.least_area
    keep[0] = False
    return np.asarray(keep[label])


def _alone_in_second(
    frame: Frame, relief: Float32Array, cost: Float32Array, parallax: Float32Array
) -> BoolArray:
    """Return which pixels fit best of all that their relief shows at their place of photo 2."""
    columns, rows = zoom_map(frame, relief)
    height, width = relief.shape
    with np.errstate(invalid="ignore"):
        column, row = np.rint(columns), np.rint(rows)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        inside &= np.isfinite(cost)
    index = (row[inside] * width + column[inside]).astype(np.int64)
    best = np.full(relief.size, -np.inf, np.float32)
    forward_projection.highest(-cost[inside], index, best)
    first = best[index] == -cost[inside]
    there = np.full(relief.size, np.nan, np.float32)
    there[index[first]] = relief[inside][first]
    alone = np.zeros(relief.shape, bool)
    alone[inside] = np.abs(there[index] - relief[inside]) * parallax[inside] < HYPOTHESIS.alone
    return alone


def _swept(frame: Frame, relief: Float32Array, valid: BoolArray) -> Swept:
    """Return what a sweep finds in the tiles that are not sure; NaN and infinite cost elsewhere.

    First at half the resolution, of all reliefs around a tile; then of what that, or flow, found.
    """
    support, unsure = evidence.supported(valid), frame.seen1 & ~valid
    half = coarse_level.halved(frame)
    height, width = half.grid.shape
    small = np.s_[: 2 * height : 2, : 2 * width : 2]
    guess = _nothing(half)
    ranges = _ranges(relief[small], support[small])
    for box, (low, high) in zip(*_tiles(unsure[small], ranges), strict=True):
        _sweep(guess, half, box, lambda wide: Hypotheses.between(half, wide, low, high))  # noqa: B023
    found = _nothing(frame)

    def near(wide: Box) -> Hypotheses:
        halves = tuple(slice(part.start // 2, part.stop // 2) for part in wide)
        values = guess.relief[halves]
        values = np.concatenate([values[np.isfinite(values)], relief[wide][support[wide]][::4]])
        return Hypotheses.near(frame, wide, values)

    for box in _tiles(unsure)[0]:
        _sweep(found, frame, box, near)
    return found


def _nothing(frame: Frame) -> Swept:
    nothing = np.full(frame.grid.shape, np.nan, np.float32)
    return Swept(nothing, np.full_like(nothing, np.inf))


def _sweep(
    found: Swept, frame: Frame, box: Box, hypotheses: Callable[[Box], Hypotheses]
) -> None:  # fmt: skip
    """Sweep a tile, with what is around it (in place)."""
    margin = HYPOTHESIS.margin
    wide: Any = tuple(
        slice(max(part.start - margin, 0), min(part.stop + margin, length))
        for part, length in zip(box, frame.grid.shape, strict=True)
    )
    tried = hypotheses(wide)
    if len(tried.numbers) > HYPOTHESIS.flat:
        inner = tuple(
            slice(part.start - around.start, part.stop - around.start)
            for part, around in zip(box, wide, strict=True)
        )
        tile = plane_sweep.swept(frame, wide, tried)
        found.relief[box], found.cost[box] = (band[inner] for band in tile)


def _tiles(
    unsure: BoolArray, ranges: tuple[Float32Array, Float32Array] | None = None
) -> tuple[list[Box], list[tuple[float, float]]]:
    """Return the tiles of which enough is unsure, and the ranges of relief around them. [m]"""
    side, boxes, limits = HYPOTHESIS.tile, [], []
    height, width = unsure.shape
    for i, j in np.ndindex(-(-height // side), -(-width // side)):
        low, high = (0.0, 1.0) if ranges is None else (float(band[i, j]) for band in ranges)
        box = np.s_[i * side : min((i + 1) * side, height), j * side : min((j + 1) * side, width)]
        if low < high and unsure[box].mean() > HYPOTHESIS.unsure:
            boxes.append(box)
            limits.append((low, high))
    return boxes, limits


def _ranges(relief: Float32Array, support: BoolArray) -> tuple[Float32Array, Float32Array]:
    """Return the least and greatest relief around every tile, and beyond. [m]"""
    height, width = relief.shape
    side = HYPOTHESIS.tile
    size = (-(-height // side), -(-width // side))
    low, high = np.full(size, np.inf, np.float32), np.full(size, -np.inf, np.float32)
    for i, j in np.ndindex(size):
        part = np.s_[i * side : (i + 1) * side, j * side : (j + 1) * side]
        values = relief[part][support[part]]
        if len(values) > HYPOTHESIS.fewest:
            low[i, j], high[i, j] = np.percentile(values, HYPOTHESIS.outliers)
    around = np.ones((HYPOTHESIS.around, HYPOTHESIS.around), np.uint8)
    beyond = np.float32(HYPOTHESIS.beyond)
    return cv2.erode(low, around) - beyond, cv2.dilate(high, around) + beyond
