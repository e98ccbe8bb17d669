"""Shifted points put into the user's own workbook; all else stays byte for byte as it was."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from multimedia.refraction import STEPS
from multimedia.remarks import remark
from multimedia.workbook.shift_files import MEDIA, ShiftInput
from multimedia.workbook.shift_points import ShiftPoints, ShiftSetup
from multimedia.workbook.shift_workbook import (
    CHART_DATA,
    media_cells,
    media_places,
    shift_columns,
    table_values,
)
from multimedia.workbook.words import WORDS
from photocore.errors import InputError
from photocore.tables import Table
from photocore.workbook import (
    BookBuilder,
    CellValue,
    OwnTable,
    ResultColumn,
    TableArea,
    WorkbookEditor,
    column_letters,
    head_row,
    make_numbers,
    place_of,
    plain_title,
    put_result_columns,
    quoted_title,
    split_area,
    split_cell,
)

#: Results that come first, and are taken over where a table has them already.
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
    _check_count(editor, len(own.layers.indices), setup)
    _store_setup(editor, setup, own)
    area = editor.table("tblMM")
    if area is None:
        raise InputError(f"{path}: has no table tblMM.")
    columns = area.headings()
    steps = sum(key[0] == "u" and key[1:].isdigit() for key in columns) - 1
    values = table_values(setup, points, max(steps, 1))
    for key, column in columns.items():
        for position, row in enumerate(rows):
            if key in values:
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
    if plain_title(sheet) != area.sheet:
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
    source: ShiftInput,
    rows: Sequence[int],
    setup: ShiftSetup,
    points: ShiftPoints,
    *,
    overwrite: bool,
) -> Path | None:
    """Put live formulas of the shift beside the user's table, and a sheet with camera and media.

    The columns Rbar, dR, Xbar, Ybar and flag come first, those that they are calculated from after
    them, to the right of everything on the sheet; see
    `photocore.workbook.changing.result_columns`. On the sheet of the
    media, values that stand in cells of the user's own refer to these.

    Parameters
    ----------
    path, out, rows, setup, points, overwrite
        As in `update_template`.
    source : ShiftInput
        What was read from the workbook.

    Returns
    -------
    Path or None
        As `update_template`.

    Raises
    ------
    InputError
        If the sheet of the media is for another number of them, or the file cannot be written.
    """
    editor, table = WorkbookEditor(Path(path)), source.table
    media = _media_sheet(editor, source, setup)
    make_numbers(editor, table, lambda _: 1.0)
    count = len(setup.layers.indices)
    places = media_places(count)

    grid = editor.grid(table.sheet).rows
    users_table = OwnTable(
        sheet=table.sheet,
        head=head_row(grid, table.columns, table.headings, table.rows[0]),
        rows=[table.rows[row] for row in rows],
        columns=table.columns,
    )
    formulas = shift_columns(
        count,
        STEPS,
        value=lambda name: _reference(media, *places[name]),
        given=table.columns.keys(),
    )
    values = table_values(setup, points, STEPS)
    columns = [
        ResultColumn(
            key=column.key, heading=column.key, values=values[column.key], formula=column.formula,
            number_format="" if column.key == "flag" else column.number_format,
        )
        for column in formulas
        if column.formula
    ]  # fmt: skip
    columns.sort(key=lambda column: column.key not in ADDED)
    put_result_columns(editor, users_table, columns, mark=MARK, adopted=ADDED)
    return editor.save(out, overwrite=overwrite)


def _media_sheet(editor: WorkbookEditor, source: ShiftInput, setup: ShiftSetup) -> str:
    """Return the title of the sheet of camera and media, made or brought up to date."""
    place = place_of(editor, MEDIA)
    values = _named(setup)
    editor.home = "" if place is None else place[0]
    if place is not None:
        title = place[0]
        count = sum(
            str(cells.get(1)).startswith("n_") for cells in editor.grid(title).rows.values()
        )
        _check_count(editor, count, setup)
        places = {name: (title, *at) for name, at in media_places(count).items()}
        for name, value in values.items():
            if editor.value_at(*places[name]) != value:
                editor.put(*places[name], value)
        _store_ratios(editor, setup, places)
        return title
    links = {}
    for name, (sheet, cell) in source.places.items():
        own = (sheet, *split_cell(cell))
        if name in values and editor.value_at(*own) == values[name]:
            links[name] = _reference(*own)
    book = BookBuilder(language="en", words=WORDS)
    media = media_cells(book, setup, links=links)
    media.finish(landscape=True, guarded=False)
    title = editor.free_title("Media")
    editor.add_sheets(book.parts(), {"Multimedia": title})
    editor.define(MEDIA, _reference(title, 5, 2))
    return title


def _reference(sheet: str, row: int, column: int) -> str:
    """Return what a formula calls a cell."""
    return f"{quoted_title(sheet)}!${column_letters(column)}${row}"


def _named(setup: ShiftSetup) -> dict[str, float]:
    """Return a set-up by the names of its cells."""
    values = {f"n_{i}": n for i, n in enumerate(setup.layers.indices, start=1)}
    values |= {f"t_{i}": t for i, t in enumerate(setup.layers.thicknesses, start=1)}
    return values | {"z_0": setup.z0, "X_0": setup.nadir[0], "Y_0": setup.nadir[1]}


def _check_count(editor: WorkbookEditor, count: int, setup: ShiftSetup) -> None:
    if len(setup.layers.indices) != count:
        given = len(setup.layers.indices)
        raise InputError(remark("shift.other_media", of=editor.path, count=count, given=given))


def _store_setup(editor: WorkbookEditor, setup: ShiftSetup, own: ShiftSetup) -> None:
    """Type changed set-up values into their named cells, and store what follows from them."""
    before = _named(own)
    for name, value in _named(setup).items():
        place = place_of(editor, name)
        if value == before[name]:
            continue
        if place is None:
            raise InputError(remark("shift.no_cell_named", of=editor.path.name, name=name))
        editor.put(*place, value)
    ratios = [f"{kind}_{i}" for kind in "kq" for i in range(1, len(setup.layers.indices) + 1)]
    places = {name: place for name in ratios if (place := place_of(editor, name)) is not None}
    _store_ratios(editor, setup, places)


def _store_ratios(
    editor: WorkbookEditor, setup: ShiftSetup, places: Mapping[str, tuple[str, int, int]]
) -> None:
    """Store the results of k = n_min / n and q = 1 - k^2 where they have cells."""
    lowest = min(setup.layers.indices)
    for i, index in enumerate(setup.layers.indices, start=1):
        k = lowest / index
        for name, value in ((f"k_{i}", k), (f"q_{i}", 1 - k * k)):
            if name in places:
                editor.set_result(*places[name], value)
