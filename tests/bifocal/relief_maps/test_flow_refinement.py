"""Flow between the photos, in bands where they are large; its last step at twice the resolution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal.relief_maps import flow
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


def test_bands_of_a_large_photo_show_no_seam(monkeypatch: pytest.MonkeyPatch):
    """Seven bands, the photo moved down by more than a band is high."""
    height, width, down = 700, 160, 120
    x, y = np.arange(width)[None, :], np.arange(height)[:, None]
    first, second = waves(x, y), waves(x - 1.3, y - down - 0.6)
    seed = np.tile(np.array([0.0, down], np.float32), (height, width, 1))
    monkeypatch.setattr(flow, "FLOW", replace(flow.FLOW, most=height * width // 7))
    moved = flow.seeded_flow(first, second, seed, finest=0)
    assert moved.shape == seed.shape
    # As the pyramid of the whole photo and its patches lie: elsewhere thin things suffer.
    assert all(low % 48 == 0 for low, *_ in flow._bands(seed))
    away = np.linalg.norm(moved - (1.3, down + 0.6), axis=-1)[30 : height - down - 30, 30:-30]
    assert away.max() < 0.2
