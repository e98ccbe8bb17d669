"""Sheets in the plain form that spreadsheet programs write, taken apart ten times faster.

An XML parser reports five events a cell; one regular expression finds the whole cell. What does not
fit it (prefixes, comments, attributes and elements beyond the usual) is left to the parser.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
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


class NotPlain(Exception):
    """The sheet has another form; nobody but the caller hears of it."""


class PlainRow(NamedTuple):
    """A row: its number, its other attributes as they stand, where it begins, its cells.

    Groups of a cell's match: letters, row, style, type, formula element, value element.
    """

    number: int
    attributes: bytes
    start: int
    cells: list[re.Match[bytes]]
    end: int
    is_closed: bool


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
    row_at, cell_at, end_at = _ROW.match, _CELL.match, _END.match
    while (row := row_at(data, position, end)) is not None:
        number = row[1]
        cells: list[re.Match[bytes]] = []
        begin = row.end() - len(row[0].lstrip())
        position = row.end()
        if row[3]:
            yield PlainRow(int(number), row[2], begin, cells, position, True)
            continue
        while (cell := cell_at(data, position, end)) is not None:
            if cell[2] != number:
                raise NotPlain
            cells.append(cell)
            position = cell.end()
        closing = end_at(data, position, end)
        if closing is None:
            raise NotPlain
        yield PlainRow(int(number), row[2], begin, cells, position, False)
        position = closing.end()
    if data[position:end].strip():
        raise NotPlain
