"""Results beside a table of the user's own: new columns, live formulas, found again next time."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.changing.changes import SheetChanges
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.reading.grid import (
    LAST_COLUMN,
    Value,
    column_letters,
    fixed_cell,
    plain_title,
    quoted_title,
    split_area,
)

#: The least width of a column, in characters.
_WIDTH = 10.0
_COUNTED = re.compile(r"(COUNT\([^()]*\))")
_CELL = re.compile(r"\[@(\w+)\]")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ResultColumn:
    """A column to be put beside a table.

    Attributes
    ----------
    key : str
        By which formulas name it.
    heading : str
        What stands above it.
    values : sequence of CellValue
        One per row of the table; results where it has a formula. None leaves a cell blank.
    formula : str
        With ``[@key]`` for the cell of the same row of an input or result column; empty for values.
    number_format : str
        How numbers are shown; empty as in the table.
    folded : bool
        Whether the column is grouped and folded away: a step on the way, not a result.
    """

    key: str
    heading: str
    values: Sequence[CellValue]
    formula: str = ""
    number_format: str = ""
    folded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OwnTable:
    """A table of the user's own.

    Attributes
    ----------
    sheet : str
        Its sheet.
    head : int
        Row of the headings, 0 where there is none.
    rows : sequence of int
        Rows of its entries.
    columns : mapping
        Input columns by key.
    factors : mapping
        What brings an input to the unit of the formulas, where it differs from 1.
    """

    sheet: str
    head: int
    rows: Sequence[int]
    columns: Mapping[str, int]
    factors: Mapping[str, float] = field(default_factory=dict)


def head_row(
    cells: Mapping[int, Mapping[int, Value]], columns: Mapping[str, int],
    headings: Mapping[str, str], first: int,
) -> int:  # fmt: skip
    """Return the row of a table's headings, above its first entry; 0 where there is none.

    Parameters
    ----------
    cells : mapping
        The sheet.
    columns, headings : mapping
        Columns and their headings by key.
    first : int
        Row of the first entry.
    """
    for row in range(first - 1, 0, -1):
        for key, heading in headings.items():
            cell = cells.get(row, {}).get(columns.get(key, 0))
            if isinstance(cell, str) and heading and cell.strip() == heading.strip():
                return row
    return max(first - 1, 0)


def put_result_columns(
    editor: WorkbookEditor,
    table: OwnTable,
    columns: Sequence[ResultColumn],
    *,
    mark: str,
    adopted: Sequence[str] = (),
) -> None:
    """Put columns beside a table, where the sheet has as many free ones, or where they stand.

    Parameters
    ----------
    editor : WorkbookEditor
        The workbook.
    table : OwnTable
        The table.
    columns : sequence of ResultColumn
        The results.
    mark : str
        Name in the workbook of the cells of their headings, by which they are found again.
    adopted : sequence of str
        Headings of columns that are taken over although they bear no mark.
    """
    head = table.head or min(table.rows)
    places = _known(editor, table, columns, mark, adopted)
    count = sum(column.key not in places for column in columns)
    last = _free_columns(editor, table, {*table.columns.values(), *places.values()}, count) - 1
    widths = editor.changes.setdefault(table.sheet, SheetChanges()).columns
    for column in columns:
        if column.key not in places:
            last += 1
            places[column.key] = last
            # Room for the heading, in the bold letters that headings have.
            widths[last] = max(_WIDTH, 1.15 * len(column.heading) + 1), column.folded
    data, heads = editor.styles_of(table.sheet, table.rows[0]), editor.styles_of(table.sheet, head)
    like = next((data[n] for n in reversed(list(table.columns.values())) if data.get(n)), "")
    like_head = next((heads[n] for n in reversed(list(table.columns.values())) if heads.get(n)), "")
    formats: dict[str, str] = {"": like}
    for column in columns:
        if column.number_format not in formats:
            formats[column.number_format] = editor.style_like(like, column.number_format)
    for column in columns:
        number, style = places[column.key], formats[column.number_format]
        if table.head:
            editor.put(table.sheet, head, number, column.heading, style=like_head)
        pieces = _pieces(column.formula, table, places)
        for row, value in zip(table.rows, column.values, strict=True):
            text = str(row).join(pieces) if column.formula else ""
            editor.put(table.sheet, row, number, value, formula=text, style=style)
    span = [places[column.key] for column in columns]
    area = ":".join(fixed_cell(head, number) for number in (min(span), max(span)))
    editor.define(mark, f"{quoted_title(table.sheet)}!{area}")


def _free_columns(
    editor: WorkbookEditor, table: OwnTable, occupied: Collection[int], count: int
) -> int:
    """Return the first of so many free columns that stand together, right of those that are taken.

    Free of all cells, not of those of the table alone: some columns of results are folded away.
    """
    used = {column for cells in editor.grid(table.sheet).rows.values() for column in cells}
    first = max(occupied, default=0) + 1
    for column in sorted(column for column in used if column >= first):
        if column - first >= count:
            break
        first = column + 1
    if first + count - 1 > LAST_COLUMN:
        raise InputError(remark("book.no_free_columns", of=editor.path, sheet=table.sheet,
                                count=count))  # fmt: skip
    return first


def _known(
    editor: WorkbookEditor,
    table: OwnTable,
    columns: Sequence[ResultColumn],
    mark: str,
    adopted: Sequence[str],
) -> dict[str, int]:
    """Return where result columns stand already, by key."""
    sheet, _, area = editor.book.names.get(mark, "").rpartition("!")
    cells = editor.grid(table.sheet).rows.get(table.head, {})
    marked: set[int] = set()
    if plain_title(sheet) == table.sheet and "#" not in area:
        top, left, _, right = split_area(area.replace("$", ""))
        marked = set(range(left, right + 1))
        if not table.head and top == min(table.rows) and len(marked) == len(columns):
            return {column.key: left + i for i, column in enumerate(columns)}
    inputs = set(table.columns.values())
    headed = {
        str(value).strip(): number
        for number, value in cells.items()
        if number not in inputs and (number in marked or str(value).strip() in adopted)
    }
    return {c.key: headed[c.heading] for c in columns if c.heading in headed}


def _pieces(formula: str, table: OwnTable, places: Mapping[str, int]) -> list[str]:
    """Return a formula cut where the number of the row belongs."""

    def cell(match: re.Match[str], *, scaled: bool) -> str:
        key = match[1]
        place = f"{column_letters(table.columns.get(key) or places[key])}\0"
        factor = table.factors.get(key, 1.0)
        return f"({place}*{factor!r})" if scaled and factor != 1.0 else place

    # What is counted is the cell: a product would count as a number where the cell is blank.
    parts = _COUNTED.split(formula)
    counted = [_CELL.sub(partial(cell, scaled=i % 2 == 0), part) for i, part in enumerate(parts)]
    return "".join(counted).split("\0")
