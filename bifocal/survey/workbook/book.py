"""Write a new survey workbook: every result a live formula that already shows its number."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

from openpyxl.styles import Alignment
from openpyxl.worksheet.worksheet import Worksheet

from bifocal.survey.workbook import charts as survey_charts
from bifocal.survey.workbook import reference_sheets as survey_reference_sheets
from bifocal.survey.workbook.columns import IDEAL_POINTS, LOG, RESULTS, pair_points
from bifocal.survey.workbook.content import (
    STRUCTURED_ROWS,
    SurveyContent,
    check_cells,
    control_cells,
    point_cells,
    result_cells,
    setup_cells,
)
from bifocal.survey.workbook.defaults import IDEAL_FORMULAS, PAIR_FORMULAS
from bifocal.survey.workbook.sheets import (
    HEAD_FONT,
    LABEL_FONT,
    BookBuilder,
    flag_colours,
    protect,
    set_up_print,
    validate,
)
from bifocal.survey.workbook.words import README, SETUP, word
from photocore.workbook.cells import CellValue
from photocore.workbook.grid import column_letters
from photocore.workbook.newbook import finish_book, new_workbook

#: Row of the keys in `Points` and `Results`.
HEAD = 4
_TYPED = "c_1 c_2 d_2 delta_d d_1 input_unit pitch nadir_1_col nadir_1_row nadir_2_col nadir_2_row"
_LIMITS = "sigma_s sigma_r_max k_off k_plane"
_DERIVED = "m_1 m_2 k_12 b_lever unit_x unit_y off_x1 off_y1 off_x2 off_y2"
_FORMS = {"d_1": "0.000", "d_2": "0.000", "delta_d": "0.000", "pitch": "0.000000"}
_FORMS |= {"m_1": "0.00", "m_2": "0.00", "k_12": "0.000000", "b_lever": "0.000"}
_FORMS |= {"sigma_s": "0.000000", "sigma_r_max": "0.0000"}


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
    survey_reference_sheets.check(builder, content, check_cells(content))
    survey_reference_sheets.georeference(builder, content, control_cells(content))
    survey_reference_sheets.planning(builder, content)
    survey_charts.charts(builder, content, cells)
    _log(builder, content)
    builder.book.active = builder.book.sheetnames.index("Points" if content.points else "Readme")
    for sheet in builder.book.worksheets:
        sheet.sheet_view.tabSelected = sheet.title == builder.book.active.title
    builder.book.calculation.fullCalcOnLoad = True
    return builder


def _readme(builder: BookBuilder) -> None:
    sheet = builder.sheet("Readme", word("Readme", builder.language))
    sheet.column_dimensions["A"].width = 110
    for row, line in enumerate(README[builder.language], start=3):
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
    if content.is_pair:
        groups = _pair_groups()
        formulas = PAIR_FORMULAS
    else:
        groups = [_TYPED.split(), _LIMITS.split(), _DERIVED.split()]
        formulas = IDEAL_FORMULAS
    derived = set(groups[-1])
    row = 5
    for group in groups:
        for name in group:
            typed = name not in derived
            _setup_cell(builder, sheet, row, name, cells, formulas, typed=typed, content=content)
            row += 1
        row += 1
    sheet.freeze_panes = "A5"
    set_up_print(sheet, language, landscape=False)
    protect(sheet)


def _pair_groups() -> list[list[str]]:
    nadirs = [f"n{image}_{axis}" for image in "12" for axis in "xy"]
    matrices = [[f"h{k}_{i}{j}" for i in "123" for j in "123"] for k in "12"]
    head = ["pair_file", "d_2", "delta_d", "d_1", *nadirs, "c_1", "c_2", "pitch", "input_unit"]
    limits = ["sigma_px", "sigma_r_max", "k_off", "k_plane", "pixel_mm"]
    return [head, limits, *matrices, ["m_1", "b_lever", "e_x", "e_y", "sigma_s"]]


def _setup_cell(
    builder: BookBuilder,
    sheet: Worksheet,
    row: int,
    name: str,
    cells: dict[str, CellValue],
    formulas: Mapping[str, str],
    *,
    typed: bool,
    content: SurveyContent,
) -> None:
    """Write one named value with its description and unit."""
    unit, *words = SETUP.get(
        name,
        ("", *(f"H{name[1]}({name[3]},{name[4]})",) * 3)
        if name.startswith("h")
        else ("mm", *_PIXEL_MM),
    )
    builder.text(sheet, f"A{row}", name)
    builder.text(sheet, f"B{row}", words[("en", "it", "de").index(builder.language)])
    builder.text(sheet, f"D{row}", unit, LABEL_FONT)
    sheet[f"D{row}"].alignment = Alignment(indent=1)
    cell, form, value = f"C{row}", _FORMS.get(name, "General"), cells.get(name)
    own = content.setup
    is_default = {
        "d_1": content.distances is None,
        "sigma_s": own is None or own.sigma_s is None,
        "sigma_r_max": content.sigma_r_max is None and (own is None or own.sigma_r_max is None),
    }
    if not typed or (name in formulas and is_default.get(name, False)):
        builder.formula(sheet, cell, formulas[name], value, form=form, name=name, editable=typed)
        return
    builder.input(sheet, cell, value, form=form, name=name)
    if name == "input_unit":
        sheet[cell].alignment = Alignment(horizontal="right")
        validate(sheet, cell, choices="mm,px")
    elif name in ("c_1", "c_2", "d_1", "d_2", "pitch", "sigma_s", "sigma_px", "sigma_r_max"):
        validate(sheet, cell, above_zero=True)
    elif name != "pair_file":
        validate(sheet, cell)


_PIXEL_MM = (
    "One pixel at image scale, typical",
    "Un pixel alla scala della foto, valore tipico",
    "Ein Pixel im Bildmaßstab, typisch",
)


def _points(
    builder: BookBuilder, content: SurveyContent, cells: dict[str, list[CellValue]]
) -> None:
    language, rows = builder.language, content.point_rows
    columns = pair_points(undistorted=content.undistorted) if content.is_pair else IDEAL_POINTS
    help_key = "points_pair" if content.is_pair else "points_how"
    sheet = builder.sheet("Points", word("Points", language), word(help_key, language))
    builder.table(
        sheet,
        "tblPoints",
        columns,
        at=(HEAD, 1),
        rows=rows,
        cells=cells,
        repeat=True,
        short=rows > STRUCTURED_ROWS,
    )
    first, last = HEAD + 1, HEAD + rows
    letters = {column.key: column_letters(i + 1) for i, column in enumerate(columns)}
    flag_colours(sheet, letters["flag"], first, last)
    validate(sheet, f"{letters['use']}{first}:{letters['use']}{last}", choices="1,0")
    measured = ("col1", "row2") if content.is_pair else ("x1", "s2")
    validate(sheet, f"{letters[measured[0]]}{first}:{letters[measured[1]]}{last}")
    if not content.is_pair:
        validate(sheet, f"{letters['theta']}{first}:{letters['theta']}{last}", between=(-360, 360))
    sheet.freeze_panes = f"B{first}"
    sheet.sheet_properties.outlinePr.summaryRight = True
    set_up_print(sheet, language, landscape=True, repeat=f"{HEAD - 1}:{HEAD}")
    protect(sheet)


def _results(
    builder: BookBuilder, content: SurveyContent, cells: dict[str, list[CellValue]]
) -> None:
    language, rows = builder.language, content.point_rows
    sheet = builder.sheet("Results", word("Results", language), word("results_how", language))
    builder.table(
        sheet,
        "tblResults",
        RESULTS,
        at=(HEAD, 1),
        rows=rows,
        cells=result_cells(content, cells),
        repeat=True,
        short=rows > STRUCTURED_ROWS,
    )
    flag_colours(sheet, "I", HEAD + 1, HEAD + rows)
    sheet.freeze_panes = f"B{HEAD + 1}"
    set_up_print(sheet, language, landscape=False, repeat=f"{HEAD - 1}:{HEAD}")
    protect(sheet)


def _log(builder: BookBuilder, content: SurveyContent) -> None:
    sheet = builder.sheet("Log", word("Log", builder.language))
    keys = [column.key for column in LOG]
    cells = {key: [row[i] for row in content.log] for i, key in enumerate(keys)}
    builder.table(sheet, "tblLog", LOG, at=(HEAD, 1), rows=max(len(content.log), 1), cells=cells)
    set_up_print(sheet, builder.language, landscape=True)
