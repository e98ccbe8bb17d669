"""Relief for a whole picture: one smooth sheet through what is kept, far from all the plane."""

from __future__ import annotations

import math

import cv2
import numpy as np

from bifocal.faces.faced_surface import FacedSurface, beneath
from bifocal.model.grid import Bounds, Grid
from bifocal.model.photo import Photo
from bifocal.model.surface import FlatSurface, MapSurface, Surface, measured_on
from bifocal.orthophotos.ortho_image import Source
from bifocal.orthophotos.pull_push import membrane
from bifocal.orthophotos.tuning import WHOLE
from bifocal.orthophotos.visibility import parts_of
from photocore.arrays import BoolArray, ByteArray, Float32Array


def completed(surface: Surface, grid: Grid, photo: Photo, pixel: float) -> Surface:
    """Return a surface without gaps for a picture; of a flat one itself."""
    if isinstance(surface, FlatSurface):
        return surface
    return CompletedSurface(surface, grid, photo, pixel)


class CompletedSurface:
    """A surface without gaps, for pictures; it knows what of it is not measured.

    What was measured stays as it is, and of what was interpolated what is broad and even. Crumbs
    and ragged steps that nobody measured are left out where that moves the picture by less than a
    bound, `WHOLE.bound`; one smooth sheet leads through all that stays, and over into the plane
    far from it.

    Parameters
    ----------
    surface : Surface
        Relief as it is known.
    grid : Grid
        Of the whole picture.
    photo : Photo
        The one that gives most colours: its rays say how far relief moves the picture.
    pixel : float
        Side of its pixel on the wall. [m]
    """

    def __init__(self, surface: Surface, grid: Grid, photo: Photo, pixel: float) -> None:
        self.surface = surface
        self._grid = _sheet_grid(surface, grid)
        relief = surface.window(self._grid)
        finite = np.isfinite(relief)
        measured = self.measured(self._grid)
        kept = finite
        if measured is not None and (finite & ~measured).any():
            slope = _slope(photo, self._grid)
            kept = _kept(relief, finite & measured, slope, WHOLE.bound * pixel, self._grid.gsd)
        self._share = np.ones(self._grid.shape, np.float32)
        if finite.any() and not kept.all():
            relief = membrane(relief, kept)
            away = cv2.distanceTransform((~finite).astype(np.uint8), cv2.DIST_L2, 5)
            near = max(WHOLE.near * max(self._grid.shape), WHOLE.seam)
            far = max(WHOLE.far * max(self._grid.shape), 2 * near)
            self._share = np.clip((far - away) / (far - near), 0, 1).astype(np.float32)
            relief = relief * self._share
        elif not finite.any():
            relief, self._share = np.zeros_like(relief), np.zeros_like(self._share)
        self._relief = np.ascontiguousarray(relief, np.float32)
        self._kept = kept
        self._extremes = MapSurface.of_array(self._relief, self._grid)

    def window(self, grid: Grid) -> Float32Array:
        """Return relief at the pixel centres of a grid, known everywhere. [m]"""
        exact = self.surface.window(grid)
        keep = np.isfinite(exact) & self._flags(self._kept, grid)
        measured = self.measured(grid)
        if measured is not None:
            keep &= measured
        return exact if keep.all() else np.where(keep, exact, self._at(self._relief, grid))

    def measured(self, grid: Grid) -> BoolArray | None:
        """Return which pixels of a grid both photos measured, or were drawn."""
        mask = measured_on(self.surface, grid)
        if mask is not None and isinstance(self.surface, FacedSurface):
            mask = mask | (self.surface.labels(grid) > 0)
        return mask

    def extremes(self, bounds: Bounds) -> tuple[float, float]:
        """Return the extremes over a box."""
        low, high = self._extremes.extremes(bounds)
        # Beyond its rim the sheet goes on.
        return self._extremes.extremes(self._grid.bounds) if math.isnan(low) else (low, high)

    def source(self, grid: Grid) -> ByteArray:
        """Return what relief stands on: `Source` INTERPOLATED, PLANE, or NONE where measured."""
        measured = self.measured(grid)
        measured = np.isfinite(self.surface.window(grid)) if measured is None else measured
        measured = measured & self._flags(self._kept, grid)
        near = self._at(self._share, grid) >= 0.5
        mark = np.where(near, np.uint8(Source.INTERPOLATED), np.uint8(Source.PLANE))
        return np.where(measured, np.uint8(Source.NONE), mark)

    def _flags(self, mask: BoolArray, grid: Grid) -> BoolArray:
        """Return a mask of the sheet at the nearest pixels of a grid."""
        if mask.all():
            return np.ones(grid.shape, bool)
        columns, rows = self._maps(grid)
        edge, flags = cv2.BORDER_REPLICATE, mask.astype(np.uint8)
        return cv2.remap(flags, columns, rows, cv2.INTER_NEAREST, borderMode=edge) > 0

    def _at(self, sheet: Float32Array, grid: Grid) -> Float32Array:
        """Return the sheet at the pixels of a grid, bilinear, its rim going on outside."""
        columns, rows = self._maps(grid)
        edge = cv2.BORDER_REPLICATE
        return np.asarray(cv2.remap(sheet, columns, rows, cv2.INTER_LINEAR, borderMode=edge))

    def _maps(self, grid: Grid) -> tuple[Float32Array, Float32Array]:
        columns = ((grid.columns_x - self._grid.x0) / self._grid.gsd).astype(np.float32)
        rows = ((self._grid.y0 - grid.rows_y) / self._grid.gsd).astype(np.float32)
        across, down = np.meshgrid(columns, rows)
        return across, down


