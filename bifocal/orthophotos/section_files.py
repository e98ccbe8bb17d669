"""A section as a drawing of its own: profile, axes with values, the wall's plane, its name."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.files.dxf import new_drawing, save_drawing
from bifocal.orthophotos.canvas import BLUE, GREY, Canvas, Pen, Place, box, scale_bar, text_width
from bifocal.orthophotos.drawing import TABLES, Drawing, Section, multiples, round_step, signed
from bifocal.orthophotos.drawing_files import name_layers
from bifocal.orthophotos.dxf_canvas import DxfCanvas
from bifocal.orthophotos.tuning import PROFILE
from photocore.arrays import FloatArray
from photocore.output import atomic_path
from photocore.reports.words import Words

_PROFILE = Pen(layer="BIFOCAL_SECTIONS", width=0.25)
_GUESSED = Pen(layer="BIFOCAL_SECTIONS_GUESSED", width=0.18, colour=GREY, dashes=(1.5, 1.0))
_AXIS = Pen(layer="BIFOCAL_AXES", width=0.13)
_WALL = Pen(layer="BIFOCAL_AXES", width=0.13, colour=BLUE, dashes=(4.0, 1.5))
_NAME = Pen(layer="BIFOCAL_SECTION_NAME")
_BAR = Pen(layer="BIFOCAL_SCALEBAR")


def write_section_dxf(path: Path, cut: Section, *, drawing: Drawing) -> None:
    """Write one section, 1:1 in metres: relief to the right (upright cut) or upwards."""
    scale, say = drawing.scale, drawing.say
    document, model = new_drawing(
        TABLES["section_layers"], point_style=3, point_size=3 * scale / 1000
    )
    title = _title(cut, scale, say)
    draw_section(DxfCanvas(model, scale / 1000), cut, scale, title)
    _lay_out(document, cut, scale, title)
    name_layers(document, drawing.layers, drawing.language)
    with atomic_path(path, overwrite=False) as temporary:
        save_drawing(document, temporary)


def _lay_out(document: Any, cut: Section, scale: float, title: str) -> None:
    """Lay the section out on the smallest sheet that holds it, through a viewport at 1:scale."""
    left, bottom, right, top = _frame(cut, scale, title)
    wide, high = right - left, top - bottom
    papers = [size for short, long in TABLES["papers"].values() for size in
              ((short, long), (long, short))]  # fmt: skip
    fitting = (size for size in papers if wide + 20 <= size[0] and high + 20 <= size[1])
    sheet = next(fitting, (wide + 20, high + 20))
    name = f"{cut.letter}-{cut.letter}"
    document.layouts.rename("Layout1", name)
    layout = document.paperspace(name)
    layout.page_setup(size=sheet, margins=(0, 0, 0, 0), units="mm")
    layout.add_viewport(
        center=(sheet[0] / 2, sheet[1] / 2), size=(wide, high), view_height=high * scale / 1000,
        view_center_point=((left + right) * scale / 2000, (bottom + top) * scale / 2000),
        dxfattribs={"layer": "BIFOCAL_VIEWPORT"},
    )  # fmt: skip
    document.layers.get("BIFOCAL_VIEWPORT").dxf.plot = 0


def _frame(cut: Section, scale: float, title: str) -> tuple[float, float, float, float]:
    """Return left, bottom, right and top of all that is drawn. [mm]"""
    left, bottom, right, top = _extent(cut, scale)
    bar = round_step(0.05 * scale) * 1000 / scale
    right = left + max(right - left, bar, text_width(title, 3.2))
    return (left - PROFILE.margin, bottom - PROFILE.margin - PROFILE.foot,
            right + PROFILE.margin, top + PROFILE.margin)  # fmt: skip


def write_section_svg(path: Path, cut: Section, *, drawing: Drawing) -> None:
    """Write one section as SVG that prints at 1:scale."""
    scale, title = drawing.scale, _title(cut, drawing.scale, drawing.say)
    left, bottom, right, top = _frame(cut, scale, title)
    canvas = _SvgCanvas(left, top)
    draw_section(canvas, cut, scale, title)
    width, height = right - left, top - bottom
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="0 0 {width:.3f} {height:.3f}" font-family="Helvetica, Arial, sans-serif">\n'
        f'<rect width="{width:.3f}" height="{height:.3f}" fill="#fff"/>\n'
        + "\n".join(canvas.parts)
        + "\n</svg>\n"
    )
    with atomic_path(path, overwrite=False) as temporary:
        temporary.write_text(text, encoding="utf-8")


def draw_section(canvas: Canvas, cut: Section, scale: float, title: str) -> None:
    """Draw a section in millimetres on paper; (0, 0) is the place 0 on the wall's plane."""
    left, bottom, right, top = _extent(cut, scale)
    factor = 1000.0 / scale
    upright = cut.axis == "x"
    along, across = ((bottom, top), (left, right)) if upright else ((left, right), (bottom, top))
    box(canvas, (left, bottom), right - left, top - bottom, _AXIS)
    relief_step = PROFILE.across[0 if upright else 1]
    for low, high, paper, vertical in (
        (*along, PROFILE.along, upright), (*across, relief_step, not upright)
    ):  # fmt: skip
        step = round_step(paper / factor)
        digits = max(0, -math.floor(math.log10(step) + 1e-9))
        for value in multiples(low / factor, high / factor, step).tolist():
            at = value * factor
            words = f"{value:.{digits}f}" if paper == PROFILE.along else signed(value, digits)
            if vertical:
                canvas.line([(left - 1.2, at), (left, at)], _AXIS)
                place = (left - 1.8 - text_width(words, 2.0), at - 0.7)
                canvas.text(place, words, _AXIS, size=2.0)
            else:
                canvas.line([(at, bottom - 1.2), (at, bottom)], _AXIS)
                canvas.text((at, bottom - 3.6), words, _AXIS, size=2.0, middle=True)
    ends = [(0.0, bottom), (0.0, top)] if upright else [(left, 0.0), (right, 0.0)]
    canvas.line(ends, _WALL)
    for measured, piece in cut.pieces():
        places = [(x, y) for x, y in (piece * factor).tolist()]
        canvas.line(places, _PROFILE if measured else _GUESSED)
    names = ("r [m]", "Y [m]") if upright else ("X [m]" if cut.axis == "y" else "s [m]", "r [m]")
    canvas.text((right - text_width(names[0], 2.2), bottom - 6.8), names[0], _AXIS, size=2.2)
    canvas.text((left - PROFILE.margin + 1, top + 2.5), names[1], _AXIS, size=2.2)
    canvas.text((left, bottom - 11.5), title, _NAME, size=3.2, bold=True)
    length = round_step(0.05 * scale)
    scale_bar(canvas, (left, bottom - 20.0), length, factor, _BAR)


