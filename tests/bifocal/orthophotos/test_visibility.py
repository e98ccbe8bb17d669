"""What a camera cannot see, against stepping along every ray of an analytic wall."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import FlatSurface, Foot, Grid, MapSurface, Surface
from bifocal.orthophotos import visibility
from bifocal.orthophotos.visibility import hidden_from
from tests.bifocal.orthophotos.wall_scene import hidden_at, make_pair, relief_at, wall_grid


def of_tiles(surface: Surface, grid: Grid, camera: Foot, side: int) -> np.ndarray:
    hidden = np.zeros(grid.shape, bool)
    for column, row, part in grid.tiles(side):
        found = hidden_from(surface, part, camera, surface.window(part))
        hidden[row : row + part.height, column : column + part.width] = found
    return hidden


@pytest.fixture(scope="module")
def wall() -> tuple[Grid, MapSurface, np.ndarray]:
    grid = wall_grid(0.0025, (0.7, -0.4, 2.9, 1.4))
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    surface = MapSurface.of_array(relief_at(x, y).astype(np.float32), grid)
    truth = hidden_at(x, y, nadir=(-0.3, -0.9), distance=10.0, step=0.0008)
    return grid, surface, truth


@pytest.mark.acceptance
def test_99_percent_of_the_hidden_pixels_are_found_at_03_percent_false_alarms(
    wall: tuple[Grid, MapSurface, np.ndarray],
) -> None:
    grid, surface, truth = wall
    camera = make_pair(0.004, (10, 10), (0, 0)).image1.foot
    found = of_tiles(surface, grid, camera, 1024)
    assert 0.02 < truth.mean() < 0.10
    assert (found & truth).sum() / truth.sum() >= 0.99
    assert (found & ~truth).sum() / (~truth).sum() <= 0.003


def test_a_step_beside_the_nadir_hides_nothing_of_it() -> None:
    """The nadir in the very middle of a pixel: its ray has no direction on the wall."""
    grid = Grid(x0=-1.0, y0=1.0, gsd=0.01, width=201, height=201)
    relief = np.zeros(grid.shape, np.float32)
    relief[:, 101:] = 0.4
    surface = MapSurface.of_array(relief, grid)
    hidden = hidden_from(surface, grid, Foot(np.zeros(2), 17.5), relief)
    assert not hidden.any()


@pytest.mark.acceptance
def test_tiles_and_the_whole_agree(wall: tuple[Grid, MapSurface, np.ndarray]) -> None:
    grid, surface, _ = wall
    camera = Foot(np.array([0.6, 0.4]), 10.0)  # the nadir within a tile
    whole, tiled = (of_tiles(surface, grid, camera, side) for side in (4096, 200))
    # Cells are laid from each tile's corner: pixels on the rim of a shadow may differ.
    assert (whole ^ tiled).mean() < 2e-4


def test_shadows_are_the_same_in_tiles_and_in_mirrors() -> None:
    """A slanting edge, 0.4 m before the wall, each row of it elsewhere; cameras all round."""
    grid = Grid.from_bounds((-0.6, -0.6, 0.6, 0.6), gsd=0.01)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    relief = np.where(x + 0.7 * y < 0.3, 0.4, 0.0).astype(np.float32)
    masks = []
    for across, up in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        mirrored = np.ascontiguousarray(relief[::up, ::across])
        surface = MapSurface.of_array(mirrored, grid)
        camera = Foot(np.array([-1.9 * across, -0.9 * up]), 9.0)
        whole, tiled = (of_tiles(surface, grid, camera, side) for side in (4096, 40))
        # The strip is some 12 of 120 px broad; cells are laid from each tile's corner.
        assert 0.05 < whole.mean() < 0.15
        assert (whole ^ tiled).mean() < 1e-3
        masks.append(whole[::up, ::across])
    assert max((one ^ masks[0]).mean() for one in masks) < 1e-3


def test_a_step_hides_a_strip_of_the_length_geometry_says() -> None:
    # Step of 0.5 m at x = 2 m, camera 10 m above x = 0: the strip behind is 2 * 0.5 / 9.5 long.
    grid = Grid.from_bounds((1.0, -0.1, 3.0, 0.1), gsd=0.002)
    r = np.where(grid.columns_x[None, :] < 2.0, 0.5, 0.0) * np.ones((grid.height, 1))
    camera = Foot(np.array([0.0, 0.0]), 10.0)
    surface = MapSurface.of_array(r.astype(np.float32), grid)
    hidden = of_tiles(surface, grid, camera, 512)
    columns = grid.columns_x[hidden[grid.height // 2]]
    assert columns.min() == pytest.approx(2.0, abs=0.0021)
    assert columns.max() == pytest.approx(2.0 + 2 * 0.5 / 9.5, abs=0.003)


def test_a_thin_fin_hides_although_no_pixel_lies_on_its_face() -> None:
    grid = Grid.from_bounds((1.0, -0.1, 3.0, 0.1), gsd=0.002)
    r = np.where(np.abs(grid.columns_x[None, :] - 2.0) < 0.003, 0.5, 0.0) * np.ones((100, 1))
    surface = MapSurface.of_array(r.astype(np.float32), grid)
    hidden = of_tiles(surface, grid, Foot(np.array([0.0, 0.0]), 10.0), 512)[50]
    behind = (grid.columns_x > 2.008) & (grid.columns_x < 2.1)
    assert hidden[behind].all()


def test_flat_and_gently_curved_walls_hide_nothing() -> None:
    grid = Grid.from_bounds((-2.0, -2.0, 2.0, 2.0), gsd=0.01)
    camera = Foot(np.array([5.0, 0.3]), 8.0)
    assert not of_tiles(FlatSurface(0.4), grid, camera, 128).any()
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    dome = (0.3 * np.exp(-(x**2 + y**2))).astype(np.float32)
    assert not of_tiles(MapSurface.of_array(dome, grid), grid, camera, 128).any()


def test_unknown_relief_neither_hides_nor_is_hidden() -> None:
    grid = Grid.from_bounds((1.0, -0.1, 3.0, 0.1), gsd=0.004)
    r = np.where(grid.columns_x[None, :] < 2.0, np.nan, 0.0) * np.ones((grid.height, 1))
    surface = MapSurface.of_array(r.astype(np.float32), grid)
    assert not of_tiles(surface, grid, Foot(np.array([0.0, 0.0]), 10.0), 512).any()


@pytest.mark.acceptance  # compiles
def test_numpy_and_machine_code_hide_the_same_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    grid = Grid.from_bounds((0.2, -0.3, 1.4, 0.5), gsd=0.005)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    relief = relief_at(x, y).astype(np.float32)
    relief += np.random.default_rng(3).normal(0, 0.004, relief.shape).astype(np.float32)
    relief[np.abs(x - 0.9) < 0.01] += 0.6  # a bar, with faces beside it
    relief[40:50, 60:90] = np.nan
    surface, camera = MapSurface.of_array(relief, grid), Foot(np.array([-0.4, 0.2]), 9.5)
    found = []
    for compiled in (False, True):
        monkeypatch.setattr(type(visibility._enter), "pays", lambda *_, way=compiled: way)
        found.append(hidden_from(surface, grid, camera, relief))
    assert 0.05 < found[0].mean() < 0.5
    assert np.array_equal(*found)
