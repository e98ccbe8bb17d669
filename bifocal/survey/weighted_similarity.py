"""Roto-translation with scale from points whose coordinates are not equally good.

Control points are taken as exact, the wall's coordinates as measured with a covariance each:
``x = c + B w`` with ``B = R' / m`` for a control point w about a whole-metre origin. In the wall's
own frame the covariance does not turn with the unknowns: all that the points say stands in sums of
the nine entries of B, and a turn of Gauss-Newton only multiplies small matrices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import Similarity, skew
from photocore.errors import GeometryError

#: Turns of Gauss-Newton: from the unweighted fit five reach rounding, also on walls that lean or
#: lie. A sheet has as many for them: where control contradicts itself both stop alike.
TURNS = 6
#: Which of rotations about the wall's X, Y, Z and logarithm of the scale a model has.
UNKNOWNS: Mapping[str, tuple[int, ...]] = {"2D": (2, 3), "levelled": (1, 3), "3D": (0, 1, 2, 3)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WeightedFit:
    """A weighted fit of the wall to control points, k of turns and logarithm of the scale unknown.

    Attributes
    ----------
    weights : ndarray, shape (n, 3, 3)
        Inverse covariances; without relief for the model 2D. [1/m²]
    inverse : ndarray, shape (3, 3)
        Covariance of the shift alone; of X and Y in the model 2D. [m²]
    spread : ndarray, shape (k, k)
        Covariance of the unknowns, shifts eliminated.
    shift_rates : ndarray, shape (3, k)
        What the unknowns shift on the wall. [m]
    rotation, scale : ndarray of shape (3, 3), float
        World from wall.
    offset : ndarray, shape (3,)
        Where the wall's centre lies from the world's origin. [m]
    """

    weights: FloatArray
    inverse: FloatArray
    spread: FloatArray
    shift_rates: FloatArray
    rotation: FloatArray
    scale: float
    offset: FloatArray

    def similarity(self, centre: FloatArray, origin: FloatArray) -> Similarity:
        """Return the transformation about a wall's centre and the world's origin, shape (3,)."""
        return Similarity(
            scale=self.scale, rotation=self.rotation, source_centre=centre,
            target_centre=origin + self.offset,
        )  # fmt: skip


def weights_of(covariance: FloatArray, *, flat: bool) -> FloatArray:
    """Return the inverse covariances, shape (n, 3, 3); of X and Y alone where ``flat``."""
    if not flat:
        return inverse_symmetric(covariance)
    a, b, d = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    weights = np.zeros_like(covariance)
    weights[:, 0, 0], weights[:, 1, 1] = d, a
    weights[:, 0, 1] = weights[:, 1, 0] = -b
    return weights / (a * d - b * b)[:, None, None]


def inverse_symmetric(matrices: FloatArray) -> FloatArray:
    """Return inverses of symmetric 3x3 matrices by cofactors, shape (n, 3, 3)."""
    a, b, c = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 0, 2]
    d, e, f = matrices[:, 1, 1], matrices[:, 1, 2], matrices[:, 2, 2]
    xx, xy, xz = d * f - e * e, c * e - b * f, b * e - c * d
    yy, yz, zz = a * f - c * c, b * c - a * e, a * d - b * b
    rows = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / (a * xx + b * xy + c * xz)
    return np.moveaxis(rows, (0, 1), (-2, -1))


def weighted_fit(
    wall: FloatArray, weights: FloatArray, near: FloatArray, start: Similarity, *, model: str
) -> WeightedFit:
    """Return the solution of a model.

    Parameters
    ----------
    wall : ndarray, shape (n, 3)
        X, Y, Z about the centre of ``start``. [m]
    weights : ndarray, shape (n, 3, 3)
        From `weights_of`. [1/m²]
    near : ndarray, shape (n, 3)
        E, N, H about a whole-metre origin; H is 0 in the model 2D. [m]
    start : Similarity
        The unweighted fit.
    model : str
        ``2D``, ``levelled`` or ``3D``.

    Raises
    ------
    GeometryError
        If the points do not determine it.
    """
    flat, unknowns = model == "2D", list(UNKNOWNS[model])
    total = weights.sum(axis=0)
    if flat:
        total[2, 2] = 1.0
    inverse = inverse_symmetric(total[None])[0]
    mixed = np.einsum("nab,nk->abk", weights, near).reshape(3, 9)
    shift, mean = inverse @ mixed, inverse @ np.einsum("nab,nb->a", weights, wall)
    normal = np.einsum("nab,nk,nl->akbl", weights, near, near).reshape(9, 9)
    target = np.einsum("nab,nb,nk->ak", weights, wall, near).reshape(9)
    reduced, right = normal - mixed.T @ shift, target - mixed.T @ mean
    entries = (start.rotation.T / start.scale).reshape(9)
    for _ in range(TURNS):
        # d(R B) = omega x B, column by column; the scale multiplies all.
        matrix = entries.reshape(3, 3)
        turns = [(skew(axis) @ matrix).reshape(9) for axis in np.eye(3)]
        design = np.stack([*turns, entries], axis=-1)[:, unknowns]
        spread = _inverse(design.T @ reduced @ design)
        step = np.zeros(4)
        step[unknowns] = spread @ (design.T @ (right - reduced @ entries))
        # Cayley's rotation: exact, and to second order that of the rotation vector.
        half = skew(step[:3] / 2)
        grown = 2 / (1 + (step[:3] ** 2).sum() / 4) * half @ (matrix + half @ matrix)
        entries = (np.exp(step[3]) * (matrix + grown)).reshape(9)
    matrix = entries.reshape(3, 3)
    scale = float(1.0 / np.cbrt(abs(np.linalg.det(matrix))))
    offset = -(scale**2) * matrix.T @ (mean - shift @ entries)
    if flat:
        offset[2] = scale * start.source_centre[2]
        inverse[2, 2] = 0.0
    return WeightedFit(
        weights=weights, inverse=inverse, spread=spread, shift_rates=shift @ design,
        rotation=scale * matrix.T, scale=scale, offset=np.asarray(offset),
    )  # fmt: skip


def _inverse(normal: FloatArray) -> FloatArray:
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        inverse = np.full_like(normal, np.nan)
    if not np.isfinite(inverse).all():
        raise GeometryError(remark("survey.no_rotation"))
    return inverse
