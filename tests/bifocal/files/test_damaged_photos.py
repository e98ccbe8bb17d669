"""A photo whose data are damaged is refused by its name; the decoders' own words stay inside."""

from __future__ import annotations

import io
import os
import shutil
from contextlib import suppress

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

from bifocal import SAMPLE, InputError, read_image
from multimedia.projects.photos import read_photo
from photocore import images
from photocore.decoding import decoded, decoders_words
from tests.builders.commands import bifocal_command as main

ENDINGS = {".jpg": "JPEG", ".tif": "TIFF", ".png": "PNG"}
FAR = (SAMPLE / "far.jpg").read_bytes()


def zeroed(content: bytes, count: int = 40) -> bytes:
    """Return a file with some bytes in its middle lost."""
    middle = len(content) // 2
    return content[:middle] + bytes(count) + content[middle + count :]


def saved(ending: str, **options: object) -> bytes:
    """Return the sample's far photo in another format."""
    out = io.BytesIO()
    Image.open(io.BytesIO(FAR)).resize((768, 512)).save(out, ending, **options)
    return out.getvalue()


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("plain.jpg", {}),
        ("progressive.jpg", {"progressive": True}),
        ("restarts.jpg", {"restart_marker_rows": 1}),
        ("lzw.tif", {"compression": "tiff_lzw"}),
        ("deflate.tif", {"compression": "tiff_adobe_deflate"}),
        ("jpeg.tif", {"compression": "jpeg"}),
        ("a.png", {}),
    ],
)
@pytest.mark.parametrize("grey", [False, True])
def test_damage_is_refused_by_the_files_name_alone(tmp_path, capfd, name, options, grey):
    path = tmp_path / name
    content = FAR if name == "plain.jpg" else saved(ENDINGS[path.suffix], **options)
    path.write_bytes(content)
    whole = read_image(path, grey=grey)
    assert whole.size
    path.write_bytes(zeroed(content))
    with pytest.raises(InputError, match=rf"{name}: the (photo|image) is damaged"):
        read_image(path, grey=grey)
    path.write_bytes(content[: len(content) * 6 // 10])
    with pytest.raises(InputError, match=name):
        read_image(path, grey=grey)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("place", range(20, 100, 10))
def test_bytes_lost_anywhere_are_noticed_where_the_decoder_is_silent_too(tmp_path, place):
    start = len(FAR) * place // 100
    (tmp_path / "far.jpg").write_bytes(FAR[:start] + bytes(40) + FAR[start + 40 :])
    with pytest.raises(InputError, match=r"damaged \((bytes lost at \d+%|JPEG data)"):
        read_image(tmp_path / "far.jpg")


@pytest.mark.parametrize("options", [{}, {"optimize": True, "quality": 92}])
def test_other_bytes_are_noticed_by_the_picture_where_the_decoder_is_silent(options):
    rng, content, out = np.random.default_rng(2), FAR, io.BytesIO()
    if options:
        Image.open(io.BytesIO(FAR)).save(out, "JPEG", **options)
        content = out.getvalue()
    whole = decoded("a.jpg", np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR).astype(int)
    spoiled = 0
    for _ in range(40):
        middle = int(len(content) * rng.uniform(0.3, 0.7))
        data = np.frombuffer(content, np.uint8).copy()
        data[middle : middle + 40] = rng.integers(0, 256, 40)
        with suppress(InputError):
            found = decoded("a.jpg", data, cv2.IMREAD_COLOR)
            spoiled += (np.abs(found - whole).max(axis=2) > 8).mean() > 0.05
    assert spoiled <= 1  # without the look at the picture, 3 and 9


@pytest.mark.parametrize("options", [{}, {"optimize": True}, {"progressive": True}])
@pytest.mark.parametrize("mode", ["L", "RGB"])
def test_a_flat_picture_is_whole(tmp_path, options, mode):
    flat = np.zeros((900, 1200), np.uint8)
    flat[:8, :8] = 200
    Image.fromarray(flat).convert(mode).save(tmp_path / "flat.jpg", quality=95, **options)
    assert read_image(tmp_path / "flat.jpg").shape[:2] == (900, 1200)


def test_large_photos_and_those_of_tanks_are_asked_too(tmp_path, monkeypatch):
    monkeypatch.setattr(images, "_BY_STRIPS", 1000)
    path = tmp_path / "far.jpg"
    path.write_bytes(FAR)
    assert read_image(path).shape[:2] == read_photo(path).shape == (1024, 1536)
    path.write_bytes(zeroed(FAR))
    for reader in (read_image, read_photo):
        with pytest.raises(InputError, match=r"far\.jpg: the photo is damaged"):
            reader(path)


@pytest.mark.parametrize("filling", [b"\0" * 40, b"\xff" * 7])
def test_padding_before_the_end_is_no_damage(tmp_path, filling, capfd):
    (tmp_path / "padded.jpg").write_bytes(FAR[:-2] + filling + FAR[-2:] + b"and a trailer")
    found = read_image(tmp_path / "padded.jpg")
    np.testing.assert_array_equal(found, read_image(SAMPLE / "far.jpg"))
    assert capfd.readouterr().err == ""


def test_a_progress_bar_of_another_thread_is_shown(capfd):
    with decoders_words() as words:
        os.write(2, b"Corrupt\n\x1b[2K50 %\n")
    assert words == ["Corrupt", "\x1b[2K50 %"]
    assert capfd.readouterr().err == "\x1b[2K50 %\n"


@pytest.mark.parametrize("command", ["ortho", "relief", "match"])
def test_no_command_measures_a_damaged_photo(tmp_path, command):
    for file in SAMPLE.iterdir():
        shutil.copyfile(file, tmp_path / file.name)
    (tmp_path / "far.jpg").write_bytes(zeroed(FAR))
    out = tmp_path / ("out.csv" if command == "match" else "out.tif")
    words = [command, str(tmp_path / "facade.pair.json"), "--out", str(out)]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 1
    assert "far.jpg: the photo is damaged" in done.stderr
    assert not out.exists()
