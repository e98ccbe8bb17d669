"""What a camera cannot see of a relief: a forward z-buffer over the reference plane."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bifocal.domain.grid import Grid
from bifocal.domain.surface import Bounds, ReliefArray, Surface
from bifocal.rays import Foot
from photocore.arrays import BoolArray

#: A point is hidden when another on its ray lies this much nearer to the nadir. Two neighbours
#: that share a cell differ by at most its diagonal, 1.44 px; less would call slopes hidden. [px]
_MARGIN = 1.0
#: No more than this many points are inserted between two neighbours.
_MOST_STEPS = 400


def hidden_from(surface: Surface, grid: Grid, camera: Foot, relief: ReliefArray) -> BoolArray:
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
    if wide.shape != grid.shape:
        relief_wide = surface.window(wide)
        relief_wide[row : row + grid.height, column : column + grid.width] = relief
    else:
        relief_wide = relief
    return _hidden(relief_wide, wide, camera, column, row, grid.shape)


def _reach(surface: Surface, grid: Grid, camera: Foot) -> tuple[Grid, int, int] | None:
    """Return the window grown towards the nadir by all that can hide a part of it.

    None if nothing can. The point at rho hides the one at rho' > rho only if
    ``rho' - rho < rho' (r - r') / (d - r')``.
    """
    low, _ = surface.extremes(grid.bounds)
    bounds = grid.bounds
    if math.isnan(low):
        return None
    left, bottom, right, top = bounds
    share = 1.0
    # The first pass takes everything up to the nadir, the next only what the relief there needs.
    for _ in range(3):
        box = _towards(bounds, camera, share)
        _, high = surface.extremes(box)
        share = max(0.0, (high - low) / (camera.distance - low))
    reach = share * max(
        math.hypot(x - camera.nadir[0], y - camera.nadir[1])
        for x in (left, right)
        for y in (bottom, top)
    )
    if reach < grid.gsd:
        return None
    box = _towards(bounds, camera, share)
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


def _hidden(
    relief: ReliefArray, grid: Grid, camera: Foot, column: int, row: int, shape: tuple[int, int]
) -> BoolArray:
    """Return the hidden pixels of the part of ``grid`` that starts at column and row."""
    gsd, d = grid.gsd, camera.distance
    x = ((grid.columns_x - camera.nadir[0]) / gsd).astype(np.float32)
    y = ((grid.rows_y - camera.nadir[1]) / gsd).astype(np.float32)
    with np.errstate(divide="ignore", invalid="ignore"):
        stretch = np.float32(d) / np.where(relief < d, np.float32(d) - relief, np.float32(np.nan))
    known = ~np.isnan(stretch)
    if not known.any():
        return np.zeros(shape, bool)
    side = np.float32(1.02 * float(np.nanmax(stretch)))
    u = x * (stretch / side)
    v = y[:, None] * (stretch / side)
    core = np.s_[row : row + shape[0], column : column + shape[1]]
    # Only cells that hold a pixel of the core matter; everything else goes to a cell of its own.
    u0, v0 = np.floor(np.nanmin(u[core], initial=np.inf)), np.floor(np.nanmin(v[core], initial=np.inf))
    if not (np.isfinite(u0) and np.isfinite(v0)):
        return np.zeros(shape, bool)
    columns = int(np.nanmax(u[core]) - u0) + 2
    rows = int(np.nanmax(v[core]) - v0) + 2
    rho = np.sqrt(x * x + (y * y)[:, None])

    nearest = np.full(rows * columns + 1, np.inf, np.float32)

    def cell_of(u: NDArray[np.float32], v: NDArray[np.float32]) -> NDArray[np.int32]:
        with np.errstate(invalid="ignore"):
            i, j = (v - v0).astype(np.int32), (u - u0).astype(np.int32)
            inside = (u >= u0) & (v >= v0) & (i < rows) & (j < columns)
        return np.where(inside, i * np.int32(columns) + j, np.int32(rows * columns))

    cells = cell_of(u, v)
    np.minimum.at(nearest, cells.ravel(), rho.ravel())
    for first, second in (
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
    ):
        _join(nearest, cell_of, u, v, rho, first, second)
    nearest[-1] = np.inf
    found = nearest[cells[core]] < rho[core] - np.float32(_MARGIN)
    return _sharpen(found, relief, nearest, cells[core], columns, x, y, rho, d / gsd, gsd, column, row)


def _sharpen(found, relief, nearest, cells, columns, x, y, rho, distance, gsd, column, row):  # type: ignore[no-untyped-def]
    import cv2

    square = np.ones((3, 3), np.uint8)
    flags = found.astype(np.uint8)
    sure = cv2.erode(flags, square) > 0
    at = np.nonzero((cv2.dilate(flags, square) > 0) & ~sure)
    if not len(at[0]):
        return found
    # The occluder: the innermost point in the cells around.
    c = cells[at].astype(np.int64)
    occ = nearest[c]
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            occ = np.fmin(occ, nearest[np.clip(c + dr * columns + dc, 0, len(nearest) - 1)])
    i, j = at[0] + row, at[1] + column
    r = relief[i, j] / np.float32(gsd)
    p = rho[i, j]
    hidden = np.zeros(len(c), bool)
    ux, uy = -x[j] / p, y[i] / p
    rise = (np.float32(distance) - r) / p
    reach = p - occ
    scaled = relief
    rows, cols = relief.shape
    for local, t0 in WIN:
        t = np.full_like(reach, t0) if local else reach + np.float32(t0)
        ii = np.rint(i + uy * t).astype(np.int32)
        jj = np.rint(j + ux * t).astype(np.int32)
        ok = (t > TMIN) & (ii >= 0) & (ii < rows) & (jj >= 0) & (jj < cols)
        h = relief[np.clip(ii, 0, rows - 1), np.clip(jj, 0, cols - 1)] / np.float32(gsd)
        with np.errstate(invalid="ignore"):
            hidden |= ok & (h > r + rise * (t - TOL))
    out = sure.copy()
    out[at] = hidden
    return out

WIN=[(True,a) for a in (0.75,1.25,1.75,2.25)]+[(False,a) for a in np.arange(-2,2.1,.5)]
TMIN=0.75
TOL=0.5

def _join(nearest, cell_of, u, v, rho, first, second) -> None:  # type: ignore[no-untyped-def]
    """Insert points of the faces between neighbours that lie more than a cell apart."""
    du, dv = u[second] - u[first], v[second] - v[first]
    with np.errstate(invalid="ignore"):
        gap = np.maximum(np.abs(du), np.abs(dv))
        at = np.nonzero(gap.ravel() > 1.0)[0]
    if not len(at):
        return
    count = np.minimum(np.ceil(gap.ravel()[at]), _MOST_STEPS).astype(np.int64)
    index = np.repeat(np.arange(len(at)), count)
    part = np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)
    t = ((part + 1) / (count + 1)[index]).astype(np.float32)
    starts = [a[first].ravel()[at][index] for a in (u, v, rho)]
    ends = [a[second].ravel()[at][index] for a in (u, v, rho)]
    pu, pv, prho = (a + (b - a) * t for a, b in zip(starts, ends, strict=True))
    np.minimum.at(nearest, cell_of(pu, pv), prho)
