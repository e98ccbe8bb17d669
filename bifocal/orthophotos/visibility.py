"""What a camera cannot see of a relief: a forward z-buffer over the plane, its mask tidied."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Bounds, Grid, bounds_of
from bifocal.model.ray_field import RayField
from bifocal.model.surface import EVERYWHERE, Surface, measured_on
from bifocal.orthophotos.tuning import TIDYING, VISIBILITY
from bifocal.rays import Foot, magnification, object_rays, plane_position, straight
from photocore.arrays import BoolArray, Float32Array
from photocore.compiled import compiled

#: What numpy takes for a pixel, roughly. [s]
_NUMPY = 50e-9


def hidden_from(surface: Surface, grid: Grid, camera: Foot, relief: Float32Array) -> BoolArray:
    """Return which pixels of a window a camera cannot see because relief is in the way.

    Parameters
    ----------
    surface : Surface
        The relief, also around the window: what hides a pixel lies between it and the nadir.
    grid : Grid
        The window.
    camera : Foot
        Nadir and distance.
    relief : ndarray, shape (height, width)
        Relief of the window; NaN pixels are not called hidden. [m]

    Notes
    -----
    A point at distance rho from the nadir is seen at ``q = rho d / (d - r)``, Midulla Eq. (1) on
    the plane. Going outwards along one direction the surface is a continuous curve q(rho), so a
    point is hidden exactly if the same q occurs at a smaller rho. All points are sorted into cells
    of the plane by q, each cell keeps its smallest rho, and a point is hidden if its own cell
    holds a smaller one. Between neighbours that are more than a cell apart, at steps of the
    relief, points of the connecting face are inserted.
    """
    limits = _reach(surface, grid, camera)
    if limits is None:
        return np.zeros(grid.shape, bool)
    wide, column, row = limits
    if wide.width * wide.height > VISIBILITY.largest and min(grid.shape) >= 2 * VISIBILITY.smallest:
        # Far from the nadir of a fine orthophoto the surroundings outgrow the window: halve it.
        hidden = np.zeros(grid.shape, bool)
        for left, top, part in grid.tiles((max(grid.shape) + 1) // 2):
            cut = np.s_[top : top + part.height, left : left + part.width]
            hidden[cut] = hidden_from(surface, part, camera, relief[cut])
        return hidden
    if wide.shape != grid.shape:
        relief_wide = surface.window(wide)
        relief_wide[row : row + grid.height, column : column + grid.width] = relief
    else:
        relief_wide = relief
    # The same cells for every window, so that windows fit together.
    _, high = surface.extremes(EVERYWHERE)
    largest = float(magnification(high, straight(camera).distance))
    if camera.media is not None:
        largest *= VISIBILITY.bent
    measured = measured_on(surface, grid)
    return _hidden(relief_wide, wide, camera, (column, row), grid.shape, largest, measured)


def _reach(surface: Surface, grid: Grid, camera: Foot) -> tuple[Grid, int, int] | None:
    """Return the window grown towards the nadir by all that can hide a part of it.

    None if nothing can. The point at rho hides the one at rho' > rho only if
    ``rho' - rho < rho' (r - r') / (d - r')``.
    """
    low, _ = surface.extremes(grid.bounds)
    bounds = grid.bounds
    if math.isnan(low):
        return None
    if camera.media is not None:
        box = _refracted_reach(surface, grid, camera, low)
        return None if box is None else _grown(grid, box)
    left, bottom, right, top = bounds
    farthest = max(
        math.hypot(x - camera.nadir[0], y - camera.nadir[1])
        for x in (left, right)
        for y in (bottom, top)
    )
    least = camera.distance
    share = 1.0
    # The first pass takes everything up to the nadir, the next only what the relief there needs.
    for _ in range(3):
        box = _towards(bounds, camera, share)
        _, high = surface.extremes(box)
        share = max(0.0, (high - low) / (least - low))
    reach = share * farthest
    if reach < grid.gsd:
        return None
    return _grown(grid, _towards(bounds, camera, share))


def _refracted_reach(surface: Surface, grid: Grid, camera: Foot, low: float) -> Bounds | None:
    """Return a window's box grown by all that can hide a part of it from a camera through media.

    None if nothing can. A ray rises from a hidden point at ``low`` to the highest relief.
    """
    bounds = grid.bounds
    x, y = np.linspace(bounds[0], bounds[2], 9), np.linspace(bounds[1], bounds[3], 9)
    xyz = np.stack(np.broadcast_arrays(*np.meshgrid(x, y), low), axis=-1)
    slope = object_rays(plane_position(xyz, camera), camera).slope.reshape(-1, 2)
    slope = np.nan_to_num(slope)
    xy, box, rise = xyz[..., :2].reshape(-1, 2), EVERYWHERE, 0.0
    for _ in range(3):
        _, high = surface.extremes(box)
        rise = max(high - low, 0.0)
        box = bounds_of(np.concatenate([xy, xy + slope * rise]))
    return box if rise * float(np.hypot(*slope.T).max()) >= grid.gsd else None


def _grown(grid: Grid, box: Bounds) -> tuple[Grid, int, int]:
    """Return a grid grown to a box, and the column and row where it begins therein."""
    left, bottom, right, top = grid.bounds
    margins = (left - box[0], box[3] - top, box[2] - right, bottom - box[1])
    c0, r0, c1, r1 = (math.ceil(margin / grid.gsd) + 2 if margin > 0 else 0 for margin in margins)
    wide = grid.window(-c0, -r0, grid.width + c0 + c1, grid.height + r0 + r1)
    return wide, c0, r0


def _towards(bounds: Bounds, camera: Foot, share: float) -> Bounds:
    """Return a box grown towards the nadir by a share of each corner's distance from it."""
    x, y = (float(value) for value in camera.nadir)
    left, bottom, right, top = bounds
    share = min(share, 1.0)
    return (
        min(left, left + (x - left) * share),
        min(bottom, bottom + (y - bottom) * share),
        max(right, right + (x - right) * share),
        max(top, top + (y - top) * share),
    )


