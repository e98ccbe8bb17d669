"""A workbook's own formulas, calculated: a column of a table at once, single cells one by one.

What no rule is known for is `Unknown`, and so is all that follows from it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from openpyxl import Workbook
from openpyxl.worksheet.formula import ArrayFormula

from photocore.workbook.calculating.functions import FUNCTIONS, chosen, signed
from photocore.workbook.calculating.syntax import Node, parts_of
from photocore.workbook.calculating.values import (
    BLANK,
    NUMBER,
    CellArray,
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
#: Row and column of a cell of a sheet.
_Cell = tuple[int, int]


class _Formula(str):
    """The text of a formula, without its equals sign."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class _CalculatedTable:
    """A table: its sheet, the row of its headings, its last row, its columns by heading."""

    sheet: str
    head: int
    last: int
    columns: Mapping[str, int]


@dataclass(slots=True, eq=False)
class _Sheet:
    """What stands in the cells of a sheet, how far they go, its names, its long columns.

    ``long`` are first and last row of what is calculated together, by column; ``typed`` the values
    of rows that repeat a prototype, by column.
    """

    cells: dict[_Cell, CellValue]
    end: _Cell
    names: Mapping[str, str]
    long: dict[int, list[tuple[int, int]]] = field(default_factory=dict)
    typed: dict[int, tuple[int, Sequence[CellValue]]] = field(default_factory=dict)


