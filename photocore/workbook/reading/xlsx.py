"""Reading .xlsx and .xlsm: values, dates, errors, hidden rows, tables and names."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache, partial
from pathlib import Path
from xml.etree.ElementTree import Element
from xml.parsers import expat

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.workbook.reading.grid import (
    CellDate,
    CellFault,
    CellGrid,
    NotCalculated,
    SheetFile,
    TableArea,
    Value,
    column_number,
    date_of_iso,
    date_of_serial,
    named_number,
    plain_title,
    split_area,
    split_cell,
)
from photocore.workbook.reading.package import (
    local,
    new_parser,
    open_package,
    read_part,
    read_relations,
    uncollected,
    understood,
    xml_elements,
    xml_root,
)
from photocore.workbook.reading.plainsheet import (
    LARGEST,
    FormCell,
    NotPlain,
    RowForm,
    plain_rows,
    sheet_data,
)
from photocore.workbook.reading.xmltext import unescaped

#: Number formats 14-22, 27-36, 45-47, 50-58 are dates and times in every language of Excel.
_BUILT_IN_DATES = {
    **dict.fromkeys([*range(27, 37), *range(50, 59)], "d.m.yyyy"),
    **{14: "d.m.yyyy", 15: "d-mmm-yy", 16: "d-mmm", 17: "mmm-yy", 22: "d.m.yyyy h:mm"},
    **dict.fromkeys([18, 19, 20, 21, 45, 46, 47], "h:mm"),
}
_ESCAPED = re.compile(r"_x([0-9A-Fa-f]{4})_")
_NAMED = re.compile(r'((?:"[^"]*"|\\.)*)(0+)(?<!^0)').fullmatch
_CONTENT_TYPES = "[Content_Types].xml"
_YES = ("1", "true", "on")
_HIDDEN = re.compile(rb'\shidden="(?:1|true|on)"')


@dataclass(slots=True)
class SheetPart:
    """One sheet of a workbook package: its name, its part, and the parts of its tables."""

    title: str
    part: str
    hidden: bool = False
    relations: dict[str, tuple[str, str]] = field(default_factory=dict)


@dataclass(slots=True)
class Workbook:
    """The directory of a workbook package: what lies where, no cells yet."""

    part: str
    sheets: list[SheetPart]
    names: dict[str, str]
    relations: dict[str, tuple[str, str]]
    since_1904: bool = False
    #: Names that count on one sheet only, by the number of the sheet in the list of all.
    local_names: dict[int, dict[str, str]] = field(default_factory=dict)
    #: Titles of all sheets in order, those without cells too.
    listed: list[str] = field(default_factory=list)

    def names_on(self, title: str) -> dict[str, str]:
        """Return the names that lead to a sheet, those that count there alone first."""
        local = self.local_names.get(self.listed.index(title), {}) if title in self.listed else {}
        names = {name: place for name, place in self.names.items() if name not in local} | local
        return {n: v for n, v in names.items() if plain_title(v.rpartition("!")[0]) == title}


def open_xlsx(path: Path, *, max_rows: int) -> SheetFile:
    """Open a workbook for reading; sheets are read when asked for.

    Parameters
    ----------
    path : Path
        An .xlsx or .xlsm file.
    max_rows : int
        Rows with content after which reading a sheet stops (`CellGrid.truncated`).

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

    def load(title: str) -> CellGrid:
        with open_package(path) as package:
            return reader.read(package, title, parts[title])

    @cache
    def text(title: str) -> str:
        with open_package(path) as package:
            return read_part(path, package, parts[title]).decode("utf-8", errors="replace")

    visible_first = sorted(book.sheets, key=lambda sheet: sheet.hidden)
    return SheetFile(
        label=path.name,
        titles=[sheet.title for sheet in visible_first],
        load=load,
        tables=tables,
        names=_single_cells(book.names),
        names_on=lambda title: _single_cells(book.names_on(title)),
        remarks=_remarks(book),
        text=text,
    )


