"""Formulas with nothing but A1 references, for programs that know no tables and no names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from photocore.workbook.changing.cells import CellValue, NewColumn
from photocore.workbook.changing.editor import WorkbookEditor
from photocore.workbook.reading.grid import TableArea, column_letters, quoted_title

#: By this name a workbook of such formulas is known.
MARK = "plain_formulas"
_COLUMN = r"(?P<table>\w+)\[(?:(?P<whole>\w+)|\[#(?P<part>This Row|Headers)\],\[(?P<key>\w+)\])\]"
_PLACE = re.compile(r"(?:'(?:[^']|'')+'|\w+)!\$[A-Z]+\$\d+(?::\$[A-Z]+\$\d+)?")


@dataclass
class PlainFormulas:
    """Writes formulas without names of tables and cells.

    Parameters
    ----------
    tables : sequence of TableArea
        Where the tables lie.
    names : mapping
        Where the names lead.
    """

    tables: Sequence[TableArea]
    names: Mapping[str, str]

    def __post_init__(self) -> None:
        self._areas = {area.name: (area, area.headings()) for area in self.tables}
        self._places = {n: text for n, text in self.names.items() if _PLACE.fullmatch(text)}
        words = "|".join(map(re.escape, self._places)) or r"(?!)"
        self._reference = re.compile(
            rf'"[^"]*"|{_COLUMN}|(?<![\w.!\'@])(?P<name>{words})(?![\w.(!])'
        )

    def plain(self, text: str, row: int | str) -> str:
        """Return a formula that stands in a row with A1 references only."""
        return self._reference.sub(lambda match: self._place(match, row), text)

    def _place(self, match: re.Match[str], row: int | str) -> str:
        if match["name"]:
            return self._places[match["name"]]
        area, headings = self._areas.get(match["table"] or "", (None, {}))
        number = headings.get(match["whole"] or match["key"] or "")
        if area is None or number is None:
            return match[0]
        letters = column_letters(number)
        if match["part"] == "This Row":
            return f"{letters}{row}"
        place = f"{quoted_title(area.sheet)}!${letters}$"
        if match["part"]:
            return f"{place}{area.area[0]}"
        return f"{place}{area.first}:${letters}${area.area[2]}"


class PlainEditor(WorkbookEditor):
    """A workbook of plain formulas to be changed in place: the new ones are plain too."""

    @cached_property
    def _formulas(self) -> PlainFormulas:
        return PlainFormulas(self.tables, self.book.names)

    def put(
        self, title: str, row: int, column: int, value: CellValue, *,
        formula: str = "", style: str = "",
    ) -> None:  # fmt: skip
        """Put a value or a formula, as `WorkbookEditor.put`."""
        formula = self._formulas.plain(formula, row)
        super().put(title, row, column, value, formula=formula, style=style)

    def fill_rows(self, title: str, first: int, columns: Sequence[NewColumn]) -> None:
        """Fill rows of columns, as `WorkbookEditor.fill_rows`."""
        super().fill_rows(title, first, list(map(self._plain, columns)))

    def _plain(self, column: NewColumn) -> NewColumn:
        formula, plain = column.formula, self._formulas.plain
        if formula is None:
            return column
        return column._replace(
            formula=lambda r: plain(formula if isinstance(formula, str) else formula(r), r)
        )
