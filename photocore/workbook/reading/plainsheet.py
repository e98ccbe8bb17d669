"""Sheets in the plain form that spreadsheet programs write, taken apart ten times faster.

An XML parser reports five events a cell; one regular expression finds the whole cell. What does not
fit it (prefixes, comments, attributes and elements beyond the usual) is left to the parser.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

#: Larger sheets are read piece by piece, to spare memory. [bytes]
LARGEST = 256 * 2**20
_ROW = re.compile(rb'\s*<row r="(\d+)"((?:\s[\w:]+="[^"<]*")*)\s*(/?)>')
_OTHER = re.compile(rb"encoding\s*=\s*[\"'](?!utf-?8)", re.IGNORECASE)
_END = re.compile(rb"\s*</row>")
#: Without a way back, since no other reading of a cell would fit: a third faster.
_CELL = re.compile(
    rb'\s*+<c r="([A-Z]{1,3}+)(\d++)"(?: s="(\d++)")?+(?: t="(\w++)")?+\s*+(?:/>|>'
    rb'(<f(?:\s[\w:]++="[^"<]*+")*+\s*+(?:/>|>[^<]*+</f>))?+'
    rb'(<v>[^<]*+</v>|<v\s*+/>|<is><t(?: xml:space="preserve")?+>[^<]*+</t></is>)?+</c>)'
)
#: The same parts of cells, and the opening tag, in the pattern of a whole row.
_FORMULA = rb'<f(?:\s[\w:]++="[^"<]*+")*+\s*+(?:/>|>[^<]*+</f>)'
_PLAIN_FORMULA = rb"<f>[^<]*+</f>"
_OPENING = rb'\s*+(<row r="(\d++)"((?:\s[\w:]++="[^"<]*+")*+)\s*+>)'
#: A pattern of sixty cells takes 30 ms to compile, and saves 0.15 ms a row read and 0.5 ms a row
#: changed: it is made for a layout that was met so often. So many of the forms met last are tried:
#: one that does not fit costs up to a fifth of taking the row apart. Sheets without repeated rows
#: are not searched for ever.
_OFTEN, _TRIED, _MOST, _PATIENCE = 60, 4, 32, 3000


class NotPlain(Exception):
    """The sheet has another form; nobody but the caller hears of it."""


class FormCell(NamedTuple):
    """What all cells with a text in one place of a row's form have in common."""

    letters: bytes
    style: bytes | None
    kind: bytes | None
    has_formula: bool
    is_inline: bool


@dataclass(frozen=True, slots=True, eq=False)
class RowForm:
    """Rows that differ only in numbers, texts and formulas: one match takes a whole row apart.

    Parameters
    ----------
    pattern : re.Pattern
        Groups: opening tag, row number, other attributes, then by turns what stands between texts,
        and a text.
    cells : tuple of FormCell
        The cells with a text, in their order.
    """

    pattern: re.Pattern[bytes]
    cells: tuple[FormCell, ...]


class PlainRow(NamedTuple):
    """A row: its number, its other attributes as they stand, where it lies, its cells.

    Groups of a cell's match: letters, row, style, type, formula element, value element. A row of a
    form has parts instead: by turns what stands between the texts of its cells, and a text.
    """

    number: int
    attributes: bytes
    start: int
    cells: list[re.Match[bytes]]
    end: int
    is_closed: bool
    form: RowForm | None = None
    parts: Sequence[bytes] = ()
    body: int = 0


def sheet_data(data: bytes) -> tuple[int, int]:
    """Return where the rows of a sheet begin and end.

    Raises
    ------
    NotPlain
        If the sheet has another form.
    """
    start, end = data.find(b"<sheetData>"), data.rfind(b"</sheetData>")
    head = data[: max(start, 0)]
    if start < 0 or end < start or len(data) > LARGEST or b"<!" in head or _OTHER.search(head):
        raise NotPlain
    if data.find(b"\r", start, end) >= 0 or data.find(b"<sheetData", start + 1, end) >= 0:
        raise NotPlain
    return start + len(b"<sheetData>"), end


def plain_rows(data: bytes, start: int, end: int) -> Iterator[PlainRow]:
    """Yield the rows of a sheet in their order.

    Parameters
    ----------
    data : bytes
        The sheet's XML.
    start, end : int
        Where its rows lie, from `sheet_data`.

    Raises
    ------
    NotPlain
        If a row or cell has another form.
    """
    position = start
    row_at, end_at = _ROW.match, _END.match
    forms = _Forms()
    while True:
        formed = forms.row(data, position, end)
        if formed is not None:
            yield formed
            position = formed.end
            continue
        row = row_at(data, position, end)
        if row is None:
            break
        begin = row.end() - len(row[0].lstrip())
        position = row.end()
        if row[3]:
            yield PlainRow(int(row[1]), row[2], begin, [], position, True)
            continue
        cells = _cells(data, position, end, row[1])
        body, position = position, cells[-1].end() if cells else position
        closing = end_at(data, position, end)
        if closing is None:
            raise NotPlain
        yield PlainRow(int(row[1]), row[2], begin, cells, position, False)
        position = closing.end()
        forms.learn(data, body, cells, position)
    if data[position:end].strip():
        raise NotPlain