def _title(cut: Section, scale: float, say: Words) -> str:
    return say("section", title=cut.title, scale=scale)


def _extent(cut: Section, scale: float) -> tuple[float, float, float, float]:
    """Return left, bottom, right and top of the axes: what is known, with the wall's plane. [mm]"""
    finite = np.isfinite(cut.relief)
    factor = 1000.0 / scale

    def rounded(values: FloatArray) -> tuple[float, float]:
        """Return a range that holds the values and 0, to half a division more."""
        step = round_step(PROFILE.across[0 if cut.axis == "x" else 1] / factor) / 2
        low, high = min(values.min(), 0.0), max(values.max(), 0.0)
        return (math.floor(low / step - 1e-6) * step * factor,
                math.ceil(high / step + 1e-6) * step * factor)  # fmt: skip

    across = rounded(cut.relief[finite])
    along = cut.place[finite].min() * factor, cut.place[finite].max() * factor
    (left, right), (bottom, top) = (across, along) if cut.axis == "x" else (along, across)
    return float(left), float(bottom), float(right), float(top)


class _SvgCanvas:
    """Elements of an SVG picture, whose Y runs downwards. [mm]"""

    def __init__(self, left: float, top: float) -> None:
        self.left, self.top = left, top
        self.parts: list[str] = []

    def line(self, points: Sequence[Place], pen: Pen) -> None:
        dashes = f' stroke-dasharray="{" ".join(f"{v:g}" for v in pen.dashes)}"'
        self.parts.append(
            f'<polyline points="{self._places(points)}" fill="none" stroke="{_hex(pen)}" '
            f'stroke-width="{pen.width:g}"{dashes if pen.dashes else ""}/>'
        )

    def area(self, corners: Sequence[Place], pen: Pen) -> None:
        self.parts.append(f'<polygon points="{self._places(corners)}" fill="{_hex(pen)}"/>')

    def text(
        self, place: Place, words: str, pen: Pen, *, size: float = 2.5, bold: bool = False,
        middle: bool = False, angle: float = 0.0,
    ) -> None:  # fmt: skip
        x, y = place[0] - self.left, self.top - place[1]
        how = ' text-anchor="middle"' if middle else ""
        how += ' font-weight="bold"' if bold else ""
        how += f' transform="rotate({-angle:g} {x:.3f} {y:.3f})"' if angle else ""
        self.parts.append(
            f'<text x="{x:.3f}" y="{y:.3f}" font-size="{size:g}" fill="{_hex(pen)}"{how}>'
            f"{html.escape(words, quote=False)}</text>"
        )

    def _places(self, points: Sequence[Place]) -> str:
        return " ".join(f"{x - self.left:.3f},{self.top - y:.3f}" for x, y in points)


def _hex(pen: Pen) -> str:
    return "#{:02x}{:02x}{:02x}".format(*pen.colour)
