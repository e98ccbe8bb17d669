"""A raster takes its place only when every block of it is in the file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.errors import RasterioIOError

from photocore.raster import check_whole, written_whole

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
