"""What formulas name that their workbook does not have: sheets, tables, columns, names."""

from __future__ import annotations

import re
import zipfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from photocore.errors import InputError
from photocore.workbook.reading.package import open_package, read_part
from photocore.workbook.reading.xlsx import read_directory, read_tables
from photocore.workbook.reading.xmltext import unescaped

#: Formulas are looked at so far into a part: rows further down repeat them. [bytes]
_FORMS = 2**19
FORMULA = re.compile(rb"<(?:\w+:)?f(?:\s[^>]*)?>([^<]+)</")
_DEFINED = re.compile(rb"<(?:\w+:)?definedName\s[^>]*?\bname\s*=\s*[\"']([^\"']+)")
#: Texts and errors, which name nothing.
_TEXT = re.compile(r'"(?:[^"]|"")*"|#(?:N/A|REF!|DIV/0!|NAME\?|NULL!|NUM!|VALUE!|SPILL!|CALC!)')
_SHEET = re.compile(r"(?<![\]\w.])(?:'((?:[^'\[\]]|'')+)'|([^\W\d][\w.]*))!")
_COLUMN = re.compile(r"(?<![\w.!'])([^\W\d]\w*)\[(?:(?:\[#[^\]]+\],)*\[)?([^\W\d]\w*)\]")
_BRACKETS = re.compile(r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]")
_NAME = re.compile(r"(?<![\w.!$:\[\]'#])([^\W\d][\w.]*)(?![\w.(!\[:$'])")
_CELL = re.compile(r"[A-Z]{1,3}\d{1,7}|TRUE|FALSE|R\d*(?:C\d*)?|C\d*", re.IGNORECASE)


def lost_references(path: Path) -> set[str]:
    """Return which formulas of a workbook name something that is not there, for people."""
    with open_package(path) as package:
        return set(_lost(path, package))


def refuse_lost(result: Path, before: Path | None = None) -> None:
    """Refuse a workbook whose formulas have lost what they name.

    Parameters
    ----------
    result : Path
        As written, not yet in its place.
    before : Path, optional
        What it was made of, whose own faults stay.

    Raises
    ------
    InputError
        Naming the formula.
    """
    lost = lost_references(result)
    if lost and before is not None:
        lost -= lost_references(before)
    if lost:
        raise InputError(f"{before or result}: nothing was written, since {min(lost)}.")


def _lost(path: Path, package: zipfile.ZipFile) -> Iterator[str]:
    book = read_directory(path, package)
    tables = {
        table.name.casefold(): {column.casefold() for column in table.columns}
        for sheet in book.sheets
        for table in read_tables(path, package, sheet)
    }
    whole = read_part(path, package, book.part)
    titles = {title.casefold() for title in _titles(whole)}
    names = {unescaped(match.decode()).casefold() for match in _DEFINED.findall(whole)}
    for sheet in book.sheets:
        with package.open(sheet.part) as part:
            formulas = set(FORMULA.findall(part.read(_FORMS)))
        for sheets, columns, plain in map(_references, formulas):
            for title in sheets:
                if title.casefold() not in titles | names:
                    yield f'{sheet.title} has a formula with the sheet "{title}", which is missing'
            for table, column in columns:
                if column.casefold() not in tables.get(table.casefold(), set()):
                    yield f"{sheet.title} has a formula with {table}[{column}], which is missing"
            for name in plain:
                if name.casefold() not in names | tables.keys():
                    yield f'{sheet.title} has a formula with the name "{name}", which is missing'


@lru_cache(maxsize=8192)  # a workbook is asked before and after, and most are alike
def _references(formula: bytes) -> tuple[list[str], list[tuple[str, str]], list[str]]:
    """Return the sheets, columns of tables and names in a formula as its part holds it."""
    text = _TEXT.sub('""', unescaped(formula.decode("utf-8", "replace")))
    if "_xl" in text or "LET(" in text:  # with names of their own
        return [], [], []
    sheets = [quoted.replace("''", "'") or plain for quoted, plain in _SHEET.findall(text)]
    names = _NAME.findall(_BRACKETS.sub("[]", _SHEET.sub("!", text)))
    return sheets, _COLUMN.findall(text), [name for name in names if not _CELL.fullmatch(name)]


def _titles(book: bytes) -> Iterator[str]:
    for tag in re.findall(rb"<(?:\w+:)?sheet\s[^>]*>", book):
        match = re.search(rb"\sname\s*=\s*(?:\"([^\"]*)\"|'([^']*)')", tag)
        if match:
            yield unescaped((match[1] or match[2] or b"").decode())
