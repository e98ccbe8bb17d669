"""Simulated particles, their names, and images through water by Fermat's principle alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: Side of the volume of a flow, its particles being one apart on the average.
SIDE = 10.0


def vortices(speed: float) -> Callable[[np.ndarray], np.ndarray]:
    """Return a flow of vortices, at most so fast."""

    def flow(xyz: np.ndarray) -> np.ndarray:
        x, y, z = 2.0 * np.pi * xyz.T / SIDE
        parts = [np.sin(y) * np.cos(z), np.sin(z) * np.cos(x), np.sin(x) * np.cos(y)]
        return speed / np.sqrt(3.0) * np.column_stack(parts)

    return flow


def simulated(
    flow: Callable[[np.ndarray], np.ndarray] | None, *, speed: float, count: int = 1000,
    frames: int = 30, noise: float = 0.005, missing: float = 0.0, seed: int = 1,
) -> tuple[list[np.ndarray], list[np.ndarray]]:  # fmt: skip
    """Return places and names of particles, in any order; without a flow each has its own way."""
    rng = np.random.default_rng(seed)
    xyz, names, new = rng.uniform(0, SIDE, (count, 3)), np.arange(count), count
    own = rng.standard_normal((count, 3))
    own *= speed * np.cbrt(rng.uniform(size=(count, 1))) / np.linalg.norm(own, axis=1)[:, None]
    places, whose = [], []
    for _ in range(frames):
        seen = np.flatnonzero(rng.uniform(size=count) >= missing)
        rng.shuffle(seen)
        places.append(xyz[seen] + noise * rng.standard_normal((len(seen), 3)))
        whose.append(names[seen])
        if flow is None:
            xyz = xyz + own
        else:
            for _ in range(8):
                xyz = xyz + flow(xyz) / 8.0
        gone = ((xyz < 0) | (xyz > SIDE)).any(axis=1)
        xyz = np.where(gone[:, None], rng.uniform(0, SIDE, xyz.shape), xyz)
        names = np.where(gone, new + np.arange(count), names)
        new += count
    return places, whose


def links_of(whose: list[np.ndarray]) -> np.ndarray:
    """Return the true predecessor of each point, however long ago, -1 for none."""
    names = np.concatenate(whose)
    last: dict[int, int] = {}
    true = np.full(len(names), -1)
    for k, name in enumerate(names.tolist()):
        true[k] = last.get(name, -1)
        last[name] = k
    return true


def seen_through_water(camera, points: np.ndarray, n: float, level: float) -> np.ndarray:
    """Return image points [mm] of a camera in air above plane water at Z = level, by bisection.

    Where a ray crosses the surface the optical path is shortest: its slope changes sign there.
    """
    centre = np.asarray(camera.centre)
    height, depth = centre[2] - level, level - points[:, 2]
    away = points[:, :2] - centre[:2]
    radius = np.hypot(*away.T)
    low, high = np.zeros(len(points)), radius.copy()
    for _ in range(80):
        middle = 0.5 * (low + high)
        slope = middle / np.hypot(middle, height)
        slope -= n * (radius - middle) / np.hypot(radius - middle, depth)
        low, high = np.where(slope < 0, middle, low), np.where(slope < 0, high, middle)
    share = low / np.maximum(radius, 1e-300)
    ray = np.column_stack([away * share[:, None], np.full(len(points), -height)])
    x, y, z = (ray @ np.asarray(camera.rotation)).T
    return -camera.principal_distance * np.column_stack([x / z, y / z])
