"""From the pixels of photo 1 to the pixels of the relief map, nearer surfaces over farther ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.ray_field import RayField
from bifocal.model.relief_map import Quality
from bifocal.rays import Foot, magnification, reduction
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.frame import Frame, offsets, values_at, zoom_map
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class ProjectionTuning:
    """Pixels of photo 1 put on the map."""

    #: A relief agrees with the pixel it came from to this share of d1.
    #: Evidence: half / twice, beyond 3 cm [%]: facade -0.01 / +0.08, plaster facade -0.05 / +0.04,
    #: church +0.01 / +0.02.
    agreement: float = 0.0004
    #: A ramp that stretches the wall by more than this is flow running over a hidden strip.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +1.22 / -0.04, plaster facade +3.92 / +0.06,
    #: church +2.75 / -0.17.
    stretch: float = 1.3
    #: A pixel that covers less of the wall than this sees the side face of a step.
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.05 / +24.04, plaster facade -0.04 / +8.66,
    #: church +0.07 / +19.74.
    side_face: float = 0.5
    #: Steps outwards when a hidden strip is filled. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.09, plaster facade +0.00 / -0.10,
    #: church +0.00 / +0.08.
    leap: int = 3
    #: The most steps are 2 to the power of this.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster facade +0.00 / +0.00, church -0.00 / +0.00.
    leaps: int = 7
    #: How much higher relief to be believed must be than what it covers in photo 2: parallax and
    #: share of d2. [px, -]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.05 / +0.04, plaster facade -0.01 / +0.04,
    #: church +0.02 / +0.01.
    covers: tuple[float, float] = (0.7, 0.0005)
    #: The same for any relief, which covers only what is not valid. [px, -]
    #: Evidence: church_1, without it: 14.3 instead of 14.2 % beyond 3 cm, 178 instead of 126 scraps
    #: of picture.
    covers_invalid: tuple[float, float] = (1.5, 0.002)
    #: Hidden relief farther than this from measured one must be surrounded by it. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.01 / -0.00,
    #: church +0.00 / +0.00.
    fringe_hidden: float = 24.0
    #: The same for interpolated relief. [px]
    #: Evidence: benchmarks/relief_tuning.py: half of it and twice it change nothing there.
    fringe_interpolated: float = 100.0
    #: Relief leans on squares of this side. [px]
    #: Evidence: half / twice, beyond 3 cm [%]: facade +0.00 / +0.00, plaster facade +0.00 / +0.01.
    grain: int = 3
    #: The same on plain walls, where specks of interpolated pixels lie in strips that a cornice
    #: hides. [px]
    #: Evidence: plaster, façade 511, 6 MP; 7, 11, 15 px: 73, 26, 23 scraps of picture, RMSE off
    #: edges 37.4, 39.7, 49.9 mm.
    grain_plain: int = 11


PROJECTION = ProjectionTuning()


class MapBands(NamedTuple):
    """Bands of a relief map in the making."""

    r: Float32Array
    sigma: Float32Array
    quality: ByteArray

    def put(self, where: Any, values: MapBands) -> None:
        """Take over values for the pixels of a mask or of (rows, columns), in place."""
        self.r[where], self.sigma[where], self.quality[where] = values

    def at(self, where: Any) -> MapBands:
        """Return the values of the pixels of a mask."""
        return MapBands(self.r[where], self.sigma[where], self.quality[where])


def stretch(frame: Frame, relief: Float32Array) -> Float32Array:
    """Return how much of the wall, along the radius, a pixel of photo 1 covers, in pixels.

    With s1 the radius about the nadir of photo 1, ``ds'/ds1 = 1 - r/d1 - (s1/d1) dr/ds1``: near one
    on a true surface, more on a ramp that no camera can have seen as a surface (`stretch`), near
    zero on the side face of a step, which has no place of its own on the map (`side_face`).
    """
    foot = frame.foot(1)
    across = cv2.Sobel(relief, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    down = cv2.Sobel(relief, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    distance = np.float32(foot.distance)
    if frame.pair.refracted:
        x, y = frame.slopes(1, *offsets(frame.grid.shape))
        return np.asarray(reduction(relief, distance) + across * x + down * y)
    x, y = offsets(frame.grid.shape, frame.grid.pixel_of(foot.nadir))
    # d s'/d s of s' = s (1 - r / d), Eq. (1).
    return np.asarray(reduction(relief + across * x + down * y, distance))


def side_faces(frame: Frame, relief: Float32Array, swept: BoolArray) -> BoolArray:
    """Return which pixels of photo 1 see the side face of a step that rises outwards.

    But for what a sweep found, `swept`: the flanks of thin things are all that is seen of them.

    The face is as wide in photo 1 as the step's parallax, and all of it stands on the one line of
    the step: whatever relief flow gives it, measured or not, would land beside that line (façade
    81: 1.39 to 1.18 % beyond 3 cm, orthophoto 1.57 to 1.33 % beyond 1 px; 83, 35/28: 2.75 to 2.49).
    """
    smooth = cv2.blur(cv2.medianBlur(relief, 5), (3, 3))
    return np.asarray((stretch(frame, smooth) < PROJECTION.side_face) & ~swept)


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
    foot = frame.foot(1)
    relief = np.where(usable, source.r, np.float32(np.nan))
    first = _scatter(frame, relief, source.quality == Quality.MEASURED, grid, foot)
    finite = np.isfinite(first)
    around = np.ones((5, 5), dtype=np.uint8)
    upper = cv2.dilate(np.where(finite, first, np.float32(-1e3)), around)
    lower = cv2.erode(np.where(finite, first, np.float32(1e3)), around)
    result = _look_up(frame, source, relief, foot, _away(frame, foot, grid), first)
    for start in (upper, lower):
        row, column = np.nonzero((np.abs(start) < 999) & np.isnan(result.r))
        away = _away(frame, foot, grid, row, column)
        relief_met = _look_up(frame, source, relief, foot, away, start[row, column])
        result.put((row, column), relief_met)
    return result


def _scatter(
    frame: Frame, relief: Float32Array, validated: BoolArray, grid: Grid, foot: Foot
) -> Float32Array:
    """Drop every pixel of photo 1 where it stands on the plane; validated ones and high ones win.

    A spike that nothing validates would otherwise win against the wall that it is a mismatch of.
    """
    x, y = offsets(frame.grid.shape, frame.grid.pixel_of(foot.nadir))
    if not frame.pair.refracted:
        # Eq. (1): s' = s - e = s (1 - r / d)
        share = reduction(relief, np.float32(foot.distance))
        x, y = x * share, y * share
    else:
        across, down = frame.slopes(1, *offsets(frame.grid.shape))
        x, y = x + relief * across, y + relief * down
    ratio = frame.grid.gsd / grid.gsd
    nadir = grid.pixel_of(foot.nadir)
    with np.errstate(invalid="ignore"):
        column = x * np.float32(ratio) + np.float32(nadir[0] + 0.5)
        row = y * np.float32(ratio) + np.float32(nadir[1] + 0.5)
        inside = (column >= 0) & (column < grid.width) & (row >= 0) & (row < grid.height)
    index = row[inside].astype(np.int32) * np.int64(grid.width) + column[inside].astype(np.int32)
    empty = np.full(grid.shape, np.nan, dtype=np.float32)
    return highest(relief[inside], index, empty, validated[inside])


def highest(
    relief: Float32Array, index: IntArray, result: Float32Array, first: BoolArray | None = None
) -> Float32Array:
    """Return an image with values put at flat indices, the highest where several fall (in place).

    Those of ``first`` win against all others, however high.
    """
    np.fmax.at(result.ravel(), index, relief)
    if first is not None:
        best = np.full(result.size, np.nan, dtype=np.float32)
        np.fmax.at(best, index[first], relief[first])
        finite = np.isfinite(best)
        result.ravel()[finite] = best[finite]
    return result


def _away(
    frame: Frame, foot: Foot, grid: Grid, row: Any = None, column: Any = None
) -> Float32Array:
    """Return how far pixels of the map lie from the nadir, (..., 2), in pixels of photo 1's grid.

    Of all of them, or of those at given rows and columns.
    """
    x = ((grid.columns_x - foot.nadir[0]) / frame.grid.gsd).astype(np.float32)
    y = ((grid.rows_y - foot.nadir[1]) / -frame.grid.gsd).astype(np.float32)
    if row is not None:
        return np.stack([x[column], y[row]], axis=-1)
    return np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)


def seen_by_first(frame: Frame, grid: Grid, relief: Float32Array) -> Float32Array:
    """Return where photo 1 shows the pixels of a map (column, row), shape (h, w, 2). [px]"""
    return shown_by_first(frame, _away(frame, frame.foot(1), grid), relief)


def shown_by_first(frame: Frame, away: Float32Array, relief: Float32Array) -> Float32Array:
    """Return where photo 1 shows points of the wall (column, row), shape (..., 2). [px]

    Parameters
    ----------
    frame : Frame
    away : ndarray of float32, shape (..., 2)
        How far they lie from the nadir, in pixels of photo 1's grid.
    relief : ndarray of float32, shape (...)
        Of the points. [m]
    """
    foot = frame.foot(1)
    nadir = frame.grid.pixel_of(foot.nadir).astype(np.float32)
    if not frame.pair.refracted:
        return np.asarray(
            nadir + away * magnification(relief, np.float32(foot.distance))[..., None]
        )
    at = nadir + away
    return np.stack(frame.shown(1, at[..., 0], at[..., 1], relief), axis=-1)


def _look_up(
    frame: Frame,
    source: MapBands,
    relief: Float32Array,
    foot: Foot,
    away: Float32Array,
    start: Float32Array,
) -> MapBands:
    """Return the surface of photo 1 that a first value leads to; unknown where it leads nowhere.

    Eq. (1), s = s' d / (d - r), with the r it is meant to find: a fixed point.
    """
    final, tolerance = start, np.float32(PROJECTION.agreement * foot.distance)
    for _ in range(3):
        value = final
        q = shown_by_first(frame, away, value)
        q[~np.isfinite(q)] = -1e4
        final = values_at(relief, q, cv2.INTER_NEAREST)
    with np.errstate(invalid="ignore"):
        good = np.abs(final - value) < tolerance
        smooth = values_at(relief, q, cv2.INTER_LINEAR)
        final = np.where(np.abs(smooth - final) < tolerance, smooth, final)
    sigma, quality = (values_at(b, q, cv2.INTER_NEAREST) for b in (source.sigma, source.quality))
    nothing = np.float32(np.nan)
    return MapBands(
        np.where(good, final, nothing),
        np.where(good, sigma, nothing),
        np.where(good, quality, np.uint8(Quality.UNKNOWN)),
    )


def fill_from_behind(bands: MapBands, holes: BoolArray, grid: Grid, nadir: FloatArray) -> BoolArray:
    """Fill holes from the lower of the next pixels farther out and farther in (in place).

    Behind a step lies the lower surface: the nearest pixel would smear the step itself over what it
    hides, and at an inner edge the surface farther out is the upper one. Returns what was filled.
    """
    row, column = np.nonzero(holes)
    filled = np.zeros_like(holes)
    if not len(row):
        return filled
    values = bands.r.ravel()
    number = np.full(bands.r.size, -1, dtype=np.int64)
    number[row * bands.r.shape[1] + column] = np.arange(len(row))
    target = np.zeros(len(row), dtype=np.int64)
    lowest = np.full(len(row), np.inf, dtype=np.float32)
    for leap in (PROJECTION.leap, -PROJECTION.leap):
        beyond = _beyond(row, column, number, bands.r.shape, grid.pixel_of(nadir), leap)
        relief = np.where(number[beyond] < 0, values[beyond], np.float32(np.nan))
        lower = relief < lowest
        target[lower], lowest[lower] = beyond[lower], relief[lower]
    good = np.isfinite(lowest)
    filled[row[good], column[good]] = True
    _fill(bands, filled, target[good], 3, Quality.HIDDEN)
    return filled


def _beyond(
    row: IntArray,
    column: IntArray,
    number: IntArray,
    shape: tuple[int, int],
    centre: FloatArray,
    leap: int,
) -> IntArray:
    """Return flat indices of what lies on the ray from the centre behind the holes it runs into."""
    dx, dy = column - centre[0], row - centre[1]
    length = np.maximum(np.hypot(dx, dy), 1e-9)
    to_column = np.clip(np.rint(column + leap * dx / length).astype(np.int64), 0, shape[1] - 1)
    to_row = np.clip(np.rint(row + leap * dy / length).astype(np.int64), 0, shape[0] - 1)
    target = to_row * shape[1] + to_column
    for _ in range(
        PROJECTION.leaps
    ):  # each round doubles the leap of those that are still in a hole
        hop = number[target]
        target = np.where(hop >= 0, target[np.maximum(hop, 0)], target)
    return np.asarray(target)


def _fill(
    bands: MapBands, holes: BoolArray, source: IntArray, factor: float, quality: Quality
) -> None:
    """Fill holes, in order of rows, from flat indices; their sigma grows (in place)."""
    bands.r[holes] = bands.r.ravel()[source]
    bands.sigma[holes] = factor * bands.sigma.ravel()[source]
    bands.quality[holes] = quality


def put_behind(
    frame: Frame, source: MapBands, valid: BoolArray, support: BoolArray
) -> tuple[MapBands, BoolArray]:
    """Return photo 1's pixels with what photo 2 cannot see on the surface behind; and which it was.

    Relief to be believed covers all, any relief what is not valid.
    """
    least, unsure = covering(frame, PROJECTION.covers), covering(frame, PROJECTION.covers_invalid)
    covered = hidden_in_second(frame, source.r, least, support)
    covered |= hidden_in_second(frame, source.r, unsure) & ~valid
    bands = MapBands(source.r.copy(), source.sigma.copy(), source.quality.copy())
    filled = fill_from_behind(bands, covered, frame.grid, frame.foot(1).nadir)
    # What is behind lies lower: a fill that rises leans on the wrong surface.
    rises = filled & (bands.r > source.r + least)
    bands.put(rises, source.at(rises))
    bands.quality[covered] = Quality.HIDDEN
    return bands, filled & ~rises


def covering(frame: Frame, covers: tuple[float, float]) -> Float32Array:
    """Return how much higher than another a surface must be to cover it in photo 2. [m]"""
    x, y = frame.from_centre()
    reach = np.maximum(np.sqrt(x * x + y * y), 1)
    parallax = covers[0] * frame.pair.base_factor / reach
    return np.asarray(parallax + covers[1] * frame.distances[1], dtype=np.float32)


def hidden_in_second(
    frame: Frame, relief: Float32Array, step: Float32Array, covers: BoolArray | None = None
) -> BoolArray:
    """Return pixels of photo 1 that a surface higher by a step [m] covers in photo 2.

    Of the pixels in ``covers``, by default of all.
    """
    columns, rows = zoom_map(frame, relief)
    height, width = relief.shape
    with np.errstate(invalid="ignore"):
        column, row = np.rint(columns).astype(np.int32), np.rint(rows).astype(np.int32)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    # What falls outside goes to a cell of its own behind the last one.
    index = np.where(inside, row.astype(np.int64) * width + column, height * width).ravel()
    top = np.full(relief.size + 1, np.float32(-1e3))
    if covers is None:
        highest(relief.ravel(), index, top)
    else:
        highest(relief[covers], index[covers.ravel()], top)
    cracked = top[:-1].reshape(height, width)
    covering = cv2.morphologyEx(cracked, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    above = covering.ravel().take(index, mode="clip").reshape(height, width)
    return np.asarray(inside & (above > relief + step))


def hidden_on_map(
    relief: Float32Array, grid: Grid, camera: Foot, field: RayField | None = None
) -> BoolArray:
    """Return which pixels of a relief map a camera, or bent rays, cannot see, to a pixel.

    On one ray, at one q = N + (P - N) d / (d - r), the highest point is the nearest to the camera:
    each cell of q keeps it, and a point is hidden if its cell holds one a pixel and more before it.
    """
    x = ((grid.columns_x - camera.nadir[0]) / grid.gsd).astype(np.float32)[None, :]
    y = ((camera.nadir[1] - grid.rows_y) / grid.gsd).astype(np.float32)[:, None]
    column0, row0 = grid.pixel_of(camera.nadir)
    distance = np.float32(camera.distance)
    factor = magnification(relief, distance)  # Eq. (1)
    with np.errstate(invalid="ignore"):
        pixel = (distance - relief) / np.maximum(np.sqrt(x * x + y * y), 1)
        column, row = x * factor, y * factor
        if field is not None:
            gsd = np.float32(grid.gsd)
            column, row, across, down = field.through(x * gsd, y * -gsd, relief)
            column, row = column / gsd, row / -gsd
            pixel = np.minimum(gsd / np.hypot(across, down), distance - relief)
        column += np.float32(column0 + 0.5)
        row += np.float32(row0 + 0.5)
        inside = (column >= 0) & (column < grid.width) & (row >= 0) & (row < grid.height)
        index = np.where(inside, row, 0).astype(np.int32) * np.int32(grid.width)
        index += np.where(inside, column, 0).astype(np.int32)
    top = np.full(grid.shape, np.float32(-1e3))
    highest(relief[inside], index[inside], top)
    top = cv2.morphologyEx(top, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    with np.errstate(invalid="ignore"):
        return np.asarray(inside & (top.ravel()[index] > relief + pixel))


def fill_small(bands: MapBands, holes: BoolArray) -> None:
    """Fill what is left of holes from the nearest known pixel, a few pixels deep (in place)."""
    if not holes.any():
        return
    unknown = ~np.isfinite(bands.r)
    distance, label = cv2.distanceTransformWithLabels(
        unknown.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    fill = holes & unknown & (distance <= PROJECTION.fringe_hidden)
    sources = np.flatnonzero(~unknown)
    if not len(sources) or not fill.any():
        return
    source_of_label = np.zeros(int(label.max()) + 1, dtype=np.int64)
    source_of_label[label.ravel()[sources]] = sources
    _fill(bands, fill, source_of_label[label[fill]], 5, Quality.INTERPOLATED)


def forget_outside(bands: MapBands, matched: Measurement) -> MapBands:
    """Make unknown what measured relief does not surround, but for a fringe (in place).

    Beyond the outermost thing both photos saw, a filled relief has nothing to lean on. On plain
    walls measured pixels are few: there it leans on interpolated ones, too (plaster, loggia 302 and
    façade 62: 0.4 % of the wall unknown no longer, relief there as good as elsewhere).
    """
    believed, grain = bands.quality == Quality.MEASURED, PROJECTION.grain
    if matched.plain:
        believed, grain = believed | (bands.quality == Quality.INTERPOLATED), PROJECTION.grain_plain
    solid = (believed & np.isfinite(bands.r)).astype(np.uint8)
    solid = cv2.morphologyEx(solid, cv2.MORPH_OPEN, np.ones((grain, grain), np.uint8))
    distance = cv2.distanceTransform(1 - solid, cv2.DIST_L2, 3)
    away = distance > PROJECTION.fringe_hidden
    number, label = cv2.connectedComponents(away.astype(np.uint8), connectivity=4)
    outer = np.zeros(number, dtype=bool)
    for side in (label[0], label[-1], label[:, 0], label[:, -1]):
        outer[side] = True
    outer[0] = False  # near measured relief
    far = (bands.quality == Quality.HIDDEN) | (distance > PROJECTION.fringe_interpolated)
    lost = outer[label] & far
    bands.r[lost] = bands.sigma[lost] = np.nan
    bands.quality[lost] = Quality.UNKNOWN
    return bands
