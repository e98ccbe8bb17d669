"""What a roto-translation with scale is worth, and what it adds to the points it places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bifocal.survey.space_similarity import SpaceSums
from bifocal.survey.weighted_similarity import WeightedSums
from photocore.arrays import FloatArray
from photocore.camera.rotation import skew
from photocore.camera.similarity import Similarity

#: Which of rotations about the wall's X, Y, Z and logarithm of the scale a model has.
_UNKNOWNS: Mapping[str, tuple[int, ...]] = {"2D": (2, 3), "levelled": (1, 3), "3D": (0, 1, 2, 3)}


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
    sums: WeightedSums | SpaceSums,
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
    sums : WeightedSums or SpaceSums
        What it was found from.
    near : ndarray, shape (n, 3)
        E, N, H of the control points about the origin. [m]
    effect : ndarray, shape (n, 3, k), optional
        What independent errors of the photos' orientation move on the wall. [m]

    Notes
    -----
    The inverse of the normal equations at the solution, shifts eliminated first, from the same sums
    as the workbook's formulas: next to the nadir X, Y and relief share nearly all their error, and
    another order of summation would differ in the ninth digit. The errors of the photos'
    orientation are common to all points: what they do to the fit is carried separately, because
    most of it is taken up by the fit itself.
    """
    spread: FloatArray
    shift_rates: FloatArray
    if isinstance(sums, SpaceSums):
        spread, shift_rates = sums.turns[-1].inverse, sums.shift @ sums.turns[-1].design
    else:
        spread, shift_rates = _of_direction(sums)
    inverse = sums.inverse.copy()
    if model == "2D":
        inverse[2, 2] = 0.0
    axes: FloatArray = np.eye(4)
    axes[:3, :3] = fit.rotation
    into = axes[:, list(_UNKNOWNS[model])]
    to_world = fit.scale * fit.rotation
    gain = np.zeros((7, 0))
    if effect is not None:
        turned = near @ fit.rotation / fit.scale
        slopes = _design(turned)[:, :, 3:][:, :, list(_UNKNOWNS[model])]
        pulled = np.einsum("nab,nbk->ak", sums.weights, effect)
        moved = np.einsum("nai,nab,nbk->ik", slopes, sums.weights, effect)
        unknowns = spread @ (moved - shift_rates.T @ pulled)
        gain = np.vstack([to_world @ (inverse @ pulled - shift_rates @ unknowns), into @ unknowns])
    return TransformationPrecision(
        own=to_world @ inverse @ to_world.T,
        shift_rates=to_world @ shift_rates @ into.T,
        spread=into @ spread @ into.T,
        gain=gain,
    )


def _of_direction(sums: WeightedSums) -> tuple[FloatArray, FloatArray]:
    """Return covariance and shift_rates of the turn in plan and the logarithm of the scale.

    A small turn w and stretch k change ``p = m cos, q = m sin`` by ``w q + k p`` and
    ``-w p + k q``.
    """
    pp, pq, qq, p, q = sums.turns[-1, 2:]
    below = (pp * qq - pq**2) * (p**2 + q**2) ** 2
    turn = (q**2 * qq + 2 * p * q * pq + p**2 * pp) / below
    both = (p * q * qq - (q**2 - p**2) * pq - p * q * pp) / below
    stretch = (p**2 * qq - 2 * p * q * pq + q**2 * pp) / below
    shift_rates = np.stack(
        [sums.shift[:, 0] * q - sums.shift[:, 1] * p, sums.mean - sums.constants], axis=-1
    )
    return np.array([[turn, both], [both, stretch]]), shift_rates