class _Surroundings(NamedTuple):
    """A window with its surroundings, in pixels, seen from the nadir."""

    relief: Float32Array  # [px]
    x: Float32Array  # of every column, from the nadir [px]
    y: Float32Array  # of every row, upwards [px]
    rho: Float32Array  # distance from the nadir [px]
    distance: np.float32  # of the camera [px]
    core: tuple[slice, slice]  # the window itself
    bent: _RaysOfWindow | None = None  # through media

    @classmethod
    def of_window(
        cls, relief: Float32Array, grid: Grid, camera: Foot, core: tuple[slice, slice]
    ) -> _Surroundings:
        """Return a window seen from the nadir of a camera."""
        gsd, foot, bent = grid.gsd, straight(camera), None
        x = ((grid.columns_x - foot.nadir[0]) / gsd).astype(np.float32)
        y = ((grid.rows_y - foot.nadir[1]) / gsd).astype(np.float32)
        if camera.media is None:
            rho = np.sqrt(x * x + (y * y)[:, None])
        else:
            bent = _RaysOfWindow.of_window(relief, grid, camera, (x, y))
            rho = np.nan_to_num(np.hypot(bent.x, bent.y))
        distance = np.float32(foot.distance / gsd)
        return cls(relief * np.float32(1 / gsd), x, y, rho, distance, core, bent)

    def seen_at(self, share: np.float32) -> tuple[Float32Array, Float32Array]:
        """Return where the rays to all pixels meet the plane, times a share, y upwards. [px]"""
        if self.bent is not None:
            return self.bent.u * share, self.bent.v * share
        stretch = magnification(self.relief, self.distance)  # Eq. (1)
        stretch *= share
        return self.x * stretch, self.y[:, None] * stretch

    def away(self, row: Any, column: Any) -> tuple[Float32Array, Float32Array]:
        """Return offsets of pixels, of length rho, from the foot of the camera on their rays."""
        if self.bent is not None:
            return self.bent.x[row, column], self.bent.y[row, column]
        return self.x[column], self.y[row]


