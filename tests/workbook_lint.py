"""Faults in a workbook that make Excel offer to repair it, or that show as errors elsewhere.

Beside what the schemas say, each rule stands for a prompt or an error that was seen in a
spreadsheet program.
"""

from __future__ import annotations

import posixpath
import re
import zipfile
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from photocore.workbook.reading.grid import TableArea, cell_name, split_area, split_cell
from photocore.workbook.reading.package import open_package
from photocore.workbook.reading.xlsx import (
    Workbook,
    read_directory,
    read_shared_strings,
    read_tables,
)
from tests.workbook_schema import schema_faults

_MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
_TYPES = "[Content_Types].xml"

_LIKE_A_CELL = re.compile(r"[A-Za-z]{1,3}\d{1,7}|[rR]\d*[cC]\d*|[rR]\d*|[cC]\d*")
_NAME = re.compile(r"[A-Za-z_\\À-ɏ][\w.\\]*")
_TEXTS = re.compile(r"\"(?:[^\"]|\"\")*\"|'(?:[^']|'')*'")
_FUNCTION = re.compile(r"([A-Za-z_][\w.]*)\s*\(")
#: Functions that show as #NAME? in LibreOffice 7.4, or whose result depends on the language.
_AVOIDED = frozenset(
    {"LET", "LAMBDA", "XLOOKUP", "XMATCH", "FILTER", "SORT", "SORTBY", "UNIQUE", "SEQUENCE"}
    | {"RANDARRAY", "TEXT", "CELL", "INFO"}
)
_LONGEST_FORMULA = 8192


@dataclass(slots=True)
class _SheetFacts:
    """What one pass over a sheet finds."""

    texts: dict[str, str | None] = field(default_factory=dict)
    formulas: dict[str, str] = field(default_factory=dict)
    rules: list[str] = field(default_factory=list)
    cells: list[tuple[int, int]] = field(default_factory=list)
    merged: list[tuple[int, int, int, int]] = field(default_factory=list)
    styles: set[int] = field(default_factory=set)


def lint(path: Path | str) -> list[str]:
    """Return the faults of a workbook, none if it is sound.

    Parameters
    ----------
    path : path
        An .xlsx or .xlsm file.

    Raises
    ------
    InputError
        If the file is not a workbook at all.
    """
    path = Path(path)
    with open_package(path) as package:
        book = read_directory(path, package)
        tables = {sheet.title: read_tables(path, package, sheet) for sheet in book.sheets}
        faults = [*_package_faults(package), *_name_faults(book, tables)]
        shared = read_shared_strings(path, package, book)
        styles = next((t for kind, t in book.relations.values() if kind == "styles"), "")
        known = ElementTree.fromstring(package.read(styles)).find(_MAIN + "cellXfs")
        for sheet in book.sheets:
            facts = _facts(ElementTree.fromstring(package.read(sheet.part)), shared)
            found = [
                *_order_faults(facts, 1 if known is None else len(known)),
                *_formula_faults(facts, book.names),
                *_rule_faults(facts),
                *_table_faults(package, tables[sheet.title], facts),
            ]
            faults += [f"{sheet.title}: {fault}" for fault in found]
    return faults


def _package_faults(package: zipfile.ZipFile) -> Iterator[str]:
    """Yield what the schemas refuse, parts without content type and relations that lead nowhere."""
    parts, kinds = set(package.namelist()), ElementTree.fromstring(package.read(_TYPES))
    typed = {e.get("PartName", "/").lstrip("/") for e in kinds if e.get("PartName")}
    endings = {e.get("Extension", "").lower() for e in kinds}
    for part in sorted(parts - typed - {_TYPES}):
        if part.rpartition(".")[2].lower() not in endings:
            yield f"the part {part} has no content type"
    for part in sorted(typed - parts):
        yield f"the part {part} has a content type but is missing"
    for part in sorted(p for p in parts if p.endswith((".rels", ".xml"))):
        yield from (f"{part}: {fault}" for fault in schema_faults(package.read(part)))
        folder = posixpath.dirname(posixpath.dirname(part))
        for relation in ElementTree.fromstring(package.read(part)) if part.endswith("rels") else ():
            whole = posixpath.join("/", folder, relation.get("Target", ""))
            inside = relation.get("TargetMode") != "External"
            if inside and posixpath.normpath(whole).lstrip("/") not in parts:
                yield f"{part} leads to {relation.get('Target')}, which is missing"


