"""What a sheet is on paper, worked out from its XML values: scale, sizes, pages."""

from __future__ import annotations

import re

from openpyxl.utils import column_index_from_string, get_column_letter
from openpyxl.worksheet.worksheet import Worksheet

A4 = (595.3, 841.9)
#: What LibreOffice makes of one unit of width with Arial 10; Excel makes 5.25. [pt]
UNIT = 5.56


def printed_columns(sheet: Worksheet) -> list[int]:
    """Return the columns that are printed and not hidden."""
    area = re.search(r"\$?([A-Z]+)\$?\d+:\$?([A-Z]+)\$?\d+$", sheet.print_area or sheet.dimensions)
    first, last = (column_index_from_string(letters) for letters in area.groups())
    return [c for c in range(first, last + 1) if not dimension(sheet, c).hidden]


def dimension(sheet: Worksheet, column: int):
    """Return the width and visibility of a column, also of one that openpyxl grouped."""
    letter = get_column_letter(column)
    for key, known in sheet.column_dimensions.items():
        if key == letter or (known.min and known.min <= column <= known.max):
            return known
    return sheet.column_dimensions[letter]


def scale_of(sheet: Worksheet) -> float:
    """Return by how much a sheet is made smaller to print."""
    setup, margins = sheet.page_setup, sheet.page_margins
    if not sheet.sheet_properties.pageSetUpPr.fitToPage:
        return setup.scale / 100
    paper = A4[setup.orientation == "landscape"] - 72 * (margins.left + margins.right)
    width = sum(dimension(sheet, c).width * UNIT for c in printed_columns(sheet))
    return min(1.0, paper / width)


def sizes_of(sheet: Worksheet) -> set[float]:
    """Return the sizes of all texts that are printed, on paper. [pt]"""
    columns = set(printed_columns(sheet))
    fonts = {
        cell.font.sz
        for row in sheet.iter_rows()
        for cell in row
        if cell.value is not None and cell.column in columns
    }
    return {size * scale_of(sheet) for size in fonts}
