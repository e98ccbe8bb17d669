"""Tables of the survey workbook: keys, kinds, number formats and live formulas.

Names never look like cells, so `d_1` and not the paper's `d1`.
"""

from __future__ import annotations

from collections.abc import Collection

from bifocal.model.flags import DOUBTFUL_SHARE, FlagLimits
from bifocal.survey.observations import DOUBT_CODES
from bifocal.workbook.formulas.media_columns import bent_ideal_points, bent_pair_points
from bifocal.workbook.formulas.placed_formulas import (
    IS_CONTROL,
    added_covariance,
    turned_covariance,
)
from photocore.workbook.making.live_columns import LiveColumn, formula_column

_f = formula_column


def _of_r(key: str, formula: str, **more: object) -> LiveColumn:
    """Return a column that is blank where relief is blank."""
    return _f(key, f'IF([@r]="","",{formula})', 4, **more)


_XY = "[@x1],[@y1],[@x2],[@y2]"


def adjustment_names(image: int) -> tuple[str, ...]:
    """Return the names of the nine cells that correct the coordinates of an image, row by row."""
    return tuple(f"a{image}_{row}{column}" for row in "123" for column in "123")


def _millimetres(image: int, *, adjusted: bool) -> tuple[str, str]:
    """Return formulas of x and y in millimetres from the nadir, y up."""
    x, y = (f"([@{axis}{image}]-off_{axis}{image})*unit_{axis}" for axis in "xy")
    if not adjusted:
        return x, y
    rows = [adjustment_names(image)[i : i + 3] for i in (0, 3, 6)]
    above, right, below = (f"({a}*{x}+{b}*{y}+{c})" for a, b, c in rows)
    return f"{above}/{below}", f"{right}/{below}"


def _radius(x: str, y: str, polar: str, factor: str, *, has_xy: bool, has_polar: bool) -> str:
    of_xy, of_polar = f"SQRT(({x})^2+({y})^2){factor}", f"{polar}{factor}"
    if not has_polar:
        return f'IF(COUNT({_XY})=4,{of_xy},"")'
    if not has_xy:
        return f'IF(COUNT([@s1],[@s2])=2,{of_polar},"")'
    return f'IF(COUNT({_XY})=4,{of_xy},IF(AND(COUNT({_XY})=0,COUNT([@s1],[@s2])=2),{of_polar},""))'


def _flag(inputs: str, miss: str) -> str:
    """Return the formula of the flag; its order is that of the library."""
    return (
        f'IF(COUNT({inputs})=0,"",IF([@s1_used]="","CHECK",IF([@den]="","",'
        f'IF([@s1_used]=0,"NADIR",IF({miss},"OFF-RADIAL",IF(ISERROR([@r]),"UNCERTAIN",'
        'IF([@sigma_r]>sigma_r_max,"UNCERTAIN",IF([@sigma_r]>sigma_r_max/2,"WEAK",'
        'IF(ABS([@r])<k_plane*[@sigma_r],"ON-PLANE","OK")))))))))'
    )


_RELIEF = (
    _f("ds", 'IF([@s1_used]="","",[@s2_used]-[@s1_used])', 4),
    _f("den", 'IF(OR([@s1_used]="",COUNT(d_1,d_2)<2),"",[@s2_used]/d_2-[@s1_used]/d_1)', 6),
    _f("r", 'IF([@den]="","",IF(AND([@s1_used]>0,[@den]*(d_1-d_2)>0),[@ds]/[@den],NA()))', 4),
)

#: Entries of the covariance of X, Y, Z.
COVARIANCES = ("XX", "XY", "YY", "XZ", "YZ", "ZZ")


def _of_x(key: str, formula: str, *, folded: bool = True) -> LiveColumn:
    """Return a column that is blank where X is blank."""
    return _f(key, f'IF([@X]="","",{formula})', None if folded else 4, folded=folded)


#: E, N, H from a whole-metre origin: columns that refer to the sheet `Georeference`.
NEAR = ("n_E", "n_N", "n_H", "cov_EN")


