"""The sheet `Charts`: points on the wall, precision, errors; numbers beside, all live."""

from __future__ import annotations

import numpy as np
from openpyxl.chart import LineChart, Reference, ScatterChart, Series
from openpyxl.chart.layout import Layout, ManualLayout
from openpyxl.drawing.line import LineEndProperties
from openpyxl.styles import Font
from openpyxl.worksheet.pagebreak import Break

from bifocal.workbook.content import CHART_ROWS, SurveyContent
from bifocal.workbook.formulas.columns import FORMULAS
from bifocal.workbook.making.reference_sheets import CHECK_HEAD
from bifocal.workbook.words import word
from photocore.workbook import (
    COLOURS,
    FACE,
    LABEL,
    LABEL_FONT,
    BookBuilder,
    Cells,
    CellValue,
    RowBlock,
    SheetBuilder,
    bars,
    column_letters,
    scatter,
    titled,
)

#: Row of the headings of the chart data; text would break a scatter chart, so blanks are #N/A.
HEAD = 4
#: Column of the first chart data: far enough right to stay out of the charts' way.
LEFT = 16
KEYS = ("X", "Y", "s_c", "sigma_r")
#: Of the print: 57 rows, and the four charts' width, go on a page; labels stay above 8 pt. [%]
_SCALE = 90
#: Edges between which errors at check points are counted, in sigmas; the outer ones hold all.
_BINS = (-99, -3, -2, -1, 0, 1, 2, 3, 99)


def charts(builder: BookBuilder, content: SurveyContent) -> None:
    """Write the chart data and three charts."""
    language = builder.language
    rows = min(content.point_rows, CHART_ROWS)
    sheet = builder.sheet("Charts")
    note = word("chart_data", language).format(n=rows)
    sheet.text(f"{column_letters(LEFT + 1)}{HEAD - 2}", note, LABEL_FONT)
    columns: list[list[CellValue]] = [[] for _ in range(LEFT)]
    for i, key in enumerate(KEYS):
        letter = column_letters(LEFT + 1 + i)
        sheet.text(f"{letter}{HEAD}", key, LABEL_FONT)
        at = f"ROW()-{HEAD}"
        value = f"INDEX(tblPoints[{key}],{at})"
        sheet.formula(f"{letter}{HEAD + 1}", f"IF(ISNUMBER({value}),{value},NA())", form="0.000")
        sheet.worksheet[f"{letter}{HEAD + 1}"].font = Font(name=FACE, color="7F7F7F", size=LABEL)
        columns.append([float("nan")] * rows)
    builder.blocks["Charts"] = RowBlock(row=HEAD + 1, columns=columns)
    last = HEAD + rows
    data = [
        Reference(sheet.worksheet, min_col=LEFT + 1 + i, min_row=HEAD + 1, max_row=last)
        for i in range(len(KEYS))
    ]
    plan = scatter(word("chart_plan", language), "X [m]", "Y [m]", data[0], {"Y": data[1]})
    _equal_scales(plan, content)
    sheet.worksheet.add_chart(plan, "A3")
    title, series = word("chart_sigma", language), {"sigma_r": data[3]}
    sigma = scatter(title, "s' [mm]", "sigma_r [m]", data[2], series)
    sigma.height, sigma.width = 7, 16
    sigma.y_axis.number_format = "General"  # 0.00 would say the same of 1 mm and of 4 mm
    sheet.worksheet.add_chart(sigma, "A32")
    _errors(builder, content)
    _checked(sheet, content, last + 4)
    sheet.finish()
    sheet.worksheet.print_area = "A1:J115"
    # A page fitted to its width goes by no break: the third chart would be cut by the first page.
    sheet.worksheet.sheet_properties.pageSetUpPr.fitToPage = False
    sheet.worksheet.page_setup.scale = _SCALE
    sheet.worksheet.row_breaks.append(Break(id=57))


