"""A relief as a picture: tinted by depth, lit from the upper left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Grid
from bifocal.model.surface import Surface
from photocore.arrays import ByteArray, Float32Array

#: Tints from far to near: dark blue, green-grey, sand, nearly white.
_TINTS = np.array(
    [[38, 54, 96], [64, 110, 132], [140, 158, 132], [214, 190, 140], [246, 236, 214]], np.float32
)
#: Direction to the light: upper left, 45 degrees high.
_LIGHT = np.array([-0.5, 0.5, 0.7071])


def tints(relief: NDArray[np.floating], limits: tuple[float, float]) -> Float32Array:
    """Return the unlit colours of a relief, shape (..., 3), 0 to 255; NaN counts as 0 m."""
    span = max(limits[1] - limits[0], 1e-6)
    share = np.clip((np.nan_to_num(relief) - limits[0]) / span, 0, 1) * (len(_TINTS) - 1)
    low = np.minimum(share.astype(np.int64), len(_TINTS) - 2)
    step = (share - low)[..., None].astype(np.float32)
    return _TINTS[low] + (_TINTS[low + 1] - _TINTS[low]) * step


def shaded(
    surface: Surface,
    grid: Grid,
    *,
    limits: tuple[float, float],
    measured: Surface | None = None,
) -> tuple[ByteArray, ByteArray]:
    """Return the picture of a window, shape (h, w, 3), and where relief is known, shape (h, w).

    Parameters
    ----------
    limits : tuple of float
        Relief of the first and the last tint. [m]
    measured : Surface, optional
        The part of the surface that was measured; the rest is greyed and hatched.
    """
    wide = grid.window(-1, -1, grid.width + 2, grid.height + 2)
    r = surface.window(wide)
    middle = r[1:-1, 1:-1]
    known = np.isfinite(middle)
    # Slopes steeper than 1:1 would all be black or white: they are flattened softly.
    dx, dy = (
        np.tanh(np.nan_to_num(step / np.float32(2 * grid.gsd)))
        for step in (r[1:-1, 2:] - r[1:-1, :-2], r[:-2, 1:-1] - r[2:, 1:-1])
    )
    light = (_LIGHT[2] - dx * _LIGHT[0] - dy * _LIGHT[1]) / np.sqrt(1 + dx * dx + dy * dy)
    tint = tints(middle, limits)
    picture = tint * (0.35 + 0.92 * np.clip(light, 0, 1))[..., None]
    if measured is not None:
        rows, columns = np.nonzero(known & np.isnan(measured.window(grid)))
        # Counted from the plane's origin, so that the stripes go on from tile to tile.
        first = round((grid.x0 - grid.y0) / grid.gsd)
        stripe = (rows + columns + first) % 10 < 3
        picture[rows, columns] = np.where(stripe, 110, 205)[:, None]
    picture[~known] = 255
    colours = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return colours, np.where(known, np.uint8(255), np.uint8(0))
