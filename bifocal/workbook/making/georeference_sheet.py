"""The sheet `Georeference`: control points, the weighted fit as live formulas, residuals."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from bifocal.survey.reference import Georeference
from bifocal.survey.relief_table import ENTRIES
from bifocal.survey.space_similarity import SpaceSums
from bifocal.survey.weighted_similarity import TURNS, WeightedSums, determinant
from bifocal.workbook.content import SurveyContent, control_cells
from bifocal.workbook.formulas.columns import georeference_columns
from bifocal.workbook.formulas.placed_formulas import entry
from bifocal.workbook.formulas.precision_lines import precision_lines, precision_values
from bifocal.workbook.formulas.space_block import STEP_FORM, SpaceBlock
from photocore.arrays import FloatArray
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.making.live_book import BookBuilder, SheetBuilder
from photocore.workbook.making.look import LABEL_FONT
from photocore.workbook.reading.grid import column_letters

#: Row of the keys of the control points; model and parameters stand above.
CONTROL_HEAD = 12
#: First column and rows of the steps of the fit: above the folded columns of the table.
_LEFT, _TOP, _ROWS = 10, 3, 8
#: Where the residuals stand, and how far right of them the steps go on.
_RESIDUALS, _BESIDE = 40, 4
_UNKNOWNS = ("p", "q", "m")


def georeference(builder: BookBuilder, content: SurveyContent) -> None:
    """Write control points, the closed-form transformation and the residuals."""
    rows = content.control_rows
    sheet = builder.sheet("Georeference", "geo_how")
    _model(sheet, content)
    _transformation(sheet, content)
    _centres(sheet, content)
    _rotation(sheet, content)
    sums = content.georeference.sums if content.georeference is not None else None
    space = SpaceBlock(sheet, sums if isinstance(sums, SpaceSums) else None)
    steps = [*_origin_steps(content), *_solved_steps(content, space), *_sums(content)]
    _write_steps(sheet, [*steps, *_weighted_steps(content, space)])
    cells = control_cells(content)
    columns = georeference_columns(is_pair=content.is_pair)
    sheet.table("tblGeo", columns, at=(CONTROL_HEAD, 1), rows=rows, cells=cells)
    space.finish()
    for letter, width in (("A", 30), ("G", 13), ("H", 13), ("I", 13)):
        sheet.worksheet.column_dimensions[letter].width = width
    repeat = f"{CONTROL_HEAD - 1}:{CONTROL_HEAD}"
    sheet.finish(landscape=True, freeze=f"B{CONTROL_HEAD + 1}", repeat=repeat)


#: Name, formula and value of a step of the fit.
_Step = tuple[str, str, CellValue]


def _write_steps(sheet: SheetBuilder, steps: Sequence[_Step]) -> None:
    """Write the steps of the fit, each beside its name, above the folded columns."""
    for i, (name, body, value) in enumerate(steps):
        row, left = _TOP + i % _ROWS, _LEFT + 2 * (i // _ROWS)
        # Not above the residuals, which are not folded away.
        left += _BESIDE if left >= _RESIDUALS else 0
        sheet.text(f"{column_letters(left)}{row}", name, LABEL_FONT)
        place = f"{column_letters(left + 1)}{row}"
        sheet.formula(place, body, value, form=STEP_FORM, name=name)


def _model(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write which model is asked for, found and used."""
    geo = content.georeference
    for row, key in enumerate(("geo_model", "geo_auto", "geo_used"), start=4):
        sheet.word(f"A{row}", key)
    sheet.input("B4", content.model, name="g_model")
    prompt, choices = sheet.book.word("geo_models"), "auto,levelled,3D,2D"
    sheet.validate("B4", title="g_model", prompt=prompt, choices=choices)
    sheet.input("B5", None if geo is None else geo.model, name="g_auto", editable=False)
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
            f'IF(g_ok=1,1/SQRT(g_p_{TURNS}^2+g_q_{TURNS}^2),"")))',
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


#: Cosines row by row: of the model 2D, of the levelled one.
_COS, _SIN = f"g_p_{TURNS}*g_k", f"g_q_{TURNS}*g_k"
_COSINES = {
    "11": (_COS, _COS), "12": (f"-{_SIN}", "0"), "13": ("0", _SIN),
    "21": (_SIN, _SIN), "22": (_COS, "0"), "23": ("0", f"-{_COS}"),
    "31": ("0", "0"), "32": ("0", "1"), "33": ("1", "0"),
}  # fmt: skip


