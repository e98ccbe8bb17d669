"""Surveyed points for other programs: DXF, PLY, LAS, CSV, GeoJSON, workbook."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bifocal.files.dxf import add_ellipse, add_text, layer_name, new_drawing, save_drawing
from bifocal.model import PointLine, Points
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, not_negative
from photocore.camera import Similarity, fit_similarity
from photocore.cloud import write_cloud
from photocore.errors import GeometryError, InputError
from photocore.output import atomic_path
from photocore.tables import write_csv
from photocore.tables.csvwrite import Columns
from photocore.workbook import CellValue, finish_book, new_workbook, plain_cell

if TYPE_CHECKING:
    from openpyxl import Workbook

#: Point lists as surveyors name them: P point, N north, E east, Z height, D description.
ORDERS = ("PNEZD", "PENZD")
#: Layers of the drawing; uncertain points get their own, so that they can be switched off.
LAYERS: Mapping[str, int] = {
    "BIFOCAL_POINTS": 7,
    "BIFOCAL_NAMES": 3,
    "BIFOCAL_RELIEF": 5,
    "BIFOCAL_UNCERTAIN": 1,
}
#: The layer of the error ellipses says how many times one sigma they are drawn.
ELLIPSES = "BIFOCAL_ELLIPSES_X{:g}"
UNCERTAIN_FLAGS = frozenset({"UNCERTAIN", "NADIR", "OFF-RADIAL", "CHECK"})


def export_points(
    path: Path | str,
    points: Points,
    *,
    world: bool = False,
    order: str = "PNEZD",
    flavour: str = "plain",
    ellipses: float = 10.0,
    lines: Sequence[PointLine] = (),
    overwrite: bool = False,
) -> tuple[str, ...]:
    """Write points in the format that the file's ending names.

    Parameters
    ----------
    path : path
        ``.dxf .ply .las .laz .csv .geojson .xlsx``
    points : Points
        Points without coordinates are left out, and said so.
    world : bool
        E, N, H instead of X, Y, r.
    order : str
        Column order of a .csv: ``PNEZD`` or ``PENZD``. In the plane frame N is Y, E is X, Z is r.
    flavour : str
        ``plain``, ``excel-it`` or ``excel-de``: delimiter, decimal sign and encoding of a .csv.
    ellipses : float
        How many times one sigma the error ellipses of a .dxf are drawn; 0 for none.
    lines : sequence of PointLine
        Polylines of a .dxf, in space; points without coordinates are left out of them.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    remarks : tuple of str
        What the user should know, e.g. which points were left out.

    Raises
    ------
    InputError
        If the ending is unknown, no point has coordinates, or the file cannot be written.
    """
    path = Path(path)
    ending = path.suffix.lower()
    drawn = (not_negative(ellipses, "ellipses"), world)
    writers: dict[str, Callable[[Path, Points, FloatArray], None]] = {
        ".dxf": partial(_write_dxf, drawn=drawn, lines=lines),
        ".geojson": partial(_write_geojson, world=world),
        ".xlsx": _write_xlsx,
    }
    if ending not in writers and ending not in (".ply", ".las", ".laz", ".csv"):
        raise InputError(remark("export.unknown_ending", of=path))
    if world and points.world is None:
        raise InputError(remark("export.no_world"))
    coordinates = points.world if world and points.world is not None else points.xyz
    keep: BoolArray = np.all(np.isfinite(coordinates), axis=1)
    if not keep.any():
        raise InputError("no point has coordinates; run `bifocal solve` first.")
    remarks = []
    if not keep.all():
        missing = [name for name, use in zip(points.ids, keep, strict=True) if not use]
        shown = ", ".join(missing[:10]) + (" ..." if len(missing) > 10 else "")
        remarks.append(remark("export.left_out", count=len(missing), names=shown))
    points, coordinates = points.take(keep), coordinates[keep]
    if ending == ".csv":
        _write_csv(path, points, coordinates, order=order, flavour=flavour, overwrite=overwrite)
    elif ending in writers:
        output = new_workbook if ending == ".xlsx" else atomic_path
        with output(path, overwrite=overwrite) as temporary:
            writers[ending](temporary, points, coordinates)
    else:
        uncertain = np.array([flag in UNCERTAIN_FLAGS for flag in points.flags], dtype=np.uint8)
        attributes = {
            key: values.astype(np.float32)
            for key, values in points.sigmas.items()
            if np.isfinite(values).any() or key == "sigma_r"
        }
        write_cloud(
            path, coordinates, attributes | {"uncertain": uncertain},
            descriptions={key: f"{key.replace('_', ' of ')}, m" for key in attributes}
            | {"sigma_r": "sigma of relief, m"},
            overwrite=overwrite,
        )  # fmt: skip
    return tuple(remarks)


def write_shifts(
    path: Path, picks: FloatArray, feet: FloatArray, places: FloatArray, *, overwrite: bool = False
) -> None:
    """Write how far parts of photo 1 must be moved, for programs that warp images.

    Parameters
    ----------
    path : path
        ``.points``: ground control points of QGIS, which lie on the wall, in metres. ``.txt``:
        from where to where, as ``-distort`` of ImageMagick takes them.
    picks, feet : ndarray, shape (n, 2)
        From where to where. [px]
    places : ndarray, shape (n, 2)
        X, Y on the wall. [m]
    overwrite : bool
        Replace an existing file.
    """
    # Both programs count from the corner of the first pixel.
    picks, feet = picks + 0.5, feet + 0.5
    head, rows = "", np.hstack([picks, feet])
    line = "{:.3f},{:.3f} {:.3f},{:.3f}\n"
    if path.suffix.lower() == ".points":
        head = "mapX,mapY,sourceX,sourceY,enable,dX,dY,residual\n"
        rows, line = np.hstack([places, picks * [1, -1]]), "{:.5f},{:.5f},{:.3f},{:.3f},1,0,0,0\n"
    with atomic_path(path, overwrite=overwrite) as temporary:
        text = head + "".join(line.format(*row) for row in rows.tolist())
        temporary.write_text(text, encoding="utf-8", newline="\n")


def _write_dxf(
    path: Path,
    points: Points,
    coordinates: FloatArray,
    *,
    drawn: tuple[float, bool],
    lines: Sequence[PointLine],
) -> None:
    """Write a drawing: a POINT, name, relief and error ellipse of each point; lines in space."""
    times, world = drawn
    layer_of_ellipses = ELLIPSES.format(times)
    ellipses = points.ellipses(world=world) * [times, times, 1.0]
    has_ellipses = times > 0 and bool(np.isfinite(ellipses).any())
    extent = float(np.ptp(coordinates[:, :2], axis=0).max())
    height = max(0.01, round(extent / 150, 3))
    layers = {**LAYERS, layer_of_ellipses: 8} if has_ellipses else LAYERS
    drawing, model = new_drawing(layers, point_style=3, point_size=height)
    for i, (x, y, z) in enumerate(coordinates.tolist()):
        uncertain = points.flags[i] in UNCERTAIN_FLAGS
        layer = "BIFOCAL_UNCERTAIN" if uncertain else "BIFOCAL_POINTS"
        model.add_point((x, y, z), dxfattribs={"layer": layer})
        left = x + height / 2
        add_text(model, points.ids[i], (left, y + 0.4 * height, z), height, "BIFOCAL_NAMES")
        if np.isfinite(points.xyz[i, 2]):  # a table of E, N, H alone has none
            relief = f"{points.xyz[i, 2]:+.3f}"
            add_text(model, relief, (left, y - 1.4 * height, z), height, "BIFOCAL_RELIEF")
        if has_ellipses and np.isfinite(ellipses[i]).all() and ellipses[i, 1] > 0:
            add_ellipse(model, (x, y, z), ellipses[i], layer_of_ellipses)
    places = dict(zip(points.ids, coordinates.tolist(), strict=True))
    for line in lines:
        vertices = [*line.places] or [places[name] for name in line.ids if name in places]
        layer = layer_name(line.layer)
        if layer not in drawing.layers:
            drawing.layers.add(layer)
        if len(vertices) > 1:
            model.add_polyline3d(vertices, close=line.closed, dxfattribs={"layer": layer})
    save_drawing(drawing, path)


def _write_csv(
    path: Path, points: Points, coordinates: FloatArray, *, order: str, flavour: str,
    overwrite: bool,
) -> None:  # fmt: skip
    """Write a surveyor's point list without a heading line, comma-named order."""
    if order not in ORDERS:
        raise InputError(f"order: {order!r} is not one of {', '.join(ORDERS)}.")
    axes = {"E": coordinates[:, 0], "N": coordinates[:, 1], "Z": coordinates[:, 2]}
    notes = zip(points.flags, points.notes, strict=True)
    columns: Columns = {
        "P": list(points.ids),
        **{letter: axes[letter] for letter in order if letter in axes},
        "D": [f"{flag} {note}".strip() for flag, note in notes],
    }
    write_csv(
        path, columns, flavour=flavour, formats=dict.fromkeys("ENZ", ".4f"), headings=False,
        overwrite=overwrite,
    )  # fmt: skip


