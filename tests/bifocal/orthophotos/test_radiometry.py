"""Colours of the picture."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bifocal import FlatSurface, Grid, InputError, Photo
from bifocal.orthophotos.radiometry import (
    chromatic_shift,
    corrected_photo,
    devignetted,
    match_exposure,
)
from bifocal.orthophotos.rectify import SourcePhoto

SIZE = (480, 360)
PHOTO = Photo(
    plane_from_pixel=[[0.01, 0, -2.395], [0, -0.01, 1.795], [0, 0, 1]], nadir=(0, 0), distance=3.0
)


def wall() -> np.ndarray:
    rng = np.random.default_rng(9)
    rough = rng.integers(40, 200, (90, 120, 3), dtype=np.uint8)
    return cv2.resize(rough, SIZE, interpolation=cv2.INTER_CUBIC)


def test_nothing_is_corrected_unless_asked_for() -> None:
    image, shift, notes = corrected_photo(wall(), PHOTO)
    np.testing.assert_array_equal(image, wall())
    assert shift is None
    assert notes == ()


def test_the_natural_fall_off_is_undone() -> None:
    # f = 3 m / 10 mm = 300 px; 160 px off the middle: cos^4 = (1 + (160/300)^2)^-2 = 0.606.
    column = round((SIZE[0] - 1) / 2 + 160)
    flat = np.full((SIZE[1], SIZE[0]), 100, np.uint8)
    found = devignetted(flat, PHOTO, "cos4")
    assert found[180, column] == pytest.approx(100 / 0.606, abs=1.5)
    assert found[180, 240] == 100


def test_given_coefficients_are_used_and_nonsense_refused() -> None:
    flat = np.full((SIZE[1], SIZE[0]), 100, np.uint8)
    # In the corner r = 1: 1 - 0.2 = 0.8.
    assert devignetted(flat, PHOTO, "-0.2,0,0")[0, 0] == pytest.approx(125, abs=1)
    with pytest.raises(InputError, match="cos4"):
        devignetted(flat, PHOTO, "1,2")


def test_the_stretch_of_red_is_found() -> None:
    image = wall()
    grey = np.repeat(image[:, :, :1], 3, axis=2)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]].astype(np.float32)
    cx, cy = (SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2
    a = 0.004  # 1.2 px in the corner
    red = cv2.remap(
        grey[:, :, 0].copy(), ((x - cx) / (1 + a) + cx).astype(np.float32),
        ((y - cy) / (1 + a) + cy).astype(np.float32), cv2.INTER_CUBIC,
        borderMode=cv2.BORDER_REPLICATE,
    )  # fmt: skip
    grey[:, :, 0] = red
    shift = chromatic_shift(grey)
    assert sum(shift.red) * shift.radius == pytest.approx(a * shift.radius, abs=0.15)
    assert sum(shift.blue) * shift.radius == pytest.approx(0.0, abs=0.05)


def test_the_second_photo_takes_the_colours_of_the_first() -> None:
    bright = wall()
    dark = np.rint(255 * 0.7 * (bright / 255.0) ** 1.2).astype(np.uint8)
    grid = Grid.from_bounds((-2.4, -1.8, 2.4, 1.8), gsd=0.01)
    first, second = (
        SourcePhoto.prepare(PHOTO, image, number=number, gsd=0.01)
        for number, image in ((1, bright), (2, dark))
    )
    matched, note = match_exposure(first, second, FlatSurface(), grid)
    assert "matched" in note
    error = matched.image.astype(float) - bright
    assert np.median(np.abs(error)) <= 1.5


@pytest.mark.parametrize("gsd", [0.01, 0.02, 0.03])
def test_colours_of_a_photo_made_smaller_stand_where_those_of_the_whole_do(gsd: float) -> None:
    """Grey values are 100 times the column plus the row: a mean of pixels is that at its middle."""
    column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    image = (100 * column + row).astype(np.uint16)
    source = SourcePhoto.prepare(PHOTO, image, number=1, gsd=gsd)
    assert source.factor == round(gsd / 0.01)
    at = np.array([[30.0, 200.5, 400.25]], np.float32), np.array([[40.0, 99.5, 300.0]], np.float32)
    shown = source.sample(*at, "linear")
    np.testing.assert_allclose(shown, 100 * at[0] + at[1], atol=5)
