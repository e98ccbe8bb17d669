"""The sheets `Check`, `Georeference` and `Planning` of a new survey workbook."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from openpyxl.formatting.rule import FormulaRule
from openpyxl.styles import Alignment, Font, PatternFill

from bifocal.survey.setup import ON_PLANE_SIGMAS
from bifocal.survey.workbook.columns import (
    CHECK,
    FRAME_SHARES,
    GEOREFERENCE,
    OVER_FRAME,
    PLANNED_RELIEF,
    UNCERTAINTY,
    verdict_columns,
)
from bifocal.survey.workbook.content import SurveyContent, setup_cells, verdict_rows
from bifocal.survey.workbook.sheets import (
    HEAD_FONT,
    LABEL_FONT,
    BookBuilder,
    protect,
    set_up_print,
    validate,
)
from bifocal.survey.workbook.words import word
from photocore.workbook.cells import CellValue
from photocore.workbook.grid import column_letters

Cells = Mapping[str, list[CellValue]]
#: Row of the keys of the two tables; statistics and parameters stand above.
CHECK_HEAD, CONTROL_HEAD = 12, 27
#: First column of the verdict, beside the check table.
VERDICT_LEFT = 14


def check(builder: BookBuilder, content: SurveyContent, cells: Cells) -> None:
    """Write errors at check points, their statistics and the verdict."""
    language, rows = builder.language, content.check_rows
    sheet = builder.sheet("Check", word("Check", language), word("check_how", language))
    for i, axis in enumerate("XYZ"):
        builder.text(sheet, f"{'BCD'[i]}4", f"d{axis}", HEAD_FONT)
    for row, key in enumerate(("n", "rmse", "mean", "max"), start=5):
        builder.text(sheet, f"A{row}", word(key, language))
        for i, axis in enumerate("XYZ"):
            cell, column = f"{'BCD'[i]}{row}", f"tblCheck[d{axis}]"
            found = content.check.axes[axis] if content.check is not None else None
            count = found.n if found is not None else 0
            text, value = {
                "n": (f"COUNT({column})", count),
                "rmse": (
                    f'IF({"BCD"[i]}5=0,"",SQRT(SUMSQ({column})/{"BCD"[i]}5))',
                    found.rmse if found is not None and count else None,
                ),
                "mean": (
                    f'IF({"BCD"[i]}5=0,"",AVERAGE({column}))',
                    found.mean if found is not None and count else None,
                ),
                "max": (
                    f'IF({"BCD"[i]}5=0,"",MAX(MAX({column}),-MIN({column})))',
                    found.max_abs if found is not None and count else None,
                ),
            }[key]
            form = "0" if key == "n" else "0.0000"
            builder.formula(sheet, cell, text, value, form=form, name=f"check_{key}_{axis}")
    builder.text(sheet, "A9", word("worst", language))
    accuracy = content.check.accuracy if content.check is not None else math.nan
    worst = None if math.isnan(accuracy) else accuracy
    builder.formula(
        sheet, "B9", 'IF(COUNT(B6:D6)=0,"",MAX(B6:D6))', worst, form="0.0000", name="check_worst"
    )
    sheet.column_dimensions["A"].width = 30
    builder.table(sheet, "tblCheck", CHECK, at=(CHECK_HEAD, 1), rows=rows, cells=cells)
    sheet.column_dimensions["A"].width = 28
    _verdict(builder, content, worst)
    first, last = CHECK_HEAD + 1, CHECK_HEAD + rows
    validate(sheet, f"B{first}:D{last}")
    validate(sheet, f"E{first}:E{last}", choices="1,0")
    sheet.freeze_panes = f"B{first}"
    set_up_print(sheet, language, landscape=True)
    protect(sheet)


def _verdict(builder: BookBuilder, content: SurveyContent, accuracy: float | None) -> None:
    """Write what drawing scales the accuracy holds, beside the check table."""
    sheet, language = builder.book["Check"], builder.language
    holds, fails = word("holds", language), word("fails", language)
    rows = verdict_rows(content)
    verdicts: list[CellValue] = [
        None if accuracy is None else holds if accuracy <= limit else fails for *_, limit in rows
    ]
    builder.table(
        sheet,
        "tblVerdict",
        verdict_columns(holds, fails),
        at=(CHECK_HEAD, VERDICT_LEFT),
        rows=len(rows),
        cells={
            "rule": [rule.name for rule, *_ in rows],
            "scale": [scale for _, scale, _ in rows],
            "tolerance": [limit * 1000.0 for *_, limit in rows],
            "verdict": verdicts,
        },
    )
    first, last = CHECK_HEAD + 1, CHECK_HEAD + len(rows)
    letter = column_letters(VERDICT_LEFT + 3)
    for verb, fill, ink in ((holds, "E2F0D9", "1E5B12"), (fails, "F8CBCB", "8B0000")):
        rule_ = FormulaRule(
            formula=[f'${letter}{first}="{verb}"'],
            fill=PatternFill("solid", start_color=fill, end_color=fill),
            font=Font(color=ink),
        )
        sheet.conditional_formatting.add(f"{letter}{first}:{letter}{last}", rule_)


def georeference(builder: BookBuilder, content: SurveyContent, cells: Cells) -> None:
    """Write control points, the closed-form transformation and the residuals."""
    language = builder.language
    sheet = builder.sheet("Georeference", word("Georeference", language), word("geo_how", language))
    _parameters(builder, content)
    spare: dict[str, list[CellValue]] = {
        key: [*cells.get(key, []), *[0] * content.control_rows]
        for key in ("w", "cX", "cY", "cZ", "cE", "cN", "cH")
    }
    builder.table(
        sheet,
        "tblGeo",
        GEOREFERENCE,
        at=(CONTROL_HEAD, 1),
        rows=content.control_rows,
        cells=dict(cells) | spare,
    )
    sheet.column_dimensions["A"].width = 34
    first, last = CONTROL_HEAD + 1, CONTROL_HEAD + content.control_rows
    validate(sheet, f"B{first}:D{last}", between=(-1e8, 1e8))
    validate(sheet, f"E{first}:E{last}", choices="1,0")
    sheet.freeze_panes = f"B{first}"
    set_up_print(sheet, language, landscape=True)
    protect(sheet)


def _sums(content: SurveyContent) -> dict[str, float]:
    """Return the centred sums of the closed forms, as the sheet computes them."""
    names = ("a2", "b2", "l2", "sq2", "aL", "bL", "lL", "sq3", "cYH")
    geo = content.georeference
    if geo is None:
        return dict.fromkeys(names, 0.0)
    used = geo.used
    p = geo.found[used] - geo.world_from_wall.source_centre
    world = content.control.xyz[used]
    q = world - geo.origin
    if geo.model == "2D":
        q[:, 2] = 0.0
    a2, b2 = (p[:, :2] * q[:, :2]).sum(), (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()
    a, b = (
        (p[:, 0] * q[:, 0]).sum() - (p[:, 2] * q[:, 1]).sum(),
        (p[:, 0] * q[:, 1]).sum() + (p[:, 2] * q[:, 0]).sum(),
    )
    values = (
        a2,
        b2,
        np.sqrt(a2**2 + b2**2),
        (p[:, :2] ** 2).sum(),
        a,
        b,
        np.sqrt(a**2 + b**2),
        (p**2).sum(),
        (p[:, 1] * q[:, 2]).sum(),
    )
    return dict(zip(names, (float(value) for value in values), strict=True))


def _parameters(builder: BookBuilder, content: SurveyContent) -> None:
    """Write the transformation: closed forms live, the general one found by the program."""
    sheet, language, geo = builder.book["Georeference"], builder.language, content.georeference
    sums = _sums(content)
    transformation = None if geo is None else geo.world_from_wall
    used = 0 if geo is None else int(geo.used.sum())

    def text(row: int, key: str) -> None:
        builder.text(sheet, f"A{row}", word(key, language))

    def formula(cell: str, name: str, body: str, value: CellValue, form: str = "0.0000") -> None:
        builder.formula(sheet, cell, body, value, form=form, name=name)

    text(4, "geo_model")
    sheet["A4"].alignment = Alignment(wrap_text=True)
    builder.input(sheet, "B4", content.model, name="g_model")
    validate(sheet, "B4", choices="auto,levelled,3D,2D")
    text(5, "geo_auto")
    builder.input(sheet, "B5", None if geo is None else geo.model, name="g_auto")
    text(6, "geo_used")
    flat = 'IF(COUNT(tblGeo[H])=0,IF(COUNT(tblGeo[E])=0,"levelled","2D"),'
    kind = geo.model if geo is not None else "levelled"
    formula(
        "B6",
        "g_used",
        f'IF(g_model="auto",{flat}IF(g_auto="3D","3D","levelled")),g_model)',
        kind if geo is not None or content.model == "auto" else content.model,
        "General",
    )
    text(7, "geo_n")
    formula("B7", "g_n", "SUM(tblGeo[w])", used, "0")
    text(8, "geo_scale")
    k = None if transformation is None else transformation.scale
    formula(
        "B8",
        "g_k",
        'IF(g_n<IF(g_used="3D",3,2),"",IF(g_used="3D",IF(COUNT(s3_k)=1,s3_k,""),'
        'IF(g_used="2D",IF(g_sq2=0,"",g_l2/g_sq2),IF(g_lL=0,"",(g_lL+g_cYH)/g_sq3))))',
        k,
        "0.000000000",
    )
    text(9, "geo_sigma0")
    redundant = 'g_n*IF(g_used="2D",2,3)-IF(g_used="2D",4,IF(g_used="3D",7,5))'
    squares = "SUMPRODUCT(tblGeo[w],tblGeo[v{0}],tblGeo[v{0}])"
    formula(
        "B9",
        "g_sigma0",
        f'IF(g_k="","",IF({redundant}<1,"",SQRT(({squares.format("E")}+{squares.format("N")}'
        f'+IF(g_used="2D",0,{squares.format("H")}))/({redundant}))))',
        None if geo is None or math.isnan(geo.sigma0) else geo.sigma0,
    )
    text(10, "geo_alpha")
    angle = None
    if transformation is not None:
        angle = math.degrees(
            math.atan2(transformation.rotation[1, 0], transformation.rotation[0, 0])
        )
    formula("B10", "g_alpha", 'IF(g_k="","",DEGREES(ATAN2(g_11,g_21)))', angle)
    _centres(builder, content)
    text(14, "geo_rotation")
    builder.text(sheet, "J14", word("geo_solved", language))
    cosines = {
        "11": ("g_a2/g_l2", "g_aL/g_lL"), "12": ("-g_b2/g_l2", "0"), "13": ("0", "g_bL/g_lL"),
        "21": ("g_b2/g_l2", "g_bL/g_lL"), "22": ("g_a2/g_l2", "0"), "23": ("0", "-g_aL/g_lL"),
        "31": ("0", "0"), "32": ("0", "1"), "33": ("1", "0"),
    }  # fmt: skip
    for i in range(3):
        for j in range(3):
            key = f"{i + 1}{j + 1}"
            entry = None if transformation is None else float(transformation.rotation[i, j])
            plane, levelled = cosines[key]
            formula(
                f"{'BCD'[j]}{14 + i}",
                f"g_{key}",
                f'IF(g_k="","",IF(g_used="3D",s3_{key},IF(g_used="2D",{plane},{levelled})))',
                entry,
                "0.000000000",
            )
            solved = entry if kind == "3D" and geo is not None else None
            builder.input(sheet, f"{'GHI'[j]}{14 + i}", solved, name=f"s3_{key}")
    builder.text(sheet, "J17", word("geo_scale", language))
    builder.input(sheet, "G17", k if kind == "3D" else None, name="s3_k")
    _write_sums(builder, sums)


def _centres(builder: BookBuilder, content: SurveyContent) -> None:
    """Write the centres of the control points in both systems, the world's in two parts.

    E0 = Er + Et with Er a whole number: differences of large coordinates stay exact.
    """
    sheet, language, geo = builder.book["Georeference"], builder.language, content.georeference
    builder.text(sheet, "A12", word("geo_centres", language))
    zero = np.zeros(3)
    wall = zero if geo is None else geo.world_from_wall.source_centre
    origin, offset = (zero, zero) if geo is None else (geo.origin, geo.offset)

    def formula(cell: str, name: str, body: str, value: float) -> None:
        builder.formula(sheet, cell, body, float(value), form="0.0000", name=name)

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


def _write_sums(builder: BookBuilder, sums: Mapping[str, float]) -> None:
    """Write the sums the closed forms are made of."""
    sheet = builder.book["Georeference"]

    def product(*pairs: str) -> str:
        return "+".join(f"SUMPRODUCT(tblGeo[c{pair[0]}],tblGeo[c{pair[1]}])" for pair in pairs)

    bodies = {
        "a2": product("XE", "YN"),
        "b2": f"{product('XN')}-{product('YE')}",
        "l2": "SQRT(g_a2^2+g_b2^2)",
        "sq2": product("XX", "YY"),
        "aL": f"{product('XE')}-{product('ZN')}",
        "bL": product("XN", "ZE"),
        "lL": "SQRT(g_aL^2+g_bL^2)",
        "sq3": product("XX", "YY", "ZZ"),
        "cYH": product("YH"),
    }
    for i, (name, body) in enumerate(bodies.items()):
        row, letter = 19 + i % 5, "AC"[i // 5]
        builder.text(sheet, f"{letter}{row}", f"g_{name}", LABEL_FONT)
        value_cell = f"{chr(ord(letter) + 1)}{row}"
        builder.formula(sheet, value_cell, body, sums[name], form="0.000000", name=f"g_{name}")


def planning(builder: BookBuilder, content: SurveyContent) -> None:
    """Write what precision to expect over the frame and where relief cannot be told from zero."""
    language, cells = builder.language, setup_cells(content)
    sheet = builder.sheet("Planning", word("Planning", language), word("type", language))
    width, height = content.sensor or (None, None)
    for row, (key, value) in enumerate((("sensor_w", width), ("sensor_h", height)), start=4):
        builder.text(sheet, f"A{row}", word(key, language))
        builder.input(sheet, f"B{row}", value, form="0.00", name=key)
        validate(sheet, f"B{row}", above_zero=True)
    scale = cells.get("m_1")
    for row, letter, size, value in ((6, "B", "sensor_w", width), (6, "C", "sensor_h", height)):
        covered = value * float(scale) / 1000 if value and scale else None
        builder.formula(
            sheet,
            f"{letter}{row}",
            f'IF(COUNT({size},m_1)=2,{size}*m_1/1000,"")',
            covered,
            form="0.00",
            name=size.replace("sensor", "covered"),
        )
    builder.text(sheet, "A6", word("footprint", language))
    builder.text(sheet, "A7", word("gsd", language))
    pitch = cells.get("pitch")
    gsd = float(pitch) * float(scale) if pitch and scale else None
    builder.formula(
        sheet, "B7", 'IF(COUNT(pitch,m_1)=2,pitch*m_1,"")', gsd, form="0.00", name="gsd_mm"
    )
    diagonal = math.hypot(width, height) if width and height else None
    sigma = cells.get("sigma_s")
    builder.text(sheet, "A9", word("uncertainty", language), HEAD_FONT)
    builder.table(
        sheet,
        "tblPlan",
        UNCERTAINTY,
        at=(11, 1),
        rows=len(PLANNED_RELIEF),
        cells=_uncertainty(content, sigma, scale, diagonal),
    )
    head = 11 + len(PLANNED_RELIEF) + 4
    builder.text(sheet, f"A{head - 2}", word("over_frame", language), HEAD_FONT)
    radii = [None if diagonal is None else share / 200 * diagonal for share in FRAME_SHARES]
    lever = cells.get("b_lever")
    sigmas: list[CellValue] = [
        math.sqrt(2) * float(sigma) * float(lever) / radius if radius and sigma and lever else None
        for radius in radii
    ]
    builder.table(
        sheet,
        "tblFrame",
        OVER_FRAME,
        at=(head, 1),
        rows=len(FRAME_SHARES),
        cells={"share": list(FRAME_SHARES), "s_mm": list(radii), "sigma_r": sigmas},
    )
    sheet.column_dimensions["A"].width = 36
    set_up_print(sheet, language, landscape=False)
    protect(sheet)


def _uncertainty(
    content: SurveyContent, sigma: CellValue, scale: CellValue, diagonal: float | None
) -> dict[str, list[CellValue]]:
    """Return the radii inside which a relief is below twice its standard deviation."""
    cells: dict[str, list[CellValue]] = {"relief_cm": list(PLANNED_RELIEF)}
    if content.distances is None or not sigma:
        return cells
    d1, d2 = content.distances
    radii = [
        ON_PLANE_SIGMAS * math.sqrt(2) * float(sigma) * (d1 - cm / 100) * (d2 - cm / 100)
        / (cm / 100 * abs(d1 - d2))
        for cm in PLANNED_RELIEF
    ]  # fmt: skip
    cells["radius_mm"] = list(radii)
    if scale:
        cells["radius_m"] = [radius * float(scale) / 1000 for radius in radii]
    if diagonal:
        cells["share"] = [200 * radius / diagonal for radius in radii]
    return cells
