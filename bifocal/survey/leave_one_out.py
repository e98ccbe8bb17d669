"""What the fit to the control points would be without each of them, without fitting again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.survey.georeferencing import ALPHA_POINT, MODELS
from bifocal.survey.reference import Georeference
from bifocal.survey.weighted_similarity import inverse_symmetric
from photocore.arrays import FloatArray

#: World coordinates carry no more than so many digits: what is below is no contradiction.
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeaveOneOut:
    """What each control point costs the fit; NaN where it takes no part or nothing is left over.

    Attributes
    ----------
    covariance : ndarray, shape (n, 3, 3)
        Of the residuals E, N, H, as the picks let expect; H counts nothing in the model 2D. [m²]
    own, gain : ndarray, shape (n,)
        Share of the weighted sum of squares, and by how much that sum falls without the point.
    spare : int
        Redundancy of the fit without one point.
    size : ndarray, shape (n,)
        Residual in space, to a micrometre. [m]
    sigma0 : ndarray, shape (n,)
        Standard deviation of a coordinate without the point. [m]
    worst : int
        Row of the point that contradicts the others most, -1 where none does.
    """

    covariance: FloatArray
    own: FloatArray
    gain: FloatArray
    spare: int
    size: FloatArray
    sigma0: FloatArray
    worst: int


def leave_one_out(world: Georeference) -> LeaveOneOut:
    r"""Return what the fit to the control points would be without each of them.

    Parameters
    ----------
    world : Georeference
        As found, weighted by the precision of the picks.

    Returns
    -------
    LeaveOneOut
        One row per control point.

    Notes
    -----
    Without point i, of residual v, the weighted sum of squares falls by
    :math:`v' (C_i - A_i K A_i')^{-1} v`, C its covariance and A K A' what the transformation
    adds there: exact in the model 2D, which is linear, and to first order in the others. A point
    contradicts the rest where the F test of `georeference` (0.1 %, shared out over the points)
    says so; of several the one without which the sum falls furthest. ``sigma0`` is that of the
    fit times the root of how much smaller the weighted sum per degree of freedom becomes.
    """
    fit, used, axes = world.world_from_wall, world.used, MODELS[world.model].axes
    left = np.where(used[:, None], world.residuals, np.nan)
    left[:, axes:] = np.where(used[:, None], 0.0, np.nan)
    own, gain = np.full((2, len(used)), np.nan)
    covariance = np.full((len(used), 3, 3), np.nan)
    if world.sums is not None:
        aside = left[used] @ fit.rotation / fit.scale
        own[used] = np.einsum("ni,nij,nj->n", aside, world.sums.weights, aside)
    if world.redundancy > axes and world.covariance is not None and world.precision is not None:
        turn = fit.scale * fit.rotation
        all_of = turn @ world.covariance @ turn.T - world.precision.of_points(world.near)
        covariance[used] = all_of[used]
        if axes == 2:
            covariance[used, 2, :2] = covariance[used, :2, 2] = 0.0
            covariance[used, 2, 2] = 1.0
        gain = np.einsum("ni,nij,nj->n", left, inverse_symmetric(covariance), left)
    # Rounding errors alone tell no point from another.
    size = np.round(np.sqrt((left**2).sum(axis=1)), 6)
    return _judged(world, covariance, own, gain, size)


def _judged(
    world: Georeference, covariance: FloatArray, own: FloatArray, gain: FloatArray, size: FloatArray
) -> LeaveOneOut:
    """Return the rows with their sigma0 and which of them contradicts the others."""
    from scipy.special import fdtrc  # a tenth of a second that only control points need

    axes, squares = MODELS[world.model].axes, float(np.nansum(own))
    spare = world.redundancy - axes
    rest = np.maximum(squares - gain, 1e-12 * squares) / spare if spare > 0 else gain
    with np.errstate(divide="ignore", invalid="ignore"):
        sigma0 = world.sigma0 * np.sqrt(rest / (squares / world.redundancy))
        chance = fdtrc(axes, spare, gain / axes / rest) * int(world.used.sum())
    worst = -1
    if np.isfinite(gain).any() and squares > 0:
        row = int(np.nanargmax(gain))
        noise = ROUNDING * np.nanmax(np.abs(world.near + world.origin))
        if chance[row] < ALPHA_POINT and size[row] > noise:
            worst = row
    return LeaveOneOut(
        covariance=covariance, own=own, gain=gain, spare=spare, size=size,
        sigma0=sigma0 if squares > 0 else np.zeros_like(gain) * gain, worst=worst,
    )  # fmt: skip
