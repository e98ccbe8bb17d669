"""The sheets `Check` and `Planning` of a new survey workbook."""

from __future__ import annotations

from openpyxl.styles import Alignment

from bifocal.model import FARTHEST_WALL
from bifocal.survey import TAPE, judge
from bifocal.workbook.content import CHECK_ROWS, SurveyContent, check_cells
from bifocal.workbook.formulas.columns import (
    FORMULAS,
    FRAME_SHARES,
    PLANNED_RELIEF,
    PLANNING,
    check_columns,
    planning_facts,
)
from bifocal.workbook.formulas.world_state import SITE, sentence
from bifocal.workbook.words import word
from photocore.workbook import (
    DOUBT,
    GOOD,
    HEAD_FONT,
    NOTE_FONT,
    WRONG,
    BookBuilder,
    SheetBuilder,
    colour_where,
    colour_words,
    column_letters,
    name_cell,
)

#: Row of the keys of the check table; statistics stand above.
CHECK_HEAD = 12
_SENSOR = ("sensor_w", "sensor_h")
#: First column of the verdict, beside the check table.
VERDICT_LEFT = 20


def check(builder: BookBuilder, content: SurveyContent) -> None:
    """Write errors at check points, their statistics and the verdict."""
    rows = content.check_rows
    sheet = builder.sheet("Check", "check_how")
    state = sentence("check_state", builder.word, sheet="Check")
    sheet.formula("A2", state, name="check_state", font=NOTE_FONT)
    colour_where(sheet.worksheet, "A2:K2", f'$A$2<>"{builder.word("check_how")}"', WRONG)
    for letter, axis in zip("BCD", "XYZ", strict=True):
        sheet.text(f"{letter}4", f"d{axis}", HEAD_FONT)
        sheet.worksheet[f"{letter}4"].alignment = Alignment(horizontal="right")
    for letter, axis in zip("BCD", "XYZ", strict=True):
        statistics_of(sheet, letter, f"tblCheck[d{axis}]", f"check_{{}}_{axis}")
    sheet.word("A9", "worst")
    sheet.formula("B9", 'IF(COUNT(B6:D6)=0,"",MAX(B6:D6))', form="0.0000", name="check_worst")
    sheet.word("A10", "flagged")
    sheet.formula("B10", "SUM(tblCheck[out])", form="0", name="check_flagged")
    _taped(sheet, content)
    columns, cells = check_columns(), check_cells(content)
    sheet.table("tblCheck", columns, at=(CHECK_HEAD, 1), rows=rows, cells=cells)
    sheet.worksheet.column_dimensions["A"].width = 16.5
    for letter in ("R", "S"):
        sheet.worksheet.column_dimensions[letter].width = 1.5
    keys = [column.key for column in columns]
    first, end = CHECK_HEAD + 1, column_letters(len(columns))
    area = f"A{first}:{end}{CHECK_HEAD + rows}"
    out, sigmas = (f"${column_letters(keys.index(key) + 1)}{first}" for key in ("out", "sigmas"))
    for formula, colour in _ROWS.items():
        formula = formula.format(out=out, sigmas=sigmas)
        colour_where(sheet.worksheet, area, formula, colour, bold=True, stop=True)
    _verdict(sheet, content)
    repeat = f"{CHECK_HEAD - 1}:{CHECK_HEAD}"
    sheet.finish(landscape=True, freeze=f"B{CHECK_HEAD + 1}", repeat=repeat)
    if rows == CHECK_ROWS:
        sheet.worksheet.page_setup.fitToHeight = 1


