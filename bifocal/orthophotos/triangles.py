"""Relief between measured points: triangles that respect breaklines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Bounds, Grid, bounds_of
from bifocal.orthophotos.tuning import TRIANGLES
from bifocal.remarks import remark
from photocore.arrays import Float32Array, FloatArray, IntArray, as_points
from photocore.errors import InputError

#: Fixed-point bits of the polygon rasteriser: corners to 1/256 px.
_BITS = 8


class TriangleSurface:
    """Relief linear within triangles of measured points; NaN outside of them.

    Parameters
    ----------
    xyz : array_like, shape (n, 3)
        X, Y, r. [m]
    breaklines : sequence of sequences of int
        Edges of the wall as rows of ``xyz`` in order; no triangle crosses them. A vertical step
        is two lines side by side, one at its foot and one at its top.

    Raises
    ------
    InputError
        If there are fewer than three points, all on one line.

    Notes
    -----
    Delaunay's triangulation; breaklines are enforced by halving their pieces until each is an
    edge of a triangle, which keeps relief on the line itself exact.
    """

    def __init__(self, xyz: FloatArray, breaklines: Sequence[Sequence[int]] = ()) -> None:
        from scipy.spatial import Delaunay, QhullError

        points = as_points(xyz, "xyz", dimension=3).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise InputError("points: every X, Y and relief must be a number.")
        points, breaklines = _without_doubles(points, breaklines)
        if len(points) < 3:
            raise InputError(remark("ortho.few_points", count=len(points)))
        try:
            for _ in range(TRIANGLES.halvings):
                # QJ would move points; Qhull's default merges flat triangles exactly.
                triangles = Delaunay(points[:, :2]).simplices
                points, breaklines, crossed = _halved(points, breaklines, triangles)
                if not crossed:
                    break
            else:
                triangles = Delaunay(points[:, :2]).simplices
        except QhullError:
            raise InputError(remark("ortho.points_on_line")) from None
        self.points, self.triangles = points, np.asarray(triangles, dtype=np.int64)
        corners = points[self.triangles]
        self._low, self._high = corners.min(axis=1), corners.max(axis=1)
        self._planes = _planes(corners)

    def window(self, grid: Grid) -> Float32Array:
        """Return relief at the pixel centres of a grid; NaN outside the triangles."""
        owner = np.full(grid.shape, -1, np.int32)
        # Pixel centres just on the rim still count: the rasteriser fills boundaries.
        touched = self._touching(grid.bounds)
        corners = grid.pixel_of(self.points[self.triangles[touched]][:, :, :2])
        # Far corners would overflow the rasteriser's 32 bits: 2^31 / 2^8 = 8 million px.
        limit = 2.0 ** (30 - _BITS)
        if corners.size and np.abs(corners).max() > limit:
            raise InputError("points: they reach too far beyond the area for this pixel size.")
        fixed = np.rint(corners * 2**_BITS).astype(np.int32)
        for index, triangle in zip(touched.tolist(), fixed, strict=True):
            cv2.fillConvexPoly(owner, triangle, float(index), lineType=cv2.LINE_8, shift=_BITS)
        index = np.maximum(owner, 0)
        plane = self._planes[index]
        x, y = grid.columns_x[None, :], grid.rows_y[:, None]
        relief = plane[..., 0] * x + plane[..., 1] * y + plane[..., 2]
        # Pixels on an edge may belong to the triangle beside; steep ones must not shoot out of it.
        low, high = self._low[index, 2], self._high[index, 2]
        slack = 0.02 * (high - low)
        relief = np.clip(relief, low - slack, high + slack)
        return np.where(owner >= 0, relief, np.nan).astype(np.float32)

    def extremes(self, bounds: Bounds) -> tuple[float, float]:
        """Return the extremes over the triangles that touch a box."""
        touched = self._touching(bounds)
        if not len(touched):
            return math.nan, math.nan
        return float(self._low[touched, 2].min()), float(self._high[touched, 2].max())

    @property
    def bounds(self) -> Bounds:
        """Box around the points: xmin, ymin, xmax, ymax. [m]"""
        return bounds_of(self.points[:, :2])

    def _touching(self, bounds: Bounds) -> IntArray:
        xmin, ymin, xmax, ymax = bounds
        hit = (self._low[:, 0] <= xmax) & (self._high[:, 0] >= xmin)
        hit &= (self._low[:, 1] <= ymax) & (self._high[:, 1] >= ymin)
        return np.nonzero(hit)[0]


def _without_doubles(
    points: FloatArray, breaklines: Sequence[Sequence[int]]
) -> tuple[FloatArray, list[list[int]]]:
    """Return points of different X, Y; the highest of doubles stays, as a camera would see it."""
    order = np.lexsort((-points[:, 2], points[:, 1], points[:, 0]))
    keys = np.rint(points[:, :2] / TRIANGLES.same).astype(np.int64)
    _, first, inverse = np.unique(keys[order], axis=0, return_index=True, return_inverse=True)
    new_of_old = np.empty(len(points), np.int64)
    new_of_old[order] = inverse.ravel()
    lines = [[int(new_of_old[i]) for i in line] for line in breaklines]
    return points[order][first], lines


def _halved(
    points: FloatArray, lines: Sequence[Sequence[int]], triangles: NDArray[np.int32]
) -> tuple[FloatArray, list[list[int]], bool]:
    """Insert the middle of every breakline piece that is no edge of a triangle."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    sides = {(min(a, b), max(a, b)) for a, b in edges.tolist()}
    added: list[FloatArray] = []
    place: dict[tuple[int, int], int] = {}
    out = []
    for line in lines:
        longer = [line[0]] if len(line) else []
        for a, b in pairwise(line):
            key = (min(a, b), max(a, b))
            if a != b and key not in sides:
                if key not in place:
                    place[key] = len(points) + len(added)
                    added.append((points[a] + points[b]) / 2)
                longer.append(place[key])
            longer.append(b)
        out.append(longer)
    grown = np.concatenate([points, np.array(added)]) if added else points
    return grown, out, bool(added)


def _planes(corners: FloatArray) -> FloatArray:
    """Return a, b, c of r = a X + b Y + c for triangles, shape (n, 3)."""
    design = corners * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.0]
    # A sliver on the rim has no area: the pseudo-inverse fits its corners as well as it can.
    return (np.linalg.pinv(design) @ corners[:, :, 2:])[:, :, 0]
