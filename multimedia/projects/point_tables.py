"""Tables of object points and image points, CSV or workbook, tolerant in and plain out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.media import Camera
from multimedia.projects.model import SHOWN, ImagePoints, ObjectPoints
from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError, WorkbookError
from photocore.names import did_you_mean, meant
from photocore.tables import Column, Table, open_tables, read_table, write_csv
from photocore.tables.axes import (
    COLUMNS_OF_PIXELS,
    EAST,
    HEIGHT,
    NAMES,
    NORTH,
    PHOTOS,
    ROWS_OF_PIXELS,
)
from photocore.tables.csvwrite import Cells, Columns

#: Metres per unit of length that a heading may name.
METRES: Mapping[str, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "km": 1e3}

_ID = Column("id", NAMES, kind="text")
_GROUP = Column("group", ("set", "plate", "frame", "gruppe", "gruppo", "code"), kind="text")
_PHOTO = ("cam", "photo", "kamera", "fotocamera", *PHOTOS)
_CAMERA = Column("camera", _PHOTO, kind="text", required=True)
_OBJECT = (
    _ID,
    Column("X", EAST, required=True, any_length=True),
    Column("Y", NORTH, required=True, any_length=True),
    Column("Z", (*HEIGHT, "depth"), required=True, any_length=True),
    Column("sigma_X", ("sX", "std X")),
    Column("sigma_Y", ("sY", "std Y")),
    Column("sigma_Z", ("sZ", "std Z")),
    _GROUP,
)
_IMAGE = (
    _CAMERA,
    _ID,
    Column("x", ("x mm", "x'"), unit="mm"),
    Column("y", ("y mm", "y'"), unit="mm"),
    Column("col", COLUMNS_OF_PIXELS, unit="px"),
    Column("row", ROWS_OF_PIXELS, unit="px"),
    Column("sigma_x", ("sx", "sigma")),
    Column("sigma_y", ("sy",)),
    _GROUP,
)


def read_object_points(path: Path, *, unit: str) -> tuple[ObjectPoints, list[str]]:
    """Read a table with id, X, Y, Z and, if there, sigma_X, sigma_Y, sigma_Z and group.

    Parameters
    ----------
    path : path
        .csv, .xlsx, .ods; found by heading.
    unit : str
        Unit wanted; headings with another unit are converted.

    Returns
    -------
    points : ObjectPoints
    remarks : list of str

    Raises
    ------
    InputError
        Naming every bad cell and every repeated id.
    """
    table = read_table(path, _OBJECT, name="ObjectPoints")
    errors: list[CellError] = []
    xyz = _gathered(table, ("X", "Y", "Z"), unit, errors)
    sigma = np.column_stack(
        [table.numbers(k) * _factor(table, k, unit) for k in ("sigma_X", "sigma_Y", "sigma_Z")]
    )
    for row, column in np.argwhere(sigma < 0).tolist():
        key = f"sigma_{'XYZ'[column]}"
        errors.append(table.error(row, key, "a standard deviation cannot be negative."))
    rows = table.once("id", xyz, errors)
    if errors:
        raise WorkbookError(errors)
    ids, groups = (tuple(np.array(t, object)[rows]) for t in (_ids(table), table.texts("group")))
    points = ObjectPoints(ids=ids, xyz=xyz[rows], sigma=sigma[rows], groups=groups)
    return points, list(table.remarks)


def read_image_points(path: Path, cameras: Sequence[Camera]) -> tuple[ImagePoints, list[str]]:
    """Read a table of image points.

    Either long, one row per camera and point: camera, id, and x, y [mm] or col, row [px]; or
    wide, one row per point with columns such as ``cam1 col``, ``cam1 row``, ``cam2 col``...

    Parameters
    ----------
    path : path
        .csv, .xlsx, .ods; found by heading.
    cameras : sequence of Camera
        Pixels need their sensors.

    Returns
    -------
    points : ImagePoints
    remarks : list of str

    Raises
    ------
    InputError
        Naming every bad cell.
    """
    book = open_tables(path)
    try:
        table = read_table(book, _IMAGE, name="ImagePoints")
    except WorkbookError:
        raise
    except InputError as error:
        wide = _read_wide(book, cameras)
        if wide is None:
            raise InputError(
                f"{error} A wide table needs columns such as {cameras[0].name} col and "
                f"{cameras[0].name} row for its cameras."
            ) from None
        return wide
    by_name = {camera.name: camera for camera in cameras}
    names = meant(table.texts("camera"), by_name)
    cameras_listed = ", ".join(list(by_name)[:SHOWN])
    errors = [
        table.error(
            row,
            "camera",
            f"no camera is called {name!r}{did_you_mean(name, by_name)}; known: {cameras_listed}.",
        )
        for row, name in enumerate(names)
        if name not in by_name
    ]
    if not ({"x", "y"} <= table.present or {"col", "row"} <= table.present):
        raise InputError(f"{path}: neither columns x and y [mm] nor col and row [px] were found.")
    in_mm = {"x", "y"} <= table.present
    keys = ("x", "y") if in_mm else ("col", "row")
    values = np.column_stack([table.numbers(key) for key in keys])
    blank = np.isnan(values).any(axis=1)
    for index in np.flatnonzero(blank).tolist():
        key = keys[int(np.isnan(values[index]).argmax())]
        errors.append(table.error(index, key, "is blank; leave the row out instead."))
    for key in ("sigma_x", "sigma_y"):
        for row in np.flatnonzero(table.numbers(key) <= 0).tolist():
            errors.append(table.error(row, key, "a standard deviation must be above zero."))
    if errors:
        raise WorkbookError(errors)
    if in_mm:
        values = values * [_factor(table, key, "mm") for key in keys]
    else:
        for name in dict.fromkeys(names):
            rows = np.array(names) == name
            values[rows] = by_name[name].described_sensor(_IN_PIXELS).image_from_pixel(values[rows])
    sigma, groups = _sigmas(table, keys, [by_name[n] for n in names]), table.texts("group")
    points = ImagePoints(
        cameras=tuple(names), ids=_ids(table), image=values, sigma=sigma, groups=tuple(groups)
    )
    return points, list(table.remarks)


def object_columns(points: ObjectPoints, unit: str) -> Columns:
    """Return the columns of a table of object points."""
    columns: Columns = {"id": points.ids}
    columns |= {f"{axis} [{unit}]": points.xyz[:, k] for k, axis in enumerate("XYZ")}
    return columns | _sigma_and_group(points, "XYZ", unit)


def image_columns(points: ImagePoints, cameras: Sequence[Camera]) -> Columns:
    """Return the columns of a table of image points, in pixels where every sensor is known."""
    columns: Columns = {"camera": points.cameras, "id": points.ids}
    sensors = {camera.name: camera.sensor for camera in cameras if camera.sensor is not None}
    if sensors.keys() >= set(points.cameras):
        pixels = np.array(points.image)
        for name in dict.fromkeys(points.cameras):
            rows = points.of_camera(name)
            pixels[rows] = sensors[name].pixel_from_image(points.image[rows])
        columns |= {"col [px]": pixels[:, 0], "row [px]": pixels[:, 1]}
    else:
        columns |= {"x [mm]": points.image[:, 0], "y [mm]": points.image[:, 1]}
    return columns | _sigma_and_group(points, "xy", "mm")


def _sigma_and_group(points: ObjectPoints | ImagePoints, axes: str, unit: str) -> Columns:
    """Return the columns that are written only where points have them."""
    columns: Columns = {}
    if np.isfinite(points.sigma).any():
        columns |= {f"sigma_{axis} [{unit}]": points.sigma[:, k] for k, axis in enumerate(axes)}
    return columns | ({"group": points.groups} if any(points.groups) else {})


def write_columns(path: Path, columns: Mapping[str, Cells], *, overwrite: bool) -> None:
    """Write columns as .csv or .xlsx, by the ending; NaN becomes an empty cell."""
    if path.suffix.lower() == ".csv":
        write_csv(path, columns, overwrite=overwrite)
        return
    if path.suffix.lower() != ".xlsx":
        raise InputError(f"{path}: tables are written as .csv or .xlsx; give one of these endings.")
    from openpyxl import Workbook

    from photocore.workbook import new_workbook, save_book

    book = Workbook()
    fill_sheet(book.active, list(columns), zip(*columns.values(), strict=True))
    with new_workbook(path, overwrite=overwrite) as temporary:
        save_book(book, temporary)


def fill_sheet(sheet: Any, headings: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table into an empty sheet: bold headings that stay in sight, then the rows."""
    from openpyxl.styles import Font

    from photocore.workbook import plain_cell

    sheet.append(list(headings))
    for cell in sheet[1]:
        cell.font = Font(bold=True)
    for row in rows:
        sheet.append([plain_cell(sheet, value) for value in row])
    sheet.freeze_panes = "A2"


