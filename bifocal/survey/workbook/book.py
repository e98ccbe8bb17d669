"""Write a new survey workbook: every result a live formula that already shows its number."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from openpyxl.styles import Alignment

from bifocal.survey.workbook.charts import charts
from bifocal.survey.workbook.columns import LOG, SurveyColumn, adjustment_names
from bifocal.survey.workbook.content import (
    STRUCTURED_ROWS,
    SurveyContent,
    point_cells,
    result_cells,
    setup_cells,
)
from bifocal.survey.workbook.georeference_sheet import georeference
from bifocal.survey.workbook.reference_sheets import check, planning
from bifocal.survey.workbook.results_columns import results_columns
from bifocal.survey.workbook.setup_cells import (
    FORMS,
    IDEAL_FORMULAS,
    IDEAL_GROUPS,
    PAIR_FORMULAS,
    PAIR_GROUPS,
    PHOTOS,
    POSITIVE,
)
from bifocal.survey.workbook.sheets import (
    FLAG_COLOURS,
    HEAD_FONT,
    LABEL_FONT,
    BookBuilder,
    Cells,
    SheetBuilder,
)
from bifocal.survey.workbook.words import readme, term, word
from photocore.workbook.cells import CellValue
from photocore.workbook.grid import column_letters
from photocore.workbook.look import colour_words
from photocore.workbook.newbook import finish_book, new_workbook

#: Row of the keys in `Points` and `Results`.
HEAD = 4


def write_book(path: Path | str, content: SurveyContent, *, overwrite: bool = False) -> None:
    """Write a survey workbook, whole or not at all.

    Parameters
    ----------
    path : path
        An ``.xlsx`` file.
    content : SurveyContent
        What it holds; an empty one makes the template.
    overwrite : bool
        Replace an existing file.
    """
    with new_workbook(path, overwrite=overwrite) as temporary:
        builder = build(content)
        package = io.BytesIO()
        builder.book.save(package)
        finish_book(package, temporary, blocks=builder.blocks, results=builder.results)


def build(content: SurveyContent) -> BookBuilder:
    """Return all sheets of the workbook, tables with one prototype row each."""
    builder = BookBuilder(language=content.language)
    builder.book.properties.creator = "bifocal"
    builder.book.properties.title = "bifocal survey"
    _readme(builder)
    _setup(builder, content)
    cells = point_cells(content)
    _points(builder, content, cells)
    _results(builder, content, cells)
    check(builder, content)
    georeference(builder, content)
    planning(builder, content)
    charts(builder, content, cells)
    _log(builder, content)
    builder.book.active = builder.book.sheetnames.index("Points" if content.points else "Readme")
    for sheet in builder.book.worksheets:
        sheet.sheet_view.tabSelected = sheet.title == builder.book.active.title
    builder.book.calculation.fullCalcOnLoad = True
    return builder


def _readme(builder: BookBuilder) -> None:
    sheet = builder.sheet("Readme")
    sheet.worksheet.column_dimensions["A"].width = 110
    for row, line in enumerate(readme(builder.language), start=3):
        heading = line.startswith("#")
        sheet.text(f"A{row}", line.lstrip("#"), HEAD_FONT if heading else None)
    sheet.finish(guarded=False)


def _setup(builder: BookBuilder, content: SurveyContent) -> None:
    sheet = builder.sheet("Setup", "type")
    for letter, key, width in (
        ("A", "name", 14),
        ("B", "description", 72),
        ("C", "value", 16),
        ("D", "unit", 10),
    ):
        sheet.word(f"{letter}4", key, HEAD_FONT)
        sheet.worksheet.column_dimensions[letter].width = width
    cells = setup_cells(content)
    groups = PAIR_GROUPS if content.is_pair else IDEAL_GROUPS
    row = 5
    for group in groups:
        for name in group:
            _setup_cell(sheet, row, name, cells, content, typed=group is not groups[-1])
            row += 1
        row += 1
    for image in (1, 2):
        names = [name for name in adjustment_names(image) if name in cells]
        for name in names:
            sheet.text(f"A{row}", name)
            sheet.text(f"B{row}", word("correction", builder.language).format(n=image))
            sheet.input(f"C{row}", cells[name], name=name)
            row += 1
    sheet.finish(freeze="A5")


def _setup_cell(
    sheet: SheetBuilder,
    row: int,
    name: str,
    cells: Mapping[str, CellValue],
    content: SurveyContent,
    *,
    typed: bool,
) -> None:
    """Write one named value with its description and unit."""
    known = term("setup", name)
    matrix = f"H{name[1]}({name[3:4]},{name[4:5]})"
    sheet.text(f"A{row}", name)
    sheet.text(f"B{row}", known.in_language(sheet.book.language) if known else matrix)
    sheet.text(f"D{row}", known.unit if known else "", LABEL_FONT)
    sheet.worksheet[f"D{row}"].alignment = Alignment(indent=1)
    cell, form, value = f"C{row}", FORMS.get(name, "General"), cells.get(name)
    if name in content.links:
        sheet.formula(cell, content.links[name], value, form=form, name=name, editable=True)
        return
    formulas = PAIR_FORMULAS if content.is_pair else IDEAL_FORMULAS
    is_default = {
        "d_1": content.pair is None,
        "sigma_s": content.setup is None or content.setup.sigma_s is None,
        "sigma_r_max": content.limits.sigma_r_max is None,
    }
    if not typed or (name in formulas and is_default.get(name, False)):
        sheet.formula(cell, formulas[name], value, form=form, name=name, editable=typed)
        return
    sheet.input(cell, value, form=form, name=name)
    if name == "input_unit":
        sheet.worksheet[cell].alignment = Alignment(horizontal="right")
        sheet.validate(cell, choices="mm,px")
    elif name not in ("pair_file", *PHOTOS):
        sheet.validate(cell, above_zero=name in POSITIVE)


def _points(builder: BookBuilder, content: SurveyContent, cells: Cells) -> None:
    columns = content.point_columns
    note = "points_pair" if content.is_pair else "points_how"
    sheet = _long_sheet(builder, "Points", note, columns, content.point_rows, cells)

    def area(first: str, last: str) -> str:
        keys = [column.key for column in columns]
        left, right = (column_letters(keys.index(key) + 1) for key in (first, last))
        return f"{left}{HEAD + 1}:{right}{HEAD + content.point_rows}"

    sheet.validate(area("use", "use"), choices="1,0")
    sheet.validate(area("col1", "row2") if content.is_pair else area("x1", "s2"))
    if not content.is_pair:
        sheet.validate(area("theta", "theta"), limit=360)
    sheet.worksheet.sheet_properties.outlinePr.summaryRight = True


def _results(builder: BookBuilder, content: SurveyContent, cells: Cells) -> None:
    columns = results_columns(is_pair=content.is_pair)
    results = result_cells(content, cells)
    _long_sheet(builder, "Results", "results_how", columns, content.point_rows, results)


def _long_sheet(
    builder: BookBuilder,
    name: str,
    note: str,
    columns: Sequence[SurveyColumn],
    rows: int,
    cells: Cells,
) -> SheetBuilder:
    """Write a sheet that is one table with a row per point, its flags coloured."""
    sheet = builder.sheet(name, note)
    short = rows > STRUCTURED_ROWS
    sheet.table(
        f"tbl{name}", columns, at=(HEAD, 1), rows=rows, cells=cells, repeat=True, short=short
    )
    flag = column_letters([column.key for column in columns].index("flag") + 1)
    bold = ("OFF-RADIAL", "NADIR", "CHECK")
    flags = f"{flag}{HEAD + 1}:{flag}{HEAD + rows}"
    colour_words(sheet.worksheet, flags, FLAG_COLOURS, bold=bold, stop=True)
    repeat = f"{HEAD - 1}:{HEAD}"
    sheet.finish(landscape=name == "Points", freeze=f"B{HEAD + 1}", repeat=repeat)
    return sheet


def _log(builder: BookBuilder, content: SurveyContent) -> None:
    sheet = builder.sheet("Log")
    keys = [column.key for column in LOG]
    cells = {key: [row[i] for row in content.log] for i, key in enumerate(keys)}
    sheet.table("tblLog", LOG, at=(HEAD, 1), rows=max(len(content.log), 1), cells=cells)
    sheet.finish(landscape=True, guarded=False)
