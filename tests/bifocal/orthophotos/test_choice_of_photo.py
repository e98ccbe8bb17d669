"""Which photo shows a place: the far one first, the near one for gaps that their rims vouch for."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bifocal import Grid, OrthoOptions, Pair, Photo, ReliefMap, Source, orthophoto
from bifocal.orthophotos.holes import close_holes

GSD = 0.01
GRID = Grid.from_bounds((-2.0, -2.0, 2.0, 2.0), gsd=GSD)
#: A buttress, and the near camera to its right: it sees what the buttress hides from the far one.
BUTTRESS, OUT = (0.4, 0.7), 0.6


def paint(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 120 + 60 * np.sin(9 * x + 2 * np.sin(5 * y)) * np.cos(8 * y - np.sin(4 * x))


def camera(x: float, distance: float) -> Photo:
    return Photo(
        plane_from_pixel=[[GSD, 0, -2.495], [0, -GSD, 2.495], [0, 0, 1]],
        nadir=(x, 0.0),
        distance=distance,
    )


def photo_of(photo: Photo, thing: tuple[float, float, float, float] | None = None) -> np.ndarray:
    """Photograph the wall and its buttress; a dark thing stands before both if there is one."""
    columns, rows = np.meshgrid(np.arange(500.0), np.arange(500.0))
    q = photo.plane_from_pixels(np.stack([columns, rows], axis=-1))
    front = photo.nadir + (q - photo.nadir) * (1 - OUT / photo.distance)
    image = paint(q[..., 0], q[..., 1])
    (low, high), x = BUTTRESS, front[..., 0]
    image = np.where((x > low) & (x < high), paint(x + 7, front[..., 1]), image)
    # Its flank is seen between its front and its foot.
    flank = np.minimum(x, q[..., 0]) < low, np.maximum(x, q[..., 0]) > high
    side = ((x < low) & (q[..., 0] > low)) | ((x > high) & (q[..., 0] < high))
    image = np.where(side & np.logical_or(*flank), 30, image)
    if thing is not None:
        left, bottom, right, top = thing
        inside = (q[..., 0] > left) & (q[..., 0] < right)
        image[inside & (q[..., 1] > bottom) & (q[..., 1] < top)] = 15
    return np.repeat(np.rint(image).astype(np.uint8)[..., None], 3, axis=2)


PAIR = Pair(image1=camera(-1.5, 9.0), image2=camera(1.9, 5.0))


def relief_with(told: np.ndarray) -> ReliefMap:
    """Return the exact relief, of which a part is told as measured."""
    low, high = BUTTRESS
    step = (GRID.columns_x > low) & (GRID.columns_x < high)
    r = np.broadcast_to(np.where(step, OUT, 0.0), GRID.shape).astype(np.float32)
    quality = np.where(told, 1, 2).astype(np.uint8)
    sigma = np.full(GRID.shape, 0.002, np.float32)
    return ReliefMap(r=r, sigma=sigma, quality=quality, plane_from_pixel=GRID.plane_from_pixel)


@pytest.fixture(scope="module")
def photos() -> tuple[np.ndarray, np.ndarray]:
    return photo_of(PAIR.image1), photo_of(PAIR.image2)


def hidden_strip() -> np.ndarray:
    """Return the middle of what the buttress hides from the far camera."""
    high = BUTTRESS[1]
    end = PAIR.image1.nadir[0] + (high - PAIR.image1.nadir[0]) / (1 - OUT / 9.0)
    strip = np.zeros(GRID.shape, bool)
    strip[40:360, (GRID.columns_x > high + 0.03) & (GRID.columns_x < end - 0.03)] = True
    assert strip.sum() > 320 * 5
    return strip


def test_a_gap_with_a_measured_rim_on_which_both_agree_is_of_the_near_photo(photos):
    picture = orthophoto(PAIR, photos, relief_with(np.ones(GRID.shape, bool)))
    strip = hidden_strip()
    assert (picture.source[strip] == Source.IMAGE_2).mean() > 0.95
    wanted = paint(*np.meshgrid(GRID.columns_x, GRID.rows_y))
    assert np.median(np.abs(picture.image[strip][:, 0] - wanted[strip])) < 4


@pytest.mark.parametrize("case", ["not measured", "not alike"])
def test_a_gap_that_its_rim_does_not_vouch_for_stays_white(photos, case):
    strip, told, (far, near) = hidden_strip(), np.ones(GRID.shape, bool), photos
    if case == "not measured":
        told[:, GRID.columns_x > BUTTRESS[0]] = False
    else:
        near = 255 - near
    picture = orthophoto(PAIR, (far, near), relief_with(told))
    assert (picture.source[strip] == Source.NEITHER).mean() > 0.95
    assert (picture.image[strip & (picture.source == Source.NEITHER)] == 255).all()
    assert not picture.valid[picture.source == Source.NEITHER].any()


def test_the_far_photo_goes_first_however_fine_the_near_one_is(photos):
    # Of the near photo every second pixel would do: its pixels are made three times finer.
    size = (1500, 1500)
    near = cv2.resize(photos[1], size, interpolation=cv2.INTER_CUBIC)
    fine = np.array(PAIR.image2.plane_from_pixel) @ [
        [1 / 3, 0, -1 / 3],
        [0, 1 / 3, -1 / 3],
        [0, 0, 1],
    ]
    second = Photo(plane_from_pixel=fine, nadir=PAIR.image2.nadir, distance=5.0)
    told = np.ones(GRID.shape, bool)
    both = Pair(image1=PAIR.image1, image2=second)
    picture = orthophoto(both, (photos[0], near), relief_with(told))
    assert (picture.source == Source.IMAGE_1).mean() > 0.9


def test_what_stood_before_the_wall_in_photo_1_only_is_drawn_from_photo_2(photos):
    thing = (-1.5, -1.2, -0.9, -0.3)
    told = np.ones(GRID.shape, bool)
    x, y = np.meshgrid(GRID.columns_x, GRID.rows_y)
    place = (x > thing[0]) & (x < thing[2]) & (y > thing[1]) & (y < thing[3])
    told[cv2.dilate(place.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0] = False
    relief, wanted = relief_with(told), paint(x, y)
    picture = orthophoto(PAIR, (photo_of(PAIR.image1, thing), photos[1]), relief)
    assert np.abs(picture.image[place][:, 0] - wanted[place]).mean() < 6
    # Of photo 2 alone it is no matter: photo 1 is drawn, as ever.
    other = orthophoto(PAIR, (photos[0], photo_of(PAIR.image2, thing)), relief)
    assert np.abs(other.image[place][:, 0] - wanted[place]).mean() < 3


def test_a_small_hole_takes_texture_from_beside_it_not_fog():
    rng = np.random.default_rng(5)
    photo = np.tile(rng.integers(60, 200, (40, 40), dtype=np.uint8), (13, 13))[:500, :500]
    photo = np.repeat(photo[..., None], 3, axis=2)
    alone = Pair(image1=camera(-1.5, 9.0), image2=camera(-1.5, 5.0))
    r = np.zeros(GRID.shape, np.float32)
    r[180:200, 250:262] = OUT  # a bracket 20 cm high: its shadow is 0.03 m2
    relief = ReliefMap.from_relief(r, plane_from_pixel=GRID.plane_from_pixel)
    picture = orthophoto(alone, photo, relief, options=OrthoOptions())
    filled = picture.source == Source.FILLED
    assert 100 < filled.sum() < 0.05 / GSD**2
    assert picture.image[filled].std() > 0.7 * photo.std()


@pytest.mark.parametrize("bands", [1, 3])
def test_specks_take_the_mean_colour_of_the_wall_beside_them(bands):
    shape = (60, 60, 3) if bands == 3 else (60, 60)
    image = np.full(shape, 1000, np.uint16)
    image[:, 32:] = 3000  # a pilaster, which stands before the wall
    relief = np.where(np.arange(60) >= 32, 0.3, 0.0) * np.ones((60, 1))
    holes = np.zeros((60, 60), bool)
    holes[20:25, 27:32] = True
    holes[40:42, 10:14] = True
    image[holes] = 0
    source = np.where(holes, Source.NONE, Source.IMAGE_1).astype(np.uint8)
    close_holes(image, source, holes, relief.astype(np.float32), GSD, largest=0.05)
    assert (source[holes] == Source.FILLED).all()
    assert (image[holes] == 1000).all()
    assert (source[~holes] == Source.IMAGE_1).all()


@pytest.mark.parametrize("bands", [(), (3,)])
def test_a_speck_of_which_nothing_is_behind_takes_what_is_there(bands):
    image, source = np.full((30, 30, *bands), 90, np.uint8), np.full((30, 30), Source.IMAGE_1)
    relief, hole = np.ones((30, 30), np.float32), np.s_[12:14, 12:14]
    image[hole], source[hole], relief[hole] = 0, Source.NONE, 0
    close_holes(image, source, source == Source.NONE, relief, GSD, largest=0.05)
    assert (source[hole] == Source.FILLED).all()
    assert (image == 90).all()


@pytest.mark.parametrize("before", [0.0, 0.3])
def test_a_sliver_within_what_no_photo_sees_is_white_but_a_bar_before_it_is_drawn(before):
    image, relief = np.full((60, 60), 90, np.uint8), np.zeros((60, 60), np.float32)
    holes = np.zeros((60, 60), bool)
    holes[10:50, 10:50] = True
    sliver = np.s_[10:50, 28:31]
    holes[sliver], relief[sliver] = False, before
    source = np.where(holes, Source.NONE, Source.IMAGE_1).astype(np.uint8)
    close_holes(image, source, holes, relief, GSD, largest=0.05)
    assert (source[20:40, 12:26] == Source.NEITHER).all()
    shown = Source.IMAGE_1 if before else Source.NEITHER
    assert (source[15:45, 28:31] == shown).all()
    assert (image[15:45, 28:31] == (90 if before else 255)).all()


def test_what_no_photo_sees_has_a_smooth_outline():
    image, relief = np.full((80, 140), 90, np.uint8), np.zeros((80, 140), np.float32)
    holes = np.zeros((80, 140), bool)
    # Teeth of 4 px every 14 px along the upper side.
    for column in range(10, 130):
        holes[24 - 4 * (column // 7 % 2) : 60, column] = True
    source = np.where(holes, Source.NONE, Source.IMAGE_1).astype(np.uint8)
    close_holes(image, source, holes, relief, GSD, largest=0.05)
    white = source == Source.NEITHER
    top = white[:, 24:116].argmax(axis=0)
    assert np.ptp(top) <= 2
    assert (white.sum() / holes.sum()) > 0.9
    assert (source[holes & ~white] == Source.FILLED).all()
