"""What formulas refer to: rows copied downwards, results gone stale, ranges that grow."""

from __future__ import annotations

import posixpath
import re
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape as escape_xml
from xml.sax.saxutils import unescape as unescape_xml

from photocore.errors import InputError
from photocore.workbook.grid import TableArea, cell_name, split_area, split_cell
from photocore.workbook.package import EnoughError, local, open_package, read_part, scan_part
from photocore.workbook.xlsx import Sheet, Workbook

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


def row_cells(path: Path, sheet: Sheet, row: int, left: int, right: int) -> dict[int, ModelCell]:
    """Return the formats and formulas of a row's cells, shared formulas written out."""
    from openpyxl.formula.translate import Translator

    found: dict[int, ModelCell] = {}
    shared: dict[str, tuple[str, str]] = {}
    attributes: dict[str, str] = {}
    formula_attributes: dict[str, str] | None = None
    text: list[str] = []
    place = (0, 0)
    inside = False

    def start(name: str, given: dict[str, str]) -> None:
        nonlocal attributes, formula_attributes, place, inside
        kind = local(name)
        if kind == "row":
            place = (int(given.get("r", place[0] + 1)), 0)
            if place[0] > row:
                raise EnoughError
        elif kind == "c":
            attributes, formula_attributes = given, None
            place = split_cell(given["r"]) if "r" in given else (place[0], place[1] + 1)
            text.clear()
        elif kind == "f":
            formula_attributes, inside = given, True

    def end(name: str) -> None:
        nonlocal inside
        kind = local(name)
        if kind == "f":
            inside = False
        if kind != "c":
            return
        formula = "".join(text)
        if formula_attributes and formula_attributes.get("t") == "shared":
            group = formula_attributes.get("si", "")
            if formula:
                shared[group] = (formula, cell_name(*place))
            elif group in shared:
                master, origin = shared[group]
                translated = Translator(f"={master}", origin=origin)
                formula = translated.translate_formula(cell_name(*place))[1:]
        if place[0] == row and left <= place[1] <= right:
            found[place[1]] = ModelCell(attributes.get("s", ""), formula)

    def collect(data: str) -> None:
        if inside:
            text.append(data)

    with open_package(path) as package:
        try:
            scan_part(path, package, sheet.part, start=start, end=end, text=collect)
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{path} › {sheet.title}: damaged near row {place[0]}, a cell cannot be understood."
            ) from error
    return found


@dataclass(slots=True)
class References:
    """The formulas, names and charts of a package, and what they refer to."""

    path: Path
    package: zipfile.ZipFile
    book: Workbook
    tables: Sequence[TableArea]

    def dependents(self, changed: Iterable[str]) -> set[str]:
        """Return the sheets with formulas that may depend on changed sheets, those included.

        Errs on the safe side: a formula depends on a sheet when it names it, one of its tables, or
        a defined name that leads there.
        """
        stale = set(changed)
        if not stale:
            return stale
        texts = {sheet.title: self._formulas(sheet) for sheet in self.book.sheets}
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

    def _formulas(self, sheet: Sheet) -> str:
        """Return the formulas of a sheet as one text, those that differ only in cells once."""
        pieces: list[str] = []
        shapes: set[str] = set()
        inside = False

        def start(name: str, attributes: dict[str, str]) -> None:  # noqa: ARG001
            nonlocal inside
            inside = local(name) == "f"

        def end(name: str) -> None:  # noqa: ARG001
            nonlocal inside
            if inside:
                shapes.add(_ANY_CELL.sub("#", "".join(pieces)))
                pieces.clear()
            inside = False

        def collect(data: str) -> None:
            if inside:
                pieces.append(data)

        scan_part(self.path, self.package, sheet.part, start=start, end=end, text=collect)
        return "\n".join(sorted(shapes))

    def grow(self, area: TableArea, bottom: int, parts: dict[str, bytes]) -> None:
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
        parts[area.part] = _grown_table(self._now(area.part, parts), area, bottom)
        parts[sheet.part] = _grown_sheet(self._now(sheet.part, parts), area, bottom)
        for name in self.package.namelist():
            if re.match(r"(.*/)?charts/(chart|chartEx)\d*\.xml$", posixpath.normpath(name)):
                self._replace(name, parts, area, bottom, tag=rb"f")
        self._replace(self.book.part, parts, area, bottom, tag=rb"definedName")

    def _now(self, name: str, parts: dict[str, bytes]) -> bytes:
        return parts[name] if name in parts else read_part(self.path, self.package, name)

    def _replace(
        self, name: str, parts: dict[str, bytes], area: TableArea, bottom: int, *, tag: bytes
    ) -> None:
        """Let the ranges in the text of certain elements grow."""
        data = self._now(name, parts)
        pattern = re.compile(rb"(<(?:\w+:)?%s(?:\s[^>]*)?>)([^<]+)(</)" % tag)

        def replace(match: re.Match[bytes]) -> bytes:
            text = unescape_xml(match[2].decode("utf-8"), {"&quot;": '"', "&apos;": "'"})
            new = grown_reference(text, area, bottom, own_sheet=False)
            return match[0] if new == text else match[1] + escape_xml(new).encode() + match[3]

        changed = pattern.sub(replace, data)
        if changed != data:
            parts[name] = changed


