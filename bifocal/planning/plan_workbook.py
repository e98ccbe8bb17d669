"""A camera plan as a workbook: stations, sigma over the frame, and a chart to compare lenses."""

from __future__ import annotations

import io
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bifocal.media import media_words
from bifocal.remarks import in_language
from photocore.reports import Words, texts_of, words_of
from photocore.workbook import INPUT_EDGE, INPUT_FILL, finish_book, new_workbook, row_formula

if TYPE_CHECKING:
    from bifocal.planning.camera_plan import Plan

_WORDS = "bifocal.planning"
#: What the formulas of a sheet give, by cell.
Results = dict[str, float | int | str]
#: Cells of the first station.
_FIRST = {"pair": "$A$5", "width": "$I$5", "height": "$J$5", "sigma_1m": "$L$5"}


def write_plan(
    path: Path | str, plan: Plan, *, language: str = "en", overwrite: bool = False
) -> None:
    """Write a plan as .xlsx: stations, and sigma of r over the frame; live unless through media.

    Raises
    ------
    InputError
        If the file exists and ``overwrite`` is false, or cannot be written.
    """
    from openpyxl import Workbook

    book, package = Workbook(), io.BytesIO()
    say = words_of(_WORDS, language)
    first, second = say("tab"), say("tab_grid")
    results: dict[str, Results] = {first: {}, second: {}}
    _stations_sheet(book.active, plan, language, results[first])
    _grid_sheet(book.create_sheet(second), plan, say, results[second])
    if not plan.media:
        _inputs(book, plan, say)
    book.properties.creator = "bifocal"
    book.calculation.fullCalcOnLoad = True
    book.save(package)
    with new_workbook(path, overwrite=overwrite) as temporary:
        finish_book(package, temporary, results=results)


def _inputs(book: Any, plan: Plan, say: Words) -> None:
    """Fill the named cells below the table that the formulas speak of."""
    from openpyxl.workbook.defined_name import DefinedName

    sheet, sensor, first = book.worksheets[0], plan.sensor, 6 + len(plan.stations)
    values = (
        sensor.pitch, sensor.columns, sensor.rows, plan.sigma_px, plan.sigma_r_max * 1000,
        *(plan.object_size or (None, None)), plan.free_space,
    )  # fmt: skip
    cells = [(key, text["cell"]) for key, text in texts_of(_WORDS).items() if "cell" in text]
    for row, ((key, form), value) in enumerate(zip(cells, values, strict=True), first):
        sheet.cell(row, 1, say(key))
        cell = sheet.cell(row, 6, value)
        cell.number_format, cell.fill, cell.border = form, INPUT_FILL, INPUT_EDGE
        book.defined_names[key] = DefinedName(key, attr_text=f"{sheet.title}!$F${row}")


