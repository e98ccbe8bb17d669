"""Rows of a table that repeat a prototype, and their formulas in A1 references."""

from __future__ import annotations

import re
from collections.abc import Container, Mapping, Sequence

from photocore.workbook.changing.cells import ROW_MARK, CellValue, RowText
from photocore.workbook.making.live_columns import LiveColumn
from photocore.workbook.making.newbook import RowBlock

#: A whole column of a table: its name without ``tbl``, and its heading.
COLUMN = re.compile(r"tbl(\w+)\[(\w+)\]")


def repeated_rows(
    table: str,
    columns: Sequence[LiveColumn],
    first: int,
    rows: int,
    cells: Mapping[str, Sequence[CellValue]],
    letters: Mapping[str, str],
    short: bool,
) -> RowBlock:
    """Return the rows that `finish_book` makes of the prototype."""
    listed = [list(cells.get(column.key, ())) for column in columns]
    listed = [
        values + [column.spare] * (rows - len(values))
        for column, values in zip(columns, listed, strict=True)
    ]
    formulas = {}
    if short:
        for i, column in enumerate(columns):
            if column.kind == "formula":
                formulas[i] = short_formula(table, column.formula, letters, first - 1)
    return RowBlock(row=first, columns=listed, formulas=formulas)


def short_formula(table: str, text: str, letters: Mapping[str, str], head: int) -> RowText:
    """Return a formula with A1 references.

    Parameters
    ----------
    table : str
        Name of the table.
    text : str
        The formula, with ``[@key]`` for the cell of the same row.
    letters : mapping
        Key to the letters of its column.
    head : int
        Row of the keys.
    """
    # The same in all rows, it takes no space in the file.
    heads = rf"{table}\[\[#Headers\],\[(\w+)\]\]"
    text = re.sub(heads, lambda key: f"${letters[key[1]]}${head}", text)
    text = re.sub(r"\[@(\w+)\]", lambda key: letters[key[1]] + ROW_MARK, text)
    return RowText(text)


def named_columns(text: str, names: Container[str]) -> str:
    """Return a formula with whole columns of tables called by names, where there are such names.

    A file has a formula once for all rows only where it leads to names and cells of its own sheet.

    >>> named_columns("INDEX(tblPoints[X],2)+SUM(tblGeo[w])", {"points_X"})
    'INDEX(points_X,2)+SUM(tblGeo[w])'
    """
    return COLUMN.sub(
        lambda at: name if (name := column_name(*at.groups())) in names else at[0], text
    )


def column_name(table: str, key: str) -> str:
    """Return the name of a whole column of a table.

    >>> column_name("Points", "X")
    'points_X'
    """
    return f"{table.lower()}_{key}"