def _near(*, is_pair: bool) -> tuple[LiveColumn, ...]:
    """Return the columns of `NEAR`: differences of large coordinates would lose their digits.

    With them the covariance of E and N, for error ellipses.
    """
    columns = []
    for row, key in enumerate(NEAR[:3], start=1):
        turned = "+".join(f"g_{row}{i}*([@{axis}]-g_{axis}0)" for i, axis in enumerate("XYZ", 1))
        body = f"g_{key[-1]}t+g_k*({turned})"
        known = "AND(ISNUMBER(g_k),COUNT([@X],[@Y],[@Z])=3)"
        columns.append(_f(key, f'IF({known},{body},"")', folded=True))
    added = added_covariance("E", "N", {name: f"[@n_{name}]" for name in "ENH"})
    own = f"g_k^2*({turned_covariance('E', 'N', '[@cov_{}]')})"
    common = ""
    if is_pair:
        own = f"(g_k*sigma_px)^2*({turned_covariance('E', 'N', '[@k_{}]')})"
        whole = turned_covariance("E", "N", "[@o_{}]")
        common = f"+IF(ISNUMBER([@o_EN]),[@o_EN],g_k^2*({whole}))"
    both = f"{own}+IF({IS_CONTROL},-1,1)*({added}){common}"
    known = "AND(ISNUMBER([@n_E]),ISNUMBER([@cov_XX]))"
    columns.append(_f(NEAR[3], f'IF({known},{both},"")', folded=True))
    return tuple(columns)


def _sigmas(
    sigma_r: str, covariances: tuple[LiveColumn, ...], *, is_pair: bool
) -> tuple[LiveColumn, ...]:
    """Return the columns of precision, with the covariance of X, Y, Z from the picks."""
    return (
        *covariances,
        _of_x("sigma_X", "SQRT([@cov_XX])", folded=False),
        _of_x("sigma_Y", "SQRT([@cov_YY])", folded=False),
        _of_r("sigma_r", sigma_r),
        *_near(is_pair=is_pair),
    )


#: What the variance of r gains where a pick was accepted in doubt: r is any on the ray of photo 1.
_DOUBT = "+IF(OR({}),({!r}*MIN(d_1,d_2))^2,0)".format(
    ",".join(f'LEFT(UPPER(TRIM([@code])),{len(word)})="{word}"' for word in DOUBT_CODES),
    DOUBTFUL_SHARE,
)


def _ideal_covariances(doubt: str) -> tuple[LiveColumn, ...]:
    """Return variances by each photo, along and across the radius; then those of X, Y, Z."""
    sin, cos = "SIN(RADIANS([@theta_used]))", "COS(RADIANS([@theta_used]))"
    near, far = "([@s2_used]/d_2)", "([@s1_used]/d_1)"
    return (
        _of_x("v_1", "((1-[@r]/d_1)*sigma_s/[@den])^2"),
        _of_x("v_2", f"((1-[@r]/d_2)*k_12*sigma_s/[@den])^2{doubt}"),
        _of_x("v_s", f"([@v_1]*{near}^2+[@v_2]*{far}^2)*(m_1/1000)^2"),
        _of_x("v_t", "((1-[@r]/d_1)*sigma_s*m_1/1000)^2"),
        _of_x("v_sr", f"-([@v_1]*{near}+[@v_2]*{far})*m_1/1000"),
        _of_x("cov_XX", f"[@v_s]*{sin}^2+[@v_t]*{cos}^2"),
        _of_x("cov_XY", f"([@v_s]-[@v_t])*{sin}*{cos}"),
        _of_x("cov_YY", f"[@v_s]*{cos}^2+[@v_t]*{sin}^2"),
        _of_x("cov_XZ", f"[@v_sr]*{sin}"),
        _of_x("cov_YZ", f"[@v_sr]*{cos}"),
        _of_x("cov_ZZ", "[@v_1]+[@v_2]"),
    )


