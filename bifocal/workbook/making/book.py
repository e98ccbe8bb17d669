"""Write a new survey workbook: every result a live formula that already shows its number."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from openpyxl.styles import Alignment, Protection

from bifocal.survey import CHANCE
from bifocal.workbook.content import STRUCTURED_ROWS, SurveyContent, point_cells, printed_rows
from bifocal.workbook.formulas.columns import FORMULAS, planning_facts, results_columns
from bifocal.workbook.formulas.world_state import SITE, STATE, sentence
from bifocal.workbook.making.agreement import refuse_contradictions
from bifocal.workbook.making.charts import charts
from bifocal.workbook.making.compare_sheet import compare
from bifocal.workbook.making.functions_sheet import functions_sheet
from bifocal.workbook.making.georeference_sheet import georeference
from bifocal.workbook.making.readme_sheet import readme_sheet
from bifocal.workbook.making.reference_sheets import check, planning
from bifocal.workbook.making.setup_sheet import setup_sheet
from bifocal.workbook.making.what_if_sheet import what_if_sheet
from bifocal.workbook.words import WORDS, word
from photocore.workbook import (
    BODY_FONT,
    DOUBT,
    GOOD,
    HEAD_FONT,
    NOTE_FONT,
    WARN_FONT,
    WRONG,
    BookBuilder,
    Cells,
    LiveColumn,
    SheetBuilder,
    colour_where,
    colour_words,
    column_letters,
    name_columns,
    strike_out,
)

#: Row of the keys in `Points` and `Results`.
HEAD = 4
#: Fill and text of each flag; the word itself always stands in the cell too.
FLAG_COLOURS = {
    "OK": GOOD,
    "ON-PLANE": ("DDEBF7", "1F4E79"),
    "WEAK": ("FFF2CC", "7F6000"),
    "UNCERTAIN": ("FCE4D6", "9C3D00"),
    "NADIR": ("EDEDED", "3B3B3B"),
    "OFF-RADIAL": WRONG,
    "CHECK": DOUBT,
}
#: Name of the warning that points stand below the rows that are printed, or below the table.
UNPRINTED = "unprinted_Points"
#: Scale of the sheet `Points` on paper: labels stay above 8 pt. [%]
_SCALE = 92
#: Name of the column `use` of `Points`, for rules of other sheets, which may not name a table.
USED = "points_use"
#: Name of all cells below the heading of the names of `Points`, in the table or not.
TYPED = "points_names"
#: The last row of a sheet in Excel.
_LAST_ROW = 1048576


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
    build(content).save(path, overwrite=overwrite)


def build(content: SurveyContent) -> BookBuilder:
    """Return all sheets of the workbook, tables with one prototype row each."""
    builder = BookBuilder(language=content.language, words=WORDS)
    builder.book.properties.creator = "bifocal"
    builder.book.properties.title = "bifocal survey"
    readme_sheet(builder, content)
    setup_sheet(builder, content)
    _points(builder, content)
    _results(builder, content)
    check(builder, content)
    if content.others:
        compare(builder, content)
    georeference(builder, content)
    planning(builder, content)
    if content.changes is not None:
        what_if_sheet(builder, content)
    charts(builder, content)
    _log(builder, content)
    if content.functions:
        functions_sheet(builder, named=not content.plain)
    if content.point_rows > STRUCTURED_ROWS and not content.plain:
        name_columns(builder.book, builder.blocks)
    builder.calculate()
    if content.table is not None:
        refuse_contradictions(builder, content)
    if content.plain:
        builder.make_plain("'Setup'!$A$1")
    builder.open_at("Points" if content.points else "Readme")
    return builder


def _points(builder: BookBuilder, content: SurveyContent) -> None:
    """Write what was measured and, beside it, all results as formulas."""
    columns = content.point_columns()
    note = "points_pair" if content.is_pair else "points_lens" if content.has_lens else "points_how"
    sheet = _long_sheet(builder, "Points", note, columns, content, point_cells(content))
    keys = [column.key for column in columns]
    breaks = [keys.index("note") + 2, keys.index("x_c") + 1]
    if content.others:
        breaks.append(keys.index("pair") + 1)
    facts = planning_facts(media=content.media_cells, is_pair=content.is_pair)
    facts |= {"long"} if content.point_rows > STRUCTURED_ROWS else set()
    state = sentence("points_state", builder.word, facts, note=note)
    sheet.formula("A2", state, name="points_state", font=NOTE_FONT)
    colour_where(sheet.worksheet, "A2:H2", f'$A$2<>"{builder.word(note)}"', WRONG)
    sheet.worksheet.sheet_properties.outlinePr.summaryRight = True
    # Each page begins with the names: the title would be cut off there, so it heads the page.
    sheet.worksheet.oddHeader.left.text = builder.word("Points")
    sheet.finish(
        landscape=True,
        freeze=f"B{HEAD + 1}",
        repeat=f"{HEAD - 1}:{HEAD}",
        scale=_SCALE,
        breaks=(len(columns), breaks),
    )


def _results(builder: BookBuilder, content: SurveyContent) -> None:
    """Write what a client is handed: names, coordinates, precision, below a title block."""
    columns = results_columns(is_pair=content.is_pair)
    sheet = _long_sheet(builder, "Results", "", columns, content, {})
    _title_block(sheet)
    sheet.finish(landscape=True, freeze=f"B{HEAD + 1}", repeat=f"{HEAD - 1}:{HEAD}")


def _long_sheet(
    builder: BookBuilder,
    name: str,
    note: str,
    columns: Sequence[LiveColumn],
    content: SurveyContent,
    cells: Cells,
) -> SheetBuilder:
    """Write a sheet that is one table with a row per point, its flags coloured."""
    sheet, rows = builder.sheet(name, note), content.point_rows
    short = rows > STRUCTURED_ROWS and not content.plain
    sheet.table(
        f"tbl{name}", columns, at=(HEAD, 1), rows=rows, cells=cells, repeat=True, short=short
    )
    keys = [column.key for column in columns]
    flag, last = column_letters(keys.index("flag") + 1), HEAD + rows
    if "use" in keys:
        used = column_letters(keys.index("use") + 1)
        builder.define(TYPED, f"'{name}'!$A${HEAD + 1}:$A${_LAST_ROW}")
        _unlock_below(sheet, columns)
        builder.define(USED, f"'{name}'!${used}${HEAD + 1}:${used}${last}")
        unused = f"AND(ISNUMBER(${used}{HEAD + 1}),${used}{HEAD + 1}=0)"
    else:
        at = f"INDEX({USED},ROW()-{HEAD})"
        unused = f"AND(ISNUMBER({at}),{at}=0)"
    # A point that is not used is no good point, whatever its flag.
    whole = f"A{HEAD + 1}:{column_letters(len(columns))}{last}"
    strike_out(sheet.worksheet, whole, unused)
    bold = ("OFF-RADIAL", "NADIR", "CHECK")
    flags = f"{flag}{HEAD + 1}:{flag}{last}"
    colour_words(sheet.worksheet, flags, FLAG_COLOURS, bold=bold, stop=True)
    if "chance" in keys:
        chance = column_letters(keys.index("chance") + 1)
        rows_of = f"{chance}{HEAD + 1}:{chance}{last}"
        colour_where(
            sheet.worksheet,
            rows_of,
            f"N({chance}{HEAD + 1})<{CHANCE:.9g}*COUNT({chance}{HEAD + 1})",
            WRONG,
        )
    _printed(sheet, print_area(name, len(columns), printed_rows(content)), content)
    return sheet


def _unlock_below(sheet: SheetBuilder, columns: Sequence[LiveColumn]) -> None:
    """Let points be typed below the table of a protected sheet, names staying as they are typed."""
    for number, column in enumerate(columns, start=1):
        if column.kind == "input":
            whole = sheet.worksheet.column_dimensions[column_letters(number)]
            whole.protection, whole.number_format = Protection(locked=False), column.number_format


def print_area(sheet: str, columns: int, rows: int) -> str:
    """Return the cells of `Points` or `Results` that are printed."""
    return f"A{1 if sheet == 'Results' else HEAD - 1}:{column_letters(columns)}{HEAD + rows}"


def unprinted_formula(language: str, rows: int) -> str:
    """Return the formula of the warning that points stand below the printed rows, or the table."""
    below = f"(COUNTA({TYPED})-COUNTA(tblPoints[id]))"
    waiting = f'IF({below}>0," "&{below}&" {word("waiting", language)}","")'
    unprinted = f'IF(COUNTA(tblPoints[id])>{rows},"{word("unprinted", language)}","")'
    return f"{unprinted}&{waiting}"


def _printed(sheet: SheetBuilder, area: str, content: SurveyContent) -> None:
    """Print only the rows that hold points, and say so where points stand below them."""
    sheet.worksheet.print_area = area
    if sheet.worksheet.title == "Points":  # the sentence on Results repeats it
        formula = unprinted_formula(sheet.book.language, printed_rows(content))
        sheet.formula("E1", formula, name=UNPRINTED, font=WARN_FONT)


_BLOCK_PLACE = Alignment(wrap_text=True, vertical="top")
#: The title block: the cells it spans, and the names of its formulas.
_BLOCKS = {"A2:D2": "title_project", "E2:I2": "title_survey", "J2:O2": ""}


def _title_block(sheet: SheetBuilder) -> None:
    """Write whose survey it is, by whom, when, in which units, and how good."""
    book = sheet.book
    people = [f'"{book.word(name)}: "&{name}' for name in ("project", "client")]
    survey = [f'"{book.word(name)}: "&{name}' for name in ("surveyor", "survey_date")]
    people.append(f'"{book.word("points_solved")}: "&COUNT(tblResults[X])')
    worst = 'IF(ISNUMBER(check_worst),ROUND(check_worst,3)&" m","")'
    survey.append(f'"{book.word("worst_of_checks")}: "&{worst}')
    for (area, name), lines in zip(_BLOCKS.items(), (people, survey, ()), strict=True):
        left = area.partition(":")[0]
        if lines:
            sheet.formula(left, "&CHAR(10)&".join(lines), name=name, font=BODY_FONT)
        else:
            sheet.word(left, "result_units")
        sheet.worksheet.merge_cells(area)
        sheet.worksheet[left].alignment = _BLOCK_PLACE
    sheet.worksheet.row_dimensions[2].height = 42
    judgement = f'TRIM({UNPRINTED}&" "&{STATE}&" "&{SITE})'
    sheet.formula("E1", judgement, name="title_world", font=HEAD_FONT)
    off = sentence("site_alarm", book.word)
    alarm = f'OR({UNPRINTED}<>"",g_alarm=1,{off})'
    colour_where(sheet.worksheet, "E1", alarm, WRONG, stop=True)
    colour_where(sheet.worksheet, "E1", f'AND(COUNT(tape_typed)=0,{SITE}<>"")', DOUBT)
    sheet.worksheet.merge_cells("E1:O1")
    sheet.worksheet["A1"].alignment = Alignment(vertical="center")
    sheet.worksheet["E1"].alignment = Alignment(wrap_text=True, vertical="center")
    sheet.worksheet.row_dimensions[1].height = 28


def _log(builder: BookBuilder, content: SurveyContent) -> None:
    sheet = builder.sheet("Log")
    columns = FORMULAS.columns("log")
    keys = [column.key for column in columns]
    cells = {key: [row[i] for row in content.log] for i, key in enumerate(keys)}
    sheet.table("tblLog", columns, at=(HEAD, 1), rows=max(len(content.log), 1), cells=cells)
    sheet.finish(landscape=True, guarded=False)
