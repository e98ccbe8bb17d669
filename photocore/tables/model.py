"""What is asked of a table and what comes back."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError
from photocore.provenance import note_remark
from photocore.remarks import remark
from photocore.workbook import cell_name, column_letters

#: Coordinates of one point in several rows may differ by this much.
_SAME = 1e-6
#: Columns by letter: point, northing, easting, elevation, description.
_ORDER = re.compile(r"(?=\w{3})P?(?:NE|EN)[ZH]?D?")
_LETTERS = {"P": "id", "Z": "H", "D": "-"}

Kind = Literal["number", "integer", "flag", "text"]


@dataclass(frozen=True, slots=True)
class Column:
    """A column that a command understands.

    Parameters
    ----------
    key : str
        Stable name, also a heading.
    aliases : tuple of str
        Other headings, in any language; several columns may share one (``"x"`` for ``x1`` and
        ``x2``): the first column with that heading goes to the first of them, and so on.
    kind : {"number", "integer", "flag", "text"}
        Numbers, integers and flags (1/0, yes/no, true/false) become float64 with NaN where blank;
        texts become ``str``, with numbers that are whole written without a decimal point.
    required : bool
        Whether a table without this column is refused. Blank cells are left to the caller.
    unit : str
        The unit expected when neither the heading nor the cell says one, for messages.
    any_length : bool
        Whether feet are taken, and made metres, although no unit is expected; as where it is "m".
    """

    key: str
    aliases: tuple[str, ...] = ()
    kind: Kind = "number"
    required: bool = False
    unit: str = ""
    any_length: bool = False


@dataclass(slots=True, kw_only=True)
class Table:
    """A table read from a file, with the way back to its cells.

    Parameters
    ----------
    file, sheet : str
        Where it was found; the sheet is empty for text files.
    values : dict
        Key to float64 array (NaN where blank) or list of str (empty where blank). Every column
        asked for is there, also those the file lacks (all blank; see ``present``).
    present : frozenset of str
        Keys whose column exists in the file.
    units : dict
        Key to the unit its heading or cells say (``"mm"``); absent where they say none.
    headings : dict
        Key to the heading as it stands in the file.
    rows : list of int
        Row of the sheet (or record of the text file) of each entry.
    columns : dict
        Key to column number, counted from 1.
    blocks : list of str
        Label of the block each entry belongs to (a row that holds only a photo number starts
        one); empty where there are none.
    remarks : list of str
        What was done that the user should know: hidden rows used, rows left out, ...
    typed_units : set of str
        Keys whose unit every cell says itself, and no heading.
    text_cells : list of str
        Cells of a sheet whose number was typed as text: formulas do not see such numbers.
    feet : dict
        Key to the foot (``ft``, ``ftUS``) of each column that was converted to metres.
    strange : tuple of str
        Headings of numbers that are none of the columns asked for.
    """

    file: str
    sheet: str
    values: dict[str, FloatArray | list[str]]
    present: frozenset[str]
    rows: list[int]
    columns: dict[str, int]
    units: dict[str, str] = field(default_factory=dict)
    headings: dict[str, str] = field(default_factory=dict)
    blocks: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    typed_units: set[str] = field(default_factory=set)
    text_cells: list[str] = field(default_factory=list)
    feet: dict[str, str] = field(default_factory=dict)
    strange: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def numbers(self, key: str) -> FloatArray:
        """Return a column of numbers, shape (n,)."""
        value = self.values[key]
        if isinstance(value, list):
            raise TypeError(f"{key} is a column of text")
        return value

    def texts(self, key: str) -> list[str]:
        """Return a column of texts."""
        value = self.values[key]
        if not isinstance(value, list):
            raise TypeError(f"{key} is a column of numbers")
        return value

    def cell(self, row: int, key: str) -> str:
        """Return the name of a cell, e.g. ``"C17"``; only its row where the column is missing."""
        column = self.columns.get(key)
        return cell_name(self.rows[row], column) if column else f"row {self.rows[row]}"

    def error(self, row: int, key: str, message: str) -> CellError:
        """Return a complaint about one cell, to be raised or gathered in a `WorkbookError`."""
        return CellError(
            message, file=self.file, sheet=self.sheet, cell=self.cell(row, key), column=key
        )

    def repeated(self, key: str) -> list[CellError]:
        """Return a complaint for each text of a column that occurred before; blanks do not count.

        The messages name both cells.
        """
        first: dict[str, int] = {}
        errors = []
        for row, text in enumerate(self.texts(key)):
            if text and first.setdefault(text, row) != row:
                earlier = self.cell(first[text], key)
                message = f'"{text}" stands in {earlier} already; give each point its own name.'
                errors.append(self.error(row, key, message))
        return errors

    def first_rows(self, key: str, values: FloatArray, errors: list[CellError]) -> list[int]:
        """Return the first row of each name; rows without a name stand for themselves.

        Parameters
        ----------
        key : str
            The column of names.
        values : ndarray, shape (n, k)
            What all rows of a name agree in; blanks of its first row are filled from the others.
        errors : list
            Takes a complaint about each row that contradicts the first.
        """
        first: dict[str, int] = {}
        for row, name in enumerate(self.texts(key)):
            place = first.setdefault(name or f" {row}", row)
            if place == row:
                continue
            if np.any(np.abs(values[row] - values[place]) > _SAME):
                message = (
                    f'"{name}" stands in {self.cell(place, key)} already, with other coordinates; '
                    "give each point its own name, or correct one."
                )
                errors.append(self.error(row, key, message))
            blank = np.isnan(values[place])
            values[place, blank] = values[row, blank]
        return [*first.values()]

    def once(self, key: str, values: FloatArray, errors: list[CellError]) -> list[int]:
        """Return `first_rows`, and say so where a name has several that agree."""
        rows = self.first_rows(key, values, errors)
        if len(rows) < len(self) and not errors:
            self.remarks.append(remark("table.once", rows=len(self), count=len(rows)))
            note_remark(f"{self.file}: {self.remarks[-1]}")
        return rows

    def too_large(self, keys: Sequence[str], largest: float) -> list[CellError]:
        """Return a complaint about each number beyond a limit: a slip, or a broken formula."""
        return [
            self.error(row, key, f"found {numbers[row]:g}, which is too large; correct it.")
            for key, numbers in ((key, self.numbers(key)) for key in keys)
            for row in np.flatnonzero(np.abs(numbers) > largest).tolist()
        ]

    def in_unit(
        self, key: str, factors: Mapping[str, float], errors: list[CellError]
    ) -> FloatArray:
        """Return a column of numbers in the first of some units, complaining about any other.

        Parameters
        ----------
        key : str
            Of the column.
        factors : mapping
            Unit to what brings its numbers to the first.
        errors : list
            Takes the complaint.
        """
        target = next(iter(factors))
        symbol = self.units.get(key) or target
        if symbol not in factors:
            errors.append(self.unit_error(key, symbol, target))
        return self.numbers(key) * factors.get(symbol, 1.0)

    def unit_error(self, key: str, symbol: str, target: str) -> CellError:
        """Return the complaint about a heading with another unit than expected."""
        message = (
            f'the heading "{self.headings.get(key, key)}" says [{symbol}], expected [{target}].'
        )
        return CellError(message, file=self.file, sheet=self.sheet, column=key)


@dataclass(slots=True, kw_only=True)
class NamedValues:
    """Single values found by name: a defined name, or a label with its value to the right.

    Parameters
    ----------
    file : str
        Where they were found.
    values : dict
        Key to number (NaN where blank or absent) or text (empty where blank or absent).
    places : dict
        Key to (sheet, cell) of every value whose place was found, blank or not.
    remarks : list of str
        What the user should know.
    text_cells : list of str
        Cells whose number was typed as text: formulas do not see such numbers.
    """

    file: str
    values: dict[str, float | str]
    places: dict[str, tuple[str, str]]
    remarks: list[str] = field(default_factory=list)
    text_cells: list[str] = field(default_factory=list)

    def number(self, key: str) -> float:
        """Return a number, NaN where blank or absent."""
        value = self.values[key]
        return value if isinstance(value, float) else np.nan

    def text(self, key: str) -> str:
        """Return a text, empty where blank or absent."""
        value = self.values[key]
        return value if isinstance(value, str) else ""

    def has(self, key: str) -> bool:
        """Whether a value was found that is not blank."""
        value = self.values[key]
        return bool(value) if isinstance(value, str) else not np.isnan(value)

    def given(self, key: str) -> float | None:
        """Return a number, None where blank, absent or never asked for."""
        return self.number(key) if key in self.values and self.has(key) else None

    def cell(self, key: str) -> str:
        """Return the name of the value's cell, empty where it was not found."""
        return self.places.get(key, ("", ""))[1]

    def error(self, key: str, message: str) -> CellError:
        """Return a complaint about one value, to be raised or gathered in a `WorkbookError`."""
        sheet, cell = self.places.get(key, ("", ""))
        return CellError(message, file=self.file, sheet=sheet, cell=cell, column=key)


