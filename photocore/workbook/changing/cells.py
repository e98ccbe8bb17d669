"""Cells as XML text: numbers that read back to the last bit, text that stays text."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Literal, NamedTuple

import numpy as np

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.workbook.reading.grid import column_letters

#: Most characters of a cell; Excel cuts or repairs longer ones.
LONGEST_TEXT = 32767

#: What a cell can be given. NaN stands for "no result" and is shown as #N/A.
CellValue = float | int | str | bool | None

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\ufffe\uffff\ud800-\udfff]|_(?=x[0-9A-Fa-f]{4}_)")
_MARKUP = re.compile(r"[&<>]")
_ENTITIES = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
_CELL = r"(\$?[A-Z]{1,3})(\$?)(\d{1,7})"
_REFERENCE = re.compile(rf"(?<![\w.$]){_CELL}(?![\w(.!\[])")
_ROWS = re.compile(r"(?<![\w.$])(\$?)(\d{1,7}):(\$?)(\d{1,7})(?![\w.(])")
#: Texts, quoted sheet names and structured references hold no cell to be moved.
_OPAQUE = re.compile(r"\"(?:[^\"]|\"\")*\"|'(?:[^']|'')*'|\[(?:[^\[\]]|\[[^\]]*\])*\]")


def escape(text: str) -> str:
    """Return text for an XML element; characters XML cannot hold become ``_xHHHH_``."""
    if _CONTROL.search(text):
        text = _CONTROL.sub(lambda match: f"_x{ord(match[0]):04X}_", text)
    if _MARKUP.search(text):
        text = _MARKUP.sub(lambda match: _ENTITIES[match[0]], text)
    return text


def name_cell(name: str) -> CellValue:
    """Return a point's name as a cell: plain whole numbers as numbers, all else as text.

    Examples
    --------
    >>> name_cell("7"), name_cell("007"), name_cell("=1+1")
    (7, '007', '=1+1')
    """
    return int(name) if name.isdecimal() and len(name) < 10 and str(int(name)) == name else name


def number_text(value: float) -> str:
    """Return a finite number as cells hold it.

    >>> number_text(2.0), number_text(1e-7)
    ('2', '1e-07')
    """
    return repr(value).removesuffix(".0")


def type_and_content(value: CellValue, prefix: str, *, formula: bool) -> tuple[str, str]:
    """Return a cell's ``t`` attribute (empty for numbers) and the XML of its value.

    Parameters
    ----------
    value : float, int, str, bool or None
        NaN becomes the error value #N/A, None no value.
    prefix : str
        Namespace prefix of the sheet with its colon, empty if it has none.
    formula : bool
        Whether the value is the result of a formula (its text is stored in another way).

    Raises
    ------
    InputError
        If a number is infinite or a text is longer than a cell can hold.
    """
    if type(value) is float and value - value == 0.0:  # finite, by far the most frequent
        return "", f"<{prefix}v>{number_text(value)}</{prefix}v>"
    if value is None:
        return "", ""
    if isinstance(value, str):
        if len(value) > LONGEST_TEXT:
            about = {"start": repr(value[:20]), "count": len(value), "limit": LONGEST_TEXT}
            raise InputError(remark("book.text_too_long", **about))
        if not formula:
            t, inline = f"{prefix}t", f"{prefix}is"
            text = f'<{t} xml:space="preserve">{escape(value)}</{t}>'
            return "inlineStr", f"<{inline}>{text}</{inline}>"
        kind, text = "str", escape(value)
    elif isinstance(value, bool | np.bool_):
        kind, text = "b", str(int(value))
    elif math.isnan(value):
        kind, text = "e", "#N/A"
    elif math.isinf(value):
        raise InputError("an infinite number cannot be written to a cell.")
    else:
        return type_and_content(float(value), prefix, formula=formula)
    return kind, f"<{prefix}v>{text}</{prefix}v>"


def result_texts(values: Sequence[CellValue]) -> tuple[Sequence[str], Sequence[bytes | None]]:
    """Return the ``t`` attributes and the texts of many results, as `type_and_content` does.

    Examples
    --------
    >>> result_texts([2.0, 0.5]), result_texts(["a<b", None])
    ((['', ''], [b'2', b'0.5']), (['str', ''], [b'a&lt;b', None]))
    """
    if {*map(type, values)} == {float}:
        joined = "\n".join([*map(repr, values), ""])
        if "n" not in joined:  # neither nan nor inf
            return [""] * len(values), joined.replace(".0\n", "\n").encode().split(b"\n")[:-1]
    if {*map(type, values)} == {str}:  # few of them differ: flags, and empty ones
        known = {value: type_and_content(value, "", formula=True) for value in {*values}}
        cells = [known[value] for value in values]
    else:
        cells = [type_and_content(value, "", formula=True) for value in values]
    texts = [content[3:-4].encode() if content else None for _, content in cells]
    return [kind for kind, _ in cells], texts


def cell_xml(
    reference: str, value: CellValue, formula: str = "", prefix: str = "", style: str = ""
) -> str:
    """Return the XML of a new cell, empty where nothing would stand in it.

    Parameters
    ----------
    reference : str
        Its name, e.g. ``"B3"``.
    value : float, int, str, bool or None
        Its value, or the cached result of its formula.
    formula : str
        Formula without the equals sign, English names, comma as separator, as `escape` leaves it;
        empty for a typed value.
    prefix : str
        Namespace prefix of the sheet with its colon, e.g. ``"x:"``.
    style : str
        Index of its cell format as text, empty for the default.

    Examples
    --------
    >>> cell_xml("B3", 1.5, "A3*3", style="2")
    '<c r="B3" s="2"><f>A3*3</f><v>1.5</v></c>'
    """
    kind, content = type_and_content(value, prefix, formula=bool(formula))
    attributes = f' s="{style}"' if style else ""
    if kind:
        attributes += f' t="{kind}"'
    if formula:
        content = f"<{prefix}f>{formula}</{prefix}f>{content}"
    elif not content:
        return f'<{prefix}c r="{reference}"{attributes}/>' if style else ""
    return f'<{prefix}c r="{reference}"{attributes}>{content}</{prefix}c>'


class RowFormula:
    """A formula that is copied downwards: relative rows move, all else stays.

    Parameters
    ----------
    text : str
        The formula as it stands in a row, without the equals sign; escaped or not.
    row : int
        That row.

    Examples
    --------
    >>> RowFormula("A2*$B$1+tbl[[#This Row],[s2]]", 2).at(5)
    'A5*$B$1+tbl[[#This Row],[s2]]'
    """

    def __init__(self, text: str, row: int) -> None:
        opaque = [match.span() for match in _OPAQUE.finditer(text)]
        numbers = [match.span(3) for match in _REFERENCE.finditer(text) if not match[2]]
        for match in _ROWS.finditer(text):
            numbers += [match.span(group) for group in (2, 4) if not match[group - 1]]
        self.pieces: list[str] = []
        self.offsets: list[int] = []
        position = 0
        for start, end in sorted(set(numbers)):
            if not any(first <= start < last for first, last in opaque):
                self.pieces.append(text[position:start])
                self.offsets.append(int(text[start:end]) - row)
                position = end
        self.rest = text[position:]

    def at(self, row: int) -> str:
        """Return the formula as it stands in another row."""
        if not self.offsets:
            return self.rest
        moved = [
            f"{piece}{row + offset}"
            for piece, offset in zip(self.pieces, self.offsets, strict=True)
        ]
        return "".join(moved) + self.rest


@dataclass(frozen=True, slots=True)
class RowText:
    """A formula of many rows, with `ROW_MARK` wherever the number of its row belongs.

    Parameters
    ----------
    text : str
        The formula, without the equals sign.
    shared : bool
        Whether the file has it once for all rows. Excel takes that only of cells of the same
        sheet and of names.

    Examples
    --------
    >>> RowText(f"A{ROW_MARK}*3")(7)
    'A7*3'
    """

    text: str
    shared: bool = False

    def __call__(self, row: int) -> str:
        """Return the formula as it stands in a row."""
        return self.text.replace(ROW_MARK, str(row))

    def escaped(self, *, shared: bool = False) -> RowText:
        """Return the formula as `escape` leaves it, its marks as they are."""
        return RowText(ROW_MARK.join(map(escape, self.text.split(ROW_MARK))), shared)


#: What stands for the number of a row; XML cannot hold it, so that it is never part of a text.
ROW_MARK = "\0"


#: What a new cell may do to what stands in its place. ``typed``: replace a typed value, never a
#: formula. ``prepared``: nothing may stand there. ``filled``: what stands there stays, a formula
#: takes the result. ``over``: replace anything.
Rule = Literal["typed", "prepared", "filled", "over"]


class NewCell(NamedTuple):
    """A cell to be made, with its formula as `escape` leaves it and the index of its format.

    A formula may be given as a function of the row, so that it is written only where it is needed.
    """

    value: CellValue
    formula: str | Callable[[int], str] = ""
    style: str = ""
    rule: Rule = "typed"


class NewColumn(NamedTuple):
    """One column of new rows: values, or a formula with its results.

    Parameters
    ----------
    column : int
        Column number, counted from 1.
    values : sequence
        One per row; None leaves the cell empty (or its formula without result).
    style : str
        Index of the cell format as text.
    formula : str or callable, optional
        The formula of all rows, or what returns that of a row by its number, as `escape` leaves it.
    """

    column: int
    values: Sequence[CellValue]
    style: str = ""
    formula: str | Callable[[int], str] | None = None


@dataclass(frozen=True, slots=True)
class NewRows:
    """Rows to be added to a sheet: the first one, how many, their columns from left to right.

    Where rows are there already, the rule says what happens to their cells.
    """

    first: int
    size: int
    columns: Sequence[NewColumn]
    rule: Rule = "prepared"
    by_letters: Mapping[bytes, Sequence[CellValue]] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Note the columns' values by their letters, as a sheet's XML names them."""
        values = {column_letters(column.column).encode(): column.values for column in self.columns}
        object.__setattr__(self, "by_letters", values)

    def cells(self, row: int) -> dict[int, NewCell]:
        """Return the cells of one row by column; none if it is not one of these."""
        index = row - self.first
        if not 0 <= index < self.size:
            return {}
        return {
            column: NewCell(values[index], formula or "", style, self.rule)
            for column, values, style, formula in self.columns
        }

    def results(
        self, first: int, last: int
    ) -> list[tuple[tuple[str, ...], tuple[bytes | None, ...]]]:
        """Return types and texts of the cells of some rows, row by row, as `result_texts` does."""
        part = slice(first - self.first, last - self.first)
        columns = [result_texts(column.values[part]) for column in self.columns]
        kinds = zip(*(own for own, _ in columns), strict=True)
        return [*zip(kinds, zip(*(texts for _, texts in columns), strict=True), strict=True)]

    def xml(self, rows: range, prefix: str) -> Iterator[str]:
        """Yield the XML of the cells of rows, row by row.

        The rows differ by little but their numbers, which take the places of marks all at once.
        """
        part = slice(rows.start - self.first, rows.stop - self.first)
        numbers = range(self.first, self.first + self.size)
        columns = [_column_xml(c, c.values[part], rows, prefix, numbers) for c in self.columns]
        for row, cells in zip(rows, zip(*columns, strict=True), strict=True):
            yield "".join(cells).replace(ROW_MARK, str(row))


