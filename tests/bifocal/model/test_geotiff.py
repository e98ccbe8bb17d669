"""GeoTIFF in the plane frame."""

from __future__ import annotations

import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rasterio
from PIL import Image

from bifocal import Grid, InputError
from bifocal.model.geotiff import RasterReader, create_raster, dpi_at_scale, gsd_at_scale
from tests.rounding import EPS

GRID = Grid.from_bounds((-2.0, -1.0, 1.5, 1.0), gsd=0.005)


def write_colour(path: Path, *, dpi: float | None = None, world_file: bool = False) -> np.ndarray:
    rng = np.random.default_rng(5)
    image = rng.integers(0, 255, (*GRID.shape, 4), dtype=np.uint8)
    with create_raster(
        path, GRID, bands=4, dtype=np.uint8, colour=True, dpi=dpi, world_file=world_file
    ) as writer:
        for column, row, part in GRID.tiles(256):
            tile = image[row : row + part.height, column : column + part.width]
            writer.write(tile, column=column, row=row, mask=tile[:, :, 3] > 100)
    return image


def test_gdal_finds_the_corner_half_a_pixel_outside_the_first_centre(tmp_path: Path) -> None:
    write_colour(tmp_path / "o.tif")
    with rasterio.open(tmp_path / "o.tif") as file:
        assert (file.transform.c, file.transform.f) == pytest.approx((-2.0, 1.0))
        assert (file.transform.a, file.transform.e) == pytest.approx((0.005, -0.005))
        assert file.crs.to_wkt().startswith("LOCAL_CS")
        assert 'UNIT["metre",1' in file.crs.to_wkt()


def test_pixels_mask_and_grid_come_back_tile_by_tile(tmp_path: Path) -> None:
    image = write_colour(tmp_path / "o.tif")
    with RasterReader(tmp_path / "o.tif") as reader:
        assert reader.grid.offset_in(GRID) == pytest.approx((0, 0), abs=1e-6)
        assert reader.grid.shape == GRID.shape
        assert (reader.read(100, 50, 300, 200) == image[50:250, 100:400]).all()
        mask = reader.read(0, 0, GRID.width, GRID.height, mask=True)
        assert ((mask == 255) == (image[:, :, 3] > 100)).all()


def test_a_window_beyond_the_edge_is_filled(tmp_path: Path) -> None:
    image = write_colour(tmp_path / "o.tif")
    with RasterReader(tmp_path / "o.tif") as reader:
        window = reader.read(-2, -3, 5, 5, fill=7)
        assert (window[:3] == 7).all()
        assert (window[3:, 2:] == image[:2, :3]).all()
        assert (reader.read(5000, 5000, 4, 4) == 0).all()


def test_dpi_tag_and_world_file_make_1_to_50_at_254_dpi_five_millimetres(tmp_path: Path) -> None:
    assert gsd_at_scale(254, 50) == pytest.approx(0.005, rel=4 * EPS)
    write_colour(tmp_path / "o.tif", dpi=dpi_at_scale(GRID.gsd, 50), world_file=True)
    with Image.open(tmp_path / "o.tif") as image:
        assert image.info["dpi"] == pytest.approx((254.0, 254.0))
    values = [float(line) for line in (tmp_path / "o.tfw").read_text().split()]
    # A D B E C F with the centre of the upper-left pixel, the convention of CAD programs.
    assert values == pytest.approx([0.005, 0, 0, -0.005, -1.9975, 0.9975])


def test_float_rasters_keep_nan_and_declared_nodata(tmp_path: Path) -> None:
    values = np.full(GRID.shape, 1.25, np.float32)
    values[3, 4] = np.nan
    with create_raster(tmp_path / "r.tif", GRID, bands=1, dtype=np.float32) as writer:
        writer.write(values)
    with RasterReader(tmp_path / "r.tif") as reader:
        read = reader.read_floats(0, 0, GRID.width, GRID.height)
    np.testing.assert_array_equal(read, values)
    with rasterio.open(
        tmp_path / "n.tif",
        "w",
        driver="GTiff",
        width=2,
        height=1,
        count=1,
        dtype="float32",
        nodata=-9999,
        transform=rasterio.Affine(1, 0, 0, 0, -1, 1),
    ) as file:
        file.write(np.array([[[0.5, -9999]]], np.float32))
    with RasterReader(tmp_path / "n.tif") as reader:
        np.testing.assert_array_equal(reader.read_floats(0, 0, 2, 1), [[0.5, np.nan]])


