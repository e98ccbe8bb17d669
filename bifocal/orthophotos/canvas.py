"""What a sheet is drawn on: lines, areas and texts in millimetres, whatever the format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

#: Red, green and blue, 0 to 255.
Colour = tuple[int, int, int]
#: X to the right and Y upwards. [mm]
Place = tuple[float, float]

BLACK: Colour = (0, 0, 0)
WHITE: Colour = (255, 255, 255)
GREY: Colour = (120, 120, 120)
BLUE: Colour = (25, 51, 204)
#: Mean width of Helvetica's letters in its size; digits have exactly this.
LETTER_WIDTH = 0.556


@dataclass(frozen=True, slots=True, kw_only=True)
class Pen:
    """How something is drawn.

    Attributes
    ----------
    layer : str
        Of the drawing, where the format has layers.
    width : float
        Of lines. [mm]
    colour : tuple of int
    dashes : tuple of float
        Lengths of strokes and gaps; empty: a whole line. [mm]
    """

    layer: str
    width: float = 0.18
    colour: Colour = BLACK
    dashes: tuple[float, ...] = ()


class Canvas(Protocol):
    """Takes primitives of a drawing. [mm]"""

    def line(self, points: Sequence[Place], pen: Pen) -> None:
        """Draw a line through points."""

    def area(self, corners: Sequence[Place], pen: Pen) -> None:
        """Fill a polygon with the pen's colour."""

    def text(
        self, place: Place, words: str, pen: Pen, *, size: float = 2.5, bold: bool = False,
        middle: bool = False, angle: float = 0.0,
    ) -> None:  # fmt: skip
        """Write from, or centred on, a place of the base line, turned counter-clockwise [deg]."""


def text_width(words: str, size: float) -> float:
    """Return about how wide a text is in Helvetica. [mm]"""
    return LETTER_WIDTH * size * len(words)


def box(canvas: Canvas, corner: Place, wide: float, high: float, pen: Pen) -> None:
    """Draw a rectangle from its lower left corner."""
    x, y = corner
    canvas.line([(x, y), (x + wide, y), (x + wide, y + high), (x, y + high), (x, y)], pen)


def scale_bar(
    canvas: Canvas, corner: Place, length: float, factor: float, pen: Pen, *, size: float = 2.4
) -> None:
    """Draw a bar of five parts with its length.

    Parameters
    ----------
    length : float
        [m]
    factor : float
        Millimetres on paper per metre.
    """
    x, y = corner
    part = length * factor / 5
    for number in range(5):
        left = x + number * part
        if number % 2 == 0:
            corners = [(left, y), (left + part, y), (left + part, y + 1.8), (left, y + 1.8)]
            canvas.area(corners, pen)
    box(canvas, corner, 5 * part, 1.8, pen)
    for number in (0, 1, 5):
        words = f"{length * number / 5:g}{' m' if number == 5 else ''}"
        canvas.text((x + number * part, y + 3), words, pen, size=size, middle=True)
