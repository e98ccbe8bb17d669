"""The table of control points: names, looked-up coordinates, weights, residuals, all live."""

from __future__ import annotations

from bifocal.workbook.formulas.columns import COVARIANCES, USED, look_up
from photocore.workbook.making.live_columns import LiveColumn, formula_column

#: Entries of the weights and, after them, what each of the unknowns p, q, m is multiplied by on
#: X, Y, Z; g_flat is 1 for the model 2D, where weights at Z are 0.
_DESIGN = {
    "p": ("[@cE]", "g_flat*[@cN]", "-[@cN]"),
    "q": ("[@cN]", "-g_flat*[@cE]", "[@cE]"),
    "m": ("0", "[@cH]", "0"),
}
_COFACTORS = {
    "XX": "[@q_YY]*[@q_ZZ]-[@q_YZ]^2",
    "XY": "[@q_XZ]*[@q_YZ]-[@q_XY]*[@q_ZZ]",
    "YY": "[@q_XX]*[@q_ZZ]-[@q_XZ]^2",
    "XZ": "[@q_XY]*[@q_YZ]-[@q_XZ]*[@q_YY]",
    "YZ": "[@q_XY]*[@q_XZ]-[@q_XX]*[@q_YZ]",
    "ZZ": "[@q_XX]*[@q_YY]-[@q_XY]^2",
}
_FLAT = {"XX": "[@q_YY]", "XY": "-[@q_XY]", "YY": "[@q_XX]"}


def entry(one: str, other: str) -> str:
    """Return the name of an entry of a symmetric matrix, whichever way round."""
    return min(one, other) + max(one, other)


def _folded(key: str, formula: str) -> LiveColumn:
    return formula_column(key, formula, folded=True, spare=0)


def _weight(key: str) -> LiveColumn:
    det = "+".join(f"[@q_X{axis}]*({_COFACTORS[entry('X', axis)]})" for axis in "XYZ")
    flat = f"({_FLAT[key]})/([@q_XX]*[@q_YY]-[@q_XY]^2)" if key in _FLAT else "0"
    body = f'IF(g_used="2D",{flat},({_COFACTORS[key]})/({det}))'
    return _folded(f"p_{key}", f"IF([@w]=1,{body},0)")


def _weighted(axis: str, parts: tuple[str, str, str]) -> str:
    """Return the row of the weights of an axis times a column of the design."""
    terms = (
        f"[@p_{entry(axis, other)}]*({part})"
        for other, part in zip("XYZ", parts, strict=True)
        if part != "0"
    )
    return "+".join(terms)


WEIGHTS: tuple[LiveColumn, ...] = (
    *(_weight(key) for key in COVARIANCES),
    *(
        _folded(f"u_{axis}{unknown}", _weighted(axis, parts))
        for unknown, parts in _DESIGN.items()
        for axis in "XYZ"
    ),
    *(_folded(f"h_{axis}", _weighted(axis, ("[@cX]", "[@cY]", "[@cZ]"))) for axis in "XYZ"),
)

_NAMED: tuple[LiveColumn, ...] = (
    LiveColumn(key="id", width=12),
    *(LiveColumn(key=axis, places=4, width=13, limits=(-1e8, 1e8)) for axis in "ENH"),
    LiveColumn(key="use", width=9, choices="1,0"),
    LiveColumn(key="found_bad", kind="value", width=10),
    *(formula_column(axis, look_up(axis), 4) for axis in "XYZ"),
)

_WEIGHED: tuple[LiveColumn, ...] = (
    formula_column(
        "w",
        f'IF(AND({USED},OR([@found_bad]="",[@found_bad]<>0),'
        "COUNT([@X],[@Y],[@Z],[@E],[@N])=5,"
        "COUNT([@q_XX],[@q_XY],[@q_YY],[@q_XZ],[@q_YZ],[@q_ZZ])=6,"
        'OR(g_used="2D",COUNT([@H])=1)),1,0)',
        width=7,
        folded=True,
        spare=0,
    ),
    # From a whole-metre origin: exact, whatever the size of the coordinates.
    *(
        formula_column(
            f"c{axis}", f"IF({used},[@{axis}]-g_{axis}{origin},0)", 4, folded=True, spare=0
        )
        for axes, origin, used in (
            ("XYZ", "0", "[@w]=1"),
            ("EN", "r", "[@w]=1"),
            ("H", "r", 'AND([@w]=1,g_used<>"2D")'),
        )
        for axis in axes
    ),
    *WEIGHTS,
    *(
        formula_column(
            f"v{name}",
            f"IF(AND(ISNUMBER(g_k),COUNT([@X],[@Y],[@Z],[@{name}])=4),"
            f"([@{name}]-g_{name}r)-(g_{name}t+g_k*("
            + "+".join(f"g_{row}{i}*([@{axis}]-g_{axis}0)" for i, axis in enumerate("XYZ", 1))
            + ')),"")',
            4,
        )
        for row, name in enumerate("ENH", start=1)
    ),
)


def georeference_columns(*, is_pair: bool) -> tuple[LiveColumn, ...]:
    """Return the table of control points.

    Parameters
    ----------
    is_pair : bool
        Whether `Points` keeps the covariances of the picks for one pixel, apart from what the
        photos' orientation is worth, which weighs nothing here.
    """
    kept, factor = ("k_", "sigma_px^2*") if is_pair else ("cov_", "")
    covariances = (
        formula_column(f"q_{key}", look_up(kept + key, factor), folded=True) for key in COVARIANCES
    )
    return (*_NAMED, *covariances, *_WEIGHED)