def ideal_points(
    *,
    xy: bool = True,
    polar: bool = True,
    theta: bool = True,
    code: bool = True,
    adjusted: Collection[int] = (),
    media: int = 0,
) -> tuple[LiveColumn, ...]:
    """Return the `Points` table of an ideal pair.

    Parameters
    ----------
    xy, polar, theta, code : bool
        Whether the table has the columns x1 y1 x2 y2, s1 s2, theta, and code; formulas name no
        others.
    adjusted : collection of int
        Images whose coordinates are corrected by the cells a1_11 ..., a2_11 ... of `Setup`.
    media : int
        How many media `Setup` has cells for; 0 in air.
    """
    (x1, y1), (x2, y2) = (_millimetres(image, adjusted=image in adjusted) for image in (1, 2))
    kinds, doubt = {"has_xy": xy, "has_polar": polar}, _DOUBT if code else ""
    measured = ",".join(([_XY] if xy else []) + (["[@s1],[@s2]"] if polar else []))
    of_theta = 'IF(COUNT([@theta])=1,[@theta],"")' if theta else '""'
    if xy:
        of_xy = f"IF([@s1_used]=0,0,DEGREES(ATAN2({y1},{x1})))"
        of_theta = f"IF(COUNT([@x1],[@y1])=2,{of_xy},{of_theta})"
    place = [
        _f(
            axis,
            'IF(OR([@den]="",[@theta_used]="",m_1=""),"",'
            f"[@s_c]*{turn}(RADIANS([@theta_used]))*m_1/1000)",
            4,
        )
        for axis, turn in (("X", "SIN"), ("Y", "COS"))
    ]
    miss = f"(({x1})*({y2})-({y1})*({x2}))*k_12/[@s1_used]"
    off = "ABS(N([@q]))>k_off*sigma_s*SQRT(1+([@s2_used]/[@s1_used])^2)" if xy else "FALSE"
    columns = (
        LiveColumn(key="id", width=12),
        *(LiveColumn(key=key, places=4, width=10.5) for key in ("x1", "y1", "x2", "y2") if xy),
        *(LiveColumn(key=key, places=4, width=11.5) for key in ("s1", "s2") if polar),
        *(
            LiveColumn(key=key, places=4, width=11, limits=(-360, 360))
            for key in ("theta",)
            if theta
        ),
        LiveColumn(key="use", width=9, choices="1,0"),
        LiveColumn(key="code", width=10),
        LiveColumn(key="note", width=18),
        _f("s1_used", _radius(x1, y1, "[@s1]", "", **kinds), 4, folded=True),
        _f("s2_used", _radius(x2, y2, "[@s2]", "*k_12", **kinds), 4, folded=True),
        _f("theta_used", f'IF([@s1_used]="","",{of_theta})', 4, folded=True),
        *_RELIEF,
        _of_r("e1", "[@s1_used]*[@r]/d_1", width=11.5),
        _of_r("e2", "[@s2_used]*[@r]/d_2", width=11.5),
        _of_r("s_c", "[@s1_used]-[@e1]"),
        *place,
        _of_r("Z", "[@r]"),
        *(
            _f("q", f'IF(COUNT({_XY})=4,IF([@s1_used]>0,{miss},0),"")', 5)
            for _ in range(1 if xy else 0)
        ),
        *_sigmas(
            f"SQRT((sigma_s/[@den])^2*((1-[@r]/d_1)^2+(k_12*(1-[@r]/d_2))^2){doubt})",
            _ideal_covariances(doubt),
            is_pair=False,
        ),
        _f("flag", _flag(measured, off), width=13),
    )
    if not media:
        return columns
    typed = {1: (x1, y1, "[@s1]"), 2: (x2, y2, "[@s2]")}
    return bent_ideal_points(
        columns,
        media,
        lambda image, per: _radius(*typed[image], per, has_xy=xy, has_polar=polar),
        doubt,
    )


IDEAL_POINTS = ideal_points()


def _carried_to_the_plane(prefix: str) -> list[LiveColumn]:
    """Return x1, y1, x2, y2: both pixels on the reference plane, from e, at the scale of photo 1.

    Parameters
    ----------
    prefix : str
        Of the headings of the pixels: ``u`` for those freed of lens distortion.
    """
    columns = []
    for image in (1, 2):
        for axis in "xy":
            known, place = _on_the_plane(prefix, image, axis)
            formula = f'IF({known},({place}-e_{axis})*1000/m_1,"")'
            columns.append(_f(f"{axis}{image}", formula, 4))
    return columns


