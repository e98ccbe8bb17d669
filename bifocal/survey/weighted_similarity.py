"""Roto-translation with scale from points whose coordinates are not equally good.

Control points are taken as exact, the wall's coordinates as measured with a covariance each:
``x = c + s R' w`` for a control point w about a whole-metre origin. In the wall's own frame the
covariance does not turn with the unknowns, and with ``p = s cos``, ``q = s sin`` the equations are
linear but for the scale m of the heights. The workbook's formulas do the same, cell by cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera.similarity import Similarity
from photocore.errors import GeometryError

#: Turns of the direction, each some 1e-3 as far as the one before: six reach rounding.
TURNS = 6
#: Design of (p, q, m) on X, Y, Z: which of E, N, H, with which sign; 0 where absent.
_DESIGNS = {
    "levelled": ((("E", 1), (None, 0), ("N", -1)), (("N", 1), (None, 0), ("E", 1)),
                 ((None, 0), ("H", 1), (None, 0))),
    "2D": ((("E", 1), ("N", 1), (None, 0)), (("N", 1), ("E", -1), (None, 0)),
           ((None, 0), (None, 0), (None, 0))),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WeightedSums:
    """The normal equations of a weighted fit of the models 2D and levelled.

    Attributes
    ----------
    weights : ndarray, shape (n, 3, 3)
        Inverse covariances; without relief for the model 2D. [1/m²]
    design : ndarray, shape (n, 3, 3)
        Columns p, q, m of the equations of each point. [m]
    total, inverse : ndarray, shape (3, 3)
        Sum of the weights and its inverse; both 1 at Z for the model 2D.
    mixed, shift : ndarray, shape (3, 3)
        Sum of weights times design, and ``inverse @ mixed``.
    right, mean : ndarray, shape (3,)
        Sum of weights times coordinates, and ``inverse @ right``.
    reduced : ndarray, shape (3, 3)
        Normal matrix of p, q, m, freed of the shifts.
    left : ndarray, shape (3,)
        Right-hand side of p, q, m, freed of the shifts.
    turns : ndarray, shape (TURNS, 7)
        Cosine and sine of the direction, the three entries of the normal matrix, and p, q.
    """

    weights: FloatArray
    design: FloatArray
    total: FloatArray
    inverse: FloatArray
    mixed: FloatArray
    shift: FloatArray
    right: FloatArray
    mean: FloatArray
    reduced: FloatArray
    left: FloatArray
    turns: FloatArray

    @property
    def unknowns(self) -> FloatArray:
        """p, q and the scale m of the last turn, shape (3,)."""
        p, q = self.turns[-1, 5:]
        return np.array([p, q, np.sqrt(p**2 + q**2)])

    @property
    def constants(self) -> FloatArray:
        """The wall's coordinates of the world's origin about the wall's centre, shape (3,). [m]"""
        return np.asarray(self.mean - self.shift @ self.unknowns)


def inverse_symmetric(matrices: FloatArray) -> FloatArray:
    """Return inverses of symmetric 3x3 matrices by cofactors, shape (n, 3, 3)."""
    a, b, c = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 0, 2]
    d, e, f = matrices[:, 1, 1], matrices[:, 1, 2], matrices[:, 2, 2]
    xx, xy, xz = d * f - e * e, c * e - b * f, b * e - c * d
    yy, yz, zz = a * f - c * c, b * c - a * e, a * d - b * b
    rows = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) / (a * xx + b * xy + c * xz)
    return np.moveaxis(rows, (0, 1), (-2, -1))


def determinant(matrix: FloatArray) -> float:
    """Return the determinant of a symmetric 3x3 matrix by cofactors, as `inverse_symmetric`."""
    (a, b, c), (_, d, e), (_, _, f) = matrix
    return float(a * (d * f - e * e) + b * (c * e - b * f) + c * (b * e - c * d))


