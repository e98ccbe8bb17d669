"""Write a new survey workbook: every result a live formula that already shows its number."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from openpyxl.styles import Alignment
from openpyxl.worksheet.worksheet import Worksheet

from bifocal.survey.workbook.charts import charts
from bifocal.survey.workbook.columns import (
    IDEAL_POINTS,
    LOG,
    RESULTS,
    SurveyColumn,
    pair_points,
)
from bifocal.survey.workbook.content import (
    STRUCTURED_ROWS,
    SurveyContent,
    point_cells,
    result_cells,
    setup_cells,
)
from bifocal.survey.workbook.reference_sheets import check, georeference, planning
from bifocal.survey.workbook.setup_cells import (
    FORMS,
    IDEAL_FORMULAS,
    IDEAL_GROUPS,
    PAIR_FORMULAS,
    PAIR_GROUPS,
    POSITIVE,
)
from bifocal.survey.workbook.sheets import (
    HEAD_FONT,
    LABEL_FONT,
    BookBuilder,
    flag_colours,
    protect,
    set_up_print,
    validate,
)
from bifocal.survey.workbook.words import readme, term, word
from photocore.workbook.bookrows import CellValue, column_letters, finish_book
from photocore.workbook.newbook import new_workbook

Cells = Mapping[str, Sequence[CellValue]]
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
    sheet = builder.sheet("Readme", word("Readme", builder.language))
    sheet.column_dimensions["A"].width = 110
    for row, line in enumerate(readme(builder.language), start=3):
        heading = line.startswith("#")
        builder.text(sheet, f"A{row}", line.lstrip("#"), HEAD_FONT if heading else None)
    set_up_print(sheet, builder.language, landscape=False)


def _setup(builder: BookBuilder, content: SurveyContent) -> None:
    language = builder.language
    sheet = builder.sheet("Setup", word("Setup", language), word("type", language))
    for letter, key, width in (
        ("A", "name", 14),
        ("B", "description", 72),
        ("C", "value", 16),
        ("D", "unit", 10),
    ):
        builder.text(sheet, f"{letter}4", word(key, language), HEAD_FONT)
        sheet.column_dimensions[letter].width = width
    cells = setup_cells(content)
    groups = PAIR_GROUPS if content.is_pair else IDEAL_GROUPS
    row = 5
    for group in groups:
        for name in group:
            _setup_cell(builder, sheet, row, name, cells, content, typed=group is not groups[-1])
            row += 1
        row += 1
    sheet.freeze_panes = "A5"
    set_up_print(sheet, language, landscape=False)
    protect(sheet)


def _setup_cell(
    builder: BookBuilder,
    sheet: Worksheet,
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
    builder.text(sheet, f"A{row}", name)
    builder.text(sheet, f"B{row}", known.in_language(builder.language) if known else matrix)
    builder.text(sheet, f"D{row}", known.unit if known else "", LABEL_FONT)
    sheet[f"D{row}"].alignment = Alignment(indent=1)
    cell, form, value = f"C{row}", FORMS.get(name, "General"), cells.get(name)
    formulas = PAIR_FORMULAS if content.is_pair else IDEAL_FORMULAS
    is_default = {
        "d_1": content.pair is None,
        "sigma_s": content.setup is None or content.setup.sigma_s is None,
        "sigma_r_max": content.limits.sigma_r_max is None,
    }
    if not typed or (name in formulas and is_default.get(name, False)):
        builder.formula(sheet, cell, formulas[name], value, form=form, name=name, editable=typed)
        return
    builder.input(sheet, cell, value, form=form, name=name)
    if name == "input_unit":
        sheet[cell].alignment = Alignment(horizontal="right")
        validate(sheet, cell, choices="mm,px")
    elif name != "pair_file":
        validate(sheet, cell, above_zero=name in POSITIVE)


def _points(builder: BookBuilder, content: SurveyContent, cells: Cells) -> None:
    columns = pair_points(undistorted=content.undistorted) if content.is_pair else IDEAL_POINTS
    note = word("points_pair" if content.is_pair else "points_how", builder.language)
    sheet = _long_sheet(builder, "Points", note, columns, content.point_rows, cells)
    rows = f"{HEAD + 1}", f"{HEAD + content.point_rows}"
    letters = {column.key: column_letters(i) for i, column in enumerate(columns)}
    first, last = ("col1", "row2") if content.is_pair else ("x1", "s2")
    validate(sheet, f"{letters['use']}{rows[0]}:{letters['use']}{rows[1]}", choices="1,0")
    validate(sheet, f"{letters[first]}{rows[0]}:{letters[last]}{rows[1]}")
    if not content.is_pair:
        theta = letters["theta"]
        validate(sheet, f"{theta}{rows[0]}:{theta}{rows[1]}", between=(-360, 360))
    sheet.sheet_properties.outlinePr.summaryRight = True


def _results(builder: BookBuilder, content: SurveyContent, cells: Cells) -> None:
    note = word("results_how", builder.language)
    results = result_cells(content, cells)
    _long_sheet(builder, "Results", note, RESULTS, content.point_rows, results)


def _long_sheet(
    builder: BookBuilder,
    name: str,
    note: str,
    columns: Sequence[SurveyColumn],
    rows: int,
    cells: Cells,
) -> Worksheet:
    """Write a sheet that is one table with a row per point, its flags coloured."""
    sheet = builder.sheet(name, word(name, builder.language), note)
    builder.table(
        sheet,
        f"tbl{name}",
        columns,
        at=(HEAD, 1),
        rows=rows,
        cells=cells,
        repeat=True,
        short=rows > STRUCTURED_ROWS,
    )
    flag = column_letters([column.key for column in columns].index("flag"))
    flag_colours(sheet, flag, HEAD + 1, HEAD + rows)
    sheet.freeze_panes = f"B{HEAD + 1}"
    repeat = f"{HEAD - 1}:{HEAD}"
    set_up_print(sheet, builder.language, landscape=name == "Points", repeat=repeat)
    protect(sheet)
    return sheet


def _log(builder: BookBuilder, content: SurveyContent) -> None:
    sheet = builder.sheet("Log", word("Log", builder.language))
    keys = [column.key for column in LOG]
    cells = {key: [row[i] for row in content.log] for i, key in enumerate(keys)}
    builder.table(sheet, "tblLog", LOG, at=(HEAD, 1), rows=max(len(content.log), 1), cells=cells)
    set_up_print(sheet, builder.language, landscape=True)
