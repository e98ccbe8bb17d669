"""Drawings for CAD: the orthophoto in its place with all that belongs to it, and its sheet."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.files.dxf import add_line, add_text, dashed, new_drawing, save_drawing, turned
from bifocal.model.points import Points
from bifocal.orthophotos.contour_lines import contour_labels
from bifocal.orthophotos.drawing import TABLES, Drawing, PrintSheet, Section
from bifocal.orthophotos.dxf_canvas import DxfCanvas
from bifocal.orthophotos.sheet_margins import SheetMargins
from bifocal.orthophotos.tuning import CONTOURS, SHEET, SPOTS
from photocore.output import atomic_path

#: Layers of the points of a drawing, by what they are.
_POINTS = {"points": "BIFOCAL_POINTS", "control": "BIFOCAL_CONTROL", "check": "BIFOCAL_CHECK"}


def write_drawing(path: Path, drawing: Drawing, sheet: PrintSheet, image_name: str | None) -> None:
    """Write an R2010 drawing in metres with the image attached at its place, and its sheet.

    Parameters
    ----------
    sheet : PrintSheet
        Laid out in paper space, in millimetres, with a viewport at 1:scale.
    image_name : str, optional
        File of the picture beside the drawing.
    """
    # Points are crosses in circles of 3 mm on paper.
    document, model = new_drawing(
        TABLES["layers"], point_style=34, point_size=3 * drawing.scale / 1000
    )
    grid = drawing.grid
    xmin, ymin = grid.bounds[:2]
    if image_name is not None:
        definition = document.add_image_def(
            filename=image_name, size_in_pixel=(grid.width, grid.height)
        )
        # The insertion point is the lower left corner of the lower left pixel.
        model.add_image(
            definition,
            insert=(xmin, ymin),
            size_in_units=(grid.width * grid.gsd, grid.height * grid.gsd),
            # Shown, also where turned; transparent where the picture is empty.
            dxfattribs={"layer": "BIFOCAL_IMAGE", "flags": 1 | 2 | 8},
        )
    paper = drawing.scale / 1000.0  # metres on the wall per millimetre on paper
    arm, on_grid = 2 * paper, {"layer": "BIFOCAL_GRID"}
    for x, y in drawing.crosses().tolist():
        model.add_line((x - arm, y), (x + arm, y), dxfattribs=on_grid)
        model.add_line((x, y - arm), (x, y + arm), dxfattribs=on_grid)
        beside = (x + 0.5 * paper, y + 0.5 * paper)
        add_text(model, f"{x:g} / {y:g}", beside, 1.6 * paper, "BIFOCAL_GRID")
    _scale_bar(model, drawing, paper)
    for role, layer in _POINTS.items():
        _points(model, getattr(drawing, role, None) or drawing.cad.get(role), layer, 2.0 * paper)
    _contours(model, drawing, paper)
    for x, y, words in drawing.spot_words():
        model.add_point((x, y), dxfattribs={"layer": "BIFOCAL_SPOT_HEIGHTS"})
        add_text(model, words, (x + paper, y + 0.5 * paper), 0.72 * SPOTS.size * paper,
                 "BIFOCAL_SPOT_HEIGHTS")  # fmt: skip
    for cut in drawing.sections:
        style = {"layer": "BIFOCAL_SECTION_LINES", **dashed(model, "DASHDOT", SHEET.cut * paper)}
        model.add_lwpolyline(cut.path.tolist(), dxfattribs=style)
        _section_names(model, drawing, cut, paper)
        for measured, line in cut.in_space():
            layer = "BIFOCAL_SECTIONS" if measured else "BIFOCAL_SECTIONS_GUESSED"
            model.add_polyline3d(line.tolist(), dxfattribs={"layer": layer})
    _lay_out(document, drawing, sheet)
    name_layers(document, drawing.layers, drawing.language)
    with atomic_path(path, overwrite=False) as temporary:
        save_drawing(document, temporary)


def name_layers(document: Any, manner: str, language: str) -> None:
    """Call the layers of a drawing as a country does: ``language``, ``ncs``; else as they are."""
    manner = language if manner == "language" else manner
    for name, names in TABLES["layer_names"].items():
        if manner in names and name in document.layers:
            document.layers.get(name).rename(names[manner])


def _contours(model: Any, drawing: Drawing, paper: float) -> None:
    for contour in drawing.contours:
        layer = "BIFOCAL_CONTOURS_INDEX" if contour.index else "BIFOCAL_CONTOURS"
        style: dict[str, object] = {"layer": layer, "elevation": contour.level}
        style["lineweight"] = 25 if contour.index else 9
        add_line(model, contour.line.tolist(), style)
    for label in contour_labels(drawing.contours, drawing.scale):
        # Above the line, for nothing hides the line behind a text of CAD.
        turn, lift = math.radians(label.angle), (0.36 * CONTOURS.label_size + SHEET.above) * paper
        place = label.place[0] - lift * math.sin(turn), label.place[1] + lift * math.cos(turn)
        entity = add_text(
            model, label.words, place, CONTOURS.label_size * paper, "BIFOCAL_CONTOUR_TEXT"
        )
        turned(entity, label.angle, middle=True)


def _section_names(model: Any, drawing: Drawing, cut: Section, paper: float) -> None:
    """Write a section's letter beyond both its ends, off its line, with the way one looks.

    Those at the edge of the picture on a layer that the sheet, which has its own, does not show.
    """
    look = cut.looking()
    side = np.array([-look[1], look[0]])
    for end, outwards in cut.ends():
        layer = "BIFOCAL_SECTION_NAMES" if drawing.at_the_edge(end) else "BIFOCAL_SECTION_LINES"
        tip = end + 3 * paper * outwards
        place = (float(tip[0]), float(tip[1]) - 1.25 * paper)
        entity = add_text(model, cut.letter, place, 2.5 * paper, layer)
        turned(entity, 0.0, middle=True)
        foot = tip + 2 * paper * look
        corners = [foot - 0.8 * paper * side, foot + 0.8 * paper * side, foot + 1.4 * paper * look]
        model.add_solid([corner.tolist() for corner in corners], dxfattribs={"layer": layer})


def _lay_out(document: Any, drawing: Drawing, sheet: PrintSheet) -> None:
    """Draw the sheet in paper space: its margins, and the model through a viewport at 1:scale."""
    name = sheet.title(drawing.say)
    document.layouts.rename("Layout1", name)
    layout = document.paperspace(name)
    layout.page_setup(size=(sheet.width, sheet.height), margins=(0, 0, 0, 0), units="mm")
    (x, y), (wide, high) = sheet.origin(drawing), drawing.paper_size
    xmin, ymin, xmax, ymax = drawing.grid.bounds
    window = layout.add_viewport(
        center=(x + wide / 2, y + high / 2),
        size=(wide, high),
        view_center_point=((xmin + xmax) / 2, (ymin + ymax) / 2),
        view_height=ymax - ymin,
        dxfattribs={"layer": "BIFOCAL_VIEWPORT"},
    )
    document.layers.get("BIFOCAL_VIEWPORT").dxf.plot = 0
    # These stand on the sheet, outside of the grid's numbers.
    window.frozen_layers = ["BIFOCAL_SECTION_NAMES"]
    # What lies on a viewport may be drawn under it.
    SheetMargins(DxfCanvas(layout), drawing, sheet, within=False).draw()


def _points(model: Any, points: Points | None, layer: str, height: float) -> None:
    if points is None:
        return
    for name, place in zip(points.ids, points.xyz.tolist(), strict=True):
        if not np.isfinite(place[:2]).all():
            continue
        relief = place[2] if np.isfinite(place[2]) else 0.0  # left blank: on the wall
        model.add_point((*place[:2], relief), dxfattribs={"layer": layer})
        # Names of known points stand below: those solved, above, mostly have the same.
        below = 0.0 if layer == "BIFOCAL_POINTS" else 2.0 * height
        label = (place[0] + height / 2, place[1] + height / 2 - below)
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
