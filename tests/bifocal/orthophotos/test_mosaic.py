"""Several orthophotos or relief maps made one."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
import rasterio
from click.testing import CliRunner, Result

from bifocal import Grid
from bifocal.model.geotiff import create_raster
from tests.builders.commands import bifocal_command as main

GSD = 0.005


def picture(grid: Grid) -> np.ndarray:
    """One wall, whatever part of it is asked for."""
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    bands = [
        120 + 60 * np.sin(9 * x + k) * np.cos(7 * y) + 30 * np.sin(60 * x) * np.sin(50 * y)
        for k in range(3)
    ]
    return np.stack(bands, axis=-1)


def write(path: Path, bounds: tuple[float, float, float, float], *, gain: float = 1.0) -> Grid:
    grid = Grid.from_bounds(bounds, gsd=GSD)
    image = np.clip(np.rint(picture(grid) * gain), 0, 255).astype(np.uint8)
    source = np.ones((*grid.shape, 1), np.uint8)
    with create_raster(
        path, grid, bands=4, dtype=np.uint8, colour=True, names=["red", "green", "blue", "source"]
    ) as writer:
        writer.write(np.concatenate([image, source], axis=2), mask=np.ones(grid.shape, bool))
    return grid


def run(folder: Path, *arguments: str) -> Result:
    old = Path.cwd()
    os.chdir(folder)
    try:
        return CliRunner().invoke(main, ["mosaic", *arguments])
    finally:
        os.chdir(old)


def read(path: Path) -> tuple[np.ndarray, np.ndarray, Grid]:
    with rasterio.open(path) as file:
        image = file.read([1, 2, 3]).transpose(1, 2, 0).astype(float)
        bounds = tuple(file.bounds)
        return image, file.read(4), Grid.from_bounds(bounds, gsd=GSD)


def test_parts_of_one_picture_become_the_picture_again(tmp_path: Path) -> None:
    write(tmp_path / "a.tif", (0, 0, 2, 1.5))
    write(tmp_path / "b.tif", (1, 0.5, 3.5, 2))
    done = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif", "--json")
    assert done.exit_code == 0, done.output
    image, source, grid = read(tmp_path / "m.tif")
    assert json.loads(done.stdout)["bounds"] == pytest.approx([0, 0, 3.5, 2])
    assert set(np.unique(source)) == {0, 1, 2}
    np.testing.assert_allclose(image[source > 0], picture(grid)[source > 0], atol=1.01)
    assert (image[source == 0] == 0).all()


def test_exposures_are_made_equal_and_no_seam_is_seen(tmp_path: Path) -> None:
    write(tmp_path / "a.tif", (0, 0, 2, 1.5), gain=1.1)
    write(tmp_path / "b.tif", (1, 0, 3, 1.5), gain=0.8)
    done = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif")
    assert done.exit_code == 0, done.output
    image, _, grid = read(tmp_path / "m.tif")
    ratio = image / picture(grid)
    # One factor for the whole wall: the exposure of the first stays as it is.
    assert np.median(ratio) == pytest.approx(1.1, abs=0.005)
    assert np.median(ratio[:, :100]) == pytest.approx(1.1, abs=0.001)
    assert np.percentile(np.abs(ratio / np.median(ratio) - 1), 99) < 0.03
    plain = run(tmp_path, "a.tif", "b.tif", "--out", "p.tif", "--no-gain", "--no-blend")
    assert plain.exit_code == 0
    raw, _, _ = read(tmp_path / "p.tif")
    assert np.percentile(raw / picture(grid), 95) / np.percentile(raw / picture(grid), 5) > 1.3


def test_priority_keeps_the_first_whole(tmp_path: Path) -> None:
    a = write(tmp_path / "a.tif", (0, 0, 2, 1.5))
    write(tmp_path / "b.tif", (1, 0, 3, 1.5))
    run(tmp_path, "a.tif", "b.tif", "--out", "m.tif", "--priority", "--no-blend")
    _, source, _ = read(tmp_path / "m.tif")
    assert (source[:, : a.width - 3] == 1).all()
    assert (source[:, a.width + 3 :] == 2).all()


def test_other_pixels_are_resampled_and_said_so(tmp_path: Path) -> None:
    write(tmp_path / "a.tif", (0, 0, 2, 1.5))
    write(tmp_path / "b.tif", (1.0017, 0.0021, 3.0017, 1.5021))
    done = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif", "--bounds", "0,0.1,2.9,1.4")
    assert done.exit_code == 0, done.output
    assert "resampled" in done.stderr
    image, source, grid = read(tmp_path / "m.tif")
    assert (source > 0).all()
    assert np.percentile(np.abs(image - picture(grid)), 99) < 2


def test_relief_maps_are_joined_without_mixing(tmp_path: Path) -> None:
    for name, left, value in (("a.tif", 0.0, 0.10), ("b.tif", 1.0, 0.13)):
        grid = Grid.from_bounds((left, 0, left + 2, 1), gsd=GSD)
        with create_raster(
            tmp_path / name, grid, bands=1, dtype=np.float32, names=["relief [m]"]
        ) as writer:
            relief = np.full(grid.shape, value, np.float32)
            relief[:20] = np.nan
            writer.write(relief)
    done = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif")
    assert done.exit_code == 0, done.output
    assert "a.tif lies 30 mm behind b.tif" in done.stderr
    with rasterio.open(tmp_path / "m.tif") as file:
        relief = file.read(1)
    assert np.isnan(relief[:20]).all()
    assert set(np.unique(relief[20:])) == {np.float32(0.10), np.float32(0.13)}


def test_what_cannot_be_joined_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.tif", (0, 0, 0.5, 0.5))
    with create_raster(
        tmp_path / "r.tif", Grid.from_bounds((0, 0, 1, 1), gsd=GSD), bands=1, dtype=np.float32
    ) as writer:
        writer.write(np.zeros((200, 200), np.float32))
    with create_raster(
        tmp_path / "away.tif", Grid.from_bounds((9, 9, 10, 10), gsd=GSD), bands=1, dtype=np.float32
    ) as writer:
        writer.write(np.zeros((200, 200), np.float32))
    for arguments, message in (
        (("a.tif",), "two rasters or more"),
        (("a.tif", "r.tif"), "cannot be joined"),
        (("a.tif", "absent.tif"), "no such raster"),
        (("a.tif", "a.tif", "--relief", "away.tif"), "away.tif: knows no relief anywhere"),
        (("a.tif", "a.tif", "--out", "m.png"), "m.png: a mosaic is written as GeoTIFF"),
        (("a.tif", "a.tif", "--bounds", "50,50,51,51"), "none of the rasters"),
    ):
        done = run(tmp_path, "--out", "m.tif", *arguments)
        assert done.exit_code == 1, done.output
        assert message in done.stderr
        assert not any((tmp_path / name).exists() for name in ("m.tif", "m.png"))


def test_rasters_that_have_nothing_in_common_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.tif", (0, 0, 0.5, 0.5))
    write(tmp_path / "near.tif", (0.7, 0, 1.2, 0.5))  # a pillar stood between
    write(tmp_path / "far.tif", (1.1, 0.4, 1.6, 0.9))
    write(tmp_path / "other.tif", (5000, 900, 5000.5, 900.5))
    done = run(tmp_path, "a.tif", "far.tif", "other.tif", "--out", "m.tif")
    assert done.exit_code == 1, done.output
    assert "rasters 1 and 2 have nothing in common: they cover X, Y [0.0, 0.0] to" in done.stderr
    assert not (tmp_path / "m.tif").exists()
    assert run(tmp_path, "a.tif", "far.tif", "near.tif", "--out", "m.tif").exit_code == 0


def test_rasters_that_overlap_but_show_different_walls_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.tif", (0, 0, 2, 1.5))
    grid = write(tmp_path / "b.tif", (0.7, 0.2, 2.9, 1.8))
    rng = np.random.default_rng(6)
    wall = np.repeat(np.repeat(rng.integers(20, 235, (40, 44, 4)), 8, 0), 10, 1).astype(np.uint8)
    with create_raster(
        tmp_path / "b.tif", grid, bands=4, dtype=np.uint8, colour=True, overwrite=True,
        names=["red", "green", "blue", "source"],
    ) as writer:  # fmt: skip
        writer.write(wall, mask=np.ones(grid.shape, bool))
    done = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif")
    assert done.exit_code == 1, done.output
    assert "rasters 1 and 2 overlap but have nothing in common" in done.stderr
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    for name, pitch in (("r.tif", 30.0), ("s.tif", 43.0)):  # relief of a wall, and of another
        relief = (0.1 * np.sin(pitch * x) * np.cos(25 * y)).astype(np.float32)
        with create_raster(tmp_path / name, grid, bands=1, dtype=np.float32) as writer:
            writer.write(relief)
    done = run(tmp_path, "r.tif", "s.tif", "--out", "m.tif")
    assert done.exit_code == 1, done.output
    assert "nothing in common" in done.stderr
    assert not (tmp_path / "m.tif").exists()


def test_rasters_that_are_little_alike_are_pointed_out_by_their_paths(tmp_path: Path) -> None:
    grid = Grid.from_bounds((0, 0, 2, 1.5), gsd=GSD)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    wall, other = np.sin(30 * x) * np.cos(25 * y), np.sin(43 * x) * np.cos(25 * y)
    for folder, part in (("left", 0.0), ("right", 0.95)):
        (tmp_path / folder).mkdir()
        relief = (0.1 * (np.sqrt(1 - part**2) * wall + part * other)).astype(np.float32)
        with create_raster(
            tmp_path / folder / "relief.tif", grid, bands=1, dtype=np.float32
        ) as writer:
            writer.write(relief)
    done = run(tmp_path, "left/relief.tif", "right/relief.tif", "--out", "m.tif")
    assert done.exit_code == 0, done.output
    told = "left/relief.tif and right/relief.tif are little alike on their overlap (correlation +0."
    assert told in done.stderr
    twice = run(tmp_path, "left/relief.tif", "left/relief.tif", "--out", "n.tif")
    assert "alike" not in twice.stderr


def test_a_mosaic_of_rasters_without_a_scale_has_none_and_is_not_mixed_with_metres(
    tmp_path: Path,
) -> None:
    for name, bounds in (("a.tif", (0, 0, 0.5, 0.5)), ("b.tif", (0.25, 0, 0.75, 0.5))):
        write(tmp_path / name, bounds)
    with rasterio.open(tmp_path / "a.tif", "r+") as file:
        file.update_tags(BIFOCAL_UNIT="none")
    mixed = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif")
    assert (mixed.exit_code, "has a scale in metres" in mixed.stderr) == (1, True)
    with rasterio.open(tmp_path / "b.tif", "r+") as file:
        file.update_tags(BIFOCAL_UNIT="none")
    done = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif")
    assert (done.exit_code, "unit of the model" in done.stderr) == (0, True)
    with rasterio.open(tmp_path / "m.tif") as file:
        assert file.tags()["BIFOCAL_UNIT"] == "none"


def test_rasters_of_different_coordinate_systems_are_refused(tmp_path: Path) -> None:
    for name in ("a.tif", "b.tif"):
        write(tmp_path / name, (0, 0, 0.5, 0.5))
    with rasterio.open(tmp_path / "b.tif", "r+") as file:
        file.crs = rasterio.CRS.from_epsg(32632)
    done = run(tmp_path, "a.tif", "b.tif", "--out", "m.tif")
    assert done.exit_code == 1
    assert "different coordinate systems" in done.stderr