def with_cells(data: bytes, row: PlainRow) -> PlainRow:
    """Return a row with its cells, taken apart one by one if it was found by its form."""
    if row.form is None:
        return row
    cells = _cells(data, row.body, row.end, None)
    end = cells[-1].end() if cells else row.body
    return PlainRow(row.number, row.attributes, row.start, cells, end, False)


def _cells(data: bytes, position: int, end: int, number: bytes | None) -> list[re.Match[bytes]]:
    """Return the cells from a position on; all must lie in the row of a number."""
    cells = []
    cell_at = _CELL.match
    while (cell := cell_at(data, position, end)) is not None:
        if number is not None and cell[2] != number:
            raise NotPlain
        cells.append(cell)
        position = cell.end()
    return cells


@dataclass(slots=True)
class _Forms:
    """The forms of rows met so far, the last met first."""

    known: list[RowForm] = field(default_factory=list)
    layouts: dict[tuple[object, ...], RowForm | None] = field(default_factory=dict)
    met: Counter[tuple[object, ...]] = field(default_factory=Counter)
    patience: int = _PATIENCE

    def row(self, data: bytes, position: int, end: int) -> PlainRow | None:
        """Return the row at a position if it has one of the forms met last."""
        for rank, form in enumerate(self.known[:_TRIED]):
            match = form.pattern.match(data, position, end)
            if match is not None:
                self.patience += 1
                if rank:
                    self.known.insert(0, self.known.pop(rank))
                _, number, attributes, *parts = match.groups()
                start, body = match.span(1)
                return PlainRow(
                    int(number), attributes, start, [], match.end(), False, form, parts, body
                )
        return None

    def learn(self, data: bytes, body: int, cells: list[re.Match[bytes]], end: int) -> None:
        """Make a form of a row's layout once it was met often enough to be worth it."""
        if self.patience < 0 or len(self.known) > _MOST:
            return
        self.patience -= 1
        layout = tuple([_layout(cell) for cell in cells])
        form = self.layouts.get(layout)
        if form is not None:
            self.known.remove(form)
            self.known.insert(0, form)
            return
        self.met[layout] += 1
        if layout not in self.layouts and self.met[layout] >= _OFTEN:
            self.layouts[layout] = form = _form(data, body, cells, end)
            if form is not None:
                self.known.insert(0, form)


def _layout(cell: re.Match[bytes]) -> tuple[bytes, bytes | None, bytes | None, bool, bytes, str]:
    """Return what makes a cell one of a form: where, style, type, formula, tags before its text.

    The last one tells what of a text may stand there: ``any``, ``some``, or ``none``.
    """
    letters, _, style, kind, formula, value = cell.groups()
    head, most = b"", "none"
    if value is not None and not value.endswith(b"/>"):
        is_inline = value.startswith(b"<is>")
        head = value[: value.index(b">", 4 if is_inline else 0) + 1]
        has_text = not value.startswith(b"</", len(head))
        most = "any" if is_inline or kind == b"str" else "some" if has_text else "none"
    return letters, style, kind, formula is not None, head, most


def _form(data: bytes, body: int, cells: list[re.Match[bytes]], end: int) -> RowForm | None:
    """Return the form of a row from its body to its end; None where that would be of no use."""
    form: list[FormCell] = []
    source, position = [_OPENING, b"("], body
    for cell in cells:
        letters, style, kind, has_formula, head, most = _layout(cell)
        is_inline = head.startswith(b"<is>")
        if is_inline != (kind == b"inlineStr" and most != "none"):
            return None
        source += [re.escape(data[position : cell.end(1)]), rb"\2"]
        position = cell.end(2)
        if has_formula:
            if most == "none":
                return None  # never calculated: readers want the formula itself
            opening = _PLAIN_FORMULA if cell[5].startswith(b"<f>") else _FORMULA
            source += [re.escape(data[position : cell.start(5)]), opening]
            position = cell.end(5)
        if most != "none":
            text = cell.start(6) + len(head)
            characters = b"[^<]*+" if most == "any" else b"[^<]++"
            source += [re.escape(data[position:text]), b")(", characters, b")("]
            position = data.index(b"<", text)
            form.append(FormCell(letters, style, kind, has_formula, is_inline))
    source += [re.escape(data[position:end]), b")"]
    if not form or len({cell[1] for cell in cells}) < len(cells):
        return None
    return RowForm(re.compile(b"".join(source)), tuple(form))
