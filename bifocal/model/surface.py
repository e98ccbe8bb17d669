"""Where the wall is: relief asked for window by window, from a number, a map or triangles."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Bounds, Grid, cut
from bifocal.remarks import remark
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.errors import InputError

#: A box without end.
EVERYWHERE: Bounds = (-math.inf, -math.inf, math.inf, math.inf)
#: Returns relief for (column, row, width, height) of a map, NaN beyond its edges.
Fetch = Callable[[int, int, int, int], Float32Array]

#: Side of the blocks whose extremes a map remembers; smaller blocks give tighter tile margins. [px]
_BLOCK = 128
#: A map whose relief changes by more than this many pixel sides from one pixel to the next has a
#: step there, not a slope (72 degrees): interpolating across it would invent a ramp.
_STEP = 3.0


class Surface(Protocol):
    """Relief over the reference plane."""

    def window(self, grid: Grid) -> Float32Array:
        """Return relief at the pixel centres of a grid; NaN where unknown. [m]"""

    def extremes(self, bounds: Bounds) -> tuple[float, float]:
        """Return the lowest and highest relief over a box; NaN, NaN where nothing is known. [m]"""


def measured_on(surface: Surface, grid: Grid) -> BoolArray | None:
    """Return which pixels of a grid both photos measured; None where the surface cannot tell."""
    measured = getattr(surface, "measured", None)
    return None if measured is None else measured(grid)


class FlatSurface:
    """A wall without relief, parallel to the reference plane.

    Parameters
    ----------
    r : float
        Its relief. [m]
    """

    def __init__(self, r: float = 0.0) -> None:
        if not math.isfinite(r):
            raise InputError(f"relief: must be a finite number [m], got {r}.")
        self.r = float(r)

    def window(self, grid: Grid) -> Float32Array:
        """Return the constant."""
        return np.full(grid.shape, self.r, np.float32)

    def extremes(self, bounds: Bounds) -> tuple[float, float]:  # noqa: ARG002
        """Return the constant twice."""
        return self.r, self.r


class MapSurface:
    """A relief map, in memory or read from a file window by window.

    Parameters
    ----------
    grid : Grid
        Where the map's pixels are.
    fetch : callable
        Returns any window of it.
    fetch_measured : callable, optional
        Returns 1 for what both photos measured in any window.
    """

    def __init__(self, grid: Grid, fetch: Fetch, fetch_measured: Fetch | None = None) -> None:
        self.grid, self._fetch, self._measured = grid, fetch, fetch_measured
        self._lowest, self._highest = self._scan()
        if np.isnan(self._lowest).all():
            raise InputError(remark("relief.empty"))

    @classmethod
    def of_array(
        cls, r: NDArray[np.floating], grid: Grid, measured: BoolArray | None = None
    ) -> MapSurface:
        """Return the surface of an array in memory, shape (height, width). [m]"""
        if r.shape != grid.shape:
            raise InputError(f"relief: expected shape {grid.shape}, found {r.shape}.")
        relief = r.astype(np.float32, copy=False)
        flags = None if measured is None else measured.astype(np.float32)
        return cls(
            grid, lambda *window: cut(relief, window, np.nan),
            None if flags is None else lambda *window: cut(flags, window, 0),
        )  # fmt: skip

    def window(self, grid: Grid) -> Float32Array:
        """Return relief at the pixel centres of a grid.

        Bilinear on slopes, nearest across steps and beside holes, so that edges stay sharp.
        """
        offset = grid.whole_offset_in(self.grid)
        if offset is not None:
            return self._fetch(*offset, grid.width, grid.height)
        return self._resample(grid)

    def measured(self, grid: Grid) -> BoolArray | None:
        """Return what both photos measured, of the nearest pixels."""
        if self._measured is None:
            return None
        offset = grid.whole_offset_in(self.grid)
        if offset is not None:
            return self._measured(*offset, grid.width, grid.height) > 0
        import cv2

        window, columns, rows = grid.resampling(self.grid, 1)
        flags = np.ascontiguousarray(self._measured(*window))
        return np.asarray(cv2.remap(flags, columns, rows, cv2.INTER_NEAREST) > 0)

    def extremes(self, bounds: Bounds) -> tuple[float, float]:
        """Return the extremes of the blocks that touch the box."""
        side = _BLOCK * self.grid.gsd
        xmin, ymin, xmax, ymax = self.grid.bounds
        left, right = (min(max(x, xmin - side), xmax + side) for x in (bounds[0], bounds[2]))
        bottom, top = (min(max(y, ymin - side), ymax + side) for y in (bounds[1], bounds[3]))
        c0, c1 = (math.floor((x - xmin) / side) for x in (left, right))
        r0, r1 = (math.floor((ymax - y) / side) for y in (top, bottom))
        cut = np.s_[max(r0, 0) : max(r1 + 1, 0), max(c0, 0) : max(c1 + 1, 0)]
        lowest, highest = self._lowest[cut], self._highest[cut]
        if not lowest.size or np.isnan(lowest).all():
            return math.nan, math.nan
        return float(np.nanmin(lowest)), float(np.nanmax(highest))

    def _scan(self) -> tuple[FloatArray, FloatArray]:
        """Return the extremes of every block."""
        rows, columns = (-(-length // _BLOCK) for length in self.grid.shape)
        lowest, highest = np.full((2, rows, columns), np.nan)
        for top in range(0, rows, 4):  # whole tiles of the file at a time
            count = min(4, rows - top)
            values = self._fetch(0, top * _BLOCK, columns * _BLOCK, count * _BLOCK)
            blocks = values.reshape(count, _BLOCK, columns, _BLOCK)
            # fmin and fmax skip NaN without a warning where all is NaN.
            for result, extreme in ((lowest, np.fmin), (highest, np.fmax)):
                result[top : top + count] = extreme.reduce(extreme.reduce(blocks, axis=1), axis=-1)
        if np.isinf(lowest).any() or np.isinf(highest).any():
            raise InputError("the relief map holds infinite values; mark unknown pixels as NaN.")
        return lowest, highest

    def _resample(self, grid: Grid) -> Float32Array:
        import cv2

        window, columns, rows = grid.resampling(self.grid, 1)
        patch = np.ascontiguousarray(self._fetch(*window))
        near = cv2.remap(patch, columns, rows, cv2.INTER_NEAREST)
        # Not by cv2.remap: OpenCV 4 rounds places to 1/32 px.
        left, top = columns[0].astype(int), rows[:, 0].astype(int)
        smooth = _between(patch[top], patch[top + 1], rows[:, :1] - top[:, None])
        smooth = _between(smooth[:, left], smooth[:, left + 1], columns[:1] - left)
        # Steps and holes of the map, as seen by the four neighbours of a position.
        filled = np.where(np.isnan(patch), np.float32(1e6), patch)
        corner = np.ones((2, 2), np.uint8)
        spread = cv2.dilate(filled, corner, anchor=(0, 0)) - cv2.erode(
            filled, corner, anchor=(0, 0)
        )
        steps = spread > _STEP * self.grid.gsd
        rough = steps[np.ix_(top, left)]
        return np.asarray(np.where(rough | np.isnan(smooth), near, smooth), np.float32)


def _between(first: Float32Array, second: Float32Array, share: FloatArray) -> Float32Array:
    """Return what lies between two values by a share of the way; exactly both where they agree."""
    return first + (second - first) * share.astype(np.float32)
