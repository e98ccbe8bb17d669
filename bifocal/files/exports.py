"""Surveyed points for other programs: DXF, PLY, LAS, CSV, GeoJSON, workbook."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from bifocal.model.points import SurveyPoints
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import InputError
from photocore.output import atomic_path
from photocore.tables import write_csv
from photocore.workbook.newbook import new_workbook

#: Point lists as surveyors name them: P point, N north, E east, Z height, D description.
ORDERS = ("PNEZD", "PENZD")
#: Layers of the drawing; uncertain points get their own, so that they can be switched off.
LAYERS: Mapping[str, int] = {
    "BIFOCAL_POINTS": 7,
    "BIFOCAL_NAMES": 3,
    "BIFOCAL_RELIEF": 5,
    "BIFOCAL_UNCERTAIN": 1,
}
UNCERTAIN_FLAGS = frozenset({"UNCERTAIN", "NADIR", "OFF-RADIAL", "CHECK"})


def export_points(
    path: Path | str,
    points: SurveyPoints,
    *,
    world: bool = False,
    order: str = "PNEZD",
    flavour: str = "plain",
    overwrite: bool = False,
) -> tuple[str, ...]:
    """Write points in the format that the file's ending names.

    Parameters
    ----------
    path : path
        ``.dxf .ply .las .laz .csv .geojson .xlsx``
    points : SurveyPoints
        Points without coordinates are left out, and said so.
    world : bool
        E, N, H instead of X, Y, r.
    order : str
        Column order of a .csv: ``PNEZD`` or ``PENZD``. In the plane frame N is Y, E is X, Z is r.
    flavour : str
        ``plain``, ``excel-it`` or ``excel-de``: delimiter, decimal sign and encoding of a .csv.
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
    writers: dict[str, Callable[[Path, SurveyPoints, FloatArray], None]] = {
        ".dxf": _write_dxf,
        ".ply": _write_ply,
        ".las": _write_las,
        ".laz": _write_las,
        ".geojson": _write_geojson,
        ".xlsx": _write_xlsx,
        ".csv": lambda p, s, c: _write_csv(p, s, c, order=order, flavour=flavour),
    }
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise InputError(f"{path}: ending not known; use one of {' '.join(writers)}.")
    if world and points.world is None:
        raise InputError(
            "the survey has no world coordinates; fill the Georeference sheet and solve again, "
            "or export in the plane frame."
        )
    coordinates = points.world if world and points.world is not None else points.xyz
    keep: BoolArray = np.all(np.isfinite(coordinates), axis=1)
    if not keep.any():
        raise InputError("no point has coordinates; run `bifocal solve` first.")
    remarks = []
    if not keep.all():
        missing = [name for name, wanted in zip(points.ids, keep, strict=True) if not wanted]
        shown = ", ".join(missing[:10]) + (" ..." if len(missing) > 10 else "")
        remarks.append(f"{len(missing)} point(s) without coordinates left out: {shown}")
    output = new_workbook if path.suffix.lower() == ".xlsx" else atomic_path
    with output(path, overwrite=overwrite) as temporary:
        writer(temporary, points.take(keep), coordinates[keep])
    return tuple(remarks)


def _write_dxf(path: Path, points: SurveyPoints, coordinates: FloatArray) -> None:
    """Write an R2010 drawing in metres: a POINT, its name and its relief for each point."""
    import ezdxf
    from ezdxf import units

    drawing = ezdxf.new("R2010", setup=True)
    drawing.units = units.M
    drawing.header["$PDMODE"] = 3  # points drawn as crosses
    for layer, colour in LAYERS.items():
        drawing.layers.add(layer, color=colour)
    extent = float(np.ptp(coordinates[:, :2], axis=0).max())
    height = max(0.01, round(extent / 150, 3))
    drawing.header["$PDSIZE"] = height
    model = drawing.modelspace()
    for i, place in enumerate(coordinates.tolist()):
        uncertain = points.flags[i] in UNCERTAIN_FLAGS
        layer = "BIFOCAL_UNCERTAIN" if uncertain else "BIFOCAL_POINTS"
        model.add_point(place, dxfattribs={"layer": layer})
        x, y, z = place
        labels = (
            ("BIFOCAL_NAMES", points.ids[i], 0.4),
            ("BIFOCAL_RELIEF", f"{points.xyz[i, 2]:+.3f}", -1.4),
        )
        for label_layer, text, lift in labels:
            model.add_text(
                text.replace("\n", " "),
                height=height,
                dxfattribs={"layer": label_layer, "insert": (x + height / 2, y + lift * height, z)},
            )
    drawing.saveas(path)


