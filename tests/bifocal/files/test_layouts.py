"""Every layout that tifffile and Pillow write is read to the pixels that these hold."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

from bifocal import InputError, read_image
from photocore.decoding import decoded
from photocore.provenance import noted_remarks, recording

RNG = np.random.default_rng(11)
COLOUR = RNG.integers(0, 256, (20, 31, 4), dtype=np.uint8)
DEEP = RNG.integers(0, 65536, (20, 31, 4), dtype=np.uint16)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("compression", [None, "zlib"])
@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("whole", [COLOUR, DEEP], ids=["8 bit", "16 bit"])
def test_a_tiff_is_what_tifffile_wrote(tmp_path, whole, channels, planar, compression, order):
    pixels = whole[..., 0] if channels == 1 else whole[..., :channels]
    stored = np.moveaxis(pixels, -1, 0) if channels > 1 and planar == "separate" else pixels
    tifffile.imwrite(
        tmp_path / "p.tif",
        np.ascontiguousarray(stored),
        photometric="minisblack" if channels == 1 else "rgb",
        planarconfig=planar if channels > 1 else None,
        extrasamples=["unassalpha"] if channels == 4 else None,
        compression=compression,
        byteorder=order,
    )
    shown = pixels if channels == 1 else pixels[..., :3]
    np.testing.assert_array_equal(read_image(tmp_path / "p.tif"), shown)
    grey = read_image(tmp_path / "p.tif", grey=True)
    assert grey.shape == (20, 31)
    assert grey.dtype == whole.dtype


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA", "I;16"])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_what_pillow_writes_is_what_pillow_shows(tmp_path, mode, ending):
    path = tmp_path / f"p.{ending}"
    image = Image.fromarray(DEEP[..., 0]) if mode == "I;16" else Image.fromarray(COLOUR[..., :3])
    image = image if mode in ("RGB", "I;16") else image.convert(mode)
    image.save(path)
    shown = np.asarray(image if mode == "I;16" else image.convert("RGB")).astype(int)
    pixels = read_image(path).astype(int)
    pixels = pixels if mode == "I;16" or pixels.ndim == 3 else np.repeat(pixels[..., None], 3, 2)
    np.testing.assert_array_equal(pixels, shown)


@pytest.mark.parametrize("bits", [9, 10, 12, 14, 15, 16])
@pytest.mark.parametrize("ending", ["png", "tif"])
def test_few_bits_in_sixteen_fill_them(tmp_path, bits, ending):
    pixels = (DEEP[..., 0] >> (16 - bits)).astype(np.uint16)
    pixels[0, 0] = 2**bits - 1
    path = tmp_path / f"p.{ending}"
    Image.fromarray(pixels).save(path)
    room = {9: 10, 15: 16}.get(bits, bits)
    with recording("a test"):
        for _ in range(2):
            np.testing.assert_array_equal(read_image(path), pixels << (16 - room))
        said = [f"holds {room} of 16 bits; its numbers were multiplied by {1 << (16 - room)}."]
        assert [text.partition(": ")[2] for text in noted_remarks()] == said * (room < 16)


def rgb_profile(red, green, blue) -> bytes:
    """Return the profile of a space of these primaries (x, y), D65, gamma 2.2, by hand."""
    xyz = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in (red, green, blue)]).T
    white = np.array([0.3127 / 0.329, 1.0, (1 - 0.3127 - 0.329) / 0.329])
    columns = xyz * np.linalg.solve(xyz, white)
    bradford = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367],
                         [0.0389, -0.0685, 1.0296]])  # fmt: skip
    d50 = np.array([0.9642, 1.0, 0.8249])
    gain = np.diag((bradford @ d50) / (bradford @ white))
    columns = np.linalg.solve(bradford, gain @ bradford @ columns)

    def s15(value: float) -> bytes:
        return round(value * 65536).to_bytes(4, "big", signed=True)

    body = [(b"%cXYZ" % c, b"XYZ " + bytes(4) + b"".join(map(s15, columns[:, k])))
            for k, c in enumerate(b"rgb")]  # fmt: skip
    body.append((b"wtpt", b"XYZ " + bytes(4) + b"".join(map(s15, d50))))
    curve = b"curv" + bytes(4) + (1).to_bytes(4, "big") + (563).to_bytes(2, "big")
    body += [(b"%cTRC" % c, curve + bytes(2)) for c in b"rgb"]
    text = b"desc" + bytes(4) + (2).to_bytes(4, "big") + b"x\0" + bytes(78)
    body += [(b"desc", text + bytes(-len(text) % 4)), (b"cprt", b"text" + bytes(4) + b"none")]
    table, data, at = b"", b"", 132 + 12 * len(body)
    for name, content in body:
        table += name + at.to_bytes(4, "big") + len(content).to_bytes(4, "big")
        data, at = data + content, at + len(content)
    head = at.to_bytes(4, "big") + bytes(4) + b"\x02\x40\0\0mntrRGB XYZ " + bytes(12) + b"acsp"
    head += bytes(28) + b"".join(map(s15, d50)) + bytes(48)
    return head + len(body).to_bytes(4, "big") + table + data


P3 = (0.680, 0.320), (0.265, 0.690), (0.150, 0.060)
ADOBE = (0.640, 0.330), (0.210, 0.710), (0.150, 0.060)
SRGB = (0.640, 0.330), (0.300, 0.600), (0.150, 0.060)


@pytest.mark.parametrize("primaries", [P3, ADOBE, SRGB], ids=["P3", "Adobe RGB", "sRGB"])
@pytest.mark.parametrize("ending", ["png", "tif", "jpg"])
def test_colours_of_another_space_become_those_of_srgb(tmp_path, primaries, ending):
    """A brick of 190, 70, 60 in sRGB, its numbers in the other space by the primaries alone."""

    def matrix(of):
        xyz = np.array([[x / y, 1.0, (1 - x - y) / y] for x, y in of]).T
        return xyz * np.linalg.solve(xyz, [0.3127 / 0.329, 1.0, (1 - 0.3127 - 0.329) / 0.329])

    brick = np.array([190.0, 70.0, 60.0]) / 255
    linear = np.where(brick > 0.04045, ((brick + 0.055) / 1.055) ** 2.4, brick / 12.92)
    inside = np.linalg.solve(matrix(primaries), matrix(SRGB) @ linear)
    numbers = np.rint(255 * inside ** (1 / (563 / 256))).astype(np.uint8)
    path = tmp_path / f"p.{ending}"
    options = {"quality": 100, "subsampling": 0} if ending == "jpg" else {}
    picture = Image.fromarray(np.full((16, 16, 3), numbers, np.uint8))
    profile = rgb_profile(*primaries)
    assert ImageCms.ImageCmsProfile(io.BytesIO(profile)).profile.xcolor_space.strip() == "RGB"
    picture.save(path, icc_profile=profile, **options)
    got = read_image(path)[8, 8].astype(int)
    if primaries is SRGB:
        assert np.abs(got - numbers).max() <= (2 if ending == "jpg" else 0)
    else:
        assert np.abs(got - [190, 70, 60]).max() <= 2
        assert np.abs(numbers - np.array([190, 70, 60])).max() > 5


@pytest.mark.parametrize(("primaries", "told"), [(P3, 1), (SRGB, 0)], ids=["P3", "sRGB"])
def test_sixteen_bits_of_another_space_stay_as_they_are_and_that_is_said(tmp_path, primaries, told):
    path = tmp_path / "deep.tif"
    deep = np.full((16, 16, 3), [50000, 20000, 15000], np.uint16)
    profile = rgb_profile(*primaries)
    tifffile.imwrite(path, deep, photometric="rgb", iccprofile=profile)
    with recording("a test"):
        np.testing.assert_array_equal(read_image(path), deep)
        assert len(noted_remarks()) == told
        assert all("not brought to sRGB" in text for text in noted_remarks())


def test_a_film_or_zeros_behind_a_jpeg_are_no_cut(tmp_path):
    packed = io.BytesIO()
    Image.fromarray(COLOUR[..., :3]).save(packed, "JPEG", quality=95)
    photo = packed.getvalue()
    path = tmp_path / "motion.jpg"
    path.write_bytes(photo)
    plain = read_image(path)
    film = b"\0\0\0\x18ftypmp42" + RNG.integers(0, 255, 4 * len(photo), dtype=np.uint8).tobytes()
    for behind in (film.replace(b"\xff\xd9", b"\xff\xd8"), bytes(3 * len(photo))):
        path.write_bytes(photo + behind)
        np.testing.assert_array_equal(read_image(path), plain)
    half = photo[: len(photo) // 2]
    with pytest.raises(InputError, match="cut off"):
        decoded(Path("half.jpg"), np.frombuffer(half + bytes(len(photo)), np.uint8), 1)


def test_no_other_reader_of_pillow_is_tried_on_what_is_named_jpg(tmp_path):
    path = tmp_path / "photo.jpg"
    Image.fromarray(COLOUR[..., 0]).save(path, "PCX")
    with pytest.raises(InputError, match="is not an image"):
        read_image(path)
