"""Pairs taken through ports, tanks and water surfaces."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from bifocal import Control, Interior
from tests.scenes import SetupErrors, bifocal_cameras
from tests.scenes.wet import under_water

SIZE = (3072, 2048)
GLASS = ((1.0, 1.49, 1.337), (0.01,))
WATER = ((1.0, 1.337), ())


@cache
def cameras(kind, seed=2):
    """Return cameras 3.5 and 1.9 m before a wall behind media, and what is typed of the media."""
    square = bifocal_cameras(
        size=SIZE, pixel=0.00074, d1=3.5, d2=1.9, rng=np.random.default_rng(seed),
        errors=SetupErrors(tilt_deg=2.0, distance=0.02, offset=0.1),
    )  # fmt: skip
    distances = [float(camera.centre[2]) for camera in (square.far, square.near)]
    media, z0, placed = {
        "port": (GLASS, [0.05, 0.06], {"ports": (0.05, 0.06)}),
        "tank": (GLASS, [d - 0.91 for d in distances], {"depth": 0.9}),
        "surface": (WATER, [d - 0.6 for d in distances], {"depth": 0.6}),
    }[kind]
    wet = under_water(square, indices=media[0], thicknesses=media[1], z0=tuple(z0))
    return (wet.far, wet.near), media, placed


def points(rng, count, relief=0.3):
    return rng.uniform([-0.7, -0.5, -relief], [0.7, 0.5, relief], (count, 3))


def lens(camera, *, factor=1.0, away=(0.0, 0.0), sigma=5e-4):
    known = Interior.from_focal(
        camera.matrix[0, 0] * factor, image_size=SIZE, sigma=sigma, source="board"
    )
    return replace(known, centre=camera.matrix[:2, 2] + away, sigma_centre=5.0, is_calibrated=True)


def control_of(xyz, pixels, sigma):
    return Control(
        ids=tuple(f"P{k}" for k in range(len(xyz))), xyz=xyz, sigma=np.full(xyz.shape, sigma),
        pixels1=pixels[0], pixels2=pixels[1],
    )  # fmt: skip
