"""Which camera saw which point of a bathymetric survey, block by block."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array, issparse

from photocore.arrays import BoolArray, FloatArray, IntArray, positive
from photocore.errors import InputError

#: Points looked at together: their cameras are culled by the box around them. Neighbours in a
#: cloud or a DEM lie close together. Fewer of them where cameras are so many that pairs would be.
POINTS, PAIRS = 4096, 2_000_000


class VisiblePoints(NamedTuple):
    """Which camera saw which point: by table, by angle, or all; never points times cameras."""

    centres: FloatArray  # (m, 3)
    table: csr_array | None  # (n, m)
    slope: float | None  # tangent of the largest angle from the vertical

    @classmethod
    def checked(
        cls,
        visible: ArrayLike | csr_array | None,
        centres: FloatArray,
        max_angle: float | None,
        shape: tuple[int, ...],
    ) -> VisiblePoints:
        """Return what was seen of points of a shape.

        Raises
        ------
        InputError
            If the table has another shape, or the angle is not between 0 and 90 degrees.
        """
        slope = None
        if max_angle is not None:
            if positive(max_angle, "max_angle") >= np.pi / 2:
                raise InputError(f"max_angle: {max_angle:g} rad is not below a right angle.")
            slope = math.tan(max_angle)
        if visible is None:
            return cls(centres, None, slope)
        shapes = {(*shape, len(centres)), (math.prod(shape), len(centres))}
        table: Any = visible if issparse(visible) else np.asarray(visible, dtype=bool)
        if table.shape not in shapes:
            raise InputError(
                f"visible: expected shape {(*shape, len(centres))} (points, cameras), found "
                f"{table.shape}."
            )
        if not issparse(table):
            table = table.reshape(math.prod(shape), len(centres))
        return cls(centres, csr_array(table), slope)

    def blocks(self, points: FloatArray, most: int) -> Iterator[tuple[slice, IntArray, IntArray]]:
        """Yield blocks of points with the pairs seen: row within the block, and camera.

        Parameters
        ----------
        points : ndarray, shape (n, 3)
        most : int
            Pairs in a block, unless one point has more.
        """
        step = max(min(POINTS, PAIRS // max(len(self.centres), 1)), 1)
        for first in range(0, len(points), step):
            last = min(first + step, len(points))
            row, camera = self._pairs(points[first:last], slice(first, last))
            ends = np.searchsorted(row, np.arange(last - first), side="right")
            start = 0
            while start < last - first:
                before = int(ends[start - 1]) if start else 0
                stop = max(int(np.searchsorted(ends, before + most, side="right")), start + 1)
                mine = slice(before, int(ends[stop - 1]))
                yield slice(first + start, first + stop), row[mine] - start, camera[mine]
                start = stop

    def _pairs(self, points: FloatArray, part: slice) -> tuple[IntArray, IntArray]:
        """Return the pairs of some points, sorted by point."""
        if self.table is not None:
            table = self.table[part].sorted_indices().tocoo()
            row, camera = table.row.astype(np.int64), table.col.astype(np.int64)
            row, camera = row[table.data != 0], camera[table.data != 0]
            if self.slope is None:
                return row, camera
            inside = self._inside(points[row], self.centres[camera])
            return row[inside], camera[inside]
        if self.slope is None:
            count = len(self.centres)
            return (
                np.repeat(np.arange(len(points)), count),
                np.tile(np.arange(count), len(points)),
            )
        near = np.flatnonzero(self._reach(points))
        row, column = np.nonzero(self._inside(points[:, None], self.centres[near]))
        return row, near[column]

    def _reach(self, points: FloatArray) -> BoolArray:
        """Return which cameras may see anything of the box around some points."""
        finite = points[np.isfinite(points).all(-1)]
        if not len(finite) or self.slope is None:
            return np.zeros(len(self.centres), dtype=bool)
        low, high = finite.min(0), finite.max(0)
        place = self.centres[:, :2]
        outside = np.maximum(np.maximum(low[:2] - place, place - high[:2]), 0)
        near: BoolArray = np.hypot(*outside.T) <= self.slope * (self.centres[:, 2] - low[2])
        return near

    def _inside(self, points: FloatArray, centres: FloatArray) -> BoolArray:
        """Return whether cameras see points within the largest angle from the vertical."""
        offset = centres - points
        aside = np.hypot(offset[..., 0], offset[..., 1])
        inside: BoolArray = aside <= (self.slope or 0.0) * offset[..., 2]
        return inside
