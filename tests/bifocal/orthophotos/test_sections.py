"""Sections: where they begin and end, and the relief along them."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal.model.grid import Grid
from bifocal.model.surface import MapSurface
from bifocal.orthophotos.sections import section

GRID = Grid.from_bounds((0.0, 0.0, 3.0, 2.0), gsd=0.01)
SLOPE = MapSurface.of_array(
    (0.1 * GRID.columns_x[None, :] - 0.05 * GRID.rows_y[:, None]).astype(np.float32), GRID
)


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("x=1.5", (0.0, 2.0)),
        ("y=0.5", (0.0, 3.0)),
        ("0.5,0.5 2.5,0.5 2.5,1.5", (0.0, 3.0)),
    ],
)
def test_a_section_runs_from_one_end_of_its_line_to_the_other(
    name: str, ends: tuple[float, float]
) -> None:
    found = section(SLOPE, GRID, name, step=0.07)
    assert (found.place[0], found.place[-1]) == pytest.approx(ends, abs=1e-12)
    assert np.diff(found.place).max() <= 0.07 + 1e-12
    assert len(found.place) == len(found.relief)


def test_a_broken_section_shows_the_relief_of_every_leg_to_its_corner() -> None:
    found = section(SLOPE, GRID, "0.5,0.5 2.5,0.5 2.5,1.5", step=0.07)
    first = found.place <= 2.0
    wanted = np.where(
        first, 0.1 * (0.5 + found.place) - 0.025, 0.25 - 0.05 * (0.5 + found.place - 2.0)
    )
    np.testing.assert_allclose(found.relief, wanted, atol=0.0011)
    assert (np.abs(found.place - 2.0) < 1e-12).sum() == 2
