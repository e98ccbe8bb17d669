"""The sheets `Check` and `Planning` of a new survey workbook."""

from __future__ import annotations

import math

from openpyxl.styles import Alignment

from bifocal.model.flags import FlagLimits
from bifocal.survey.reference import AxisErrors
from bifocal.survey.tolerances import judge
from bifocal.workbook.content import SurveyContent, setup_cells
from bifocal.workbook.formulas.columns import (
    FORMULAS,
    FRAME_SHARES,
    PLANNED_RELIEF,
    PLANNING,
    check_columns,
    planning_facts,
)
from bifocal.workbook.reference_cells import check_cells
from bifocal.workbook.words import word
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.making.live_book import BookBuilder, Cells, SheetBuilder
from photocore.workbook.making.look import DOUBT, GOOD, HEAD_FONT, WRONG, colour_where, colour_words
from photocore.workbook.reading.grid import column_letters

#: Row of the keys of the check table; statistics stand above.
CHECK_HEAD = 12
_SENSOR = ("sensor_w", "sensor_h")
#: First column of the verdict, beside the check table.
VERDICT_LEFT = 20


def check(builder: BookBuilder, content: SurveyContent, points: Cells) -> None:
    """Write errors at check points, their statistics and the verdict."""
    rows = content.check_rows
    sheet = builder.sheet("Check", "check_how")
    for letter, axis in zip("BCD", "XYZ", strict=True):
        sheet.text(f"{letter}4", f"d{axis}", HEAD_FONT)
        sheet.worksheet[f"{letter}4"].alignment = Alignment(horizontal="right")
    for letter, axis in zip("BCD", "XYZ", strict=True):
        found = None if content.check is None else content.check.axes[axis]
        statistics_of(sheet, letter, f"tblCheck[d{axis}]", f"check_{{}}_{axis}", found)
    sheet.word("A9", "worst")
    accuracy = content.check.accuracy if content.check is not None else math.nan
    worst = None if math.isnan(accuracy) else accuracy
    sheet.formula(
        "B9", 'IF(COUNT(B6:D6)=0,"",MAX(B6:D6))', worst, form="0.0000", name="check_worst"
    )
    sheet.word("A10", "flagged")
    flagged = 0 if content.check is None else len(content.check.flagged)
    sheet.formula("B10", "SUM(tblCheck[out])", flagged, form="0", name="check_flagged")
    columns = check_columns()
    cells = check_cells(content, points)
    sheet.table("tblCheck", columns, at=(CHECK_HEAD, 1), rows=rows, cells=cells)
    sheet.worksheet.column_dimensions["A"].width = 18
    for letter in ("R", "S"):
        sheet.worksheet.column_dimensions[letter].width = 1.5
    keys = [column.key for column in columns]
    first, end = CHECK_HEAD + 1, column_letters(len(columns))
    area = f"A{first}:{end}{CHECK_HEAD + rows}"
    out, sigmas = (f"${column_letters(keys.index(key) + 1)}{first}" for key in ("out", "sigmas"))
    for formula, colour in _ROWS.items():
        formula = formula.format(out=out, sigmas=sigmas)
        colour_where(sheet.worksheet, area, formula, colour, bold=True, stop=True)
    _verdict(sheet, content, accuracy)
    repeat = f"{CHECK_HEAD - 1}:{CHECK_HEAD}"
    sheet.finish(landscape=True, freeze=f"B{CHECK_HEAD + 1}", repeat=repeat)


def statistics_of(
    sheet: SheetBuilder, letter: str, column: str, name: str, found: AxisErrors | None
) -> None:
    """Write number, RMSE, mean and largest of a column of errors, from row 5 on.

    Parameters
    ----------
    sheet, letter
        Where to.
    column : str
        The errors, as formulas call them.
    name : str
        Of the cells, with the statistic in braces.
    found : AxisErrors or None
        What they show.
    """
    for row, (key, (body, attribute)) in enumerate(_STATISTICS.items(), start=5):
        sheet.word(f"A{row}", key)
        value: CellValue = 0 if key == "n" else None
        if found is not None and found.n:
            value = getattr(found, attribute)
        form, text = "0" if key == "n" else "0.0000", body.format(column, f"{letter}5")
        sheet.formula(f"{letter}{row}", text, value, form=form, name=name.format(key))


#: Rows that are coloured: not counted, beyond three sigma, beyond two.
_ROWS = {"{out}=1": DOUBT, "N({sigmas})>3": WRONG, "N({sigmas})>2": ("FFF2CC", "7F6000")}
#: Statistics of errors: formula of their column and the cell of their number, attribute.
_STATISTICS = {
    "n": ("COUNT({0})", "n"),
    "rmse": ('IF({1}=0,"",SQRT(SUMSQ({0})/{1}))', "rmse"),
    "mean": ('IF({1}=0,"",AVERAGE({0}))', "mean"),
    "max": ('IF({1}=0,"",MAX(MAX({0}),-MIN({0})))', "max_abs"),
}


