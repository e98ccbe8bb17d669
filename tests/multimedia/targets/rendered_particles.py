"""Images of particles with known places: Gaussians integrated over pixels, noise, uneven light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr


@dataclass(frozen=True, kw_only=True)
class Frame:
    image: np.ndarray
    places: np.ndarray
    diameters: np.ndarray


def rendered(
    seed: int, count: int = 300, shape: tuple[int, int] = (256, 320), *,
    diameters: tuple[float, float] = (2.0, 6.0), heights: tuple[float, float] = (40.0, 140.0),
    noise: float = 2.0, gain: float = 0.05, uneven: float = 30.0, apart: float = 0.0,
) -> Frame:  # fmt: skip
    """Return an 8-bit image; diameters to 1 / e^2, heights in their middles, noise as cameras have.

    No two are nearer than `apart`. [px]
    """
    rng = np.random.default_rng(seed)
    height, width = shape
    places: list[np.ndarray] = []
    while len(places) < count:
        place = rng.uniform((2, 2), (width - 3, height - 3))
        if not places or np.hypot(*(np.array(places) - place).T).min() >= apart:
            places.append(place)
    at = np.array(places).reshape(-1, 2)
    size = rng.uniform(*diameters, count)
    tall = rng.uniform(*heights, count)
    return Frame(
        image=_image(rng, shape, at, size, tall, noise, gain, uneven), places=at, diameters=size
    )


def drawn(places: np.ndarray, shape: tuple[int, int], *, seed: int) -> np.ndarray:
    """Return an 8-bit image of particles of 3 px and grey value 120 at places (n, 2)."""
    ones = np.ones(len(places))
    rng = np.random.default_rng(seed)
    return _image(rng, shape, places, 3 * ones, 120 * ones, 2.0, 0.05, 30.0)


def _image(
    rng: np.random.Generator, shape: tuple[int, int], at: np.ndarray, size: np.ndarray,
    tall: np.ndarray, noise: float, gain: float, uneven: float,
) -> np.ndarray:  # fmt: skip
    height, width = shape
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    image = 30 + uneven * np.sin(x / 70.0 + 0.3) * np.cos(y / 90.0) + uneven
    for (column, row), four_sigma, peak in zip(at, size, tall, strict=True):
        s = four_sigma / 4
        c, r = int(column), int(row)
        window = slice(max(r - 10, 0), r + 11), slice(max(c - 10, 0), c + 11)
        u, v = x[window] - column, y[window] - row
        across = ndtr((u + 0.5) / s) - ndtr((u - 0.5) / s)
        down = ndtr((v + 0.5) / s) - ndtr((v - 0.5) / s)
        image[window] += peak * across * down / (2 * ndtr(0.5 / s) - 1) ** 2
    noisy = image + np.sqrt(noise**2 + gain * image) * rng.standard_normal(image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
