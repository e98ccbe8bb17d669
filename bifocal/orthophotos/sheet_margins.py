"""What stands on a sheet around its picture: frame, numbers, title, scale bar, legend, level."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bifocal.orthophotos.canvas import (
    BLUE,
    LETTER_WIDTH,
    WHITE,
    Canvas,
    Pen,
    Place,
    box,
    scale_bar,
    text_width,
)
from bifocal.orthophotos.drawing import Drawing, PrintSheet, Section, multiples
from bifocal.orthophotos.hatching import DIRECTIONS
from bifocal.orthophotos.tuning import SHEET

_FRAME = Pen(layer="BIFOCAL_FRAME")
_THICK = Pen(layer="BIFOCAL_FRAME", width=0.5)
_RULE = Pen(layer="BIFOCAL_FRAME", width=0.35)
_BAR = Pen(layer="BIFOCAL_SCALEBAR")
_PAPER = Pen(layer="BIFOCAL_SECTION_LINES", colour=WHITE)
_MARK = Pen(layer="BIFOCAL_SECTION_LINES", width=0.5, colour=BLUE)


class SheetMargins:
    """Draws what is around the picture of a drawing.

    Parameters
    ----------
    canvas : Canvas
        In millimetres from the lower left corner of the sheet.
    drawing : Drawing
    sheet : PrintSheet
    within : bool
        Draw the letters of sections that end within the picture, too.
    """

    def __init__(
        self, canvas: Canvas, drawing: Drawing, sheet: PrintSheet, *, within: bool = True
    ) -> None:
        self.within = within
        self.canvas, self.drawing, self.sheet = canvas, drawing, sheet
        self.origin = sheet.origin(drawing)
        self.factor = 1000.0 / drawing.scale

    def draw(self) -> None:
        """Draw all of it."""
        self._frame()
        self._ticks()
        for cut in self.drawing.sections:
            self._section_ends(cut)
        self._title()
        left, bottom, _, _ = self.sheet.frame
        scale_bar(self.canvas, (left + 6, bottom + 8), self.drawing.bar_length(), self.factor, _BAR)
        words = self.drawing.say("print", scale=self.drawing.scale)
        self.canvas.text((left + 6, bottom + 3.8), words, _BAR, size=2.2)
        self._level()
        self._legend()
        self._hatches()

    def place(self, x: float, y: float) -> Place:
        """Return where a plane position is on the sheet. [mm]"""
        xmin, ymin, _, _ = self.drawing.grid.bounds
        return self.origin[0] + (x - xmin) * self.factor, self.origin[1] + (y - ymin) * self.factor

    def _frame(self) -> None:
        left, bottom, right, top = self.sheet.frame
        box(self.canvas, (left, bottom), right - left, top - bottom, _THICK)
        self.canvas.line([(left, bottom + SHEET.strip), (right, bottom + SHEET.strip)], _RULE)
        box(self.canvas, self.origin, *self.drawing.paper_size, _FRAME)

    def _ticks(self) -> None:
        """Draw ticks with coordinates around the picture."""
        xmin, ymin, xmax, ymax = self.drawing.grid.bounds
        step = self.drawing.grid_step()
        digits = 0 if step >= 1 else (1 if step >= 0.1 else 2)
        for x in multiples(xmin, xmax, step).tolist():
            for y, tick, beside in ((ymin, -1.5, -4.2), (ymax, 1.5, 2.2)):
                px, py = self.place(x, y)
                self.canvas.line([(px, py), (px, py + tick)], _FRAME)
                self.canvas.text(
                    (px, py + beside), f"{x:.{digits}f}", _FRAME, size=2.2, middle=True
                )
        for y in multiples(ymin, ymax, step).tolist():
            for x, tick, beside in ((xmin, -1.5, -2.2), (xmax, 1.5, 4.0)):
                px, py = self.place(x, y)
                self.canvas.line([(px, py), (px + tick, py)], _FRAME)
                self.canvas.text(
                    (px + beside, py), f"{y:.{digits}f}", _FRAME, size=2.2, middle=True, angle=90
                )

    def _section_ends(self, cut: Section) -> None:
        """Draw the letter of a section beyond both its ends, with the way one looks."""
        for end, outwards in cut.ends():
            beyond = self.drawing.at_the_edge(end)
            if not (beyond or self.within):
                continue
            x, y = self.place(*end.tolist())
            away = SHEET.beyond if beyond else SHEET.within
            self.canvas.line([(x, y), (x + 1.5 * outwards[0], y + 1.5 * outwards[1])], _MARK)
            tip = np.array([x, y]) + away * outwards
            look = cut.looking()
            side = np.array([-look[1], look[0]])
            if not beyond:  # white, for letters are lost on a dark picture
                near, far = tip - 1.9 * look, tip + 3.7 * look
                rim = [near - 1.9 * side, far - 1.9 * side, far + 1.9 * side, near + 1.9 * side]
                self.canvas.area([(float(a), float(b)) for a, b in rim], _PAPER)
            at, size = (float(tip[0]), float(tip[1]) - 0.36 * SHEET.letter), SHEET.letter
            self.canvas.text(at, cut.letter, _MARK, size=size, bold=True, middle=True)
            foot = tip + 2.0 * look
            corners = [foot - 0.8 * side, foot + 0.8 * side, foot + 1.4 * look]
            self.canvas.area([(float(a), float(b)) for a, b in corners], _MARK)

    def _title(self) -> None:
        left, bottom, right, _ = self.sheet.frame
        block = left + 0.44 * (right - left)
        self.canvas.line([(block, bottom), (block, bottom + SHEET.strip)], _RULE)
        room = right - block - 5

        def fitting(text: str, size: float) -> float:
            """Return the size at which a text does not run into the frame."""
            return round(min(size, room / (1.08 * LETTER_WIDTH * max(len(text), 1))), 3)

        title = self.drawing.title
        top = bottom + SHEET.strip
        self.canvas.text((block + 3, top - 8), title, _FRAME, size=fitting(title, 5.0), bold=True)
        kind = f"{self.drawing.say(self.drawing.kind)} 1:{self.drawing.scale:g}"
        self.canvas.text((block + 3, top - 14), kind, _FRAME, size=3.5)
        name = self.sheet.title(self.drawing.say)
        place = (right - 3 - text_width(name, 2.2), bottom + 2.5)
        self.canvas.text(place, name, _FRAME, size=2.2)
        lines = self.drawing.notes
        pitch = min(3.2, 12.8 / max(len(lines) - 1, 1))
        for number, note in enumerate(lines):
            place = (block + 3, top - 19 - pitch * number)
            self.canvas.text(place, note, _FRAME, size=fitting(note, min(2.2, 0.75 * pitch)))

    def _level(self) -> None:
        """Draw the level mark: the triangle that says how high Y = 0 is, and where up is."""
        line = self.canvas.line
        left, bottom, _, _ = self.sheet.frame
        x, y = left + 8, bottom + SHEET.strip - 7
        pen = Pen(layer="BIFOCAL_FRAME", width=0.25)
        line([(x - 2.2, y + 3), (x + 2.2, y + 3), (x, y), (x - 2.2, y + 3)], pen)
        line([(x - 4, y), (x + 22, y)], pen)
        self.canvas.text((x + 4, y + 1), "±0.00 = Y 0", _FRAME, size=2.6)
        arrow = left + 40
        line([(arrow, y - 3), (arrow, y + 4)], pen)
        line([(arrow - 1, y + 2), (arrow, y + 4), (arrow + 1, y + 2)], pen)
        self.canvas.text((arrow + 2, y), self.drawing.say("up"), _FRAME, size=2.4)
        xmin, ymin, _, ymax = self.drawing.grid.bounds
        if ymin <= 0 <= ymax:
            px, py = self.place(xmin, 0.0)
            tip = px - SHEET.band + 2.2
            line([(tip - 1.4, py + 2), (tip + 1.4, py + 2), (tip, py), (tip - 1.4, py + 2)], _FRAME)

    def _legend(self) -> None:
        """Draw the colours of a relief, and what the hatching means."""
        legend = self.drawing.legend
        if legend is None:
            return
        left, bottom, _, _ = self.sheet.frame
        x, y, wide, high = left + 9, bottom + 17.0, 44.0, 2.2
        part = wide / len(legend.colours)
        for number, colour in enumerate(legend.colours):
            a, b = x + number * part, x + (number + 1) * part + 0.02
            corners = [(a, y), (b, y), (b, y + high), (a, y + high)]
            self.canvas.area(corners, Pen(layer="BIFOCAL_LEGEND", colour=colour))
        box(self.canvas, (x, y), wide, high, _FRAME)
        low, top = legend.words
        ends = (("< " if legend.beyond[0] else "") + low, self.drawing.say("wall"),
                ("> " if legend.beyond[1] else "") + f"{top} m")  # fmt: skip
        for share, words in zip((0.0, 0.5, 1.0), ends, strict=True):
            self.canvas.text((x + share * wide, y + 3), words, _FRAME, size=2.2, middle=True)
        if legend.hatched:
            self._hatch((x + wide + 5, y), (1,), self.drawing.say("not_measured"))

    def _hatches(self) -> None:
        """Draw what each hatch of an orthophoto means, and how much of the picture it covers."""
        left, bottom, _, _ = self.sheet.frame
        for number, (source, share) in enumerate(self.drawing.hatched):
            words = self.drawing.say(source.name.lower(), share=100 * share)
            place = (left + 9, bottom + 21.0 - 3.2 * number)
            self._hatch(place, DIRECTIONS[source], words)

    def _hatch(self, place: Place, directions: Sequence[int], words: str) -> None:
        """Draw a box of lines that rise (1) or fall (-1), and words beside it."""
        (x, y), high = place, 2.2
        box(self.canvas, place, 4, high, _FRAME)
        for step in range(3):
            a, b = x + 1.4 * step, x + 1.4 * step + 1.2
            for rises in directions:
                ends = (y, y + high) if rises > 0 else (y + high, y)
                self.canvas.line([(a, ends[0]), (b, ends[1])], _FRAME)
        self.canvas.text((x + 5, y + 0.3), words, _FRAME, size=2.2)