def parse_column_map(text: str, keys: Sequence[str] = ()) -> dict[str, str]:
    """Return key -> heading or column letter from what a user typed.

    Parameters
    ----------
    text : str
        ``"s1=My column, s2=C"``, or the keys in the order of the file's columns for tables
        without headings: ``"id,X,Y"`` (``-`` skips a column), or ``PNEZD``.
    keys : sequence of str
        The keys that exist; empty accepts any. Upper and lower case may be mixed up.

    Raises
    ------
    InputError
        If an entry cannot be understood, a key is unknown or named twice.

    Examples
    --------
    >>> parse_column_map("id, X, -, Y")
    {'id': 'A', 'X': 'B', 'Y': 'D'}
    >>> parse_column_map("PNEZD", ("id", "E", "N", "H"))
    {'id': 'A', 'N': 'B', 'E': 'C', 'H': 'D'}
    >>> parse_column_map("s1 = distance 1; s2=C")
    {'s1': 'distance 1', 's2': 'C'}
    """
    if _ORDER.fullmatch(text.strip()) and text.strip() not in keys:
        text = ",".join(_LETTERS.get(letter, letter) for letter in text.strip())
    entries = [entry.strip() for entry in re.split(r"[,;]", text)]
    named = any("=" in entry for entry in entries)
    places: dict[str, str] = {}
    for position, entry in enumerate(entries, start=1):
        if named:
            key, equals, place = (part.strip() for part in entry.partition("="))
            if not (key and equals and place):
                raise InputError(remark("table.no_map", entry=entry))
        elif entry in ("-", ""):
            continue
        else:
            key, place = entry, column_letters(position)
        key = _known(key, keys)
        if key in places:
            raise InputError(f'--columns: "{key}" is named twice.')
        places[key] = place
    if not places:
        raise InputError("--columns: names no column; write for example id=A,s1=B,s2=C.")
    return places


def _known(key: str, keys: Sequence[str]) -> str:
    if not keys or key in keys:
        return key
    alike = [name for name in keys if name.casefold() == key.casefold()]
    if len(alike) == 1:
        return alike[0]
    raise InputError(f'--columns: there is no column "{key}"; known are {", ".join(keys)}.')
