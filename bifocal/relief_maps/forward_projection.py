"""From the pixels of photo 1 to the pixels of the relief map, nearer surfaces over farther ones."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.rays import Foot, magnification, reduction
from bifocal.relief_maps.frame import Frame, offsets, values_at, zoom_map
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray

#: A relief agrees with the pixel it came from to this. [m], relative to d1
AGREEMENT = 4e-4
#: A ramp that stretches the wall by more than this is flow running over a hidden strip.
STRETCH = 1.3
#: Steps outwards when a hidden strip is filled; 2**LEAPS steps of LEAP pixels are the most.
LEAP, LEAPS = 3, 7
#: Relief hidden or interpolated farther than this from measured one must be surrounded by it. [px]
FRINGE_HIDDEN, FRINGE_INTERPOLATED = 24.0, 100.0
#: Holes are filled from their nearest neighbour up to this depth. [px]
DEEPEST_HOLE = 30.0


class MapBands(NamedTuple):
    """Bands of a relief map in the making."""

    r: Float32Array
    sigma: Float32Array
    quality: ByteArray


def ramps(frame: Frame, relief: Float32Array) -> BoolArray:
    """Return pixels of photo 1 on ramps that no camera can have seen as a surface.

    With s1 the radius about the nadir of photo 1, ``ds'/ds1 = 1 - r/d1 - (s1/d1) dr/ds1`` is how
    much wall one pixel covers; on a true surface it is near one.
    """
    foot = frame.pair.image1.foot
    x, y = offsets(frame.grid.shape, frame.grid.pixel_of(foot.nadir))
    across = cv2.Sobel(relief, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    down = cv2.Sobel(relief, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    # d s'/d s of s' = s (1 - r / d), Eq. (1).
    stretch = reduction(relief + across * x + down * y, np.float32(foot.distance))
    return np.asarray(stretch > STRETCH)


def to_plane(frame: Frame, source: MapBands, usable: BoolArray, grid: Grid) -> MapBands:
    """Return the relief map on a grid of the plane.

    Parameters
    ----------
    frame : Frame
    source : MapBands
        Bands in the frame of photo 1.
    usable : ndarray of bool
        Pixels that may be used.
    grid : Grid
        Of the relief map.
    """
    foot = frame.pair.image1.foot
    relief = np.where(usable, source.r, np.float32(np.nan))
    first = _scatter(frame, relief, grid, foot)
    known = np.isfinite(first)
    around = np.ones((5, 5), dtype=np.uint8)
    upper = cv2.dilate(np.where(known, first, np.float32(-1e3)), around)
    lower = cv2.erode(np.where(known, first, np.float32(1e3)), around)
    unknown = np.full(grid.shape, np.float32(np.nan))
    result = MapBands(unknown, unknown.copy(), np.zeros(grid.shape, dtype=np.uint8))
    for start in (upper, first, lower):
        start = np.where(np.abs(start) < 999, start, np.float32(np.nan))
        _gather(frame, source, relief, grid, foot, start, result)
    return result


def _scatter(frame: Frame, relief: Float32Array, grid: Grid, foot: Foot) -> Float32Array:
    """Drop every pixel of photo 1 where it stands on the plane; the highest wins."""
    x, y = offsets(frame.grid.shape, frame.grid.pixel_of(foot.nadir))
    share = reduction(relief, np.float32(foot.distance))  # Eq. (1): s' = s - e = s (1 - r / d)
    ratio = frame.grid.gsd / grid.gsd
    nadir = grid.pixel_of(foot.nadir)
    with np.errstate(invalid="ignore"):
        column = x * share * np.float32(ratio) + np.float32(nadir[0] + 0.5)
        row = y * share * np.float32(ratio) + np.float32(nadir[1] + 0.5)
        inside = (column >= 0) & (column < grid.width) & (row >= 0) & (row < grid.height)
    index = row[inside].astype(np.int32) * np.int64(grid.width) + column[inside].astype(np.int32)
    return _highest(relief[inside], index, np.full(grid.shape, np.nan, dtype=np.float32))


def _highest(relief: Float32Array, index: IntArray, result: Float32Array) -> Float32Array:
    """Return an image with values put at flat indices, the highest where several fall."""
    if relief.size:
        low, high = float(relief.min()), float(relief.max())
        # A radix sort of 16-bit levels: later writes win, so the highest comes last.
        level = ((relief - low) * (65535 / max(high - low, 1e-9))).astype(np.uint16)
        order = np.argsort(level, kind="stable")
        result.ravel()[index[order]] = relief[order]
    return result


def _gather(
    frame: Frame,
    source: MapBands,
    relief: Float32Array,
    grid: Grid,
    foot: Foot,
    start: Float32Array,
    result: MapBands,
) -> None:
    """Look up, where nothing is known yet, the surface that a first value leads to (in place).

    Eq. (1), s = s' d / (d - r), with the r it is meant to find: a fixed point.
    """
    todo = np.isfinite(start) & ~np.isfinite(result.r)
    row, column = np.nonzero(todo)
    if not len(row):
        return
    places = np.stack([grid.columns_x[column], grid.rows_y[row]], axis=-1)
    away = ((places - foot.nadir) / [frame.grid.gsd, -frame.grid.gsd]).astype(np.float32)
    nadir = frame.grid.pixel_of(foot.nadir).astype(np.float32)
    value = start[row, column]
    steps = []
    for _ in range(3):
        q = nadir + away * magnification(value, foot.distance)[:, None]
        value = values_at(relief, q, cv2.INTER_NEAREST)
        steps.append(value)
    value, final = steps[1:]
    tolerance = AGREEMENT * foot.distance
    with np.errstate(invalid="ignore"):
        good = np.abs(final - value) < tolerance
        smooth = values_at(relief, q, cv2.INTER_LINEAR)
        final = np.where(np.abs(smooth - final) < tolerance, smooth, final)
    row, column, q, final = row[good], column[good], q[good], final[good]
    result.r[row, column] = final
    result.sigma[row, column] = values_at(source.sigma, q, cv2.INTER_NEAREST)
    result.quality[row, column] = values_at(source.quality, q, cv2.INTER_NEAREST)


def fill_outwards(bands: MapBands, holes: BoolArray, grid: Grid, nadir: FloatArray) -> BoolArray:
    """Fill holes from the next known pixel farther out (in place); return which were filled.

    Behind a step lies the lower surface, and it goes on outwards: the nearest pixel would smear
    the step itself over what it hides.
    """
    height, width = bands.r.shape
    row, column = np.nonzero(holes)
    if not len(row):
        return np.zeros_like(holes)
    centre = grid.pixel_of(nadir)
    dx, dy = column - centre[0], row - centre[1]
    length = np.maximum(np.hypot(dx, dy), 1e-9)
    number = np.full(height * width, -1, dtype=np.int64)
    number[row * width + column] = np.arange(len(row))
    to_column = np.clip(np.rint(column + LEAP * dx / length).astype(np.int64), 0, width - 1)
    to_row = np.clip(np.rint(row + LEAP * dy / length).astype(np.int64), 0, height - 1)
    target = to_row * width + to_column
    for _ in range(LEAPS):  # each round doubles the leap of those that are still in a hole
        hop = number[target]
        target = np.where(hop >= 0, target[np.maximum(hop, 0)], target)
    good = np.isfinite(bands.r.ravel()[target]) & (number[target] < 0)
    filled = np.zeros_like(holes)
    filled[row[good], column[good]] = True
    _fill(bands, filled, target[good], 3, Quality.HIDDEN)
    return filled


def _fill(
    bands: MapBands, holes: BoolArray, source: IntArray, factor: float, quality: Quality
) -> None:
    """Fill holes, in order of rows, from flat indices; their sigma grows (in place)."""
    bands.r[holes] = bands.r.ravel()[source]
    bands.sigma[holes] = factor * bands.sigma.ravel()[source]
    bands.quality[holes] = quality


def hidden_in_second(frame: Frame, relief: Float32Array, step: Float32Array) -> BoolArray:
    """Return pixels of photo 1 that a higher surface covers in photo 2.

    Parameters
    ----------
    frame : Frame
    relief : ndarray of float32
        Relief of the pixels of photo 1. [m]
    step : ndarray of float32, broadcastable
        How much higher the covering surface must be. [m]
    """
    columns, rows = zoom_map(frame, relief)
    height, width = relief.shape
    with np.errstate(invalid="ignore"):
        column, row = np.rint(columns).astype(np.int32), np.rint(rows).astype(np.int32)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    # What falls outside goes to a cell of its own behind the last one.
    index = np.where(inside, row.astype(np.int64) * width + column, height * width).ravel()
    top = _highest(relief.ravel(), index, np.full(relief.size + 1, np.float32(-1e3)))
    cracked = top[:-1].reshape(height, width)
    covering = cv2.morphologyEx(cracked, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    above = covering.ravel().take(index, mode="clip").reshape(height, width)
    return np.asarray(inside & (above > relief + step))


def fill_small(bands: MapBands, holes: BoolArray) -> None:
    """Fill what is left of holes from the nearest known pixel, a few pixels deep (in place)."""
    if not holes.any():
        return
    unknown = ~np.isfinite(bands.r)
    distance, label = cv2.distanceTransformWithLabels(
        unknown.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    fill = holes & unknown & (distance <= DEEPEST_HOLE)
    known = np.flatnonzero(~unknown)
    if not len(known) or not fill.any():
        return
    source_of_label = np.zeros(int(label.max()) + 1, dtype=np.int64)
    source_of_label[label.ravel()[known]] = known
    _fill(bands, fill, source_of_label[label[fill]], 5, Quality.INTERPOLATED)


def forget_outside(bands: MapBands) -> None:
    """Make unknown what measured relief does not surround, but for a fringe (in place).

    Beyond the outermost thing both photos saw, a filled relief has nothing to lean on.
    """
    measured = (bands.quality == Quality.MEASURED) & np.isfinite(bands.r)
    grains = np.ones((3, 3), np.uint8)
    solid = cv2.morphologyEx(measured.astype(np.uint8), cv2.MORPH_OPEN, grains)
    distance = cv2.distanceTransform(1 - solid, cv2.DIST_L2, 3)
    away = distance > FRINGE_HIDDEN
    number, label = cv2.connectedComponents(away.astype(np.uint8), connectivity=4)
    outer = np.zeros(number, dtype=bool)
    for side in (label[0], label[-1], label[:, 0], label[:, -1]):
        outer[side] = True
    outer[0] = False  # near measured relief
    far = (bands.quality == Quality.HIDDEN) | (distance > FRINGE_INTERPOLATED)
    lost = outer[label] & far
    bands.r[lost] = bands.sigma[lost] = np.nan
    bands.quality[lost] = Quality.UNKNOWN