def _write_geojson(path: Path, points: Points, coordinates: FloatArray, *, world: bool) -> None:  # noqa: ARG001
    """Write a FeatureCollection in the survey's own metres (a local frame, not longitudes)."""
    path.write_text(json.dumps(points.to_geojson(world=world), indent=1), encoding="utf-8")


#: World coordinates follow from those of the wall where they do to this. [m]
_EXACT = 1e-6
#: A world coordinate by the cells of the sheet `World`.
_PLACED = "=w_{axis}+w_k*(w_{i}1*(B{row}-w_X)+w_{i}2*(C{row}-w_Y)+w_{i}3*(D{row}-w_Z))"


def _write_xlsx(path: Path, points: Points, coordinates: FloatArray) -> None:  # noqa: ARG001
    """Write all coordinates as a plain table, world coordinates as formulas where they can be."""
    from openpyxl import Workbook

    book = Workbook(write_only=True)
    sheet, results = book.create_sheet("Results"), dict[str, CellValue]()
    sigmas, fit = points.sigmas, _to_world(points)
    sheet.append(["id", "X", "Y", "Z", "E", "N", "H", *sigmas, "flag", "note"])
    world = points.world if points.world is not None else np.full((len(points), 3), np.nan)
    for row, name in enumerate(points.ids, start=2):
        i = row - 2
        numbers = [*points.xyz[i], *world[i], *(values[i] for values in sigmas.values())]
        values = (name, *numbers, points.flags[i], points.notes[i])
        cells = [plain_cell(sheet, value) for value in values]
        if fit is not None:
            cells[4:7] = [_PLACED.format(axis=a, i=k, row=row) for k, a in enumerate("ENH", 1)]
            results |= {f"{a}{row}": float(v) for a, v in zip("EFG", world[i], strict=True)}
        sheet.append(cells)
    if fit is not None:
        _add_world(book, fit)
    package = io.BytesIO()
    book.properties.creator = "bifocal"
    book.save(package)
    finish_book(package, path, results={"Results": results})


def _to_world(points: Points) -> Similarity | None:
    """Return what all world coordinates follow from; None where no similarity gives them."""
    if points.world is None or not np.isfinite(points.world).all():
        return None
    try:
        fit = fit_similarity(points.xyz, points.world)
    except GeometryError:
        return None
    return fit if np.abs(fit(points.xyz) - points.world).max() < _EXACT else None


def _add_world(book: Workbook, fit: Similarity) -> None:
    """Add the sheet whose named cells place the points in the world."""
    from openpyxl.workbook.defined_name import DefinedName

    cells = {"k": fit.scale, **dict(zip("XYZ", fit.source_centre.tolist(), strict=True))}
    cells |= dict(zip("ENH", fit.target_centre.tolist(), strict=True))
    cells |= {f"{i}{j}": float(fit.rotation[i - 1, j - 1]) for i in (1, 2, 3) for j in (1, 2, 3)}
    sheet = book.create_sheet("World")
    for row, (name, value) in enumerate(cells.items(), start=1):
        sheet.append([f"w_{name}", value])
        place = f"World!$B${row}"
        book.defined_names[f"w_{name}"] = DefinedName(f"w_{name}", attr_text=place)
