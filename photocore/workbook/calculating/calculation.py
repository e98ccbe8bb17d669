"""A workbook's own formulas, calculated: a column of a table at once, single cells one by one.

What no rule is known for is `Unknown`, and so is all that follows from it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from openpyxl import Workbook
from openpyxl.worksheet.formula import ArrayFormula

from photocore.workbook.calculating.functions import FUNCTIONS, signed
from photocore.workbook.calculating.syntax import Node, parts_of
from photocore.workbook.calculating.values import (
    BLANK,
    NUMBER,
    Cells,
    Unknown,
    number_cells,
)
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.reading.grid import (
    LAST_ROW,
    column_letters,
    column_number,
    plain_title,
    split_area,
    split_cell,
)

#: Frames that a chain of formulas may take.
_DEEPEST = 20_000


@dataclass(frozen=True, slots=True)
class _Table:
    """A table: its sheet, the row of its headings, its last row, its columns by heading."""

    sheet: str
    head: int
    last: int
    columns: Mapping[str, int]


@dataclass(slots=True, eq=False)
class Calculation:
    """The values that a workbook's formulas give.

    Parameters
    ----------
    book : Workbook
        As openpyxl reads it, formulas not replaced by stored results.

    Attributes
    ----------
    unknown : dict
        What of formulas is not known here, and the first cell that has it.
    """

    book: Workbook
    unknown: dict[str, str] = field(default_factory=dict)
    _tables: dict[str, _Table] = field(default_factory=dict)
    _inside: dict[tuple[str, int], list[str]] = field(default_factory=dict)
    _known: dict[tuple[Any, ...], Cells | str | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for sheet in self.book.worksheets:
            for table in sheet.tables.values():
                top, left, bottom, _ = split_area(table.ref)
                names = [column.name.casefold() for column in table.tableColumns]
                columns = {name: left + i for i, name in enumerate(names)}
                key = table.name.casefold()
                self._tables[key] = _Table(sheet.title, top, bottom, columns)
                for number in columns.values():
                    self._inside.setdefault((sheet.title, number), []).append(key)

    def value(self, sheet: str, row: int, column: int) -> CellValue:
        """Return what a cell shows.

        Raises
        ------
        Unknown
            If its formula, or one that it follows from, has something that is not known.
        """
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(max(limit, _DEEPEST))  # a cell may follow from a hundred others
        try:
            return self._cell(sheet, row, column).items()[0]
        finally:
            sys.setrecursionlimit(limit)

    def formulas(self) -> list[tuple[str, int, int]]:
        """Return sheet, row and column of all cells that hold a formula."""
        return [
            (sheet.title, int(cell.row), int(cell.column))
            for sheet in self.book.worksheets
            for cells in sheet.iter_rows()
            for cell in cells
            if _formula(cell)
        ]

    def _cell(self, sheet: str, row: int, column: int) -> Cells:
        for key in self._inside.get((sheet, column), ()):
            table = self._tables[key]
            if table.head < row <= table.last:
                return self._column(key, column).at([row - table.head - 1])
        return self._once((sheet, row, column), lambda: self._single(sheet, row, column))

    def _single(self, sheet: str, row: int, column: int) -> Cells:
        cell = self.book[sheet].cell(row, column)
        if text := _formula(cell):
            return _no_blank(self._evaluated(text, (sheet, [row], column)), 1)
        return Cells.of([_typed(cell.value)])

    def _once(self, at: tuple[Any, ...], make: Callable[[], Cells]) -> Cells:
        """Return what was calculated already, or calculate it."""
        if at not in self._known:
            self._known[at] = None  # meanwhile: met again, it follows from itself
            try:
                self._known[at] = make()
            except (Unknown, ValueError, IndexError, OverflowError) as why:
                self._known[at] = str(why)
                self.unknown.setdefault(str(why), f"{at[0]}!{column_letters(at[-1])}{at[1]}")
            except RecursionError:
                self._known[at] = "a chain of formulas that is too long"
        value = self._known[at]
        if not isinstance(value, Cells):
            raise Unknown(value or "a formula that follows from itself")
        return value

    def _column(self, key: str, column: int) -> Cells:
        """Return a column of a table: formulas that are alike are calculated together."""
        table = self._tables[key]
        at = (table.sheet, f":{table.head}", column)
        return self._once(at, lambda: self._calculated(table, column))

    def _calculated(self, table: _Table, column: int) -> Cells:
        sheet, first = self.book[table.sheet], table.head + 1
        stands = [sheet.cell(row, column) for row in range(first, table.last + 1)]
        alike: dict[str, list[int]] = {}
        for i, cell in enumerate(stands):
            if text := _formula(cell):
                alike.setdefault(_of_row(text, first + i), []).append(i)
        cells = Cells.of([None if _formula(cell) else _typed(cell.value) for cell in stands])
        for text, rows in alike.items():
            numbers = [first + i for i in rows]
            result = _no_blank(self._evaluated(text, (table.sheet, numbers, column)), len(rows))
            cells.numbers[rows], cells.kinds[rows] = result.numbers, result.kinds
            cells.texts[rows] = result.texts
        return cells

    def _evaluated(self, text: str, where: tuple[str, list[int], int]) -> Cells:
        return self._value(parts_of(text), where)

    def _value(self, node: Node, where: tuple[str, list[int], int]) -> Cells:
        """Return the value of a part of a formula that stands in rows of a column of a sheet."""
        kind, *parts = node
        match kind:
            case "value":
                return parts[0]
            case "sign":
                sign, one, other = parts
                return signed(sign, self._value(one, where), self._value(other, where))
            case "area":
                return self._area(parts[0] or where[0], parts[1], where[1])
            case "table":
                return self._of_table(parts, where[1])
            case "name":
                return self._named(parts[0], where)
            case _:
                return self._call(parts[0], parts[1:], where)

    def _call(self, name: str, given: list[Node], where: tuple[str, list[int], int]) -> Cells:
        if name == "ROW":
            if not given:
                return number_cells(np.array(where[1], dtype=float)[:, None])
            kind, *parts = given[0]
            if kind == "table" and parts[1] == "Headers":
                return number_cells([[self._table(parts[0]).head]])
            if kind == "area" and ":" not in parts[1]:
                return number_cells([[split_cell(parts[1])[0]]])
            raise Unknown("ROW")
        if name not in FUNCTIONS:
            raise Unknown(name)
        values = [self._value(one, where) for one in given]
        try:
            return FUNCTIONS[name](*values)
        except TypeError:
            raise Unknown(f"{name} with {len(given)} arguments") from None

    def _named(self, name: str, where: tuple[str, list[int], int]) -> Cells:
        of_sheet = self.book[where[0]].defined_names
        listed = {key.casefold(): value for key, value in self.book.defined_names.items()}
        listed |= {key.casefold(): value for key, value in of_sheet.items()}
        defined = listed.get(name.casefold())
        if defined is None or not defined.attr_text:
            raise Unknown(name)
        node = parts_of(str(defined.attr_text))
        if node[0] != "area":
            raise Unknown(name)
        return self._value(node, where)

    def _table(self, name: str) -> _Table:
        table = self._tables.get(name.casefold())
        if table is None:
            raise Unknown(f"{name}[]")
        return table

    def _of_table(self, parts: list[Any], rows: list[int]) -> Cells:
        name, part, heading = parts
        table = self._table(name)
        column = table.columns.get(heading.casefold())
        if column is None:
            raise Unknown(f"{name}[{heading}]")
        if part == "Headers":
            return Cells.of([_typed(self.book[table.sheet].cell(table.head, column).value)])
        cells = self._column(name.casefold(), column)
        if part == "This Row":
            if not table.head < rows[0] <= rows[-1] <= table.last:
                raise Unknown(f"{name}[{heading}] of another row")
            return cells.at([row - table.head - 1 for row in rows])
        return cells.across()

    def _area(self, title: str, area: str, rows: list[int]) -> Cells:
        title = plain_title(title)
        if title not in self.book.sheetnames:
            raise Unknown(f"{title}!")
        sheet = self.book[title]
        first, _, last = area.partition(":")
        if first.isalpha():
            area = f"{first}1:{last}{LAST_ROW}"
        if ":" not in area:
            letters, number = first.rstrip("0123456789"), first.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
            column = column_number(letters)
            if number == "0":  # the row where the formula stands
                alike = [self._cell(title, row, column) for row in rows]
                return Cells(
                    np.concatenate([one.numbers for one in alike]),
                    np.concatenate([one.kinds for one in alike]),
                    np.concatenate([one.texts for one in alike]),
                )
            return self._cell(title, int(number), column)
        top, left, bottom, right = split_area(area)
        bottom, right = (
            min(bottom, max(sheet.max_row, top)),
            min(right, max(sheet.max_column, left)),
        )
        cells = [
            self._cell(title, row, column)
            for row in range(top, bottom + 1)
            for column in range(left, right + 1)
        ]
        numbers, kinds, texts = (
            np.concatenate([getattr(cell, part).ravel() for cell in cells])[None]
            for part in ("numbers", "kinds", "texts")
        )
        return Cells(numbers, kinds, texts, (bottom - top + 1, right - left + 1))


def _formula(cell: Any) -> str:
    """Return the text of a cell's formula, empty where there is none."""
    if cell.data_type != "f":
        return ""
    stands = cell.value.text if isinstance(cell.value, ArrayFormula) else cell.value
    return str(stands or "").removeprefix("=")


def _typed(stands: Any) -> CellValue:
    return stands if isinstance(stands, str | bool | int | float) or stands is None else str(stands)


def _of_row(text: str, row: int) -> str:
    """Return a formula with row 0 in place of its own, so that it is the same in all rows."""
    if "[" in text and not _ROW_CELL.search(text):
        return text
    return _ROW_CELL.sub(lambda cell: f"{cell[1]}0" if int(cell[2]) == row else cell[0], text)


#: A cell of any row, not part of a range nor on another sheet.
_ROW_CELL = re.compile(r"(?<![\w$!'.:\"])([A-Z]{1,3})(\d+)(?![\w(:.!\"])")


def _no_blank(cells: Cells, rows: int) -> Cells:
    """Return what formulas show, one a row: 0 for a cell that is blank."""
    shape = (rows, 1)
    kinds = np.broadcast_to(cells.kinds[:, :1], shape)
    return Cells(
        np.broadcast_to(cells.numbers[:, :1], shape).copy(),
        np.where(kinds == BLANK, NUMBER, kinds).astype(np.uint8),
        np.broadcast_to(cells.texts[:, :1], shape).copy(),
    )
