"""Exact answers about a scene: relief seen square on, and what each camera can see."""

from __future__ import annotations

import numpy as np

from bifocal import Grid, ReliefMap
from tests.scenes.arrays import BoolArray, FloatArray
from tests.scenes.cameras import SceneCamera
from tests.scenes.tracing import Faces, Parallel, Tracer

#: A point is seen if nothing lies this much before it. [m]
CLEARANCE = 1e-4
_DOWN = np.array([0.0, 0.0, -1.0])
_ROWS = 64


def look_square_on(tracer: Tracer, places: FloatArray) -> tuple[FloatArray, Faces]:
    """Return relief and face at places (X, Y) of the plane, shape (n,). [m]"""
    view = Parallel(_DOWN)
    height = 100.0
    origins = np.column_stack([places, np.full(len(places), height)])
    rays = np.broadcast_to(_DOWN, origins.shape)
    distance, face = tracer.cast(origins, rays, places, tracer.bounds(view))
    return height - distance, face


def relief_truth(
    tracer: Tracer, *, bounds: tuple[float, float, float, float], gsd: float
) -> ReliefMap:
    """Return the exact relief map over bounds."""
    grid = Grid.from_bounds(bounds, gsd=gsd)
    height, width = grid.shape
    relief = np.empty((height, width), dtype=np.float32)
    x = grid.columns_x
    for top in range(0, height, _ROWS):
        y = grid.rows_y[top : top + _ROWS]
        for left in range(0, width, 256):
            part = x[left : left + 256]
            places = np.stack(np.meshgrid(part, y), axis=-1).reshape(-1, 2)
            found = look_square_on(tracer, places)[0].reshape(len(y), len(part))
            relief[top : top + len(y), left : left + len(part)] = found
    return ReliefMap.from_relief(relief, plane_from_pixel=grid.plane_from_pixel)


def visible_from(tracer: Tracer, camera: SceneCamera, truth: ReliefMap) -> BoolArray:
    """Return which points of the exact relief map a camera sees, shape (height, width)."""
    height, width = truth.shape
    seen = np.zeros((height, width), dtype=bool)
    bounds = tracer.bounds(camera)
    for top in range(0, height, _ROWS):
        rows = slice(top, min(top + _ROWS, height))
        places = truth.plane_positions(rows)
        for left in range(0, width, 256):
            columns = slice(left, min(left + 256, width))
            part = places[:, columns].reshape(-1, 2)
            points = np.column_stack([part, truth.r[rows, columns].ravel().astype(np.float64)])
            found = sees(tracer, camera, points, bounds)
            seen[rows, columns] = found.reshape(-1, columns.stop - left)
    return seen


def sees(
    tracer: Tracer, camera: SceneCamera, points: FloatArray, bounds: FloatArray | None = None
) -> BoolArray:
    """Return which points lie in the photo with nothing before them, shape (n,)."""
    origins, rays = camera.aimed(points)
    pixels = camera.view_of(points)
    distance, _ = tracer.cast(
        origins, rays, pixels, tracer.bounds(camera) if bounds is None else bounds
    )
    limit = np.array(camera.size)
    inside = ((pixels >= -0.5) & (pixels < limit - 0.5)).all(1)
    length = np.linalg.norm(rays, axis=1)
    return np.asarray(inside & ((1 - distance) * length < CLEARANCE))
