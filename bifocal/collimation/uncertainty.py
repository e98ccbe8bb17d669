"""Where on the wall relief is precise: contour lines of its sigma, and the area of uncertainty."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.collimation.live_results import LiveResults
from bifocal.collimation.pictures import Pictures
from photocore.arrays import FloatArray

#: Longer sides of the computed grid and of the picture. [px]
COMPUTED, SHOWN = 256, 1024
#: Contour lines of sigma of r. [mm]
LEVELS = (1, 2, 5, 10, 20, 50, 100, 200, 500)
_SHADE = (60, 60, 220, 110)  # BGRA
#: Shorter lines are specks. [points of the computed grid]
_SHORTEST = 6


def relief_sigma(pictures: Pictures, results: LiveResults) -> FloatArray:
    """Return sigma of the relief of points on the wall, shape (h, w), over the wall's grid. [m]

    NaN where not both photos show the wall.
    """
    pair, grid = pictures.needed_pair(), pictures.grid
    assert grid is not None
    step = max(grid.width, grid.height) / COMPUTED
    width, height = (max(2, round(side / step)) for side in (grid.width, grid.height))
    xmin, ymin, xmax, ymax = grid.bounds
    x = xmin + (np.arange(width) + 0.5) * (xmax - xmin) / width
    y = ymax - (np.arange(height) + 0.5) * (ymax - ymin) / height
    plane = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    projected = [pair.photo(number).pixels_from_plane(plane) for number in (1, 2)]
    inside = np.ones(len(plane), dtype=bool)
    for pixels, info in zip(projected, pictures.infos, strict=True):
        inside &= (pixels > -0.5).all(axis=1) & (pixels < np.array(info.size) - 0.5).all(axis=1)
    sigma = np.full(len(inside), np.nan)
    if inside.any():
        solved = pair.intersect(
            projected[0][inside], projected[1][inside], sigma_px=results.sigma_px
        )
        sigma[inside] = solved.sigma[:, 2]
    return sigma.reshape(height, width)


def uncertainty_picture(pictures: Pictures, results: LiveResults) -> bytes:
    """Return the shaded area of uncertainty over the wall, PNG."""
    sigma = relief_sigma(pictures, results)
    limit = results.limits.relief_limit(pictures.needed_pair().d2)
    height, width = sigma.shape
    factor = SHOWN / max(height, width)
    size = (round(width * factor), round(height * factor))
    finite = np.isfinite(sigma)
    filled = np.where(finite, sigma, np.nanmax(sigma) if finite.any() else 1.0)
    smooth = cv2.resize(np.log(filled), size, interpolation=cv2.INTER_CUBIC)
    shown = cv2.resize(finite.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    picture = np.zeros((size[1], size[0], 4), np.uint8)
    picture[(smooth > np.log(limit)) & shown] = _SHADE
    return cv2.imencode(".png", picture)[1].tobytes()


def precision_contours(pictures: Pictures, results: LiveResults) -> list[dict[str, object]]:
    """Return lines of equal sigma of r: ``sigma_mm`` and ``line``, pixels of the wall, (n, 2)."""
    from contourpy import contour_generator

    sigma, grid = relief_sigma(pictures, results), pictures.grid
    assert grid is not None
    step = np.array([grid.width, grid.height]) / sigma.shape[::-1]
    contours = contour_generator(z=np.ma.masked_invalid(np.log(sigma)))
    return [
        {"sigma_mm": level, "line": ((np.asarray(line) + 0.5) * step - 0.5).round(1).tolist()}
        for level in LEVELS
        for line in contours.lines(np.log(level / 1000))
        if len(line) >= _SHORTEST
    ]