def _rotation(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write the rotation from the closed forms, or from the turns of the model 3D."""
    geo = content.georeference
    sheet.word("D7", "geo_rotation")
    for key, (plane, levelled) in _COSINES.items():
        i, j = int(key[0]) - 1, int(key[1]) - 1
        entry = None if geo is None else float(geo.world_from_wall.rotation[i, j])
        body = f'IF(g_k="","",IF(g_used="3D",s3_{key},IF(g_used="2D",{plane},{levelled})))'
        sheet.formula(f"{'GHI'[j]}{7 + i}", body, entry, form="0.000000000", name=f"g_{key}")


def _solved_steps(content: SurveyContent, space: SpaceBlock) -> Iterator[_Step]:
    """Yield rotation, scale and constants of the model 3D from its last turn."""
    geo = content.georeference
    found = geo if geo is not None and geo.model == "3D" else None
    scale = None if found is None else found.world_from_wall.scale
    yield "s3_k", _in_space(f"1/SQRT(SUMSQ({space.entries.range})/3)"), scale
    for i, j in np.ndindex(3, 3):
        value = None if found is None else float(found.world_from_wall.rotation[i, j])
        body = f"s3_k*{space.entries.fixed(3 * j + i, 0)}"
        yield f"s3_{i + 1}{j + 1}", _in_space(body), value
    constants = (None, None, None) if found is None else _constants(found)
    for n, (axis, constant) in enumerate(zip("XYZ", constants, strict=True)):
        body = f"g_f_{axis}-SUMPRODUCT({space.shift.column(n)},{space.entries.range})"
        yield f"s3_{axis}", _in_space(body), constant


def _in_space(body: str) -> str:
    return f'IF(g_space=1,{body},"")'


def _origins(geo: Georeference | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the centre on the wall, and the world's in two parts, whole metres and the rest."""
    zero = np.zeros(3)
    if geo is None:
        return zero, zero, zero
    return geo.world_from_wall.source_centre, geo.origin, geo.offset


_MEAN = "IF(g_n=0,0,SUMIF(tblGeo[w],1,tblGeo[{0}])/g_n)"


def _centres(sheet: SheetBuilder, content: SurveyContent) -> None:
    """Write the centres of the control points in both systems."""
    wall, origin, offset = _origins(content.georeference)
    sheet.word("D4", "geo_wall")
    sheet.word("D5", "geo_world")
    for i, (axis, name) in enumerate(zip("XYZ", "ENH", strict=True)):
        body, letter = _MEAN.format(axis), "GHI"[i]
        sheet.formula(f"{letter}4", body, float(wall[i]), form="0.0000", name=f"g_{axis}0")
        body, value = f"g_{name}r+g_{name}t", float(origin[i] + offset[i])
        sheet.formula(f"{letter}5", body, value, form="0.0000", name=f"g_{name}0")


def _origin_steps(content: SurveyContent) -> Iterator[_Step]:
    """Yield the world's centre in two parts, E0 = Er + Et.

    Er is a whole number: differences of large coordinates stay exact.
    """
    _, origin, offset = _origins(content.georeference)
    for i, name in enumerate("ENH"):
        rounded = f"ROUND({_MEAN.format(name)},0)"
        turned = "+".join(f"g_{i + 1}{j}*g_x_{other}" for j, other in enumerate("XYZ", 1))
        rest = f"IF(ISNUMBER(g_k),-g_k*({turned}),0)"
        if name == "H":
            rounded = f'IF(g_used="2D",0,{rounded})'
            rest = f'IF(g_used="2D",IF(ISNUMBER(g_k),g_k*g_Z0,0),{rest})'
        yield f"g_{name}r", rounded, float(origin[i])
        yield f"g_{name}t", rest, float(offset[i])


def _sums(content: SurveyContent) -> Iterator[_Step]:
    """Yield the centred sums the closed forms are made of, with their values."""
    geo = content.georeference
    centred = np.zeros((6, 0))
    if geo is not None:
        world = content.control.xyz[geo.used] - geo.origin
        if geo.model == "2D":
            world[:, 2] = 0.0
        centred = np.hstack([geo.solved[geo.used] - geo.world_from_wall.source_centre, world]).T
    column = dict(zip("XYZENH", centred, strict=True))
    products = {"a2": "XE+YN", "b2": "XN-YE", "aL": "XE-ZN", "bL": "XN+ZE"}
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
    for name in ("a2", "b2", "l2", "aL", "bL", "lL"):
        yield f"g_{name}", bodies[name], values[name]


def _constants(geo: Georeference) -> tuple[float, ...]:
    """Return the wall's coordinates of the world's origin about the wall's centre. [m]"""
    turn = geo.world_from_wall
    return tuple((-(turn.rotation.T @ geo.offset) / turn.scale).tolist())


def _weighted_steps(content: SurveyContent, space: SpaceBlock) -> Iterator[_Step]:
    """Yield the normal equations of the weighted fit, the turns that solve them, and its worth."""
    values = _weighted_values(content.georeference) | precision_values(content.georeference)
    of_all, of_level = _common_lines(), _weighted_lines()
    lines = {
        "g_flat": 'IF(g_used="2D",1,0)',
        "g_ok": 'IF(AND(g_n>=2,g_used<>"3D"),IF(IF(g_flat=1,g_l2,g_lL)>0,1,0),0)',
        "g_space": 'IF(AND(g_n>=3,g_used="3D"),1,0)',
        **{name: f'IF(g_ok+g_space=1,{body},"")' for name, body in of_all.items()},
        **{name: f'IF(g_ok=1,{body},"")' for name, body in of_level.items()},
    }
    for axis in "XYZ":
        terms = "+".join(f"g_F_{axis}{u}*{value}" for u, value in _SOLVED.items())
        lines[f"g_x_{axis}"] = f'IF(g_used="3D",s3_{axis},IF(g_ok=1,g_f_{axis}-({terms}),""))'
    for name, body in precision_lines(space).items():
        lines[name] = f'IF(ISNUMBER(g_k),{body},"")'
    for name, body in lines.items():
        yield name, body, values.get(name)


#: The unknowns as cells: p, q and, the scale of the heights, m.
_SOLVED = {"p": f"g_p_{TURNS}", "q": f"g_q_{TURNS}", "m": "(1/g_k)"}
#: What each unknown is multiplied by on X, Y, Z, as columns of the table with a factor before.
_DESIGN = {
    "p": (("", "cE"), ("g_flat*", "cN"), ("-1*", "cN")),
    "q": (("", "cN"), ("-g_flat*", "cE"), ("", "cE")),
    "m": (None, ("", "cH"), None),
}


def _product(unknown: str, column: str) -> str:
    """Return the sum of a column of the design times columns that end in X, Y, Z."""
    terms = [
        f"{part[0]}SUMPRODUCT(tblGeo[{part[1]}],tblGeo[{column.format(axis)}])"
        for axis, part in zip("XYZ", _DESIGN[unknown], strict=True)
        if part is not None
    ]
    return "+".join(terms)


def _solved(axis: str, right: str) -> str:
    """Return a row of the inverse of the sum of the weights times a vector."""
    return "+".join(f"g_i_{entry(axis, o)}*{right.format(o)}" for o in "XYZ")


def _common_lines() -> dict[str, str]:
    """Return the formulas by name that all models share, each from those before it."""
    lines = {
        f"g_s_{key}": f"IF(AND(g_flat=1,{int(key == 'ZZ')}=1),1,SUM(tblGeo[p_{key}]))"
        for key in ENTRIES
    }
    cofactors = {
        "XX": "g_s_YY*g_s_ZZ-g_s_YZ^2", "XY": "g_s_XZ*g_s_YZ-g_s_XY*g_s_ZZ",
        "YY": "g_s_XX*g_s_ZZ-g_s_XZ^2", "XZ": "g_s_XY*g_s_YZ-g_s_XZ*g_s_YY",
        "YZ": "g_s_XY*g_s_XZ-g_s_XX*g_s_YZ", "ZZ": "g_s_XX*g_s_YY-g_s_XY^2",
    }  # fmt: skip
    lines["g_det"] = "+".join(f"g_s_X{axis}*({cofactors['X' + axis]})" for axis in "XYZ")
    lines |= {f"g_i_{key}": f"({body})/g_det" for key, body in cofactors.items()}
    lines |= {f"g_h_{axis}": f"SUM(tblGeo[h_{axis}])" for axis in "XYZ"}
    lines |= {f"g_f_{axis}": _solved(axis, "g_h_{}") for axis in "XYZ"}
    return lines


def _weighted_lines() -> dict[str, str]:
    """Return the formulas by name of the models 2D and levelled, each from those before it."""
    pairs = [("p", "p"), ("p", "q"), ("p", "m"), ("q", "q"), ("q", "m"), ("m", "m")]
    lines: dict[str, str] = {}
    for axis in "XYZ":
        lines |= {f"g_b_{axis}{u}": f"SUM(tblGeo[u_{axis}{u}])" for u in _UNKNOWNS}
    for axis in "XYZ":
        lines |= {f"g_F_{axis}{u}": _solved(axis, "g_b_{}" + u) for u in _UNKNOWNS}
    for one, other in pairs:
        freed = "+".join(f"g_b_{axis}{one}*g_F_{axis}{other}" for axis in "XYZ")
        lines[f"g_m_{one}{other}"] = f"{_product(one, 'u_{}' + other)}-({freed})"
    for one in _UNKNOWNS:
        freed = "+".join(f"g_b_{axis}{one}*g_f_{axis}" for axis in "XYZ")
        lines[f"g_y_{one}"] = f"{_product(one, 'h_{}')}-({freed})"
    for i in range(1, TURNS + 1):
        lines |= _turn(i)
    return lines


def _turn(i: int) -> dict[str, str]:
    """Return the formulas of one turn: direction, normal matrix of two unknowns, solution."""
    before, c, s = f"g_p_{i - 1}", f"g_c_{i}", f"g_s_{i}"
    length = f"SQRT({before}^2+g_q_{i - 1}^2)"
    start = ("IF(g_flat=1,g_a2/g_l2,g_aL/g_lL)", "IF(g_flat=1,g_b2/g_l2,g_bL/g_lL)")
    n11, n12, n22 = (f"g_n{key}_{i}" for key in ("pp", "pq", "qq"))
    h1, h2 = f"(g_y_p+{c}*g_y_m)", f"(g_y_q+{s}*g_y_m)"
    det = f"({n11}*{n22}-{n12}^2)"
    return {
        c: start[0] if i == 1 else f"{before}/{length}",
        s: start[1] if i == 1 else f"g_q_{i - 1}/{length}",
        n11: f"g_m_pp+2*{c}*g_m_pm+{c}^2*g_m_mm",
        n12: f"g_m_pq+{c}*g_m_qm+{s}*g_m_pm+{c}*{s}*g_m_mm",
        n22: f"g_m_qq+2*{s}*g_m_qm+{s}^2*g_m_mm",
        f"g_p_{i}": f"({h1}*{n22}-{h2}*{n12})/{det}",
        f"g_q_{i}": f"({h2}*{n11}-{h1}*{n12})/{det}",
    }


def _weighted_values(geo: Georeference | None) -> dict[str, CellValue]:
    """Return what the formulas show."""
    values: dict[str, CellValue] = {"g_flat": 0, "g_ok": 0, "g_space": 0}
    if geo is None:
        return values
    values["g_flat"] = int(geo.model == "2D")
    constants = _constants(geo)
    if geo.model == "2D" and geo.sums is not None:
        constants = tuple(geo.sums.constants.tolist())
    values |= {f"g_x_{axis}": value for axis, value in zip("XYZ", constants, strict=True)}
    sums = geo.sums
    if sums is None:
        return values
    values["g_space" if geo.model == "3D" else "g_ok"] = 1
    symmetric: dict[str, FloatArray] = {"g_s_": sums.total, "g_i_": sums.inverse}
    for prefix, matrix in symmetric.items():
        values |= {f"{prefix}{key}": float(matrix[at]) for key, at in ENTRIES.items()}
    values["g_det"] = determinant(sums.total)
    for i, axis in enumerate("XYZ"):
        values |= {f"g_h_{axis}": float(sums.right[i]), f"g_f_{axis}": float(sums.mean[i])}
    return values | _level_values(sums) if isinstance(sums, WeightedSums) else values


def _level_values(sums: WeightedSums) -> dict[str, CellValue]:
    """Return what the formulas of the models 2D and levelled show."""
    values: dict[str, CellValue] = {}
    for i, axis in enumerate("XYZ"):
        values |= {f"g_b_{axis}{u}": float(sums.mixed[i, j]) for j, u in enumerate(_UNKNOWNS)}
        values |= {f"g_F_{axis}{u}": float(sums.shift[i, j]) for j, u in enumerate(_UNKNOWNS)}
        values[f"g_y_{_UNKNOWNS[i]}"] = float(sums.left[i])
    for i, one in enumerate(_UNKNOWNS):
        for j in range(i, 3):
            values[f"g_m_{one}{_UNKNOWNS[j]}"] = float(sums.reduced[i, j])
    for i, turn in enumerate(sums.turns, start=1):
        names = ("g_c_", "g_s_", "g_npp_", "g_npq_", "g_nqq_", "g_p_", "g_q_")
        values |= {f"{name}{i}": float(v) for name, v in zip(names, turn, strict=True)}
    return values
