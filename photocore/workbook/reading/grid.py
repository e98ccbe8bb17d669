"""Sheets as sparse grids of typed cells, whatever the file format."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from functools import lru_cache

from photocore.errors import InputError

#: Where every sheet ends.
LAST_ROW, LAST_COLUMN = 2**20, 2**14


@dataclass(frozen=True, slots=True)
class CellDate:
    """A number that a spreadsheet shows as a date or time.

    Parameters
    ----------
    when : datetime
        The moment.
    style : str
        Number format, e.g. ``"d-mmm"``; empty where the file has none.
    """

    when: datetime
    style: str = ""

    @property
    def shown(self) -> str:
        """The date as text, without a time when it is midnight."""
        midnight = self.when.hour == self.when.minute == self.when.second == 0
        return self.when.strftime("%Y-%m-%d" if midnight else "%Y-%m-%d %H:%M:%S")


class NamedNumber(float):
    """A whole number that a spreadsheet shows with leading zeros or letters: 7 as ``P007``."""

    shown: str = ""


def named_number(number: float, shown: str) -> NamedNumber:
    """Return a number with the text that is shown for it."""
    named = NamedNumber(number)
    named.shown = shown
    return named


@dataclass(frozen=True, slots=True)
class CellFault:
    """An error value such as ``#DIV/0!``."""

    text: str


@dataclass(frozen=True, slots=True)
class NotCalculated:
    """A formula whose file holds no result yet."""

    formula: str = ""


Value = float | str | bool | CellDate | CellFault | NotCalculated


@dataclass(slots=True)
class CellGrid:
    """The cells of one sheet that hold something.

    Rows and columns are counted from 1, as spreadsheets do.

    Parameters
    ----------
    title : str
        Name of the sheet.
    rows : dict
        Row number to (column number to value).
    hidden : set of int
        Hidden or filtered rows.
    merged : list of (top, left, bottom, right)
        Merged ranges, both ends included.
    truncated : bool
        Whether reading stopped early because the sheet is too long.
    labels : dict, optional
        Where each text stands, by its plain form; filled in when single values are looked for.
    """

    title: str
    rows: dict[int, dict[int, Value]] = field(default_factory=dict)
    hidden: set[int] = field(default_factory=set)
    merged: list[tuple[int, int, int, int]] = field(default_factory=list)
    truncated: bool = False
    labels: dict[str, tuple[int, int]] | None = None


@dataclass(frozen=True, slots=True)
class TableArea:
    """A named table: where it lies, how many rows are headings and totals, its part."""

    name: str
    sheet: str
    area: tuple[int, int, int, int]
    header_rows: int = 1
    totals_rows: int = 0
    part: str = ""
    columns: tuple[str, ...] = ()

    @property
    def first(self) -> int:
        """The row below the headings."""
        return self.area[0] + 1

    @property
    def length(self) -> int:
        """Rows below the headings."""
        return self.area[2] - self.area[0]

    def headings(self) -> dict[str, int]:
        """Return the column number of each heading."""
        return dict(zip(self.columns, range(self.area[1], self.area[3] + 1), strict=False))


