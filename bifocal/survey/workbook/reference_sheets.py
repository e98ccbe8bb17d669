"""The sheets `Check`, `Georeference` and `Planning` of a new survey workbook."""

from __future__ import annotations

import math
import re

import numpy as np
from openpyxl.styles import Alignment

from bifocal.model.flags import FlagLimits
from bifocal.survey.tolerances import judge
from bifocal.survey.workbook.columns import (
    CHECK,
    FRAME_SHARES,
    GEOREFERENCE,
    OVER_FRAME,
    PLANNED_RELIEF,
    UNCERTAINTY,
    verdict_columns,
)
from bifocal.survey.workbook.content import SurveyContent, check_cells, control_cells, setup_cells
from bifocal.survey.workbook.sheets import HEAD_FONT, LABEL_FONT, BookBuilder, Cells, SheetBuilder
from bifocal.survey.workbook.words import word
from photocore.workbook.cells import CellValue
from photocore.workbook.grid import column_letters
from photocore.workbook.look import colour_words

#: Row of the keys of the two tables; statistics and parameters stand above.
CHECK_HEAD, CONTROL_HEAD = 12, 27
_SENSOR = ("sensor_w", "sensor_h")
#: First column of the verdict, beside the check table.
VERDICT_LEFT = 14


def check(builder: BookBuilder, content: SurveyContent) -> None:
    """Write errors at check points, their statistics and the verdict."""
    rows = content.check_rows
    sheet = builder.sheet("Check", "check_how")
    for letter, axis in zip("BCD", "XYZ", strict=True):
        sheet.text(f"{letter}4", f"d{axis}", HEAD_FONT)
    for row, (key, (body, attribute)) in enumerate(_STATISTICS.items(), start=5):
        sheet.word(f"A{row}", key)
        for letter, axis in zip("BCD", "XYZ", strict=True):
            errors = None if content.check is None else content.check.axes[axis]
            value: CellValue = 0 if key == "n" else None
            if errors is not None and errors.n:
                value = getattr(errors, attribute)
            text = body.format(f"tblCheck[d{axis}]", f"{letter}5")
            form, name = "0" if key == "n" else "0.0000", f"check_{key}_{axis}"
            sheet.formula(f"{letter}{row}", text, value, form=form, name=name)
    sheet.word("A9", "worst")
    accuracy = content.check.accuracy if content.check is not None else math.nan
    worst = None if math.isnan(accuracy) else accuracy
    sheet.formula(
        "B9", 'IF(COUNT(B6:D6)=0,"",MAX(B6:D6))', worst, form="0.0000", name="check_worst"
    )
    cells = check_cells(content)
    sheet.table("tblCheck", CHECK, at=(CHECK_HEAD, 1), rows=rows, cells=cells)
    sheet.worksheet.column_dimensions["A"].width = 28
    _verdict(sheet, content, accuracy)
    first, last = CHECK_HEAD + 1, CHECK_HEAD + rows
    sheet.validate(f"B{first}:D{last}")
    sheet.validate(f"E{first}:E{last}", choices="1,0")
    sheet.finish(landscape=True, freeze=f"B{first}")


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
        verdict_columns(holds, fails),
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
    colours = {holds: ("E2F0D9", "1E5B12"), fails: ("F8CBCB", "8B0000")}
    colour_words(sheet.worksheet, f"{letter}{first}:{letter}{last}", colours)


def georeference(builder: BookBuilder, content: SurveyContent) -> None:
    """Write control points, the closed-form transformation and the residuals."""
    rows = content.control_rows
    sheet = builder.sheet("Georeference", "geo_how")
    _model(sheet, content)
    _transformation(sheet, content)
    _centres(sheet, content)
    _rotation(sheet, content)
    _sums(sheet, content)
    cells = control_cells(content)
    sheet.table("tblGeo", GEOREFERENCE, at=(CONTROL_HEAD, 1), rows=rows, cells=cells)
    sheet.worksheet.column_dimensions["A"].width = 34
    first, last = CONTROL_HEAD + 1, CONTROL_HEAD + rows
    sheet.validate(f"B{first}:D{last}", limit=1e8)
    sheet.validate(f"E{first}:E{last}", choices="1,0")
    sheet.finish(landscape=True, freeze=f"B{first}")