def _column_xml(
    column: NewColumn, values: Sequence[CellValue], rows: range, prefix: str, block: range
) -> Iterator[str]:
    """Yield the XML of the cells of a column, with marks for the numbers of their rows."""
    letters, formula = column_letters(column.column), column.formula
    name = f"{letters}{ROW_MARK}"
    if callable(formula) and not isinstance(formula, RowText):
        for row, value in zip(rows, values, strict=True):
            yield cell_xml(name, value, formula(row), prefix, column.style)
        return
    text = formula.text if isinstance(formula, RowText) else formula or ""
    plain = shown = f"<{prefix}f>{text}</{prefix}f>"
    if isinstance(formula, RowText) and formula.shared:
        kind = f'<{prefix}f t="shared" si="{column.column}"'
        shown = f"{kind}/>"
        if rows.start == block.start and values:
            first = cell_xml(name, values[0], text, prefix, column.style)
            area = f"{letters}{block.start}:{letters}{block.stop - 1}"
            yield first.replace(f"<{prefix}f>", f'{kind} ref="{area}">', 1)
            values = values[1:]

    @lru_cache(typed=True)  # flags and blanks are many, and few of them differ
    def cell(value: CellValue) -> str:
        return cell_xml(name, value, text, prefix, column.style).replace(plain, shown)

    head, _, tail = cell(0.5).rpartition("0.5")
    for value in values:
        if isinstance(value, float) and value - value == 0.0:  # by far the most frequent
            yield f"{head}{number_text(float(value))}{tail}"
        else:
            yield cell(value)
