"""Rotations from the angles omega, phi, kappa, and small rotation vectors."""

from __future__ import annotations

from math import hypot, sin

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import FloatArray, as_floats, read_only
from photocore.errors import GeometryError
from photocore.remarks import remark

#: The matrices of e_k x v, for the three axes e_k: shape (3, 3, 3).
AXES_CROSS = np.array(
    [[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]],
     [[0, -1, 0], [1, 0, 0], [0, 0, 0]]], dtype=np.float64,
)  # fmt: skip


def world_from_camera(omega: float, phi: float, kappa: float) -> FloatArray:
    r"""Rotation matrix of a camera, its columns being the camera's axes in the world.

    Parameters
    ----------
    omega, phi, kappa : float
        Rotations about the X, the once rotated Y and the twice rotated Z axis. [rad]

    Returns
    -------
    ndarray, shape (3, 3)
        :math:`R = R_x(\omega) R_y(\phi) R_z(\kappa)`; a point P is at
        :math:`R^T (P - X_0)` in the camera frame, whose z axis points backwards.

    Examples
    --------
    A quarter turn about Z: the camera's x axis is the world's Y axis.

    >>> world_from_camera(0.0, 0.0, np.pi / 2).round(9)[:, 0].tolist()
    [0.0, 1.0, 0.0]
    """
    so, sp, sk = np.sin((omega, phi, kappa))
    co, cp, ck = np.cos((omega, phi, kappa))
    return np.array(
        [
            [cp * ck, -cp * sk, sp],
            [co * sk + so * sp * ck, co * ck - so * sp * sk, -so * cp],
            [so * sk - co * sp * ck, so * ck + co * sp * sk, co * cp],
        ]
    )


def angles_from_rotation(rotation: ArrayLike) -> tuple[float, float, float]:
    """Return omega, phi, kappa of a matrix made by `world_from_camera`. [rad]

    phi lies in [-pi/2, pi/2]; at its ends, where omega and kappa turn about the same axis,
    kappa is set to 0.

    Examples
    --------
    >>> [round(a, 9) for a in angles_from_rotation(world_from_camera(0.1, -0.2, 3.0))]
    [0.1, -0.2, 3.0]
    """
    r = as_floats(rotation, "rotation")
    cos_phi = float(np.hypot(r[0, 0], r[0, 1]))
    phi = float(np.arctan2(r[0, 2], cos_phi))
    if cos_phi < 1e-12:
        return float(np.arctan2(r[2, 1], r[1, 1])), phi, 0.0
    return float(np.arctan2(-r[1, 2], r[2, 2])), phi, float(np.arctan2(-r[0, 1], r[0, 0]))


def angle_rates(rotations: FloatArray) -> FloatArray:
    """Return d(omega, phi, kappa) / d(rotation vector) of rotations (..., 3, 3), of that shape.

    The vector is one of the world. The columns of the inverse are the axes that the three angles
    turn about. Infinite at phi = +-pi/2: that is the gimbal lock of the angles, not of the camera.
    """
    omega = np.arctan2(-rotations[..., 1, 2], rotations[..., 2, 2])
    tan = np.tan(np.arcsin(np.clip(rotations[..., 0, 2], -1.0, 1.0)))
    so, co = np.sin(omega), np.cos(omega)
    over = np.hypot(1.0, tan)  # 1 / cos(phi)
    rates = np.zeros(rotations.shape)
    rates[..., 0, 0], rates[..., 0, 1], rates[..., 0, 2] = 1.0, so * tan, -co * tan
    rates[..., 1, 1], rates[..., 1, 2] = co, so
    rates[..., 2, 1], rates[..., 2, 2] = -so * over, co * over
    return rates


def skew(vectors: ArrayLike) -> FloatArray:
    """Return the matrices with ``skew(a) @ v = a x v``, shape (..., 3, 3).

    Examples
    --------
    >>> (skew([1.0, 2.0, 3.0]) @ [0.0, 0.0, 1.0]).tolist()
    [2.0, -1.0, 0.0]
    """
    a = as_floats(vectors, "vectors")
    return (a @ AXES_CROSS.reshape(9, 3).T).reshape(*a.shape, 3)