def _on_the_plane(prefix: str, image: int, axis: str) -> tuple[str, str]:
    """Return whether a pixel is known, and where its straight ray meets the plane, as formulas."""
    col, row, h = f"[@{prefix}col{image}]", f"[@{prefix}row{image}]", f"h{image}_"
    line = "xy".index(axis) + 1
    above = f"({h}{line}1*{col}+{h}{line}2*{row}+{h}{line}3)"
    return f"COUNT({col},{row})=2", f"{above}/({h}31*{col}+{h}32*{row}+{h}33)"


def pair_points(*, undistorted: bool, media: int = 0) -> tuple[LiveColumn, ...]:
    """Return the `Points` table of a general pair measured in raw pixels.

    Parameters
    ----------
    undistorted : bool
        Whether the photos have lens distortion, which no formula can take out: the pixels freed of
        it are then written beside the raw ones.
    media : int
        How many media `Setup` has cells for; 0 in air.
    """
    prefix = "u" if undistorted else ""
    moved, own = {}, {}
    for image, axis in ((1, "x"), (1, "y"), (2, "x"), (2, "y")):
        at = f"{axis}{image}"
        moved[at] = f"([@{at}]-[@q]*[@g{image}{axis}])"
        own[at] = f"({moved[at]}-(n{image}_{axis}-e_{axis})*1000/m_1)"

    def radius(image: int, parts: dict[str, str]) -> str:
        return f"SQRT({parts[f'x{image}']}^2+{parts[f'y{image}']}^2)"

    def place(axis: str) -> str:
        return f"e_{axis}+({moved[f'{axis}1']}-{own[f'{axis}1']}*[@r]/d_1)*m_1/1000"

    columns = (
        LiveColumn(key="id", width=12),
        *(LiveColumn(key=key, places=3, width=10.5) for key in ("col1", "row1", "col2", "row2")),
        LiveColumn(key="use", width=9, choices="1,0"),
        LiveColumn(key="code", width=10),
        LiveColumn(key="note", width=18),
        *(
            LiveColumn(key=f"u{key}", kind="value", places=3, folded=True)
            for key in ("col1", "row1", "col2", "row2")
            if undistorted
        ),
        *_carried_to_the_plane(prefix),
        _f(
            "q",
            f"IF(COUNT({_XY})=4,IF([@x1]^2+[@y1]^2>0,"
            '([@x1]*[@y2]-[@y1]*[@x2])/SQRT([@x1]^2+[@y1]^2),0),"")',
            5,
        ),
        *(
            LiveColumn(key=key, kind="value", places=6, folded=True)
            for key in ("g1x", "g1y", "g2x", "g2y", "k_q", "k_w", "k_r", "o_r")
        ),
        *(
            LiveColumn(key=f"{kind}_{key}", kind="value", folded=True)
            for kind in "ko"
            for key in COVARIANCES
        ),
        *(LiveColumn(key=f"o_{name}", kind="value", folded=True) for name in ("E", "N", "H", "EN")),
        _f("s1_used", f'IF([@q]="","",{radius(1, moved)})', 4, folded=True),
        _f("s2_used", f'IF([@q]="","",{radius(2, moved)})', 4, folded=True),
        _f(
            "theta_used",
            f'IF([@q]="","",IF([@s1_used]=0,0,DEGREES(ATAN2({moved["y1"]},{moved["x1"]}))))',
            4,
            folded=True,
        ),
        *_RELIEF,
        _of_r("e1", f"{radius(1, own)}*[@r]/d_1", width=11.5),
        _of_r("e2", f"{radius(2, own)}*[@r]/d_2", width=11.5),
        _of_r("s_c", f"{radius(1, own)}-[@e1]"),
        _of_r("X", place("x")),
        _of_r("Y", place("y")),
        _of_r("Z", "[@r]"),
        *_sigmas(
            "IF(ISNUMBER([@r]),SQRT((sigma_px*[@k_r])^2+N([@o_r])^2),NA())",
            tuple(
                _of_x(
                    f"cov_{key}",
                    f"IF(ISNUMBER([@r]),sigma_px^2*[@k_{key}]+N([@o_{key}]),NA())",
                )
                for key in COVARIANCES
            ),
            is_pair=True,
        ),
        _f(
            "flag",
            # On the wall: q follows an image scale typed later, k_q does not.
            _flag(_XY, "ABS(N([@q]))*m_1/1000>k_off*sigma_px*N([@k_w])").replace(
                "[@s1_used]=0", "[@x1]^2+[@y1]^2=0"
            ),
            width=13,
        ),
    )
    if not media:
        return columns
    return bent_pair_points(columns, media, lambda image, axis: _on_the_plane(prefix, image, axis))


