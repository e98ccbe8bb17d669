"""Ray casting: where rays meet a scene, and which of its points the sun reaches.

Rays are straight lines from a pinhole (or parallel ones) met with half-spaces and quadrics. Nothing
here knows nadirs, zoom factors or homographies, so it can stand as the truth for what does.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tests.scenes.arrays import BoolArray, FloatArray
from tests.scenes.shapes import Convex, Material, Scene

Faces = NDArray[np.int32]

#: Distances below this are the surface itself. [m]
SKIN = 1e-7


class View(Protocol):
    """Rays of one origin or direction: each is one point of a two-dimensional view."""

    def view_of(self, points: FloatArray) -> FloatArray:
        """Return the view coordinates of points, shape (..., 2)."""


class Parallel:
    """Parallel rays along a direction (looking square on the wall, or along the sunlight)."""

    def __init__(self, direction: FloatArray) -> None:
        self.direction = direction

    def view_of(self, points: FloatArray) -> FloatArray:
        """Return where the parallel through each point meets Z = 0."""
        along = points[..., 2:] / self.direction[2]
        return points[..., :2] - along * self.direction[:2]


class FaceTable(NamedTuple):
    """All faces of a scene: 0 is the wall, then each solid's and each cavity's in order."""

    normals: FloatArray
    materials: list[Material]
    bodies: NDArray[np.int32]
    first_of_solid: list[int]
    first_of_cavity: list[int]


def face_table(scene: Scene) -> FaceTable:
    """Return all faces: a body's quadric after its planes, a cavity's normals inwards."""
    normals: list[FloatArray] = [np.array([0.0, 0.0, 1.0])]
    materials, bodies = [scene.wall], [-1]
    firsts: tuple[list[int], list[int]] = ([], [])
    for kind, sign in ((0, 1.0), (1, -1.0)):
        for number, body in enumerate((scene.solids, scene.cavities)[kind]):
            firsts[kind].append(len(normals))
            normals.extend(sign * body.planes[:, :3])
            count = len(body.planes)
            if body.round_part is not None:
                normals.append(np.zeros(3))  # varies: see `normals_at`
                count += 1
            materials.extend([body.material] * count)
            bodies.extend([number + kind * len(scene.solids)] * count)
    return FaceTable(
        np.array(normals), materials, np.array(bodies, dtype=np.int32), firsts[0], firsts[1]
    )


class Tracer:
    """Casts tiles of rays that share a view."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.table = face_table(scene)
        self._boxes = np.array([body.box for body in (*scene.solids, *scene.cavities)])

    def bounds(self, view: View) -> FloatArray:
        """Return the view rectangle of every body, shape (bodies, 4): low, high."""
        bulge, steps = getattr(view, "bulge", 0.0), getattr(view, "steps", 1)
        if not len(self._boxes):
            return np.zeros((0, 4))
        edges = _along_edges(self._boxes, steps)
        seen = view.view_of(edges.reshape(-1, 3)).reshape(*edges.shape[:2], 2)
        return np.concatenate([seen.min(1) - bulge, seen.max(1) + bulge], axis=1)

    def cast(
        self, origins: FloatArray, rays: FloatArray, seen: FloatArray, bounds: FloatArray
    ) -> tuple[FloatArray, Faces]:
        """Return the ray parameter and the face of the first hit of each ray.

        Parameters
        ----------
        origins : ndarray, shape (3,) or (n, 3)
            Start of the rays, before the wall. [m]
        rays : ndarray, shape (n, 3)
            Directions, not normalised, with negative Z.
        seen : ndarray, shape (n, 2)
            View coordinates of the rays.
        bounds : ndarray
            From `bounds` of the same view.
        """
        origins = np.broadcast_to(origins, rays.shape)
        seen = np.asfortranarray(seen)
        distance = -origins[:, 2] / rays[:, 2]
        face = np.zeros(len(rays), dtype=np.int32)
        count = len(self.scene.solids)
        near = self._near(seen, bounds)
        floors: dict[int, int] = {-1: 0}
        for number, cavity in enumerate(self.scene.cavities):
            first = self.table.first_of_cavity[number]
            floors[number] = first + int(np.argmin(cavity.planes[:, 2]))
            if near[count + number]:
                some = np.flatnonzero(
                    _inside(seen, bounds[count + number]) & (face == floors[cavity.parent])
                )
                self._sink(cavity, first, some, origins, rays, distance, face)
        for number in np.flatnonzero(near[:count]).tolist():
            body = self.scene.solids[number]
            some = np.flatnonzero(_inside(seen, bounds[number]))
            if not len(some):
                continue
            enter, leave, which = crossing(body, origins[some], rays[some])
            hit = (enter < leave) & (enter < distance[some]) & (enter > 0)
            distance[some[hit]] = enter[hit]
            face[some[hit]] = self.table.first_of_solid[number] + which[hit]
        return distance, face

    def _sink(
        self,
        cavity: Convex,
        first: int,
        at: NDArray[np.int64],
        origins: FloatArray,
        rays: FloatArray,
        distance: FloatArray,
        face: Faces,
    ) -> None:
        """Let those rays that meet the cavity's opening go on to its far side."""
        if not len(at):
            return
        start = origins[at] + rays[at] * distance[at, None]
        walls = cavity.planes[cavity.planes[:, 2] <= 0]  # all but the open top
        at = at[_all_below(walls, start)]
        if not len(at):
            return
        slope = cavity.planes[:, :3] @ rays[at].T
        gap = cavity.planes[:, 3:] - cavity.planes[:, :3] @ origins[at].T
        with np.errstate(divide="ignore", invalid="ignore"):
            leave = np.where(slope > 0, gap / slope, np.inf)
        which = leave.argmin(0)
        distance[at] = leave.min(0)
        face[at] = first + which

    def lit(self, points: FloatArray, bounds: FloatArray, sun: Parallel) -> BoolArray:
        """Return which points the sun reaches, shape (n,)."""
        seen = np.asfortranarray(sun.view_of(points))
        direction = sun.direction
        free = np.ones(len(points), dtype=bool)
        near = self._near(seen, bounds)
        count = len(self.scene.solids)
        for number in np.flatnonzero(near[:count]):
            some = np.flatnonzero(_inside(seen, bounds[number]) & free)
            if len(some):
                rays = np.broadcast_to(direction, (len(some), 3))
                enter, leave, _ = crossing(self.scene.solids[number], points[some], rays)
                free[some[(enter < leave - SKIN) & (enter > SKIN)]] = False
        for number in np.flatnonzero(near[count:]):
            cavity = self.scene.cavities[number]
            top = cavity.box[1, 2]
            # The floor is left out: a point of a deeper, nested cavity has to pass here as well.
            walls = cavity.planes[np.abs(cavity.planes[:, 2]) < 0.999]
            some = np.flatnonzero(_inside(seen, bounds[count + number]) & free)
            some = some[points[some, 2] < top - SKIN]
            some = some[_all_below(walls, points[some], SKIN)]
            if len(some):
                rise = (top - points[some, 2]) / direction[2]
                out = points[some] + rise[:, None] * direction
                free[some[~_all_below(walls, out)]] = False
        return free

    def normals_at(self, points: FloatArray, face: Faces) -> FloatArray:
        """Return outward unit normals at points of given faces, shape (n, 3)."""
        normals = self.table.normals[face]
        for body, first in zip(self.scene.solids, self.table.first_of_solid, strict=True):
            if body.round_part is not None:
                on = np.flatnonzero(face == first + len(body.planes))
                if len(on):
                    shape = body.round_part
                    slope = (points[on] - shape.centre) * shape.weights**2
                    normals[on] = slope / np.linalg.norm(slope, axis=1, keepdims=True)
        return normals

    @staticmethod
    def _near(seen: FloatArray, bounds: FloatArray) -> BoolArray:
        """Return which bodies overlap the rectangle of these rays."""
        if not len(seen):
            return np.zeros(len(bounds), dtype=bool)
        low, high = seen.min(0), seen.max(0)
        return (bounds[:, :2] <= high).all(1) & (bounds[:, 2:] >= low).all(1)


