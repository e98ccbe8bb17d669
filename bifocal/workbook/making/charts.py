"""The sheet `Charts`: points on the wall, precision, errors; numbers beside, all live."""

from __future__ import annotations

from openpyxl.chart import BarChart, Reference, ScatterChart, Series
from openpyxl.chart.layout import Layout, ManualLayout
from openpyxl.chart.shapes import GraphicalProperties
from openpyxl.styles import Font

from bifocal.workbook.content import CHART_ROWS, SurveyContent
from bifocal.workbook.making.reference_sheets import CHECK_HEAD
from bifocal.workbook.words import word
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.making.live_book import BookBuilder, Cells
from photocore.workbook.making.live_charts import COLOURS, scatter, titled
from photocore.workbook.making.look import FACE, LABEL, LABEL_FONT
from photocore.workbook.making.newbook import RowBlock
from photocore.workbook.reading.grid import column_letters

#: Row of the headings of the chart data; text would break a scatter chart, so blanks are #N/A.
HEAD = 4
#: Column of the first chart data: far enough right to stay out of the charts' way.
LEFT = 16
KEYS = ("X", "Y", "s_c", "sigma_r")


def charts(builder: BookBuilder, content: SurveyContent, cells: Cells) -> None:
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
        sheet.formula(
            f"{letter}{HEAD + 1}", f"IF(ISNUMBER({value}),{value},NA())", None, form="0.000"
        )
        sheet.worksheet[f"{letter}{HEAD + 1}"].font = Font(name=FACE, color="7F7F7F", size=LABEL)
        listed: list[CellValue] = [
            value if isinstance(value, int | float) else float("nan")
            for value in cells.get(key, [])[:rows]
        ]
        columns.append(listed + [float("nan")] * (rows - len(listed)))
    builder.blocks["Charts"] = RowBlock(row=HEAD + 1, columns=columns)
    last = HEAD + rows
    data = [
        Reference(sheet.worksheet, min_col=LEFT + 1 + i, min_row=HEAD + 1, max_row=last)
        for i in range(len(KEYS))
    ]
    plan = scatter(word("chart_plan", language), "X [m]", "Y [m]", data[0], {"Y": data[1]})
    _equal_scales(plan, cells)
    sheet.worksheet.add_chart(plan, "A3")
    title, series = word("chart_sigma", language), {"sigma_r": data[3]}
    sigma = scatter(title, "s' [mm]", "sigma_r [m]", data[2], series)
    sigma.height, sigma.width = 7, 16
    sigma.y_axis.number_format = "General"  # 0.00 would say the same of 1 mm and of 4 mm
    sheet.worksheet.add_chart(sigma, "A32")
    _errors(builder, content)
    sheet.finish()
    sheet.worksheet.print_area = "A1:J65"
    sheet.worksheet.page_setup.fitToHeight = 1


def _equal_scales(chart: ScatterChart, cells: Cells) -> None:
    """Give X and Y the same scale, so that the wall keeps its shape."""
    extents = []
    for key in ("X", "Y"):
        listed = [v for v in cells.get(key, []) if isinstance(v, int | float) and v == v]
        extents.append((min(listed), max(listed)) if listed else (-5.0, 5.0))
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
    chart = BarChart()
    chart.type, chart.style, chart.legend = "col", 10, None
    chart.title = titled(word("chart_error", language))
    rows = max(len(content.known), 8)
    errors = Reference(sheet, min_col=11, min_row=CHECK_HEAD + 1, max_row=CHECK_HEAD + rows)
    names = Reference(sheet, min_col=1, min_row=CHECK_HEAD + 1, max_row=CHECK_HEAD + rows)
    series = Series(errors, title="dZ")
    series.graphicalProperties = GraphicalProperties(solidFill=COLOURS[1])
    chart.series.append(series)
    chart.set_categories(names)
    chart.x_axis.delete = chart.y_axis.delete = False
    chart.x_axis.tickLblPos, chart.y_axis.title = "low", titled("dZ [m]", 1000)
    chart.y_axis.number_format = "General"
    chart.height, chart.width = 7, 16
    builder.book["Charts"].add_chart(chart, "A49")
