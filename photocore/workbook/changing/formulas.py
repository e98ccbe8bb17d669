"""What formulas refer to: rows copied downwards, results gone stale, ranges that grow."""

from __future__ import annotations

import posixpath
import re
import zipfile
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from photocore.workbook.reading.grid import TableArea, cell_name, plain_title, split_area
from photocore.workbook.reading.package import (
    Parts,
    local,
    opened,
    read_part,
    read_relations,
    understood,
    windows,
    xml_elements,
)
from photocore.workbook.reading.references import FORMULA
from photocore.workbook.reading.xlsx import SheetPart, Workbook, part_of_kind, row_cells
from photocore.workbook.reading.xmltext import escaped, unescaped

_RANGE = re.compile(
    r"(?P<sheet>(?:'(?:[^']|'')+'|[A-Za-z0-9_.À-ɏ]+)!)?"
    r"(?P<c1>\$?[A-Z]{1,3})(?P<r1>\$?\d+):(?P<c2>\$?[A-Z]{1,3})(?P<r2>\$?\d+)(?![\w(])"
)
_AREA = re.compile(r"[A-Z]{1,3}\d{1,7}(:[A-Z]{1,3}\d{1,7})?")
#: A cell without its sheet; all are alike when only sheets, tables and names matter.
_ANY_CELL = re.compile(r"(?<![\w.'$])\$?[A-Z]{1,3}\$?\d+(?![\w.!'(])")
#: Functions whose result may depend on any cell, whatever their text names.
_FAR_REACHING = re.compile(r"\b(INDIRECT|OFFSET|CELL|INFO)\s*\(", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class ModelCell:
    """Format and formula of a cell that new rows copy; empty where it has none."""

    style: str = ""
    formula: str = ""


def model_cells(
    path: Path, package: zipfile.ZipFile, sheet: SheetPart, row: int
) -> dict[int, ModelCell]:
    """Return the formats and formulas of a row's cells, shared formulas written out."""
    from openpyxl.formula.translate import Translator

    models: dict[int, ModelCell] = {}
    shared: dict[str, Translator] = {}
    number = 0
    with understood(
        lambda: f"{path} › {sheet.title}: damaged near row {number}, a cell cannot be understood."
    ):
        for element in xml_elements(path, package, sheet.part, "row"):
            number = int(element.get("r", number + 1))
            if number > row:
                break
            for column, cell in row_cells(element):
                node = next((child for child in cell if local(child.tag) == "f"), None)
                formula = "" if node is None else node.text or ""
                if node is not None and node.get("t") == "shared":
                    place, group = cell_name(number, column), node.get("si", "")
                    if formula:
                        shared[group] = Translator(f"={formula}", origin=place)
                    elif group in shared:
                        formula = shared[group].translate_formula(place)[1:]
                if number == row:
                    models[column] = ModelCell(cell.get("s", ""), formula)
    return models


@dataclass(slots=True)
class References:
    """The formulas, names and charts of a package, and what they refer to."""

    path: Path
    package: zipfile.ZipFile
    book: Workbook
    tables: Sequence[TableArea]

    def dependents(self, changed: Iterable[str], settled: Collection[str] = ()) -> set[str]:
        """Return the sheets with formulas that may depend on changed sheets, those included.

        Errs on the safe side: a formula depends on a sheet when it names it, one of its tables, or
        a defined name that leads there. Sheets are settled whose every formula has its new result.
        """
        stale = set(changed)
        if not stale:
            return stale
        reached = stale.union(settled)
        others = [sheet for sheet in self.book.sheets if sheet.title not in reached]
        texts = {sheet.title: self._formulas(sheet) for sheet in others}
        names = dict(self.book.names)
        while True:
            words = self._words(stale)
            through = {n for n, text in names.items() if words.search(text)}
            if through:
                words = self._words(stale, through)
            more = {
                title
                for title, text in texts.items()
                if title not in stale and (words.search(text) or _FAR_REACHING.search(text))
            }
            if not more:
                return stale
            stale |= more

    def _words(self, titles: set[str], names: Iterable[str] = ()) -> re.Pattern[str]:
        """Return a pattern that finds a mention of sheets, of their tables, or of names."""
        tables = [table.name for table in self.tables if table.sheet in titles]
        quoted = [re.escape(title.replace("'", "''")) for title in titles]
        words = [rf"(?:'|\b){title}'?!" for title in quoted]
        words += [rf"(?<![\w.]){re.escape(name)}(?![\w.(])" for name in (*tables, *names)]
        # A range over several sheets (first:last!A1) is caught by its first or last sheet.
        words += [rf"(?:'|\b){title}:" for title in quoted]
        return re.compile("|".join(words), re.IGNORECASE)

    def _formulas(self, sheet: SheetPart) -> str:
        """Return the formulas of a sheet as one text, those that differ only in cells once."""
        data = read_part(self.path, self.package, sheet.part)
        texts = {match.decode("utf-8", "replace") for match in FORMULA.findall(data)}
        shapes = {_ANY_CELL.sub("#", unescaped(text)) for text in texts}
        return "\n".join(sorted(shapes))

    def grow(self, area: TableArea, bottom: int, parts: Parts) -> None:
        """Let a table, and all that reaches to its last row, reach down to a new one.

        Parameters
        ----------
        area : TableArea
            The table as it stands in the file.
        bottom : int
            Its new last row.
        parts : dict
            Changed parts so far; takes the further ones.
        """
        sheet = next(sheet for sheet in self.book.sheets if sheet.title == area.sheet)
        now = partial(parts.now, self.path, self.package)
        parts[area.part] = _grown_table(now(area.part), area, bottom)
        parts[sheet.part] = _grown_sheet(now(sheet.part), area, bottom)
        for name in self.package.namelist():
            if re.match(r"(.*/)?charts/(chart|chartEx)\d*\.xml$", posixpath.normpath(name)):
                self._replace(name, parts, area, bottom, tag=rb"f")
        self._replace(self.book.part, parts, area, bottom, tag=rb"definedName")
        last = re.compile(rb"![$]?[A-Z]+[$]?\d+:[$]?[A-Z]+[$]?%d\b" % area.area[2])
        for any_sheet in self.book.sheets:
            part = parts.held(any_sheet.part) or read_part(self.path, self.package, any_sheet.part)
            if any(last.search(text) for _, text in windows(opened(part))):
                self._replace(any_sheet.part, parts, area, bottom, tag=rb"f")

    def _replace(
        self, name: str, parts: Parts, area: TableArea, bottom: int, *, tag: bytes
    ) -> None:
        """Let the ranges in the text of certain elements grow."""
        data = parts.now(self.path, self.package, name)
        pattern = re.compile(rb"(<(?:\w+:)?%s(?:\s[^>]*)?>)([^<]+)(</)" % tag)

        def replace(match: re.Match[bytes]) -> bytes:
            text = unescaped(match[2].decode("utf-8"))
            new = grown_reference(text, area, bottom)
            return match[0] if new == text else match[1] + escaped(new).encode() + match[3]

        changed = pattern.sub(replace, data)
        if changed != data:
            parts[name] = changed


def grown_reference(text: str, area: TableArea, bottom: int) -> str:
    """Return a reference with each range that ends in the table's last row reaching further.

    Parameters
    ----------
    text : str
        A formula or reference.
    area : TableArea
        The table.
    bottom : int
        Its new last row.
    """

    def grow(match: re.Match[str]) -> str:
        title = plain_title((match["sheet"] or "").removesuffix("!"))
        plain = f"{match['c1']}{match['r1']}:{match['c2']}{match['r2']}"
        if title != area.sheet or not _ends_with(area, plain):
            return match[0]
        dollar = "$" if match["r2"].startswith("$") else ""
        return f"{match[0][: -len(match['r2'])]}{dollar}{bottom}"

    return _RANGE.sub(grow, text)


def _ends_with(area: TableArea, reference: str) -> bool:
    """Whether a range lies inside a table and ends in its last row."""
    top, left, bottom, right = split_area(reference)
    inside = area.area[1] <= left and right <= area.area[3] and top >= area.area[0]
    return inside and bottom == area.area[2]


def _grown_table(data: bytes, area: TableArea, bottom: int) -> bytes:
    """Return a table part whose range, and whose filter's range, reach to a new last row."""
    top, left, last, right = area.area
    old = f'"{cell_name(top, left)}:{cell_name(last, right)}"'.encode()
    new = f'"{cell_name(top, left)}:{cell_name(bottom, right)}"'.encode()
    tag = re.compile(rb"<(?:\w+:)?(?:table|autoFilter)\s[^>]*>")
    pattern = re.compile(rb"(\sref\s*=\s*)" + old.replace(b'"', rb"[\"']"))
    return tag.sub(lambda match: pattern.sub(lambda m: m[1] + new, match[0]), data)


def _grown_sheet(data: bytes, area: TableArea, bottom: int) -> bytes:
    """Return a sheet whose conditional formats and validations reach to a new last row."""

    def grown(reference: str) -> str:
        if not _AREA.fullmatch(reference) or not _ends_with(area, reference):
            return reference
        top, left, _, right = split_area(reference)
        return f"{cell_name(top, left)}:{cell_name(bottom, right)}"

    def attribute(match: re.Match[bytes]) -> bytes:
        return match[1] + " ".join(map(grown, match[2].decode().split())).encode() + match[3]

    def element(match: re.Match[bytes]) -> bytes:
        return re.sub(rb"""(\ssqref\s*=\s*["'])([^"']*)(["'])""", attribute, match[0])

    tags = rb"<(?:\w+:)?(?:conditionalFormatting|dataValidation|ignoredError)\s[^>]*>"
    # All of these stand behind the rows, which may be millions of bytes.
    start = data.rfind(b"</row>") + 1
    rest = re.sub(tags, element, data[start:])
    return data[:start] + re.sub(rb"(<(?:\w+:)?sqref>)([^<]*)(</)", attribute, rest)


def areas_of_arrays(data: bytes) -> list[tuple[int, int, int, int]]:
    """Return the ranges that a single formula fills."""
    if not any(kind in data for kind in (b'"array"', b"'array'", b"dataTable")):
        return []
    tags = re.findall(rb"<(?:\w+:)?f\s[^>]*>", data)
    matches = [re.search(rb"\sref\s*=\s*[\"']([A-Z]+\d+:[A-Z]+\d+)[\"']", tag) for tag in tags]
    kinds = [b"array" in tag or b"dataTable" in tag for tag in tags]
    return [split_area(m[1].decode()) for m, kind in zip(matches, kinds, strict=True) if m and kind]


def charts_of(path: Path, package: zipfile.ZipFile, sheet: SheetPart) -> list[str]:
    """Return the parts of the charts that are drawn on a sheet."""
    drawings = [part for kind, part in sheet.relations.values() if kind == "drawing"]
    return [
        part
        for drawing in drawings
        for kind, part in read_relations(path, package, drawing).values()
        if kind == "chart"
    ]


def drop_order(path: Path, package: zipfile.ZipFile, book: Workbook, parts: Parts) -> None:
    """Leave out the list of formulas in the order of calculation: it names one that is gone.

    Excel makes it anew, and takes a workbook for damaged whose list is wrong.
    """
    part = part_of_kind(package, book, "calcChain")
    if not part:
        return
    parts[part] = None
    folder, file = posixpath.split(book.part)
    for name in (f"{folder}/_rels/{file}.rels".lstrip("/"), "[Content_Types].xml"):
        data = parts.now(path, package, name)
        entry = rb"<(?:\w+:)?(?:Relationship|Override)\s[^>]*%s[\"'][^>]*?/>"
        parts[name] = re.sub(entry % re.escape(posixpath.basename(part).encode()), b"", data)


def recalculate_on_load(path: Path, package: zipfile.ZipFile, book: Workbook, parts: Parts) -> None:
    """Tell spreadsheet programs to calculate all formulas when they open the workbook."""
    data = parts.now(path, package, book.part)
    element = re.search(rb"<(?:\w+:)?calcPr(?:\s[^>]*)?>", data)
    if element:
        tag = re.sub(rb"""\sfullCalcOnLoad\s*=\s*("[^"]*"|'[^']*')""", b"", element[0])
        head = re.match(rb"<(?:\w+:)?calcPr", tag)
        end = head.end() if head else 0
        tag = tag[:end] + b' fullCalcOnLoad="1"' + tag[end:]
        parts[book.part] = data[: element.start()] + tag + data[element.end() :]
        return
    # The schema fixes the order of the elements; calcPr comes before these.
    later = (
        rb"<(?:\w+:)?(?:oleSize|customWorkbookViews|pivotCaches|smartTagPr|smartTagTypes|webPublishing"
        rb"|fileRecoveryPr|webPublishObjects|extLst)\b|</(\w+:)?workbook\s*>"
    )
    place = re.search(later, data)
    root = re.search(rb"<(\w+:)?workbook\s", data)
    prefix = (root[1] or b"") if root else b""
    if place:
        tag = b"<" + prefix + b'calcPr fullCalcOnLoad="1"/>'
        parts[book.part] = data[: place.start()] + tag + data[place.start() :]
