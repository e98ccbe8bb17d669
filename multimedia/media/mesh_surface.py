"""A water surface as a triangle mesh, such as the triangulated tie points on the water."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.height_field import HeightField
from multimedia.remarks import remark
from photocore.arrays import BoolArray, FloatArray, IntArray, as_floats, read_only
from photocore.errors import InputError

#: A position this far outside a triangle (in barycentric units) still belongs to it.
EDGE_SLACK = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeshSurface(HeightField):
    """Triangles over X and Y without overhangs; they stand for a smooth surface.

    A ray meets the flat facets but is bent at a normal that passes smoothly from vertex to vertex:
    water has no edges, and at the edges of flat facets some points would have no ray at all.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3)
        Corner points.
    triangles : ndarray of int, shape (m, 3)
        Three vertex numbers per triangle, counted from 0, in any sense of rotation.
    source : str
        File it was read from; a project file names it.
    """

    vertices: FloatArray
    triangles: IntArray
    source: str = ""
    _facet: FloatArray = field(init=False, repr=False)
    _corner: FloatArray = field(init=False, repr=False)
    _to_corners: FloatArray = field(init=False, repr=False)
    _corner_slopes: FloatArray = field(init=False, repr=False)
    _grid: TriangleCells = field(init=False, repr=False)

    def __post_init__(self) -> None:
        vertices = read_only(self.vertices, "vertices")
        if vertices.ndim != 2 or vertices.shape[1:] != (3,):
            raise InputError(f"vertices: expected shape (n, 3), found {vertices.shape}.")
        triangles = np.array(self.triangles, dtype=np.int64)
        if triangles.ndim != 2 or triangles.shape[1:] != (3,) or not len(triangles):
            raise InputError(f"triangles: expected shape (m, 3), found {triangles.shape}.")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise InputError(
                f"triangles: vertex numbers must lie in 0 ... {len(vertices) - 1}; "
                f"found {triangles.min()} ... {triangles.max()}."
            )
        edges = np.diff(vertices[triangles], axis=1)  # two edges per triangle, from its corners
        area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
        if not (np.abs(area) > 0).all():
            raise InputError(
                f"triangles: {int((area == 0).sum())} of {len(area)} triangles have no extent in X "
                "and Y; a water surface has no vertical faces. Remove them."
            )
        _refuse_folds(vertices, triangles, area)
        triangles.setflags(write=False)
        corners = vertices[triangles]
        # (b1, b2) = _to_corners @ (xy - corner 0); b0 = 1 - b1 - b2.
        sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
        to_corners = np.linalg.inv(sides[:, :2, :])
        facet = np.einsum("mk,mki->mi", sides[:, 2, :], to_corners)
        # Vertex slope: mean of the facets around it, weighted by their area.
        area = np.abs(area)
        total, weight = np.zeros((len(vertices), 2)), np.zeros(len(vertices))
        for corner in range(3):
            np.add.at(total, triangles[:, corner], facet * area[:, None])
            np.add.at(weight, triangles[:, corner], area)
        heights = corners[..., 2]
        margin = 1e-9 * max(1.0, float(np.abs(heights).max()))
        # Slivers along the hull of a triangulation may stand on edge; they are no waves.
        real = area > 1e-2 * np.median(area)
        self._keep(
            vertices=vertices,
            triangles=triangles,
            lowest=float(heights.min()) - margin,
            highest=float(heights.max()) + margin,
            steepest=float(np.hypot(*facet[real].T).max()),
            feature=float(np.sqrt(np.median(area))),
            _facet=facet,
            _corner=corners[:, 0],
            _to_corners=to_corners,
            _corner_slopes=total / np.where(weight > 0, weight, 1.0)[:, None],
            _grid=TriangleCells.over(corners[..., :2]),
        )

    def _locate(self, xy: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the triangle below each position (-1: none) and its barycentric coordinates."""
        triangle = np.full(len(xy), -1, dtype=np.int64)
        share = np.zeros((len(xy), 3))
        start, count = self._grid.candidates(xy)
        for number in range(int(count.max(initial=0))):
            rows = np.flatnonzero((triangle < 0) & (number < count))
            if not rows.size:
                break
            tried = self._grid.members[start[rows] + number]
            offset = xy[rows] - self._corner[tried, :2]
            b12 = np.einsum("nij,nj->ni", self._to_corners[tried], offset)
            b = np.column_stack([1 - b12.sum(-1), b12])
            inside = (b >= -EDGE_SLACK).all(-1)
            triangle[rows[inside]] = tried[inside]
            share[rows[inside]] = b[inside]
        return triangle, share

    def covers(self, xy: FloatArray) -> BoolArray:
        """Return whether a triangle lies there."""
        return self._locate(xy)[0] >= 0

    def heights(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the height of the facet and its gradient; the mean level outside the mesh."""
        triangle, _ = self._locate(xy)
        inside = triangle >= 0
        gradient = np.where(inside[:, None], self._facet[triangle], 0.0)
        corner = self._corner[triangle]
        height = corner[:, 2] + (gradient * (xy - corner[:, :2])).sum(-1)
        return np.where(inside, height, self.middle), gradient

    def slopes(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the slope between the vertices' slopes, and its derivative."""
        triangle, share = self._locate(xy)
        corners = self._corner_slopes[self.triangles[triangle]]
        slope = np.einsum("nk,nki->ni", share, corners)
        to_corners = self._to_corners[triangle]
        rise = corners[:, 1:] - corners[:, :1]
        return slope, np.einsum("nki,nkj->nij", rise, to_corners)

    def shifted(self, vector: ArrayLike) -> MeshSurface:
        """Return the mesh moved by a vector."""
        return replace(self, vertices=self.vertices + as_floats(vector, "vector"), source="")


def _refuse_folds(vertices: FloatArray, triangles: IntArray, area: FloatArray) -> None:
    """Refuse triangles on the same side of a common edge: there the surface is folded back.

    Raises
    ------
    InputError
        With the place of the first. Triangles that share no vertex numbers are not compared.
    """
    first, second, third = triangles.T
    ends = np.sort(np.concatenate([[first, second], [second, third], [third, first]], axis=1).T)
    # Along the edge from its lower vertex number the triangle lies left or right.
    turned = np.sign(np.concatenate([second - first, third - second, first - third]))
    side = turned * np.tile(np.sign(area), 3)
    order = np.lexsort((side, ends[:, 1], ends[:, 0]))
    ends, side = ends[order], side[order]
    same = (ends[1:] == ends[:-1]).all(axis=1) & (side[1:] == side[:-1])
    if same.any():
        x, y = vertices[ends[int(same.argmax())], :2].mean(axis=0)
        raise InputError(remark("surface.overhang", count=int(same.sum()), x=x, y=y))


@dataclass(frozen=True, slots=True, eq=False)
class TriangleCells:
    """Square cells, each with the triangles whose bounding box touches it."""

    low: FloatArray
    cell: float
    shape: tuple[int, int]
    starts: IntArray
    members: IntArray

    @classmethod
    def over(cls, corners: FloatArray) -> TriangleCells:
        """Sort triangles, shape (m, 3, 2), into about as many cells as there are triangles."""
        low, high = corners.min((0, 1)), corners.max((0, 1))
        extent = high - low
        cell = float(max(np.sqrt(extent.prod() / len(corners)), extent.max() / 2000))
        shape = np.maximum(np.ceil(extent / cell).astype(np.int64), 1)
        first = np.clip(((corners.min(1) - low) / cell - 1e-6).astype(np.int64), 0, shape - 1)
        last = np.clip(((corners.max(1) - low) / cell + 1e-6).astype(np.int64), 0, shape - 1)
        wide, tall = (last - first + 1).T
        # Every (triangle, cell) pair: number each cell within the triangle's box, then unfold it.
        triangle = np.repeat(np.arange(len(corners)), wide * tall)
        offset = np.arange(len(triangle)) - np.repeat(
            np.cumsum(wide * tall) - wide * tall, wide * tall
        )
        column = first[triangle, 0] + offset % wide[triangle]
        row = first[triangle, 1] + offset // wide[triangle]
        key = row * shape[0] + column
        order = np.argsort(key, kind="stable")
        starts = np.searchsorted(key[order], np.arange(shape.prod() + 1))
        return cls(low, cell, (int(shape[0]), int(shape[1])), starts, triangle[order])

    def candidates(self, xy: FloatArray) -> tuple[IntArray, IntArray]:
        """Return where the candidates of each position start and how many they are."""
        with np.errstate(invalid="ignore"):
            place = (xy - self.low) / self.cell
            near = np.all((place >= -1e-6) & (place <= np.array(self.shape) + 1e-6), axis=-1)
        place = np.where(near[:, None], place, 0.0)
        column, row = np.clip(place.astype(np.int64), 0, np.array(self.shape) - 1).T
        key = row * self.shape[0] + column
        start = self.starts[key]
        return start, np.where(near, self.starts[key + 1] - start, 0)
