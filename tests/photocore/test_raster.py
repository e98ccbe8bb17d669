"""A raster takes its place only when every block of it is in the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.errors import RasterioIOError

from bifocal import InputError
from photocore import raster
from photocore.raster import (
    RasterFile,
    Window,
    check_whole,
    corner_transform,
    create_geotiff,
    written_whole,
)
from photocore.raster_places import cloud_optimised

WIDTH, HEIGHT = 700, 300
pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")


def write(path: Path, *, bands: int = 2, levels: bool = False, **options: object) -> Path:
    profile = {"driver": "GTiff", "width": WIDTH, "height": HEIGHT, "count": bands,
               "dtype": "float32", "compress": "deflate"}  # fmt: skip
    noise = np.random.default_rng(1).normal(size=(bands, HEIGHT, WIDTH)).astype(np.float32)
    with rasterio.open(path, "w", **profile, **options) as file:
        file.write(noise)
    if levels:
        with rasterio.open(path, "r+") as file:
            file.build_overviews([2, 4])
    return path


TILED = {"tiled": True, "blockxsize": 256, "blockysize": 256}
KINDS = [{}, TILED, {**TILED, "interleave": "pixel"}, {**TILED, "levels": True}]


@pytest.mark.parametrize("kind", KINDS, ids=["strips", "tiles", "pixel by pixel", "reduced"])
def test_a_whole_raster_passes_and_one_cut_anywhere_does_not(tmp_path: Path, kind: dict) -> None:
    path = write(tmp_path / "a.tif", **kind)
    check_whole(path, width=WIDTH, height=HEIGHT, bands=2)
    data = path.read_bytes()
    for length in (0, 4, 100, len(data) // 3, len(data) // 2, len(data) - 500, len(data) - 1):
        path.write_bytes(data[:length])
        with pytest.raises(OSError, match="incomplete"):
            check_whole(path, width=WIDTH, height=HEIGHT, bands=2)


def test_a_block_that_was_never_written_is_missed(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    profile = {"driver": "GTiff", "width": WIDTH, "height": HEIGHT, "count": 1, "dtype": "uint8",
               "sparse_ok": True}  # fmt: skip
    with rasterio.open(path, "w", **profile, **TILED) as file:
        file.write(np.ones((1, 256, 256), np.uint8), window=((0, 256), (256, 512)))
    with pytest.raises(OSError, match="is the disk full"):
        check_whole(path, width=WIDTH, height=HEIGHT, bands=1)


@pytest.mark.parametrize("wrong", [{"width": 701}, {"height": 1}, {"bands": 3}])
def test_a_raster_of_another_shape_is_not_the_one_meant(tmp_path: Path, wrong: dict) -> None:
    path = write(tmp_path / "a.tif")
    with pytest.raises(OSError, match="700 x 300 px in 2 bands instead of"):
        check_whole(path, **({"width": WIDTH, "height": HEIGHT, "bands": 2} | wrong))


def test_what_gdal_says_and_what_it_does_not_say_are_told_alike(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    with (
        pytest.raises(OSError, match="is the disk full") as told,
        written_whole(path, width=1, height=1, bands=1),
    ):
        raise RasterioIOError("Write failed")
    assert not isinstance(told.value, RasterioIOError)
    with (
        pytest.raises(OSError, match="is the disk full"),
        written_whole(path, width=WIDTH, height=HEIGHT, bands=2),
    ):
        path.write_bytes(write(path).read_bytes()[:1000])


def test_an_error_of_gdal_while_reduced_copies_are_made_is_one_of_the_disk(tmp_path: Path) -> None:
    """GDAL's own exception comes through rasterio's `build_overviews` as it is."""
    from rasterio._err import CPLE_AppDefinedError

    with (
        pytest.raises(OSError, match="is the disk full"),
        written_whole(tmp_path / "a.tif", width=1, height=1, bands=1),
    ):
        raise CPLE_AppDefinedError(3, 1, "TIFFAppendToStrip:Write error at scanline 0")


def test_a_raster_comes_back_with_place_names_and_tags(tmp_path: Path) -> None:
    # The centre of the first pixel is (11, 49): its corner, of which GDAL speaks, is (10, 50).
    matrix = np.array([[2.0, 0.0, 11.0], [0.0, -2.0, 49.0]])
    values = np.arange(600 * 530 * 2, dtype=np.float32).reshape(530, 600, 2)
    with create_geotiff(
        tmp_path / "a.tif", width=600, height=530, bands=2, dtype="float32", nodata=3.0,
        transform=corner_transform(matrix), crs="EPSG:32632", names=["h", "s"], tags={"A": "b"},
    ) as writer:  # fmt: skip
        writer.write(values[:, :512], column=0)
        writer.write(values[:, 512:], column=512)
    with rasterio.open(tmp_path / "a.tif") as file:
        assert tuple(file.transform)[:6] == (2, 0, 10, 0, -2, 50)
    with RasterFile(tmp_path / "a.tif", nodata=4.0) as file:
        assert (file.width, file.height, file.bands, file.dtype) == (600, 530, 2, np.float32)
        assert (file.names, file.tags["A"], file.nodata) == (("h", "s"), "b", 4.0)
        assert file.has_position
        np.testing.assert_array_equal(file.xy_from_pixel, matrix)
        np.testing.assert_array_equal(file.read(510, 7, 5, 3), values[7:10, 510:515])
        # Band 1 holds even numbers: 4 is unknown as the reader says, 2 and 6 are not.
        near = file.read_floats(-1, 0, 6, 1, dtype=np.float64)
        np.testing.assert_array_equal(near, [[np.nan, 0, 2, np.nan, 6, 8]])
        assert near.dtype == np.float64


def test_a_raster_that_lies_nowhere_says_so(tmp_path: Path) -> None:
    with create_geotiff(tmp_path / "a.tif", width=3, height=2, bands=1, dtype="uint8") as writer:
        writer.write(np.ones((2, 3), np.uint8))
    with RasterFile(tmp_path / "a.tif") as file:
        assert not file.has_position
        assert (file.crs, file.nodata, file.masked) == (None, None, False)
    with pytest.raises(InputError, match="is a folder"):
        RasterFile(tmp_path)


def test_a_damaged_raster_is_refused_where_it_cannot_be_read(tmp_path: Path) -> None:
    data = write(tmp_path / "a.tif", **TILED).read_bytes()
    (tmp_path / "cut.tif").write_bytes(data[: len(data) // 2])
    with (
        RasterFile(tmp_path / "cut.tif") as file,
        pytest.raises(InputError, match=r"cut\.tif: cannot be read at column 0, row 0; the"),
    ):
        file.read(-5, -5, WIDTH, HEIGHT + 5)


def test_a_window_is_widened_on_every_side() -> None:
    assert Window(10, 20, 30, 40).widened(2) == (8, 18, 34, 44)


def write_plain(path: Path | str, values: np.ndarray, *, overwrite: bool = False) -> None:
    with create_geotiff(
        path, width=values.shape[1], height=values.shape[0], bands=1, dtype=values.dtype,
        names=["grey"], tags={"A": "b"}, overwrite=overwrite,
        transform=corner_transform(np.array([[2.0, 0.0, 11.0], [0.0, -2.0, 49.0]])),
    ) as writer:  # fmt: skip
        writer.write(values, mask=values > 10)


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_a_cloud_optimised_raster_holds_what_a_plain_one_does(tmp_path: Path, kind) -> None:
    values = np.random.default_rng(1).integers(0, 255, (900, 1300)).astype(kind)
    write_plain(tmp_path / "plain.tif", values)
    with cloud_optimised():
        write_plain(tmp_path / "cog.tif", values)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cog.tif", "plain.tif"]
    layouts = []
    for name in ("plain", "cog"):
        with rasterio.open(tmp_path / f"{name}.tif") as file:
            layouts.append(file.tags(ns="IMAGE_STRUCTURE").get("LAYOUT"))
            assert file.tags()["A"] == "b"
            assert file.tags()["TIFFTAG_SOFTWARE"].startswith("bifocal")
            assert file.descriptions == ("grey",)
            assert tuple(file.transform)[:6] == (2, 0, 10, 0, -2, 50)
            assert np.array_equal(file.read(1), values)
            assert np.array_equal(file.dataset_mask() > 0, values > 10)
            overviews = file.overviews(1)
    assert layouts == [None, "COG"]
    assert overviews == [2, 4]


@pytest.mark.parametrize("wanted", [False, True], ids=["plain", "cloud-optimised"])
def test_blocks_that_the_disk_swallowed_are_missed(tmp_path: Path, monkeypatch, wanted) -> None:
    opened = raster._opened

    def swallowing(path: Path, mode: str = "r", **options: object) -> object:
        return opened(path, mode, **options, **({"sparse_ok": True} if mode == "w" else {}))

    monkeypatch.setattr(raster, "_opened", swallowing)
    with (
        pytest.raises(InputError, match="is the disk full"),
        cloud_optimised(wanted),
        create_geotiff(tmp_path / "a.tif", width=1300, height=900, bands=1, dtype="uint8") as file,
    ):
        file.write(np.ones((512, 512), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_gdals_own_file_systems_are_written_and_read() -> None:
    values = np.arange(600 * 700, dtype=np.float32).reshape(600, 700)
    place = "/vsimem/bucket/a.tif"
    write_plain(place, values)
    with RasterFile(place) as file:
        assert np.array_equal(file.read_floats(5, 6, 7, 8), values[6:14, 5:12])
    with pytest.raises(InputError, match="exists already; add --overwrite"):
        write_plain(place, values)
    write_plain(place, values + 1, overwrite=True)
    with RasterFile(place) as file:
        assert file.read(0, 0, 1, 1) == 1
    with pytest.raises(InputError, match=r"could not be read \(No such file"):
        RasterFile("/vsimem/bucket/none.tif")
    with pytest.raises(InputError, match=r"cannot be reached|could not be written"):
        write_plain("/vsicurl/https://localhost:1/a.tif", values)


def blocks_of(path: Path, **level: int) -> int:
    """Return how many bytes the blocks of one resolution take."""
    with rasterio.open(path, **level) as file:
        high, wide = file.block_shapes[0]
        places = [
            f"BLOCK_SIZE_{column}_{row}"
            for row in range(-(-file.height // high))
            for column in range(-(-file.width // wide))
        ]
        return sum(int(file.get_tag_item(place, "TIFF", bidx=1)) for place in places)


def test_no_block_is_written_twice(tmp_path: Path) -> None:
    # GDAL's cache once held 96 bytes for 96 MB: blocks of reduced copies were written band by band,
    # and what they took before stayed in the file, which became half as long again.
    path = tmp_path / "a.tif"
    noise = np.random.default_rng(4).integers(0, 255, (1100, 1100, 4), np.uint8)
    with create_geotiff(
        path, width=1100, height=1100, bands=4, dtype=np.uint8, colour=True, overviews=True
    ) as writer:
        for row in range(0, 1100, 512):
            for column in range(0, 1100, 512):
                cut = noise[row : row + 512, column : column + 512]
                writer.write(cut, column=column, row=row)
    with rasterio.open(path) as file:
        levels = len(file.overviews(1))
    assert levels == 2
    used = blocks_of(path) + sum(blocks_of(path, overview_level=k) for k in range(levels))
    assert path.stat().st_size < 1.01 * used
