"""Reading .xlsx and .xlsm: values, dates, errors, hidden rows, tables and names."""

from __future__ import annotations

import posixpath
import re
import zipfile
from dataclasses import dataclass, field
from pathlib import Path

from photocore.errors import InputError
from photocore.workbook.grid import (
    CellDate,
    CellFault,
    Grid,
    NotCalculated,
    SheetFile,
    TableArea,
    Value,
    column_number,
    date_of_serial,
    split_area,
    split_cell,
)
from photocore.workbook.package import EnoughError, local, open_package, scan_part

#: Number formats 14-22, 27-36, 45-47, 50-58 are dates and times in every language of Excel.
_BUILT_IN_DATES = {
    **dict.fromkeys([*range(27, 37), *range(50, 59)], "d.m.yyyy"),
    **{14: "d.m.yyyy", 15: "d-mmm-yy", 16: "d-mmm", 17: "mmm-yy", 22: "d.m.yyyy h:mm"},
    **dict.fromkeys([18, 19, 20, 21, 45, 46, 47], "h:mm"),
}
_ESCAPED = re.compile(r"_x([0-9A-Fa-f]{4})_")
_CONTENT_TYPES = "[Content_Types].xml"


@dataclass(slots=True)
class Sheet:
    """One sheet of a workbook package: its name, its part, and the parts of its tables."""

    title: str
    part: str
    hidden: bool = False
    relations: dict[str, tuple[str, str]] = field(default_factory=dict)


@dataclass(slots=True)
class Workbook:
    """The directory of a workbook package: what lies where, no cells yet."""

    part: str
    sheets: list[Sheet]
    names: dict[str, str]
    relations: dict[str, tuple[str, str]]
    since_1904: bool = False
    strict: bool = False


def open_xlsx(path: Path, *, max_rows: int) -> SheetFile:
    """Open a workbook for reading; sheets are read when asked for.

    Parameters
    ----------
    path : Path
        An .xlsx or .xlsm file.
    max_rows : int
        Rows with content after which reading a sheet stops (`Grid.truncated`).

    Raises
    ------
    InputError
        If the file is not a workbook, is damaged or unsafe.
    """
    with open_package(path) as package:
        book = read_directory(path, package)
        tables = [area for sheet in book.sheets for area in read_tables(path, package, sheet)]
        strings = read_shared_strings(path, package, book)
        dates = _date_styles(path, package, book)
    parts = {sheet.title: sheet.part for sheet in book.sheets}
    reader = _SheetReader(path, strings, dates, since_1904=book.since_1904, max_rows=max_rows)

    def load(title: str) -> Grid:
        with open_package(path) as package:
            return reader.read(package, title, parts[title])

    visible = [sheet.title for sheet in book.sheets if not sheet.hidden]
    hidden = [sheet.title for sheet in book.sheets if sheet.hidden]
    return SheetFile(
        label=path.name,
        titles=visible + hidden,
        load=load,
        tables=tables,
        names=_single_cells(book),
        remarks=_remarks(book),
    )


def _remarks(book: Workbook) -> list[str]:
    """Return what the user should know about values that come from elsewhere."""
    if any(kind == "externalLink" for kind, _ in book.relations.values()):
        return ["The workbook refers to other workbooks; their values are used as last stored."]
    return []