def by_rotation(rows: FloatArray, arms: FloatArray) -> FloatArray:
    """Return derivatives by a small turn v of arms: ``row . (v x arm) = (arm x row) . v``.

    Parameters
    ----------
    rows : ndarray, shape (n, m, 3)
        Derivatives of m things by the end of each arm.
    arms : ndarray, shape (n, 3)
        What turns.

    Returns
    -------
    ndarray, shape (n, m, 3)
    """
    x, y, z = arms.T
    turned: FloatArray = np.empty(rows.shape)
    for row, out in zip(rows.transpose(1, 0, 2), turned.transpose(1, 0, 2), strict=True):
        a, b, c = row.T
        out[:, 0], out[:, 1], out[:, 2] = y * c - z * b, z * a - x * c, x * b - y * a
    return turned


def rotation_from_vector(vector: ArrayLike) -> FloatArray:
    """Return the rotation about a vector by its length, shape (3, 3) (Rodrigues).

    Examples
    --------
    >>> rotation_from_vector([0.0, 0.0, np.pi / 2]).round(9)[:, 0].tolist()
    [0.0, 1.0, 0.0]
    """
    cross = skew(vector)
    angle = hypot(*as_floats(vector, "vector").tolist())
    # sin(x) / x keeps both factors exact down to the smallest angle.
    first, half = (sin(x) / x if x > 0 else 1.0 for x in (angle, 0.5 * angle))
    second = 0.5 * half**2
    return np.eye(3) + first * cross + second * (cross @ cross)


def checked_rotation(matrix: ArrayLike, name: str, *, tolerance: float = 1e-6) -> FloatArray:
    """Return a read-only copy of a rotation matrix, shape (3, 3).

    Raises
    ------
    GeometryError
        If its rows are no unit vectors at right angles to ``tolerance``, or it mirrors.
    """
    rotation = read_only(matrix, name, shape=(3, 3))
    if not (np.abs(rotation @ rotation.T - np.eye(3)) <= tolerance + 1e-5 * np.eye(3)).all():
        raise GeometryError(remark("rotation.none", name=name))
    (a, b, c), (d, e, f), (g, h, i) = rotation.tolist()
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0:
        raise GeometryError(remark("rotation.mirrors", name=name))
    return rotation


def nearest_rotation(matrix: ArrayLike) -> FloatArray:
    """Return the rotation nearest to a matrix that is one but for rounding, shape (3, 3)."""
    u, _, vt = np.linalg.svd(as_floats(matrix, "matrix"))
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    rotation = u @ vt
    # The SVD leaves its factors up to 15 roundings from orthonormal, otherwise on each processor:
    # one Newton step takes that to the two or three of a product.
    return np.asarray(rotation + 0.5 * rotation @ (np.eye(3) - rotation.T @ rotation))


def rotation_from_quaternion(quaternion: ArrayLike, name: str = "quaternion") -> FloatArray:
    """Return the rotation matrix of a quaternion w, x, y, z (Hamilton's convention), shape (3, 3).

    Raises
    ------
    GeometryError
        If its length is not 1 to 1e-3: it is no rotation, or its parts are in another order.

    Examples
    --------
    >>> half = np.sqrt(0.5)
    >>> (rotation_from_quaternion([half, 0.0, 0.0, half]) @ [2.0, 0.0, 0.0]).round(9)[1]
    np.float64(2.0)
    """
    parts = read_only(quaternion, name, shape=(4,))
    length = float(np.linalg.norm(parts))
    if not abs(length - 1.0) < 1e-3:
        raise GeometryError(
            f"{name}: a rotation has w, x, y, z of length 1, found {length:.6g}: {parts.tolist()}."
        )
    w, x, y, z = parts / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_from_rotation(rotation: ArrayLike) -> FloatArray:
    """Return w, x, y, z of a rotation matrix, w not negative: undoes `rotation_from_quaternion`.

    Notes
    -----
    Of the four products 4 q q^T that the matrix gives, the row of the largest part is taken:
    nothing is divided by a small number.
    """
    r = as_floats(rotation, "rotation")
    trace = float(np.trace(r))
    outer = np.empty((4, 4))
    outer[0, 0] = 1.0 + trace
    outer[0, 1:] = outer[1:, 0] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    outer[1:, 1:] = r + r.T + (1.0 - trace) * np.eye(3)
    row = outer[int(np.argmax(np.diag(outer)))]
    quaternion = row / np.linalg.norm(row)
    return np.asarray(-quaternion if quaternion[0] < 0 else quaternion)