def _model(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write which model is asked for, found and used."""
    geo = content.georeference
    for row, key in enumerate(("geo_model", "geo_auto", "geo_used"), start=4):
        sheet.word(f"A{row}", key)
    sheet.worksheet["A4"].alignment = Alignment(wrap_text=True)
    sheet.input("B4", content.model, name="g_model")
    sheet.validate("B4", choices="auto,levelled,3D,2D")
    sheet.input("B5", None if geo is None else geo.model, name="g_auto")
    flat = 'IF(COUNT(tblGeo[H])=0,IF(COUNT(tblGeo[E])=0,"levelled","2D"),'
    used = f'IF(g_model="auto",{flat}IF(g_auto="3D","3D","levelled")),g_model)'
    shown = "levelled" if content.model == "auto" else content.model
    value = shown if geo is None else geo.model
    sheet.formula("B6", used, value, form="General", name="g_used")


def _transformation(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write number of points, scale, precision and rotation in plan, live."""
    geo = content.georeference
    redundant = 'g_n*IF(g_used="2D",2,3)-IF(g_used="2D",4,IF(g_used="3D",7,5))'
    east, north, height = (f"SUMPRODUCT(tblGeo[w],tblGeo[v{n}],tblGeo[v{n}])" for n in "ENH")
    values: tuple[CellValue, ...] = (0, None, None, None)
    if geo is not None:
        turn = geo.world_from_wall.rotation
        values = (
            int(geo.used.sum()),
            geo.world_from_wall.scale,
            None if math.isnan(geo.sigma0) else geo.sigma0,
            math.degrees(math.atan2(turn[1, 0], turn[0, 0])),
        )
    lines = (
        ("geo_n", "g_n", "SUM(tblGeo[w])", "0"),
        (
            "geo_scale",
            "g_k",
            'IF(g_n<IF(g_used="3D",3,2),"",IF(g_used="3D",IF(COUNT(s3_k)=1,s3_k,""),'
            'IF(g_used="2D",IF(g_sq2=0,"",g_l2/g_sq2),IF(g_lL=0,"",(g_lL+g_cYH)/g_sq3))))',
            "0.000000000",
        ),
        (
            "geo_sigma0",
            "g_sigma0",
            f'IF(g_k="","",IF({redundant}<1,"",SQRT(({east}+{north}'
            f'+IF(g_used="2D",0,{height}))/({redundant}))))',
            "0.0000",
        ),
        ("geo_alpha", "g_alpha", 'IF(g_k="","",DEGREES(ATAN2(g_11,g_21)))', "0.0000"),
    )
    for row, ((key, name, body, form), value) in enumerate(zip(lines, values, strict=True), 7):
        sheet.word(f"A{row}", key)
        sheet.formula(f"B{row}", body, value, form=form, name=name)


#: Cosines of the closed forms, row by row: of the model 2D, of the levelled one.
_COSINES = {
    "11": ("g_a2/g_l2", "g_aL/g_lL"), "12": ("-g_b2/g_l2", "0"), "13": ("0", "g_bL/g_lL"),
    "21": ("g_b2/g_l2", "g_bL/g_lL"), "22": ("g_a2/g_l2", "0"), "23": ("0", "-g_aL/g_lL"),
    "31": ("0", "0"), "32": ("0", "1"), "33": ("1", "0"),
}  # fmt: skip


def _rotation(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write the rotation: closed forms live, the general one found by the program."""
    geo = content.georeference
    sheet.word("A14", "geo_rotation")
    sheet.word("J14", "geo_solved")
    is_3d = geo is not None and geo.model == "3D"
    for key, (plane, levelled) in _COSINES.items():
        i, j = int(key[0]) - 1, int(key[1]) - 1
        entry = None if geo is None else float(geo.world_from_wall.rotation[i, j])
        body = f'IF(g_k="","",IF(g_used="3D",s3_{key},IF(g_used="2D",{plane},{levelled})))'
        place = f"{'BCD'[j]}{14 + i}"
        sheet.formula(place, body, entry, form="0.000000000", name=f"g_{key}")
        solved = entry if is_3d else None
        sheet.input(f"{'GHI'[j]}{14 + i}", solved, name=f"s3_{key}")
    sheet.word("J17", "geo_scale")
    scale = geo.world_from_wall.scale if geo is not None and is_3d else None
    sheet.input("G17", scale, name="s3_k")


def _centres(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write the centres of the control points in both systems, the world's in two parts.

    E0 = Er + Et with Er a whole number: differences of large coordinates stay exact.
    """
    geo = content.georeference
    sheet.word("A12", "geo_centres")
    zero = np.zeros(3)
    wall = zero if geo is None else geo.world_from_wall.source_centre
    origin, offset = (zero, zero) if geo is None else (geo.origin, geo.offset)

    def formula(cell: str, name: str, body: str, value: float) -> None:
        sheet.formula(cell, body, float(value), form="0.0000", name=name)

    for i, (axis, name) in enumerate(zip("XYZ", "ENH", strict=True)):
        mean = "IF(g_n=0,0,SUMIF(tblGeo[w],1,tblGeo[{0}])/g_n)"
        formula(f"{'BCD'[i]}12", f"g_{axis}0", mean.format(axis), wall[i])
        rounded, rest = f"ROUND({mean.format(name)},0)", f"IF(g_n=0,0,SUM(tblGeo[c{name}])/g_n)"
        if name == "H":
            rounded = f'IF(g_used="2D",0,{rounded})'
            rest = f'IF(g_used="2D",IF(g_sq2=0,0,g_l2/g_sq2*g_Z0),{rest})'
        formula(f"{'BCD'[i]}13", f"g_{name}0", f"g_{name}r+g_{name}t", origin[i] + offset[i])
        formula(f"{'GHI'[i]}12", f"g_{name}r", rounded, origin[i])
        formula(f"{'GHI'[i]}13", f"g_{name}t", rest, offset[i])


def _sums(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write the centred sums the closed forms are made of, with their values."""
    geo = content.georeference
    centred = np.zeros((6, 0))
    if geo is not None:
        world = content.control.xyz[geo.used] - geo.origin
        if geo.model == "2D":
            world[:, 2] = 0.0
        centred = np.hstack([geo.solved[geo.used] - geo.world_from_wall.source_centre, world]).T
    column = dict(zip("XYZENH", centred, strict=True))
    products = {
        "a2": "XE+YN", "b2": "XN-YE", "sq2": "XX+YY", "aL": "XE-ZN", "bL": "XN+ZE",
        "sq3": "XX+YY+ZZ", "cYH": "YH",
    }  # fmt: skip
    bodies, values = {}, {}
    for name, pairs in products.items():
        signed = re.findall(r"([+-]?)(\w)(\w)", pairs)
        bodies[name] = "".join(
            f"{sign}SUMPRODUCT(tblGeo[c{one}],tblGeo[c{other}])" for sign, one, other in signed
        )
        values[name] = sum(
            float(f"{sign}1") * float((column[one] * column[other]).sum())
            for sign, one, other in signed
        )
    for kind in "2L":
        bodies[f"l{kind}"] = f"SQRT(g_a{kind}^2+g_b{kind}^2)"
        values[f"l{kind}"] = math.hypot(values[f"a{kind}"], values[f"b{kind}"])
    for i, name in enumerate(("a2", "b2", "l2", "sq2", "aL", "bL", "lL", "sq3", "cYH")):
        row, (left, right) = 19 + i % 5, ("AB", "CD")[i // 5]
        sheet.text(f"{left}{row}", f"g_{name}", LABEL_FONT)
        place, form = f"{right}{row}", "0.000000"
        sheet.formula(place, bodies[name], values[name], form=form, name=f"g_{name}")


def planning(builder: BookBuilder, content: SurveyContent) -> None:
    """Write what precision to expect over the frame and where relief cannot be told from zero."""
    sheet, cells = builder.sheet("Planning", "type"), setup_cells(content)
    scale, pitch, sigma, base = (
        float(cells.get(name) or math.nan) for name in ("m_1", "pitch", "sigma_s", "b_lever")
    )
    sizes = content.sensor or (math.nan, math.nan)
    sheet.word("A6", "footprint")
    for row, (name, size) in enumerate(zip(_SENSOR, sizes, strict=True), start=4):
        sheet.word(f"A{row}", name)
        sheet.input(f"B{row}", size, form="0.00", name=name)
        sheet.validate(f"B{row}", above_zero=True)
    for letter, name, size in zip("BC", _SENSOR, sizes, strict=True):
        body, covered = f'IF(COUNT({name},m_1)=2,{name}*m_1/1000,"")', _known(size * scale / 1000)
        named = name.replace("sensor", "covered")
        sheet.formula(f"{letter}6", body, covered, form="0.00", name=named)
    sheet.word("A7", "gsd")
    body = 'IF(COUNT(pitch,m_1)=2,pitch*m_1,"")'
    sheet.formula("B7", body, _known(pitch * scale), form="0.00", name="gsd_mm")
    diagonal = math.hypot(*sizes)
    sheet.word("A9", "uncertainty", HEAD_FONT)
    shown = _uncertainty(content, sigma, scale, diagonal)
    sheet.table("tblPlan", UNCERTAINTY, at=(11, 1), rows=len(PLANNED_RELIEF), cells=shown)
    head = 11 + len(PLANNED_RELIEF) + 4
    sheet.word(f"A{head - 2}", "over_frame", HEAD_FONT)
    radii = [share / 200 * diagonal for share in FRAME_SHARES]
    over_frame: Cells = {
        "share": FRAME_SHARES,
        "s_mm": list(map(_known, radii)),
        "sigma_r": [_known(math.sqrt(2) * sigma * base / radius) for radius in radii],
    }
    rows = len(FRAME_SHARES)
    sheet.table("tblFrame", OVER_FRAME, at=(head, 1), rows=rows, cells=over_frame)
    sheet.worksheet.column_dimensions["A"].width = 36
    sheet.finish()


def _known(value: float) -> float | None:
    """Return a number; None where what it follows from is not given."""
    return None if math.isnan(value) else value


def _uncertainty(content: SurveyContent, sigma: float, scale: float, diagonal: float) -> Cells:
    """Return the radii inside which a relief is below twice its standard deviation."""
    d1, d2 = (content.pair.d1, content.pair.d2) if content.pair else (math.nan, math.nan)
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
