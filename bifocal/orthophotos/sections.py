"""Sections of a relief."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.surface import Surface
from bifocal.options import section_corners
from bifocal.orthophotos.drawing import Section
from bifocal.orthophotos.tuning import PROFILE
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError


def section(
    surface: Surface, grid: Grid, name: str, *, step: float, measured: Surface | None = None,
    letter: str = "A",
) -> Section:  # fmt: skip
    """Return a section of a relief.

    Parameters
    ----------
    name : str
        ``x=1.5`` upright cut, ``y=2`` level cut, or the corners ``x,y x,y ...`` of a line. [m]
    step : float
        Between points along it. [m]
    measured : Surface, optional
        The part of the surface that was measured; None: all of it.
    letter : str
        What both its ends bear.

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
    measured_relief = relief if measured is None else sample(measured, points, gsd=grid.gsd)
    return Section(
        letter=letter, name=name, axis=axis, path=path, place=place, relief=relief,
        measured=np.isfinite(measured_relief),
    )  # fmt: skip


def section_letter(number: int) -> str:
    """Return the letter of a section, counted from 0: A to Z, then A1, B1 ..."""
    return chr(ord("A") + number % 26) + (str(number // 26) if number >= 26 else "")


def sample(surface: Surface, points: FloatArray, *, gsd: float) -> FloatArray:
    """Return relief at points of a path, shape (n,); nearest pixel of the given size. [m]"""
    relief = np.full(len(points), np.nan)
    for first in range(0, len(points), PROFILE.together):
        part = points[first : first + PROFILE.together]
        low, high = part.min(axis=0), part.max(axis=0)
        width, height = (math.ceil((high[k] - low[k]) / gsd) + 1 for k in (0, 1))
        window = Grid(x0=float(low[0]), y0=float(high[1]), gsd=gsd, width=width, height=height)
        column, row = np.rint(window.pixel_of(part)).astype(np.int64).T
        relief[first : first + PROFILE.together] = surface.window(window)[row, column]
    return relief


def _path(name: str, grid: Grid) -> tuple[str, FloatArray]:
    xmin, ymin, xmax, ymax = grid.bounds
    try:
        kind, numbers = section_corners(name)
    except ValueError:
        raise InputError(remark("ortho.section_place", name=name)) from None
    if kind != "line":
        at = numbers[0]
        numbers = (at, ymin, at, ymax) if kind == "x" else (xmin, at, xmax, at)
    corners = np.array(numbers).reshape(-1, 2)
    if not np.ptp(corners, axis=0).any():
        raise InputError(f"section {name!r}: its corners are one point; write two or more.")
    return kind, corners[np.append(True, np.diff(corners, axis=0).any(axis=1))]
