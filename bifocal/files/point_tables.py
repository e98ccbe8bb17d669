"""Surveyed points read from a result workbook or a text table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bifocal.model import Points
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError, WorkbookError
from photocore.tables import Column, Table, open_tables, read_named_values, read_table
from photocore.tables.convert import NOT_CALCULATED
from photocore.workbook import SheetFile

_COLUMNS = (
    Column("id", aliases=("Point", "Punto", "Punkt", "Name"), kind="text", required=True),
    Column("X", unit="m"),
    Column("Y", unit="m"),
    Column("Z", aliases=("r", "relief"), unit="m"),
    Column("E", aliases=("east",), unit="m"),
    Column("N", aliases=("north",), unit="m"),
    Column("H", aliases=("height",), unit="m"),
    *(Column(f"sigma_{axis}", unit="m") for axis in ("X", "Y", "r", "E", "N", "H")),
    *(Column(key) for key in ("cov_XY", "cov_EN")),
    Column("flag", kind="text"),
    Column("note", kind="text"),
)


def read_survey_points(path: Path | str) -> tuple[Points, tuple[str, ...]]:
    """Return the points of a result, and remarks.

    Parameters
    ----------
    path : path
        ``.xlsx .xlsm .ods`` with a table or sheet ``Results`` (else ``Points``), or ``.csv``;
        headings id, X, Y, Z and, where there, E, N, H, sigma_r, flag, note.

    Raises
    ------
    InputError, WorkbookError
        If the table is missing or cells are unusable; the message names them.
    """
    errors: list[CellError] = []
    book = open_tables(path)
    table = read_table(book, _COLUMNS, name="Results", errors=errors)
    if any(NOT_CALCULATED in str(error) for error in errors):
        name = Path(path).name
        raise InputError(remark("points.never_calculated", of=path, name=name))
    if errors:
        raise WorkbookError(errors)
    if not {"X", "Y", "Z"} <= table.present and not {"E", "N", "H"} <= table.present:
        raise InputError(remark("points.no_coordinates", of=path))
    world = np.column_stack([table.numbers(key) for key in "ENH"])
    named = np.array([bool(name) for name in table.texts("id")], dtype=bool)
    cov_xy, cov_en = table.numbers("cov_XY"), table.numbers("cov_EN")
    if isinstance(book, SheetFile) and "cov_XY" not in table.present:
        cov_xy, cov_en = _mixed(book, table)
    points = Points(
        ids=tuple(table.texts("id")),
        xyz=np.column_stack([table.numbers(key) for key in "XYZ"]),
        world=world if np.isfinite(world).any() else None,
        sigma_r=table.numbers("sigma_r"),
        flags=tuple(flag or "OK" for flag in table.texts("flag")),
        notes=tuple(table.texts("note")),
        sigma_xy=np.column_stack([table.numbers(f"sigma_{key}") for key in "XY"]),
        sigma_world=np.column_stack([table.numbers(f"sigma_{key}") for key in "ENH"]),
        cov_xy=cov_xy,
        cov_en=cov_en,
    )
    return points.take(named), tuple(table.remarks)


def _mixed(book: SheetFile, table: Table) -> tuple[FloatArray, FloatArray]:
    """Return the covariances of X with Y and of E with N that a survey workbook holds."""
    order = ("XX", "XY", "XZ", "XY", "YY", "YZ", "XZ", "YZ", "ZZ")
    blank = np.full(len(table), np.nan)
    if not any(area.name == "tblPoints" for area in book.tables):
        return blank, blank
    keys = (*dict.fromkeys(order), "EN")
    columns = [Column("id", kind="text"), *(Column(f"cov_{key}") for key in keys)]
    points = read_table(book, columns, name="Points", errors=[])
    place = {name: row for row, name in enumerate(points.texts("id")) if name}
    rows = np.array([place.get(name, len(points)) for name in table.texts("id")], dtype=np.int64)
    flat = np.stack([np.append(points.numbers(f"cov_{key}"), np.nan) for key in order], axis=-1)
    covariance = flat[rows].reshape(-1, 3, 3)
    if "cov_EN" in points.present:
        return covariance[:, 0, 1], np.append(points.numbers("cov_EN"), np.nan)[rows]
    # A workbook made by an older version, whose sigmas leave out the transformation.
    names = ["g_k", *(f"g_{i}{j}" for i in "12" for j in "123")]
    geo = read_named_values(book, [Column(n) for n in names], sheet="Georeference", errors=[])
    if not all(geo.has(name) for name in names):
        return covariance[:, 0, 1], blank
    numbers = np.array([geo.number(name) for name in names], dtype=np.float64)
    east, north = numbers[0] * numbers[1:].reshape(2, 3)
    return covariance[:, 0, 1], np.einsum("i,nij,j->n", east, covariance, north)
