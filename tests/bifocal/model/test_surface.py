"""Relief asked for window by window."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import FlatSurface, Grid, InputError, MapSurface

GRID = Grid.from_bounds((0.0, 0.0, 3.0, 2.0), gsd=0.01)


def slope() -> np.ndarray:
    return (0.1 * GRID.columns_x[None, :] - 0.05 * GRID.rows_y[:, None]).astype(np.float32)


def test_a_window_on_the_same_grid_is_the_map_itself() -> None:
    surface = MapSurface.of_array(slope(), GRID)
    window = GRID.window(30, 40, 50, 60)
    np.testing.assert_array_equal(surface.window(window), slope()[40:100, 30:80])


def test_beyond_the_map_relief_is_unknown() -> None:
    found = MapSurface.of_array(slope(), GRID).window(GRID.window(-3, -2, 6, 6))
    assert np.isnan(found[:2]).all()
    assert np.isnan(found[:, :3]).all()
    assert np.isfinite(found[2:, 3:]).all()


@pytest.mark.parametrize("gsd", [0.0037, 0.0123])
def test_another_pixel_size_interpolates_slopes_exactly(gsd: float) -> None:
    fine = Grid.from_bounds((0.51, 0.52, 1.5, 1.4), gsd=gsd)
    expected = 0.1 * fine.columns_x[None, :] - 0.05 * fine.rows_y[:, None]
    found = MapSurface.of_array(slope(), GRID).window(fine)
    np.testing.assert_allclose(found, expected, atol=2e-6)


def test_steps_are_not_smeared_into_ramps() -> None:
    stepped = np.where(GRID.columns_x[None, :] > 1.0, 0.3, 0.0) * np.ones((GRID.height, 1))
    fine = Grid.from_bounds((0.5, 0.5, 1.5, 1.5), gsd=0.0025)
    found = MapSurface.of_array(stepped.astype(np.float32), GRID).window(fine)
    assert set(np.unique(found)) == {np.float32(0.0), np.float32(0.3)}


def test_holes_do_not_grow_under_interpolation() -> None:
    holed = slope()
    holed[100, 100] = np.nan
    fine = Grid(x0=GRID.x0, y0=GRID.y0, gsd=0.0025, width=1000, height=600)
    found = MapSurface.of_array(holed, GRID).window(fine)
    # One pixel of 10 mm is 4 x 4 pixels of 2.5 mm; where rims fall on a centre 3 x 3 or 5 x 5.
    assert 9 <= np.isnan(found).sum() <= 25


def test_extremes_bound_the_relief_of_any_box() -> None:
    surface = MapSurface.of_array(slope(), GRID)
    low, high = surface.extremes((0.7, 0.3, 1.1, 0.9))
    part = surface.window(Grid.from_bounds((0.7, 0.3, 1.1, 0.9), gsd=0.01))
    assert low <= part.min()
    assert high >= part.max()
    assert np.isnan(surface.extremes((50, 50, 60, 60))).all()
    assert FlatSurface(0.2).extremes((0, 0, 1, 1)) == (0.2, 0.2)


def test_an_empty_or_infinite_map_is_refused() -> None:
    with pytest.raises(InputError, match="every pixel is unknown"):
        MapSurface.of_array(np.full(GRID.shape, np.nan, np.float32), GRID)
    with pytest.raises(InputError, match="infinite"):
        MapSurface.of_array(np.full(GRID.shape, np.inf, np.float32), GRID)
    with pytest.raises(InputError, match="expected shape"):
        MapSurface.of_array(np.zeros((2, 2), np.float32), GRID)
