"""The table `Results`: what a survey found, on the wall and in the world, all live."""

from __future__ import annotations

from bifocal.workbook.formulas.placed_formulas import (
    IS_CONTROL,
    added_covariance,
    turned_covariance,
)
from photocore.workbook.making.live_columns import LiveColumn, formula_column

_AT = "ROW()-ROW(tblResults[[#Headers],[id]])"


def _cell(key: str) -> str:
    return f"INDEX(tblPoints[{key}],{_AT})"


def _from_points(key: str) -> str:
    return f'IF(ISNUMBER({_cell(key)}),{_cell(key)},"")'


def _text_from_points(key: str) -> str:
    # Fewer rows in Points, where some were deleted, leave the rest of Results blank.
    return f'IF({_AT}>ROWS(tblPoints[id]),"",IF({_cell(key)}="","",{_cell(key)}))'


def _world(row: int, name: str) -> str:
    turned = "+".join(f"g_{row}{i}*([@{axis}]-g_{axis}0)" for i, axis in enumerate("XYZ", start=1))
    return f'IF(AND(ISNUMBER(g_k),COUNT([@X],[@Y],[@Z])=3),g_{name}0+g_k*({turned}),"")'


def _world_sigma(name: str, *, is_pair: bool) -> str:
    """Return the formula of sigma_E, sigma_N or sigma_H: the picks and the transformation."""
    own = f"g_k^2*({turned_covariance(name, name, _cell('cov_{}'))})"
    if is_pair:
        own = f"(g_k*sigma_px)^2*({turned_covariance(name, name, _cell('k_{}'))})"
    near = {axis: _cell(f"n_{axis}") for axis in "ENH"}
    shared = f"AND(g_flat=0,{IS_CONTROL})" if name == "H" else IS_CONTROL
    variance = f"{own}+IF({shared},-1,1)*({added_covariance(name, name, near)})"
    if is_pair:
        common, whole = _cell(f"o_{name}"), turned_covariance(name, name, _cell("o_{}"))
        variance += f"+IF(ISNUMBER({common}),{common}^2,g_k^2*({whole}))"
    known = f"COUNT({near['E']},{_cell('cov_XX')})=2"
    return f'IF({known},SQRT(MAX(0,{variance})),"")'


def results_columns(*, is_pair: bool) -> tuple[LiveColumn, ...]:
    """Return the columns of `Results`.

    Parameters
    ----------
    is_pair : bool
        Whether `Points` keeps the covariances of the picks for one pixel, and apart from them what
        the photos' orientation adds: on the wall, and once placed in the world.
    """
    return (
        formula_column("id", _text_from_points("id"), width=12),
        *(formula_column(key, _from_points(key), 3, width=9) for key in "XYZ"),
        *(
            formula_column(name, _world(row, name), 3, width=10 if name == "H" else 12.5)
            for row, name in enumerate("ENH", start=1)
        ),
        *(
            formula_column(key, _from_points(key), 4 if key != "sigma_r" else 3, width=9)
            for key in ("sigma_X", "sigma_Y", "sigma_r")
        ),
        *(
            formula_column(f"sigma_{name}", _world_sigma(name, is_pair=is_pair), 4, width=9)
            for name in "ENH"
        ),
        formula_column("flag", _text_from_points("flag"), width=13),
        formula_column("note", _text_from_points("note"), width=16),
    )
