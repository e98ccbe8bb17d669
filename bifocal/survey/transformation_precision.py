"""What a roto-translation with scale is worth, and what it adds to the points it places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.survey.weighted_similarity import UNKNOWNS, WeightedFit
from photocore.arrays import FloatArray
from photocore.camera import Similarity, skew


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransformationPrecision:
    """Covariance of a transformation to the world, about a whole-metre origin there.

    A wrong transformation moves a point n metres from the origin by
    ``shift + turn x n + stretch n``, where ``shift = own - shift_rates (turn, stretch)``.

    Attributes
    ----------
    own : ndarray, shape (3, 3)
        Covariance of the part of the shift that is independent of the rest. [m²]
    shift_rates : ndarray, shape (3, 4)
        What turns about E, N, H and the logarithm of the scale shift. [m]
    spread : ndarray, shape (4, 4)
        Covariance of turns [rad²] and logarithm of the scale.
    gain : ndarray, shape (7, k)
        Shift, turn and stretch by each independent error of the photos' orientation.
    """

    own: FloatArray
    shift_rates: FloatArray
    spread: FloatArray
    gain: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """Of shift E, N, H, turns about E, N, H and logarithm of the scale, shape (7, 7)."""
        mixed = -self.shift_rates @ self.spread
        shift = self.own - mixed @ self.shift_rates.T
        return np.block([[shift, mixed], [mixed.T, self.spread]])

    def of_points(self, near: FloatArray) -> FloatArray:
        """Return what it adds to the covariance of points it was not found from, (n, 3, 3). [m²]

        Parameters
        ----------
        near : ndarray, shape (n, 3)
            E, N, H about the origin. [m]
        """
        design = _design(near)
        return np.asarray(design @ self.covariance @ design.transpose(0, 2, 1))

    def moved_by_orientation(self, near: FloatArray) -> FloatArray:
        """Return how the orientation's errors move points through the fit, shape (n, 3, k). [m]"""
        return np.asarray(_design(near) @ self.gain)


def _design(near: FloatArray) -> FloatArray:
    """Return the derivative of points by shift, turns and stretch, shape (n, 3, 7)."""
    design = np.zeros((len(near), 3, 7))
    design[:, :, :3] = np.eye(3)
    # turn x n = -n x turn
    design[:, :, 3:6] = -skew(near)
    design[:, :, 6] = near
    return design


def precision_of(
    model: str,
    fit: Similarity,
    weighted: WeightedFit,
    near: FloatArray,
    effect: FloatArray | None = None,
) -> TransformationPrecision:
    """Return the precision of a fit to control points.

    Parameters
    ----------
    model : str
        ``2D``, ``levelled`` or ``3D``.
    fit : Similarity
        World from wall.
    weighted : WeightedFit
        As found.
    near : ndarray, shape (n, 3)
        E, N, H of the control points about the origin. [m]
    effect : ndarray, shape (n, 3, k), optional
        What independent errors of the photos' orientation move on the wall. [m]

    Notes
    -----
    The inverse of the normal equations at the solution, shifts eliminated first. The errors of the
    photos' orientation are common to all points: what they do to the fit is carried separately,
    because most of it is taken up by the fit itself.
    """
    spread, shift_rates = weighted.spread, weighted.shift_rates
    inverse, weights = weighted.inverse, weighted.weights
    axes: FloatArray = np.eye(4)
    axes[:3, :3] = fit.rotation
    into = axes[:, list(UNKNOWNS[model])]
    to_world = fit.scale * fit.rotation
    gain = np.zeros((7, 0))
    if effect is not None:
        turned = near @ fit.rotation / fit.scale
        slopes = _design(turned)[:, :, 3:][:, :, list(UNKNOWNS[model])]
        pulled = np.einsum("nab,nbk->ak", weights, effect)
        moved = np.einsum("nai,nab,nbk->ik", slopes, weights, effect)
        unknowns = spread @ (moved - shift_rates.T @ pulled)
        gain = np.vstack([to_world @ (inverse @ pulled - shift_rates @ unknowns), into @ unknowns])
    return TransformationPrecision(
        own=to_world @ inverse @ to_world.T,
        shift_rates=to_world @ shift_rates @ into.T,
        spread=into @ spread @ into.T,
        gain=gain,
    )
