"""What a roto-translation with scale is worth, and what it adds to the points it places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bifocal.survey.weighted_similarity import inverse_symmetric
from photocore.arrays import FloatArray
from photocore.rotation import skew
from photocore.similarity import Similarity

#: Which of rotations about the wall's X, Y, Z and logarithm of the scale a model has.
_UNKNOWNS: Mapping[str, tuple[int, ...]] = {"2D": (2, 3), "levelled": (1, 3), "3D": (0, 1, 2, 3)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TransformationPrecision:
    """Covariance of a transformation to the world, about a whole-metre origin there.

    A wrong transformation moves a point n metres from the origin by
    ``shift + turn x n + stretch n``, where ``shift = own - lever (turn, stretch)``.

    Attributes
    ----------
    own : ndarray, shape (3, 3)
        Covariance of the part of the shift that is independent of the rest. [m²]
    lever : ndarray, shape (3, 4)
        What turns about E, N, H and the logarithm of the scale shift. [m]
    spread : ndarray, shape (4, 4)
        Covariance of turns [rad²] and logarithm of the scale.
    gain : ndarray, shape (7, k)
        Shift, turn and stretch by each independent error of the photos' orientation.
    """

    own: FloatArray
    lever: FloatArray
    spread: FloatArray
    gain: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """Of shift E, N, H, turns about E, N, H and logarithm of the scale, shape (7, 7)."""
        mixed = -self.lever @ self.spread
        shift = self.own - mixed @ self.lever.T
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
    weights: FloatArray,
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
    weights : ndarray, shape (n, 3, 3)
        Inverse covariances of the wall's coordinates; zero at Z for the model 2D. [1/m²]
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
    active = list(_UNKNOWNS[model])
    turned = near @ fit.rotation / fit.scale
    slopes = np.concatenate([-skew(turned), turned[:, :, None]], axis=-1)[:, :, active]
    total = weights.sum(axis=0)
    if model == "2D":
        total[2, 2] = 1.0
    inverse = inverse_symmetric(total[None])[0]
    if model == "2D":
        inverse[2, 2] = 0.0
    mixed = (weights @ slopes).sum(axis=0)
    lever = inverse @ mixed
    normal = np.einsum("nai,nab,nbj->ij", slopes, weights, slopes) - mixed.T @ lever
    spread = np.linalg.inv(normal)
    into = np.zeros((4, len(active)))
    axes = np.block([[fit.rotation, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])
    into[active] = np.eye(len(active))
    into = axes @ into
    to_world = fit.scale * fit.rotation
    gain = np.zeros((7, 0))
    if effect is not None:
        pulled = np.einsum("nab,nbk->ak", weights, effect)
        moved = np.einsum("nai,nab,nbk->ik", slopes, weights, effect)
        unknowns = spread @ (moved - lever.T @ pulled)
        shifts = inverse @ pulled - lever @ unknowns
        gain = np.vstack([to_world @ shifts, into @ unknowns])
    return TransformationPrecision(
        own=to_world @ inverse @ to_world.T,
        lever=to_world @ lever @ into.T,
        spread=into @ spread @ into.T,
        gain=gain,
    )
