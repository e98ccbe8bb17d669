"""Bathymetric correction: accuracy and time beside Dietrich's (2017) mean over the cameras.

Run: python benchmarks/bench_bathymetry.py

Baseline: the per-camera depth correction of Dietrich 2017 as pyBathySfM does it (h = ha tan r /
tan i for every camera, then the mean), written here in numpy. Scene: points 0.1 to 12.6 m deep,
seen by 2 to 9 cameras within 40 degrees, exact rays; the apparent points are where the straight
rays meet best. Percentages are of the root mean square depth; CPU time, one core.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"

import time

import numpy as np

import multimedia as mm

N, LEVEL = 1.34, 100.0


def scene(count: int, surface, *, by_image: bool, seed: int = 5):
    """Return true points, apparent points, cameras and visibility."""
    rng = np.random.default_rng(seed)
    depth = LEVEL - 0.5 - rng.uniform(0.1, 12.6, count)
    true = np.column_stack([rng.uniform(-40, 40, (count, 2)), depth])
    cameras = np.column_stack([rng.uniform(-70, 70, (60, 2)), rng.uniform(150, 175, 60)])
    offset = cameras - true[:, None]
    able = np.hypot(offset[..., 0], offset[..., 1]) < np.tan(np.radians(40)) * offset[..., 2]
    rank = np.where(able, rng.random(able.shape), 2.0).argsort(axis=1).argsort(axis=1)
    seen = able & (rank < rng.integers(2, 10, count)[:, None])
    row, camera = np.nonzero(seen)
    water = mm.Interfaces(surfaces=(surface,), indices=(1.0, N))
    u = mm.aim_rays(cameras[camera], true[row], water).directions[:, 0]
    across = np.eye(3) - u[:, :, None] * u[:, None, :]
    starts = np.searchsorted(row, np.arange(count))
    apparent, weight = true, np.ones(len(row))
    for _ in range(15 if by_image else 1):
        normal = np.add.reduceat(weight[:, None, None] * across, starts)
        right = np.add.reduceat(
            weight[:, None] * np.einsum("kij,kj->ki", across, cameras[camera]), starts
        )
        apparent = np.linalg.solve(normal, right[..., None])[..., 0]
        weight = 1 / ((apparent[row] - cameras[camera]) ** 2).sum(-1)
    return true, apparent, cameras, seen


def dietrich(apparent: np.ndarray, cameras: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Return corrected points: mean over the cameras of ha tan(r) / tan(i)."""
    offset = cameras - apparent[:, None]
    r = np.arctan2(np.hypot(offset[..., 0], offset[..., 1]), offset[..., 2])
    i = np.arcsin(np.sin(r) / N)
    depth = (LEVEL - apparent[:, None, 2]) * np.tan(r) / np.tan(i)
    mean = (depth * seen).sum(-1) / seen.sum(-1)
    return np.column_stack([apparent[:, :2], LEVEL - mean])


def report(name: str, found: np.ndarray, true: np.ndarray, seconds: float, rays: int) -> float:
    """Print one line; return the share of the depth."""
    error = found - true
    rms = np.sqrt(((LEVEL - true[:, 2]) ** 2).mean())
    z = 100 * np.sqrt((error[:, 2] ** 2).mean()) / rms
    xy = 100 * np.sqrt((error[:, :2] ** 2).sum(-1).mean()) / rms
    print(f"  {name:32s} z {z:9.2e} %  x, y {xy:9.2e} %  {1e9 * seconds / rays:8.0f} ns per ray")
    return float(z)


def main() -> None:
    surfaces = {
        "flat": mm.Plane.level(LEVEL),
        "waves (5 cm, 4 m long)": mm.WaveSurface.sinusoid(LEVEL, amplitude=0.05, wavelength=4.0),
    }
    for title, surface in surfaces.items():
        for by_image in (True, False):
            count = 20_000 if title == "flat" else 1000
            true, apparent, cameras, seen = scene(count, surface, by_image=by_image)
            rays = int(seen.sum())
            how = "in the images" if by_image else "in space"
            print(f"{title}, {count} points, {rays} rays, balanced {how}:")
            report("as measured", apparent, true, 0.0, rays)
            start = time.process_time()
            nadir = mm.correct_bathymetry(apparent, water_level=LEVEL, refractive_index=N).xyz
            report("nadir, times n", nadir, true, time.process_time() - start, rays)
            start = time.process_time()
            peer = dietrich(apparent, cameras, seen)
            worse = report("Dietrich 2017", peer, true, time.process_time() - start, rays)
            start = time.process_time()
            ours = mm.correct_bathymetry(
                apparent, water_level=surface, refractive_index=N, cameras=cameras, visible=seen
            ).xyz
            ok = np.isfinite(ours).all(-1)
            z = report("multimedia", ours[ok], true[ok], time.process_time() - start, rays)
            assert ok.mean() > 0.999
            assert z < min(1.0, worse)


if __name__ == "__main__":
    main()
