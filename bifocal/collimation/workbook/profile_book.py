"""A profile of the relief as a table and as a workbook: its places, their relief, a chart."""

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
from photocore.workbook import COLOURS, plain_cell, save_book, scatter

#: Heading of each column.
HEADINGS = ("distance [m]", "X [m]", "Y [m]", "r [m]", "sigma_r [m]")
#: Width of the profile's line, 1 pt. [EMU]
_LINE = 12_700


def profile_rows(
    profile: Mapping[str, Sequence[float | None]], start: FloatArray, end: FloatArray
) -> list[tuple[float | None, ...]]:
    """Return the rows below `HEADINGS`; as `profile_book`. [m]"""
    distances = np.array(profile["distance"], dtype=float)
    places = start + distances[:, None] / (distances[-1] or 1.0) * (end - start)
    columns = (distances.tolist(), *places.T.tolist(), profile["r"], profile["sigma"])
    return list(zip(*columns, strict=True))


def profile_csv(
    profile: Mapping[str, Sequence[float | None]], start: FloatArray, end: FloatArray, _: str
) -> bytes:
    """Return the same as a table; as `profile_book`."""
    lines = (
        ",".join("" if value is None else f"{value:.4f}" for value in row)
        for row in profile_rows(profile, start, end)
    )
    return "\r\n".join((",".join(HEADINGS), *lines, "")).encode()


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
    rows = profile_rows(profile, start, end)
    for row in rows:
        sheet.append([plain_cell(sheet, value) for value in row])
    for cells in sheet.iter_cols():
        sheet.column_dimensions[cells[0].column_letter].width = 14
        for cell in cells[1:]:
            cell.number_format = "0.0000"
    sheet.freeze_panes, last = "A2", len(rows) + 1
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