def read_directory(path: Path, package: zipfile.ZipFile) -> Workbook:
    """Return what a workbook package says about its sheets, names and relations.

    Raises
    ------
    InputError
        If the package holds something other than a workbook.
    """
    names = set(package.namelist())
    if "mimetype" in names and _CONTENT_TYPES not in names:
        raise InputError(f"{path}: is an OpenDocument file; give it the ending .ods.")
    if _CONTENT_TYPES not in names or "_rels/.rels" not in names:
        raise InputError(f"{path}: is a zip file but not a workbook.")
    roots = _relations(path, package, "")
    part = next((target for kind, target in roots.values() if kind == "officeDocument"), "")
    if part.endswith(".bin"):
        raise InputError(f"{path}: is a binary workbook (.xlsb); save it as .xlsx.")
    if part not in names:
        raise InputError(f"{path}: is a zip file but not a workbook.")
    book = Workbook(part=part, sheets=[], names={}, relations=_relations(path, package, part))
    pending: list[tuple[str, str, bool]] = []
    defined = ""
    text: list[str] = []
    root = ""

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal defined, root
        root = root or name
        kind = local(name)
        if kind == "workbook":
            book.strict = any("purl.oclc.org" in value for value in attributes.values())
        elif kind == "workbookPr":
            book.since_1904 = attributes.get("date1904", "0") in ("1", "true", "on")
        elif kind == "sheet":
            key = next((v for k, v in attributes.items() if local(k) == "id"), "")
            hidden = attributes.get("state", "visible") != "visible"
            pending.append((attributes.get("name", ""), key, hidden))
        elif kind == "definedName" and "localSheetId" not in attributes:
            defined = attributes.get("name", "")
            text.clear()

    def end(name: str) -> None:
        nonlocal defined
        if local(name) == "definedName" and defined:
            book.names[defined] = "".join(text)
            defined = ""

    def collect(data: str) -> None:
        if defined:
            text.append(data)

    scan_part(path, package, part, start=start, end=end, text=collect)
    if local(root) != "workbook":
        raise InputError(f"{path}: is not a workbook but another kind of document.")
    for title, key, hidden in pending:
        kind, target = book.relations.get(key, ("", ""))
        if kind == "worksheet" and target in names:
            sheet = Sheet(title, target, hidden, _relations(path, package, target))
            book.sheets.append(sheet)
    if not book.sheets:
        raise InputError(f"{path}: the workbook has no sheet with cells.")
    return book


def _relations(path: Path, package: zipfile.ZipFile, part: str) -> dict[str, tuple[str, str]]:
    """Return id -> (kind, target part) of a part's relations; external targets are left out."""
    folder, name = posixpath.split(part)
    rels = posixpath.join(folder, "_rels", f"{name}.rels")
    found: dict[str, tuple[str, str]] = {}
    if rels not in package.namelist():
        return found

    def start(name: str, attributes: dict[str, str]) -> None:
        if local(name) == "Relationship" and attributes.get("TargetMode") != "External":
            target = attributes.get("Target", "")
            whole = target[1:] if target.startswith("/") else posixpath.join(folder, target)
            kind = attributes.get("Type", "").rpartition("/")[2]
            found[attributes.get("Id", "")] = (kind, posixpath.normpath(whole))

    scan_part(path, package, rels, start=start)
    return found


def read_tables(path: Path, package: zipfile.ZipFile, sheet: Sheet) -> list[TableArea]:
    """Return the named tables of a sheet."""
    found: list[TableArea] = []
    for kind, target in sheet.relations.values():
        if kind == "table" and target in package.namelist():
            try:
                found.append(_table(path, package, sheet.title, target))
            except (KeyError, ValueError) as error:
                if isinstance(error, InputError):
                    raise
                raise InputError(
                    f"{path}: damaged, the table part {target} has no range."
                ) from None
    return found


def _table(path: Path, package: zipfile.ZipFile, title: str, part: str) -> TableArea:
    root: dict[str, str] = {}
    columns: list[str] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        if local(name) == "table":
            root.update(attributes)
        elif local(name) == "tableColumn":
            columns.append(unescape(attributes.get("name", "")))

    scan_part(path, package, part, start=start)
    return TableArea(
        name=root.get("displayName") or root.get("name", ""),
        sheet=title,
        area=split_area(root["ref"]),
        header_rows=int(root.get("headerRowCount", "1")),
        totals_rows=int(root.get("totalsRowCount", "0")),
        part=part,
        columns=tuple(columns),
    )