def _name_faults(book: Workbook, tables: dict[str, list[TableArea]]) -> Iterator[str]:
    """Yield bad names of sheets, tables and cells."""
    titles = [sheet.title for sheet in book.sheets]
    for title in titles:
        if not title or len(title) > 31 or re.search(r"[\[\]:*?/\\]", title) or title[0] == "'":
            yield f'the sheet name "{title}" is not allowed'
    names = [name for name in book.names if not name.startswith("_xlnm.")]
    names += [table.name for areas in tables.values() for table in areas]
    for name, count in Counter(n.casefold() for n in [*names, *titles]).items():
        if count > 1 and name not in {t.casefold() for t in titles}:
            yield f'the name "{name}" is used {count} times'
    for name in names:
        if _LIKE_A_CELL.fullmatch(name):
            yield f'the name "{name}" looks like a cell'
        elif not _NAME.fullmatch(name) or len(name) > 255:
            yield f'the name "{name}" is not allowed'
    for name, reference in book.names.items():
        if "#REF!" in reference:
            yield f'the name "{name}" leads nowhere ({reference})'
        for sheet in re.findall(r"'((?:[^']|'')+)'!", reference):
            if sheet.replace("''", "'") not in titles:
                yield f'the name "{name}" leads to a missing sheet ({reference})'
        for sheet in re.findall(r"(?:^|[,(])([A-Za-z_][\w.]*)!", reference):
            if sheet not in titles:
                yield f'the name "{name}" leads to a missing sheet ({reference})'


def _order_faults(facts: _SheetFacts, formats: int) -> Iterator[str]:
    """Yield cells out of order, cells twice, unknown formats and overlapping merged ranges."""
    for before, after in zip(facts.cells, facts.cells[1:], strict=False):
        if after <= before:
            yield f"the cell {cell_name(*after)} comes after {cell_name(*before)}"
    for style in sorted(facts.styles):
        if style >= formats:
            yield f"the cell format {style} does not exist"
    for index, first in enumerate(facts.merged):
        for second in facts.merged[index + 1 :]:
            if _overlap(first, second):
                yield f"merged ranges overlap at {cell_name(*second[:2])}"


def _formula_faults(facts: _SheetFacts, names: Mapping[str, str]) -> Iterator[str]:
    """Yield formulas that Excel or LibreOffice will not read; functions with names are known."""
    own = [name for name, text in names.items() if text.startswith("_xlfn.LAMBDA(")]
    called = re.compile(rf"\b({'|'.join(own)})\(" if own else r"(?!)")
    for cell, formula in facts.formulas.items():
        for fault in formula_faults(called.sub("(", formula)):
            yield f"{cell}: {fault}: {formula:.80}"


def formula_faults(formula: str) -> Iterator[str]:
    """Yield what is wrong with a formula as it is stored in a file.

    Examples
    --------
    >>> list(formula_faults("SUMME(A1;B1)"))
    ['";" separates arguments', 'SUMME is not an English function name']
    """
    from openpyxl.utils import FORMULAE

    bare = _TEXTS.sub("''", formula)
    if formula.startswith("="):
        yield "begins with an equals sign"
    if len(formula) > _LONGEST_FORMULA:
        yield f"has {len(formula)} characters, more than {_LONGEST_FORMULA}"
    if "[@" in bare:
        yield "[@column] is [#This Row] in a file"
    if ";" in re.sub(r"\{[^}]*\}", "", bare):
        yield '";" separates arguments'
    if bare.count("(") != bare.count(")"):
        yield "brackets do not match"
    if "#REF!" in bare:
        yield "leads nowhere"
    for function in _FUNCTION.findall(re.sub(r"\[[^\[\]]*\]", "", bare)):
        name = function.upper().removeprefix("_XLFN.").removeprefix("_XLWS.")
        if name in _AVOIDED:
            yield f"{name} is not understood everywhere"
        elif name not in FORMULAE and not function.upper().startswith("_XLFN."):
            yield f"{function} is not an English function name"


