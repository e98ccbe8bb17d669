"""Surveyed points read from a result workbook or a text table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bifocal.model.points import SurveyPoints
from photocore.errors import CellError, InputError, WorkbookError
from photocore.tables import Column, read_table
from photocore.tables.convert import NOT_CALCULATED

_COLUMNS = (
    Column("id", aliases=("Point", "Punto", "Punkt", "Name"), kind="text", required=True),
    Column("X", unit="m"),
    Column("Y", unit="m"),
    Column("Z", aliases=("r", "relief"), unit="m"),
    Column("E", aliases=("east",), unit="m"),
    Column("N", aliases=("north",), unit="m"),
    Column("H", aliases=("height",), unit="m"),
    Column("sigma_r", unit="m"),
    Column("flag", kind="text"),
    Column("note", kind="text"),
)


def read_survey_points(path: Path | str) -> tuple[SurveyPoints, tuple[str, ...]]:
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
    table = read_table(path, _COLUMNS, name="Results", errors=errors)
    if any(NOT_CALCULATED in str(error) for error in errors):
        name = Path(path).name
        raise InputError(
            f"{path}: its results have never been calculated. Solve it first: bifocal solve {name} "
            "--out result.xlsx"
        )
    if errors:
        raise WorkbookError(errors)
    if not {"X", "Y", "Z"} <= table.present and not {"E", "N", "H"} <= table.present:
        raise InputError(
            f"{path}: the table has neither X, Y, Z nor E, N, H; run `bifocal solve` first."
        )
    world = np.column_stack([table.numbers(key) for key in "ENH"])
    named = np.array([bool(name) for name in table.texts("id")], dtype=bool)
    points = SurveyPoints(
        ids=tuple(table.texts("id")),
        xyz=np.column_stack([table.numbers(key) for key in "XYZ"]),
        world=world if np.isfinite(world).any() else None,
        sigma_r=table.numbers("sigma_r"),
        flags=tuple(flag or "OK" for flag in table.texts("flag")),
        notes=tuple(table.texts("note")),
    )
    return points.take(named), tuple(table.remarks)
