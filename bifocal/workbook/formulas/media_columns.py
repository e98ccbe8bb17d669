"""The table `Points` of a pair that looks through media: the bent ray, column by column."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from bifocal.workbook.formulas.media_formulas import arm, bend
from photocore.workbook.making.live_columns import LiveColumn, formula_column

_f = formula_column


def _folded(key: str, formula: str) -> LiveColumn:
    return _f(key, formula, folded=True)


def _of(image: int, key: str, formula: str, needed: str) -> LiveColumn:
    """Return a folded column, blank where what it needs is, or where light is reflected."""
    return _folded(
        f"{key}{image}", f'IFERROR(IF(COUNT({needed})={needed.count("[")},{formula},""),"")'
    )


def bent_ideal_points(
    columns: Sequence[LiveColumn], media: int, radius: Callable[[int, str], str], doubt: str
) -> tuple[LiveColumn, ...]:
    """Return the `Points` table of an ideal pair through media.

    Parameters
    ----------
    columns : sequence of LiveColumn
        Those in air.
    media : int
        How many there are cells for.
    radius : callable
        Image and what follows a radial distance as measured to the formula of that distance.
    doubt : str
        What the variance of r gains where the code says that a pick was accepted in doubt.

    Notes
    -----
    With tan = s / c of the measured ray: a = tan arm, T = tan bend, ``r = (a1 - a2)/(T1 - T2)``,
    both brought to millimetres at the scale of image 1 as in air.
    """
    before = []
    for image in (1, 2):
        tangent = f"[@tan{image}]"
        square = f"{tangent}^2"
        lens = f'IF(COUNT(c_rays_{image})=0,"",{radius(image, f"/c_rays_{image}")})'
        before.append(_folded(f"tan{image}", lens))
        ways = (
            ("arm", arm(image, media, square)),
            ("bend", bend(media, square)),
            ("pace", arm(image, media, square, rate=True)),
            ("turn", bend(media, square, rate=True)),
        )
        before += [_of(image, key, formula, tangent) for key, formula in ways]
    slopes = [_folded(f"t{i}", f'IF([@s1_used]="","",[@tan{i}]*[@bend{i}]*mm_1)') for i in (1, 2)]
    known = "COUNT([@arm1],[@arm2])<2"
    raw1, raw2 = (f"[@tan{i}]*c_rays_{i}" for i in (1, 2))
    by_key = {column.key: column for column in columns}
    own = {
        "s1_used": f'IF({known},"",[@tan1]*[@arm1]*mm_1)',
        "s2_used": f'IF({known},"",[@tan2]*[@arm2]*mm_1)',
        "den": 'IF(OR([@s1_used]="",COUNT(d_1,d_2)<2),"",[@t2]-[@t1])',
        "r": _relief("AND([@s1_used]>0,[@den]<>0)"),
        "e1": 'IF([@r]="","",[@t1]*[@r])',
        "e2": 'IF([@r]="","",[@t2]*[@r])',
        "sigma_r": f'IF([@r]="","",SQRT((sigma_s/[@den])^2*([@g1]^2+[@g2]^2){doubt}))',
        "v_1": _where_x("([@g1]*sigma_s/[@den])^2"),
        "v_2": _where_x(f"([@g2]*sigma_s/[@den])^2{doubt}"),
        "v_s": _where_x("([@v_1]*[@t2]^2+[@v_2]*[@t1]^2)*(m_1/1000)^2"),
        "v_t": _where_x(f"([@s_c]/({raw1})*sigma_s*m_1/1000)^2"),
        "v_sr": _where_x("-([@v_1]*[@t2]+[@v_2]*[@t1])*m_1/1000"),
        "flag": f'IF(COUNT(d_1,d_2)<2,"",{by_key["flag"].formula})',
    }
    moves = [
        _folded(f"g{i}", f'IF([@r]="","",([@pace{i}]-[@r]*[@turn{i}])/c_rays_{i}*mm_1)')
        for i in (1, 2)
    ]
    made = _with(columns, own, before={"s1_used": before}, after={"theta_used": slopes, "r": moves})
    # Across the radius nothing is bent: picks are compared in the image, as in air.
    swapped = {
        ")*k_12/[@s1_used]": f")*k_12/({raw1})",
        "SQRT(1+([@s2_used]/[@s1_used])^2)": f"SQRT(1+({raw2}*k_12/({raw1}))^2)",
    }
    return tuple(_reworded(column, swapped) for column in made)


def _where_x(formula: str) -> str:
    return f'IF([@X]="","",{formula})'


def _relief(known: str) -> str:
    """Return the formula of r; rays that meet before the last interface have none."""
    ratio = "[@ds]/[@den]"
    return f'IF([@den]="","",IF({known},IF({ratio}<=r_top,{ratio},NA()),NA()))'


def _with(
    columns: Sequence[LiveColumn],
    formulas: Mapping[str, str],
    *,
    before: Mapping[str, Sequence[LiveColumn]],
    after: Mapping[str, Sequence[LiveColumn]],
) -> list[LiveColumn]:
    """Return columns with other formulas, and others between them."""
    made: list[LiveColumn] = []
    for column in columns:
        own = column
        if column.key in formulas:
            label = "den_media" if column.key == "den" else ""
            own = replace(column, formula=formulas[column.key], label=label)
        made += [*before.get(column.key, ()), own, *after.get(column.key, ())]
    return made


def _reworded(column: LiveColumn, swapped: Mapping[str, str]) -> LiveColumn:
    """Return a column with parts of its formula exchanged."""
    formula = column.formula
    for old, new in swapped.items():
        formula = formula.replace(old, new)
    return column if formula == column.formula else replace(column, formula=formula)


def bent_pair_points(
    columns: Sequence[LiveColumn], media: int, apparent: Callable[[int, str], tuple[str, str]]
) -> tuple[LiveColumn, ...]:
    """Return the `Points` table of a general pair through media parallel to the reference plane.

    Parameters
    ----------
    columns : sequence of LiveColumn
        Those in air.
    media : int
        How many there are cells for.
    apparent : callable
        Image and axis to two formulas: whether there is a pixel, and where its straight ray meets
        the plane. [m]

    Notes
    -----
    The rays in the object's medium are the lines ``A - r T``; both are known, so r follows from
    ``A2 - A1 = r (T2 - T1)``, taken along its own direction.
    """
    rays, positions, slopes = _bent_rays(media, apparent)
    rate = {axis: f"([@t2{axis}]-[@t1{axis}])" for axis in "xy"}
    gap = {axis: f"([@{axis}2]-[@{axis}1])" for axis in "xy"}
    steep = f"({rate['x']}^2+{rate['y']}^2)"
    miss = f"({rate['x']}*{gap['y']}-{rate['y']}*{gap['x']})/SQRT{steep}"
    moved = {f"{axis}{i}": f"([@{axis}{i}]-[@q]*[@g{i}{axis}])" for i in "12" for axis in "xy"}
    lean = {f"{axis}{i}": f"([@t{i}{axis}]-[@q]*[@u{i}{axis}])" for i in "12" for axis in "xy"}
    own = {k: f"({moved[k]}-(n{k[1]}_{k[0]}-e_{k[0]})*1000/m_1)" for k in moved}
    place = {k: f"({own[k]}-{lean[k]}*[@r])" for k in moved}
    fitted = {axis: f"({lean[f'{axis}2']}-{lean[f'{axis}1']})" for axis in "xy"}
    apart = {axis: f"({moved[f'{axis}2']}-{moved[f'{axis}1']})" for axis in "xy"}

    def length(parts: Mapping[str, str], image: int) -> str:
        return f"SQRT({parts[f'x{image}']}^2+{parts[f'y{image}']}^2)"

    along = f"({apart['x']}*{fitted['x']}+{apart['y']}*{fitted['y']})"
    formulas = {
        "q": f'IF(COUNT([@x1],[@y1],[@x2],[@y2])=4,IF({steep}>0,{miss},0),"")',
        "den": f'IF([@s1_used]="","",SQRT({fitted["x"]}^2+{fitted["y"]}^2))',
        "ds": f'IF([@s1_used]="","",IF([@den]>0,{along}/[@den],0))',
        "r": _relief("[@den]>0"),
        **{f"e{i}": f'IF([@r]="","",{length(own, i)}-{length(place, i)})' for i in (1, 2)},
        "X": f'IF([@r]="","",n1_x+{place["x1"]}*m_1/1000)',
        "Y": f'IF([@r]="","",n1_y+{place["y1"]}*m_1/1000)',
    }
    by_key = {column.key: column for column in columns}
    formulas["s_c"] = f'IF([@r]="","",{length(own, 1)}-[@e1])'
    gains = [
        LiveColumn(key=f"u{i}{axis}", kind="value", places=6, folded=True)
        for i in "12" for axis in "xy"
    ]  # fmt: skip
    kept = [c for c in columns if c.key not in ("x1", "y1", "x2", "y2")]
    exchanged = [replace(by_key[key], formula=formula) for key, formula in positions.items()]
    return tuple(
        _with(
            kept,
            formulas,
            before={"q": [*rays, *exchanged, *slopes]},
            after={"g2y": gains},
        )
    )


def _bent_rays(
    media: int, apparent: Callable[[int, str], tuple[str, str]]
) -> tuple[list[LiveColumn], dict[str, str], list[LiveColumn]]:
    """Return columns of the rays, formulas of x1 ... y2 on the plane, columns of their slopes."""
    rays, positions, slopes = [], {}, []
    for image in (1, 2):
        tangent = {axis: f"[@p{image}{axis}]" for axis in "xy"}
        both = f"{tangent['x']},{tangent['y']}"
        square = f"({tangent['x']}^2+{tangent['y']}^2)"
        for axis in "xy":
            known, where = apparent(image, axis)
            away = f'IF({known},({where}-n{image}_{axis})/d_{image},"")'
            rays.append(_folded(f"p{image}{axis}", away))
        rays.append(_of(image, "arm", arm(image, media, square), both))
        rays.append(_of(image, "bend", bend(media, square), both))
        for axis in "xy":
            on = f"(n{image}_{axis}+{tangent[axis]}*[@arm{image}]-e_{axis})*1000/m_1"
            positions[f"{axis}{image}"] = f'IF(COUNT([@arm{image}])=1,{on},"")'
            leans = f"{tangent[axis]}*[@bend{image}]*1000/m_1"
            slopes.append(_folded(f"t{image}{axis}", f'IF(COUNT([@arm{image}])=1,{leans},"")'))
    return rays, positions, slopes
