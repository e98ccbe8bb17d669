"""The sheet RefractiveIndex: the index of water as live formulas, and a chart over the light."""

from __future__ import annotations

from openpyxl.chart import Reference

from photocore.workbook import HEAD_FONT, BookBuilder, FormulaBook, SheetBuilder, scatter

FORMULAS = FormulaBook(__package__)
#: Name, value, unit and limits of the cells to fill in.
_GIVEN = (
    ("wavelength_nm", 550.0, "nm", (180, 1200)),
    ("temperature_c", 20.0, "°C", (-5, 100)),
    ("salinity_percent", 0.0, "%", (0, 30)),
    ("depth_m", 0.0, "m", (0, 11000)),
)
#: An index to find the salinity of.
_MEASURED = 1.3416
#: The light of the chart. [nm]
_LIGHT = range(400, 701, 25)
_CHART_HEAD = 21


def write_index_sheet(book: BookBuilder) -> None:
    """Write the sheet of the refractive index."""
    sheet = book.sheet("RefractiveIndex", "index_how")
    sheet.headings(4, ("name", "description", "value", "unit"), (18, 56, 14, 14))
    for row, (name, value, unit, limits) in enumerate(_GIVEN, start=5):
        sheet.describe(row, (name, book.word(name)), unit)
        sheet.input(f"C{row}", value, name=name)
        sheet.validate(f"C{row}", title=name, prompt=book.word(name), limits=limits)
    results = (("n_hoehle", ""), ("n_quan_fry", ""), ("dn_dT", "1/°C"), ("dn_dS", "1/%"))
    *lines, inverse = FORMULAS.columns("index")
    sheet.headings(10, ("result", "description", "value", "unit"))
    for row, (line, (words, unit)) in enumerate(zip(lines, results, strict=True), start=11):
        sheet.describe(row, (line.key, book.word(words)), unit)
        name = line.key if line.key == "n_w" else ""
        sheet.formula(f"C{row}", line.formula, form="0.000000", name=name)
    sheet.headings(16, ("inverse", "description", "value", "unit"))
    sheet.describe(17, ("n_measured", book.word("n_measured")))
    sheet.input("C17", _MEASURED, name="n_measured")
    prompt = book.word("n_measured")
    sheet.validate("C17", title="n_measured", prompt=prompt, limits=(1.2, 1.6))
    sheet.describe(18, ("salinity", book.word("salinity")), "%")
    sheet.formula("C18", inverse.formula, form="0.000")
    _over_light(sheet)
    sheet.finish(freeze="A5")


def _over_light(sheet: SheetBuilder) -> None:
    """Write the index by both formulas over the wavelength, and draw it."""
    sheet.word(f"A{_CHART_HEAD - 1}", "over_light", HEAD_FONT)
    for letter, key in zip("ACD", ("nm", "Höhle", "Quan, Fry"), strict=True):
        sheet.text(f"{letter}{_CHART_HEAD}", key, HEAD_FONT)
    for i, wavelength in enumerate(_LIGHT):
        row = _CHART_HEAD + 1 + i
        sheet.worksheet[f"A{row}"] = wavelength
        lines = FORMULAS.columns("index", parts={"light": f"$A{row}"}, rows="over_light")
        for line in lines:
            sheet.formula(f"{line.key}{row}", line.formula, form="0.000000")
    last = _CHART_HEAD + len(_LIGHT)
    data = [
        Reference(sheet.worksheet, min_col=column, min_row=_CHART_HEAD + 1, max_row=last)
        for column in (1, 3, 4)
    ]
    title = sheet.book.word("chart_index")
    chart = scatter(title, "nm", "n", data[0], {"Höhle": data[1], "Quan, Fry": data[2]})
    chart.x_axis.number_format, chart.y_axis.number_format = "0", "0.000"
    chart.x_axis.scaling.min, chart.x_axis.scaling.max = 400, 700
    chart.height, chart.width = 6.5, 10.5
    sheet.worksheet.add_chart(chart, f"B{_CHART_HEAD}")
