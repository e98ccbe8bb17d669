"""Relief written at spots of a drawing: where it is measured and lies even."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.surface import Surface
from bifocal.orthophotos.contour_lines import contour_grid
from bifocal.orthophotos.tuning import SPOTS
from photocore.arrays import FloatArray


def spot_heights(measured: Surface, grid: Grid, scale: float) -> FloatArray:
    """Return X, Y and relief of spots, shape (n, 3), one in each field of the sheet that has any.

    Parameters
    ----------
    measured : Surface
        Relief as it was measured.
    grid : Grid
        Of the picture.
    scale : float
        1:scale: fields are so large on paper.
    """
    coarse = contour_grid(grid, scale)
    relief = measured.window(coarse)
    finite = np.isfinite(relief)
    side = max(3, round(SPOTS.even / 1000 * scale / coarse.gsd) | 1)
    filled = np.where(finite, relief, np.float32(0))
    mean, square = (cv2.blur(band, (side, side)) for band in (filled, filled * filled))
    rough = np.sqrt(np.maximum(square - mean * mean, 0))
    whole = cv2.erode(finite.astype(np.uint8), np.ones((side, side), np.uint8), borderValue=0) > 0
    step = max(side, round(SPOTS.field / 1000 * scale / coarse.gsd))
    spots = []
    for top in range(0, coarse.height, step):
        for left in range(0, coarse.width, step):
            part = np.s_[top : top + step, left : left + step]
            row, column = np.nonzero(whole[part])
            if not len(row):
                continue
            # Even, and not far from the middle of the field.
            off = np.hypot(row - step / 2, column - step / 2) / step
            worth = rough[part][row, column] + np.float32(SPOTS.middle * coarse.gsd) * off
            best = int(worth.argmin())
            y, x = top + int(row[best]), left + int(column[best])
            place = (coarse.x0 + x * coarse.gsd, coarse.y0 - y * coarse.gsd, float(mean[y, x]))
            spots.append(place)
    return np.array(spots, float).reshape(-1, 3)