def grown_reference(text: str, area: TableArea, bottom: int, *, own_sheet: bool) -> str:
    """Return a reference with each range that ends in the table's last row reaching further.

    Parameters
    ----------
    text : str
        A formula or reference.
    area : TableArea
        The table.
    bottom : int
        Its new last row.
    own_sheet : bool
        Whether ranges without a sheet name lie on the table's sheet.
    """
    top, left, last, right = area.area

    def grow(match: re.Match[str]) -> str:
        title = (match["sheet"] or "").removesuffix("!").strip("'").replace("''", "'")
        if title != area.sheet and not (own_sheet and not title):
            return match[0]
        plain = f"{match['c1']}{match['r1']}:{match['c2']}{match['r2']}"
        first_row, first_column, last_row, last_column = split_area(plain)
        inside = left <= first_column and last_column <= right and first_row >= top
        if last_row != last or not inside:
            return match[0]
        dollar = "$" if match["r2"].startswith("$") else ""
        return f"{match[0][: -len(match['r2'])]}{dollar}{bottom}"

    return _RANGE.sub(grow, text)


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
    top, left, last, right = area.area

    def grown(reference: str) -> str:
        pieces = []
        for piece in reference.split():
            if not _AREA.fullmatch(piece):
                pieces.append(piece)
                continue
            first_row, first_column, last_row, last_column = split_area(piece)
            inside = left <= first_column and last_column <= right
            if inside and last_row == last and first_row >= top:
                piece = f"{cell_name(first_row, first_column)}:{cell_name(bottom, last_column)}"
            pieces.append(piece)
        return " ".join(pieces)

    def attribute(match: re.Match[bytes]) -> bytes:
        return match[1] + grown(match[2].decode()).encode() + match[3]

    def element(match: re.Match[bytes]) -> bytes:
        return re.sub(rb"""(\ssqref\s*=\s*["'])([^"']*)(["'])""", attribute, match[0])

    tags = rb"<(?:\w+:)?(?:conditionalFormatting|dataValidation|ignoredError)\s[^>]*>"
    data = re.sub(tags, element, data)
    return re.sub(rb"(<(?:\w+:)?sqref>)([^<]*)(</)", attribute, data)


def recalculate_on_load(
    path: Path, package: zipfile.ZipFile, book: Workbook, parts: dict[str, bytes]
) -> None:
    """Tell spreadsheet programs to calculate all formulas when they open the workbook."""
    data = parts.get(book.part) or read_part(path, package, book.part)
    found = re.search(rb"<(?:\w+:)?calcPr(?:\s[^>]*)?>", data)
    if found:
        tag = re.sub(rb"""\sfullCalcOnLoad\s*=\s*("[^"]*"|'[^']*')""", b"", found[0])
        head = re.match(rb"<(?:\w+:)?calcPr", tag)
        end = head.end() if head else 0
        tag = tag[:end] + b' fullCalcOnLoad="1"' + tag[end:]
        parts[book.part] = data[: found.start()] + tag + data[found.end() :]
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