def _remarks(book: Workbook) -> list[str]:
    """Return what the user should know about values that come from elsewhere."""
    if any(kind == "externalLink" for kind, _ in book.relations.values()):
        return [remark("table.other_workbooks")]
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
    roots = read_relations(path, package, "")
    part = next((target for kind, target in roots.values() if kind == "officeDocument"), "")
    if part.endswith(".bin"):
        raise InputError(f"{path}: is a binary workbook (.xlsb); save it as .xlsx.")
    if part not in names:
        raise InputError(f"{path}: is a zip file but not a workbook.")
    relations = read_relations(path, package, part)
    book = Workbook(part=part, sheets=[], names={}, relations=relations)
    root = xml_root(path, package, part)
    if local(root.tag) != "workbook":
        raise InputError(f"{path}: is not a workbook but another kind of document.")
    for element in root.iter():
        kind = local(element.tag)
        if kind == "workbookPr":
            book.since_1904 = element.get("date1904", "0") in _YES
        elif kind == "sheet":
            key = next((v for k, v in element.items() if local(k) == "id"), "")
            book.listed.append(element.get("name", ""))
            kind, target = relations.get(key, ("", ""))
            if kind == "worksheet" and target in names:
                hidden = element.get("state", "visible") != "visible"
                parts = read_relations(path, package, target)
                book.sheets.append(SheetPart(element.get("name", ""), target, hidden, parts))
        elif kind == "definedName":
            sheet = element.get("localSheetId", "")
            home = book.local_names.setdefault(int(sheet), {}) if sheet.isdigit() else book.names
            home[element.get("name", "")] = element.text or ""
    if not book.sheets:
        raise InputError(f"{path}: the workbook has no sheet with cells.")
    return book


def read_tables(path: Path, package: zipfile.ZipFile, sheet: SheetPart) -> list[TableArea]:
    """Return the named tables of a sheet."""
    tables = []
    for kind, part in sheet.relations.values():
        if kind == "table" and part in package.namelist():
            root = xml_root(path, package, part)
            with understood(
                partial("{}: damaged, the table part {} has no range.".format, path, part)
            ):
                tables.append(_table(sheet.title, part, root))
    return tables


def _table(title: str, part: str, root: Element) -> TableArea:
    columns = (column for column in root.iter() if local(column.tag) == "tableColumn")
    return TableArea(
        name=root.get("displayName", root.get("name", "")),
        sheet=title,
        area=split_area(root.attrib["ref"]),
        header_rows=int(root.get("headerRowCount", "1")),
        totals_rows=int(root.get("totalsRowCount", "0")),
        part=part,
        columns=tuple(unescape(column.get("name", "")) for column in columns),
    )


def part_of_kind(package: zipfile.ZipFile, book: Workbook, kind: str) -> str:
    """Return the one part of a workbook of a kind, empty where it has none."""
    part = next((target for relation, target in book.relations.values() if relation == kind), "")
    return part if part in package.namelist() else ""


def read_shared_strings(path: Path, package: zipfile.ZipFile, book: Workbook) -> list[str]:
    """Return the texts that cells of type ``s`` point to."""
    part = part_of_kind(package, book, "sharedStrings")
    items = xml_elements(path, package, part, "si") if part else ()
    return [unescape(_rich_text(item)) for item in items]


def _rich_text(item: Element) -> str:
    """Return a text whose runs may have formats of their own; phonetic runs do not count."""
    pieces = []
    for run in item:
        kind = local(run.tag)
        if kind == "t":
            pieces.append(run.text or "")
        elif kind == "r":
            pieces += [piece.text or "" for piece in run if local(piece.tag) == "t"]
    return "".join(pieces)


def _date_styles(path: Path, package: zipfile.ZipFile, book: Workbook) -> dict[str, str]:
    """Return the cell styles (as the ``s`` attribute writes them) that show dates."""
    part = part_of_kind(package, book, "styles")
    if not part:
        return {}
    codes: dict[int, str] = dict(_BUILT_IN_DATES)
    cells: list[int] = []
    with understood(lambda: f"{path}: damaged, the styles have a number format without number."):
        for element in xml_root(path, package, part).iter():
            kind = local(element.tag)
            if kind == "numFmt":
                codes[int(element.get("numFmtId", "0"))] = element.get("formatCode", "")
            elif kind == "cellXfs":
                cells += [
                    int(style.get("numFmtId", "0")) for style in element if local(style.tag) == "xf"
                ]
    dates = {n: code for n, code in codes.items() if is_date_format(code) or _NAMED(code)}
    return {str(index): dates[number] for index, number in enumerate(cells) if number in dates}


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