def read_shared_strings(path: Path, package: zipfile.ZipFile, book: Workbook) -> list[str]:
    """Return the texts that cells of type ``s`` point to."""
    part = next((target for kind, target in book.relations.values() if kind == "sharedStrings"), "")
    strings: list[str] = []
    if part not in package.namelist():
        return strings
    pieces: list[str] = []
    inside = phonetic = False

    def start(name: str, attributes: dict[str, str]) -> None:  # noqa: ARG001
        nonlocal inside, phonetic
        kind = local(name)
        if kind == "si":
            pieces.clear()
        elif kind == "rPh":
            phonetic = True
        elif kind == "t":
            inside = not phonetic

    def end(name: str) -> None:
        nonlocal inside, phonetic
        kind = local(name)
        if kind == "si":
            strings.append(unescape("".join(pieces)))
        elif kind == "rPh":
            phonetic = False
        elif kind == "t":
            inside = False

    def collect(data: str) -> None:
        if inside:
            pieces.append(data)

    scan_part(path, package, part, start=start, end=end, text=collect)
    return strings


def _date_styles(path: Path, package: zipfile.ZipFile, book: Workbook) -> dict[str, str]:
    """Return the cell styles (as the ``s`` attribute writes them) that show dates."""
    part = next((target for kind, target in book.relations.values() if kind == "styles"), "")
    if part not in package.namelist():
        return {}
    formats: dict[int, str] = dict(_BUILT_IN_DATES)
    cells: list[int] = []
    inside = False

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal inside
        kind = local(name)
        if kind == "numFmt":
            code = attributes.get("formatCode", "")
            number = int(attributes.get("numFmtId", "0"))
            if is_date_format(code):
                formats[number] = code
            else:
                formats.pop(number, None)
        elif kind == "cellXfs":
            inside = True
        elif kind == "xf" and inside:
            cells.append(int(attributes.get("numFmtId", "0")))

    def end(name: str) -> None:
        nonlocal inside
        if local(name) == "cellXfs":
            inside = False

    try:
        scan_part(path, package, part, start=start, end=end)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: damaged, the styles have a number format without number."
        ) from None
    return {str(index): formats[number] for index, number in enumerate(cells) if number in formats}


def is_date_format(code: str) -> bool:
    """Whether a number format shows dates or times.

    >>> is_date_format("[$-410]d-mmm;@"), is_date_format('0.00" mm"')
    (True, False)
    """
    bare = re.sub(r'"[^"]*"|\\.|_.|\*.', "", code)
    if re.search(r"\[(h+|m+|s+)\]", bare, re.IGNORECASE):
        return True
    bare = re.sub(r"\[[^\]]*\]", "", bare).split(";")[0].lower()
    if "general" in bare or "standard" in bare:
        return False
    # A digit placeholder beside an "m" is somebody's unquoted unit, unless seconds are shown.
    return bool(re.search(r"[dmyhs]", bare)) and ("s" in bare or not re.search(r"[0#?]", bare))


def unescape(text: str) -> str:
    """Undo the ``_x000D_`` escapes of characters that XML cannot hold."""
    if "_x" not in text:
        return text
    return _ESCAPED.sub(lambda match: chr(int(match[1], 16)), text)


def _single_cells(book: Workbook) -> dict[str, tuple[str, int, int]]:
    """Return the defined names that stand for one cell."""
    found = {}
    for name, reference in book.names.items():
        match = re.fullmatch(r"(?:'((?:[^']|'')+)'|([^'!:]+))!(\$?[A-Z]{1,3}\$?\d+)", reference)
        if match:
            title = match[1].replace("''", "'") if match[1] else match[2]
            found[name.casefold()] = (title, *split_cell(match[3]))
    return found


