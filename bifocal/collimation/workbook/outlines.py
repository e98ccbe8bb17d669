"""Outlines drawn on the orthophoto as a table of the survey workbook: widths, heights, areas."""

from __future__ import annotations

import io
from collections.abc import Mapping

from openpyxl.utils import get_column_letter

from bifocal.collimation.wording import say
from photocore.workbook import (
    HEAD_FILL,
    HEAD_FONT,
    LABEL_FONT,
    CellValue,
    WorkbookEditor,
    add_table,
    finished_parts,
    name_cell,
    new_book,
)

#: Of an outline by its name: what it is called on drawings, and its measures. [m, m2]
Outlines = Mapping[str, Mapping[str, CellValue]]
TABLE = "tblOutlines"
#: Columns of the table, and their widths.
KEYS = {
    "id": 14, "layer": 18, "width": 12, "height": 12, "area": 12, "length": 12, "relief": 12,
}  # fmt: skip


def outline_cells(outlines: Outlines) -> dict[str, dict[str, CellValue]]:
    """Return the cells of the table's rows."""
    return {
        name: {"id": name_cell(name), **{key: one[key] for key in list(KEYS)[1:]}}
        for name, one in outlines.items()
    }


def add_outlines(editor: WorkbookEditor, outlines: Outlines, language: str) -> None:
    """Add the sheet of outlines to a workbook that has none."""
    book = new_book()
    sheet = book.active
    sheet.title = "Outlines"
    sheet.cell(1, 1, say("outline", "note", language)).font = LABEL_FONT
    for number, (key, width) in enumerate(KEYS.items(), start=1):
        sheet.cell(3, number, say("outline", key, language)).font = LABEL_FONT
        head = sheet.cell(4, number, key)
        head.font, head.fill = HEAD_FONT, HEAD_FILL
        sheet.column_dimensions[get_column_letter(number)].width = width
    for row, cells in enumerate(outline_cells(outlines).values(), start=5):
        for number, key in enumerate(KEYS, start=1):
            sheet.cell(row, number, cells[key]).number_format = "0.000"
    area = f"A4:{get_column_letter(len(KEYS))}{4 + len(outlines)}"
    add_table(sheet, TABLE, area, [(key, "") for key in KEYS])
    sheet.freeze_panes = "A5"
    package = io.BytesIO()
    book.save(package)
    title = editor.free_title(say("outline", "title", language))
    editor.add_sheets(finished_parts(package, results={}), {sheet.title: title})
