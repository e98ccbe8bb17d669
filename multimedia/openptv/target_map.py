"""Targets of a photo on a map of cells: which places have none near, without a search."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from photocore.arrays import BoolArray, FloatArray, IntArray

#: Cells per reach, and along a side of the map at most.
_PER_REACH, _MOST = 4, 2000


class TargetMap:
    """Targets that are sought within a reach of places.

    Parameters
    ----------
    pixels : ndarray, shape (n, 2)
        One or more. [px]
    reach : float
        Farthest that a target may lie from a place, which is not reached. [px]
    """

    def __init__(self, pixels: FloatArray, reach: float) -> None:
        self._tree, self._reach = cKDTree(pixels), reach
        low, high = pixels.min(axis=0) - reach, pixels.max(axis=0) + reach
        self._low, self._cell = low, max(reach / _PER_REACH, float((high - low).max()) / _MOST)
        cells = self._cells(pixels)
        count = int(reach / self._cell) + 1
        ahead = np.arange(-count, count + 1)
        across, down = (part.ravel() for part in np.meshgrid(ahead, ahead))
        # Of two cells the nearest points are a cell less apart on each axis.
        least = np.hypot(*np.maximum(np.abs([across, down]) - 1, 0)) * self._cell
        self._shape = cells.max(axis=0) + 2 * count + 2
        self._margin = count
        self._near: BoolArray = np.zeros(self._shape, dtype=bool)
        for x, y in zip(across[least < reach], down[least < reach], strict=True):
            self._near[cells[:, 0] + x + count, cells[:, 1] + y + count] = True

    def _cells(self, places: FloatArray) -> IntArray:
        return np.floor((places - self._low) / self._cell).astype(np.int64)

    def nearest(self, places: FloatArray) -> IntArray:
        """Return the number of the target nearest to each place, -1 where none is within reach.

        Parameters
        ----------
        places : ndarray, shape (n, 2)
            NaN where there is none. [px]
        """
        numbers = np.full(len(places), -1, dtype=np.int64)
        scaled = (places - self._low) / self._cell + self._margin
        # NaN is in no cell.
        inside = np.flatnonzero(((scaled >= 0.0) & (scaled < self._shape)).all(axis=1))
        cells = scaled[inside].astype(np.int64)
        some = inside[self._near[cells[:, 0], cells[:, 1]]]
        away, target = self._tree.query(places[some], distance_upper_bound=self._reach)
        within = np.isfinite(away)
        numbers[some[within]] = target[within]
        return numbers