@dataclass(slots=True, eq=False)
class Calculation:
    """The values that a workbook's formulas give.

    Parameters
    ----------
    book : Workbook
        As openpyxl reads it, formulas not replaced by stored results.
    repeated : mapping, optional
        By title, rows of which ``book`` has the first alone: its number, and the values of columns
        A, B, ...; where the first row has a formula, so have all.
    results : mapping, optional
        By title, cells that show something whatever their formulas say.

    Attributes
    ----------
    unknown : dict
        What of formulas is not known here, and the first cell that has it.
    """

    book: Workbook
    repeated: Mapping[str, tuple[int, Sequence[Sequence[CellValue]]]] = field(default_factory=dict)
    results: Mapping[str, Mapping[str, CellValue]] = field(default_factory=dict)
    unknown: dict[str, str] = field(default_factory=dict)
    _sheets: dict[str, _Sheet] = field(default_factory=dict)
    _shown: dict[tuple[str, int, int], CellValue] = field(default_factory=dict)
    _names: dict[str, str] = field(default_factory=dict)
    _tables: dict[str, _CalculatedTable] = field(default_factory=dict)
    _values: dict[tuple[Any, ...], CellArray | str | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._names = _texts_of(self.book.defined_names)
        for sheet in self.book.worksheets:
            cells = {
                (int(cell.row), int(cell.column)): _content(cell)
                for cell in sheet._cells.values()  # iter_rows makes all that are not there
                if cell.value is not None
            }
            end = max(row for row, _ in cells or [(1, 1)]), max(c for _, c in cells or [(1, 1)])
            self._sheets[sheet.title] = _Sheet(cells, end, _texts_of(sheet.defined_names))
            for table in sheet.tables.values():
                top, left, bottom, _ = split_area(table.ref)
                headings = [column.name.casefold() for column in table.tableColumns]
                columns = {heading: left + i for i, heading in enumerate(headings)}
                self._tables[table.name.casefold()] = _CalculatedTable(
                    sheet.title, top, bottom, columns
                )
                for number in columns.values():
                    long = self._sheets[sheet.title].long
                    long.setdefault(number, []).append((top + 1, bottom))
        self._shown = {
            (title, *split_cell(cell)): value
            for title, cells_of in self.results.items()
            for cell, value in cells_of.items()
            if value is not None
        }
        for title, (first, columns_of) in self.repeated.items():
            self._repeat(self._sheets[title], first, columns_of)

    @staticmethod
    def _repeat(sheet: _Sheet, first: int, columns: Sequence[Sequence[CellValue]]) -> None:
        """Take up rows that repeat a prototype."""
        last = first + max(map(len, columns)) - 1
        sheet.end = max(sheet.end[0], last), sheet.end[1]
        for number, values in enumerate(columns, start=1):
            if len(values):
                sheet.typed[number] = first, values
                if (first, last) not in sheet.long.get(number, ()):
                    sheet.long.setdefault(number, []).append((first, last))

    def value(self, title: str, row: int, column: int) -> CellValue:
        """Return what a cell shows.

        Raises
        ------
        Unknown
            If its formula, or one that it follows from, has something that is not known.
        """
        with _deep():
            return self._cell(title, row, column).items()[0]

    def values(self) -> dict[tuple[str, int, int], CellValue]:
        """Return what single cells with formulas show, but those of ``results``, by their place.

        Raises
        ------
        Unknown
            As `value`.
        """
        shown: dict[tuple[str, int, int], CellValue] = {}
        with _deep():
            for title, sheet in self._sheets.items():
                columns = {
                    number: [(*rows, self._column(title, rows, number).items()) for rows in long]
                    for number, long in sheet.long.items()
                    if number not in sheet.typed
                }
                for (row, number), content in sheet.cells.items():
                    if not isinstance(content, _Formula) or (title, row, number) in self._shown:
                        continue
                    if sheet.typed.get(number, (0, ()))[0] == row:
                        continue
                    inside = [(a, v) for a, b, v in columns.get(number, ()) if a <= row <= b]
                    shown[title, row, number] = (
                        inside[0][1][row - inside[0][0]]
                        if inside
                        else self._cell(title, row, number).items()[0]
                    )
        return shown

    def columns(self, title: str, first: int) -> dict[int, list[CellValue]]:
        """Return what the columns of formulas show that begin in a row of a sheet, by number.

        Raises
        ------
        Unknown
            As `value`.
        """
        sheet = self._sheets[title]
        with _deep():
            return {
                number: self._column(title, rows, number).items()
                for number, long in sheet.long.items()
                for rows in long
                if rows[0] == first and isinstance(sheet.cells.get((first, number)), _Formula)
            }

    def formulas(self) -> list[tuple[str, int, int]]:
        """Return sheet, row and column of all cells that hold a formula."""
        return [
            (title, *at)
            for title, sheet in self._sheets.items()
            for at, content in sheet.cells.items()
            if isinstance(content, _Formula)
        ]

    def _cell(self, title: str, row: int, column: int) -> CellArray:
        for first, last in self._sheets[title].long.get(column, ()):
            if first <= row <= last:
                return self._column(title, (first, last), column).at([row - first])
        key = (title, row, column)
        value = self._values.get(key)
        if isinstance(value, CellArray):
            return value
        return self._once(key, lambda: self._single(title, row, column))

    def _single(self, title: str, row: int, column: int) -> CellArray:
        content = self._sheets[title].cells.get((row, column))
        if isinstance(content, _Formula):
            if (title, row, column) in self._shown:
                return CellArray.of([self._shown[title, row, column]])
            return _no_blank(self._evaluated(content, (title, [row], column)), 1)
        return CellArray.of([content])

    def _once(self, at: tuple[Any, ...], make: Callable[[], CellArray]) -> CellArray:
        """Return what was calculated already, or calculate it."""
        if at not in self._values:
            self._values[at] = None  # meanwhile: met again, it follows from itself
            try:
                self._values[at] = make()
            except (Unknown, ValueError, IndexError, OverflowError) as why:
                self._values[at] = str(why)
                self.unknown.setdefault(str(why), f"{at[0]}!{column_letters(at[-1])}{at[1]}")
            except RecursionError:
                self._values[at] = "a chain of formulas that is too long"
        value = self._values[at]
        if not isinstance(value, CellArray):
            raise Unknown(value or "a formula that follows from itself")
        return value

    def _column(self, title: str, rows: tuple[int, int], column: int) -> CellArray:
        """Return a long column: formulas that are alike are calculated together."""
        key = (title, f":{rows[0] - 1}", column)
        return self._once(key, lambda: self._calculated(title, rows, column))

    def _calculated(self, title: str, rows: tuple[int, int], column: int) -> CellArray:
        sheet, (first, last) = self._sheets[title], rows
        contents = [sheet.cells.get((row, column)) for row in range(first, last + 1)]
        alike: dict[str, list[int]] = {}
        if sheet.typed.get(column, (0,))[0] == first:
            if isinstance(contents[0], _Formula):
                alike[_of_row(contents[0], first)] = list(range(len(contents)))
            else:
                contents = list(sheet.typed[column][1])
                contents += [None] * (last + 1 - first - len(contents))
        else:
            for i, content in enumerate(contents):
                if isinstance(content, _Formula):
                    alike.setdefault(_of_row(content, first + i), []).append(i)
        cells = CellArray.of([None if isinstance(c, _Formula) else c for c in contents])
        for text, places in alike.items():
            numbers = [first + i for i in places]
            result = _no_blank(self._evaluated(text, (title, numbers, column)), len(places))
            if len(places) == len(contents):
                return result
            cells.numbers[places], cells.kinds[places] = result.numbers, result.kinds
            cells.texts[places] = result.texts
        return cells

    def _evaluated(self, text: str, where: tuple[str, list[int], int]) -> CellArray:
        return self._value(parts_of(text), where)

    def _value(self, node: Node, where: tuple[str, list[int], int]) -> CellArray:
        """Return the value of a part of a formula that stands in rows of a column of a sheet."""
        match node[0]:
            case "value":
                value: CellArray = node[1]
                return value
            case "sign":
                return signed(node[1], self._value(node[2], where), self._value(node[3], where))
            case "area":
                return self._area(node[1] or where[0], node[2], where[1])
            case "table":
                return self._of_table(node[1:], where[1])
            case "name":
                return self._named(node[1], where)
            case _:
                return self._call(node[1], node[2:], where)

    def _call(
        self, name: str, nodes: Sequence[Node], where: tuple[str, list[int], int]
    ) -> CellArray:
        if name == "ROW":
            return self._row(nodes, where)
        if name not in FUNCTIONS:
            raise Unknown(name)
        if name in ("IF", "IFERROR") and 1 < len(nodes) < 4:
            # What is not chosen anywhere is not calculated.
            return chosen(name, [lambda node=node: self._value(node, where) for node in nodes])  # type: ignore[misc]
        values = [self._value(node, where) for node in nodes]
        try:
            return FUNCTIONS[name](*values)
        except TypeError:
            raise Unknown(f"{name} with {len(nodes)} arguments") from None

    def _row(self, nodes: Sequence[Node], where: tuple[str, list[int], int]) -> CellArray:
        if not nodes:
            return number_cells(np.array(where[1], dtype=float)[:, None])
        kind, *parts = nodes[0]
        if kind == "table" and parts[1] == "Headers":
            return number_cells([[self._table(parts[0]).head]])
        if kind == "table" and not parts[1]:
            table = self._table(parts[0])
            return number_cells(np.arange(table.head + 1.0, table.last + 1)[None, :])
        if kind == "area":
            title, (top, _, bottom, _) = parts[0] or where[0], split_area(parts[1])
            bottom = min(bottom, max(self._sheets[plain_title(title)].end[0], top))
            return number_cells(np.arange(float(top), bottom + 1)[None, :])
        raise Unknown("ROW")

    def _named(self, name: str, where: tuple[str, list[int], int]) -> CellArray:
        key = name.casefold()
        text = self._sheets[where[0]].names.get(key) or self._names.get(key)
        if not text:
            raise Unknown(name)
        node = parts_of(text)
        if node[0] != "area":
            raise Unknown(name)
        return self._value(node, where)

    def _table(self, name: str) -> _CalculatedTable:
        table = self._tables.get(name.casefold())
        if table is None:
            raise Unknown(f"{name}[]")
        return table

    def _of_table(self, parts: Sequence[Any], rows: list[int]) -> CellArray:
        name, part, heading = parts
        table = self._table(name)
        column = table.columns.get(heading.casefold())
        if column is None:
            raise Unknown(f"{name}[{heading}]")
        if part == "Headers":
            return self._single(table.sheet, table.head, column)
        cells = self._column(table.sheet, (table.head + 1, table.last), column)
        if part != "This Row":
            key = (table.sheet, f":{table.head}:", column)
            return self._once(key, cells.across)
        if not table.head < rows[0] <= rows[-1] <= table.last:
            raise Unknown(f"{name}[{heading}] of another row")
        if len(rows) == table.last - table.head:
            return cells
        return cells.at([row - table.head - 1 for row in rows])

    def _area(self, title: str, area: str, rows: list[int]) -> CellArray:
        title = plain_title(title)
        if title not in self._sheets:
            raise Unknown(f"{title}!")
        first, _, last = area.partition(":")
        if not last:
            letters, number = first.rstrip("0123456789"), first.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
            column = column_number(letters)
            if number == "0":  # the row where the formula stands
                cells = self._down(title, rows[0], rows[-1], column)
                is_whole = len(rows) == rows[-1] - rows[0] + 1
                return cells if is_whole else cells.at([row - rows[0] for row in rows])
            return self._cell(title, int(number), column)
        return self._once((title, area, 1), lambda: self._range(title, area))

    def _range(self, title: str, area: str) -> CellArray:
        """Return the cells of a range."""
        first, _, last = area.partition(":")
        if first.isalpha():
            area = f"{first}1:{last}{LAST_ROW}"
        top, left, bottom, right = split_area(area)
        end = self._sheets[title].end
        bottom, right = min(bottom, max(end[0], top)), min(right, max(end[1], left))
        columns = [self._down(title, top, bottom, column) for column in range(left, right + 1)]
        numbers, kinds, texts = (
            np.hstack([getattr(one, part) for one in columns]).reshape(1, -1)
            for part in ("numbers", "kinds", "texts")
        )
        return CellArray(numbers, kinds, texts, (bottom - top + 1, right - left + 1))

    def _down(self, title: str, top: int, bottom: int, column: int) -> CellArray:
        """Return the cells of a column from one row to another, long columns at once."""
        parts, row = [], top
        long = self._sheets[title].long.get(column, ())
        while row <= bottom:
            for first, last in long:
                if first <= row <= last:
                    end = min(last, bottom)
                    cells = self._column(title, (first, last), column)
                    parts.append(cells.at(slice(row - first, end - first + 1)))
                    row = end + 1
                    break
            else:
                parts.append(self._cell(title, row, column))
                row += 1
        if len(parts) == 1:
            return parts[0]
        return CellArray(
            np.concatenate([one.numbers for one in parts]),
            np.concatenate([one.kinds for one in parts]),
            np.concatenate([one.texts for one in parts]),
        )


@contextmanager
def _deep() -> Iterator[None]:
    """Let a cell follow from hundreds of others."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, _DEEPEST))
    try:
        yield
    finally:
        sys.setrecursionlimit(limit)


def _texts_of(names: Any) -> dict[str, str]:
    return {name.casefold(): str(defined.attr_text or "") for name, defined in names.items()}


def _content(cell: Any) -> CellValue:
    """Return what stands in a cell, its formula as such."""
    content = cell.value
    if cell.data_type == "f":
        text = content.text if isinstance(content, ArrayFormula) else content
        return _Formula(str(text or "").removeprefix("="))
    return content if isinstance(content, str | bool | int | float) else str(content)


def _of_row(text: str, row: int) -> str:
    """Return a formula with row 0 in place of its own, so that it is the same in all rows."""
    if "[" in text and not _ROW_CELL.search(text):
        return text
    return _ROW_CELL.sub(lambda cell: f"{cell[1]}0" if int(cell[2]) == row else cell[0], text)


#: A cell of any row, not part of a range nor on another sheet.
_ROW_CELL = re.compile(r"(?<![\w$!'.:\"])([A-Z]{1,3})(\d+)(?![\w(:.!\"])")


def _no_blank(cells: CellArray, rows: int) -> CellArray:
    """Return what formulas show, one a row: 0 for a cell that is blank."""
    shape = (rows, 1)
    kinds = cells.kinds[:, :1]
    if cells.kinds.shape == shape and not (kinds == BLANK).any():
        return cells
    kinds = np.broadcast_to(kinds, shape)
    return CellArray(
        np.broadcast_to(cells.numbers[:, :1], shape).copy(),
        np.where(kinds == BLANK, NUMBER, kinds).astype(np.uint8),
        np.broadcast_to(cells.texts[:, :1], shape).copy(),
    )
