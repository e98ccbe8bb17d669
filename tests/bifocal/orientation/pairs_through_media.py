"""Pairs taken through ports, tanks and water surfaces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal import (
    Control,
    Interior,
)

SIZE = (3072, 2048)
GLASS = ((1.0, 1.49, 1.337), (0.01,))


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
