"""Rasters on the reference plane."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal.model.grid import Grid
from photocore.errors import InputError


def test_bounds_are_the_outer_edges_and_pixels_count_from_their_centres() -> None:
    # 10 m x 6 m at 5 mm: 2000 x 1200 px; the first centre is half a pixel inside the corner.
    grid = Grid.from_bounds((-5.0, -2.0, 5.0, 4.0), gsd=0.005)
    assert grid.shape == (1200, 2000)
    assert (grid.x0, grid.y0) == pytest.approx((-4.9975, 3.9975))
    assert grid.bounds == pytest.approx((-5.0, -2.0, 5.0, 4.0))
    assert grid.pixel_of(np.array([-4.9975, 3.9975])) == pytest.approx([0.0, 0.0])


def test_a_grid_survives_its_own_matrix() -> None:
    grid = Grid(x0=-1.2, y0=3.4, gsd=0.00369, width=31, height=17)
    assert Grid.from_affine(grid.plane_from_pixel, (17, 31)) == grid


def test_tiles_cover_every_pixel_once_and_know_where_they_are() -> None:
    grid = Grid(x0=0.0, y0=0.0, gsd=0.1, width=25, height=13)
    seen = np.zeros(grid.shape, int)
    for column, row, part in grid.tiles(8):
        seen[row : row + part.height, column : column + part.width] += 1
        assert part.offset_in(grid) == pytest.approx((column, row))
    assert (seen == 1).all()


def test_snapped_grids_of_one_gsd_fit_without_resampling() -> None:
    first = Grid.from_bounds((0.0123, 0.0456, 1.0, 1.0), gsd=0.005).snapped()
    second = Grid.from_bounds((0.5011, -0.3, 2.0, 0.7777), gsd=0.005).snapped()
    column, row = second.offset_in(first)
    assert (column, row) == pytest.approx((round(column), round(row)), abs=1e-9)
    assert first.bounds[0] <= 0.0123
    assert first.bounds[3] >= 1.0


def test_an_already_snapped_grid_does_not_grow() -> None:
    grid = Grid.from_bounds((-0.35, -0.1, 0.7, 0.95), gsd=0.005)
    assert grid.snapped().shape == grid.shape


@pytest.mark.parametrize("bounds", [(0, 0, 0, 1), (1, 0, 0, 1), (0, 0, float("nan"), 1)])
def test_an_empty_box_is_refused(bounds: tuple[float, float, float, float]) -> None:
    with pytest.raises(InputError, match="xmin < xmax"):
        Grid.from_bounds(bounds, gsd=0.01)


def test_turned_pixels_are_refused() -> None:
    turned = np.array([[0.01, 0.001, 0.0], [0.001, -0.01, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(InputError, match="parallel"):
        Grid.from_affine(turned, (100, 100))
