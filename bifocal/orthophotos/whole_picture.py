"""Relief for a whole picture: where none is known it is interpolated, far from all the plane."""

from __future__ import annotations

import math

import cv2
import numpy as np

from bifocal.model.grid import Bounds, Grid
from bifocal.model.surface import Surface, measured_on
from bifocal.orthophotos.ortho_image import Source
from bifocal.orthophotos.pull_push import fill_holes
from bifocal.orthophotos.tuning import WHOLE
from photocore.arrays import BoolArray, ByteArray, Float32Array


class CompletedSurface:
    """A surface without gaps, for pictures; it knows what of it is not measured.

    Parameters
    ----------
    surface : Surface
        Relief as it is known.
    grid : Grid
        Of the whole picture.
    """

    def __init__(self, surface: Surface, grid: Grid) -> None:
        self.surface = surface
        step = max(1.0, max(grid.shape) / WHOLE.side)
        self._grid = Grid.from_bounds(grid.bounds, gsd=grid.gsd * step)
        relief = surface.window(self._grid)
        known = np.isfinite(relief)
        self._relief = np.where(known, relief, np.float32(0))
        self._share = known.astype(np.float32)
        if known.any() and not known.all():
            filled, done = fill_holes(self._relief, known, ~known)
            away = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, 5)
            near, far = (share * max(self._grid.shape) for share in (WHOLE.near, WHOLE.far))
            share = np.clip((far - away) / max(far - near, 1.0), 0, 1)
            self._share = np.where(known | done, share, 0).astype(np.float32)
            self._relief = np.where(self._share > 0, filled * self._share, 0).astype(np.float32)

    def window(self, grid: Grid) -> Float32Array:
        """Return relief at the pixel centres of a grid, known everywhere. [m]"""
        relief = self.surface.window(grid)
        unknown = np.isnan(relief)
        if not unknown.any():
            return relief
        rest = self._at(self._relief, grid)
        if unknown.all():
            return rest
        deep = cv2.distanceTransform(unknown.astype(np.uint8), cv2.DIST_L2, 3) > WHOLE.seam
        relief[deep] = rest[deep]
        relief, _ = fill_holes(relief, ~unknown | deep, unknown & ~deep)
        return np.where(np.isnan(relief), rest, relief)

    def measured(self, grid: Grid) -> BoolArray | None:
        """Return which pixels of a grid both photos measured."""
        return measured_on(self.surface, grid)

    def extremes(self, bounds: Bounds) -> tuple[float, float]:
        """Return the extremes over a box of what is known and of what is interpolated."""
        low, high = self.surface.extremes(bounds)
        values = [v for v in (low, high) if not math.isnan(v)]
        height, width = self._grid.shape
        corners = self._grid.pixel_of(np.array([[bounds[0], bounds[3]], [bounds[2], bounds[1]]]))
        # One pixel more on every side, for the interpolation; the rim goes on outside.
        first = np.clip(np.floor(np.nan_to_num(corners[0])) - 1, 0, (width - 1, height - 1))
        last = np.clip(np.ceil(np.nan_to_num(corners[1])) + 1, 0, (width - 1, height - 1))
        (c0, r0), (c1, r1) = first.astype(int), last.astype(int)
        part = self._relief[r0 : r1 + 1, c0 : c1 + 1]
        values += [float(part.min()), float(part.max())]
        return min(values), max(values)

    def source(self, grid: Grid) -> ByteArray:
        """Return what relief stands on: `Source` INTERPOLATED, PLANE, or NONE where it is known."""
        unknown = np.isnan(self.surface.window(grid))
        near = self._at(self._share, grid) >= 0.5
        mark = np.where(near, np.uint8(Source.INTERPOLATED), np.uint8(Source.PLANE))
        return np.where(unknown, mark, np.uint8(Source.NONE))

    def _at(self, coarse: Float32Array, grid: Grid) -> Float32Array:
        """Return a coarse raster at the pixels of a grid, bilinear, its rim going on outside."""
        columns = ((grid.columns_x - self._grid.x0) / self._grid.gsd).astype(np.float32)
        rows = ((self._grid.y0 - grid.rows_y) / self._grid.gsd).astype(np.float32)
        maps = np.meshgrid(columns, rows)
        edge = cv2.BORDER_REPLICATE
        return np.asarray(cv2.remap(coarse, *maps, cv2.INTER_LINEAR, borderMode=edge))
