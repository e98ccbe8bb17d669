"""Images of particles: share found, share of none, errors, beside threshold and centroids.

Run: python benchmarks/bench_targets.py

Rendered images with known places (tests/multimedia/targets): alone, at random, crowded, small,
large, faint. Centroids are those of scikit-image's regions above 5 standard deviations of the
noise; where trackpy is installed, it is asked too. CPU time of an image beside that of centroids.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from multimedia import find_targets
from tests.multimedia.targets.rendered_particles import Frame, rendered
from tests.multimedia.targets.test_targets import centroids, matched

SCENES = {
    "alone, 2 to 6 px": {"apart": 8.0},
    "at random": {},
    "crowded": {"count": 1000},
    "2 to 2.5 px": {"diameters": (2.0, 2.5), "apart": 6.0},
    "5 to 6 px": {"diameters": (5.0, 6.0), "apart": 9.0, "count": 200},
    "faint": {"noise": 6.0, "gain": 0.2, "heights": (30.0, 60.0)},
}
SEEDS = (1, 2, 3)


def by_trackpy(image: np.ndarray) -> np.ndarray:
    """Return places that trackpy finds with features of 7 px."""
    import trackpy

    return trackpy.locate(image, 7)[["x", "y"]].to_numpy()


def scored(find: Callable[[np.ndarray], np.ndarray], frames: list[Frame]) -> tuple[float, ...]:
    """Return shares found and of none, RMSE [px], and CPU time of an image [s]."""
    found = none = 0
    errors = []
    start = time.process_time()
    pixels = [find(frame.image) for frame in frames]
    spent = time.process_time() - start
    for frame, places in zip(frames, pixels, strict=True):
        rows, true = matched(frame, places)
        found += len(rows)
        none += len(places) - len(rows)
        errors.append(places[rows] - frame.places[true])
    total = sum(len(frame.places) for frame in frames)
    rmse = float(np.sqrt((np.vstack(errors) ** 2).mean()))
    return found / total, none / max(found + none, 1), rmse, spent / len(frames)


def main() -> None:
    roads = {"multimedia": lambda image: find_targets(image).pixels, "centroids": centroids}
    if find_spec("trackpy") is not None:
        roads["trackpy"] = by_trackpy
    for name, options in SCENES.items():
        frames = [rendered(seed, **options) for seed in SEEDS]
        base = scored(centroids, frames)[3]
        for road, find in roads.items():
            share, none, rmse, spent = scored(find, frames)
            print(
                f"{name:18} {road:11} found {share:6.1%}  none {none:6.1%}  {rmse:.3f} px  "
                f"{spent / base:5.1f} x the time of centroids"
            )


if __name__ == "__main__":
    main()
