"""Targets drawn at known places are found there."""

import cv2
import numpy as np
import pytest

from bifocal.matching.features import Features, match_along_lines, spread_evenly
from bifocal.matching.targets import find_targets
from bifocal.orientation.area_points import _trusted


def board(*, noise: float = 1.5, dark: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Return a photo of 36 discs of 11 px, drawn 16 times finer than its pixels, and centres."""
    rng = np.random.default_rng(0)
    fine, side, count = 16, 50, 6
    image = np.zeros((side * count, side * count))
    centres = []
    y, x = np.mgrid[0 : side * fine, 0 : side * fine]
    x, y = (x + 0.5) / fine - 0.5, (y + 0.5) / fine - 0.5
    for row in range(count):
        for column in range(count):
            cx, cy = 25 + rng.uniform(-0.5, 0.5, 2)
            disc = ((x - cx) ** 2 + (y - cy) ** 2 < 5.5**2).reshape(side, fine, side, fine)
            part = slice(row * side, (row + 1) * side), slice(column * side, (column + 1) * side)
            image[part] = 210 - 170 * disc.mean(axis=(1, 3))
            centres.append([column * side + cx, row * side + cy])
    image = cv2.GaussianBlur(image, (0, 0), 0.6) + rng.normal(0, noise, image.shape)
    image = np.clip(np.round(image), 0, 255).astype(np.uint8)
    return image if dark else 255 - image, np.array(centres)


def nearest(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.linalg.norm(found[:, None] - truth[None], axis=2).min(axis=0)


def test_discs_are_found_to_a_hundredth_of_a_pixel() -> None:
    for dark in (True, False):
        image, truth = board(dark=dark)
        found = find_targets(image)
        discs = found.pixels[np.array(found.kinds) == "disc"]
        error = nearest(discs, truth)
        assert (error < 0.05).mean() > 0.9
        assert np.sqrt((error[error < 0.05] ** 2).mean()) < 0.012


def test_a_chequer_is_found_at_its_crossing() -> None:
    fine = 8
    y, x = np.mgrid[0 : 80 * fine, 0 : 80 * fine]
    x, y = (x + 0.5) / fine - 0.5 - 40.3, (y + 0.5) / fine - 0.5 - 39.6
    inside = (np.abs(x) < 12) & (np.abs(y) < 12)
    pattern = np.where(inside & (x * y > 0), 30, 220).reshape(80, fine, 80, fine).mean(axis=(1, 3))
    found = find_targets(np.round(pattern).astype(np.uint8))
    crossing = found.pixels[np.array(found.kinds) == "chequer"]
    assert nearest(crossing, np.array([[40.3, 39.6]])).max() < 0.15


def test_a_coded_marker_is_named_and_centred() -> None:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_250)
    image = np.full((200, 200), 230, np.uint8)
    image[60:132, 70:142] = cv2.aruco.generateImageMarker(dictionary, 17, 72)
    found = find_targets(image)
    row = found.codes.index("4X4-17")
    np.testing.assert_allclose(found.pixels[row], [105.5, 95.5], atol=0.3)


def test_an_empty_wall_has_no_targets() -> None:
    assert not len(find_targets(np.full((100, 120), 128, np.uint8)).pixels)


def test_points_are_spread_evenly_best_first() -> None:
    rng = np.random.default_rng(1)
    # Nine tenths crowd in one corner.
    pixels = np.concatenate([rng.uniform(0, 100, (900, 2)), rng.uniform(0, 1000, (100, 2))])
    sigma = rng.uniform(0.01, 0.3, 1000)
    chosen = spread_evenly(pixels, sigma, (1000, 1000), 120)
    assert len(chosen) == 120
    crowd = (pixels[chosen] < 100).all(axis=1).mean()
    assert crowd < 0.5
    assert sigma[chosen][(pixels[chosen] < 100).all(axis=1)].mean() < 0.1


def test_a_feature_has_a_partner_on_its_line_that_is_alike_and_has_no_rival():
    """Of three features on lines of their own: unlike, with a rival, and hardly without."""
    alike = np.array([(0.6, 0.0), (0.95, 0.94), (0.95, 0.935)])
    angle = np.radians([10.0, 40.0, 70.0])
    away = np.column_stack([np.cos(angle), np.sin(angle)])
    first, second = np.eye(128)[:3], np.zeros((6, 128))
    for k, both in enumerate(alike):
        for j, value in enumerate(both):
            second[2 * k + j, k], second[2 * k + j, 10 + 2 * k + j] = value, np.sqrt(1 - value**2)
    places = (away[:, None] * np.array([[150.0], [250.0]])).reshape(6, 2)

    def features(pixels, descriptors):
        return Features(
            pixels=pixels, size=np.ones(len(pixels)), direction=np.zeros(len(pixels)),
            descriptors=descriptors.astype(np.float32), reduction=1.0,
        )  # fmt: skip

    rows = match_along_lines(
        features(100 * away, first), features(places, second), np.zeros(2),
        (100 * away, 300 * away), across=3.0,
    )  # fmt: skip
    assert [part.tolist() for part in rows] == [[2], [4]]


@pytest.mark.parametrize("turned", [1, -1])
def test_flow_is_trusted_along_the_radius_only(turned):
    x, y = np.arange(-50, 50) / 10, np.arange(50, -50, -1) / 10
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    centre = np.array([0.3, -0.2])
    right, up = np.moveaxis(grid - centre, -1, 0)
    grey = np.full(grid.shape[:2], 90, np.uint8)
    # Rows run down: a flow away from the centre has the sign of up turned.
    along = turned * np.stack([right, -up], axis=-1)
    across = turned * np.stack([up, right], axis=-1)
    far = np.hypot(right, up) > 2.0
    assert _trusted(grey, grey, along, grid, centre)[far].all()
    assert not _trusted(grey, grey, across, grid, centre).any()
    assert not _trusted(grey, grey, along, grid, centre)[np.hypot(right, up) < 1.5].any()


def test_the_bow_ties_of_a_real_church_are_found(data_dir) -> None:
    """Seen at 20 px across, their edges drawn over two pixels, as lenses do."""
    photo = cv2.imread(str(data_dir / "facade_pairs/church_2/far.jpg"), cv2.IMREAD_GRAYSCALE)
    found = find_targets(photo).pixels
    for place in ((18, 1582), (790, 1314), (1218, 1475), (2023, 1364), (2396, 1732)):
        assert np.hypot(*(found - place).T).min() < 2.0
    assert len(found) <= 7
