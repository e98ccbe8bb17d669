"""A last step of flow at twice its resolution."""

from __future__ import annotations

import numpy as np

from bifocal.relief_maps.flow_refinement import REFINEMENT, STRIP, refined

#: Displacement of the pixels of the first photo in the second. [px of the photo]
SHIFT = (3.3, -1.6)


def waves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return a texture that is known between the pixels, too."""
    rng = np.random.default_rng(4)
    grey = np.full(np.broadcast(x, y).shape, 120.0)
    for _ in range(40):
        u, v, phase = rng.uniform((-0.8, -0.8, 0), (0.8, 0.8, 6.28))
        grey += 9 * np.sin(u * x + v * y + phase)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def photos(height: int = 2 * 150 + 1, width: int = 2 * 120 + 1) -> tuple[np.ndarray, np.ndarray]:
    x, y = np.arange(width)[None, :], np.arange(height)[:, None]
    return waves(x, y), waves(x - SHIFT[0], y - SHIFT[1])


def test_what_half_the_resolution_rounded_off_is_found():
    first, second = photos()
    assert first.shape[0] // 2 > 3 * STRIP, "several strips, the last a part of one"
    exact = np.array(SHIFT) / 2
    start = np.broadcast_to(exact + np.array([0.12, -0.08]), (150, 120, 2)).astype(np.float32)
    inner = (slice(4, -4), slice(4, -4))
    before = np.linalg.norm(start - exact, axis=-1)[inner]
    after = np.linalg.norm(refined(start, first, second) - exact, axis=-1)[inner]
    assert np.median(after) < 0.15 * np.median(before)
    assert after.max() < before.min(), "at the seams of the strips, too"


def test_where_there_is_nothing_to_see_flow_stays():
    grey = np.full((96, 96), 77, np.uint8)
    start = np.random.default_rng(1).normal(size=(48, 48, 2)).astype(np.float32)
    assert np.array_equal(refined(start, grey, grey), start)


def test_no_pixel_moves_farther_than_the_photos_are_linear():
    rng = np.random.default_rng(2)
    first, second = (rng.integers(0, 255, (96, 96)).astype(np.uint8) for _ in range(2))
    moved = refined(np.zeros((48, 48, 2), np.float32), first, second)
    assert np.isfinite(moved).all()
    assert np.abs(moved).max() <= REFINEMENT.farthest / 2
