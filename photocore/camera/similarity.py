"""Roto-translation with scale between two sets of common points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_points, read_only
from photocore.errors import GeometryError, InputError
from photocore.remarks import remark


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Similarity:
    """target = target_centre + scale * rotation @ (source - source_centre).

    Kept about the centres, so that coordinates of the size of UTM lose no digits.

    Attributes
    ----------
    scale : float
        Above zero.
    rotation : ndarray, shape (3, 3)
        Proper rotation.
    source_centre, target_centre : ndarray, shape (3,)
        Means of the points the transformation was found from.
    """

    scale: float
    rotation: FloatArray
    source_centre: FloatArray
    target_centre: FloatArray

    def __post_init__(self) -> None:
        shapes = {"rotation": (3, 3), "source_centre": (3,), "target_centre": (3,)}
        for name, shape in shapes.items():
            object.__setattr__(self, name, read_only(getattr(self, name), name, shape=shape))

    def __call__(self, points: ArrayLike) -> FloatArray:
        """Return source points in the target frame, shape (..., 3)."""
        offset = as_points(points, "points", dimension=3) - self.source_centre
        return self.target_centre + self.scale * (offset @ self.rotation.T)

    def inverse(self) -> Similarity:
        """Return the transformation from target to source."""
        return Similarity(
            scale=1.0 / self.scale,
            rotation=self.rotation.T,
            source_centre=self.target_centre,
            target_centre=self.source_centre,
        )


def fit_similarity(source: ArrayLike, target: ArrayLike) -> Similarity:
    """Return the least-squares similarity of 7 parameters (3 rotations, 3 shifts, scale).

    Parameters
    ----------
    source, target : array_like, shape (n, 3)
        The same points in both frames, three or more not on one line.

    Raises
    ------
    GeometryError
        If there are fewer than three points or they lie on one line.

    Notes
    -----
    Closed form by singular values of the cross-covariance; S. Umeyama, "Least-squares estimation of
    transformation parameters between two point patterns", IEEE PAMI 13(4), 1991. With the
    residuals measured in the target frame it is the least-squares solution, mirror images excluded.

    Examples
    --------
    >>> wall = [[0, 0, 0], [4, 0, 0], [0, 3, 0], [0, 0, 1]]
    >>> world = [[10, 20, 5], [10, 28, 5], [10, 20, 11], [12, 20, 5]]
    >>> round(fit_similarity(wall, world).scale, 12)
    2.0
    """
    first, second, p, q = _centred(source, target, needed=3)
    spread = np.linalg.svd(p, compute_uv=False)
    if spread[1] <= 1e-9 * spread[0]:
        raise GeometryError(remark("similarity.one_line"))
    left, values, right = np.linalg.svd(q.T @ p)
    # The sign keeps a proper rotation where noise (or points in one plane) would allow a mirror.
    signs = np.array([1.0, 1.0, np.sign(np.linalg.det(left) * np.linalg.det(right)) or 1.0])
    rotation = (left * signs) @ right
    scale = float((values * signs).sum() / (p**2).sum())
    return Similarity(scale=scale, rotation=rotation, source_centre=first, target_centre=second)


def fit_levelled(source: ArrayLike, target: ArrayLike) -> Similarity:
    """Return the least-squares similarity of a wall whose Y is upright: 5 parameters.

    Parameters
    ----------
    source : array_like, shape (n, 3)
        X right, Y up, Z towards the viewer. [m]
    target : array_like, shape (n, 3)
        E, N, H of the same points. [m]

    Raises
    ------
    GeometryError
        If there are fewer than two points, or all are one above the other.

    Notes
    -----
    With centred sums A = sum(X E) - sum(Z N), B = sum(X N) + sum(Z E), C = sum(Y H) and
    D = sum(X^2 + Y^2 + Z^2): rotation in plan ``atan2(B, A)``, scale ``(sqrt(A^2 + B^2) + C)/D``;
    E = k (X cos + Z sin), N = k (X sin - Z cos), H = k Y, all about the centres.
    """
    first, second, p, q = _centred(source, target, needed=2)
    a = (p[:, 0] * q[:, 0]).sum() - (p[:, 2] * q[:, 1]).sum()
    b = (p[:, 0] * q[:, 1]).sum() + (p[:, 2] * q[:, 0]).sum()
    total = (p**2).sum()
    if np.hypot(a, b) <= 1e-12 * total or total == 0:
        raise GeometryError(remark("similarity.one_above_other"))
    length = np.sqrt(a**2 + b**2)
    scale = float((length + (p[:, 1] * q[:, 2]).sum()) / total)
    if scale <= 0:
        raise GeometryError(remark("similarity.upside_down"))
    cos, sin = a / length, b / length
    rotation = np.array([[cos, 0.0, sin], [sin, 0.0, -cos], [0.0, 1.0, 0.0]])
    return Similarity(scale=scale, rotation=rotation, source_centre=first, target_centre=second)


def fit_plane(source: ArrayLike, target: ArrayLike) -> Similarity:
    """Return the least-squares plane similarity X, Y -> E, N: 4 parameters; Z is only scaled.

    Parameters
    ----------
    source, target : array_like, shape (n, 3)
        The same points in both frames; the third coordinate plays no part.

    Raises
    ------
    GeometryError
        If there are fewer than two points, or all coincide.
    """
    first, second, p, q = _centred(source, target, needed=2)
    a = (p[:, :2] * q[:, :2]).sum()
    b = (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()
    total = (p[:, :2] ** 2).sum()
    length = np.sqrt(a**2 + b**2)
    if total == 0 or length <= 1e-12 * total:
        raise GeometryError("the control points coincide: give two or more apart from each other.")
    cos, sin = a / length, b / length
    scale = float(length / total)
    second = np.array([second[0], second[1], scale * first[2]])
    return Similarity(
        scale=scale,
        rotation=np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]),
        source_centre=first,
        target_centre=second,
    )


def _centred(
    source: ArrayLike, target: ArrayLike, *, needed: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return both centres and the points about them."""
    first = as_points(source, "source", dimension=3)
    second = as_points(target, "target", dimension=3)
    if first.shape != second.shape or first.ndim != 2:
        raise InputError(remark("similarity.shapes", shape=first.shape, other=second.shape))
    if len(first) < needed:
        raise GeometryError(
            f"{len(first)} control point{'s' * (len(first) != 1)}: at least {needed} are needed, "
            "with coordinates in both systems."
        )
    centre = first.mean(axis=0)
    # Means are taken about a round origin: coordinates of the size of UTM lose no digits.
    origin = round_origin(second)
    near = second - origin
    offset = near.mean(axis=0)
    return centre, origin + offset, first - centre, near - offset


def round_origin(points: FloatArray) -> FloatArray:
    """Return the mean of points rounded to whole units, halves away from zero, shape (3,).

    Examples
    --------
    >>> round_origin(np.array([[351234.2, -0.7, 0.0], [351234.8, -0.3, 0.2]])).tolist()
    [351235.0, -1.0, 0.0]
    """
    mean = points.mean(axis=0)
    return np.asarray(np.copysign(np.floor(np.abs(mean) + 0.5), mean) + 0.0)
