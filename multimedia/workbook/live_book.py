"""A new workbook whose formulas already show their values."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from openpyxl import Workbook
from openpyxl.styles import Font
from openpyxl.utils import get_column_letter
from openpyxl.workbook.defined_name import DefinedName
from openpyxl.worksheet.datavalidation import DataValidation
from openpyxl.worksheet.worksheet import Worksheet

from photocore.workbook.cells import CellValue
from photocore.workbook.look import HEAD_FILL, INPUT_EDGE, INPUT_FILL
from photocore.workbook.newbook import finish_book, new_workbook

FORMULA, TITLE, BOLD = Font(color="1F3FA8"), Font(bold=True, size=14), Font(bold=True)
SMALL, NOTE = Font(size=9), Font(italic=True, color="595959")


@dataclass(slots=True, eq=False)
class LiveBook:
    """A workbook under construction, with the values its formulas will show."""

    book: Workbook = field(default_factory=Workbook)
    results: dict[str, dict[str, CellValue]] = field(default_factory=dict)

    def sheet(self, name: str, title: str, note: str, *, first: bool = False) -> Worksheet:
        """Add a sheet with its title and one line of help, ready to print."""
        sheet: Worksheet = self.book.active if first else self.book.create_sheet()
        sheet.title, self.results[name] = name, {}
        sheet["A1"], sheet["A1"].font = title, TITLE
        sheet["A2"], sheet["A2"].font = note, NOTE
        sheet.sheet_view.showGridLines = False
        sheet.page_setup.paperSize = 9  # A4
        sheet.page_setup.orientation = "landscape"
        sheet.sheet_properties.pageSetUpPr.fitToPage = True
        sheet.page_setup.fitToHeight = 0
        sheet.oddFooter.left.text, sheet.oddFooter.right.text = "&F · &A", "&P / &N"
        return sheet

    def formula(self, sheet: Worksheet, row: int, column: int, text: str, value: CellValue) -> None:
        """Write a formula and the value it has."""
        cell = sheet.cell(row, column, f"={text}")
        cell.font = FORMULA
        if value is not None:
            self.results[sheet.title][cell.coordinate] = value

    def typed(self, sheet: Worksheet, row: int, column: int, value: CellValue) -> None:
        """Write a cell that the user fills in."""
        cell = sheet.cell(row, column)
        if value is not None and value == value:
            cell.value = value
            if isinstance(value, str):
                cell.data_type = "s"  # a name like =A1 is a name, not a formula
            elif isinstance(value, float):
                self.results[sheet.title][cell.coordinate] = value
        cell.fill, cell.border = INPUT_FILL, INPUT_EDGE

    def name(self, name: str, sheet: Worksheet, row: int, column: int) -> None:
        """Give a cell a name."""
        place = f"'{sheet.title}'!${get_column_letter(column)}${row}"
        self.book.defined_names[name] = DefinedName(name, attr_text=place)

    def save(self, path: Path, *, overwrite: bool) -> None:
        """Write the workbook, with the values put into its formula cells."""
        with new_workbook(path, overwrite=overwrite) as temporary:
            package = io.BytesIO()
            self.book.save(package)
            finish_book(package, temporary, results=self.results)


def headings(sheet: Worksheet, row: int, words: Sequence[str]) -> None:
    """Write a row of headings."""
    for column, word in enumerate(words, start=1):
        cell = sheet.cell(row, column, word)
        cell.font, cell.fill = BOLD, HEAD_FILL


def allow_between(sheet: Worksheet, cells: str, limits: tuple[float, float], prompt: str) -> None:
    """Refuse numbers outside the limits, with a prompt."""
    rule = DataValidation(
        type="decimal",
        operator="between",
        formula1=f"{limits[0]:g}",
        formula2=f"{limits[1]:.10g}",
        allow_blank=True,
        showErrorMessage=True,
        showInputMessage=True,
        promptTitle="multimedia",
        prompt=prompt,
    )
    rule.add(cells)
    sheet.add_data_validation(rule)
