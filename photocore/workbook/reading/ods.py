"""Reading .ods: values, dates, errors, hidden rows, merged cells and names."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from xml.etree.ElementTree import Element

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.workbook.reading.grid import (
    CellDate,
    CellFault,
    CellGrid,
    SheetFile,
    Value,
    named_number,
    plain_title,
    split_cell,
)
from photocore.workbook.reading.package import (
    local,
    open_package,
    read_part,
    understood,
    xml_events,
)

#: Repeated cells with content beyond these are a decompression bomb, not a survey.
_MOST_COLUMNS = 16384
_MOST_CELLS = 20_000_000
_DRAWINGS = tuple(
    f"{{urn:oasis:names:tc:opendocument:xmlns:{kind}:1.0}}" for kind in ("drawing", "dr3d")
)
_BLANKS = {"tab": "\t", "line-break": "\n"}
#: Whole numbers with leading zeros, or with letters before them.
_SHOWN = re.compile(r"0\d+|[^\W\d_]+\d+")
_FAULTS = re.compile(r"(#[A-Z0-9/]+[!?]?|Err:\d+)")


def open_ods(path: Path, *, max_rows: int) -> SheetFile:
    """Open an OpenDocument spreadsheet; all its sheets are read at once.

    Raises
    ------
    InputError
        If the file is not a spreadsheet, is encrypted, damaged or unsafe.
    """
    with open_package(path) as package:
        members = set(package.namelist())
        if "content.xml" not in members:
            raise InputError(f"{path}: is a zip file but not an OpenDocument spreadsheet.")
        if "META-INF/manifest.xml" in members and b"encryption-data" in read_part(
            path, package, "META-INF/manifest.xml"
        ):
            raise InputError(f"{path}: is protected by a password; save it without one.")
        reader = _OdsReader(path, max_rows)
        with understood(lambda: f"{path}: damaged, a cell cannot be understood."):
            for event, element in xml_events(path, package, "content.xml", "start", "end"):
                if event == "start":
                    reader.start(local(element.tag), element)
                else:
                    reader.end(local(element.tag), element)
    if not reader.grids:
        raise InputError(f"{path}: the OpenDocument file has no sheet.")
    grids = {grid.title: grid for grid in reader.grids}
    titles = sorted(grids, key=reader.hidden_sheets.__contains__)
    return SheetFile(label=path.name, titles=titles, load=grids.__getitem__, names=reader.names)


@dataclass(slots=True)
class _OdsReader:
    """Builds the grids from the elements of content.xml."""

    path: Path
    max_rows: int
    grids: list[CellGrid] = field(default_factory=list)
    names: dict[str, tuple[str, int, int]] = field(default_factory=dict)
    hidden_sheets: set[str] = field(default_factory=set)
    hidden_styles: set[str] = field(default_factory=set)
    row: int = 0
    filled: int = 0

    def start(self, kind: str, element: Element) -> None:
        """Begin a sheet."""
        if kind == "table" and (title := _attributes(element).get("name")) is not None:
            self.grids.append(CellGrid(title))
            self.row = 0
            if _attributes(element).get("style-name") in self.hidden_styles:
                self.hidden_sheets.add(title)

    def end(self, kind: str, element: Element) -> None:
        """Take what is complete: a row, a style, a name."""
        if kind == "table-row":
            if self.grids:
                self.end_row(element)
            element.clear()
        elif kind == "style":
            inner = (_attributes(part) for part in element if local(part.tag) == "table-properties")
            if any(attributes.get("display") == "false" for attributes in inner):
                self.hidden_styles.add(_attributes(element).get("name", ""))
        elif kind == "named-range":
            attributes = _attributes(element)
            reference = attributes.get("cell-range-address", "")
            match = re.fullmatch(r"\$?('(?:[^']|'')+'|[^'.]+)\.(\$?[A-Z]+\$?\d+)", reference)
            if match:
                key = attributes.get("name", "").casefold()
                self.names[key] = (plain_title(match[1]), *split_cell(match[2]))

    def end_row(self, element: Element) -> None:
        """Store one row, as often as it is repeated."""
        grid, attributes = self.grids[-1], _attributes(element)
        repeat = int(attributes.get("number-rows-repeated", "1"))
        first = self.row + 1
        self.row += repeat
        cells = self.cells(element, first, repeat)
        for row in range(first, self.row + 1) if cells else ():
            if len(grid.rows) >= self.max_rows:
                grid.truncated = True
                return
            grid.rows[row] = dict(cells)
            if attributes.get("visibility", "visible") != "visible":
                grid.hidden.add(row)

    def cells(self, element: Element, row: int, row_repeat: int) -> dict[int, Value]:
        """Return the cells of one row, each as often as it is repeated."""
        cells: dict[int, Value] = {}
        last = 0
        for cell in element:
            if local(cell.tag) not in ("table-cell", "covered-table-cell"):
                continue
            attributes = _attributes(cell)
            repeat = int(attributes.get("number-columns-repeated", "1"))
            first, last = last + 1, last + repeat
            down = int(attributes.get("number-rows-spanned", "1"))
            across = int(attributes.get("number-columns-spanned", "1"))
            if down > 1 or across > 1:
                self.grids[-1].merged.append((row, first, row + down - 1, first + across - 1))
            value = _value(attributes, cell)
            if value is None:
                continue
            self.filled += repeat * row_repeat
            if last > _MOST_COLUMNS or self.filled > _MOST_CELLS:
                raise InputError(remark("book.repeats", of=self.path))
            cells.update(dict.fromkeys(range(first, last + 1), value))
        return cells


def _attributes(element: Element) -> dict[str, str]:
    return {local(key): value for key, value in element.items()}


def _paragraphs(element: Element) -> Iterator[str]:
    """Yield the paragraphs of a cell; its comment and what is drawn upon it do not count."""
    for child in element:
        kind = local(child.tag)
        if kind == "p":
            yield _text(child)
        elif kind != "annotation" and not child.tag.startswith(_DRAWINGS):
            yield from _paragraphs(child)


def _text(element: Element) -> str:
    """Return the text of a paragraph."""
    pieces = [element.text or ""]
    for child in element:
        kind = local(child.tag)
        if kind == "s":
            pieces.append(" " * min(int(_attributes(child).get("c", "1")), 1000))
        elif kind != "annotation":
            pieces.append(_BLANKS.get(kind) or _text(child))
        pieces.append(child.tail or "")
    return "".join(pieces)


def _value(attributes: dict[str, str], cell: Element) -> Value | None:
    """Return the typed value of a cell, None when it is blank."""
    kind = attributes.get("value-type", "")
    text = "\n".join(_paragraphs(cell))
    if "formula" in attributes and _FAULTS.fullmatch(text.strip()):
        return CellFault(text.strip())
    if kind in ("float", "percentage", "currency"):
        number = float(attributes["value"]) if "value" in attributes else None
        return named_number(number, text) if number and _SHOWN.fullmatch(text) else number
    if kind == "boolean":
        return attributes.get("boolean-value") == "true"
    if kind == "date":
        moment = datetime.fromisoformat(attributes.get("date-value", "").removesuffix("Z"))
        # The shown text tells the format: "01.05." or "1-May" was typed as a number.
        return CellDate(moment.replace(tzinfo=None), "d.m.yyyy")
    if kind == "time":
        return CellDate(datetime(1899, 12, 30), "h:mm")
    return attributes.get("string-value", text) or None
