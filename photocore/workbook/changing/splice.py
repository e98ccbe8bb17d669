"""Changing cells of a sheet's XML in place: every other byte stays as it was."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Mapping
from operator import itemgetter
from pathlib import Path
from xml.parsers import expat

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.workbook.changing.cells import CellValue, NewCell, cell_xml, type_and_content
from photocore.workbook.changing.changes import SheetChanges, Spliced, column_edits
from photocore.workbook.changing.formfill import FormFiller
from photocore.workbook.changing.formulas import areas_of_arrays
from photocore.workbook.reading.grid import cell_name, column_number, split_area
from photocore.workbook.reading.package import local, new_parser, uncollected, understood
from photocore.workbook.reading.plainsheet import (
    NotPlain,
    PlainRow,
    plain_rows,
    sheet_data,
    with_cells,
)
from photocore.workbook.reading.xlsx import unescape
from photocore.workbook.reading.xmltext import quoted, unescaped

_TAG = re.compile(rb"""<[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:"[^"]*"|'[^']*'))*\s*(/?)>""")
#: Changes are written once there are so many of them, new rows in pieces of so many bytes.
_HELD, _PIECE = 256, 2**20
_INLINE = re.compile(r"\s*<(?:\w+:)?t(?:\s[^>]*)?>([^<]*)</(?:\w+:)?t>\s*")


def splice_sheet(
    path: Path,
    part: str,
    data: bytes,
    changes: SheetChanges,
    strings: Callable[[], list[str]] = list,
) -> Spliced:
    """Work out the changes of one sheet's XML.

    Parameters
    ----------
    path, part : Path, str
        File and part, for messages.
    data : bytes
        The sheet's XML.
    changes : SheetChanges
        What is to change.
    strings : callable
        Returns the workbook's shared strings, to see whether a text differs at all.

    Raises
    ------
    InputError
        If a typed value would overwrite a formula, or the XML is damaged or not UTF-8.
    """
    head = data[:200]
    if head.startswith((b"\xff\xfe", b"\xfe\xff")) or re.search(
        rb"encoding\s*=\s*[\"'](?!utf-?8|us-ascii)", head, re.IGNORECASE
    ):
        raise InputError(remark("book.not_utf8", of=path, part=part))
    return _Splicer(path, part, data, changes, strings).run()