@dataclass(slots=True)
class _SheetReader:
    """Reads the cells of one sheet part in one pass."""

    path: Path
    strings: list[str]
    dates: dict[str, str]
    since_1904: bool
    max_rows: int

    def read(self, package: zipfile.ZipFile, title: str, part: str) -> Grid:
        """Return the sheet's cells; empty but formatted cells are left out."""
        grid = Grid(title)
        columns: dict[str, int] = {}
        kinds: dict[str, str] = {}
        text: list[str] = []
        row = column = 0
        cells: dict[int, Value] = {}
        attributes_of_cell: dict[str, str] = {}
        formula: str | None = None
        inside = depth = collecting = phonetic = False

        def start(name: str, attributes: dict[str, str]) -> None:
            nonlocal row, column, cells, attributes_of_cell, formula
            nonlocal inside, depth, collecting, phonetic
            kind = kinds.get(name)
            if kind is None:
                kind = kinds[name] = local(name)
            if kind == "c":
                attributes_of_cell = attributes
                reference = attributes.get("r")
                if reference is None:
                    column += 1
                else:
                    letters = reference.rstrip("0123456789")
                    found = columns.get(letters)
                    if found is None:
                        found = columns[letters] = column_number(letters)
                    column = found
                formula = None
                text.clear()
            elif kind == "v":
                collecting = inside
            elif kind == "f":
                formula = ""
                depth = True
            elif kind == "t":
                collecting = inside and not phonetic
            elif kind == "rPh":
                phonetic = True
            elif kind == "row" and inside:
                row = int(attributes.get("r", row + 1))
                column = 0
                cells = {}
                if attributes.get("hidden", "0") in ("1", "true", "on"):
                    grid.hidden.add(row)
            elif kind == "sheetData":
                inside = True
            elif kind == "mergeCell":
                grid.merged.append(split_area(attributes["ref"]))

        def end(name: str) -> None:
            nonlocal inside, depth, collecting, phonetic
            kind = kinds[name]
            if kind == "c":
                if text or formula is not None:
                    value = self.value("".join(text), attributes_of_cell, formula)
                    if value is not None:
                        cells[column] = value
            elif kind in ("v", "t"):
                collecting = False
            elif kind == "f":
                depth = False
            elif kind == "rPh":
                phonetic = False
            elif kind == "row" and inside:
                if cells:
                    if len(grid.rows) >= self.max_rows:
                        grid.truncated = True
                        raise EnoughError
                    grid.rows[row] = cells
            elif kind == "sheetData":
                inside = False

        def collect(data: str) -> None:
            nonlocal formula
            if collecting:
                text.append(data)
            elif depth and formula is not None:
                formula += data

        try:
            scan_part(self.path, package, part, start=start, end=end, text=collect)
        except (KeyError, ValueError, IndexError, OverflowError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{self.path} › {title}: damaged near row {row}, a cell cannot be understood. Open "
                "the file in the spreadsheet program and save it again."
            ) from error
        return grid

    def value(self, text: str, attributes: dict[str, str], formula: str | None) -> Value | None:
        """Return the typed value of one cell, None when it is blank."""
        kind = attributes.get("t", "n")
        if kind == "s" and text:
            return self.strings[int(text)] or None
        if not text:
            # Text formulas store an empty result as no text at all; other types mean "never run".
            return None if formula is None or kind == "str" else NotCalculated(formula)
        if kind == "n":
            number = float(text)
            style = self.dates.get(attributes.get("s", ""))
            return number if style is None else self.date(number, style)
        if kind == "b":
            return text.strip() in ("1", "true")
        if kind == "e":
            return CellFault(text)
        if kind == "d":
            return self.iso(text)
        return unescape(text)

    def date(self, number: float, style: str) -> Value:
        """Return a date, or the plain number where no calendar reaches."""
        try:
            return CellDate(date_of_serial(number, since_1904=self.since_1904), style)
        except (OverflowError, ValueError):
            return number

    def iso(self, text: str) -> Value:
        """Return a date stored as ISO text (strict workbooks)."""
        from datetime import datetime

        try:
            return CellDate(datetime.fromisoformat(text.strip().removesuffix("Z")), "d.m.yyyy")
        except ValueError:
            return text
