"""Single cells of a workbook that is changed in place: by name, and only where they differ."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from photocore.tables.model import Table
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.reading.grid import Value, plain_title, split_cell


def place_of(editor: WorkbookEditor, name: str) -> tuple[str, int, int] | None:
    """Return sheet, row and column of a named cell; None where the name leads to no single cell."""
    place = editor.named.get(name) or next(
        (v for k, v in editor.named.items() if k.casefold() == name.casefold()), ""
    )
    sheet, _, cell = place.rpartition("!")
    sheet = plain_title(sheet)
    if sheet not in editor.titles or ":" in cell or not cell:
        return None
    return (sheet, *split_cell(cell))


def type_value(editor: WorkbookEditor, place: tuple[str, int, int], value: CellValue) -> None:
    """Type a value unless it stands there already."""
    if editor.value_at(*place) != value:
        editor.set_value(*place, value)


def type_column(
    editor: WorkbookEditor, place: tuple[str, int, int], values: Sequence[CellValue]
) -> None:
    """Type values down a column from a place on, each unless it stands there already."""
    sheet, first, column = place
    rows = editor.grid(sheet).rows
    nothing: dict[int, Value] = {}
    for row, value in enumerate(values, start=first):
        if rows.get(row, nothing).get(column) != value:
            editor.set_value(sheet, row, column, value)


def make_numbers(editor: WorkbookEditor, table: Table, factor: Callable[[str], float]) -> None:
    """Turn numbers of a table that were typed as text into numbers, which formulas see.

    Parameters
    ----------
    editor : WorkbookEditor
        The workbook.
    table : Table
        As read from it.
    factor : callable
        Returns what the numbers of a column, by its key, are multiplied by: a unit typed into
        the cells goes with the text.
    """
    text_cells = set(table.text_cells)
    for key, column in table.columns.items():
        for i, row in enumerate(table.rows):
            if f"{table.sheet}!{table.cell(i, key)}" in text_cells:
                value = float(table.numbers(key)[i]) * factor(key)
                type_value(editor, (table.sheet, row, column), value)