class _RaysOfWindow(NamedTuple):
    """Rays through media to the pixels of a window, y upwards. [px]"""

    u: Float32Array  # where they meet the plane, from the nadir
    v: Float32Array
    x: Float32Array  # of their points from where they reach the height of the camera
    y: Float32Array

    @classmethod
    def of_window(
        cls, relief: Float32Array, grid: Grid, camera: Foot, at: tuple[Float32Array, Float32Array]
    ) -> _RaysOfWindow:
        """Return the rays to points at offsets ``at`` [px] from the straight camera's nadir."""
        reliefs = (float(f.reduce(relief, axis=None, initial=0.0)) for f in (np.fmin, np.fmax))
        low, high = reliefs
        gsd = np.float32(grid.gsd)
        field = RayField.over(camera, grid.bounds, (low, high))
        u, v, across, up = field.through(at[0] * gsd, at[1][:, None] * gsd, relief)
        rise = (np.float32(field.foot.distance) - relief) / gsd
        return cls(u / gsd, v / gsd, -across * rise, -up * rise)


def _hidden(
    relief: Float32Array,
    grid: Grid,
    camera: Foot,
    start: tuple[int, int],
    shape: tuple[int, int],
    largest: float,
    measured: BoolArray | None,
) -> BoolArray:
    """Return the hidden pixels of the part of ``grid`` that starts at a column and row."""
    column, row = start
    core = np.s_[row : row + shape[0], column : column + shape[1]]
    around = _Surroundings.of_window(relief, grid, camera, core)
    hidden = _behind(around, largest)
    if measured is None:
        return hidden
    ground = _without_thin(around, grid.gsd)
    thin = around.relief > ground
    if not thin.any():
        return hidden
    relief = np.where(thin, ground * np.float32(grid.gsd), relief)
    body = _Surroundings.of_window(relief, grid, camera, core)
    solid = np.zeros(hidden.shape, np.uint8)
    for part, of in ((body, None), (around, thin)):
        if (buffer := _Buffer.of_surroundings(part, largest, of)) is not None:
            solid |= buffer.covers(part)
    # A shadow's rim, a pixel broad, belongs to it.
    doubtful = hidden & (cv2.dilate(solid, np.ones((3, 3), np.uint8)) == 0)
    return hidden & ~_seen_past(doubtful, measured)


def _seen_past(doubtful: BoolArray, measured: BoolArray) -> BoolArray:
    """Return what only the space below thin things hides, around which both photos measured."""
    side = (VISIBILITY.seen_past, VISIBILITY.seen_past)
    doubtful_share, measured_share = (
        cv2.blur(mask.astype(np.float32), side) for mask in (doubtful, doubtful & measured)
    )
    return doubtful & (measured_share > np.float32(VISIBILITY.share_seen) * doubtful_share)


def _behind(around: _Surroundings, largest: float) -> BoolArray:
    """Return what the relief hides, and the faces between it and the wall."""
    buffer = _Buffer.of_surroundings(around, largest)
    if buffer is None:
        return np.zeros(around.relief[around.core].shape, bool)
    return _sharpen(around, buffer)


