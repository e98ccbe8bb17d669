"""Time Pair.intersect with covariances; baseline: numpy's own batched 3x3 solve of as many points.

python benchmarks/bench_intersection.py
"""

from __future__ import annotations

import time

import numpy as np

from bifocal import Pair, Photo

METRES = np.array([[0.00369, 0, -5.67], [0, -0.00369, 3.78], [0, 0, 1.0]])
PAIR = Pair(
    image1=Photo(plane_from_pixel=METRES, nadir=[0, 0], distance=17.5),
    image2=Photo(plane_from_pixel=METRES, nadir=[0.1, 0], distance=9.5),
)


def best_of(action, repeat=5):
    """Return the least CPU time of several runs. [s]."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        action()
        times.append(time.process_time() - start)
    return min(times)


def main() -> None:
    """Check the result, then time three sizes."""
    rng = np.random.default_rng(1)
    for count in (1_000, 100_000, 1_000_000):
        xyz = np.column_stack(
            [rng.uniform(-4, 4, count), rng.uniform(-3, 3, count), rng.uniform(-0.5, 1, count)]
        )
        picks = PAIR.project(xyz)
        assert np.nanmax(np.abs(PAIR.intersect(*picks).xyz - xyz)) < 1e-8
        matrices = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
        ours = best_of(lambda p=picks: PAIR.intersect(*p), 3)
        baseline = best_of(lambda m=matrices, x=xyz: np.linalg.solve(m, x[..., None]), 3)
        print(
            f"{count:>9} points: {ours:7.3f} s CPU, {ours / count * 1e6:.2f} us a point, "
            f"{ours / baseline:.1f} x numpy's batched 3x3 solve"
        )


if __name__ == "__main__":
    main()
