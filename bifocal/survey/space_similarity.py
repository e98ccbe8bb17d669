"""Weighted roto-translation with scale of seven parameters, as the workbook's formulas do it.

``x = c + B w`` with ``B = m R'``: the wall's coordinates x of a control point w about a whole-metre
origin. All the points say of it stands in sums; every turn of Gauss-Newton then only multiplies
matrices of nine rows, XE XN XH YE YN YH ZE ZN ZH, the entries of B.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.remarks import remark
from bifocal.survey.weighted_similarity import inverse_symmetric
from photocore.arrays import FloatArray
from photocore.camera.rotation import skew
from photocore.camera.similarity import Similarity
from photocore.errors import GeometryError

#: Turns of Gauss-Newton: from the unweighted fit five reach rounding on walls that lean or lie.
SPACE_STEPS = 6
#: Squarings of Horn's matrix: its first eigenvector then counts 1024 times its own share.
SQUARINGS = 10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpaceStep:
    """One turn of Gauss-Newton on rotation vector and logarithm of the scale.

    Attributes
    ----------
    entries, halfway : ndarray, shape (9,)
        B before the turn, and ``B + a x B`` with a half the rotation vector.
    design, product : ndarray, shape (9, 4)
        Derivative of B by the four unknowns, and the reduced sums times it.
    normal, inverse : ndarray, shape (4, 4)
    right, step : ndarray, shape (4,)
    """

    entries: FloatArray
    halfway: FloatArray
    design: FloatArray
    product: FloatArray
    normal: FloatArray
    inverse: FloatArray
    right: FloatArray
    step: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpaceSums:
    """What the weighted fit of the model 3D is made of.

    Attributes
    ----------
    weights : ndarray, shape (n, 3, 3)
        Inverse covariances. [1/m²]
    total, inverse : ndarray, shape (3, 3)
        Sum of the weights and its inverse.
    mixed, shift : ndarray, shape (3, 9)
        Sum of weights times world coordinates, and ``inverse @ mixed``.
    right, mean : ndarray, shape (3,)
        Sum of weights times wall coordinates, and ``inverse @ right``.
    reduced : ndarray, shape (9, 9)
        Normal matrix of B, freed of the shifts.
    left : ndarray, shape (9,)
        Right-hand side of B, freed of the shifts.
    crossed : ndarray, shape (9,)
        Sums of wall times world coordinates, unweighted.
    squares : float
        Sum of the squares of the wall's coordinates. [m²]
    powers : tuple of ndarray, shape (4, 4)
        Horn's matrix, made positive, and its squares, each of trace 1.
    start : ndarray, shape (9,)
        R' of the unweighted fit.
    turns : tuple of SpaceStep
    entries : ndarray, shape (9,)
        B as found.
    """

    weights: FloatArray
    total: FloatArray
    inverse: FloatArray
    mixed: FloatArray
    shift: FloatArray
    right: FloatArray
    mean: FloatArray
    reduced: FloatArray
    left: FloatArray
    crossed: FloatArray
    squares: float
    powers: tuple[FloatArray, ...]
    start: FloatArray
    turns: tuple[SpaceStep, ...]
    entries: FloatArray

    @property
    def constants(self) -> FloatArray:
        """The wall's coordinates of the world's origin about the wall's centre, shape (3,). [m]"""
        return np.asarray(self.mean - self.shift @ self.entries)


