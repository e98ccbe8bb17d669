"""What both photos tell of relief, on flat walls made by hand: plain, textured, of one photo."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from bifocal import Grid, Pair, Photo, Quality
from bifocal.relief_maps import flow
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import Frame, parallax_per_metre
from bifocal.relief_maps.information import information, measured_by_texture

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


def called_measured(frame: Frame) -> tuple[MapBands, np.ndarray]:
    """Return a map whose relief flow found and called measured, and its error in parallax. [px]"""
    found = flow.measure(frame, np.full((20, 20), 0.28, np.float32))
    sigma = flow.sigma_of_relief(frame, found.r, found.sigma_px)
    every = np.ones(found.r.shape, bool)
    all_measured = np.full(found.r.shape, Quality.MEASURED, np.uint8)
    source = MapBands(found.r, sigma, all_measured)
    flat = np.full(found.r.shape, RELIEF, np.float32)
    bands = MapBands(flat, sigma, all_measured)
    return measured_by_texture(frame, source, every, bands, frame.grid), found.r - RELIEF


@pytest.mark.parametrize("jpeg", [75, 85, 95])
def test_a_plain_wall_is_not_measured_however_strongly_it_is_compressed(jpeg):
    plain = np.full((SIDE, SIDE), 120.0)
    bands, _ = called_measured(frame_of(plain, plain, jpeg))
    assert (bands.quality[INNER] == Quality.MEASURED).mean() < 0.02


def test_a_textured_wall_is_measured_and_its_sigma_holds_its_errors():
    wall = texture(8, 25.0)
    frame = frame_of(wall, wall)
    bands, error = called_measured(frame)
    good = bands.quality[INNER] == Quality.MEASURED
    assert good.mean() > 0.95
    ratio = np.abs(error / bands.sigma)[INNER][good]
    assert np.percentile(ratio, 99) < 4
    assert np.median(np.abs(error * parallax_per_metre(frame))[INNER]) < 0.1


def test_relief_that_fits_better_a_pixel_farther_on_is_not_measured():
    wall = texture(3, 12.0)
    frame = frame_of(wall, wall)
    every = np.ones((SIDE, SIDE), bool)
    beside = (RELIEF + 0.8 / parallax_per_metre(frame)).astype(np.float32)
    right = np.full((SIDE, SIDE), RELIEF, np.float32)
    assert information(frame, right, every).distinct[INNER].mean() > 0.95
    assert information(frame, beside, every).distinct[INNER].mean() < 0.1