#: Where a point of another table stands in `Points`; the second search finds the number 7 among
#: names kept as text.
_AT = 'IFERROR(MATCH([@id],tblPoints[id],0),MATCH([@id]&"",tblPoints[id],0))'
#: Whether a row of another table is used, here and in `Points`.
USED = (
    'OR([@use]="",[@use]<>0),'
    f'IFERROR(OR(INDEX(tblPoints[use],{_AT})="",INDEX(tblPoints[use],{_AT})<>0),TRUE)'
)


def look_up(axis: str, factor: str = "") -> str:
    """Return the formula that finds a column of `Points` by the name of the point."""
    cell = f"INDEX(tblPoints[{axis}],{_AT})"
    return f'IF([@id]="","",IFERROR(IF(ISNUMBER({cell}),{factor}{cell},""),""))'


CHECK: tuple[LiveColumn, ...] = (
    LiveColumn(key="id", width=12),
    *(LiveColumn(key=f"{axis}_ref", places=4) for axis in "XYZ"),
    LiveColumn(key="use", width=9, choices="1,0"),
    *(_f(axis, look_up(axis), 4, width=8.5) for axis in "XYZ"),
    *(
        _f(
            f"d{axis}",
            f'IF(AND(COUNT([@{axis}],[@{axis}_ref])=2,{USED}),[@{axis}]-[@{axis}_ref],"")',
            4,
            width=8.5,
        )
        for axis in "XYZ"
    ),
)

#: Relief whose area of uncertainty the sheet `Planning` shows. [cm]
PLANNED_RELIEF = (1, 2, 5, 10, 20, 50, 100)
UNCERTAINTY: tuple[LiveColumn, ...] = (
    LiveColumn(key="relief_cm", width=13),
    _f(
        "radius_mm",
        f'IF(COUNT(d_1,d_2)<2,"",{FlagLimits().on_plane:g}*SQRT(2)*sigma_s*(d_1-[@relief_cm]/100)*'
        "(d_2-[@relief_cm]/100)/([@relief_cm]/100*ABS(d_1-d_2)))",
        2,
        width=18,
    ),
    _f("radius_m", 'IF(OR([@radius_mm]="",m_1=""),"",[@radius_mm]*m_1/1000)', 2, width=18),
    _f(
        "share",
        'IF(OR([@radius_mm]="",COUNT(sensor_w,sensor_h)<2),"",'
        "200*[@radius_mm]/SQRT(sensor_w^2+sensor_h^2))",
        0,
        width=18,
    ),
)
FRAME_SHARES = (10, 20, 30, 40, 50, 60, 70, 80, 90, 100)
OVER_FRAME: tuple[LiveColumn, ...] = (
    LiveColumn(key="share", width=13),
    _f(
        "s_mm",
        'IF(COUNT(sensor_w,sensor_h)<2,"",[@share]/200*SQRT(sensor_w^2+sensor_h^2))',
        2,
        width=18,
    ),
    _f(
        "sigma_r",
        'IF(OR([@s_mm]="",COUNT(d_1,d_2)<2),"",SQRT(2)*sigma_s*b_lever/[@s_mm])',
        4,
        width=18,
    ),
)


def verdict_columns(holds: str, fails: str) -> tuple[LiveColumn, ...]:
    """Return the table of verdicts with its two words in the workbook's language."""
    return (
        LiveColumn(key="rule", width=13),
        LiveColumn(key="scale", width=9, form='"1:"0'),
        LiveColumn(key="tolerance", places=1),
        _f(
            "verdict",
            'IF(OR(check_worst="",[@tolerance]=""),"",'
            f'IF(check_worst<=[@tolerance]/1000,"{holds}","{fails}"))',
            width=9,
        ),
    )


LOG: tuple[LiveColumn, ...] = tuple(
    LiveColumn(key=key, kind="value", width=width)
    for key, width in (("time", 11), ("program", 14), ("what", 32), ("file", 24), ("sha256", 66))
)
