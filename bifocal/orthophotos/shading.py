"""A relief as a picture: tinted by depth, lit from the upper left."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.model.grid import Grid
from bifocal.model.surface import Surface
from bifocal.orthophotos.tuning import SHADING
from photocore.arrays import BoolArray, ByteArray, Float32Array

#: Tints from the farthest to the nearest: blue behind the wall, the wall itself nearly white, sand
#: and brown before it.
_TINTS = np.array(
    [[32, 62, 120], [118, 162, 196], [236, 234, 228], [222, 172, 104], [140, 74, 34]], np.float32
)
#: Direction to the light: upper left, 45 degrees high.
_LIGHT = np.array([-0.5, 0.5, 0.7071])


def tints(relief: NDArray[np.floating], limits: tuple[float, float]) -> Float32Array:
    """Return the unlit colours of a relief, shape (..., 3), 0 to 255; NaN counts as 0 m.

    The first and the last colour belong to the limits, the one in the middle to 0 m, the wall.
    """
    low, high = min(limits[0], -1e-6), max(limits[1], 1e-6)
    filled = np.nan_to_num(relief)
    half = (len(_TINTS) - 1) / 2
    share = half + half * np.clip(np.where(filled < 0, -filled / low, filled / high), -1, 1)
    first = np.minimum(share.astype(np.int64), len(_TINTS) - 2)
    step = (share - first)[..., None].astype(np.float32)
    return _TINTS[first] + (_TINTS[first + 1] - _TINTS[first]) * step


def colour_limits(relief: Float32Array) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Return the relief of the first and the last colour [m], and whether any lies beyond them.

    A phantom of a few pixels must not take the colours from the wall: a median over 5 x 5 pixels
    takes small ones out, and of the rest 0.2 % may lie beyond either end. The end that is nearer
    to the wall is at least a tenth as far as the other, lest noise of the wall be coloured.
    """
    unknown = ~np.isfinite(relief)
    if unknown.all():
        return (0.0, 0.0), (False, False)
    quiet = cv2.medianBlur(np.where(unknown, np.float32(0), relief), 5)[~unknown]
    low, high = (float(value) for value in np.percentile(quiet, (0.2, 99.8)))
    low, high = min(low, -high / 10, 0.0), max(high, -low / 10, 0.0)
    extremes = float(relief[~unknown].min()), float(relief[~unknown].max())
    slack = 0.02 * (high - low)
    return (low, high), (extremes[0] < low - slack, extremes[1] > high + slack)


def unmeasured(surface: Surface, measured: Surface, grid: Grid, *, scale: float) -> BoolArray:
    """Return where relief is known but was not measured, but for parts too narrow to be drawn."""
    return _unmeasured(surface, measured, grid, scale)[0]


def _unmeasured(
    surface: Surface, measured: Surface, grid: Grid, scale: float
) -> tuple[BoolArray, BoolArray]:
    """Return where relief was not measured, and where that is broad enough for lines."""
    small, large = (
        max(3, round(wide / 1000 * scale / grid.gsd) | 1)
        for wide in (SHADING.narrow, SHADING.lined)
    )
    wide = grid.window(-large, -large, grid.width + 2 * large, grid.height + 2 * large)
    mask = np.isfinite(surface.window(wide)) & np.isnan(measured.window(wide))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (small, small))
    opened = [
        cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, kernel)
        for kernel in (disc, np.ones((large, large), np.uint8))
    ]
    core = np.s_[large:-large, large:-large]
    return np.asarray(opened[0][core] > 0), np.asarray(opened[1][core] > 0)


def shaded(
    surface: Surface,
    grid: Grid,
    *,
    limits: tuple[float, float],
    measured: Surface | None = None,
    scale: float = 50.0,
) -> tuple[ByteArray, ByteArray]:
    """Return the picture of a window, shape (h, w, 3), and where relief is known, shape (h, w).

    Parameters
    ----------
    limits : tuple of float
        Relief of the first and the last tint. [m]
    measured : Surface, optional
        The part of the surface that was measured; the rest is paler and hatched.
    scale : float
        1:scale of the drawing, for the hatching.
    """
    wide = grid.window(-1, -1, grid.width + 2, grid.height + 2)
    r = surface.window(wide)
    middle = r[1:-1, 1:-1]
    finite = np.isfinite(middle)
    # Slopes steeper than 1:1 would all be black or white: they are flattened softly.
    dx, dy = (
        np.tanh(np.nan_to_num(step / np.float32(2 * grid.gsd)))
        for step in (r[1:-1, 2:] - r[1:-1, :-2], r[:-2, 1:-1] - r[2:, 1:-1])
    )
    light = (_LIGHT[2] - dx * _LIGHT[0] - dy * _LIGHT[1]) / np.sqrt(1 + dx * dx + dy * dy)
    tint = tints(middle, limits)
    picture = tint * (0.35 + 0.92 * np.clip(light, 0, 1))[..., None]
    if measured is not None:
        guessed, broad = _unmeasured(surface, measured, grid, scale)
        rows, columns = np.nonzero(guessed)
        pixel = 1000 * grid.gsd / scale  # on paper [mm]
        period = max(4, round(SHADING.period * np.sqrt(2) / pixel))
        stroke = max(1, round(SHADING.stroke * np.sqrt(2) / pixel))
        # Counted from the plane's origin, so that the lines go on from tile to tile.
        first = round((grid.x0 - grid.y0) / grid.gsd)
        lined = ((rows + columns + first) % period < stroke) & broad[rows, columns]
        pale = picture[rows, columns] * (1 - SHADING.pale) + 255 * SHADING.pale
        picture[rows, columns] = np.where(lined[:, None], pale * SHADING.lines, pale)
    picture[~finite] = 255
    colours = np.clip(np.rint(picture), 0, 255).astype(np.uint8)
    return colours, np.where(finite, np.uint8(255), np.uint8(0))
