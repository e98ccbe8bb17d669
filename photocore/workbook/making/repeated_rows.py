"""Rows of a table that repeat a prototype, and their formulas in A1 references."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace

from openpyxl import Workbook
from openpyxl.workbook.defined_name import DefinedName

from photocore.workbook.changing.cells import ROW_MARK, CellValue, RowText
from photocore.workbook.making.live_columns import LiveColumn
from photocore.workbook.making.newbook import RowBlock
from photocore.workbook.reading.grid import TableArea, column_letters, quoted_title, split_area

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


def name_columns(book: Workbook, blocks: dict[str, RowBlock]) -> None:
    """Call the columns of tables that short formulas lead to by names: the file has each once.

    That takes names, or cells of the same sheet; with tables every row would spell it out.
    """
    places = column_places(
        TableArea(t.name, sheet.title, split_area(t.ref), columns=tuple(t.column_names))
        for sheet in book.worksheets
        for t in sheet.tables.values()
    )
    for title, block in blocks.items():
        formulas = dict(block.formulas)
        for column, formula in formulas.items():
            for name in (column_name(*key) for key in COLUMN.findall(formula.text)):
                book.defined_names[name] = DefinedName(name, attr_text=places[name])
            formulas[column] = named = RowText(named_columns(formula.text, places))
            book[title].cell(block.row, column + 1).value = f"={named(block.row)}"
        blocks[title] = replace(block, formulas=formulas)


def column_places(tables: Iterable[TableArea]) -> dict[str, str]:
    """Return where the names of all columns of tables must lead."""
    places = {}
    for table in (table for table in tables if table.name.startswith("tbl")):
        for key, column in table.headings().items():
            letters = column_letters(column)
            cells = f"${letters}${table.first}:${letters}${table.area[2]}"
            name = column_name(table.name.removeprefix("tbl"), key)
            places[name] = f"{quoted_title(table.sheet)}!{cells}"
    return places


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
