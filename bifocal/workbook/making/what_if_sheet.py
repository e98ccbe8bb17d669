"""The sheet `WhatIf`: what changes of the set-up do to every relief, and what matters most."""

from __future__ import annotations

from openpyxl.chart import Reference
from openpyxl.styles import Alignment

from bifocal.workbook.content import CHART_ROWS, SurveyContent, printed_rows
from bifocal.workbook.formulas.columns import CHANGED, FORMULAS
from bifocal.workbook.formulas.setup_cells import number_format
from photocore.workbook import COLOURS, BookBuilder, SheetBuilder, bars, column_letters, scatter

#: Rows of the changes, of the charts, and of the keys of the table.
FIRST, CHARTS, HEAD = 5, 12, 30
#: What is drawn against each other.
_DRAWN = ("s_c", "change")
#: What is changed while nothing was typed: what a tape and a calibration are worth.
DEFAULTS = {"d_1": 0.01, "d_2": 0.01, "c_1": 0.05, "c_2": 0.05, "pitch": 0.0}


def what_if_sheet(builder: BookBuilder, content: SurveyContent) -> None:
    """Write cells for the changes, their effect on every point, and two charts of it."""
    sheet = builder.sheet("WhatIf", "what_if_how")
    changes = {**DEFAULTS, **(content.changes or {})}
    sheet.headings(FIRST - 1, ("name", "value", "change", "becomes", "max", "rms_change"))
    for letter in "CDEF":
        sheet.worksheet[f"{letter}{FIRST - 1}"].alignment = Alignment(horizontal="right")
    for row, name in enumerate(CHANGED, start=FIRST):
        _changed(sheet, row, name, changes[name])
        _effect(sheet, row, f"by_{name}")
    row = FIRST + len(CHANGED)
    sheet.word(f"A{row}", "all_changes")
    _effect(sheet, row, "change")
    columns = FORMULAS.columns("what_if")
    rows = min(content.point_rows, CHART_ROWS)
    sheet.table("tblWhatIf", columns, at=(HEAD, 1), rows=rows, cells={}, repeat=True)
    area = {"min_row": FIRST, "max_row": row}
    names, effects = (Reference(sheet.worksheet, min_col=column, **area) for column in (1, 6))
    title = builder.word("chart_sensitivity")
    worst = bars(title, effects, names, series="r [m]", colour=COLOURS[0])
    worst.type, worst.gapWidth = "bar", 40
    worst.x_axis.scaling.orientation = "maxMin"
    worst.y_axis.number_format = "General"
    keys, ends = [column.key for column in columns], {"min_row": HEAD + 1, "max_row": HEAD + rows}
    x, y = (
        Reference(sheet.worksheet, min_col=keys.index(f"plot_{key}") + 1, **ends) for key in _DRAWN
    )
    dots = scatter(builder.word("chart_changes"), "s' [mm]", "r [m]", x, {"change": y})
    dots.y_axis.number_format, dots.visible_cells_only = "General", False
    for chart, place in ((worst, f"A{CHARTS}"), (dots, f"G{CHARTS}")):
        chart.height, chart.width = 8, 12.5
        sheet.worksheet.add_chart(chart, place)
    sheet.finish(landscape=True, repeat=f"{HEAD - 1}:{HEAD}")
    printed = HEAD + min(printed_rows(content), CHART_ROWS)
    # The second chart reaches over the columns of the table.
    sheet.worksheet.print_area = f"A1:{column_letters(len(columns) + 2)}{printed}"


def _changed(sheet: SheetBuilder, row: int, name: str, change: float) -> None:
    """Write a value of the set-up, what is added to it, and what it becomes."""
    wording = sheet.book.words.term("setup", name)
    form, prompt = number_format(name), sheet.book.word("what_if_how")
    sheet.text(f"A{row}", f"{name} [{wording.unit if wording else ''}]")
    text = f'IF(COUNT({name})=1,{name},"")'
    sheet.formula(f"B{row}", text, form=form, name=f"now_{name}")
    sheet.input(f"C{row}", change, form="0.0000", name=f"change_{name}")
    sheet.validate(f"C{row}", title=name, prompt=prompt, limits=(-1e4, 1e4))
    text = f'IF(COUNT({name})=1,{name}+N(change_{name}),"")'
    sheet.formula(f"D{row}", text, form=form, name=f"new_{name}")


def _effect(sheet: SheetBuilder, row: int, key: str) -> None:
    """Write how far a change moves relief: the largest, and the root mean square."""
    column = f"tblWhatIf[{key}]"
    bodies = (f"MAX(MAX({column}),-MIN({column}))", f"SQRT(SUMSQ({column})/COUNT({column}))")
    for letter, body in zip("EF", bodies, strict=True):
        text = f'IF(COUNT({column})=0,"",{body})'
        name = f"effect_{'max' if letter == 'E' else 'rms'}_{key}"
        sheet.formula(f"{letter}{row}", text, form="0.0000", name=name)