def _checked(sheet: SheetBuilder, content: SurveyContent, head: int) -> None:
    """Draw how large the errors at check points are, and which way they point.

    Parameters
    ----------
    sheet, content
        The sheet, and what the workbook holds.
    head : int
        Row of the keys of their numbers, below those of the other charts.
    """
    parts = sheet.book.word("chart_vectors").split("{n}")
    bins, vectors = FORMULAS.columns("bins"), FORMULAS.columns("vectors")
    counts = _bin_cells()
    (line,) = FORMULAS.columns("vectors", rows="lines")
    place = f"{column_letters(LEFT + 6)}{head - 2}"
    sheet.formula(place, line.formula, form=line.number_format, name=line.key)
    live = f'"{parts[0]}"&{line.key}&"{parts[1]}"'
    at = f"{column_letters(LEFT + 7)}{head - 2}"
    sheet.formula(at, live, name="chart_vectors", font=LABEL_FONT)
    rows = len(counts["sigmas_from"])
    sheet.table("tblBins", bins, at=(head, LEFT + 6), rows=rows, cells=counts)
    left, count = LEFT + 12, content.arrows
    numbered: Cells = {"check_row": list(range(1, count + 1))}
    sheet.table("tblVectors", vectors, at=(head, left), rows=count, cells=numbered)
    area = {"min_row": head + 1, "max_row": head + rows}
    names, numbers, normal = (
        Reference(sheet.worksheet, min_col=LEFT + offset, **area) for offset in (6, 9, 10)
    )
    title = sheet.book.word("chart_bins")
    counted = bars(title, numbers, names, series=bins[3].key, colour=COLOURS[0])
    counted.height, counted.width, counted.gapWidth = 5.5, 16, 20
    line_of = LineChart()
    line_of.series.append(Series(normal, title=bins[4].key))
    line_of.set_categories(names)
    line_of.series[0].graphicalProperties.line.solidFill = COLOURS[1]
    line_of.series[0].smooth = False
    counted += line_of
    sheet.worksheet.add_chart(counted, "A75")
    ends = {"min_row": head + 1, "max_row": head + count}
    x, y = (Reference(sheet.worksheet, min_col=left + i, **ends) for i in (1, 3))
    plan = scatter("", "X [m]", "Y [m]", x, {"Y": y})
    for row in range(head + 1, head + 1 + count):
        x, y = (
            Reference(sheet.worksheet, min_col=left + i, max_col=left + i + 1, min_row=row)
            for i in (1, 3)
        )
        arrow = Series(y, x, title_from_data=False)
        arrow.marker.symbol, arrow.smooth = "none", False
        arrow.graphicalProperties.line.solidFill = COLOURS[1]
        arrow.graphicalProperties.line.width = 15000
        arrow.graphicalProperties.line.tailEnd = LineEndProperties(type="triangle")
        plan.series.append(arrow)
    plan.title = sheet.book.linked_title("Charts", at)
    _equal_scales(plan, content)
    sheet.worksheet.add_chart(plan, "A88")


def _bin_cells() -> Cells:
    """Return the edges between which errors are counted."""
    return {
        "bin": [f"< {_BINS[1]}", *(f"{a} … {a + 1}" for a in _BINS[1:-2]), f"> {_BINS[-2]}"],
        "sigmas_from": list(_BINS[:-1]),
        "sigmas_to": list(_BINS[1:]),
    }


def _equal_scales(chart: ScatterChart, content: SurveyContent) -> None:
    """Give X and Y the same scale, so that the wall keeps its shape."""
    extents = []
    for key in ("X", "Y"):
        places = np.zeros(0) if content.table is None else content.table[key]
        places = places[np.isfinite(places)].tolist()
        extents.append((min(places), max(places)) if places else (-5.0, 5.0))
    span = max(high - low for low, high in extents) * 1.1 or 1.0
    for axis, (low, high) in zip((chart.x_axis, chart.y_axis), extents, strict=True):
        middle = (low + high) / 2
        step = _round_step(span / 8)
        axis.scaling.min = round((middle - span / 2) / step) * step
        axis.scaling.max = axis.scaling.min + (int(span / step) + 1) * step
        axis.majorUnit = step
    chart.height, chart.width = 12.5, 13.5
    # A square: left to themselves, spreadsheets stretch X, which has room where Y has a title.
    size = {"w": 9.7 / chart.width, "h": 9.7 / chart.height}
    inner = ManualLayout(layoutTarget="inner", xMode="edge", yMode="edge", x=0.18, y=0.1, **size)
    chart.layout = Layout(inner)


def _round_step(rough: float) -> float:
    """Return the least of 1, 2 or 5 times a power of ten that is not below rough."""
    steps = sorted(factor * 10.0**power for factor in (1, 2, 5) for power in range(-6, 7))
    return next((step for step in steps if step >= rough), steps[-1])


def _errors(builder: BookBuilder, content: SurveyContent) -> None:
    """Draw a bar for the relief error of each check point."""
    sheet, language = builder.book["Check"], builder.language
    area = {"min_row": CHECK_HEAD + 1, "max_row": CHECK_HEAD + content.check_rows}
    names, errors = (Reference(sheet, min_col=column, **area) for column in (1, 11))
    chart = bars(word("chart_error", language), errors, names, series="dZ", colour=COLOURS[1])
    chart.style = 10
    chart.x_axis.tickLblPos, chart.y_axis.title = "low", titled("dZ [m]", 1000)
    chart.y_axis.number_format = "General"
    chart.height, chart.width = 7, 16
    builder.book["Charts"].add_chart(chart, "A59")
