"""Relief as a picture: what was not measured is paler, and lined where there is room for lines."""

from __future__ import annotations

import numpy as np

from bifocal import Grid, MapSurface
from bifocal.orthophotos.shading import shaded

WALL = Grid.from_bounds((0.0, 0.0, 3.0, 2.0), gsd=0.005)
PAPER = 0.05  # metres per millimetre at 1:50


def test_specks_that_were_not_measured_are_paler_but_bear_no_dashes() -> None:
    x, y = np.meshgrid(WALL.columns_x, WALL.rows_y)
    relief = np.full(WALL.shape, -0.1, np.float32)
    specks = np.zeros(WALL.shape, bool)
    for number in range(5):
        specks |= np.hypot(x - 0.3 * (number + 1), y - 1.6) < 0.8 * PAPER
    porch = (np.abs(x - 1.5) < 12 * PAPER) & (y < 1.0)
    measured = np.where(specks | porch, np.float32(np.nan), relief)
    picture, known = shaded(
        MapSurface.of_array(relief, WALL), WALL, limits=(-0.2, 0.2), scale=50,
        measured=MapSurface.of_array(measured, WALL),
    )  # fmt: skip
    assert known.all()
    light = picture.astype(int).sum(axis=-1)
    plain = int(light[5, 5])
    # Five specks of 1.6 mm, none of whose pixels is darker than the wall; most are paler.
    assert light[specks].min() >= plain
    assert (light[specks] > plain + 60).mean() > 0.5
    # The porch is lined: lines of 0.2 mm every 1.5 mm.
    assert 0.08 < (light[porch] < 0.75 * np.median(light[porch])).mean() < 0.25
