"""New rows of a sheet, given by columns: thousands of cells without an object for each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from photocore.workbook.cellxml import CellInput, cell_xml, escape, number_text, type_and_content
from photocore.workbook.grid import cell_name, column_letters

_CHUNK = 2000
_CELL = r"(\$?[A-Z]{1,3})(\$?)(\d{1,7})"
_REFERENCE = re.compile(rf"(?<![\w.$]){_CELL}(?![\w(.!\[])")
_ROWS = re.compile(r"(?<![\w.$])(\$?)(\d{1,7}):(\$?)(\d{1,7})(?![\w.(])")
#: Texts, quoted sheet names and structured references hold no cell to be moved.
_OPAQUE = re.compile(r"\"(?:[^\"]|\"\")*\"|'(?:[^']|'')*'|\[(?:[^\[\]]|\[[^\]]*\])*\]")


@dataclass(frozen=True, slots=True)
class NewCell:
    """One cell of a new row.

    Parameters
    ----------
    value : float, int, str, bool or None
        Value, or cached result of the formula.
    formula : str, optional
        Formula without the equals sign.
    style : str
        Index of the cell format as text, empty for the default.
    """

    value: CellInput
    formula: str | None = None
    style: str = ""


class RowFormula:
    """A formula that is copied downwards: relative rows move, all else stays.

    Parameters
    ----------
    text : str
        The formula as it stands in a row, without the equals sign.
    row : int
        That row.

    Examples
    --------
    >>> RowFormula("A2*$B$1+tbl[[#This Row],[s2]]", 2).at(5)
    'A5*$B$1+tbl[[#This Row],[s2]]'
    """

    def __init__(self, text: str, row: int) -> None:
        self.pieces: list[str] = [""]
        self.offsets: list[int] = []
        position = 0
        for opaque in [*_OPAQUE.finditer(text), None]:
            end = opaque.start() if opaque else len(text)
            self._take(text[position:end], row)
            if opaque:
                self.pieces[-1] += opaque[0]
                position = opaque.end()
        self.escaped = [escape(piece) for piece in self.pieces]

    def _take(self, text: str, row: int) -> None:
        """Cut a text at its relative rows."""
        numbers = [m.span(3) for m in _REFERENCE.finditer(text) if not m[2]]
        for match in _ROWS.finditer(text):
            numbers += [match.span(g) for g in (2, 4) if not match[g - 1]]
        position = 0
        for start, end in sorted(set(numbers)):
            self.pieces[-1] += text[position:start]
            self.pieces.append("")
            self.offsets.append(int(text[start:end]) - row)
            position = end
        self.pieces[-1] += text[position:]

    def at(self, row: int) -> str:
        """Return the formula as it stands in another row."""
        return self._joined(self.pieces, row)

    def xml_at(self, row: int) -> str:
        """Return the formula of another row, escaped for XML."""
        return self._joined(self.escaped, row)

    def _joined(self, pieces: Sequence[str], row: int) -> str:
        if not self.offsets:
            return pieces[0]
        text = pieces[0]
        for offset, piece in zip(self.offsets, pieces[1:], strict=True):
            text += f"{row + offset}{piece}"
        return text


@dataclass(slots=True)
class NewColumn:
    """One column of new rows: values, or a formula with its results.

    Parameters
    ----------
    column : int
        Column number, counted from 1.
    values : sequence
        One per row; None leaves the cell empty (or its formula without result).
    style : str
        Index of the cell format as text.
    formula : RowFormula, optional
        Formula of the cells.
    """

    column: int
    values: Sequence[CellInput]
    style: str = ""
    formula: RowFormula | None = None

    def xml(self, first: int, start: int, stop: int, prefix: str) -> list[str]:
        """Return the XML of the cells of some rows."""
        letters, v = column_letters(self.column), f"{prefix}v"
        style = f' s="{self.style}"' if self.style else ""
        cells = []
        for row, value in enumerate(self.values[start:stop], start=first + start):
            formula = ""
            if self.formula is not None:
                formula = f"<{prefix}f>{self.formula.xml_at(row)}</{prefix}f>"
            if type(value) is float and value - value == 0.0:
                text = number_text(value)
                cells.append(
                    f'<{prefix}c r="{letters}{row}"{style}>{formula}<{v}>{text}</{v}></{prefix}c>'
                )
                continue
            if value is None and not formula:
                cells.append(f'<{prefix}c r="{letters}{row}"{style}/>' if style else "")
                continue
            kind, content = type_and_content(value, prefix, formula=bool(formula))
            kind = kind and f' t="{kind}"'
            cells.append(
                f'<{prefix}c r="{letters}{row}"{style}{kind}>{formula}{content}</{prefix}c>'
            )
        return cells


@dataclass(slots=True)
class NewRows:
    """Rows to be added to a sheet.

    Parameters
    ----------
    first, count : int
        First row and number of rows.
    columns : list of NewColumn
        What they hold, from left to right.
    """

    first: int
    count: int
    columns: list[NewColumn] = field(default_factory=list)

    def cells(self, row: int) -> dict[int, NewCell]:
        """Return the cells of one row that hold something or have a format."""
        found = {}
        for column in self.columns:
            value = column.values[row - self.first]
            formula = column.formula.at(row) if column.formula else None
            if value is not None or formula or column.style:
                found[column.column] = NewCell(value, formula, column.style)
        return found

    def xml(self, prefix: str, start: int, stop: int) -> Iterator[str]:
        """Yield the XML of rows, some at a time; ``start`` and ``stop`` count within the block."""
        for begin in range(start, stop, _CHUNK):
            end = min(begin + _CHUNK, stop)
            columns = [column.xml(self.first, begin, end, prefix) for column in self.columns]
            pieces = []
            for row, cells in enumerate(zip(*columns, strict=True), start=self.first + begin):
                pieces.append(f'<{prefix}row r="{row}">{"".join(cells)}</{prefix}row>')
            yield "".join(pieces)


def new_cell_xml(row: int, column: int, cell: NewCell, prefix: str) -> str:
    """Return the XML of one new cell."""
    return cell_xml(
        cell_name(row, column),
        cell.value,
        prefix=prefix,
        style=cell.style,
        formula=cell.formula,
    )
