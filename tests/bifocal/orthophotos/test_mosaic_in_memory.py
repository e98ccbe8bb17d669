"""Mosaics of orthophotos and relief maps in memory."""

from __future__ import annotations

import numpy as np
import pytest

import bifocal
from bifocal import Grid, InputError


def ortho(bounds, *, factor: float = 1.0, hole: bool = False) -> bifocal.Orthophoto:
    """One wall, brighter to the right, whatever part of it is asked for."""
    grid = Grid.from_bounds(bounds, gsd=0.02)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    grey = factor * (100 + 20 * x + 10 * np.sin(9 * y))
    source = np.ones(grid.shape, np.uint8)
    if hole:
        source[: grid.height // 2] = 0
    image = np.where(source[:, :, None] > 0, np.stack([grey] * 3, axis=-1), 0)
    return bifocal.Orthophoto(
        image=np.rint(image).astype(np.uint8),
        source=source,
        hidden=source == 0,
        plane_from_pixel=grid.plane_from_pixel,
    )


def test_parts_of_one_picture_become_the_picture_again() -> None:
    left, right = ortho((0, 0, 2, 1)), ortho((1, 0, 3, 1))
    whole = bifocal.mosaic([left, right], options=bifocal.MosaicOptions(gain=False))
    expected = ortho((0, 0, 3, 1))
    assert whole.grid.bounds == pytest.approx((0, 0, 3, 1))
    assert np.abs(whole.image.astype(int) - expected.image).max() <= 1
    assert set(np.unique(whole.source)) == {1, 2}
    assert whole.source[0, 0] == 1
    assert whole.source[0, -1] == 2


@pytest.mark.parametrize("upright", [False, True])
def test_each_part_owns_what_lies_deep_within_it(upright: bool) -> None:
    boxes = [(0, 0, 1, 2), (0, 1, 1, 3)] if upright else [(0, 0, 2, 1), (1, 0, 3, 1)]
    whole = bifocal.mosaic([ortho(box) for box in boxes])
    # Along the middle of the strip, 1 m to 2 m is common: a tenth off either rim is the other's.
    along = whole.source[::-1, 25] if upright else whole.source[25]
    place = 0.02 * (np.arange(150) + 0.5)
    assert (along[place < 1.1] == 1).all()
    assert (along[place > 1.9] == 2).all()


def test_exposures_are_made_equal() -> None:
    whole = bifocal.mosaic([ortho((0, 0, 2, 1)), ortho((1, 0, 3, 1), factor=0.8)])
    ratio = whole.image[:, :, 0] / ortho((0, 0, 3, 1)).image[:, :, 0]
    # The first keeps its own; all values were rounded.
    np.testing.assert_allclose(ratio, 1.0, atol=1.5 / 100)
    assert whole.gains[1, 0] / whole.gains[0, 0] == pytest.approx(1 / 0.8, rel=0.01)


def test_what_one_does_not_show_the_other_fills_and_the_rest_stays_empty() -> None:
    holed, part = ortho((0, 0, 2, 1), hole=True), ortho((0, 0.5, 1, 1))
    whole = bifocal.mosaic([holed, part], options=bifocal.MosaicOptions(gain=False, blend=False))
    assert (whole.source[:25, :50] == 2).all()
    assert (whole.source[:25, 50:] == 0).all()
    assert (whole.image[:25, 50:] == 0).all()
    assert (whole.source[25:] == 1).all()


def test_relief_maps_are_joined_and_never_mixed() -> None:
    maps = [
        bifocal.ReliefMap.from_relief(np.full((10, 20), r), plane_from_pixel=grid.plane_from_pixel)
        for r, grid in (
            (0.1, Grid.from_bounds((0, 0, 2, 1), gsd=0.1)),
            (0.3, Grid.from_bounds((1, 0, 3, 1), gsd=0.1)),
        )
    ]
    whole = bifocal.mosaic(maps, options=bifocal.MosaicOptions(priority=True))
    assert whole.image.shape == (10, 30)
    np.testing.assert_array_equal(np.unique(whole.image), np.float32([0.1, 0.3]))
    assert (whole.source[:, :20] == 1).all()


def test_unlike_or_single_rasters_are_refused() -> None:
    flat = bifocal.ReliefMap.from_relief(
        np.zeros((10, 20)),
        plane_from_pixel=Grid.from_bounds((0, 0, 2, 1), gsd=0.1).plane_from_pixel,
    )
    for rasters in ([], [flat], [flat, ortho((0, 0, 2, 1))]):
        with pytest.raises(InputError, match="two rasters or more, all of one kind"):
            bifocal.mosaic(rasters)
    with pytest.raises(InputError, match="none of the rasters"):
        bifocal.mosaic([flat, flat], bounds=(10, 10, 11, 11))


def test_white_tells_nothing_of_the_exposure() -> None:
    white = [ortho(box, factor=9.0) for box in ((0, 0, 2, 1), (1, 0, 3, 1))]
    for part in white:
        part.image[:] = 255
    whole = bifocal.mosaic(white)
    np.testing.assert_allclose(whole.gains, 1.0)
    assert (whole.image == 255).all()


@pytest.mark.parametrize("clipped", [0, 1])
@pytest.mark.parametrize("value", [2, 254])
def test_the_exposure_is_told_by_what_is_neither_white_nor_black(clipped: int, value: int) -> None:
    parts = [ortho((0, 0, 2, 1)), ortho((1, 0, 3, 1), factor=0.5)]
    parts[clipped].image[:35] = value  # 0.7 of the common part
    gains = bifocal.mosaic(parts).gains
    assert gains[1, 0] / gains[0, 0] == pytest.approx(2.0, rel=0.01)
