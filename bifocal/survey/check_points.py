"""Errors at check points, their statistics and what drawing scale they hold."""

from __future__ import annotations

import numpy as np

from bifocal.model import UNCOUNTED
from bifocal.survey.reference import AxisErrors, CheckResult, KnownPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.tolerances import RULES, ToleranceRule, judge
from photocore.arrays import FloatArray

#: Standard deviations of X, Y and relief.
SIGMAS = ("sigma_X", "sigma_Y", "sigma_r")


def check_points(
    table: ReliefTable, reference: KnownPoints, rules: tuple[ToleranceRule, ...] = RULES
) -> CheckResult:
    """Compare solved points with what was measured on site.

    Parameters
    ----------
    table : ReliefTable
        Solved points; those flagged as one of `UNCOUNTED` are not counted.
    reference : KnownPoints
        Check points; any coordinate may be NaN.
    rules : tuple of ToleranceRule
        Rules for the verdict.

    Returns
    -------
    CheckResult
        RMSE is ``sqrt(sum(error^2)/n)``: no mean is taken off, a bias counts in full.
    """
    solved = reference.coordinates_in(table)
    rows = reference.rows_in(table)
    flags = np.array([*table.flags, ""])[rows]
    compared = reference.used & ~np.isnan(reference.xyz).all(axis=1)
    flagged = compared & np.isin(flags, UNCOUNTED)
    errors = np.where((reference.used & ~flagged)[:, None], solved - reference.xyz, np.nan)
    sigma = np.stack([table[key] for key in SIGMAS], axis=-1) if len(table) else np.zeros((0, 3))
    axes = {name: statistics(errors[:, i]) for i, name in enumerate("XYZ")}
    accuracy = max((axis.rmse for axis in axes.values() if axis.n), default=float("nan"))
    return CheckResult(
        ids=reference.ids,
        solved=solved,
        errors=errors,
        axes=axes,
        verdicts=judge(accuracy, rules) if np.isfinite(accuracy) else (),
        missing=reference.missing_in(table),
        flagged={reference.ids[row]: str(flags[row]) for row in np.flatnonzero(flagged)},
        standardised=errors / np.vstack([sigma, np.full((1, 3), np.nan)])[rows],
    )


def statistics(errors: FloatArray) -> AxisErrors:
    """Return count, RMSE, mean and largest error."""
    kept = errors[~np.isnan(errors)]
    if not len(kept):
        return AxisErrors(n=0, rmse=np.nan, mean=np.nan, max_abs=np.nan)
    return AxisErrors(
        n=len(kept),
        rmse=float(np.sqrt((kept**2).sum() / len(kept))),
        mean=float(kept.sum() / len(kept)),
        max_abs=float(np.abs(kept).max()),
    )
