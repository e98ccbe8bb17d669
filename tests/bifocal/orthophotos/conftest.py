"""Fixtures of this folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bifocal import Grid, Pair, Photo, ReliefMap, write_image
from tests.bifocal.orthophotos.ortho_command import GSD, SIZE, relief_of


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    rng = np.random.default_rng(4)
    for name in ("far.png", "near.png"):
        write_image(tmp_path / name, rng.integers(0, 255, (SIZE[1], SIZE[0], 3), dtype=np.uint8))
    matrix = [[GSD, 0, -2.095], [0, -GSD, 1.495], [0, 0, 1]]
    pair = Pair(
        image1=Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=12.0, file="far.png"),
        image2=Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=7.0, file="near.png"),
        extra={"name": "Torre (est)"},
    )
    pair.write(tmp_path / "wall.pair.json")
    grid = Grid.from_bounds((-2.1, -1.5, 2.1, 1.5), gsd=GSD)
    relief = ReliefMap.from_relief(relief_of(grid), plane_from_pixel=grid.plane_from_pixel)
    relief.write(tmp_path / "relief.tif")
    return tmp_path
