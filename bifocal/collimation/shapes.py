"""What is drawn on the wall: faces, break lines and occluders for the relief, outlines to measure.

Corners are kept as pixels of photo 1 with the relief there, so that they follow the photo and not
an orientation; their X, Y on the wall follow from the pair.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bifocal import rays
from bifocal.collimation.records import DrawnShape, SurveyState
from bifocal.faces import BreakLine, Face, Faces, Occluder, beside
from bifocal.model import Pair, ReliefMap
from photocore.arrays import FloatArray

#: Rounds in which relief and place settle where a ray meets a relief map.
ROUNDS = 6
#: Layer of outlines that were given none.
OUTLINES = "outlines"


def places_of(pair: Pair, corners: Sequence[Sequence[float]]) -> FloatArray:
    """Return X, Y, r of corners (column, row, r) of photo 1, shape (n, 3). [m]"""
    array = np.array(corners, dtype=np.float64)
    return _at_relief(pair, array[:, :2], array[:, 2])


def _at_relief(pair: Pair, pixels: FloatArray, relief: FloatArray) -> FloatArray:
    """Return where the rays of photo 1 are at a relief, shape (n, 3). [m]"""
    photo = pair.image1
    apparent = photo.apparent_from_pixels(pixels)
    rays_ = rays.object_rays(apparent, photo.foot)
    return np.column_stack([rays_.position + relief[:, None] * rays_.slope, relief])


def corners_of(pair: Pair, places: FloatArray) -> FloatArray:
    """Return column, row, r of places X, Y, r in photo 1, shape (n, 3)."""
    return np.column_stack([pair.project(places)[0], places[:, 2]])


def met(pair: Pair, relief: ReliefMap, pixels: FloatArray) -> FloatArray:
    """Return X, Y, r where rays of photo 1 meet a relief map, shape (n, 3); r NaN where unknown."""
    r: FloatArray = np.zeros(len(pixels))
    for _ in range(ROUNDS):
        places = _at_relief(pair, pixels, np.nan_to_num(r))
        r = relief.sample(places[:, :2])
    places[:, 2] = r
    return places


def relief_within(pair: Pair, relief: ReliefMap, pixels: FloatArray) -> float | None:
    """Return the median relief within a polygon of photo 1; None where none is known. [m]"""
    import cv2

    low, high = pixels.min(axis=0), pixels.max(axis=0)
    step = max(float((high - low).max()) / 60, 1.0)
    columns, rows = (np.arange(a, b + step, step) for a, b in zip(low, high, strict=True))
    grid = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
    ring = pixels.astype(np.float32)
    inside = [cv2.pointPolygonTest(ring, tuple(map(float, place)), False) >= 0 for place in grid]
    relief_met = met(pair, relief, grid[np.array(inside)])[:, 2] if any(inside) else np.array([])
    finite = relief_met[np.isfinite(relief_met)]
    return float(np.median(finite)) if len(finite) else None


def outlines_of(state: SurveyState, pair: Pair) -> dict[str, dict[str, object]]:
    """Return layer and measures of what was drawn to be measured, by its name. [m, m2]"""
    return {
        shape.name: {"layer": shape.layer or OUTLINES, **measures_of(shape, pair)}
        for shape in state.shapes.values()
        if shape.kind == "outline"
    }


def faces_of(state: SurveyState, pair: Pair) -> Faces:
    """Return what was drawn for the relief, in X, Y of the plane frame."""
    faces: list[Face] = []
    breaks: list[BreakLine] = []
    occluders: list[Occluder] = []
    for shape in state.shapes.values():
        if shape.kind == "outline":
            continue
        places = places_of(pair, shape.corners)
        ring = np.ascontiguousarray(places[:, :2])
        if shape.kind == "face":
            plane = np.array([float(np.median(places[:, 2])), 0.0, 0.0])
            faces.append(Face(name=shape.name, rings=(ring,), plane=plane))
        elif shape.kind == "break":
            breaks.append(BreakLine(name=shape.name, line=places))
        else:
            flat = places_of(pair, [(column, row, 0.0) for column, row, _ in shape.corners])
            occluders.append(Occluder(name=shape.name, rings=(flat[:, :2],)))
    return Faces(tuple(faces), tuple(breaks), tuple(occluders))


def keep_faces(state: SurveyState, pair: Pair, file: Path) -> None:
    """Write what was drawn beside the pair file, where every later run finds it."""
    path, faces = beside(file), faces_of(state, pair)
    if len(faces):
        faces.write(path, overwrite=True)
    else:
        path.unlink(missing_ok=True)


def shapes_from(faces: Faces, pair: Pair) -> list[dict[str, object]]:
    """Return faces of a file or a suggestion as the page draws them: name, kind, corners, mends."""
    shapes: list[dict[str, object]] = []
    for face in faces.faces:
        plane = np.zeros(3) if face.plane is None else face.plane
        ring = face.rings[0]
        relief = plane[0] + ring @ plane[1:]
        shapes.append(
            {"name": face.name, "kind": "face", "mends": face.mends}
            | _drawn(pair, np.column_stack([ring, relief]))
        )
    for edge in faces.breaks:
        places = np.column_stack([edge.line[:, :2], np.nan_to_num(edge.line[:, 2])])
        shapes.append({"name": edge.name, "kind": "break"} | _drawn(pair, places))
    for one in faces.occluders:
        ring = one.rings[0]
        places = np.column_stack([ring, np.zeros(len(ring))])
        shapes.append({"name": one.name, "kind": "occluder"} | _drawn(pair, places))
    return shapes


def commands_for(faces: Faces, state: SurveyState, pair: Pair) -> list[dict[str, object]]:
    """Return the commands that make the survey's faces those of a file; none if they are."""
    if faces.to_dict() == faces_of(state, pair).to_dict():
        return []
    gone = [shape.name for shape in state.shapes.values() if shape.kind != "outline"]
    commands: list[dict[str, object]] = [{"op": "shape.delete", "name": name} for name in gone]
    for shape in shapes_from(faces, pair):
        name = {"name": shape["name"]} if shape["name"] else {}
        corners = {"kind": shape["kind"], "corners": shape["corners"]}
        commands.append({"op": "shape.set", **corners, **name})
    return commands


def _drawn(pair: Pair, places: FloatArray) -> dict[str, object]:
    return {"corners": corners_of(pair, places).round(3).tolist()}


def measures_of(shape: DrawnShape, pair: Pair) -> dict[str, object]:
    """Return X, Y, r of a shape's corners, and width, height, area and length as seen square on."""
    places = places_of(pair, shape.corners)
    x, y = places[:, 0], places[:, 1]
    closed = shape.kind != "break"
    around = np.vstack([places, places[:1]]) if closed else places
    area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2 if closed else None
    return {
        "places": places.round(4).tolist(),
        "width": float(np.ptp(x)),
        "height": float(np.ptp(y)),
        "area": area,
        "length": float(np.linalg.norm(np.diff(around[:, :2], axis=0), axis=1).sum()),
        "relief": float(np.median(places[:, 2])),
    }