class _Splicer:
    """One pass over a sheet, gathering edits by byte position."""

    def __init__(
        self,
        path: Path,
        part: str,
        data: bytes,
        changes: SheetChanges,
        strings: Callable[[], list[str]],
    ) -> None:
        self.path, self.part, self.data, self.strings = path, part, data, strings
        self.changes = changes
        self.result = Spliced(data)
        self.edits = self.result.edits
        self.new_rows = deque(changes.rows())
        self.is_plain = len(changes.added) == 1 and not changes.placed
        self.parser = new_parser(path, part, start=self.start, end=self.end)
        self.kinds: dict[str, str] = {}
        self.inside = False
        self.prefix = ""
        self.row = self.column = 0
        self.row_start = self.cell_start = self.cell_end = self.data_start = 0
        self.attributes: dict[str, str] = {}
        self.children: list[tuple[str, int, int]] = []
        self.child_start = self.depth = 0
        self.new: dict[int, NewCell] = {}
        self.cached: Mapping[int, CellValue] = {}
        self.dimension: tuple[int, int, str] | None = None
        self.grown: list[tuple[int, int, bytes]] = []
        self.arrays = areas_of_arrays(data)

    def run(self) -> Spliced:
        """Parse, and return the edits in the order of the file."""
        complaint = f"{self.path}: damaged, the part {self.part} cannot be understood near row "
        with understood(lambda: f"{complaint}{self.row}."):
            try:
                try:
                    with uncollected():
                        self.run_plain()
                except NotPlain:
                    self.begin_anew()
                    self.parser.Parse(self.data, True)
            except expat.ExpatError as error:
                raise InputError(
                    remark("book.invalid_xml", of=self.path, part=self.part, error=error)
                ) from None
        if self.edits == self.grown:
            self.edits.clear()  # nothing was made
        self.edits.sort(key=itemgetter(0, 1))
        del self.parser  # which calls this object: together they would keep the sheet
        return self.result

    def begin_anew(self) -> None:
        """Forget all that was found so far."""
        self.result = Spliced(self.data)
        self.edits = self.result.edits
        self.new_rows = deque(self.changes.rows())
        self.parser = new_parser(self.path, self.part, start=self.start, end=self.end)
        self.dimension, self.grown = None, []
        self.prefix, self.depth, self.inside, self.row = "", 0, False, 0

    def run_plain(self) -> None:
        """Take a sheet of the plain form apart, all but its rows by the XML parser."""
        start, end = sheet_data(self.data)
        self.parser.Parse(self.data[:start], False)
        self.inside, self.prefix = False, ""
        filler = FormFiller(self.changes)
        for plain in plain_rows(self.data, start, end):
            if len(self.edits) > _HELD:
                self.spill()
            if plain.form is not None and self.fill_formed(filler, plain):
                continue
            row = with_cells(self.data, plain)
            self.start_row(row.number, row.start, "")
            new, cached, before = self.new, self.cached, 0
            for cell in row.cells:
                column = column_number(cell[1].decode())
                if column <= before:
                    self.refuse_order(cell_name(row.number, column))
                before = column
                if new and next(iter(new)) < column:
                    self.add_cells(column, (cell.start(), cell.start(), "", ""))
                is_asked = column in new or column in cached
                if is_asked or (cell[5] and cell[6]):
                    self.take_cell(cell, column)
                    self.end_cell("c")
            if new:
                place = (row.end, row.end, "", "")
                if row.is_closed:
                    opening = self.data[row.start : row.end].decode("utf-8")[:-2].rstrip()
                    place = (row.start, row.end, f"{opening}>", "</row>")
                self.add_cells(10**6, place)
        self.add_rows(10**9, (end, end, "", ""))
        self.parser.Parse(self.data[end:], True)

    def spill(self) -> None:
        """Write what is changed so far, unless results in it may still be taken out."""
        if not self.result.strips:
            self.result.write()

    def fill_formed(self, filler: FormFiller, row: PlainRow) -> bool:
        """Give every formula of a row of a form its result, if no more is to be done.

        Nearly every row of a large table is such a row.
        """
        if not self.new_rows or self.new_rows[0] != row.number or self.arrays:
            return False
        filled = filler.filled(row)
        if filled is None:
            return False
        self.new_rows.popleft()
        self.result.inputs_changed |= filled.is_typed
        if filled.parts is not None:
            self.edits.append((row.body, row.end, b"".join(filled.parts)))
        return True

    def take_cell(self, cell: re.Match[bytes], column: int) -> None:
        """Note where a cell of the plain form and its parts lie."""
        start, end = cell.span()
        while self.data[start] != 60:  # "<": blanks may stand before
            start += 1
        self.cell_start, self.cell_end, self.column = start, end, column
        attributes = {"r": f"{cell[1].decode()}{self.row}"}
        if cell[3]:
            attributes["s"] = cell[3].decode()
        if cell[4]:
            attributes["t"] = cell[4].decode()
        self.attributes = attributes
        self.children = [("f", *cell.span(5))] if cell[5] else []
        if cell[6]:
            kind = "v" if cell[6].startswith(b"<v") else "is"
            self.children.append((kind, *cell.span(6)))

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Handle an opening tag."""
        kind = self.kinds.get(name)
        if kind is None:
            kind = self.kinds[name] = local(name)
        if kind == "c" and self.inside and not self.depth:
            self.start_cell(attributes)
        elif kind == "row" and self.inside and not self.depth:
            number = int(attributes.get("r", self.row + 1))
            self.start_row(number, self.parser.CurrentByteIndex, name[: len(name) - 3])
        elif self.inside:
            # Only direct children of a cell count; "t" and "r" lie deeper, in a rich text.
            if not self.depth:
                self.child_start = self.parser.CurrentByteIndex
            self.depth += 1
        elif kind == "sheetData":
            self.inside = True
            self.data_start = self.parser.CurrentByteIndex
            self.prefix = name[: len(name) - len(kind)]
            if self.changes.columns:
                head = self.data[: self.data_start]
                self.edits += column_edits(head, self.prefix, self.changes.columns)
            if self.dimension:
                self.grow_dimension(*self.dimension)
        elif kind == "dimension":
            start = self.parser.CurrentByteIndex
            self.dimension = (start, self.tag_end(start), attributes.get("ref", ""))

    def end(self, name: str) -> None:
        """Handle a closing tag."""
        kind = self.kinds[name]
        if not self.inside:
            return
        if kind == "c" and not self.depth:
            self.cell_end = self.element_end(name, self.cell_start)
            self.end_cell(name)
        elif kind == "row" and not self.depth:
            self.end_row(name)
        elif kind == "sheetData":
            self.inside = False
            self.add_rows(10**9, self.closing(name, self.data_start))
        else:
            self.depth -= 1
            if not self.depth:
                end = self.element_end(name, self.child_start)
                self.children.append((kind, self.child_start, end))

    def start_row(self, number: int, start: int, prefix: str) -> None:
        """Insert the new rows before this one and note what is to happen in it."""
        if number <= self.row:
            self.refuse_order(cell_name(number, 1))
        self.row, self.row_start, self.column = number, start, 0
        if self.new_rows and self.new_rows[0] < self.row:
            self.add_rows(self.row, (self.row_start, self.row_start, "", ""))
        self.prefix = prefix
        self.cached = self.changes.cached.get(self.row, {})
        self.new = {}
        if self.new_rows and self.new_rows[0] == self.row:
            self.new = self.changes.cells(self.new_rows.popleft())

    def refuse_order(self, cell: str) -> None:
        """Refuse to change a sheet where a new cell could not be put in its place."""
        if self.changes:
            raise InputError(remark("book.not_in_order", of=self.path, part=self.part, cell=cell))

    def end_row(self, name: str) -> None:
        """Insert the new cells behind the last one of this row."""
        if self.new:
            self.add_cells(10**6, self.closing(name, self.row_start))

    def start_cell(self, attributes: dict[str, str]) -> None:
        """Insert the new cells before this one."""
        self.cell_start = self.parser.CurrentByteIndex
        self.attributes = attributes
        self.children.clear()
        reference, before = attributes.get("r"), self.column
        if reference is None:
            self.column += 1
        else:
            self.column = column_number(reference.rstrip("0123456789"))
        if self.column <= before:
            self.refuse_order(cell_name(self.row, self.column))
        if self.new and next(iter(self.new)) < self.column:
            self.add_cells(self.column, (self.cell_start, self.cell_start, "", ""))

    def end_cell(self, name: str) -> None:
        """Change this cell, or note that its result may be stale."""
        if self.column in self.new:
            self.replace(name, self.new.pop(self.column))
        elif self.column in self.cached:
            self.put_result(name, self.cached[self.column])
        elif len(self.children) > 1 and self.child("f") and self.child("v"):
            # How to take the cached result out, should it be stale.
            self.result.strips.append(self.with_result(name, "", ""))

    def replace(self, name: str, new: NewCell) -> None:
        """Give this cell another typed value, or a formula if it is empty."""
        where = f"{self.path} › {cell_name(self.row, self.column)}"
        formula = self.child("f")
        if formula and (new.rule == "filled" or self.same_formula(formula, new)):
            self.put_result(name, new.value)
            return
        if self.children and new.rule == "filled":
            return
        if formula and (new.rule != "over" or self.serves_others(formula)):
            raise InputError(f"{where}: holds a formula, which is not overwritten.")
        if new.rule == "prepared" and self.children:
            raise InputError(f"{where}: is not empty; a new row cannot be put there.")
        if not new.formula and not formula and self.holds(new.value):
            return
        if not formula and self.is_of_array():
            raise InputError(f"{where}: is part of an array formula, which is not overwritten.")
        self.result.formula_lost |= bool(formula) and not new.formula
        new = new._replace(style=self.attributes.get("s", "") or new.style)
        edit = self.xml(self.column, new).encode()
        self.edits.append((self.cell_start, self.cell_end, edit))
        self.result.inputs_changed = True

    def serves_others(self, formula: tuple[int, int]) -> bool:
        """Whether other cells have their formula from here, and do not get one of their own."""
        tag = self.data[formula[0] : self.tag_end(formula[0])]
        area = re.search(rb"\sref\s*=\s*[\"'](\w+(?::\w+)?)", tag)
        if area is None or b"shared" not in tag:
            return area is not None
        top, left, bottom, right = split_area(area[1].decode())
        placed = [self.changes.placed.get(row, {}) for row in range(top, bottom + 1)]
        return not all(column in cells for cells in placed for column in range(left, right + 1))

    def is_of_array(self) -> bool:
        """Whether this cell holds a result of a formula that stands in another one."""
        at = self.row, self.column
        return any(t <= at[0] <= b and left <= at[1] <= r for t, left, b, r in self.arrays)

    def same_formula(self, place: tuple[int, int], new: NewCell) -> bool:
        """Whether a formula that would be replaced is the same already."""
        text = new.formula(self.row) if callable(new.formula) else new.formula
        if new.rule != "over" or not text:
            return False
        start = self.tag_end(place[0])
        present = self.data[start : max(start, self.data.rfind(b"<", start, place[1]))]
        return unescaped(present.decode("utf-8")) == unescaped(text)

    def put_result(self, name: str, value: CellValue) -> None:
        """Give this cell's formula another cached result."""
        formula = self.child("f")
        if formula is None:
            # Otherwise the user put a value in its place: it stays.
            if self.changes.restates and isinstance(value, float):
                self.replace(name, NewCell(value))
            return
        kind, content = type_and_content(value, self.prefix, formula=True)
        stored = self.child("v")
        if stored and self.attributes.get("t", "") == kind:
            # Only the value differs, if anything: by far the most frequent case.
            new = content.encode()
            if self.data[stored[0] : stored[1]] != new:
                self.edits.append((*stored, new))
            return
        self.edits.append(self.with_result(name, kind, content))

    def with_result(self, name: str, kind: str, content: str) -> tuple[int, int, bytes]:
        """Return the edit that gives a formula cell this result and keeps all else of it."""
        kept = [f" {key}={quoted(value)}" for key, value in self.attributes.items() if key != "t"]
        kept += [f' t="{kind}"'] if kind else []
        before = b"".join(self.data[s:e] for k, s, e in self.children if k == "f")
        after = b"".join(self.data[s:e] for k, s, e in self.children if k not in ("f", "v", "is"))
        opening = f"<{name}{''.join(kept)}>".encode()
        replacement = opening + before + content.encode() + after + f"</{name}>".encode()
        return self.cell_start, self.cell_end, replacement

    def holds(self, value: CellValue) -> bool:
        """Whether this cell holds the value already."""
        kind = self.attributes.get("t", "n")
        content = self.child("v") or self.child("is")
        if content is None:
            return value is None or value == ""
        inner = self.data[self.tag_end(content[0]) : self.data.rfind(b"<", content[0], content[1])]
        text = unescaped(inner.decode("utf-8"))
        try:
            if kind == "n" and not isinstance(value, str | bool) and value is not None:
                return float(text) == float(value)
            if kind == "b" and isinstance(value, bool):
                return (text == "1") is value
            if kind == "s" and isinstance(value, str):
                return self.strings()[int(text)] == value
            if kind == "inlineStr" and isinstance(value, str):
                plain = _INLINE.fullmatch(inner.decode("utf-8"))
                return plain is not None and unescape(unescaped(plain[1])) == value
        except (ValueError, IndexError):
            return False
        return False

    def child(self, kind: str) -> tuple[int, int] | None:
        """Return where a direct child of this cell lies."""
        places = ((start, end) for name, start, end in self.children if name == kind)
        return next(places, None)

    def add_cells(self, before: int, place: tuple[int, int, str, str]) -> None:
        """Insert the new cells of this row whose columns lie before one."""
        columns = [column for column in self.new if column < before]
        self.insert("".join([self.xml(c, self.new.pop(c)) for c in columns]).encode(), place)

    def xml(self, column: int, cell: NewCell, row: int = 0) -> str:
        """Return the XML of a cell of this row, or of another one."""
        row = row or self.row
        formula = cell.formula(row) if callable(cell.formula) else cell.formula
        return cell_xml(cell_name(row, column), cell.value, formula, self.prefix, cell.style)

    def add_rows(self, before: int, place: tuple[int, int, str, str]) -> None:
        """Insert the new rows whose numbers lie before one."""
        rows = []
        while self.new_rows and self.new_rows[0] < before:
            rows.append(self.new_rows.popleft())
        is_plain = self.is_plain and self.changes.inputs.keys().isdisjoint(rows)
        if rows and is_plain:
            lines = self.changes.added[0].xml(range(rows[0], rows[-1] + 1), self.prefix)
        else:
            lines = map(self.row_xml, rows)
        tag = f"{self.prefix}row"
        pieces = zip(rows, lines, strict=True)
        added = bytearray()  # rows of a large sheet are never held one by one
        start, end, opening, closing = place
        for number, xml in pieces:
            if xml:
                if len(added) > _PIECE:
                    self.insert(added, (start, end, opening, ""))
                    self.spill()
                    added, opening = bytearray(), ""
                added += f'<{tag} r="{number}">{xml}</{tag}>'.encode()
        self.insert(added, (start, end, opening, closing))

    def row_xml(self, row: int) -> str:
        """Return the XML of the cells of a new row."""
        new = self.changes.cells(row).items()
        return "".join([self.xml(column, cell, row) for column, cell in new])

    def insert(self, xml: bytes | bytearray, place: tuple[int, int, str, str]) -> None:
        """Insert XML at a place (start, end, text before, text behind)."""
        if xml:
            start, end, opening, closing = place
            self.edits.append((start, end, opening.encode() + xml + closing.encode()))
            self.result.inputs_changed = True

    def closing(self, name: str, start: int) -> tuple[int, int, str, str]:
        """Return the place just inside the end of an element, which may be self-closed."""
        match = self.match_tag(start)
        if match[1]:
            opening = self.data[start : match.end()].decode("utf-8")[:-2].rstrip()
            return start, match.end(), f"{opening}>", f"</{name}>"
        end = self.parser.CurrentByteIndex
        return end, end, "", ""

    def element_end(self, name: str, start: int) -> int:
        """Return the position behind an element whose end is being reported."""
        position: int = self.parser.CurrentByteIndex
        # Expat reports the end of an empty element behind it, of others at their closing tag.
        if self.data.startswith(b"</" + name.encode(), position):
            return self.data.index(b">", position) + 1
        return self.tag_end(start)

    def tag_end(self, start: int) -> int:
        """Return the position behind an opening tag."""
        return self.match_tag(start).end()

    def match_tag(self, start: int) -> re.Match[bytes]:
        """Return the match of an opening tag; group 1 is filled if it closes itself."""
        match = _TAG.match(self.data, start)
        if match is None:
            raise InputError(f"{self.path}: damaged, the part {self.part} cannot be taken apart.")
        return match

    def grow_dimension(self, start: int, end: int, reference: str) -> None:
        """Let the sheet's stated extent take in the cells that were made."""
        grown = self.changes.grown(reference)
        if grown != reference:
            tag = re.sub(
                rb"""(\sref\s*=\s*)("[^"]*"|'[^']*')""",
                lambda match: match[1] + f'"{grown}"'.encode(),
                self.data[start:end],
                count=1,
            )
            self.grown = [(start, end, tag)]
            self.edits += self.grown
