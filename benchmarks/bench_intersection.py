"""Time intersections with covariances; baseline: numpy's own batched 3x3 solve of as many points.

    python benchmarks/bench_intersection.py

`Pair.intersect`, and `multimedia.intersect` of noisy points in a tank that four cameras see through
glass, without and with the kernel that the extra ``fast`` compiles.
"""

from __future__ import annotations

import time
from dataclasses import replace
from functools import partial
from unittest import mock

import numpy as np

from bifocal import Pair, Photo
from multimedia import Brown, Camera, Layers, intersect, project
from multimedia.orientation.point_kernel import settled_points
from photocore.compiled import Kernel

METRES = np.array([[0.00369, 0, -5.67], [0, -0.00369, 3.78], [0, 0, 1.0]])
PAIR = Pair(
    image1=Photo(plane_from_pixel=METRES, nadir=[0, 0], distance=17.5),
    image2=Photo(plane_from_pixel=METRES, nadir=[0.1, 0], distance=9.5),
)
GLASS = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(10.0,))
EYES = ((20.0, 10.0, 520.0), (300.0, 30.0, 450.0), (-300.0, -20.0, 450.0), (10.0, 310.0, 450.0))
NOISE = 0.003


def best_of(action, repeat=5):
    """Return the least CPU time of several runs. [s]."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return min(times)


def baseline(count: int, repeat: int = 3) -> float:
    """Return the CPU time of numpy's solve of as many 3x3 systems. [s]."""
    matrices = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
    right = np.ones((count, 3, 1))
    return best_of(lambda: np.linalg.solve(matrices, right), repeat)


def pair(count: int, rng: np.random.Generator) -> None:
    """Check and time a bifocal pair."""
    xyz = np.column_stack(
        [rng.uniform(-4, 4, count), rng.uniform(-3, 3, count), rng.uniform(-0.5, 1, count)]
    )
    picks = PAIR.project(xyz)
    assert np.nanmax(np.abs(PAIR.intersect(*picks).xyz - xyz)) < 1e-8
    ours = best_of(lambda: PAIR.intersect(*picks), 3)
    print(
        f"{count:>9} points, pair: {ours:7.3f} s CPU, {ours / count * 1e6:.2f} us a point, "
        f"{ours / baseline(count):.1f} x numpy's batched 3x3 solve"
    )


def four_cameras(count: int, rng: np.random.Generator) -> None:
    """Check and time both roads through glass, with lenses and without."""
    points = rng.uniform((-70, -60, -180), (70, 60, -20), (count, 3))
    for name, lens in (("no distortion", Brown()), ("lenses", Brown(k1=2e-5, p1=1e-5))):
        views = [
            replace(Camera.looking_at(eye, (0, 0, -100), principal_distance=25.0), distortion=lens)
            for eye in EYES
        ]
        image = np.stack([project(camera, points, GLASS) for camera in views])
        image += rng.normal(0, NOISE, image.shape)
        spent, found = {}, {}
        for road in (False, True):
            with mock.patch.object(Kernel, "pays", lambda *_, road=road: road):
                found[road] = intersect(views, image, GLASS, sigma=NOISE)  # compiles it
                spent[road] = best_of(partial(intersect, views, image, GLASS, sigma=NOISE), 3)
        assert np.abs(found[True].xyz - found[False].xyz).max() < 1e-9
        assert np.abs(found[True].sigma0 - found[False].sigma0).max() < 1e-9
        plain, fast = (spent[road] / count * 1e6 for road in (False, True))
        print(
            f"{count:>9} points, four cameras, {name}: numpy {plain:.2f} us a point, compiled "
            f"{fast:.2f}, {plain / fast:.1f} x; {spent[True] / baseline(count):.1f} x numpy's "
            "batched 3x3 solve"
        )


def main() -> None:
    """Check the results, then time three sizes."""
    rng = np.random.default_rng(1)
    for count in (1_000, 100_000, 1_000_000):
        pair(count, rng)
    if settled_points.machine_code() is settled_points.plain:
        print("the extra fast is not installed: numpy twice")
    for count in (10_000, 100_000, 1_000_000):
        four_cameras(count, rng)


if __name__ == "__main__":
    main()