def _write_ply(path: Path, points: SurveyPoints, coordinates: FloatArray) -> None:
    """Write a binary PLY with x y z, sigma_r and uncertain (0/1)."""
    fields = [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("sigma_r", "<f4"), ("uncertain", "u1")]
    rows = np.zeros(len(points), dtype=fields)
    for axis, name in enumerate("xyz"):
        rows[name] = coordinates[:, axis]
    rows["sigma_r"] = points.sigma_r
    rows["uncertain"] = [flag in UNCERTAIN_FLAGS for flag in points.flags]
    kinds = {"<f8": "double", "<f4": "float", "u1": "uchar"}
    properties = "".join(f"property {kinds[kind]} {name}\n" for name, kind in fields)
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment metres\n"
        f"element vertex {len(rows)}\n{properties}end_header\n"
    )
    path.write_bytes(header.encode("ascii") + rows.tobytes())


def _write_las(path: Path, points: SurveyPoints, coordinates: FloatArray) -> None:
    """Write LAS 1.4 (or LAZ) with sigma_r as an extra dimension, to 0.1 mm."""
    import laspy

    header = laspy.LasHeader(point_format=6, version="1.4")
    header.offsets = np.floor(coordinates.min(axis=0))
    header.scales = np.full(3, 1e-4)
    header.add_extra_dim(
        laspy.ExtraBytesParams(name="sigma_r", type=np.float32, description="sigma of relief, m")
    )
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = coordinates.T
    cloud["sigma_r"] = points.sigma_r.astype(np.float32)
    # ASPRS classes: 1 unclassified, 7 low point (noise).
    cloud.classification = np.array(
        [7 if flag in UNCERTAIN_FLAGS else 1 for flag in points.flags], dtype=np.uint8
    )
    cloud.write(str(path))


def _write_csv(
    path: Path, points: SurveyPoints, coordinates: FloatArray, *, order: str, flavour: str
) -> None:
    """Write a surveyor's point list without a heading line, comma-named order."""
    if order not in ORDERS:
        raise InputError(f"order: {order!r} is not one of {', '.join(ORDERS)}.")
    axes = {"E": coordinates[:, 0], "N": coordinates[:, 1], "Z": coordinates[:, 2]}
    notes = zip(points.flags, points.notes, strict=True)
    columns: dict[str, object] = {
        "P": list(points.ids),
        **{letter: axes[letter] for letter in order if letter in axes},
        "D": [f"{flag} {note}".strip() for flag, note in notes],
    }
    write_csv(
        path, columns, flavour=flavour, formats=dict.fromkeys("ENZ", ".4f"), headings=False,
        overwrite=True,
    )  # fmt: skip


def _write_geojson(path: Path, points: SurveyPoints, coordinates: FloatArray) -> None:
    """Write a FeatureCollection in the survey's own metres (a local frame, not longitudes)."""
    features = [
        {
            "type": "Feature",
            "id": points.ids[i],
            "geometry": {"type": "Point", "coordinates": place},
            "properties": {
                "id": points.ids[i],
                "relief": points.xyz[i, 2] if np.isfinite(points.xyz[i, 2]) else None,
                "sigma_r": points.sigma_r[i] if np.isfinite(points.sigma_r[i]) else None,
                "flag": points.flags[i],
                "note": points.notes[i],
            },
        }
        for i, place in enumerate(np.round(coordinates, 6).tolist())
    ]
    # GeoJSON knows only longitude and latitude; the older "crs" member says that these are not.
    crs = {"type": "name", "properties": {"name": "local engineering frame, metres"}}
    text = json.dumps({"type": "FeatureCollection", "crs": crs, "features": features}, indent=1)
    path.write_text(text, encoding="utf-8")


def _write_xlsx(path: Path, points: SurveyPoints, coordinates: FloatArray) -> None:  # noqa: ARG001
    """Write all coordinates as a plain table of values."""
    from openpyxl import Workbook
    from openpyxl.cell import WriteOnlyCell

    book = Workbook(write_only=True)
    sheet = book.create_sheet("Results")
    sheet.append(["id", "X", "Y", "Z", "E", "N", "H", "sigma_r", "flag", "note"])
    world = points.world if points.world is not None else np.full((len(points), 3), np.nan)
    for i, name in enumerate(points.ids):
        numbers = [*points.xyz[i], *world[i], points.sigma_r[i]]
        texts = []
        for text in (name, points.flags[i], points.notes[i]):
            cell = WriteOnlyCell(sheet, text)
            cell.data_type = "s"  # a name that starts with "=" stays a name
            texts.append(cell)
        cells = [float(value) if np.isfinite(value) else None for value in numbers]
        sheet.append([texts[0], *cells, texts[1], texts[2]])
    book.save(path)
