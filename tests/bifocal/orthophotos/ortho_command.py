"""``bifocal ortho`` on a small wall."""

from __future__ import annotations

import os
import re
import zlib
from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result

from bifocal import Grid
from tests.builders.commands import bifocal_command as main

SIZE = (420, 300)
GSD = 0.01


def relief_of(grid: Grid) -> np.ndarray:
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    return np.where((np.abs(x - 0.8) < 0.2) & (np.abs(y) < 1), 0.3, 0.02 * x).astype(np.float32)


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
