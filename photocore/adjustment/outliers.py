"""The one policy for gross errors: data snooping, and Huber's weights where asked for."""

from __future__ import annotations

import numpy as np

from photocore.arrays import FloatArray

#: A residual beyond this many of its own standard deviations is a gross error (1 honest in 2000).
OUTLIER_LIMIT = 3.5
#: The same chance for the length of a residual in the plane, of unit variance either way:
#: sqrt(-2 ln 0.000465).
OUTLIER_DISTANCE = 3.917
#: Chance that of all honest residuals that are tested together one is called a gross error.
FALSE_ALARM = 0.05
#: Observations with a smaller redundancy number are not controlled: their residual says nothing.
CONTROLLED = 1e-9


def standardised(
    residuals: FloatArray | float, redundancy_numbers: FloatArray, sigma0: float = 1.0
) -> FloatArray:
    """Return weighted residuals over their own standard deviations (Baarda's data snooping).

    Parameters
    ----------
    residuals, redundancy_numbers : ndarray, shape (...)
        Of observations of weight one.
    sigma0 : float
        Standard deviation of unit weight.

    Returns
    -------
    ndarray, shape (...)
        NaN where nothing controls an observation.

    Examples
    --------
    >>> standardised(np.array([2.0, 2.0]), np.array([0.25, 0.0])).tolist()
    [4.0, nan]
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        controlled = np.where(redundancy_numbers > CONTROLLED, redundancy_numbers, np.nan)
        return residuals / (sigma0 * np.sqrt(controlled))


def outlier_limit(count: int) -> float:
    """Return the limit for the largest of so many standardised residuals, `OUTLIER_LIMIT` at least.

    Among many honest ones some pass any fixed limit: a hundred of 350 000 are beyond 3.5. With
    this one all of them together raise a false alarm in one of twenty adjustments (Bonferroni).

    Examples
    --------
    >>> outlier_limit(50), round(outlier_limit(350_000), 2)
    (3.5, 5.26)
    """
    from scipy.special import ndtri

    return max(OUTLIER_LIMIT, -float(ndtri(FALSE_ALARM / 2 / max(count, 1))))


def huber_weights(residuals: FloatArray, bound: float) -> FloatArray:
    """Return Huber's weights: 1 up to ``bound`` robust standard deviations, bound / size beyond.

    The robust standard deviation is the median of the sizes over 0.6745, that of a normal
    distribution.

    Examples
    --------
    >>> huber_weights(np.array([-0.6745, 0.6745, 0.6745, 6.745]), 2.0).round(3).tolist()
    [1.0, 1.0, 1.0, 0.297]
    """
    size = np.abs(residuals)
    spread = max(float(np.median(size)) / 0.6745, 1e-300)
    return np.minimum(1.0, bound * spread / np.maximum(size, 1e-300))


def robust_sigma(values: FloatArray) -> float:
    """Return 1.4826 times the median absolute value: the sigma of the honest majority."""
    finite = np.abs(values[np.isfinite(values)])
    return float(1.4826 * np.median(finite)) if len(finite) else np.inf