def test_whole_numbers_are_unknown_where_marked_masked_or_beyond_the_edges(tmp_path: Path) -> None:
    profile = {"driver": "GTiff", "width": 3, "height": 1, "count": 1, "dtype": "int16",
               "transform": rasterio.Affine(1, 0, 0, 0, -1, 1)}  # fmt: skip
    with rasterio.open(tmp_path / "n.tif", "w", nodata=-9999, **profile) as file:
        file.write(np.array([[[4, -9999, 6]]], np.int16))
    with rasterio.open(tmp_path / "m.tif", "w", **profile) as file:
        file.write(np.array([[[4, 5, 6]]], np.int16))
        file.write_mask(np.array([[True, False, True]]))
    for name in ("n.tif", "m.tif"):
        with RasterReader(tmp_path / name) as reader:
            window = reader.read_floats(-1, 0, 4, 2)
        np.testing.assert_array_equal(window, [[np.nan, 4, np.nan, 6], [np.nan] * 4])


def test_overviews_are_inside_the_file(tmp_path: Path) -> None:
    grid = Grid.from_bounds((0, 0, 7.0, 5.0), gsd=0.005)
    with create_raster(
        tmp_path / "o.tif", grid, bands=3, dtype=np.uint8, colour=True, overviews=True
    ) as writer:
        writer.write(np.full((*grid.shape, 3), 90, np.uint8))
    with rasterio.open(tmp_path / "o.tif") as file:
        assert file.overviews(1) == [2, 4]
    assert [item.name for item in tmp_path.iterdir()] == ["o.tif"]


def test_a_failure_in_the_middle_leaves_nothing(tmp_path: Path) -> None:
    def fail() -> None:
        with create_raster(tmp_path / "o.tif", GRID, bands=1, dtype=np.uint8) as writer:
            writer.write(np.zeros(GRID.shape, np.uint8))
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="file size limits are POSIX")
def test_a_disk_that_fills_up_in_the_middle_is_reported_and_leaves_nothing(tmp_path: Path) -> None:
    # A file-size limit stands in for the full disk: GDAL's writes fail the same way.
    script = f"""
        import resource, signal, numpy as np
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
        from bifocal.model.grid import Grid
        from bifocal.model.geotiff import create_raster
        grid = Grid.from_bounds((0, 0, 5, 5), gsd=0.005)
        noise = np.random.default_rng(1).integers(0, 255, (*grid.shape, 3), dtype=np.uint8)
        with create_raster({str(tmp_path / "o.tif")!r}, grid, bands=3, dtype=np.uint8) as writer:
            writer.write(noise)
    """
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, check=False
    )
    assert "InputError" in run.stderr
    assert "is the disk full?" in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_raster_that_does_not_fit_the_disk_is_refused_before_the_work(tmp_path: Path) -> None:
    grid = Grid(x0=0, y0=0, gsd=0.001, width=30_000_000, height=30_000_000)
    with (
        pytest.raises(InputError, match="GB are free"),
        create_raster(tmp_path / "o.tif", grid, bands=3, dtype=np.uint8),
    ):
        pass


def test_a_raster_without_position_is_refused(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((4, 4), np.uint8)).save(tmp_path / "plain.tif")
    with pytest.raises(InputError, match="where it lies"):
        RasterReader(tmp_path / "plain.tif")


def test_what_is_no_raster_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.tif").write_text("hello")
    with pytest.raises(InputError, match="not a raster"):
        RasterReader(tmp_path / "x.tif")
    with pytest.raises(InputError, match="no such raster"):
        RasterReader(tmp_path / "absent.tif")


def test_an_existing_file_is_only_replaced_on_request(tmp_path: Path) -> None:
    write_colour(tmp_path / "o.tif")
    with pytest.raises(InputError, match="--overwrite"):
        write_colour(tmp_path / "o.tif")


def test_a_small_disk_is_told_in_units_that_say_something(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=8192))
    grid = Grid.from_bounds((0, 0, 2, 1), gsd=0.005)
    with (
        pytest.raises(InputError, match=r"need more than 24 kB and 8\.192 kB are free"),
        create_raster(tmp_path / "o.tif", grid, bands=3, dtype=np.uint8),
    ):
        pass
