"""What the transformation is worth, as formulas: of its parameters, and of a point it places."""

from __future__ import annotations

import numpy as np

from bifocal.survey.reference import Georeference
from bifocal.survey.weighted_similarity import TURNS
from bifocal.workbook.formulas.placed_formulas import SMALL, entry, ordered
from bifocal.workbook.formulas.space_block import SpaceBlock
from photocore.workbook.changing.cells import CellValue

_PAIRS = tuple(one + other for i, one in enumerate(SMALL) for other in SMALL[i:])


def precision_lines(space: SpaceBlock) -> dict[str, str]:
    """Return the formulas by name, each from those before it.

    ``g_w_`` is the covariance of turns and stretch, ``g_v_`` what they shift, ``g_u_`` their
    product, ``g_z_`` the variance of the shift: see `TransformationPrecision`.
    """
    lines = {f"g_w_{key}": _spread(key, space) for key in _PAIRS}
    p, q, last = f"g_p_{TURNS}", f"g_q_{TURNS}", space.design
    for axis, shift in zip("XYZ", (space.shift.column(n) for n in range(3)), strict=True):
        slopes = [f"SUMPRODUCT({shift},{last.column(n)})" for n in range(3)]
        for i, name in enumerate("ENH", start=1):
            general = "+".join(f"g_{i}{j}*{slope}" for j, slope in enumerate(slopes, start=1))
            levelled = f"g_F_{axis}p*{q}-g_F_{axis}q*{p}" if name == "H" else "0"
            lines[f"g_t_{axis}{name}"] = f"IF(g_space=1,{general},{levelled})"
        general = f"SUMPRODUCT({shift},{last.column(3)})"
        lines[f"g_t_{axis}K"] = f"IF(g_space=1,{general},g_f_{axis}-g_x_{axis})"
    for i, name in enumerate("ENH", start=1):
        for small in SMALL:
            turned = "+".join(f"g_{i}{j}*g_t_{axis}{small}" for j, axis in enumerate("XYZ", 1))
            lines[f"g_v_{name}{small}"] = f"g_k*({turned})"
    for name in "ENH":
        for small in SMALL:
            terms = (f"g_v_{name}{other}*g_w_{ordered(other, small)}" for other in SMALL)
            lines[f"g_u_{name}{small}"] = "+".join(terms)
    for i, name in enumerate("ENH", start=1):
        own = "+".join(
            f"g_{i}{j}*g_{i}{k}*g_i_{entry(one, other)}"
            for j, one in enumerate("XYZ", start=1)
            for k, other in enumerate("XYZ", start=1)
        )
        own = f"IF(g_flat=1,0,g_k^2*({own}))" if name == "H" else f"g_k^2*({own})"
        carried = "+".join(f"g_v_{name}{small}*g_u_{name}{small}" for small in SMALL)
        lines[f"g_z_{name}"] = f"{own}+{carried}"
    own = "+".join(
        f"g_1{j}*g_2{k}*g_i_{entry(one, other)}"
        for j, one in enumerate("XYZ", start=1)
        for k, other in enumerate("XYZ", start=1)
    )
    carried = "+".join(f"g_v_E{small}*g_u_N{small}" for small in SMALL)
    lines["g_z_EN"] = f"g_k^2*({own})+{carried}"
    return lines


def _spread(key: str, space: SpaceBlock) -> str:
    """Return the formula of an entry of the covariance of turns and stretch."""
    found = space.inverse
    rows = [[f"g_{SMALL.index(small) + 1}{j}" for j in "123"] for small in key if small != "K"]
    if key == "KK":
        general = found.fixed(3, 3)
    elif key.endswith("K"):
        general = "+".join(f"{cell}*{found.fixed(j, 3)}" for j, cell in enumerate(rows[0]))
    else:
        general = "+".join(
            f"{one}*{other}*{found.fixed(i, j)}"
            for i, one in enumerate(rows[0])
            for j, other in enumerate(rows[1])
        )
    p, q, pp, pq, qq = (f"g_{name}_{TURNS}" for name in ("p", "q", "npp", "npq", "nqq"))
    below = f"(({pp}*{qq}-{pq}^2)*({p}^2+{q}^2)^2)"
    levelled = {
        "HH": f"({q}^2*{qq}+2*{p}*{q}*{pq}+{p}^2*{pp})/{below}",
        "HK": f"({p}*{q}*{qq}-({q}^2-{p}^2)*{pq}-{p}*{q}*{pp})/{below}",
        "KK": f"({p}^2*{qq}-2*{p}*{q}*{pq}+{q}^2*{pp})/{below}",
    }.get(key, "0")
    return f"IF(g_space=1,{general},{levelled})"


def precision_values(geo: Georeference | None) -> dict[str, CellValue]:
    """Return what the formulas show."""
    if geo is None or geo.precision is None:
        return {}
    found, fit = geo.precision, geo.world_from_wall
    carried = found.shift_rates @ found.spread
    variances = np.diag(found.covariance)
    on_wall = fit.rotation.T @ found.shift_rates / fit.scale
    values = {"g_z_EN": float(found.covariance[0, 1])}
    for i, one in enumerate(SMALL):
        for j in range(i, 4):
            values[f"g_w_{one}{SMALL[j]}"] = float(found.spread[i, j])
    for i, (axis, name) in enumerate(zip("XYZ", "ENH", strict=True)):
        for j, small in enumerate(SMALL):
            values[f"g_t_{axis}{small}"] = float(on_wall[i, j])
            values[f"g_v_{name}{small}"] = float(found.shift_rates[i, j])
            values[f"g_u_{name}{small}"] = float(carried[i, j])
        values[f"g_z_{name}"] = float(variances[i])
    return dict(values)
