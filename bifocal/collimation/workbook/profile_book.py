"""A profile of the relief as a workbook: its places, their relief, and a chart of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from openpyxl import Workbook
from openpyxl.chart import Reference
from openpyxl.drawing.line import LineProperties
from openpyxl.worksheet.properties import PageSetupProperties

from photocore.arrays import FloatArray
from photocore.workbook.making.live_charts import COLOURS, scatter
from photocore.workbook.making.newbook import plain_cell, save_book

#: Heading of each column.
HEADINGS = ("distance [m]", "X [m]", "Y [m]", "r [m]", "sigma_r [m]")
#: Width of the profile's line, 1 pt. [EMU]
_LINE = 12_700


def profile_book(
    profile: Mapping[str, Sequence[float | None]], start: FloatArray, end: FloatArray, title: str
) -> bytes:
    """Return the workbook of a profile; unknown relief is blank.

    Parameters
    ----------
    profile : mapping
        ``distance``, ``r`` and ``sigma`` along the line. [m]
    start, end : ndarray, shape (2,)
        Its ends on the wall. [m]
    title : str
        Of the chart.
    """
    book = Workbook()
    sheet = book.active
    sheet.title = "Profile"
    sheet.append(HEADINGS)
    distances = np.array(profile["distance"], dtype=float)
    places = start + distances[:, None] / (distances[-1] or 1.0) * (end - start)
    rows = zip(distances.tolist(), *places.T.tolist(), profile["r"], profile["sigma"], strict=True)
    for row in rows:
        sheet.append([plain_cell(sheet, value) for value in row])
    for cells in sheet.iter_cols():
        sheet.column_dimensions[cells[0].column_letter].width = 14
        for cell in cells[1:]:
            cell.number_format = "0.0000"
    sheet.freeze_panes, last = "A2", len(distances) + 1
    x, r = (Reference(sheet, min_col=column, min_row=2, max_row=last) for column in (1, 4))
    chart = scatter(title, HEADINGS[0], HEADINGS[3], x, {HEADINGS[3]: r})
    line = chart.series[0]
    line.marker.symbol, line.smooth = "none", False
    line.graphicalProperties.line = LineProperties(solidFill=COLOURS[0], w=_LINE)
    chart.width, chart.height = 24, 10
    sheet.add_chart(chart, "G2")
    sheet.page_setup.orientation, sheet.page_setup.paperSize = "landscape", sheet.PAPERSIZE_A4
    sheet.sheet_properties.pageSetUpPr = PageSetupProperties(fitToPage=True)
    sheet.page_setup.fitToHeight, sheet.print_title_rows = 0, "1:1"
    with TemporaryDirectory() as folder:
        save_book(book, path := Path(folder, "profile.xlsx"))
        return path.read_bytes()