def _stations_sheet(sheet: Any, plan: Plan, language: str, results: Results) -> None:
    """Fill the table of stations and the bar chart of expected precision."""
    from openpyxl.chart import BarChart, Reference
    from openpyxl.styles import Alignment, Font, PatternFill
    from openpyxl.worksheet.table import Table, TableStyleInfo

    say, media = words_of(_WORDS, language), plan.media
    kind = "media" if media else "air"
    formats = {
        key: text["format"]
        for key, text in texts_of(_WORDS).items()
        if "format" in text and text.get("only", kind) == kind
    }
    sheet.title, sheet["A1"] = say("tab"), say("title")
    sheet["A1"].font = Font(bold=True, size=14)
    sheet["A2"] = say("change")
    if media:
        sheet["A2"] = say(
            "about", **asdict(plan.sensor), sigma=plan.sigma_px, limit=plan.sigma_r_max * 1000
        )
        place, away = ("port", media.port[0]) if media.port else ("depth", media.depth)
        sheet["A2"].value += say(place, media=media_words(media.layers), depth=away)
    for column, key in enumerate(formats, start=1):
        # Labels for people above, stable keys for formulas as the table's headings.
        sheet.cell(4, column, key).font = Font(color="808080", size=8)
        cell = sheet.cell(3, column, say(key))
        cell.alignment = Alignment(wrap_text=True, vertical="top")
        sheet.column_dimensions[cell.column_letter].width = 44 if key == "note" else 11
    sheet.row_dimensions[3].height = 60
    for row, station in enumerate(plan.stations, start=5):
        sheet.row_dimensions[row].height = 30 if station.note else 15
        values = (
            f"{station.c1:g}/{station.c2:g} mm", station.d1, station.d2,
            *(() if media else (station.c1, station.c2)), station.delta_d,
            *((station.z0_1, station.z0_2) if media else ()),
            station.scale_number, station.gsd * 1000, *station.footprint,
            f"{station.photos[0]} x {station.photos[1]}",
            *(() if media else (station.sigma_ortho * station.d1 * 1000,)),
            station.sigma_r_rms * 1000, station.sigma_r_corner * 1000,
            station.sigma_ortho * 1000, station.uncertain_radius, station.uncertain_share,
            say("yes" if station.feasible else "no"),
            in_language(station.note, language),
        )  # fmt: skip
        note = values[-1].replace('"', '""')
        for column, (value, (key, form)) in enumerate(zip(values, formats.items(), strict=True), 1):
            cell = sheet.cell(row, column, value)
            cell.number_format = form
            cell.alignment = Alignment(wrap_text=True, vertical="top")
            if station is plan.best:
                cell.fill = PatternFill("solid", fgColor="E2F0D9")
            text = texts_of(_WORDS)[key].get("live", "")
            if key == "note" and note:
                text = f'IF(AND([@d1]={station.d1!r},free_space={plan.free_space!r}),"{note}","")'
            if text and not media:
                text = text.replace("{yes}", say("yes")).replace("{no}", say("no"))
                cell.value, results[cell.coordinate] = row_formula("tblPlan", text), value
            elif not media and key in ("c1", "c2", "d1", "d2"):
                cell.fill, cell.border = INPUT_FILL, INPUT_EDGE
    last = 4 + len(plan.stations)
    table = Table(
        displayName="tblPlan", ref=f"A4:{sheet.cell(4, len(formats)).column_letter}{last}"
    )
    table.tableStyleInfo = TableStyleInfo(name="TableStyleLight1", showRowStripes=False)
    sheet.add_table(table)
    sheet.freeze_panes = "B5"
    chart = BarChart()
    chart.title = say("chart")
    first = list(formats).index("sigma_rms") + 1
    figures = Reference(sheet, min_col=first, max_col=first + 2, min_row=4, max_row=last)
    chart.add_data(figures, titles_from_data=True)
    chart.set_categories(Reference(sheet, min_col=1, min_row=5, max_row=last))
    chart.y_axis.title = "mm"
    chart.x_axis.delete = chart.y_axis.delete = False
    chart.width, chart.height = 22, 10
    sheet.add_chart(chart, f"A{last + (3 if media else 12)}")
    _fit_to_width(sheet)


def _grid_sheet(sheet: Any, plan: Plan, say: Words, results: Results) -> None:
    """Fill sigma of r over the frame of the best pair, coloured by size."""
    from openpyxl.formatting.rule import ColorScaleRule
    from openpyxl.styles import Font
    from openpyxl.utils import get_column_letter

    best = plan.best
    x, y, sigma = plan.sigma_grid(best, columns=15, rows=11)
    title = say("grid", c1=best.c1, c2=best.c2)
    parts = title.replace(f"{best.c1:g}/{best.c2:g} mm", '"&{pair}&"')
    station = {key: f"{say('tab')}!{cell}" for key, cell in _FIRST.items()}

    def fill(row: int, column: int, value: Any, form: str, formula: str) -> None:
        """Write a value, in air as the formula of the first station that gives it."""
        cell = sheet.cell(row, column, value)
        cell.number_format = form
        if not plan.media and value != "nadir":
            cell.value, results[cell.coordinate] = "=" + formula.format(**station), value

    fill(1, 1, title, "General", f'"{parts}"')
    sheet["A1"].font = Font(bold=True)
    for column, value in enumerate(x, start=2):
        fill(3, column, float(value), "0.00", f"{{width}}*({column - 2}/{len(x) - 1}-0.5)")
    for row, value in enumerate(y, start=4):
        fill(row, 1, float(value), "0.00", f"{{height}}*(0.5-{row - 4}/{len(y) - 1})")
        for column, item in enumerate(sigma[row - 4], start=2):
            # At the nadir itself relief is undefined: a word, not an empty cell.
            radius = f"SQRT({get_column_letter(column)}$3^2+$A{row}^2)"
            shown = "nadir" if item != item else float(item) * 1000
            fill(row, column, shown, "0", f'IFERROR({{sigma_1m}}/{radius},"")')
    area = f"B4:{sheet.cell(3 + len(y), 1 + len(x)).coordinate}"
    ends = {"start_type": "min", "start_color": "63BE7B", "end_type": "max", "end_color": "F8696B"}
    middle = {"mid_type": "percentile", "mid_value": 60, "mid_color": "FFEB84"}
    sheet.conditional_formatting.add(area, ColorScaleRule(**ends, **middle))
    _fit_to_width(sheet)


def _fit_to_width(sheet: Any) -> None:
    """Print a sheet across the page, as many pages high as it takes."""
    sheet.page_setup.orientation = "landscape"
    sheet.page_setup.fitToHeight = 0
    sheet.sheet_properties.pageSetUpPr.fitToPage = True