def _ids(table: Table) -> tuple[str, ...]:
    """Return the ids; rows of a table without an id column are numbered from 1."""
    ids = table.texts("id")
    if "id" not in table.present:
        return tuple(str(k) for k in range(1, len(ids) + 1))
    errors = [
        table.error(row, "id", "is blank; every point needs a name.")
        for row, text in enumerate(ids)
        if not text
    ]
    if errors:
        raise WorkbookError(errors)
    return tuple(ids)


def _factor(table: Table, key: str, unit: str) -> float:
    """Return what converts a column to ``unit``; 1 where the heading says no length."""
    unit_typed = table.units.get(key, "")
    return METRES[unit_typed] / METRES[unit] if unit_typed in METRES and unit in METRES else 1.0


def _gathered(table: Table, keys: Sequence[str], unit: str, errors: list[CellError]) -> FloatArray:
    """Return columns side by side in ``unit``; blanks are complained about."""
    values = np.column_stack([table.numbers(key) for key in keys])
    for row, column in np.argwhere(np.isnan(values)):
        errors.append(table.error(int(row), keys[column], "is blank; give a number."))
    return values * [_factor(table, key, unit) for key in keys]


def _sigmas(table: Table, coordinates: Sequence[str], cameras: Sequence[Camera]) -> FloatArray:
    """Return sigma_x, sigma_y of every row [mm]; one column serves both.

    They are in the unit of their heading, and without one in that of the coordinates.
    """
    sigma = np.empty((len(table), 2))
    for axis, coordinate in enumerate(coordinates):
        key = f"sigma_{'xy'[axis]}" if "sigma_y" in table.present else "sigma_x"
        default_unit = "px" if coordinate in ("col", "row") else table.units.get(coordinate, "")
        unit = table.units.get(key, "") or default_unit
        factor = METRES.get(unit, METRES["mm"]) / METRES["mm"]
        sigma[:, axis] = table.numbers(key) * factor
        if unit == "px" and key in table.present:
            sigma[:, axis] *= [c.described_sensor(_IN_PIXELS).pixel_size[axis] for c in cameras]
    return sigma


