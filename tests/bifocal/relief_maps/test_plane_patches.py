"""Plain walls on plane patches: segments between edges, and planes by all that a segment shows."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from bifocal import Grid, Pair, Photo
from bifocal.relief_maps import coarse_level, plane_patches
from bifocal.relief_maps.frame import Frame
from bifocal.relief_maps.segments import SEGMENTS, Segments

SIDE, PANEL = 320, 0.3
#: Rows and columns of a panel before the wall, in photo 1.
ROWS, COLUMNS = slice(60, 150), slice(190, 290)


def _zoomed(image: np.ndarray, k: float) -> np.ndarray:
    middle = (SIDE - 1) / 2
    zoom = np.array([[k, 0, middle * (1 - k)], [0, k, middle * (1 - k)]])
    return cv2.warpAffine(image, zoom, (SIDE, SIDE), flags=cv2.INTER_CUBIC)


@cache
def _plaster() -> tuple[Frame, np.ndarray]:
    """Return a panel before a wall, shades of one grey level in noise of 1.5, and its truth."""
    rng = np.random.default_rng(5)
    shades = cv2.GaussianBlur(rng.normal(0, 1, (2, SIDE, SIDE)).transpose(1, 2, 0), (0, 0), 2.0)
    shades /= shades.std()
    on = np.zeros((SIDE, SIDE))
    on[ROWS, COLUMNS] = 1.0
    wall, panel = 140 + shades[..., 0], 175 + shades[..., 1]
    # A panel at 0.3 m: photo 2 shows it enlarged by (9.5 / 9.2) / (17.5 / 17.2), over the wall.
    k = (9.5 / 9.2) / (17.5 / 17.2)
    cover = np.clip(_zoomed(on, k), 0, 1)
    photos = [on * panel + (1 - on) * wall, cover * _zoomed(panel, k) + (1 - cover) * wall]
    noisy = [
        np.clip(np.rint(photo + rng.normal(0, 1.5, photo.shape)), 0, 255).astype(np.uint8)
        for photo in photos
    ]
    step = 2.0 / SIDE
    metres = [[step, 0, -1 + step / 2], [0, -step, 1 - step / 2], [0, 0, 1]]
    far, near = (Photo(plane_from_pixel=metres, nadir=(0, 0), distance=d) for d in (17.5, 9.5))
    grid, seen = Grid.from_bounds((-1.0, -1.0, 1.0, 1.0), gsd=step), np.ones((SIDE, SIDE), bool)
    frame = Frame(
        grid=grid, image1=noisy[0], image2=noisy[1], seen1=seen, seen2=seen,
        pair=Pair(image1=far, image2=near),
    )  # fmt: skip
    return frame, (PANEL * on).astype(np.float32)


def test_segments_end_at_the_edges_of_the_photo():
    frame, truth = _plaster()
    segments = Segments.of(frame.image1)
    assert segments.number == (SIDE // SEGMENTS.spacing) ** 2
    share = np.bincount(segments.label.ravel(), (truth > 0).ravel()) / np.bincount(
        segments.label.ravel()
    )
    wrong = np.where(share > 0.5, 1 - share, share)[segments.label].mean()
    assert wrong < 0.003
    borders = segments.borders
    parted = (share[borders.own] > 0.5) != (share[borders.other] > 0.5)
    assert np.median(borders.contrast[parted]) > 15
    assert np.percentile(borders.contrast[~parted], 95) < 4
    # Both sides of a border own it, and it lies between their middles.
    pairs = set(zip(borders.own.tolist(), borders.other.tolist(), strict=True))
    assert all((other, own) in pairs for own, other in pairs)
    np.testing.assert_array_equal(
        borders.own, np.repeat(np.arange(segments.number), np.diff(borders.first))
    )
    apart = np.hypot(
        borders.row - segments.row[borders.own], borders.column - segments.column[borders.own]
    )
    assert apart.max() < 3 * SEGMENTS.spacing


def test_a_panel_on_plain_plaster_ends_at_its_edge_whatever_flow_made_of_it():
    frame, truth = _plaster()
    # Flow has run over the steps as a ramp, and wobbles.
    rng = np.random.default_rng(6)
    wobble = cv2.GaussianBlur(rng.normal(0, 1, truth.shape), (0, 0), 8)
    relief = cv2.blur(truth, (25, 25)) + 0.04 * (wobble / wobble.std()).astype(np.float32)
    found = plane_patches.fitted(coarse_level.halved(frame), frame.image1, relief)
    off = np.abs(found - truth)
    parallax = np.hypot(*np.meshgrid(*[np.arange(SIDE) - (SIDE - 1) / 2] * 2)) > 60
    before, after = ((np.abs(r - truth) > 0.1)[parallax].mean() for r in (relief, found))
    assert before > 0.04
    assert after < 0.3 * before
    assert np.median(off[parallax]) < 0.75 * np.median(np.abs(relief - truth)[parallax])
    assert np.abs(np.median(found[ROWS, COLUMNS]) - PANEL) < 0.03


def test_a_photo_of_few_segments_is_left_as_it_was_measured():
    frame, truth = _plaster()
    small = frame.image1[: 3 * SEGMENTS.spacing]
    relief = truth[: 3 * SEGMENTS.spacing]
    assert plane_patches.fitted(coarse_level.halved(frame), small, relief) is relief
