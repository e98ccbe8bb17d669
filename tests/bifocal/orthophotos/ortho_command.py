"""``bifocal ortho`` on a small wall."""

from __future__ import annotations

import os
import re
import zlib
from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result

from bifocal import Grid, Pair, Photo, ReliefMap, write_image
from tests.builders.commands import bifocal_command as main

SIZE = (420, 300)
GSD = 0.01


def relief_of(grid: Grid) -> np.ndarray:
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    return np.where((np.abs(x - 0.8) < 0.2) & (np.abs(y) < 1), 0.3, 0.02 * x).astype(np.float32)


def write_wall(folder: Path) -> None:
    """Write two photos of noise, their pair and a relief map."""
    rng = np.random.default_rng(4)
    for name in ("far.png", "near.png"):
        write_image(folder / name, rng.integers(0, 255, (SIZE[1], SIZE[0], 3), dtype=np.uint8))
    matrix = [[GSD, 0, -2.095], [0, -GSD, 1.495], [0, 0, 1]]
    pair = Pair(
        image1=Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=12.0, file="far.png"),
        image2=Photo(plane_from_pixel=matrix, nadir=(0, 0), distance=7.0, file="near.png"),
        extra={"name": "Torre (est)"},
    )
    pair.write(folder / "wall.pair.json")
    grid = Grid.from_bounds((-2.1, -1.5, 2.1, 1.5), gsd=GSD)
    relief = ReliefMap.from_relief(relief_of(grid), plane_from_pixel=grid.plane_from_pixel)
    relief.write(folder / "relief.tif")


def run(folder: Path, *arguments: str) -> Result:
    old = Path.cwd()
    os.chdir(folder)
    try:
        return CliRunner().invoke(main, ["ortho", "wall.pair.json", *arguments])
    finally:
        os.chdir(old)


def page_of(pdf: Path) -> str:
    """Return the drawing commands of a sheet."""
    data = pdf.read_bytes()
    pieces = re.findall(rb"/Length \d+ 0 R >>\nstream\n(.*?)\nendstream", data, re.DOTALL)
    return zlib.decompress(pieces[-1]).decode("cp1252")
