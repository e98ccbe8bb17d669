"""Reading .ods: values, dates, errors, hidden rows, merged cells and names."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from photocore.errors import InputError
from photocore.workbook.grid import CellDate, CellFault, Grid, SheetFile, Value, split_cell
from photocore.workbook.package import local, open_package, read_part, scan_part

#: Repeated cells with content beyond these are a decompression bomb, not a survey.
_MOST_COLUMNS = 16384
_MOST_CELLS = 20_000_000
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
        reader = _OdsReader(max_rows)
        try:
            scan_part(
                path,
                package,
                "content.xml",
                start=reader.start,
                end=reader.end,
                text=reader.collect,
            )
        except (ValueError, IndexError) as error:
            if isinstance(error, InputError):
                raise (
                    InputError(f"{path}: {error}")
                    if not str(error).startswith(str(path))
                    else error
                ) from None
            raise InputError(f"{path}: damaged, a cell cannot be understood.") from error
    if not reader.grids:
        raise InputError(f"{path}: the OpenDocument file has no sheet.")
    grids = {grid.title: grid for grid in reader.grids}
    titles = [title for title in grids if title not in reader.hidden_sheets]
    titles += [title for title in grids if title in reader.hidden_sheets]
    return SheetFile(label=path.name, titles=titles, load=grids.__getitem__, names=reader.names)


@dataclass(slots=True)
class _OdsReader:
    """Builds the grids from the elements of content.xml."""

    max_rows: int
    grids: list[Grid] = field(default_factory=list)
    names: dict[str, tuple[str, int, int]] = field(default_factory=dict)
    hidden_sheets: set[str] = field(default_factory=set)
    hidden_styles: set[str] = field(default_factory=set)
    kinds: dict[str, str] = field(default_factory=dict)
    style: str = ""
    row: int = 0
    column: int = 0
    filled: int = 0
    row_repeat: int = 1
    repeat: int = 1
    row_hidden: bool = False
    cells: dict[int, Value] = field(default_factory=dict)
    attributes: dict[str, str] = field(default_factory=dict)
    text: list[str] = field(default_factory=list)
    paragraphs: int = 0
    in_cell: bool = False
    in_paragraph: int = 0
    in_note: int = 0

    def start(self, name: str, attributes: dict[str, str]) -> None:
        """Handle an opening tag."""
        kind = self.kinds.get(name)
        if kind is None:
            kind = self.kinds[name] = local(name)
        if kind in ("table-cell", "covered-table-cell"):
            self.attributes = {local(key): value for key, value in attributes.items()}
            self.repeat = int(self.attributes.get("number-columns-repeated", "1"))
            self.in_cell, self.paragraphs = True, 0
            self.text.clear()
        elif kind == "table-row":
            plain = {local(key): value for key, value in attributes.items()}
            self.row_repeat = int(plain.get("number-rows-repeated", "1"))
            self.row_hidden = plain.get("visibility", "visible") != "visible"
            self.row += 1
            self.column, self.cells = 0, {}
        elif kind == "p" and self.in_cell and not self.in_note:
            if self.paragraphs:
                self.text.append("\n")
            self.paragraphs += 1
            self.in_paragraph += 1
        elif kind == "annotation":
            self.in_note += 1
        elif kind == "s" and self.in_paragraph and not self.in_note:
            count = next((int(v) for k, v in attributes.items() if local(k) == "c"), 1)
            self.text.append(" " * min(count, 1000))
        elif kind == "tab" and self.in_paragraph and not self.in_note:
            self.text.append("\t")
        elif kind == "line-break" and self.in_paragraph and not self.in_note:
            self.text.append("\n")
        else:
            self.start_sheet(kind, {local(key): value for key, value in attributes.items()})

    def start_sheet(self, kind: str, attributes: dict[str, str]) -> None:
        """Handle what comes once per sheet or file."""
        if kind == "table" and "name" in attributes:
            self.grids.append(Grid(attributes["name"]))
            self.row = 0
            if attributes.get("style-name") in self.hidden_styles:
                self.hidden_sheets.add(attributes["name"])
        elif kind == "style":
            self.style = attributes.get("name", "")
        elif kind == "table-properties" and attributes.get("display") == "false":
            self.hidden_styles.add(self.style)
        elif kind == "named-range":
            reference = attributes.get("cell-range-address", "")
            match = re.fullmatch(r"\$?(?:'((?:[^']|'')+)'|([^'.]+))\.(\$?[A-Z]+\$?\d+)", reference)
            if match:
                title = match[1].replace("''", "'") if match[1] else match[2]
                key = attributes.get("name", "").casefold()
                self.names[key] = (title, *split_cell(match[3]))

    def end(self, name: str) -> None:
        """Handle a closing tag."""
        kind = self.kinds.get(name, "")
        if kind in ("table-cell", "covered-table-cell"):
            self.end_cell()
        elif kind == "table-row" and self.grids:
            self.end_row()
        elif kind == "p" and self.in_paragraph and not self.in_note:
            self.in_paragraph -= 1
        elif kind == "annotation":
            self.in_note -= 1

    def end_cell(self) -> None:
        """Store one cell, as often as it is repeated."""
        self.in_cell = False
        value = self.value()
        first = self.column + 1
        self.column += self.repeat
        down = int(self.attributes.get("number-rows-spanned", "1"))
        across = int(self.attributes.get("number-columns-spanned", "1"))
        if (down > 1 or across > 1) and self.grids:
            self.grids[-1].merged.append((self.row, first, self.row + down - 1, first + across - 1))
        if value is None:
            return
        self.filled += self.repeat * self.row_repeat
        if self.column > _MOST_COLUMNS or self.filled > _MOST_CELLS:
            raise InputError("refused, it repeats cells beyond the size of any real sheet.")
        for column in range(first, self.column + 1):
            self.cells[column] = value

    def end_row(self) -> None:
        """Store one row, as often as it is repeated."""
        grid = self.grids[-1]
        first = self.row
        self.row += self.row_repeat - 1
        for row in range(first, self.row + 1) if self.cells else ():
            if len(grid.rows) >= self.max_rows:
                grid.truncated = True
                return
            grid.rows[row] = dict(self.cells)
            if self.row_hidden:
                grid.hidden.add(row)

    def collect(self, data: str) -> None:
        """Gather the text of a cell."""
        if self.in_paragraph and not self.in_note:
            self.text.append(data)

    def value(self) -> Value | None:
        """Return the typed value of the cell just read, None when it is blank."""
        attributes, text = self.attributes, "".join(self.text)
        kind = attributes.get("value-type", "")
        is_formula = "formula" in attributes
        if is_formula and _FAULTS.fullmatch(text.strip()):
            return CellFault(text.strip())
        if kind in ("float", "percentage", "currency"):
            return float(attributes["value"]) if "value" in attributes else None
        if kind == "boolean":
            return attributes.get("boolean-value") == "true"
        if kind == "date":
            moment = datetime.fromisoformat(attributes.get("date-value", "").removesuffix("Z"))
            # The shown text tells the format: "01.05." or "1-May" was typed as a number.
            return CellDate(moment.replace(tzinfo=None), "d.m.yyyy")
        if kind == "time":
            return CellDate(datetime(1899, 12, 30), "h:mm")
        return attributes.get("string-value", text) or None