@dataclass(slots=True)
class SheetFile:
    """An open spreadsheet: its sheets are read when asked for.

    Parameters
    ----------
    label : str
        File name for messages.
    titles : list of str
        Sheet names in order, visible ones first.
    load : callable
        Reads one sheet by its name; `grid` calls it once per sheet.
    tables : list of TableArea
        Named tables.
    names : dict
        Defined names of single cells: lower-case name to (sheet, row, column).
    remarks : list of str
        What the user should know about the file as a whole.
    text : callable
        Returns the XML of one sheet by its name; empty where formulas are not told.
    names_on : callable
        Returns the names of single cells of one sheet.
    """

    label: str
    titles: list[str]
    load: Callable[[str], CellGrid]
    tables: Sequence[TableArea] = ()
    names: dict[str, tuple[str, int, int]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    text: Callable[[str], str] = lambda _: ""
    names_on: Callable[[str], dict[str, tuple[str, int, int]]] = lambda _: {}
    _grids: dict[str, CellGrid] = field(default_factory=dict)

    def grid(self, title: str) -> CellGrid:
        """Return the cells of one sheet."""
        if title not in self._grids:
            self._grids[title] = self.load(title)
        return self._grids[title]

    def forget(self) -> None:
        """Let the cells go, where memory is wanted; they are read again when asked for."""
        self._grids.clear()

    def formula(self, title: str, row: int, column: int) -> str:
        """Return the formula of a cell as it stands in the file; empty where there is none."""
        cell_at = rf'<(?:\w+:)?c r="{cell_name(row, column)}"[^>]*><(?:\w+:)?f[^>]*>([^<]*)<'
        match = re.search(cell_at, self.text(title))
        return (
            match[1].replace("&quot;", '"').replace("&lt;", "<").replace("&gt;", ">")
            if match
            else ""
        )


@lru_cache(maxsize=2**15)
def column_letters(column: int) -> str:
    """Return the letters of a column counted from 1.

    >>> column_letters(28)
    'AB'
    """
    letters = ""
    while column > 0:
        column, rest = divmod(column - 1, 26)
        letters = chr(65 + rest) + letters
    return letters


@lru_cache(maxsize=2**15)
def column_number(letters: str) -> int:
    """Return the number, counted from 1, of a column's letters.

    >>> column_number("AB")
    28
    """
    number = 0
    for letter in letters.upper():
        number = number * 26 + ord(letter) - 64
    return number


def cell_name(row: int, column: int) -> str:
    """Return a cell's name.

    Raises
    ------
    InputError
        If no spreadsheet has such a row or column.

    Examples
    --------
    >>> cell_name(3, 2)
    'B3'
    """
    if not (0 < row <= LAST_ROW and 0 < column <= LAST_COLUMN):
        raise InputError(f"row {row}, column {column}: a sheet ends at {LAST_ROW}, {LAST_COLUMN}.")
    return f"{column_letters(column)}{row}"


def fixed_cell(row: int, column: int) -> str:
    """Return a cell's name as formulas keep it when they are copied.

    >>> fixed_cell(3, 2)
    '$B$3'
    """
    return f"${column_letters(column)}${row}"


def split_cell(reference: str) -> tuple[int, int]:
    """Return row and column of a cell's name, dollar signs allowed.

    >>> split_cell("$B$3")
    (3, 2)
    """
    plain = reference.replace("$", "")
    letters = plain.rstrip("0123456789")
    return int(plain[len(letters) :]), column_number(letters)


def split_area(reference: str) -> tuple[int, int, int, int]:
    """Return (top, left, bottom, right) of a range or of one cell.

    >>> split_area("B3:D9")
    (3, 2, 9, 4)
    """
    first, _, last = reference.partition(":")
    top, left = split_cell(first)
    bottom, right = split_cell(last or first)
    return top, left, bottom, right


def quoted_title(title: str) -> str:
    """Return a sheet's title as references write it.

    Examples
    --------
    >>> quoted_title("Tom's wall")
    "'Tom''s wall'"
    """
    escaped = title.replace("'", "''")
    return f"'{escaped}'"


def plain_title(written: str) -> str:
    """Return a sheet's title from what stands before the "!" of a reference.

    Examples
    --------
    >>> plain_title("'Tom''s wall'"), plain_title("Points")
    ("Tom's wall", 'Points')
    """
    if len(written) > 1 and written[0] == written[-1] == "'":
        return written[1:-1].replace("''", "'")
    return written


def date_of_iso(text: str) -> Value:
    """Return a date stored as ISO text (strict workbooks), the text where it is none."""
    try:
        return CellDate(datetime.fromisoformat(text.strip().removesuffix("Z")), "d.m.yyyy")
    except ValueError:
        return text


def date_of_serial(serial: float, *, since_1904: bool) -> datetime:
    """Return the moment a spreadsheet's day number stands for."""
    origin = datetime(1904, 1, 1) if since_1904 else datetime(1899, 12, 30)
    # Day 60 of the 1900 calendar is the 29 February that never was; before it, days are one off.
    if not since_1904 and 0 < serial < 60:
        serial += 1
    return origin + timedelta(days=serial)


def with_names(text: str, names: Mapping[str, str]) -> str:
    """Return a formula with names in place of the single cells that they lead to."""
    for name, place in names.items() if "!" in text else ():
        cell = re.escape(place).replace("'", "'?")
        text = re.sub(rf"{cell}(?![\d:])", name, text, flags=re.IGNORECASE)
    return text