_IN_PIXELS = (
    "image points are given in pixels, but its sensor is not described; add [camera.sensor] with "
    "width, height and pitch."
)


def _read_wide(book: object, cameras: Sequence[Camera]) -> tuple[ImagePoints, list[str]] | None:
    """Read one row per point with a pair of columns per camera; None if there are none."""
    units = {"col": "px", "row": "px", "x": "mm", "y": "mm"}
    of_cameras = (Column(f"{c.name} {key}", unit=units[key]) for c in cameras for key in units)
    columns = [_ID, _GROUP, *of_cameras]
    try:
        table = read_table(book, columns, name="ImagePoints")  # type: ignore[arg-type]
    except WorkbookError:
        raise
    except InputError:
        return None
    names: list[str] = []
    rows: list[int] = []
    images: list[FloatArray] = []
    for camera in cameras:
        for first, second in (("col", "row"), ("x", "y")):
            keys = (f"{camera.name} {first}", f"{camera.name} {second}")
            if not set(keys) <= table.present:
                continue
            values = np.column_stack([table.numbers(key) for key in keys])
            finite = np.flatnonzero(np.isfinite(values).all(axis=1))
            image = values[finite]
            if first == "col":
                image = camera.described_sensor(_IN_PIXELS).image_from_pixel(image)
            names += [camera.name] * len(finite)
            rows += finite.tolist()
            images.append(image)
            break
    if not images:
        return None
    ids, groups = (tuple(np.array(t, object)[rows]) for t in (_ids(table), table.texts("group")))
    image = np.concatenate(images)
    points = ImagePoints(cameras=tuple(names), ids=ids, image=image, groups=groups)
    return points, list(table.remarks)
