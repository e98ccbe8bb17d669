"""Filling rows of one form: results and numbers take their places, all else stays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from photocore.errors import InputError
from photocore.workbook.changing.cells import CellValue, NewRows, number_text
from photocore.workbook.changing.changes import SheetChanges
from photocore.workbook.reading.grid import column_number
from photocore.workbook.reading.plainsheet import PlainRow, RowForm

#: Rows whose results are turned into text at once: a quarter of the time of one by one, and less
#: than a MB.
_AT_ONCE = 256

#: Types and texts of a row's results.
_Results = tuple[tuple[str, ...], tuple[bytes | None, ...]]


class FilledRow(NamedTuple):
    """What became of a row: its parts, None if nothing differs; whether a typed value does."""

    parts: Sequence[bytes] | None
    is_typed: bool


class _Places(NamedTuple):
    """Types that a block's results must have, their places among the parts; those of numbers."""

    kinds: tuple[str, ...]
    places: tuple[int, ...]
    typed: Mapping[int, int]


@dataclass(slots=True)
class FormFiller:
    """Fills the rows of a sheet to which nothing is added, where types stay as they are.

    Parameters
    ----------
    changes : SheetChanges
        What is to change in the sheet.
    """

    changes: SheetChanges
    _places: dict[tuple[RowForm, int], _Places | None] = field(default_factory=dict)
    _results: dict[int, tuple[int, list[_Results]]] = field(default_factory=dict)

    def filled(self, row: PlainRow) -> FilledRow | None:
        """Return what becomes of a row of a form; None if it must be taken apart by its cells."""
        block = self.changes.only_filled(row.number)
        if block is None or row.form is None:
            return None
        key = row.form, id(block)
        if key not in self._places:
            self._places[key] = _places_of(row.form, block)
        where = self._places[key]
        kinds, texts = self._row_results(block, row.number)
        if where is None or kinds != where.kinds or None in texts:
            return None
        parts = [*row.parts]
        for place, text in zip(where.places, texts, strict=True):
            parts[place] = text or b""
        typed = _type(parts, where.typed, self.changes.inputs.get(row.number, {}))
        if typed is None:
            return None
        return FilledRow(parts if parts != row.parts else None, typed)

    def _row_results(self, block: NewRows, row: int) -> _Results:
        """Return types and texts of a row's results."""
        first, rows = self._results.get(id(block), (0, []))
        if not first <= row < first + len(rows):
            first, last = row, min(row + _AT_ONCE, block.first + block.size)
            try:
                rows = block.results(first, last)
            except InputError:  # an infinite number, which may stay out
                rows = [((), ())] * (last - first)
            self._results[id(block)] = first, rows
        return rows[row - first]


def _places_of(form: RowForm, block: NewRows) -> _Places | None:
    """Return where a block's results go; None unless they are those of all formulas of a row."""
    formulas = {cell.letters: cell.kind or b"" for cell in form.cells if cell.has_formula}
    if formulas.keys() != block.by_letters.keys():
        return None
    places = {cell.letters: 2 * i + 1 for i, cell in enumerate(form.cells)}
    return _Places(
        tuple(formulas[letters].decode() for letters in block.by_letters),
        tuple(places[letters] for letters in block.by_letters),
        {
            column_number(cell.letters.decode()): places[cell.letters]
            for cell in form.cells
            if not cell.has_formula and cell.kind is None
        },
    )


def _type(
    parts: list[bytes], places: Mapping[int, int], typed: Mapping[int, CellValue]
) -> bool | None:
    """Type numbers over others that differ; return whether any does, None if that is not enough."""
    is_changed = False
    for column, number in typed.items():
        place = places.get(column)
        if place is None or type(number) is not float:
            return None
        if float(parts[place]) != number:
            parts[place] = number_text(number).encode()
            is_changed = True
    return is_changed
