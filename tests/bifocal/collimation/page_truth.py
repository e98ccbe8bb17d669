"""What is true of the sample pair, from the ray caster that rendered it."""

from __future__ import annotations

import csv

import numpy as np

from bifocal import SAMPLE
from tests.scenes import bifocal_cameras, demo_scene
from tests.scenes.make_sample import PIXEL, SIZE

#: Targets half hidden by a moulding or cut by a shadow, in one photo at least.
SPOILT = ("T06", "T12", "T13", "T32")


def true_pixels() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the exact pixels of the sample's targets in both photos."""
    cameras = bifocal_cameras(size=SIZE, pixel=PIXEL)
    with (SAMPLE / "targets.csv").open(encoding="utf-8", newline="") as file:
        relief = {row["id"]: float(row["r measured [m]"]) for row in csv.DictReader(file)}
    found = {}
    for target in demo_scene().targets:
        if target.name in relief:
            xyz = np.array([[*target.position, relief[target.name]]])
            found[target.name] = (cameras.far.view_of(xyz)[0], cameras.near.view_of(xyz)[0])
    return found


def noisy_picks(sigma: float, *, seed: int) -> dict[str, tuple[tuple[float, float], ...]]:
    """Return picks of the targets with noise."""
    rng = np.random.default_rng(seed)
    return {
        name: tuple((float(c), float(r)) for c, r in (p + rng.normal(0, sigma, 2) for p in pixels))
        for name, pixels in true_pixels().items()
    }
