"""Rasters on the reference plane."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import Grid, InputError, ReliefMap
from bifocal.model.grid import cut


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


def test_an_array_is_cut_with_filling_beyond_its_edges() -> None:
    array = np.arange(12).reshape(3, 4)
    np.testing.assert_array_equal(
        cut(array, (2, 1, 3, 3), -1), [[6, 7, -1], [10, 11, -1], [-1] * 3]
    )
    assert (cut(array, (9, 9, 2, 1)) == np.zeros((1, 2))).all()


def test_pixels_of_the_same_lattice_have_a_whole_offset() -> None:
    grid = Grid(x0=0.0, y0=0.0, gsd=0.1, width=25, height=13)
    assert grid.window(-3, 4, 5, 6).whole_offset_in(grid) == (-3, 4)
    assert Grid(x0=0.05, y0=0.0, gsd=0.1, width=5, height=5).whole_offset_in(grid) is None
    assert Grid(x0=0.0, y0=0.0, gsd=0.11, width=5, height=5).whole_offset_in(grid) is None


def test_resampling_finds_every_pixel_in_its_window() -> None:
    other, grid = (
        Grid(x0=x, y0=1.0, gsd=g, width=9, height=7) for x, g in ((0.0, 0.1), (0.3, 0.04))
    )
    (column, row, width, height), columns, rows = grid.resampling(other, 2)
    # Pixel (5, 3) of the grid lies at X = 0.5, Y = 0.88: column 5, row 1.2 of the other.
    assert columns[3, 5] + column == pytest.approx(5.0, abs=1e-6)
    assert rows[3, 5] + row == pytest.approx(1.2, abs=1e-6)
    assert columns.min() >= 2
    assert columns.max() <= width - 3
    assert rows.max() <= height - 3


@pytest.mark.parametrize("bounds", [(0, 0, 0, 1), (1, 0, 0, 1), (0, 0, float("nan"), 1)])
def test_an_empty_box_is_refused(bounds: tuple[float, float, float, float]) -> None:
    with pytest.raises(InputError, match="xmin < xmax"):
        Grid.from_bounds(bounds, gsd=0.01)


def test_turned_pixels_are_refused() -> None:
    turned = np.array([[0.01, 0.001, 0.0], [0.001, -0.01, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(InputError, match="parallel"):
        Grid.from_affine(turned, (100, 100))


def test_a_map_of_relief_speaks_of_corners_to_gis_programs_and_of_centres_to_xarray() -> None:
    grid = Grid.from_bounds((0.0, 0.0, 2.0, 1.0), gsd=0.5)
    relief = ReliefMap.from_relief(np.zeros((2, 4)), plane_from_pixel=grid.plane_from_pixel)
    assert (relief.transform.c, relief.transform.f) == pytest.approx((0.0, 1.0))
    xarray = pytest.importorskip("xarray")
    data = relief.to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert set(data) == {"r", "sigma", "quality"}
    assert float(data.r.sel(x=0.25, y=0.75)) == 0.0
