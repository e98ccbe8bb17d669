"""Radial shift: time per point, beside liboptv (``pip install optv``) where it is installed.

Run: python benchmarks/bench_shift.py [POINTS]

Set-up: air 500 mm, glass 10 mm, water 0 to 200 mm, points uniform in X, Y within 150 mm. One core,
CPU time, best of several. Every result is compared with a long-double solution before timing.
"""

from __future__ import annotations

import os

os.environ["OMP_NUM_THREADS"] = "1"

import sys
import time
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from multimedia import Layers, ShiftTable, iterated_radius, radial_shift

LAYERS = Layers(indices=(1.0, 1.5, 1.34), thicknesses=(10.0,))
HEIGHT = 500.0


def reference(radius: np.ndarray, depth: np.ndarray, height: float = HEIGHT) -> np.ndarray:
    """Return the shift in long double (x86: 64 bits of mantissa), by plain Newton from below."""
    r, h3 = radius.astype(np.longdouble), depth.astype(np.longdouble)
    heights = [np.longdouble(height), np.longdouble(LAYERS.thicknesses[0]), h3]
    indices = [np.longdouble(n) for n in LAYERS.indices]
    t = r / sum(h / n for h, n in zip(heights, indices, strict=True))
    for _ in range(30):
        root = [np.sqrt(n * n + (n * n - 1) * t * t) for n in indices]
        value = sum(h * t / q for h, q in zip(heights, root, strict=True))
        slope = sum(h * n * n / q**3 for h, n, q in zip(heights, indices, root, strict=True))
        t = t + (r - value) / slope
    return sum(heights) * t


def nanoseconds(work: Callable[[], object], points: int, repeats: int) -> float:
    """Return the least CPU time per point."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times) / points * 1e9


def optv_work(radius: np.ndarray, depth: np.ndarray) -> Callable[[], np.ndarray] | None:
    """Return liboptv's shift through its Python binding: its projection with a trivial camera."""
    if find_spec("optv") is None:
        return None
    from optv.calibration import Calibration
    from optv.imgcoord import flat_image_coordinates
    from optv.parameters import MultimediaParams

    media = MultimediaParams(
        n1=LAYERS.indices[0], n2=[LAYERS.indices[1]], n3=LAYERS.indices[2], d=LAYERS.thicknesses
    )
    camera = Calibration()
    # The water side of the glass is at Z = 1 mm (its vector must not be zero), the camera looks
    # straight down with a camera constant of 1 mm, so the image coordinate is tan(beta 1).
    camera.set_pos(np.array([0.0, 0.0, 1.0 + LAYERS.thicknesses[0] + HEIGHT]))
    camera.set_angles(np.zeros(3))
    camera.set_primary_point(np.array([0.0, 0.0, 1.0]))
    camera.set_glass_vec(np.array([0.0, 0.0, 1.0]))
    points = np.column_stack([radius, np.zeros_like(radius), 1.0 - depth])
    total = HEIGHT + LAYERS.thicknesses[0] + depth
    return lambda: np.abs(flat_image_coordinates(points, camera, media)[:, 0]) * total


def main() -> None:
    """Check, time, print."""
    points = int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000
    rng = np.random.default_rng(20240601)
    radius = np.hypot(*rng.uniform(-150, 150, (2, points)))
    depth = rng.uniform(0, 200, points)
    sample = rng.choice(points, min(points, 100_000), replace=False)
    truth = reference(radius[sample], depth[sample])
    heights = [np.asarray(HEIGHT), np.asarray(LAYERS.thicknesses[0]), depth]

    def table(degree: int) -> ShiftTable:
        return ShiftTable(
            z0=HEIGHT, layers=LAYERS, max_radius=215.0, depths=(0.0, 200.0), degree=degree
        )

    bilinear, bicubic = table(1), table(3)
    rows: list[tuple[str, Callable[[], np.ndarray], int]] = [
        ("exact, numpy", lambda: radial_shift(radius, z0=HEIGHT, zp=depth, layers=LAYERS), 7),
        (f"table, bilinear, {bilinear.entries} entries", lambda: bilinear(radius, zp=depth), 5),
        (f"table, bicubic, {bicubic.entries} entries", lambda: bicubic(radius, zp=depth), 5),
        (
            "papers' iteration, 1e-4 mm",
            lambda: (
                iterated_radius(
                    radius, heights, LAYERS.indices, tolerance=1e-4, over_compensation=None
                ).radius_bar
            ),
            1,
        ),
    ]
    liboptv = optv_work(radius, depth)
    if liboptv is not None:
        rows.append(("liboptv (projection, 1e-3 mm)", liboptv, 3))
    results = []
    for name, work, repeats in rows:
        error = float(np.abs(work()[sample] - truth).max())
        if error > (1.2e-13 if name.startswith("exact") else 2e-3):
            raise SystemExit(f"{name}: wrong by {error:.1e} mm, not timed")
        results.append((name, nanoseconds(work, points, repeats), error))
    base = results[-1] if liboptv is not None else None
    print(f"{points} points, one core")
    print(f"{'':34s} {'ns/point':>9s} {'largest error':>14s} {'times faster':>13s}")
    for name, spent, error in results:
        ratio = f"{base[1] / spent:13.1f}" if base else ""
        print(f"{name:34s} {spent:9.1f} {error:11.1e} mm {ratio}")
    if base is None:
        print("liboptv: not installed (pip install optv)")


if __name__ == "__main__":
    main()
