"""Formulas of ours that somebody changed in a workbook: found, and followed by what is stored."""

from __future__ import annotations

import math
import re
import tempfile
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from zipfile import BadZipFile

from openpyxl import load_workbook

from photocore.workbook.calculating.calculation import Calculation
from photocore.workbook.calculating.values import Unknown
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.making.newbook import is_untouched
from photocore.workbook.reading.grid import CellFault, Value, cell_name, column_number
from photocore.workbook.reading.package import (
    Parts,
    open_package,
    read_part,
    rewrite_package,
)
from photocore.workbook.reading.xmltext import unescaped

#: Stored and calculated numbers that differ by less are alike: 1e-9 of what is above 1.
ALIKE = 1e-9
#: Formulas of a workbook that are calculated at most; one takes 0.2 ms.
MOST = 100_000
_CELL = re.compile(rb'r="([A-Z]+)(\d+)"[^>]*>\s*+<(?:\w+:)?f(?: [^>]*[^/>])?>([^<]+)<')
_RELATIVE = re.compile(r"(?<![\w$!'.:\[])([A-Z]{1,3})\d+(?![\w(\]])")

#: A column's number and its rows, first and last.
Column = tuple[int, int, int]


@lru_cache(maxsize=8192)  # a workbook holds ours and the user's, which are mostly the same
def normal(formula: str) -> str:
    """Return a formula as it reads in all rows, without blanks, quotes and case."""
    return re.sub(r"[\s$']", "", _RELATIVE.sub(r"\1#", formula)).casefold()


def changed_formulas(
    editor: WorkbookEditor, ours: Collection[str], places: Mapping[str, Collection[Column]]
) -> list[str]:
    """Return the cells of results that hold another formula than ours.

    Parameters
    ----------
    editor : WorkbookEditor
        The workbook as it is.
    ours : collection of str
        Our formulas, each as `normal` has it.
    places : mapping
        Sheet to the columns, or single cells, where results stand.
    """
    changed: list[str] = []
    if is_untouched(editor.path):
        return changed
    with open_package(editor.path) as package:
        for sheet in editor.book.sheets:
            columns = places.get(sheet.title, ())
            data = read_part(editor.path, package, sheet.part) if columns else b""
            cells = _CELL.findall(data)
            # Formulas that differ in the number of their row alone are looked at once.
            forms = [text.replace(row, b"#") for _, row, text in cells]
            texts = dict(zip(forms, (text for _, _, text in cells), strict=True))
            normals = {form: _normal(text) for form, text in texts.items()}
            found = {
                (int(row), column_number(letters.decode())): normals[form]
                for (letters, row, _), form in zip(cells, forms, strict=True)
                if normals[form] not in ours
            }
            changed += [f"{sheet.title}!{cell_name(*at)}" for at in _deviating(found, columns)]
    return changed


def _normal(text: bytes) -> str:
    return normal(unescaped(text.decode("utf-8", errors="replace")))


def _deviating(
    formulas: Mapping[tuple[int, int], str], columns: Collection[Column]
) -> list[tuple[int, int]]:
    """Return which cells with other formulas are among results.

    Another program writes all formulas in its own way: where most columns have one that is not
    ours, the one that most rows have counts as ours.
    """
    rows: dict[Column, list[tuple[int, int]]] = {}
    for column, first, last in columns:
        cells = [at for at in formulas if at[1] == column and first <= at[0] <= last]
        if cells:
            rows[column, first, last] = cells
    long = [one for one in columns if one[2] > one[1]]
    whole = [c for c, cells in rows.items() if c in long and len(cells) > (c[2] - c[1] + 1) / 2]
    if 2 * len(whole) > len(long):
        for place in whole:
            most = Counter(formulas[at] for at in rows[place]).most_common(1)[0][0]
            rows[place] = [at for at in rows[place] if formulas[at] != most]
    return [at for cells in rows.values() for at in cells]


@dataclass(slots=True)
class Settling:
    """Stores in a changed workbook what its own formulas give.

    Attributes
    ----------
    cells : list of str
        Cells whose stored result was another one.
    unknown : dict
        What of formulas is not known here, and the first cell that has it: such cells, and those
        that follow from them, keep what was stored.
    """

    cells: list[str] = field(default_factory=list)
    unknown: dict[str, str] = field(default_factory=dict)

    def __call__(self, path: Path, parts: Parts) -> Parts:
        """Return the parts of a workbook with the results that its formulas give."""
        with tempfile.TemporaryDirectory() as folder:
            result = Path(folder) / path.name
            rewrite_package(path, result, parts)
            editor = WorkbookEditor(result)
            try:
                book = Calculation(load_workbook(result))
            except (ValueError, TypeError, KeyError, AttributeError, IndexError, BadZipFile) as why:
                self.unknown[type(why).__name__] = result.name
                return parts
            formulas = book.formulas()[:MOST]
            for sheet, row, column in formulas:
                try:
                    value = book.value(sheet, row, column)
                except Unknown:
                    continue
                if not _alike(editor.value_at(sheet, row, column), value):
                    self.cells.append(f"{sheet}!{cell_name(row, column)}")
                    editor.set_result(sheet, row, column, value)
            self.unknown |= book.unknown
            return parts | editor.changed_parts()


def _alike(stored: Value | None, value: CellValue) -> bool:
    if isinstance(value, float) and math.isnan(value):
        return isinstance(stored, CellFault)
    if isinstance(stored, float) and isinstance(value, int | float):
        return abs(stored - value) <= ALIKE * max(1.0, abs(stored))
    return (stored or "") == (value or "")