def weights_of(covariance: FloatArray, *, flat: bool) -> FloatArray:
    """Return the inverse covariances, shape (n, 3, 3); of X and Y alone where ``flat``."""
    if flat:
        a, b, d = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
        weights = np.zeros_like(covariance)
        weights[:, 0, 0], weights[:, 1, 1] = d, a
        weights[:, 0, 1] = weights[:, 1, 0] = -b
        return weights / (a * d - b * b)[:, None, None]
    return inverse_symmetric(covariance)


def weighted_sums(
    wall: FloatArray, weights: FloatArray, near: FloatArray, start: Similarity, *, model: str
) -> WeightedSums:
    """Return the solution of the models 2D and levelled.

    Parameters
    ----------
    wall : ndarray, shape (n, 3)
        X, Y, Z about their mean. [m]
    weights : ndarray, shape (n, 3, 3)
        From `weights_of`. [1/m²]
    near : ndarray, shape (n, 3)
        E, N, H about a whole-metre origin. [m]
    start : Similarity
        The unweighted fit, whose direction the first turn starts from.
    model : str
        ``2D`` or ``levelled``.
    """
    world = dict(zip("ENH", near.T, strict=True))
    design = np.zeros((len(wall), 3, 3))
    for column, parts in enumerate(_DESIGNS[model]):
        for axis, (name, sign) in enumerate(parts):
            if name is not None:
                design[:, axis, column] = sign * world[name]
    weighted = weights @ design
    total, right = weights.sum(axis=0), (weights @ wall[:, :, None]).sum(axis=0)[:, 0]
    if model == "2D":
        total[2, 2] = 1.0
    inverse = inverse_symmetric(total[None])[0]
    mixed = weighted.sum(axis=0)
    shift, mean = inverse @ mixed, inverse @ right
    normal = np.einsum("nki,nkj->ij", design, weighted)
    target = np.einsum("nk,nki->i", wall, weighted)
    reduced, left = normal - mixed.T @ shift, target - mixed.T @ mean
    return WeightedSums(
        weights=weights, design=design, total=total, inverse=inverse, mixed=mixed, shift=shift,
        right=right, mean=mean, reduced=reduced, left=left,
        turns=_turns(reduced, left, start.rotation[:2, 0]),
    )  # fmt: skip


def _turns(reduced: FloatArray, left: FloatArray, direction: FloatArray) -> FloatArray:
    """Return every turn: m is p c + q s in the direction of the turn before."""
    rows = []
    for _ in range(TURNS):
        c, s = direction
        n11 = reduced[0, 0] + 2 * c * reduced[0, 2] + c**2 * reduced[2, 2]
        n12 = reduced[0, 1] + c * reduced[1, 2] + s * reduced[0, 2] + c * s * reduced[2, 2]
        n22 = reduced[1, 1] + 2 * s * reduced[1, 2] + s**2 * reduced[2, 2]
        h1, h2 = left[0] + c * left[2], left[1] + s * left[2]
        det = n11 * n22 - n12**2
        p, q = (h1 * n22 - h2 * n12) / det, (h2 * n11 - h1 * n12) / det
        rows.append((c, s, n11, n12, n22, p, q))
        length = np.sqrt(p**2 + q**2)
        if not length > 0:
            raise GeometryError(remark("survey.no_direction"))
        direction = np.array([p, q]) / length
    return np.array(rows)


def fit_of_sums(
    sums: WeightedSums, centre: FloatArray, origin: FloatArray, *, model: str
) -> tuple[Similarity, FloatArray]:
    """Return the transformation, and where the wall's centre lies from the origin, shape (3,)."""
    p, q, inverse_scale = sums.unknowns
    cos, sin = p / inverse_scale, q / inverse_scale
    rotation = np.array([[cos, 0.0, sin], [sin, 0.0, -cos], [0.0, 1.0, 0.0]])
    if model == "2D":
        rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    scale = 1.0 / inverse_scale
    offset = -scale * rotation @ sums.constants
    if model == "2D":
        offset[2] = scale * centre[2]
    similarity = Similarity(
        scale=float(scale), rotation=rotation, source_centre=centre, target_centre=origin + offset
    )
    return similarity, offset