def _verdict(sheet: SheetBuilder, content: SurveyContent, accuracy: float) -> None:
    """Write what drawing scales the accuracy holds, beside the check table."""
    language = sheet.book.language
    holds, fails = word("holds", language), word("fails", language)
    verdicts = judge(accuracy, content.rules)
    unknown = math.isnan(accuracy)
    sheet.table(
        "tblVerdict",
        FORMULAS.columns("verdict", parts={"holds": holds, "fails": fails}),
        at=(CHECK_HEAD, VERDICT_LEFT),
        rows=len(verdicts),
        cells={
            "rule": [verdict.rule.name for verdict in verdicts],
            "scale": [verdict.scale for verdict in verdicts],
            "tolerance": [verdict.tolerance * 1000.0 for verdict in verdicts],
            "verdict": [
                None if unknown else holds if verdict.holds else fails for verdict in verdicts
            ],
        },
    )
    first, last = CHECK_HEAD + 1, CHECK_HEAD + len(verdicts)
    letter = column_letters(VERDICT_LEFT + 3)
    colours = {holds: GOOD, fails: WRONG}
    colour_words(sheet.worksheet, f"{letter}{first}:{letter}{last}", colours)


def planning(builder: BookBuilder, content: SurveyContent) -> None:
    """Write what precision to expect over the frame and where relief cannot be told from zero."""
    sheet, cells = builder.sheet("Planning", "type"), setup_cells(content)
    scale_name = "m_seen" if content.media_cells and not content.is_pair else "m_1"
    scale, pitch, sigma, base = (
        float(cells.get(name) or math.nan) for name in (scale_name, "pitch", "sigma_s", "b_lever")
    )

    facts = planning_facts(media=content.media_cells, is_pair=content.is_pair)
    lines = {line.key: line.formula for line in FORMULAS.columns("planning", facts, rows="lines")}
    sizes = content.sensor or (math.nan, math.nan)
    sheet.word("A6", "footprint")
    for row, (name, size) in enumerate(zip(_SENSOR, sizes, strict=True), start=4):
        sheet.word(f"A{row}", name)
        sheet.input(f"B{row}", size, form="0.00", name=name)
        sheet.validate(f"B{row}", title=name, prompt=word(name, builder.language), above_zero=True)
    # By the principal distance: without it the image scale of a general pair is only nominal.
    d1_name = "seen_1" if content.media_cells else "d_1"
    c1, d1 = (float(cells.get(name) or math.nan) for name in ("c_1", d1_name))
    for letter, name, size in zip("BC", _SENSOR, sizes, strict=True):
        named, covered = name.replace("sensor", "covered"), _known(size * d1 / c1)
        sheet.formula(f"{letter}6", lines[named], covered, form="0.00", name=named)
    sheet.word("A7", "gsd")
    pixel = float(cells.get("pixel_wall") or math.nan) if content.is_pair else pitch * scale
    sheet.formula("B7", lines["gsd_mm"], _known(pixel), form="0.00", name="gsd_mm")
    diagonal = math.hypot(*sizes) * float(cells["enlargement_1"] or 1)  # of the print, if any
    sheet.word("A9", "uncertainty", HEAD_FONT)
    shown = _uncertainty(content, sigma, scale, diagonal)
    columns = FORMULAS.columns("planning", facts, PLANNING)
    sheet.table("tblPlan", columns, at=(11, 1), rows=len(PLANNED_RELIEF), cells=shown)
    head = 11 + len(PLANNED_RELIEF) + 4
    sheet.word(f"A{head - 2}", "over_frame", HEAD_FONT)
    radii = [share / 200 * diagonal for share in FRAME_SHARES]
    over_frame: Cells = {
        "share": FRAME_SHARES,
        "s_mm": list(map(_known, radii)),
        "sigma_r": [_known(math.sqrt(2) * sigma * base / radius) for radius in radii],
    }
    rows = len(FRAME_SHARES)
    columns = FORMULAS.columns("over_frame", facts)
    sheet.table("tblFrame", columns, at=(head, 1), rows=rows, cells=over_frame)
    sheet.worksheet.column_dimensions["A"].width = 36
    sheet.finish()


def _known(value: float) -> float | None:
    """Return a number; None where what it follows from is not given."""
    return None if math.isnan(value) else value


def _uncertainty(content: SurveyContent, sigma: float, scale: float, diagonal: float) -> Cells:
    """Return the radii inside which a relief is below twice its standard deviation."""
    d1, d2 = content.pair.straight_distances if content.pair else (math.nan, math.nan)
    radii = []
    for cm in PLANNED_RELIEF:
        r = cm / 100
        noise = FlagLimits().on_plane * math.sqrt(2) * sigma
        radii.append(noise * (d1 - r) * (d2 - r) / (r * abs(d1 - d2)))
    return {
        "relief_cm": PLANNED_RELIEF,
        "radius_mm": list(map(_known, radii)),
        "radius_m": [_known(radius * scale / 1000) for radius in radii],
        "share": [_known(200 * radius / diagonal) for radius in radii],
    }
