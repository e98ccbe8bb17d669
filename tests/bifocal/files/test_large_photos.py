"""TIFFs too large to hold are read window by window, to the same pixels."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from bifocal import (
    FlatSurface,
    Grid,
    InputError,
    LargePhoto,
    Pair,
    Photo,
    dense_relief,
    open_photo,
    orthophoto,
    read_image,
)
from bifocal.model.image import as_grey
from bifocal.orthophotos import rectify
from bifocal.orthophotos.radiometry import corrected_photo, match_exposure
from bifocal.orthophotos.rectify import SourcePhoto
from photocore import images, large_photos

RNG = np.random.default_rng(12)
ROUGH = RNG.integers(20, 230, (40, 30, 3), dtype=np.uint8)
PICTURE = cv2.resize(ROUGH, (180, 240), interpolation=cv2.INTER_CUBIC)
#: 10 mm a pixel, turned by a degree, so that nothing falls on the lattice of the photo.
TURN = np.array([[0.01, 0.0002, -0.9], [0.0002, -0.01, 1.2], [0, 0, 1]])
CAMERA = Photo(plane_from_pixel=TURN, nadir=(0, 0), distance=3.0)


@pytest.fixture(autouse=True)
def _small_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read what is small as if it were large, and by windows of a few rows."""
    monkeypatch.setattr(large_photos, "BY_WINDOWS", 1000)
    monkeypatch.setattr(rectify, "_WINDOW", 4000)
    for module in (large_photos, rectify):
        monkeypatch.setattr(module, "ROWS", 16)


def tiff(folder: Path, pixels: np.ndarray, **options: object) -> Path:
    path = folder / "photo.tif"
    colour = pixels.ndim == 3
    tifffile.imwrite(path, pixels, photometric="rgb" if colour else "minisblack", **options)
    return path


@pytest.mark.parametrize("orientation", range(1, 9))
def test_windows_of_every_orientation_are_those_of_the_whole(tmp_path, orientation):
    path = tiff(tmp_path, PICTURE, extratags=[(274, "H", 1, orientation, True)])
    whole = read_image(path)
    with open_photo(path) as photo:
        assert isinstance(photo, LargePhoto)
        assert (photo.shape, photo.dtype, photo.ndim) == (whole.shape, whole.dtype, whole.ndim)
        for window in (np.s_[:, :], np.s_[3:40, 100:101], np.s_[-9:, 7:-20]):
            np.testing.assert_array_equal(photo[window], whole[window])


@pytest.mark.parametrize(
    "pixels",
    [
        PICTURE[:, :, 0],
        PICTURE.astype(np.uint16) * 257,
        PICTURE.astype(np.uint16) * 4,  # 10 bits of 16
        np.dstack([PICTURE, np.full((240, 180), 255, np.uint8)]),
    ],
    ids=["grey", "16 bits", "10 bits in 16", "alpha"],
)
@pytest.mark.parametrize("options", [{}, {"tile": (32, 32), "compression": "zlib"}])
def test_depths_and_bands_are_read_as_a_whole_photo_is(tmp_path, pixels, options):
    path = tiff(tmp_path, pixels, **options)
    with open_photo(path) as photo:
        assert isinstance(photo, LargePhoto)
        np.testing.assert_array_equal(np.asarray(photo), read_image(path))
        np.testing.assert_array_equal(as_grey(photo, "photo"), as_grey(read_image(path), "photo"))


@pytest.mark.parametrize("pixels", ["planar", "jpeg", "png"])
def test_what_windows_would_show_otherwise_is_read_whole(tmp_path, pixels):
    path = tmp_path / "photo.tif"
    if pixels == "planar":
        tifffile.imwrite(path, np.moveaxis(PICTURE, 2, 0), photometric="rgb", planarconfig=2)
    elif pixels == "jpeg":
        path = tmp_path / "photo.jpg"
        images.write_image(path, PICTURE)
    else:
        path = tmp_path / "photo.png"
        images.write_image(path, PICTURE)
    with open_photo(path) as photo:
        np.testing.assert_array_equal(np.asarray(photo), read_image(path))


def test_more_than_memory_holds_is_refused_only_where_all_of_it_is_wanted(tmp_path, monkeypatch):
    path = tiff(tmp_path, PICTURE)
    monkeypatch.setattr(images, "MAX_PIXELS", 2000)
    monkeypatch.setattr(images.check_size, "__defaults__", (2000,))
    with pytest.raises(InputError, match="claims 180 x 240 px"):
        read_image(path)
    with open_photo(path) as photo:
        assert photo[:5, :5].shape == (5, 5, 3)
        with pytest.raises(InputError, match="Halve it first"):
            np.asarray(photo)


@pytest.mark.parametrize("gsd", [0.01, 0.031])
@pytest.mark.parametrize("vignetting", ["", "cos4"])
def test_orthophotos_are_the_same_pixel_by_pixel(tmp_path, gsd, vignetting):
    path = tiff(tmp_path, PICTURE)
    grid = Grid.from_bounds((-0.8, -1.0, 0.7, 1.1), gsd=gsd)
    surface = FlatSurface(0.1)
    second = cv2.GaussianBlur(PICTURE, (0, 0), 1.5) // 2 + 40
    drawn = []
    with open_photo(path) as photo:
        for pixels in (photo, read_image(path)):
            image, _, _ = corrected_photo(pixels, CAMERA, vignetting=vignetting)
            view = SourcePhoto.prepare(CAMERA, image, number=2, gsd=gsd)
            first = SourcePhoto.prepare(CAMERA, second, number=1, gsd=gsd)
            view, note = match_exposure(first, view, surface, grid)
            assert "matched" in note
            column, row = view.pixel_map(grid, surface.window(grid))
            drawn.append(view.sample(column, row, "cubic"))
    np.testing.assert_array_equal(*drawn)


def test_relief_and_orthophoto_of_python_take_it(tmp_path):
    far = Photo(plane_from_pixel=TURN, nadir=(0, 0), distance=5.0)
    pair = Pair(image1=far, image2=CAMERA)
    path = tiff(tmp_path, PICTURE)
    whole = read_image(path)
    with open_photo(path) as photo:
        results = [
            (dense_relief(pair, one, whole, gsd=0.025), orthophoto(pair, one, gsd=0.02))
            for one in (photo, whole)
        ]
    np.testing.assert_array_equal(*(relief.r for relief, _ in results))
    np.testing.assert_array_equal(*(picture.image for _, picture in results))


#: Draws a photo of 120 megapixels to scale and prints the most memory used. [KiB]
SCRIPT = """
import re, sys
from bifocal.cli.main import main
corners = "0,0,11999,0,11999,9999,0,9999"
try:
    main(["rectify", "big.tif", "--rectangle", "12,10", "--corners", corners, "--focal", "35",
          "--sensor-width", "36", "--gsd", "4mm", "--out", "o.tif"])
except SystemExit as end:
    assert not end.code
print(re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
"""


@pytest.mark.acceptance
@pytest.mark.skipif(sys.platform != "linux", reason="memory is read from /proc")
def test_a_large_tiff_is_drawn_in_memory_that_does_not_grow_with_it(tmp_path):
    band = np.tile(cv2.resize(ROUGH, (500, 500)), (1, 24, 1))
    tifffile.imwrite(
        tmp_path / "big.tif", np.tile(band, (20, 1, 1)), photometric="rgb", rowsperstrip=100
    )
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    memory = int(done.stdout.split()[-1]) / 1024
    # 720 megapixels take as much; read whole these alone would be 360 MB more.
    assert memory < 450, f"{memory:.0f} MB"
