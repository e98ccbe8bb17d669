"""Contour lines and sections of a relief."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.surface import Surface
from bifocal.orthophotos.drawing import Section, multiples
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: More contour levels than this are a mistake of unit.
_MOST_LEVELS = 2000
#: Side of the largest raster contours are drawn from. [px]
_LARGEST = 4000
#: Points of a section that are looked up together.
_TOGETHER = 64


def contours(
    surface: Surface, grid: Grid, *, interval: float, detail: float
) -> tuple[tuple[float, FloatArray], ...]:
    """Return contour lines of a relief.

    Parameters
    ----------
    surface : Surface
    grid : Grid
        Where.
    interval : float
        Between levels. [m]
    detail : float
        Finest detail that is wanted. [m]

    Returns
    -------
    lines : tuple of (level, ndarray of shape (n, 2))
        In metres on the plane.
    """
    from contourpy import contour_generator

    largest = max(grid.shape) * grid.gsd / _LARGEST
    coarse = Grid.from_bounds(grid.bounds, gsd=max(grid.gsd, detail, largest))
    relief = surface.window(coarse).astype(np.float64)
    if min(relief.shape) < 2 or not np.isfinite(relief).any():
        return ()
    low, high = float(np.nanmin(relief)), float(np.nanmax(relief))
    if (high - low) / interval > _MOST_LEVELS:
        raise InputError(
            f"contours every {interval:g} m make {(high - low) / interval:.0f} levels; choose a "
            "larger interval."
        )
    levels = multiples(low, high, interval)
    generator = contour_generator(
        coarse.columns_x, coarse.rows_y, np.ma.masked_invalid(relief), name="serial"
    )
    lines = []
    for level in levels.tolist():
        for line in generator.lines(level):
            # Rings of a few pixels are noise of the relief, not form of the wall.
            if len(line) >= 8:
                lines.append((level, np.asarray(line, dtype=np.float64)))
    return tuple(lines)


def section(surface: Surface, grid: Grid, name: str, *, step: float) -> Section:
    """Return a section of a relief.

    Parameters
    ----------
    name : str
        ``x=1.5`` upright cut, ``y=2`` level cut, or the corners ``x,y x,y ...`` of a line. [m]
    step : float
        Between points along it. [m]

    Raises
    ------
    InputError
        If the name is none of these or the line misses the wall.
    """
    axis, path = _path(name, grid)
    pieces, places, done = [], [], 0.0
    for start, end in pairwise(path):
        length = float(np.hypot(*(end - start)))
        count = max(2, math.ceil(length / step) + 1)
        share = np.linspace(0.0, 1.0, count)
        pieces.append(start + (end - start) * share[:, None])
        places.append(done + length * share)
        done += length
    points = np.concatenate(pieces)
    place = {"x": points[:, 1], "y": points[:, 0]}.get(axis, np.concatenate(places))
    relief = sample(surface, points, gsd=grid.gsd)
    if not np.isfinite(relief).any():
        raise InputError(f"section {name}: no relief is known along it; check its coordinates.")
    return Section(name=name, axis=axis, path=path, place=place, relief=relief)


def sample(surface: Surface, points: FloatArray, *, gsd: float) -> FloatArray:
    """Return relief at points of a path, shape (n,); nearest pixel of the given size. [m]"""
    relief = np.full(len(points), np.nan)
    for first in range(0, len(points), _TOGETHER):
        part = points[first : first + _TOGETHER]
        low, high = part.min(axis=0), part.max(axis=0)
        width, height = (math.ceil((high[k] - low[k]) / gsd) + 1 for k in (0, 1))
        window = Grid(x0=float(low[0]), y0=float(high[1]), gsd=gsd, width=width, height=height)
        column, row = np.rint(window.pixel_of(part)).astype(np.int64).T
        relief[first : first + _TOGETHER] = surface.window(window)[row, column]
    return relief


def _path(name: str, grid: Grid) -> tuple[str, FloatArray]:
    xmin, ymin, xmax, ymax = grid.bounds
    text = name.replace(" ", "").lower()
    kind = text[0] if text.startswith(("x=", "y=")) else "line"
    try:
        if kind == "line":
            numbers = [float(value) for value in name.replace(",", " ").replace(";", " ").split()]
        else:
            at = float(text[2:])
            numbers = [at, ymin, at, ymax] if kind == "x" else [xmin, at, xmax, at]
    except ValueError:
        numbers = []
    if len(numbers) < 4 or len(numbers) % 2 or not np.isfinite(numbers).all():
        raise InputError(
            f'section {name!r}: write x=1.5 (upright), y=2.0 (level) or corners "0,1 2,1 2,3" '
            "in metres."
        )
    corners = np.array(numbers).reshape(-1, 2)
    if not np.ptp(corners, axis=0).any():
        raise InputError(f"section {name!r}: its corners are one point; write two or more.")
    return kind, corners
