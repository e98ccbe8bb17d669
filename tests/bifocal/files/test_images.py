"""Photos: orientation, depth, colour and refusals."""

from __future__ import annotations

import contextlib
import re
import sys
import types
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from bifocal import InputError, read_image, write_image
from bifocal.model.image import as_grey
from photocore.images import READ, image_info, to_eight_bit, turn_upright

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


def test_formats_of_phones_and_the_web_are_read_upright(tmp_path):
    smooth = cv2.GaussianBlur(cv2.resize(PICTURE, (64, 48)), (0, 0), 4)
    exif = Image.Exif()
    exif[274] = 6
    for name, format_ in (("a.webp", "WEBP"), ("a.avif", "AVIF")):
        Image.fromarray(smooth).save(tmp_path / name, format_, quality=95, exif=exif)
        assert image_info(tmp_path / name).size == (48, 64)
        found = read_image(tmp_path / name).astype(int)
        assert np.abs(found - np.rot90(smooth, -1)).mean() < 6
        assert read_image(tmp_path / name, grey=True).shape == (64, 48)


def test_heic_and_raw_are_read_where_their_libraries_are(tmp_path, monkeypatch):
    heic, raw = tmp_path / "IMG 1.HEIC", tmp_path / "p.nef"
    heic.write_bytes(b"x")
    raw.write_bytes(b"x")
    for name in ("pillow_heif", "rawpy"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(InputError, match=r"saved as JPEG.*photos"):
        read_image(heic)
    with pytest.raises(InputError, match=r"16-bit TIFF.*photos"):
        read_image(raw)
    developed = np.full((4, 6, 3), 700, np.uint16)
    sizes = types.SimpleNamespace(width=4, height=6, flip=5)

    class LibRawError(Exception):
        pass

    def extract_thumb():
        raise LibRawError("no thumbnail")

    def imread(path):  # what rawpy offers of a file, and of one that it does not know
        if path.endswith("p.nef"):
            held = types.SimpleNamespace(
                sizes=sizes, postprocess=lambda **_: developed, extract_thumb=extract_thumb
            )
            return contextlib.nullcontext(held)
        raise LibRawError("unknown")

    fake = types.SimpleNamespace(imread=imread, LibRawError=LibRawError)
    monkeypatch.setitem(sys.modules, "rawpy", fake)
    assert (image_info(raw).size, image_info(raw).bits) == ((6, 4), 16)
    np.testing.assert_array_equal(read_image(raw), developed)
    (tmp_path / "q.dng").write_bytes(b"x")
    with pytest.raises(InputError, match=r"camera raw cannot be read \(unknown\)"):
        read_image(tmp_path / "q.dng")


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


def test_a_reader_that_pillow_lacks_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "wall.png"
    Image.new("RGB", (40, 30)).save(path)
    Image.init()
    monkeypatch.delitem(Image.OPEN, "PNG")
    monkeypatch.setattr(Image, "init", lambda: 0)
    with pytest.raises(InputError, match="Pillow cannot read PNG here"):
        image_info(path)


def test_the_page_lets_every_photo_be_chosen_that_is_read():
    script = resources.files("bifocal.collimation").joinpath("web/js/photos.js").read_text()
    of_browsers = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp"}  # image/*
    assert {one for one in READ - of_browsers if not re.search(rf"\{one}\b", script)} == set()
