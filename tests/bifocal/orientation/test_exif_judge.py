"""EXIF data of a photo held against each other: what agrees counts, what contradicts is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bifocal.files.exif_judge import middle_aside
from bifocal.orientation.align_workflow import KnownLens, interior_of_photo, judged_together
from photocore.images import ImageInfo, image_info

#: A 35 mm lens on a sensor 22.7 mm wide, 3072 px; and at half the size.
PITCH = 22.7 / 3072
WHOLE, HALF = 35 / PITCH, 35 / PITCH / 2


def interior(width: int = 1536, **tags: object):
    known = {"focal_length": 35.0, "focal_plane_pitch": PITCH} | tags
    info = ImageInfo(path=Path("far.jpg"), size=(width, width * 2 // 3), **known)
    return interior_of_photo(info, KnownLens())


def test_a_resized_photo_keeps_the_lens_of_the_whole(tmp_path) -> None:
    path = tmp_path / "small.jpg"
    exif = Image.Exif()
    exif.get_ifd(34665).update(
        {37386: 35.0, 41486: 3072 / 22.7, 41488: 4, 40962: 3072, 40963: 2048}
    )
    Image.fromarray(np.zeros((1024, 1536, 3), np.uint8)).save(path, exif=exif)
    made = interior_of_photo(image_info(path), KnownLens())
    assert made.focal == pytest.approx(HALF, rel=1e-4)
    assert made.sigma_focal == 0.02
    assert "3072 px wide saved at 1536 px" in made.source
    assert not made.doubt


def test_a_whole_photo_is_as_its_focal_plane_says() -> None:
    for more in ({}, {"recorded_size": (3072, 2048)}, {"focal_length_35": 55.5}):
        made = interior(3072, **more)
        assert made.focal == pytest.approx(WHOLE)
        assert (made.sigma_focal, made.source, made.doubt) == (0.02, "EXIF, 35 mm", "")
    # Cut to other proportions, nothing was enlarged.
    assert interior(3000, recorded_size=(3072, 2304)).focal == pytest.approx(WHOLE)


@pytest.mark.parametrize("wrong", [1.52, 0.5, 2.0])
def test_a_focal_plane_that_the_equivalent_contradicts_is_said_and_covered(wrong) -> None:
    made = interior(3072, focal_plane_pitch=PITCH / wrong, focal_length_35=55.5)
    assert made.focal == pytest.approx(WHOLE, rel=0.02)
    assert "contradict themselves" in made.doubt
    off = min(abs(np.log(wrong)), 0.28)
    assert made.sigma_focal == pytest.approx(off / 2, abs=0.012)


def test_digital_zoom_lengthens_the_lens() -> None:
    zoomed = interior(3072, digital_zoom=1.84)
    assert zoomed.focal == pytest.approx(1.84 * WHOLE)
    assert zoomed.focal * zoomed.pixel_size == pytest.approx(35)
    for equivalent in (55.5, 55.5 * 1.84):  # some makers count it in, some do not
        agreed = interior(3072, digital_zoom=1.84, focal_length_35=equivalent)
        assert agreed.focal == pytest.approx(1.84 * WHOLE)
        assert not agreed.doubt
    alone = interior(3072, digital_zoom=1.3, focal_plane_pitch=None, focal_length_35=55.5)
    assert "digital zoom 1.3" in alone.doubt
    for true in (WHOLE, 1.3 * WHOLE):
        assert abs(np.log(alone.focal / true)) < 1.2 * alone.sigma_focal


def test_two_photos_of_one_camera_with_sensors_of_two_sizes_are_doubted() -> None:
    whole, near = (
        ImageInfo(
            path=Path(name), size=(width, width * 2 // 3), model="X", focal_length=focal,
            focal_plane_pitch=PITCH,
        )
        for name, width, focal in (("far.jpg", 3072, 35.0), ("near.jpg", 1536, 19.0))
    )  # fmt: skip
    lenses = [interior_of_photo(info, KnownLens()) for info in (whole, near)]
    for made in judged_together((whole, near), lenses):
        assert made.sigma_focal == pytest.approx(np.log(2), abs=0.2)
        assert "both of X" in made.doubt
    known = interior_of_photo(near, KnownLens(focal=19, sensor_width=22.7))
    assert judged_together((whole, near), [lenses[0], known])[1] is known
    other = replace(near, model="Y")
    assert judged_together((whole, other), lenses) == lenses


def test_what_was_typed_is_not_doubted() -> None:
    info = ImageInfo(
        path=Path("far.jpg"), size=(3072, 2048), focal_length=35.0, focal_length_35=55.5,
        focal_plane_pitch=PITCH / 2,
    )  # fmt: skip
    made = interior_of_photo(info, KnownLens(focal=35, sensor_width=22.7))
    assert made.focal == pytest.approx(WHOLE)
    assert not made.doubt


@pytest.mark.parametrize(
    ("size", "recorded", "said"),
    [
        ((3072, 2048), (3072, 2048), ""),
        ((1536, 1024), (3072, 2048), ""),
        ((2048, 3072), (3072, 2048), ""),
        ((2000, 2048), (3072, 2048), "THE PHOTO WAS CROPPED: a.jpg has 2000 x 2048 px of the 3072"),
        ((4928, 3264), None, ""),
        ((4000, 2252), None, ""),
        ((3072, 1900), None, "THE PHOTO WAS PROBABLY CROPPED: a.jpg is 3072 x 1900 px"),
    ],
)
def test_a_cropped_photo_is_told_by_its_size(size, recorded, said) -> None:
    info = ImageInfo(
        path=Path("a.jpg"), size=size, recorded_size=recorded, model="X", focal_length=35,
        focal_plane_pitch=22.7 / 3072,
    )  # fmt: skip
    usual = 0.004 * np.hypot(*size)
    for data in (KnownLens(), KnownLens(focal=35, pixel_size=22.7 / 3072)):
        interior = interior_of_photo(info, data)
        assert interior.doubt.startswith(said)
        assert bool(interior.doubt) == bool(said)
        assert interior.is_part == bool(said)
        assert (interior.sigma_centre > 5 * usual) == bool(said)
    aside, words = middle_aside(replace(info, model="", focal_length=None))
    assert bool(words) == bool(said and recorded)
    assert aside == (interior.sigma_centre if words else 0.0)
