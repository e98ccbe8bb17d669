"""What the cells of the transformation show: the head of its sheet, the steps of the fit."""

from __future__ import annotations

import math

import numpy as np

from bifocal.survey.leave_one_out import leave_one_out
from bifocal.survey.reference import Georeference
from bifocal.survey.relief_table import ENTRIES
from bifocal.survey.weighted_similarity import WeightedSums, determinant
from bifocal.workbook.formulas.placed_formulas import SMALL
from photocore.arrays import FloatArray
from photocore.workbook.changing.cells import CellValue

_UNKNOWNS = ("p", "q", "m")
_Values = dict[str, CellValue]


def _entries(prefix: str, rows: str, columns: str, matrix: FloatArray) -> _Values:
    """Return the entries of a matrix by the names of their cells."""
    return {
        f"{prefix}{row}{column}": float(matrix[i, j])
        for i, row in enumerate(rows)
        for j, column in enumerate(columns)
    }


def georeference_values(geo: Georeference | None, model: str) -> dict[str, CellValue]:
    """Return the values by the names of their cells.

    Parameters
    ----------
    geo : Georeference or None
        What was found; None without control points.
    model : str
        What was asked for.
    """
    values: _Values = dict.fromkeys(("g_n", "g_flat", "g_ok", "g_space"), 0)
    values |= dict.fromkeys(("g_a2", "g_b2", "g_l2", "g_aL", "g_bL", "g_lL"), 0.0)
    values |= {f"g_{axis}{kind}": 0.0 for axis in "XYZENH" for kind in "0rt"}
    values["g_used"] = "levelled" if model == "auto" else model
    if geo is None:
        return values
    fit = geo.world_from_wall
    values |= {
        "g_used": geo.model,
        "g_n": int(geo.used.sum()),
        "g_k": fit.scale,
        "g_sigma0": None if math.isnan(geo.sigma0) else geo.sigma0,
        "g_alpha": math.degrees(math.atan2(fit.rotation[1, 0], fit.rotation[0, 0])),
        "g_flat": int(geo.model == "2D"),
        **_entries("g_", "123", "123", fit.rotation),
        **_closed_sums(geo),
    }
    # The wall's coordinates of the world's origin about the wall's centre. [m]
    constants: FloatArray = -(fit.rotation.T @ geo.offset) / fit.scale
    if geo.model == "3D":
        values |= {"s3_k": fit.scale, **_entries("s3_", "123", "123", fit.rotation)}
        values |= {f"s3_{axis}": float(constants[i]) for i, axis in enumerate("XYZ")}
    if geo.model == "2D" and geo.sums is not None:
        constants = geo.sums.constants
    for i, (axis, name) in enumerate(zip("XYZ", "ENH", strict=True)):
        values |= {
            f"g_{axis}0": float(fit.source_centre[i]),
            f"g_{name}0": float(geo.origin[i] + geo.offset[i]),
            f"g_{name}r": float(geo.origin[i]),
            f"g_{name}t": float(geo.offset[i]),
            f"g_x_{axis}": float(constants[i]),
        }
    left_out = leave_one_out(geo)
    values |= {"g_squares": float(np.nansum(left_out.own)), "g_spare": left_out.spare}
    return values | _weighted_values(geo) | precision_values(geo)


def _closed_sums(geo: Georeference) -> _Values:
    """Return the centred sums that the closed forms are made of."""
    x, y, z = (geo.solved[geo.used] - geo.world_from_wall.source_centre).T
    east, north, _ = geo.near[geo.used].T
    xe, xn, ye, yn, ze, zn = (
        float((own * world).sum()) for own in (x, y, z) for world in (east, north)
    )
    sums = {"2": (xe + yn, xn - ye), "L": (xe - zn, xn + ze)}
    return {
        f"g_{name}{kind}": value
        for kind, (a, b) in sums.items()
        for name, value in (("a", a), ("b", b), ("l", math.hypot(a, b)))
    }


def _weighted_values(geo: Georeference) -> _Values:
    """Return the normal equations of the weighted fit and the turns that solve them."""
    sums = geo.sums
    if sums is None:
        return {}
    values: _Values = {"g_space" if geo.model == "3D" else "g_ok": 1}
    for key, at in ENTRIES.items():
        values |= {f"g_s_{key}": float(sums.total[at]), f"g_i_{key}": float(sums.inverse[at])}
    values["g_det"] = determinant(sums.total)
    for i, axis in enumerate("XYZ"):
        values |= {f"g_h_{axis}": float(sums.right[i]), f"g_f_{axis}": float(sums.mean[i])}
    if not isinstance(sums, WeightedSums):
        return values
    values |= _entries("g_b_", "XYZ", "pqm", sums.mixed)
    values |= _entries("g_F_", "XYZ", "pqm", sums.shift)
    values |= _entries("g_m_", "pqm", "pqm", sums.reduced)
    values |= {f"g_y_{unknown}": float(sums.left[i]) for i, unknown in enumerate(_UNKNOWNS)}
    for i, turn in enumerate(sums.turns, start=1):
        names = ("g_c_", "g_s_", "g_npp_", "g_npq_", "g_nqq_", "g_p_", "g_q_")
        values |= {f"{name}{i}": float(v) for name, v in zip(names, turn, strict=True)}
    return values


def precision_values(geo: Georeference | None) -> dict[str, CellValue]:
    """Return what the transformation is worth.

    ``g_w_`` is the covariance of turns and stretch, ``g_v_`` what they shift, ``g_u_`` their
    product, ``g_z_`` the variance of the shift: see `TransformationPrecision`.
    """
    if geo is None or geo.precision is None:
        return {}
    found, fit = geo.precision, geo.world_from_wall
    values = _entries("g_w_", SMALL, SMALL, found.spread)
    values |= _entries("g_t_", "XYZ", SMALL, fit.rotation.T @ found.shift_rates / fit.scale)
    values |= _entries("g_v_", "ENH", SMALL, found.shift_rates)
    values |= _entries("g_u_", "ENH", SMALL, found.shift_rates @ found.spread)
    values |= {f"g_z_{name}": float(found.covariance[i, i]) for i, name in enumerate("ENH")}
    mixed = {"EN": (0, 1), "EH": (0, 2), "NH": (1, 2)}
    return values | {f"g_z_{pair}": float(found.covariance[at]) for pair, at in mixed.items()}
