"""The sheet `WhatIf`: what changes of the set-up do to every relief, and what matters most."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from openpyxl.chart import BarChart, Reference, Series
from openpyxl.chart.shapes import GraphicalProperties
from openpyxl.styles import Alignment

from bifocal.survey.what_if import CHANGED, what_if
from bifocal.workbook.content import CHART_ROWS, SurveyContent, inputs, setup_cells
from bifocal.workbook.formulas.columns import FORMULAS
from bifocal.workbook.formulas.setup_cells import number_format
from photocore.arrays import FloatArray
from photocore.workbook.changing.cells import CellValue, name_cell
from photocore.workbook.making.live_book import BookBuilder, SheetBuilder
from photocore.workbook.making.live_charts import COLOURS, scatter, titled

#: Rows of the changes, of the charts, and of the keys of the table.
FIRST, CHARTS, HEAD = 5, 12, 30
#: What is drawn against each other.
_DRAWN = ("s_c", "change")
#: What is changed while nothing was typed: what a tape and a calibration are worth.
DEFAULTS = {"d_1": 0.01, "d_2": 0.01, "c_1": 0.05, "c_2": 0.05, "pitch": 0.0}


def what_if_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return every column of the table of points under changes, by key."""
    if content.table is None or content.setup is None:
        return {}
    changes = {**DEFAULTS, **(content.changes or {})}
    found = what_if(content.setup.taking, content.table, changes)
    found["s_c"] = content.table["s_c"]
    cells = {key: inputs(column[:CHART_ROWS]) for key, column in found.items()}
    drawn = ~np.isnan(found["change"])
    for key in _DRAWN:
        cells[f"plot_{key}"] = np.where(drawn, found[key], np.nan)[:CHART_ROWS].tolist()
    return {"id": [name_cell(name) for name in content.table.ids[:CHART_ROWS]], **cells}


def what_if_sheet(builder: BookBuilder, content: SurveyContent) -> None:
    """Write cells for the changes, their effect on every point, and two charts of it."""
    sheet, cells = builder.sheet("WhatIf", "what_if_how"), what_if_cells(content)
    changes = {**DEFAULTS, **(content.changes or {})}
    sheet.headings(FIRST - 1, ("name", "value", "change", "becomes", "max", "rms_change"))
    for letter in "CDEF":
        sheet.worksheet[f"{letter}{FIRST - 1}"].alignment = Alignment(horizontal="right")
    for row, name in enumerate(CHANGED, start=FIRST):
        _changed(sheet, row, name, setup_cells(content).get(name), changes[name])
        _effect(sheet, row, f"by_{name}", cells)
    row = FIRST + len(CHANGED)
    sheet.word(f"A{row}", "all_changes")
    _effect(sheet, row, "change", cells)
    columns = FORMULAS.columns("what_if")
    rows = min(content.point_rows, CHART_ROWS)
    sheet.table("tblWhatIf", columns, at=(HEAD, 1), rows=rows, cells=cells, repeat=True)
    area = {"min_row": FIRST, "max_row": row}
    bars, names = BarChart(), Reference(sheet.worksheet, min_col=1, **area)
    bars.series.append(Series(Reference(sheet.worksheet, min_col=6, **area), title="r [m]"))
    bars.series[0].graphicalProperties = GraphicalProperties(solidFill=COLOURS[0])
    bars.set_categories(names)
    bars.type, bars.legend, bars.gapWidth = "bar", None, 40
    bars.title = titled(builder.word("chart_sensitivity"))
    bars.x_axis.delete = bars.y_axis.delete = False
    bars.x_axis.scaling.orientation = "maxMin"
    bars.y_axis.number_format = "General"
    keys, ends = [column.key for column in columns], {"min_row": HEAD + 1, "max_row": HEAD + rows}
    x, y = (
        Reference(sheet.worksheet, min_col=keys.index(f"plot_{key}") + 1, **ends) for key in _DRAWN
    )
    dots = scatter(builder.word("chart_changes"), "s' [mm]", "r [m]", x, {"change": y})
    dots.y_axis.number_format, dots.visible_cells_only = "General", False
    for chart, place in ((bars, f"A{CHARTS}"), (dots, f"G{CHARTS}")):
        chart.height, chart.width = 8, 12.5
        sheet.worksheet.add_chart(chart, place)
    sheet.finish(landscape=True, repeat=f"{HEAD - 1}:{HEAD}")


def _changed(sheet: SheetBuilder, row: int, name: str, value: CellValue, change: float) -> None:
    """Write a value of the set-up, what is added to it, and what it becomes."""
    known = sheet.book.words.term("setup", name)
    form, prompt = number_format(name), sheet.book.word("what_if_how")
    sheet.text(f"A{row}", f"{name} [{known.unit if known else ''}]")
    text = f'IF(COUNT({name})=1,{name},"")'
    sheet.formula(f"B{row}", text, value, form=form, name=f"now_{name}")
    sheet.input(f"C{row}", change, form="0.0000", name=f"change_{name}")
    sheet.validate(f"C{row}", title=name, prompt=prompt, limits=(-1e4, 1e4))
    new = value + change if isinstance(value, int | float) else None
    text = f'IF(COUNT({name})=1,{name}+N(change_{name}),"")'
    sheet.formula(f"D{row}", text, new, form=form, name=f"new_{name}")


def _effect(sheet: SheetBuilder, row: int, key: str, cells: Mapping[str, list[CellValue]]) -> None:
    """Write how far a change moves relief: the largest, and the root mean square."""
    known: FloatArray = np.array([v for v in cells.get(key, ()) if v is not None], float)
    column = f"tblWhatIf[{key}]"
    shown = (np.abs(known).max(), np.sqrt(np.mean(known**2))) if len(known) else (None, None)
    bodies = (f"MAX(MAX({column}),-MIN({column}))", f"SQRT(SUMSQ({column})/COUNT({column}))")
    for letter, body, value in zip("EF", bodies, shown, strict=True):
        text = f'IF(COUNT({column})=0,"",{body})'
        name = f"effect_{'max' if letter == 'E' else 'rms'}_{key}"
        value = None if value is None else float(value)
        sheet.formula(f"{letter}{row}", text, value, form="0.0000", name=name)
