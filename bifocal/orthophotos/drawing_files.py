"""Drawings for CAD: the orthophoto in its place with all that belongs to it, and sections."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np

from bifocal.files.dxf import add_text, new_drawing, save_drawing
from bifocal.model.points import SurveyPoints
from bifocal.orthophotos.drawing import Drawing, Section, round_step
from photocore.output import atomic_path

#: Layers and their colours (AutoCAD colour index).
LAYERS = {
    "BIFOCAL_IMAGE": 7,
    "BIFOCAL_POINTS": 7,
    "BIFOCAL_NAMES": 3,
    "BIFOCAL_CONTROL": 1,
    "BIFOCAL_GRID": 8,
    "BIFOCAL_SCALEBAR": 7,
    "BIFOCAL_CONTOURS": 30,
    "BIFOCAL_CONTOUR_TEXT": 30,
    "BIFOCAL_SECTION_LINES": 5,
    "BIFOCAL_SECTIONS": 5,
}


def write_drawing(path: Path, drawing: Drawing, image_name: str | None, *, overwrite: bool) -> None:
    """Write an R2010 drawing in metres with the image attached at its place.

    Parameters
    ----------
    image_name : str, optional
        File of the picture beside the drawing.
    """
    document, model = _new(drawing.scale)
    grid = drawing.grid
    xmin, ymin, xmax, ymax = grid.bounds
    if image_name is not None:
        definition = document.add_image_def(
            filename=image_name, size_in_pixel=(grid.width, grid.height)
        )
        # The insertion point is the lower left corner of the lower left pixel.
        model.add_image(
            definition,
            insert=(xmin, ymin),
            size_in_units=(grid.width * grid.gsd, grid.height * grid.gsd),
            dxfattribs={"layer": "BIFOCAL_IMAGE"},
        )
    paper = drawing.scale / 1000.0  # metres on the wall per millimetre on paper
    style, arm = {"layer": "BIFOCAL_GRID"}, 2 * paper
    for x, y in drawing.crosses().tolist():
        model.add_line((x - arm, y), (x + arm, y), dxfattribs=style)
        model.add_line((x, y - arm), (x, y + arm), dxfattribs=style)
        beside = (x + 0.5 * paper, y + 0.5 * paper)
        add_text(model, f"{x:g} / {y:g}", beside, 1.6 * paper, "BIFOCAL_GRID")
    _scale_bar(model, drawing, paper)
    _points(model, drawing.points, "BIFOCAL_POINTS", 2.0 * paper)
    _points(model, drawing.control, "BIFOCAL_CONTROL", 2.0 * paper)
    for level, line in drawing.contours:
        model.add_lwpolyline(
            line.tolist(), dxfattribs={"layer": "BIFOCAL_CONTOURS", "elevation": level}
        )
        if len(line) > 60:
            place = tuple(line[len(line) // 2].tolist())
            add_text(model, f"{level:+.2f}", place, 1.4 * paper, "BIFOCAL_CONTOUR_TEXT")
    for cut in drawing.sections:
        model.add_lwpolyline(cut.path.tolist(), dxfattribs={"layer": "BIFOCAL_SECTION_LINES"})
        place = tuple(cut.path[0].tolist())
        add_text(model, cut.name, place, 2.5 * paper, "BIFOCAL_SECTION_LINES")
    document.set_modelspace_vport(
        height=1.15 * (ymax - ymin), center=((xmin + xmax) / 2, (ymin + ymax) / 2)
    )
    with atomic_path(path, overwrite=overwrite) as temporary:
        save_drawing(document, temporary)


def write_section_dxf(path: Path, cut: Section, *, scale: float, overwrite: bool) -> None:
    """Write one section, 1:1 in metres: relief to the right (upright cut) or upwards."""
    document, model = _new(scale)
    for piece in cut.pieces():
        model.add_lwpolyline(piece.tolist(), dxfattribs={"layer": "BIFOCAL_SECTIONS"})
    start, end = float(cut.place.min()), float(cut.place.max())
    ends = ((0.0, start), (0.0, end)) if cut.axis == "x" else ((start, 0.0), (end, 0.0))
    model.add_line(*ends, dxfattribs={"layer": "BIFOCAL_GRID"})
    add_text(model, f"section {cut.name}", ends[0], 3 * scale / 1000, "BIFOCAL_SECTIONS")
    with atomic_path(path, overwrite=overwrite) as temporary:
        save_drawing(document, temporary)


def write_section_svg(path: Path, cut: Section, *, scale: float, overwrite: bool) -> None:
    """Write one section as SVG that prints at 1:scale, with its reference line and a scale bar."""
    factor = 1000.0 / scale
    pieces = [piece * factor for piece in cut.pieces()]
    every = np.concatenate(pieces)
    low, high = np.minimum(every.min(axis=0), 0), np.maximum(every.max(axis=0), 0)
    margin, foot = 10.0, 16.0
    bar = round_step(0.05 * scale)
    width = max(high[0] - low[0], bar * factor) + 2 * margin
    height = high[1] - low[1] + 2 * margin + foot

    def place(x: float, y: float) -> str:
        return f"{x - low[0] + margin:.3f},{high[1] - y + margin:.3f}"

    lines = "\n".join(
        f'<polyline points="{" ".join(place(x, y) for x, y in piece.tolist())}"/>'
        for piece in pieces
    )
    along = np.array([0.0, 1.0] if cut.axis == "x" else [1.0, 0.0])  # the reference line
    ends = (function(every @ along) * along for function in (np.min, np.max))
    zero = " ".join(place(*end.tolist()) for end in ends)
    y = height - 6
    tenth = bar * factor / 5
    boxes = "".join(
        f'<rect x="{margin + i * tenth:.3f}" y="{y - 2:.3f}" width="{tenth:.3f}" height="2" '
        f'fill="{"#000" if i % 2 == 0 else "#fff"}" stroke="#000" stroke-width="0.15"/>'
        for i in range(5)
    )
    text = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="0 0 {width:.3f} {height:.3f}">\n'
        f'<rect width="100%" height="100%" fill="#fff"/>\n'
        f'<polyline points="{zero}" fill="none" stroke="#888" stroke-width="0.15" '
        f'stroke-dasharray="2 1"/>\n'
        f'<g fill="none" stroke="#000" stroke-width="0.25">\n{lines}\n</g>\n'
        f"{boxes}\n"
        f'<g font-family="Helvetica, Arial, sans-serif" font-size="2.6">'
        f'<text x="{margin}" y="{y - 3.2:.3f}">section {escape(cut.name)}, 1:{scale:g}</text>'
        f'<text x="{margin}" y="{y + 3.2:.3f}">0</text>'
        f'<text x="{margin + 5 * tenth:.3f}" y="{y + 3.2:.3f}">{bar:g} m</text></g>\n</svg>\n'
    )
    with atomic_path(path, overwrite=overwrite) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _new(scale: float) -> tuple[Any, Any]:
    """Return a drawing whose points are crosses in circles of 3 mm on paper."""
    return new_drawing(LAYERS, point_style=34, point_size=3 * scale / 1000)


def _points(model: Any, points: SurveyPoints | None, layer: str, height: float) -> None:
    if points is None:
        return
    for name, place in zip(points.ids, points.xyz.tolist(), strict=True):
        if not np.isfinite(place[:2]).all():
            continue
        relief = place[2] if np.isfinite(place[2]) else 0.0  # left blank: on the wall
        model.add_point((*place[:2], relief), dxfattribs={"layer": layer})
        label = (place[0] + height / 2, place[1] + height / 2)
        add_text(
            model, name, label, height, "BIFOCAL_NAMES" if layer == "BIFOCAL_POINTS" else layer
        )


def _scale_bar(model: Any, drawing: Drawing, paper: float) -> None:
    xmin, ymin, _, _ = drawing.grid.bounds
    length = drawing.bar_length()
    y, high = ymin - 10 * paper, 2 * paper
    layer = "BIFOCAL_SCALEBAR"
    style = {"layer": layer}
    for part in range(5):
        a, b = xmin + length * part / 5, xmin + length * (part + 1) / 5
        corners = [(a, y), (b, y), (b, y + high), (a, y + high)]
        if part % 2 == 0:
            model.add_solid([corners[0], corners[1], corners[3], corners[2]], dxfattribs=style)
        model.add_lwpolyline(corners, close=True, dxfattribs=style)
    for share, text in ((0.0, "0"), (0.2, f"{length / 5:g}"), (1.0, f"{length:g} m")):
        add_text(
            model, text, (xmin + length * share, y + 1.5 * high), 2.4 * paper, "BIFOCAL_SCALEBAR"
        )
    title = f"{drawing.title}, 1:{drawing.scale:g}"
    add_text(model, title, (xmin, y - 4 * paper), 2.4 * paper, "BIFOCAL_SCALEBAR")