def _sheet_grid(surface: Surface, grid: Grid) -> Grid:
    """Return the grid of the sheet: the relief map's own pixels under the picture, if it has any.

    No finer than the picture, and no more pixels than memory bears.
    """
    under = beneath(surface)
    least = math.sqrt(grid.width * grid.height / WHOLE.most) * grid.gsd
    if not isinstance(under, MapSurface) or under.grid.gsd < max(grid.gsd, least):
        return Grid.from_bounds(grid.bounds, gsd=max(grid.gsd, least))
    left, bottom, right, top = grid.bounds
    (c0, r0), (c1, r1) = under.grid.pixel_of(np.array([[left, top], [right, bottom]]))
    c0, r0, c1, r1 = math.floor(c0), math.floor(r0), math.ceil(c1), math.ceil(r1)
    return under.grid.window(c0, r0, c1 - c0 + 1, r1 - r0 + 1)


def _slope(photo: Photo, grid: Grid) -> Float32Array:
    """Return how far a metre of relief moves the picture of a photo. [m/m]"""
    x, y = grid.columns_x - photo.nadir[0], grid.rows_y - photo.nadir[1]
    slope = np.hypot(x[None, :], y[:, None]) / photo.distance
    return np.maximum(slope, WHOLE.least_slope).astype(np.float32)


def _kept(
    relief: Float32Array, measured: BoolArray, slope: Float32Array, bound: float, gsd: float
) -> BoolArray:
    """Return the known pixels that a picture keeps.

    Of what was measured all but crumbs on ground that hardly was, such as mirroring glass; of the
    rest broad even parts, and what moves the picture by more than the bound.
    """
    finite = np.isfinite(relief)
    even = _even(relief, slope)
    least = WHOLE.broad / gsd**2
    side = int(WHOLE.around / gsd) | 1
    dense = cv2.blur(measured.astype(np.float32), (side, side)) >= WHOLE.dense
    sure = measured & (dense | parts_of(measured & even, least))
    if not sure.any():
        return finite
    away = np.where(finite, np.abs(relief - membrane(relief, sure)) * slope, np.float32(0))
    rest = finite & ~sure
    far = rest & (cv2.medianBlur(away.astype(np.float32), 5) > bound)
    kept = sure | parts_of(rest & even, least) | parts_of(far, WHOLE.piece / gsd**2)
    return _with_rims(kept, relief)


def _with_rims(kept: BoolArray, relief: Float32Array) -> BoolArray:
    """Return what is kept with what goes on beside it without a step, as far as `WHOLE.rim`.

    The rim of a raised part is interpolated, a few pixels broad, and stands where it stands: left
    out, the sheet would fall from it to the wall, and what it hides with it.
    """
    square, limit, far = np.ones((3, 3), np.uint8), np.float32(WHOLE.even), np.float32(9e9)
    for _ in range(WHOLE.rim):
        low = relief - cv2.erode(np.where(kept, relief, far), square)
        high = cv2.dilate(np.where(kept, relief, -far), square) - relief
        kept = kept | (np.minimum(np.abs(low), np.abs(high)) < limit)
    return kept


def _even(relief: Float32Array, slope: Float32Array) -> BoolArray:
    """Return where relief moves the picture by less from pixel to pixel than `WHOLE.even`."""
    square = np.ones((3, 3), np.uint8)
    finite, far = np.isfinite(relief), np.float32(9e9)
    high = cv2.dilate(np.where(finite, relief, -far), square)
    return (high - cv2.erode(np.where(finite, relief, far), square)) * slope < WHOLE.even
