"""What goes on a drawing besides the picture: points, contour lines, sections, and its frame."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import pairwise
from typing import Any

import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.points import Points
from bifocal.orthophotos.ortho_image import Source
from bifocal.orthophotos.tuning import SHEET
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import InputError
from photocore.reports.words import Words, words_of

#: Papers, width and height upright [mm]; layers of drawings and sections, with their colours.
TABLES: Mapping[str, Mapping[str, Any]] = tomllib.loads(
    files("bifocal.orthophotos").joinpath("drawing.toml").read_text("utf-8")
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """A cut through the wall.

    Attributes
    ----------
    letter : str
        Both its ends bear it: section A-A.
    name : str
        What was asked for: ``x=1.5``, ``y=2`` or the corners of a polyline.
    axis : str
        ``x`` (upright cut), ``y`` (level cut) or ``line``.
    path : ndarray, shape (k, 2)
        Corners on the plane. [m]
    place : ndarray, shape (n,)
        Y of an upright cut, X of a level one, else the distance along the line. [m]
    relief : ndarray, shape (n,)
        NaN where unknown. [m]
    measured : ndarray of bool, shape (n,)
        False where the relief was interpolated or taken from behind a step.
    """

    letter: str = "A"
    name: str
    axis: str
    path: FloatArray
    place: FloatArray
    relief: FloatArray
    measured: BoolArray

    @property
    def title(self) -> str:
        """What it is called: ``A-A  x=1.5``."""
        return f"{self.letter}-{self.letter}  {self.name}"

    def looking(self) -> FloatArray:
        """Return the direction one looks in, on the plane, shape (2,): see `pieces`."""
        if self.axis == "x":
            return np.array([1.0, 0.0])
        along = self.path[-1] - self.path[0]
        if not along.any():
            along = self.path[1] - self.path[0]
        return np.array([-along[1], along[0]]) / np.hypot(*along)

    def ends(self) -> list[tuple[FloatArray, FloatArray]]:
        """Return both ends and the directions out of the line there, each of shape (2,)."""
        pairs = ((self.path[0], self.path[1]), (self.path[-1], self.path[-2]))
        return [(end, (end - before) / np.hypot(*(end - before))) for end, before in pairs]

    def pieces(self) -> list[tuple[bool, FloatArray]]:
        """Return the known pieces as drawn, measured or not, relief to the right or upwards.

        Each is an array of shape (n, 2); one that was not measured goes on to its neighbours. [m]
        """
        upright = self.axis == "x"
        columns = (self.relief, self.place) if upright else (self.place, self.relief)
        return self._split(np.stack(columns, axis=-1))

    def in_space(self) -> list[tuple[bool, FloatArray]]:
        """Return the known pieces where they lie on the wall, each X, Y, r, shape (n, 3). [m]"""
        steps = np.r_[0.0, np.hypot(*np.diff(self.path, axis=0).T).cumsum()]
        along = self.place
        if self.axis != "line":  # X or Y itself, not the way from the path's beginning
            axis = 1 if self.axis == "x" else 0
            along = np.abs(self.place - self.path[0, axis])
        corners = (np.interp(along, steps, self.path[:, k]) for k in (0, 1))
        return self._split(np.stack([*corners, self.relief], axis=-1))

    def _split(self, line: FloatArray) -> list[tuple[bool, FloatArray]]:
        """Return the known pieces of what has a row for each place, measured or not."""
        kind = np.where(np.isfinite(self.relief), np.where(self.measured, 1, 2), 0)
        bounds = [0, *(np.flatnonzero(np.diff(kind)) + 1).tolist(), len(kind)]
        pieces = []
        for a, b in pairwise(bounds):
            if kind[a] == 2:
                a -= int(a > 0 and kind[a - 1] == 1)
                b += int(b < len(kind) and kind[b] == 1)
            if kind[b - 1] and b - a > 1:
                pieces.append((not (kind[a:b] == 2).any(), line[a:b]))
        return pieces


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Contour:
    """A contour line.

    Attributes
    ----------
    level : float
        Its relief. [m]
    line : ndarray, shape (n, 2)
        On the plane. [m]
    index : bool
        Every fifth level: drawn thicker, and labelled.
    """

    level: float
    line: FloatArray
    index: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Legend:
    """The colours of a relief.

    Attributes
    ----------
    limits : tuple of float
        Relief of the first and the last colour; the wall, 0 m, has the one in the middle. [m]
    beyond : tuple of bool
        Whether there is relief below the first, above the last.
    colours : tuple of (red, green, blue), 0 to 255
    hatched : bool
        Whether relief that was not measured is.
    """

    limits: tuple[float, float]
    beyond: tuple[bool, bool] = (False, False)
    colours: tuple[tuple[int, int, int], ...]
    hatched: bool = False

    @property
    def words(self) -> tuple[str, str]:
        """The limits as they are written: to millimetres on a flat wall."""
        digits = 2 if max(-self.limits[0], self.limits[1]) >= 0.1 else 3
        return signed(self.limits[0], digits), signed(self.limits[1], digits)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawing:
    """Everything on a drawing of one orthophoto.

    Attributes
    ----------
    title : str
    kind : {"ortho", "relief"}
    grid : Grid
        Of the picture.
    scale : float
        1:scale.
    points, control : Points, optional
    cad : mapping of str to Points
        Of ``points``, ``control`` and ``check``: what only the drawing for CAD holds.
    contours : tuple of Contour
    sections : tuple of Section
    notes : tuple of str
        Lines for the title block.
    legend : Legend, optional
        Of a relief.
    hatched : tuple of (Source, float)
        What lines lie over in an orthophoto, and its share of the picture.
    spots : ndarray, shape (n, 3)
        X, Y and relief of spot heights. [m]
    language : str
    layers : str
        How they are called: ``language``, ``bifocal`` or ``ncs``.
    """

    title: str
    kind: str = "ortho"
    grid: Grid
    scale: float
    points: Points | None = None
    control: Points | None = None
    cad: Mapping[str, Points] = field(default_factory=dict)
    contours: tuple[Contour, ...] = ()
    sections: tuple[Section, ...] = ()
    notes: tuple[str, ...] = field(default=())
    legend: Legend | None = None
    hatched: tuple[tuple[Source, float], ...] = ()
    spots: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    language: str = "en"
    layers: str = "language"

    @property
    def say(self) -> Words:
        """What gives the texts of the sheet in its language, by their keys."""
        return words_of("bifocal.orthophotos", self.language)

    @property
    def paper_size(self) -> tuple[float, float]:
        """Width and height of the picture on paper. [mm]"""
        factor = 1000.0 / self.scale * self.grid.gsd
        return self.grid.width * factor, self.grid.height * factor

    def at_the_edge(self, end: FloatArray) -> bool:
        """Return whether a section's end is so near the edge that its letter stands beyond it."""
        xmin, ymin, xmax, ymax = self.grid.bounds
        gaps = np.abs([end[0] - xmin, end[0] - xmax, end[1] - ymin, end[1] - ymax])
        return bool(gaps.min() * 1000.0 / self.scale < SHEET.beyond)

    def spot_words(self) -> list[tuple[float, float, str]]:
        """Return X, Y [m] and words of the spot heights; on a flat wall they have millimetres."""
        digits = 2 if np.abs(self.spots[:, 2]).max(initial=0.0) >= 0.1 else 3
        return [(x, y, signed(r, digits)) for x, y, r in self.spots.tolist()]

    def grid_step(self) -> float:
        """Return the spacing of grid crosses: about 5 cm on paper, a round number. [m]"""
        return round_step(0.05 * self.scale)

    def crosses(self) -> FloatArray:
        """Return the grid crosses on the picture, shape (n, 2). [m]"""
        xmin, ymin, xmax, ymax = self.grid.bounds
        step = self.grid_step()
        x, y = (multiples(a, b, step) for a, b in ((xmin, xmax), (ymin, ymax)))
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def bar_length(self) -> float:
        """Return the length of the scale bar: about 6 cm on paper. [m]"""
        return round_step(0.06 * self.scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintSheet:
    """A sheet of paper for a drawing.

    Attributes
    ----------
    name : str
        ``A3 landscape``.
    width, height : float
        [mm]
    """

    name: str
    width: float
    height: float

    @classmethod
    def fitting(cls, drawing: Drawing, paper: str | None = None) -> PrintSheet:
        """Return the smallest sheet that holds a drawing.

        Raises
        ------
        InputError
            If it does not fit the paper asked for, or not even A0.
        """
        wide, high = drawing.paper_size
        need = (
            wide + SHEET.left + SHEET.margin + 2 * SHEET.band,
            high + 2 * SHEET.margin + 2 * SHEET.band + SHEET.strip,
        )
        for name, (short, long) in TABLES["papers"].items():
            if paper is not None and name != paper:
                continue
            ways = [("portrait", (short, long)), ("landscape", (long, short))]
            for turned, size in ways if high > wide else ways[::-1]:
                if need[0] <= size[0] and need[1] <= size[1]:
                    return cls(name=f"{name} {turned}", width=size[0], height=size[1])
        paper_size = paper or "A0"
        raise InputError(
            f"at 1:{drawing.scale:g} the picture is {wide:.0f} x {high:.0f} mm and does not fit "
            f"{paper_size}. Choose a smaller scale (1:{drawing.scale * 2:g}), --bounds, or another "
            "--paper."
        )

    def title(self, say: Words) -> str:
        """Return the name of the sheet in the language of its drawing."""
        paper, turned = self.name.split()
        return say(turned, paper=paper)

    @property
    def frame(self) -> tuple[float, float, float, float]:
        """Left, bottom, right, top of the frame from the sheet's lower left corner. [mm]"""
        return SHEET.left, SHEET.margin, self.width - SHEET.margin, self.height - SHEET.margin

    def origin(self, drawing: Drawing) -> tuple[float, float]:
        """Return the lower left corner of the picture, centred above the strip. [mm]"""
        left, bottom, right, top = self.frame
        wide, high = drawing.paper_size
        return (left + right - wide) / 2, (bottom + SHEET.strip + top - high) / 2


def round_step(length: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that does not exceed a length.

    Examples
    --------
    >>> round_step(3.0), round_step(0.7), round_step(5.0)
    (2.0, 0.5, 5.0)
    """
    power = 10.0 ** math.floor(math.log10(length) + 1e-9)
    for factor in (5.0, 2.0):
        if factor * power <= length * (1 + 1e-9):
            return round(factor * power, 9)
    return round(power, 9)


def signed(value: float, digits: int) -> str:
    """Return a relief as drawings write it, with its sign; what is 0 has none.

    Examples
    --------
    >>> signed(-0.25, 2), signed(0.5, 1), signed(-0.0, 2)
    ('-0.25', '+0.5', '0.00')
    """
    words = f"{value:+.{digits}f}"
    return words[1:] if float(words) == 0 else words


def multiples(low: float, high: float, step: float) -> FloatArray:
    """Return the multiples of a step from low to high."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return np.round(np.arange(first, last + 1) * step, 9)
