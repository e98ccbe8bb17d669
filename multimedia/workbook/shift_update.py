"""Shifted points put into the user's own workbook; all else stays byte for byte as it was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from multimedia.workbook.shift_points import ShiftPoints, ShiftResult, ShiftSetup
from multimedia.workbook.shift_workbook import CHART_DATA, table_values
from photocore.errors import InputError
from photocore.tables import Table, open_tables
from photocore.workbook.cells import CellValue
from photocore.workbook.editor import WorkbookEditor
from photocore.workbook.grid import SheetFile, TableArea, split_area
from photocore.workbook.result_columns import (
    OwnTable,
    ResultColumn,
    head_row,
    put_result_columns,
)

#: Columns added to a table that has none of them yet.
ADDED = ("Rbar", "dR", "Xbar", "Ybar", "flag")
#: Name of the headings of the results in a workbook of the user's own.
MARK = "multimedia_results"


def is_template(path: Path | str) -> bool:
    """Tell whether a workbook is one of ours, with formulas for the shift."""
    return WorkbookEditor(Path(path)).table("tblMM") is not None


def update_template(
    path: Path | str,
    out: Path,
    table: Table,
    rows: Sequence[int],
    setup: ShiftSetup,
    own: ShiftSetup,
    points: ShiftPoints,
    *,
    overwrite: bool,
) -> Path | None:
    """Store the results of the formulas, and the set-up where options changed it.

    Parameters
    ----------
    path, out : path
        The workbook and where the new one goes; may be the same.
    table : Table
        As read from it.
    rows : sequence of int
        Entry of the table of each point.
    setup, own : ShiftSetup
        Set-up used, and that of the workbook.
    points : ShiftPoints
        The points.
    overwrite : bool
        Replace an existing file.

    Returns
    -------
    Path or None
        The backup of a workbook changed in place.

    Raises
    ------
    InputError
        If the number of media differs or the file cannot be written.
    """
    editor = WorkbookEditor(Path(path))
    if len(setup.layers.indices) != len(own.layers.indices):
        raise InputError(
            f"{path}: its formulas are for {len(own.layers.indices)} media, the options give "
            f"{len(setup.layers.indices)}; add --new for a new workbook."
        )
    _store_setup(editor, setup, own)
    area = editor.table("tblMM")
    if area is None:
        raise InputError(f"{path}: has no table tblMM.")
    columns = area.headings()
    steps = sum(key[0] == "u" and key[1:].isdigit() for key in columns) - 1
    values = table_values(setup, points, len(points.ids), max(steps, 1))
    for key, column in columns.items():
        for position, row in enumerate(rows):
            if key in values and key not in ("id", "X", "Y", "Z", "R", "ZP"):
                editor.set_result(area.sheet, table.rows[row], column, values[key][position])
    _store_chart(editor, area, [table.rows[row] for row in rows], values)
    return editor.save(out, overwrite=overwrite)


def _store_chart(
    editor: WorkbookEditor,
    area: TableArea,
    rows: Sequence[int],
    values: Mapping[str, Sequence[CellValue]],
) -> None:
    """Store the numbers of the chart of our workbooks, which stand beside the table."""
    sheet, _, cells = editor.book.names.get(CHART_DATA, "").rpartition("!")
    if sheet.strip("'") != area.sheet:
        return
    top, left, bottom, _ = split_area(cells.replace("$", ""))
    for position, row in enumerate(rows):
        place = top + row - area.area[0] - 1
        if place <= bottom:
            for column, key in enumerate(("R_u", "dR"), start=left):
                value = values[key][position]
                shown = value if isinstance(value, int | float) else float("nan")
                editor.set_result(area.sheet, place, column, shown)


def add_columns(
    path: Path | str,
    out: Path,
    table: Table,
    rows: Sequence[int],
    points: ShiftPoints,
    result: ShiftResult,
    *,
    overwrite: bool,
) -> Path | None:
    """Write the shifted points beside the user's table, in columns of their own.

    Columns called Rbar, dR, Xbar, Ybar or flag are filled; those that are missing are added to
    the right of everything on the sheet, see `photocore.workbook.result_columns`.

    Parameters
    ----------
    path, out, table, rows, points, overwrite
        As in `update_template`.
    result : ShiftResult
        The shifted points.

    Returns
    -------
    Path or None
        As `update_template`.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    editor = WorkbookEditor(Path(path))
    grid = editor.grid(table.sheet).rows
    own = OwnTable(
        sheet=table.sheet,
        head=head_row(grid, table.columns, table.headings, table.rows[0]),
        rows=[table.rows[row] for row in rows],
        columns=table.columns,
    )
    columns = [
        ResultColumn(key=key, heading=key, values=[_shown(value) for value in values])
        for key, values in result.columns(points).items()
        if key in ADDED
    ]
    put_result_columns(editor, own, columns, mark=MARK, adopted=ADDED)
    return editor.save(out, overwrite=overwrite)


def _shown(value: str | np.float64) -> CellValue:
    """Return a result as a cell, blank where there is none."""
    if isinstance(value, str):
        return value
    return None if np.isnan(value) else float(value)


def _store_setup(editor: WorkbookEditor, setup: ShiftSetup, own: ShiftSetup) -> None:
    """Type changed set-up values into their named cells, and store what follows from them."""

    def named(given: ShiftSetup) -> dict[str, float]:
        values = {f"n_{i}": n for i, n in enumerate(given.layers.indices, start=1)}
        values |= {f"t_{i}": t for i, t in enumerate(given.layers.thicknesses, start=1)}
        return values | {"z_0": given.z0, "X_0": given.nadir[0], "Y_0": given.nadir[1]}

    book = open_tables(editor.path)
    places = book.names if isinstance(book, SheetFile) else {}
    before = named(own)
    changed = {name: value for name, value in named(setup).items() if value != before[name]}
    for name, value in changed.items():
        if name.casefold() not in places:
            raise InputError(
                f"{editor.path.name}: has no cell named {name}; add --new for a new workbook."
            )
        editor.put(*places[name.casefold()], value)
    lowest = min(setup.layers.indices)
    for i, index in enumerate(setup.layers.indices, start=1):
        k = lowest / index
        for name, value in ((f"k_{i}", k), (f"q_{i}", 1 - k * k)):
            if name in places:
                editor.set_result(*places[name], value)