def _single_cells(names: Mapping[str, str]) -> dict[str, tuple[str, int, int]]:
    """Return the defined names that stand for one cell."""
    places = {}
    for name, reference in names.items():
        match = re.fullmatch(r"('(?:[^']|'')+'|[^'!:]+)!(\$?[A-Z]{1,3}\$?\d+)", reference)
        if match:
            places[name.casefold()] = (plain_title(match[1]), *split_cell(match[2]))
    return places


def row_cells(row: Element) -> Iterator[tuple[int, Element]]:
    """Yield the cells of a row with their column numbers."""
    column = 0
    for cell in row.iter(row.tag.removesuffix("row") + "c"):
        reference = cell.get("r")
        column = column + 1 if reference is None else column_number(reference.rstrip("0123456789"))
        yield column, cell


@dataclass(slots=True)
class _SheetReader:
    """Reads the cells of one sheet part in one pass."""

    path: Path
    strings: list[str]
    dates: dict[str, str]
    since_1904: bool
    max_rows: int
    date_marks: frozenset[bytes] = field(init=False)
    readers: dict[RowForm, list[tuple[int, Callable[[bytes], Value | None]]]] = field(
        init=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        """Note the styles of dates as the XML writes them."""
        self.date_marks = frozenset(style.encode() for style in self.dates)

    def read(self, package: zipfile.ZipFile, title: str, part: str) -> CellGrid:
        """Return the sheet's cells; empty but formatted cells are left out."""
        grid = CellGrid(title)
        row = 0
        with understood(lambda: remark("book.damaged_row", of=f"{self.path} › {title}", row=row)):
            try:
                with uncollected():
                    return self.read_plain(package, title, part)
            except (NotPlain, ValueError, IndexError):
                pass  # the parser tells which row is damaged, if one is
            for element in xml_elements(self.path, package, part, "row", "mergeCell"):
                if local(element.tag) == "mergeCell":
                    grid.merged.append(split_area(element.attrib["ref"]))
                    continue
                row = int(element.get("r", row + 1))
                if element.get("hidden", "0") in _YES:
                    grid.hidden.add(row)
                cells = self.cells(element)
                if cells and len(grid.rows) >= self.max_rows:
                    grid.truncated = True
                    break
                if cells:
                    grid.rows[row] = grid.rows.get(row, {}) | cells
        return grid

    def read_plain(self, package: zipfile.ZipFile, title: str, part: str) -> CellGrid:
        """Return the cells of a sheet of the plain form."""
        if part in package.namelist() and package.getinfo(part).file_size > LARGEST:
            raise NotPlain
        data, grid = read_part(self.path, package, part), CellGrid(title)
        start, end = sheet_data(data)

        def note(name: str, attributes: dict[str, str]) -> None:
            if local(name) == "mergeCell":
                grid.merged.append(split_area(attributes["ref"]))

        parser = new_parser(self.path, part, start=note)
        try:
            parser.Parse(data[:start], False)
            parser.Parse(data[end:], True)
        except expat.ExpatError:
            raise NotPlain from None
        for row in plain_rows(data, start, end):
            if _HIDDEN.search(row.attributes):
                grid.hidden.add(row.number)
            cells = (
                self.formed_cells(row.form, row.parts) if row.form else self.plain_cells(row.cells)
            )
            if cells and len(grid.rows) >= self.max_rows:
                grid.truncated = True
                break
            if cells:
                grid.rows[row.number] = grid.rows.get(row.number, {}) | cells
        return grid

    def plain_cells(self, row: Sequence[re.Match[bytes]]) -> dict[int, Value]:
        """Return the typed values of a row of the plain form by column number."""
        cells: dict[int, Value] = {}
        for cell in row:
            letters, _, style, kind, formula, content = cell.groups()
            is_number = kind is None and content is not None and style not in self.date_marks
            if is_number and len(content) > len(b"<v></v>"):  # by far the most frequent
                cells[_column_of(letters)] = float(content[3:-4])
                continue
            text = b"" if content is None else content[content.find(b">") + 1 : content.rfind(b"<")]
            if text and kind == b"inlineStr":
                text = text[text.find(b">") + 1 : text.rfind(b"<")]
            if not text and formula is not None and kind != b"str":
                inner = formula[formula.find(b">") + 1 : max(formula.rfind(b"<"), 0)]
                value: Value | None = NotCalculated(_plain_text(inner))
            else:
                value = self.plain_value(text, style, kind)
            if value is not None:
                cells[_column_of(letters)] = value
        return cells

    def plain_value(self, text: bytes, style: bytes | None, kind: bytes | None) -> Value | None:
        """Return the typed value of a cell that holds a text, None for an empty one."""
        if not text:
            return None
        if kind is None:
            date = self.dates.get(style.decode()) if style else None
            return float(text) if date is None else self.date(float(text), date)
        if kind == b"s":
            return self.string(int(text))
        if kind == b"inlineStr":
            return unescape(_plain_text(text)) or None
        like = Element("c", {"s": (style or b"").decode()})
        return self.value(_plain_text(text), kind.decode(), like)

    def formed_cells(self, form: RowForm, parts: Sequence[bytes]) -> dict[int, Value]:
        """Return the typed values of a row that was taken apart by its form, by column number."""
        if form not in self.readers:
            self.readers[form] = [self.reader_of(cell) for cell in form.cells]
        texts = zip(self.readers[form], parts[1::2], strict=True)
        return {
            column: value for (column, read), text in texts if (value := read(text)) is not None
        }

    def reader_of(self, cell: FormCell) -> tuple[int, Callable[[bytes], Value | None]]:
        """Return the column of a cell of a form, and what makes a value of its text."""
        is_number = cell.kind is None and cell.style not in self.date_marks
        read = float if is_number else partial(self.plain_value, style=cell.style, kind=cell.kind)
        return _column_of(cell.letters), read

    def cells(self, row: Element) -> dict[int, Value]:
        """Return the typed values of a row by column number, without those that are blank."""
        cells: dict[int, Value] = {}
        v = row.tag.removesuffix("row") + "v"
        for column, cell in row_cells(row):
            text, kind = cell.findtext(v, ""), cell.get("t", "n")
            value = self.value(text, kind, cell) if text else _without_text(kind, cell)
            if value is not None:
                cells[column] = value
        return cells

    def value(self, text: str, kind: str, cell: Element) -> Value | None:
        """Return the typed value of a cell that holds a text."""
        if kind == "n":
            style = self.dates.get(cell.get("s", ""))
            return float(text) if style is None else self.date(float(text), style)
        if kind == "s":
            return self.string(int(text))
        if kind == "b":
            return text.strip() in ("1", "true")
        if kind == "e":
            return CellFault(text)
        if kind == "d":
            return date_of_iso(text)
        return unescape(text)

    def string(self, index: int) -> str | None:
        """Return a shared string, None for an empty one."""
        if index < 0:
            raise IndexError(index)
        return self.strings[index] or None

    def date(self, number: float, style: str) -> Value:
        """Return a date, a number shown as ``007``, or the number where no calendar reaches."""
        if name := _NAMED(style):
            shown = re.sub(r'["\\]', "", name[1]) + f"{number:0{len(name[2])}.0f}"
            return named_number(number, shown) if number >= 0 and number % 1 == 0 else number
        try:
            return CellDate(date_of_serial(number, since_1904=self.since_1904), style)
        except (OverflowError, ValueError):
            return number


@lru_cache(maxsize=2**15)
def _column_of(letters: bytes) -> int:
    return column_number(letters.decode())


def _plain_text(text: bytes) -> str:
    """Return the text that stands between two tags."""
    if b"&#" in text:
        raise NotPlain
    return unescaped(text.decode("utf-8"))


def _without_text(kind: str, cell: Element) -> Value | None:
    """Return what a cell without stored value holds: a text of its own, or a new formula."""
    for child in cell:
        if local(child.tag) == "is":
            return unescape(_rich_text(child)) or None
        # Text formulas store an empty result as no text at all; other types mean "never run".
        if local(child.tag) == "f" and kind != "str":
            return NotCalculated(child.text or "")
    return None