def _rule_faults(facts: _SheetFacts) -> Iterator[str]:
    """Yield faults of the formulas of conditional formats and validations."""
    for formula in facts.rules:
        if formula.startswith('"'):
            yield "the list of a validation is longer than 255 characters"
        if re.search(r"\w\[", _TEXTS.sub("''", formula)):
            yield f"a rule may not name a table: {formula:.80}"
        for fault in formula_faults(formula):
            yield f"rule: {fault}: {formula:.80}"


def _table_faults(
    package: zipfile.ZipFile, tables: list[TableArea], facts: _SheetFacts
) -> Iterator[str]:
    """Yield faults of the named tables of a sheet."""
    for index, table in enumerate(tables):
        top, left, bottom, right = table.area
        columns, root = table.columns, ElementTree.fromstring(package.read(table.part))
        if bottom - top < table.header_rows + table.totals_rows:
            yield f"the table {table.name} has no row of data"
        if len(columns) != right - left + 1:
            width = right - left + 1
            yield f"the table {table.name} names {len(columns)} columns but is {width} wide"
        repeated = [n for n, count in Counter(c.casefold() for c in columns).items() if count > 1]
        for name in repeated:
            yield f'the table {table.name} has the column "{name}" twice'
        for offset, name in enumerate(columns):
            cell = cell_name(top, left + offset)
            if re.search(r"[\[\]#'@\n\r\t]", name) or name != name.strip() or not name:
                yield f'{cell}: the heading "{name}" has characters that need care in formulas'
            if table.header_rows and facts.texts.get(cell) != name:
                yield f'{cell}: holds {facts.texts.get(cell)!r}, but its table column is "{name}"'
        for element in root.iter(_MAIN + "autoFilter"):
            area = split_area(element.get("ref", ""))
            if area[:2] != (top, left) or area[3] != right or area[2] != bottom - table.totals_rows:
                yield f"the filter of the table {table.name} has another range"
        for other in tables[index + 1 :]:
            if _overlap(table.area, other.area):
                yield f"the tables {table.name} and {other.name} overlap"
        if any(_overlap(table.area, area) for area in facts.merged):
            yield f"the table {table.name} holds merged cells"


def _facts(root: ElementTree.Element, shared: list[str]) -> _SheetFacts:
    """Return the facts of one sheet."""
    facts, row, column = _SheetFacts(), 0, 0
    for line in root.iter(_MAIN + "row"):
        row, column = int(line.get("r", row + 1)), 0
        for cell in line:
            row, column = split_cell(cell.get("r") or cell_name(row, column + 1))
            place, kind, text = cell_name(row, column), cell.get("t", "n"), None
            facts.cells.append((row, column))
            facts.styles.add(int(cell.get("s", "0")))
            for part in cell.iter():
                if part.tag == _MAIN + "f" and part.text:
                    facts.formulas[place] = part.text
                elif part.tag == _MAIN + "t":
                    text = part.text
                elif part.tag == _MAIN + "v" and kind in ("s", "str"):
                    text = shared[int(part.text)] if kind == "s" else part.text
            facts.texts[place] = text
    facts.merged = [split_area(cell.get("ref", "")) for cell in root.iter(_MAIN + "mergeCell")]
    rules = [e.text or "" for e in root.iter() if e.tag.startswith(_MAIN + "formula")]
    facts.rules = [rule for rule in rules if not rule.startswith('"') or len(rule) > 257]
    return facts


def _overlap(first: tuple[int, int, int, int], second: tuple[int, int, int, int]) -> bool:
    return not (
        first[2] < second[0] or second[2] < first[0] or first[3] < second[1] or second[3] < first[1]
    )
