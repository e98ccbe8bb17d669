"""Flags of measured points and their limits: one order for pairs, surveys and workbooks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from photocore.arrays import BoolArray, FloatArray

#: Flags from bad to good; a point gets the first that applies.
FLAGS = ("NADIR", "OFF-RADIAL", "CHECK", "UNCERTAIN", "WEAK", "ON-PLANE", "OK")
#: Of these a coordinate is missing, wrong or too uncertain to be held against a check.
UNCOUNTED = FLAGS[:4]
#: Default measuring precision of a careful pick. [px]
SIGMA_PIXEL = 0.5
#: Beyond this share of d2 the standard deviation of r makes a point UNCERTAIN, beyond half WEAK.
UNCERTAIN_SHARE = 0.02
#: A place accepted in doubt may be any on its line: standard deviation of r as a share of d2, where
#: places from half of d2 behind the wall to 0.4 of it before are equally likely.
DOUBTFUL_SHARE = 0.9 / 12**0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class FlagLimits:
    """Where the flags begin.

    Attributes
    ----------
    off_radial : float
        A misfit across the radius beyond this many sigma is a blunder: one honest pick in 2000.
    redundant : float
        The same of three rays and more, of all their misfits together, as for a normal deviate: one
        honest pick in 100. Of 35/28/19 mm at 17.5/14/9.5 m and 0.5 px it notices a slip of 3 px
        along the radius in 61, 95 and 7 % of cases, where a pair notices none.
    on_plane : float
        Relief below this many sigma cannot be told from zero.
    sigma_r_max : float or None
        Points of less precise relief are UNCERTAIN; default 2 % of the near distance. [m]
    """

    off_radial: float = 3.5
    redundant: float = 2.576
    on_plane: float = 2.0
    sigma_r_max: float | None = None

    def relief_limit(self, near_distance: Any) -> Any:
        """Return the standard deviation of r beyond which a point is UNCERTAIN. [m]"""
        return self.sigma_r_max or UNCERTAIN_SHARE * near_distance


def point_flags(
    *,
    at_nadir: BoolArray,
    standardised: FloatArray,
    incomplete: BoolArray,
    relief: FloatArray,
    sigma_r: FloatArray,
    near_distance: float | FloatArray,
    limits: FlagLimits,
    redundant: BoolArray | None = None,
) -> tuple[str, ...]:
    """Return the first flag of `FLAGS` that applies to each point.

    Parameters
    ----------
    at_nadir, incomplete : ndarray of bool, shape (n,)
        Points without a radius; points measured on one photo only, or beyond the horizon.
    standardised : ndarray, shape (n,)
        Misfit across the radius over its standard deviation; NaN where it cannot be tested.
    relief, sigma_r : ndarray, shape (n,)
        Relief and its standard deviation; NaN where the rays do not meet. [m]
    near_distance : float or ndarray
        Of the near camera. [m]
    limits : FlagLimits
        Where the flags begin.
    redundant : ndarray of bool, optional
        Points of three rays or more; by default none.
    """
    limit = limits.relief_limit(near_distance)
    several = np.zeros_like(at_nadir) if redundant is None else redundant
    most = np.where(several, limits.redundant, limits.off_radial)
    with np.errstate(invalid="ignore"):
        conditions = [
            at_nadir,
            np.abs(standardised) > most,
            incomplete,
            ~(sigma_r <= limit) | np.isnan(relief),
            sigma_r > limit / 2,
            np.abs(relief) < limits.on_plane * sigma_r,
        ]
    return tuple(np.select(conditions, FLAGS[:-1], default=FLAGS[-1]).tolist())