def _without_thin(around: _Surroundings, gsd: float) -> Float32Array:
    """Return relief without what is too narrow for its displacement to reach down to the wall. [px]

    A railing is a surface before another one: rays pass beneath its bars.
    """
    side = max(3, int(VISIBILITY.thin / gsd) | 1)
    filled = np.where(np.isnan(around.relief), np.float32(1e9), around.relief)
    body = cv2.morphologyEx(filled, cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    with np.errstate(invalid="ignore"):
        displaced = (around.relief - body) * around.rho
        thin = displaced > np.float32(side) * (around.distance - around.relief)
    return np.where(thin, body, around.relief)


class _Buffer(NamedTuple):
    """The z-buffer: the smallest rho in each cell of q, and the cell of each pixel of the core."""

    nearest: Float32Array
    cells: NDArray[np.int32]
    columns: int

    @classmethod
    def of_surroundings(
        cls, around: _Surroundings, largest: float, of: BoolArray | None = None
    ) -> _Buffer | None:
        """Return the filled buffer; None if nothing of the core is known.

        Of some pixels only, if given, without the faces between them.
        """
        core = around.core
        if math.isnan(largest):
            stretch = magnification(around.relief, around.distance)  # Eq. (1)
            largest = float(np.fmax.reduce(stretch, axis=None))
        # Just wider than the widest gap between neighbours on a flat part: no cell stays empty.
        u, v = around.seen_at(np.float32(1 / (1.02 * largest)))
        if np.isnan(np.fmax.reduce(u[core], axis=None)):
            return None
        # Only cells that hold a pixel of the core matter; the rest goes to a cell of its own.
        u0, u1 = (float(f.reduce(u[core], axis=None)) for f in (np.fmin, np.fmax))
        v0, v1 = (float(f.reduce(v[core], axis=None)) for f in (np.fmin, np.fmax))
        u -= np.float32(math.floor(u0))
        v -= np.float32(math.floor(v0))
        columns, rows = (int(math.floor(b) - math.floor(a)) + 1 for a, b in ((u0, u1), (v0, v1)))
        nearest = np.full(rows * columns + 1, np.inf, np.float32)
        cells = _cells(u, v, rows, columns)
        if of is not None:
            np.minimum.at(nearest, cells[of], around.rho[of])
        elif _enter.pays(u.size * _NUMPY):
            most = np.int64(VISIBILITY.most_steps)
            _enter(u, v, around.rho, cells, nearest, rows, columns, most)
        else:
            np.minimum.at(nearest, cells.ravel(), around.rho.ravel())
            for first, second in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
                ends = [(a[first], a[second]) for a in (u, v, around.rho)]
                _join(nearest, ends, rows, columns)
        nearest[-1] = np.inf
        return cls(nearest, cells[core], columns)

    def covers(self, around: _Surroundings) -> BoolArray:
        """Return which pixels of the core lie farther out than what their cell holds."""
        ahead = around.rho[around.core] - self.nearest[self.cells]
        return np.asarray(ahead > np.float32(VISIBILITY.margin))


def _cells(u: Float32Array, v: Float32Array, rows: int, columns: int) -> NDArray[np.int32]:
    """Return the cell of positions; the one after the last for what lies outside or is NaN."""
    inside = (u >= 0) & (v >= 0) & (u < columns) & (v < rows)
    with np.errstate(invalid="ignore"):
        cells = v.astype(np.int32) * np.int32(columns) + u.astype(np.int32)
    cells[~inside] = rows * columns
    return cells


def _join(
    nearest: Float32Array, ends: list[tuple[Float32Array, Float32Array]], rows: int, columns: int
) -> None:
    """Insert points of the faces between neighbours that lie more than a cell apart."""
    (u, u_next), (v, v_next), _ = ends
    gap = np.maximum(np.abs(u_next - u), np.abs(v_next - v))
    at = np.nonzero(gap > 1)
    if not len(at[0]):
        return
    count = np.minimum(np.ceil(gap[at]), VISIBILITY.most_steps).astype(np.int64)
    index = np.repeat(np.arange(len(count)), count)
    part = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
    t = ((part + 1) / (count + 1)[index]).astype(np.float32)
    points = [a[at][index] + (b[at] - a[at])[index] * t for a, b in ends]
    np.minimum.at(nearest, _cells(points[0], points[1], rows, columns), points[2])


@compiled
def _enter(u, v, rho, cells, nearest, rows, columns, most):  # type: ignore[no-untyped-def]
    """Enter all pixels in the buffer, and the faces between neighbours, one at a time."""
    height, width = u.shape
    for i in range(height):
        for j in range(width):
            nearest[cells[i, j]] = min(nearest[cells[i, j]], rho[i, j])
            for down, right in ((0, 1), (1, 0)):
                a, b = i + down, j + right
                if a >= height or b >= width:
                    continue
                du, dv, far = u[a, b] - u[i, j], v[a, b] - v[i, j], rho[a, b] - rho[i, j]
                gap = max(abs(du), abs(dv))
                if not gap > 1:
                    continue
                count = min(int(np.ceil(gap)), most)
                for part in range(1, count + 1):
                    t = np.float32(part / (count + 1))
                    x, y = u[i, j] + du * t, v[i, j] + dv * t
                    if x >= 0 and y >= 0 and x < columns and y < rows:
                        cell = int(y) * columns + int(x)
                        nearest[cell] = min(nearest[cell], rho[i, j] + far * t)


def _sharpen(around: _Surroundings, buffer: _Buffer) -> BoolArray:
    """Return the hidden pixels, those at the rims of shadows decided along their own rays.

    The cells are a pixel wide, so the rim of a shadow is known to a pixel only, and shadows of
    a pixel are missed. Where that matters the ray from the pixel to the camera is followed at the
    place of the occluder and right beside the pixel: it is hidden if relief rises above the ray.
    """
    core, rho = around.core, around.rho[around.core]
    ahead = rho - buffer.nearest[buffer.cells]
    hidden = ahead > np.float32(VISIBILITY.margin)
    flags, square = hidden.astype(np.uint8), np.ones((3, 3), np.uint8)
    sure = (cv2.erode(flags, square) > 0) & (ahead > np.float32(VISIBILITY.sure))
    unsure = (cv2.dilate(flags, square) > 0) & ~sure
    filled = np.where(np.isnan(around.relief), np.float32(-1e9), around.relief)
    rise = cv2.dilate(filled, square)[core] - around.relief[core]
    depth = around.distance - around.relief[core]
    unsure |= rise * rho > np.float32(VISIBILITY.least_shadow) * depth
    unsure &= rho > 0  # nothing lies between the nadir and the camera
    row, column = np.nonzero(unsure & ~sure)
    if not len(row):
        return hidden
    cell = buffer.cells[row, column].astype(np.int64)
    # At a rim the occluder may lie just beside the pixel's own cell.
    lit = ~hidden[row, column]
    occluder = buffer.nearest[cell]
    for shift in [i * buffer.columns + j for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]:
        beside = buffer.nearest[np.clip(cell[lit] + shift, 0, cell.max())]
        occluder[lit] = np.fmin(occluder[lit], beside)
    sure[row, column] = _above_ray(around, row + core[0].start, column + core[1].start, occluder)
    return sure


def _above_ray(
    around: _Surroundings, row: NDArray[np.int64], column: NDArray[np.int64], occluder: Float32Array
) -> BoolArray:
    """Return which pixels' rays to the camera run into relief beside them or at the occluder."""
    r, rho = around.relief[row, column], around.rho[row, column]
    x, y = around.away(row, column)
    to_occluder = np.where(np.isfinite(occluder), rho - occluder, np.float32(0))
    rays = (row, column, r, -x / rho, y / rho, (around.distance - r) / rho, to_occluder)
    beside, shifts = (np.array(v, np.float32) for v in (VISIBILITY.beside, VISIBILITY.around))
    rim, steep = np.float32(VISIBILITY.rim), np.float32(VISIBILITY.steep)
    follow: Any = _followed if _followed.pays(len(row) * _NUMPY) else _followed_by_numpy
    return follow(around.relief, *rays, beside, shifts, rim, steep)


def _followed_by_numpy(  # type: ignore[no-untyped-def]
    relief, row, column, r, to_x, to_y, slope, to_occluder, beside, shifts, rim, steep
):
    """Return which rays run into relief at some distances, one distance at a time."""
    rows, columns = relief.shape
    hidden = np.zeros(len(row), bool)

    def height(of: NDArray[np.int64], t: Float32Array) -> tuple[Float32Array, BoolArray]:
        i = np.rint(row[of] + to_y[of] * t).astype(np.int32)
        j = np.rint(column[of] + to_x[of] * t).astype(np.int32)
        inside = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        return relief[i.clip(0, rows - 1), j.clip(0, columns - 1)], inside

    running = np.arange(len(row))
    for t_all in [*(np.full(len(row), t) for t in beside), *(to_occluder + t for t in shifts)]:
        t, ray = t_all[running], slope[running]
        above, inside = height(running, t)
        over = above - r[running] - ray * t
        perhaps = np.nonzero(inside & (t >= beside[0]) & (over > -rim * ray))[0]
        # The benefit of the doubt is a step's only: a slope just short of the ray's hides nothing.
        below, _ = height(running[perhaps], t[perhaps] - 1)
        step = above[perhaps] - below > steep * ray[perhaps]
        hidden[running[perhaps[step | (over[perhaps] > 0)]]] = True
        running = running[~hidden[running]]
    return hidden


@compiled
def _followed(  # type: ignore[no-untyped-def]
    relief, row, column, r, to_x, to_y, slope, to_occluder, beside, shifts, rim, steep
):
    """Return the same, one ray at a time."""
    rows, columns = relief.shape
    hidden = np.zeros(len(row), np.bool_)
    near = len(beside)
    for k in range(len(row)):
        ray = slope[k]
        for n in range(near + len(shifts)):
            t = beside[n] if n < near else to_occluder[k] + shifts[n - near]
            if not t >= beside[0]:
                continue
            i = int(np.rint(row[k] + np.float64(to_y[k] * t)))
            j = int(np.rint(column[k] + np.float64(to_x[k] * t)))
            if i < 0 or i >= rows or j < 0 or j >= columns:
                continue
            over = relief[i, j] - r[k] - ray * t
            if not over > -rim * ray:
                continue
            if not over > 0:
                back = t - np.float32(1)
                low = int(np.rint(row[k] + np.float64(to_y[k] * back)))
                side = int(np.rint(column[k] + np.float64(to_x[k] * back)))
                below = relief[min(max(low, 0), rows - 1), min(max(side, 0), columns - 1)]
                if not relief[i, j] - below > steep * ray:
                    continue
            hidden[k] = True
            break
    return hidden


def tidied(hidden: BoolArray, side: int = 3) -> BoolArray:
    """Return a mask of hidden pixels without parts too small or too thin to be a shadow.

    A shadow that is nowhere ``side`` pixels wide, three by default, is what half a pixel of doubt
    about a step makes; a part of fewer than `least_area` pixels cannot be told. Pinholes in the
    mask are closed likewise.
    """
    if not hidden.any():
        return hidden
    core = cv2.erode(hidden.astype(np.uint8), np.ones((side, side), np.uint8), borderValue=1) > 0
    _, label, stats, _ = cv2.connectedComponentsWithStats(hidden.astype(np.uint8), connectivity=8)
    keep = np.zeros(len(stats), dtype=bool)
    keep[np.unique(label[core & hidden])] = True
    keep &= stats[:, cv2.CC_STAT_AREA] >= TIDYING.least_area
    keep[0] = False
    return ~parts_of(~keep[label], TIDYING.least_area, connectivity=4)


def parts_of(mask: BoolArray, least: float, connectivity: int = 8) -> BoolArray:
    """Return the parts of a mask that have so many pixels."""
    flags = mask.astype(np.uint8)
    _, label, stats, _ = cv2.connectedComponentsWithStats(flags, connectivity=connectivity)
    keep = stats[:, cv2.CC_STAT_AREA] >= least
    keep[0] = False
    return np.asarray(keep[label])
