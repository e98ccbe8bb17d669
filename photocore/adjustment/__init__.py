"""The one adjustment: Levenberg-Marquardt with its precision; dense, or with points eliminated."""

from photocore.adjustment.blocks import BlockEquations
from photocore.adjustment.dense import DenseEquations
from photocore.adjustment.iteration import Fit, correlations, fit, minimise
from photocore.adjustment.outliers import (
    OUTLIER_DISTANCE,
    OUTLIER_LIMIT,
    huber_weights,
    outlier_limit,
    standardised,
)

__all__ = [
    "OUTLIER_DISTANCE",
    "OUTLIER_LIMIT",
    "BlockEquations",
    "DenseEquations",
    "Fit",
    "correlations",
    "fit",
    "huber_weights",
    "minimise",
    "outlier_limit",
    "standardised",
]
