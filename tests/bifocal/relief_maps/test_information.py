"""What both photos tell of relief, on flat walls made by hand: plain, textured, of one photo."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bifocal import Grid, Pair, Photo, Quality
from bifocal.relief_maps import flow
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, parallax_per_metre
from bifocal.relief_maps.information import sigma_of_noise, with_sigma_of_noise

SIDE, RELIEF = 320, 0.3
METRES = [[0.01, 0, -1.595], [0, -0.01, 1.595], [0, 0, 1]]
PAIR = Pair(
    image1=Photo(plane_from_pixel=METRES, nadir=(-1.0, 0.0), distance=17.5),
    image2=Photo(plane_from_pixel=METRES, nadir=(-1.0, 0.0), distance=9.5),
)
INNER = np.s_[40:280, 130:280]


def texture(seed: int, contrast: float) -> np.ndarray:
    grey = np.random.default_rng(seed).normal(0, 1, (SIDE, SIDE))
    grey = cv2.GaussianBlur(grey, (0, 0), 1.2)
    return 120 + contrast * grey / grey.std()


def delivered(image: np.ndarray, rng: np.random.Generator, jpeg: int) -> np.ndarray:
    """Return a photo with the camera's noise, as JPEG."""
    noisy = np.clip(np.rint(image + rng.normal(0, 2.0, image.shape)), 0, 255).astype(np.uint8)
    return cv2.imdecode(cv2.imencode(".jpg", noisy, [cv2.IMWRITE_JPEG_QUALITY, jpeg])[1], 0)


def frame_of(first: np.ndarray, second: np.ndarray, jpeg: int = 85) -> Frame:
    """Return photos of a flat wall at `RELIEF`: photo 2 is enlarged about the nadir, Eq. (6)."""
    rng = np.random.default_rng(13)
    k = (9.5 / (9.5 - RELIEF)) / (17.5 / (17.5 - RELIEF))
    matrix = np.array([[k, 0, 59.5 * (1 - k)], [0, k, 159.5 * (1 - k)]])
    near = cv2.warpAffine(second, matrix, (SIDE, SIDE), flags=cv2.INTER_CUBIC, borderValue=120)
    grid = Grid(x0=-1.595, y0=1.595, gsd=0.01, width=SIDE, height=SIDE)
    seen = np.ones(grid.shape, bool)
    return Frame(
        grid=grid, image1=delivered(first, rng, jpeg), image2=delivered(near, rng, jpeg),
        seen1=seen, seen2=seen, pair=PAIR,
    )  # fmt: skip


def map_of(frame: Frame, relief: np.ndarray, sigma: np.ndarray) -> MapBands:
    """Return the map of a relief of photo 1 of which every pixel was measured."""
    every = np.ones(relief.shape, bool)
    measured = np.full(relief.shape, Quality.MEASURED, np.uint8)
    bands = MapBands(np.full(relief.shape, RELIEF, np.float32), sigma, measured)
    return with_sigma_of_noise(frame, MapBands(relief, sigma, measured), every, bands, frame.grid)


@pytest.mark.parametrize("jpeg", [75, 85, 95])
def test_nothing_is_known_of_a_plain_wall_however_strongly_it_is_compressed(jpeg):
    plain = np.full((SIDE, SIDE), 120.0)
    frame = frame_of(plain, plain, jpeg)
    relief = np.full((SIDE, SIDE), RELIEF, np.float32)
    sigma = map_of(frame, relief, np.zeros_like(relief)).sigma[INNER]
    assert np.median(sigma * parallax_per_metre(frame)[INNER]) > 1
    assert (sigma > 0.01 * PAIR.image2.distance).mean() > 0.75


@pytest.mark.parametrize("contrast", [4.0, 25.0])
def test_sigma_holds_the_errors_of_a_textured_wall_and_is_not_far_above_them(contrast):
    wall = texture(8, contrast)
    frame = frame_of(wall, wall)
    found = flow.measure(frame, np.full((20, 20), 0.28, np.float32))
    sigma = map_of(frame, found.r, flow.sigma_of_relief(frame, found.r, found.sigma_px)).sigma
    ratio = (np.abs(found.r - RELIEF) / sigma)[INNER]
    assert np.percentile(ratio, 99) < 4
    assert np.median(ratio) > 0.1


def test_texture_of_one_photo_alone_is_no_information():
    wall, other = texture(8, 25.0), texture(9, 25.0)
    relief, every = np.full((SIDE, SIDE), RELIEF, np.float32), np.ones((SIDE, SIDE), bool)
    both = sigma_of_noise(frame_of(wall, wall), relief, every)[INNER]
    one = sigma_of_noise(frame_of(wall, other), relief, every)[INNER]
    assert np.median(both) < 0.1
    assert np.median(one) > 10 * np.median(both)
