"""Photos: orientation, depth, colour and refusals."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from bifocal import InputError, read_image, write_image
from bifocal.model.image import as_grey
from photocore.images import image_info, to_eight_bit, turn_upright

PICTURE = np.random.default_rng(7).integers(0, 255, (24, 36, 3), dtype=np.uint8)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("ending", ["png", "jpg", "tif"])
def test_every_orientation_is_read_as_pillow_shows_it(tmp_path, orientation, ending):
    path = tmp_path / f"photo.{ending}"
    smooth = cv2.GaussianBlur(PICTURE, (0, 0), 3)
    exif = Image.Exif()
    exif[274] = orientation
    Image.fromarray(smooth).save(path, exif=exif, quality=100, subsampling=0)
    from PIL import ImageOps

    with Image.open(path) as image:
        expected = np.asarray(ImageOps.exif_transpose(image))
    found = read_image(path)
    assert found.shape == expected.shape
    assert np.abs(found.astype(int) - expected).max() <= 3
    assert image_info(path).size == (expected.shape[1], expected.shape[0])


def test_orientation_six_turns_the_left_edge_up():
    stored = np.array([[1, 2], [3, 4]], dtype=np.uint8)
    assert turn_upright(stored, 6).tolist() == [[3, 1], [4, 2]]


def test_sixteen_bit_colour_tiff_keeps_its_bits(tmp_path):
    path = tmp_path / "deep.tif"
    deep = PICTURE.astype(np.uint16) * 257
    write_image(path, deep)
    assert image_info(path).bits == 16
    np.testing.assert_array_equal(read_image(path), deep)
    np.testing.assert_array_equal(to_eight_bit(read_image(path)), PICTURE)


def test_sixteen_bits_become_the_nearest_of_eight_and_are_cut_for_matching():
    deep = np.arange(65536, dtype=np.uint16).reshape(256, 256)
    np.testing.assert_array_equal(to_eight_bit(deep), np.rint(deep / 257.0))
    np.testing.assert_array_equal(as_grey(deep, "deep"), deep // 256)


def test_alpha_is_dropped_and_grey_stays_grey(tmp_path):
    Image.fromarray(np.dstack([PICTURE, PICTURE[..., 0]])).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), PICTURE)
    Image.fromarray(PICTURE[..., 0]).save(tmp_path / "g.png")
    np.testing.assert_array_equal(read_image(tmp_path / "g.png"), PICTURE[..., 0])
    assert read_image(tmp_path / "a.png", grey=True).ndim == 2


def test_exif_focal_lengths_are_read(tmp_path):
    exif = Image.Exif()
    exif[271], exif[272] = "Canon", "EOS 300D"
    exif.get_ifd(34665).update({37386: 35.0, 41989: 56, 42036: "EF-S 18-55mm"})
    Image.fromarray(PICTURE).save(tmp_path / "e.jpg", exif=exif)
    info = image_info(tmp_path / "e.jpg")
    assert (info.make, info.model, info.lens) == ("Canon", "EOS 300D", "EF-S 18-55mm")
    assert (info.focal_length, info.focal_length_35) == (35.0, 56.0)
    # By hand: the photo's diagonal is hypot(36, 24) px, so 56 mm on the film diagonal is 56 px.
    assert info.focal_pixels == pytest.approx(56.0)


def test_cmyk_is_refused_with_advice(tmp_path):
    for name in ("c.jpg", "c.tif"):
        Image.fromarray(PICTURE).convert("CMYK").save(tmp_path / name)
        with pytest.raises(InputError, match="RGB"):
            read_image(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("p.cr2", b"II*\0", "camera raw"),
        ("p.jpg", b"", "empty"),
        ("p.jpg", b"hello world", "not an image"),
        ("p.tif", b"II*\0garbage", "TIFF|damaged"),
    ],
)
def test_what_is_not_a_photo_is_named(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_image(tmp_path / name)


def test_missing_photo_and_folder_are_named(tmp_path):
    with pytest.raises(InputError, match="no such image"):
        read_image(tmp_path / "none.jpg")
    with pytest.raises(InputError, match="folder"):
        read_image(tmp_path)


def test_a_cut_jpeg_is_refused(tmp_path):
    path = tmp_path / "cut.jpg"
    big = cv2.resize(PICTURE, (640, 480))
    write_image(path, big)
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(InputError, match="cut off"):
        read_image(path)


@pytest.mark.acceptance
def test_a_decompression_bomb_is_refused_by_its_header(tmp_path):
    path = tmp_path / "bomb.png"
    Image.new("1", (30_000, 30_000)).save(path)
    with pytest.raises(InputError, match="400 MP"):
        read_image(path)


@pytest.mark.parametrize("ending", [".png", ".tif"])
def test_large_photos_are_read_by_strips_to_the_same_pixels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    from photocore import images

    photo = np.random.default_rng(6).integers(0, 255, (600, 70, 3), dtype=np.uint8)
    images.write_image(tmp_path / f"p{ending}", photo)
    monkeypatch.setattr(images, "_BY_STRIPS", 1000)
    np.testing.assert_array_equal(images.read_image(tmp_path / f"p{ending}"), photo)
