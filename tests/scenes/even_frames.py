"""Small frames of even surfaces, both photos already laid on the plane."""

from __future__ import annotations

import numpy as np

from bifocal import Grid, Pair, Photo
from bifocal.relief_maps.frame import Frame

METRES = [[0.01, 0, -0.995], [0, -0.01, 0.995], [0, 0, 1]]
FAR, NEAR = (Photo(plane_from_pixel=METRES, nadir=(0, 0), distance=d) for d in (17.5, 9.5))
SIDE = 160


def frame_of(image1: np.ndarray, image2: np.ndarray) -> Frame:
    """Return a frame of 8 x 8 m about the nadirs, photos of `SIDE` pixels a side."""
    pair = Pair(image1=FAR, image2=NEAR)
    grid = Grid.from_bounds((-4.0, -4.0, 4.0, 4.0), gsd=8.0 / SIDE)
    seen = np.ones(grid.shape, bool)
    return Frame(grid=grid, image1=image1, image2=image2, seen1=seen, seen2=seen, pair=pair)