def crossing(
    body: Convex, origins: FloatArray, rays: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return where rays enter and leave a convex body, and through which face they enter."""
    # Faces first, rays last: reductions then run along memory.
    slope = body.planes[:, :3] @ rays.T
    gap = body.planes[:, 3:] - body.planes[:, :3] @ origins.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = gap / slope
    inwards = slope < 0
    enter_all = np.where(inwards, at, -np.inf)
    parallel = slope == 0
    if parallel.any():
        enter_all[parallel & (gap < 0)] = np.inf
        at[parallel] = np.inf
    at[inwards] = np.inf
    which = enter_all.argmax(0)
    enter, leave = enter_all.max(0), at.min(0)
    if body.round_part is not None:
        shape = body.round_part
        start, step = (origins - shape.centre) * shape.weights, rays * shape.weights
        a, b = (step * step).sum(1), (start * step).sum(1)
        root = b * b - a * ((start * start).sum(1) - 1)
        with np.errstate(invalid="ignore", divide="ignore"):
            half = np.sqrt(root)
            first = np.where(root > 0, (-b - half) / a, np.inf)
            last = np.where(root > 0, (-b + half) / a, -np.inf)
        which = np.where(first > enter, len(body.planes), which)
        enter, leave = np.maximum(enter, first), np.minimum(leave, last)
    return enter, leave, which


def _along_edges(boxes: FloatArray, steps: int) -> FloatArray:
    """Return points along the edges of boxes, corners included, shape (boxes, n, 3)."""
    share = np.linspace(0.0, 1.0, steps + 1)
    edges = []
    for axis in range(3):
        sides = [np.array([0.0, 1.0])] * 3
        sides[axis] = share
        grid = np.meshgrid(*sides, indexing="ij")
        edges.append(np.stack([part.ravel() for part in grid], axis=-1))
    low, high = boxes[:, :1], boxes[:, 1:]
    return np.asarray(low + np.concatenate(edges) * (high - low))


def _inside(seen: FloatArray, rectangle: FloatArray) -> BoolArray:
    """Return which view points lie in a rectangle."""
    x, y = seen[:, 0], seen[:, 1]
    return (x >= rectangle[0]) & (x <= rectangle[2]) & (y >= rectangle[1]) & (y <= rectangle[3])


def _all_below(planes: FloatArray, points: FloatArray, slack: float = 0.0) -> BoolArray:
    """Return which points lie in all half-spaces."""
    return np.asarray((planes[:, :3] @ points.T <= planes[:, 3:] + slack).all(0))
