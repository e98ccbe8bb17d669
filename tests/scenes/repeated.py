"""A front whose windows are all alike, exact by homographies: a wall with holes, panes behind."""

from __future__ import annotations

import cv2
import numpy as np

#: Texels a metre; half the wall's size. [m]
TEXELS, HALF = 150, np.array([8.0, 4.5])
D1, D2 = 17.5, 9.5


def front(
    rng: np.random.Generator,
    *,
    plaster: float,
    pitch: float,
    jitter: float = 0.0,
    door: bool = False,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return wall, panes behind it and where the wall has holes.

    Parameters
    ----------
    plaster : float
        Grain of the plaster. [grey levels]
    pitch : float
        From window to window. [m]
    jitter : float
        How far windows stray from that. [m]
    door : bool
        Whether a door stands where a window of the ground floor would.
    """
    width, height = (2 * HALF * TEXELS).astype(int)
    wall = np.full((height, width), 178.0, np.float32)
    for step, share in ((2, 0.5), (5, 0.6), (20, 0.6)):
        grain = rng.normal(size=(height // step + 2, width // step + 2)).astype(np.float32)
        wall += plaster * share * cv2.resize(grain, (width, height), interpolation=cv2.INTER_CUBIC)
    panes, holes = np.full_like(wall, 225.0), np.zeros_like(wall)

    def fill(sheet: np.ndarray, x: tuple[float, float], y: tuple[float, float], value: float):
        columns = np.clip(np.round((np.array(x) + HALF[0]) * TEXELS), 0, width).astype(int)
        rows = np.clip(np.round((HALF[1] - np.array(y)[::-1]) * TEXELS), 0, height).astype(int)
        sheet[slice(*rows), slice(*columns)] = value

    for x in np.arange(-9, 10) * pitch + jitter * rng.uniform(-1, 1, 19):
        for y in (-3.4, -1.0, 1.4):
            fill(holes, (x - 0.35, x + 0.35), (y, y + 1.5), 1.0)
            fill(wall, (x - 0.40, x + 0.40), (y - 0.08, y), 150.0)
            for sash in ((x - 0.28, x - 0.03), (x + 0.03, x + 0.28)):
                for pane in ((y + 0.07, y + 0.9), (y + 0.97, y + 1.43)):
                    fill(panes, sash, pane, 45.0)
    if door:
        fill(holes, (1.0, 2.4), (-4.4, -1.5), 1.0)
        fill(panes, (1.0, 2.4), (-4.4, -1.5), 90.0)
    return wall, panes, holes


def photo(
    sheets: tuple[np.ndarray, ...], rng: np.random.Generator, *, distance: float, x: float,
    size: tuple[int, int], pixel: float, depth: float = 0.2, noise: float = 1.5,
) -> np.ndarray:  # fmt: skip
    """Return the front as a square camera sees it from (x, 0); pixels count metres of the wall."""

    def seen(sheet: np.ndarray, z: float) -> np.ndarray:
        scale, (u, v) = distance / pixel / (distance - z), (np.array(size) - 1) / 2
        metres = np.array([[1 / TEXELS, 0, 0.5 / TEXELS - HALF[0]],
                           [0, -1 / TEXELS, HALF[1] - 0.5 / TEXELS], [0, 0, 1]])  # fmt: skip
        pixels = np.array([[scale, 0, u - scale * x], [0, -scale, v], [0, 0, 1]])
        flags, border = cv2.INTER_AREA, cv2.BORDER_REPLICATE
        return cv2.warpPerspective(sheet, pixels @ metres, size, flags=flags, borderMode=border)

    wall, panes, holes = sheets
    through = seen(holes, 0.0)
    picture = seen(wall, 0.0) * (1 - through) + seen(panes, -depth) * through
    return np.clip(np.rint(picture + rng.normal(0, noise, picture.shape)), 0, 255).astype(np.uint8)