def _taped(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write cells for one distance taped on site, what it is calculated as, and what that says."""
    facts = planning_facts(media=content.media_cells, is_pair=content.is_pair)
    sheet.formula("A3", sentence(SITE, sheet.book.word, facts), name=SITE, font=HEAD_FONT)
    off = sentence("site_alarm", sheet.book.word)
    colour_where(sheet.worksheet, "A3:K3", off, WRONG)
    sheet.word("F4", "tape", HEAD_FONT)
    tape = content.tape
    typed = (None, None, None) if tape is None else (*map(name_cell, tape.ends), tape.length)
    limits = (0.001, FARTHEST_WALL)
    for row, (key, value) in enumerate(zip(TAPE, typed, strict=True), start=5):
        sheet.word(f"F{row}", key)
        is_length = key == TAPE[-1]
        sheet.input(f"I{row}", value, form="0.0000" if is_length else "@", name=key)
        prompt = sheet.book.word("tape_how")
        sheet.validate(f"I{row}", title=key, prompt=prompt, limits=limits if is_length else None)
    for place, line in zip(_TAPE_PLACES, FORMULAS.columns("states", rows="tape"), strict=True):
        if place[0] == "I":
            sheet.word(f"F{place[1:]}", line.key)
        sheet.formula(place, line.formula, form=line.form, name=line.key)


#: Where the taped distance is compared: components in columns that are folded away.
_TAPE_PLACES = ("L7", "M7", "N7", "I8", "I9", "I10")


def statistics_of(sheet: SheetBuilder, letter: str, column: str, name: str) -> None:
    """Write number, RMSE, mean and largest of a column of errors, from row 5 on.

    Parameters
    ----------
    sheet, letter
        Where to.
    column : str
        The errors, as formulas call them.
    name : str
        Of the cells, with the statistic in braces.
    """
    for row, (key, body) in enumerate(_STATISTICS.items(), start=5):
        sheet.word(f"A{row}", key)
        form, text = "0" if key == "n" else "0.0000", body.format(column, f"{letter}5")
        sheet.formula(f"{letter}{row}", text, form=form, name=name.format(key))


#: Rows that are coloured: not counted, beyond three sigma, beyond two.
_ROWS = {"{out}=1": DOUBT, "N({sigmas})>3": WRONG, "N({sigmas})>2": ("FFF2CC", "7F6000")}
#: Statistics of errors: formula of their column and the cell of their number.
_STATISTICS = {
    "n": "COUNT({0})",
    "rmse": 'IF({1}=0,"",SQRT(SUMSQ({0})/{1}))',
    "mean": 'IF({1}=0,"",AVERAGE({0}))',
    "max": 'IF({1}=0,"",MAX(MAX({0}),-MIN({0})))',
}


def _verdict(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write what drawing scales the accuracy holds, beside the check table."""
    language = sheet.book.language
    holds, fails = word("holds", language), word("fails", language)
    verdicts = judge(float("nan"), content.rules)
    sheet.table(
        "tblVerdict",
        FORMULAS.columns("verdict", parts={"holds": holds, "fails": fails}),
        at=(CHECK_HEAD, VERDICT_LEFT),
        rows=len(verdicts),
        cells={
            "rule": [verdict.rule.name for verdict in verdicts],
            "scale": [verdict.scale for verdict in verdicts],
            "tolerance": [verdict.tolerance * 1000.0 for verdict in verdicts],
        },
    )
    first, last = CHECK_HEAD + 1, CHECK_HEAD + len(verdicts)
    letter = column_letters(VERDICT_LEFT + 3)
    colours = {holds: GOOD, fails: WRONG}
    colour_words(sheet.worksheet, f"{letter}{first}:{letter}{last}", colours)


def planning(builder: BookBuilder, content: SurveyContent) -> None:
    """Write what precision to expect over the frame and where relief cannot be told from zero."""
    sheet = builder.sheet("Planning", "type")
    facts = planning_facts(media=content.media_cells, is_pair=content.is_pair)
    lines = {line.key: line.formula for line in FORMULAS.columns("planning", facts, rows="lines")}
    sheet.word("A6", "footprint")
    for row, (name, size) in enumerate(
        zip(_SENSOR, content.sensor or (None, None), strict=True), start=4
    ):
        sheet.word(f"A{row}", name)
        sheet.input(f"B{row}", size, form="0.00", name=name)
        sheet.validate(f"B{row}", title=name, prompt=word(name, builder.language), above_zero=True)
    for letter, name in zip("BC", _SENSOR, strict=True):
        covered = name.replace("sensor", "covered")
        sheet.formula(f"{letter}6", lines[covered], form="0.00", name=covered)
    sheet.word("A7", "gsd")
    sheet.formula("B7", lines["gsd_mm"], form="0.00", name="gsd_mm")
    sheet.word("A9", "uncertainty", HEAD_FONT)
    columns, rows = FORMULAS.columns("planning", facts, PLANNING), len(PLANNED_RELIEF)
    sheet.table("tblPlan", columns, at=(11, 1), rows=rows, cells={"relief_cm": PLANNED_RELIEF})
    head = 11 + len(PLANNED_RELIEF) + 4
    sheet.word(f"A{head - 2}", "over_frame", HEAD_FONT)
    columns, rows = FORMULAS.columns("over_frame", facts), len(FRAME_SHARES)
    sheet.table("tblFrame", columns, at=(head, 1), rows=rows, cells={"share": FRAME_SHARES})
    sheet.worksheet.column_dimensions["A"].width = 36
    sheet.finish()