def space_sums(wall: FloatArray, weights: FloatArray, near: FloatArray) -> SpaceSums:
    """Return the solution of the model 3D.

    Parameters
    ----------
    wall : ndarray, shape (n, 3)
        X, Y, Z about their mean. [m]
    weights : ndarray, shape (n, 3, 3)
        Inverse covariances. [1/m²]
    near : ndarray, shape (n, 3)
        E, N, H about a whole-metre origin. [m]

    Raises
    ------
    GeometryError
        If the points do not determine it.

    Notes
    -----
    The unweighted rotation it starts from is the first eigenvector of the 4 x 4 matrix of
    B. K. P. Horn, "Closed-form solution of absolute orientation using unit quaternions", JOSA A
    4(4), 1987, found by squaring the matrix.
    """
    total = weights.sum(axis=0)
    inverse = inverse_symmetric(total[None])[0]
    mixed = np.einsum("nab,nk->abk", weights, near).reshape(3, 9)
    right = np.einsum("nab,nb->a", weights, wall)
    shift, mean = inverse @ mixed, inverse @ right
    normal = np.einsum("nab,nk,nl->akbl", weights, near, near).reshape(9, 9)
    target = np.einsum("nab,nb,nk->ak", weights, wall, near).reshape(9)
    reduced, left = normal - mixed.T @ shift, target - mixed.T @ mean
    crossed, squares = (wall.T @ near).reshape(9), float((wall**2).sum())
    powers = _powers(crossed.reshape(3, 3))
    start = _rotation_of_power(powers[-1]).T.reshape(9)
    turns, entries = _turns(reduced, left, start * (squares / float(start @ crossed)))
    return SpaceSums(
        weights=weights, total=total, inverse=inverse, mixed=mixed, shift=shift, right=right,
        mean=mean, reduced=reduced, left=left, crossed=crossed, squares=squares, powers=powers,
        start=start, turns=turns, entries=entries,
    )  # fmt: skip


def _powers(crossed: FloatArray) -> tuple[FloatArray, ...]:
    """Return Horn's matrix with no negative eigenvalue, then its squares, each of trace 1."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = crossed
    matrix = np.array([
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, yy - xx - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, zz - xx - yy],
    ])  # fmt: skip
    # No eigenvalue is larger than the sum of the singular values of the 3 x 3 matrix.
    bound = np.sqrt(3.0 * (crossed**2).sum())
    powers = [matrix + bound * np.eye(4)]
    for _ in range(SQUARINGS):
        powers.append(powers[-1] @ powers[-1] / (powers[-1] ** 2).sum())
    return tuple(powers)


def _rotation_of_power(power: FloatArray) -> FloatArray:
    """Return the rotation of the quaternion in the longest column of a power, shape (3, 3)."""
    column = power[:, int(np.argmax(np.diag(power)))]
    a, b, c, d = column / np.sqrt((column**2).sum())
    return np.array([
        [a**2 + b**2 - c**2 - d**2, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a**2 - b**2 + c**2 - d**2, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a**2 - b**2 - c**2 + d**2],
    ])  # fmt: skip


def _turns(
    reduced: FloatArray, left: FloatArray, entries: FloatArray
) -> tuple[tuple[SpaceStep, ...], FloatArray]:
    """Return every turn of Gauss-Newton and the entries that the last one leads to."""
    turns = []
    for _ in range(SPACE_STEPS):
        matrix = entries.reshape(3, 3)
        # d(R B) = omega x B, column by column; the scale multiplies all.
        design = np.stack(
            [*((skew(axis) @ matrix).reshape(9) for axis in np.eye(3)), entries], axis=-1
        )
        product = reduced @ design
        normal = design.T @ product
        right = design.T @ left - design.T @ product[:, 3]
        try:
            inverse = np.linalg.inv(normal)
        except np.linalg.LinAlgError:
            inverse = np.full((4, 4), np.nan)
        step = inverse @ right
        if not np.isfinite(step).all():
            raise GeometryError(remark("survey.no_rotation"))
        half = skew(step[:3] / 2)
        halfway = matrix + half @ matrix
        turns.append(
            SpaceStep(
                entries=entries, halfway=halfway.reshape(9), design=design, product=product,
                normal=normal, inverse=inverse, right=right, step=step,
            )
        )  # fmt: skip
        # Cayley's rotation: exact, and to second order that of the rotation vector.
        turned = matrix + 2 / (1 + (step[:3] ** 2).sum() / 4) * half @ halfway
        entries = (np.exp(step[3]) * turned).reshape(9)
    return tuple(turns), entries


def fit_of_space(
    sums: SpaceSums, centre: FloatArray, origin: FloatArray
) -> tuple[Similarity, FloatArray]:
    """Return the transformation, and where the wall's centre lies from the origin, shape (3,)."""
    matrix = sums.entries.reshape(3, 3)
    scale = 1.0 / np.sqrt((matrix**2).sum() / 3.0)
    rotation = scale * matrix.T
    offset = -scale * rotation @ sums.constants
    similarity = Similarity(
        scale=float(scale), rotation=rotation, source_centre=centre, target_centre=origin + offset
    )
    return similarity, offset
