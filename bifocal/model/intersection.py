"""The result of intersecting a bifocal pair's rays: points, covariance, misfits, flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photocore.arrays import FloatArray

#: Flags from bad to good; a point gets the first that applies.
FLAGS = ("NADIR", "OFF-RADIAL", "CHECK", "UNCERTAIN", "WEAK", "ON-PLANE", "OK")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Intersection:
    """Points in the plane frame with their precision.

    Attributes
    ----------
    xyz : ndarray, shape (n, 3)
        X, Y on the reference plane and relief r; NaN where the rays do not meet. [m]
    covariance : ndarray, shape (n, 3, 3)
        Covariance of xyz; NaN where xyz is. [m²]
    residuals : ndarray, shape (n, 4)
        Observed minus adjusted column 1, row 1, column 2, row 2. [px]
    misfit : ndarray, shape (n,)
        Distance of the pick in image 2 from the radial line through the pick in image 1. [px]
    standardised : ndarray, shape (n,)
        Misfit over its standard deviation; beyond 3.5 a pick is called a blunder.
    e1, e2 : ndarray, shape (n,)
        Relief displacements on the reference plane, outwards positive. [m]
    flags : tuple of str, length n
        One of `FLAGS` per point.
    sigma_px : float
        Measuring precision per coordinate that the covariance rests on. [px]
    """

    xyz: FloatArray
    covariance: FloatArray
    residuals: FloatArray
    misfit: FloatArray
    standardised: FloatArray
    e1: FloatArray
    e2: FloatArray
    flags: tuple[str, ...]
    sigma_px: float

    def __post_init__(self) -> None:
        for name in ("xyz", "covariance", "residuals", "misfit", "standardised", "e1", "e2"):
            getattr(self, name).setflags(write=False)

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of X, Y and r, shape (n, 3). [m]"""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    def blunders(self, names: Sequence[str]) -> list[str]:
        """Return one sentence for each mispicked point, worst first."""
        bad = [i for i, flag in enumerate(self.flags) if flag == "OFF-RADIAL"]
        bad.sort(key=lambda i: -abs(self.standardised[i]))
        return [
            f"{names[i]}: the two picks miss each other by {abs(self.misfit[i]):.1f} px across the "
            f"radius ({abs(self.standardised[i]):.1f} sigma); measure it again."
            for i in bad
        ]
