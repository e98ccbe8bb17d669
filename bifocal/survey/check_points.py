"""Errors at check points, their statistics and what drawing scale they hold."""

from __future__ import annotations

import numpy as np

from bifocal.survey.reference import AxisErrors, CheckResult, KnownPoints, NamedPoints
from bifocal.survey.tolerances import RULES, ToleranceRule, judge
from photocore.arrays import FloatArray


def check_points(
    table: NamedPoints, known: KnownPoints, rules: tuple[ToleranceRule, ...] = RULES
) -> CheckResult:
    """Compare solved points with what was measured on site.

    Parameters
    ----------
    table : NamedPoints
        Solved points.
    known : KnownPoints
        Check points; any coordinate may be NaN.
    rules : tuple of ToleranceRule
        Rules for the verdict.

    Returns
    -------
    CheckResult
        RMSE is ``sqrt(sum(error^2)/n)``: no mean is taken off, a bias counts in full.
    """
    solved = known.coordinates_in(table)
    errors = np.where(known.used[:, None], solved - known.xyz, np.nan)
    axes = {name: _statistics(errors[:, i]) for i, name in enumerate("XYZ")}
    accuracy = max((axis.rmse for axis in axes.values() if axis.n), default=float("nan"))
    return CheckResult(
        ids=known.ids,
        solved=solved,
        errors=errors,
        axes=axes,
        verdicts=judge(accuracy, rules) if np.isfinite(accuracy) else (),
        missing=known.missing_in(table),
    )


def _statistics(errors: FloatArray) -> AxisErrors:
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
