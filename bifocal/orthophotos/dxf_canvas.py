"""A canvas whose primitives become entities of a drawing for CAD."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bifocal.files.dxf import add_line, add_text, dashed, turned
from bifocal.orthophotos.canvas import BLACK, Colour, Pen, Place

#: Widths that drawings know, in hundredths of a millimetre.
_WEIGHTS = (5, 9, 13, 15, 18, 20, 25, 30, 35, 40, 50)


class DxfCanvas:
    """Draws into model or paper space.

    Parameters
    ----------
    space : ezdxf layout
    unit : float
        Drawing units per millimetre of the canvas: 1 in paper space, scale / 1000 in a model in
        metres.
    """

    def __init__(self, space: Any, unit: float = 1.0) -> None:
        self.space, self.unit = space, unit

    def line(self, points: Sequence[Place], pen: Pen) -> None:
        """Draw a line through points."""
        style = self._style(pen)
        if pen.dashes:
            style |= dashed(self.space, "DASHED", sum(pen.dashes) * self.unit)
        add_line(self.space, self._scaled(points), style)

    def area(self, corners: Sequence[Place], pen: Pen) -> None:
        """Fill a triangle or a four-sided polygon."""
        # A solid takes the last two corners of four the other way round.
        places = [corners[k] for k in ((0, 1, 3, 2) if len(corners) == 4 else (0, 1, 2))]
        self.space.add_solid(self._scaled(places), dxfattribs=self._style(pen))

    def text(
        self, place: Place, words: str, pen: Pen, *, size: float = 2.5, bold: bool = False,
        middle: bool = False, angle: float = 0.0,
    ) -> None:  # fmt: skip
        """Write a text; bold ones in the layer's thicker lines."""
        # Helvetica's sizes count from line to line, CAD's are those of a capital letter.
        (at,) = self._scaled([place])
        entity = add_text(self.space, words, at, 0.72 * size * self.unit, pen.layer)
        for name, value in self._style(pen).items():
            entity.dxf.set(name, value)
        if bold:
            entity.dxf.lineweight = 35
        turned(entity, angle, middle=middle)

    def _scaled(self, points: Sequence[Place]) -> list[Place]:
        return [(float(x) * self.unit, float(y) * self.unit) for x, y in points]

    def _style(self, pen: Pen) -> dict[str, object]:
        hundredths = min(_WEIGHTS, key=lambda weight: abs(weight - 100 * pen.width))
        style: dict[str, object] = {"layer": pen.layer, "lineweight": hundredths}
        return style if pen.colour == BLACK else style | {"true_color": _packed(pen.colour)}


def _packed(colour: Colour) -> int:
    red, green, blue = colour
    return red << 16 | green << 8 | blue
