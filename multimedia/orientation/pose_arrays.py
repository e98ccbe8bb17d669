"""The equations of a pose by numpy: all points at once, in few calls.

A call of numpy takes longer than the sums over 20 points. What it gives is to the last digits what
`multimedia.orientation.pose_kernel` does one by one; the formulas are explained there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.lapack import dposv

from photocore.arrays import FloatArray
from photocore.camera import skew

#: Halley's steps for the tangent: three settle it for nearly every ray below `STEEPEST`.
ROOT_STEPS = 3
#: Last step, as a share of the tangent, of what has settled: the next would be its cube; and one
#: that values and slopes before it follow to second and first order: 1e-15 and 1e-10 remain.
SETTLED, STEADY = 1e-9, 1e-5
#: Tangents of rays in air beyond which roots want more digits than float64 has.
STEEPEST = 2.0

#: Numbers, or rows of them, one of each point.
Vector = Any


class Layering(NamedTuple):
    """Parallel layers as plain numbers; the first medium has the lowest index.

    Attributes
    ----------
    point, normal : ndarray, shape (3,)
        Of the last face; the normal towards the camera.
    moving : bool
        Whether both are in the camera's frame.
    thicknesses : ndarray, shape (k,)
        Of the inner layers.
    k, q : ndarray, shape (k + 1,)
        n_1 / n_i and 1 - k^2 of the inner layers and the last medium.
    """

    point: Vector
    normal: Vector
    moving: Any
    thicknesses: Vector
    k: Vector
    q: Vector


def apparent_depths(
    rho: FloatArray, first: Any, depth: FloatArray, layering: Layering
) -> tuple[Any, ...]:
    """Return V, F' and t of points at rho, and which settled: layers, the air first, are rows."""
    total, q = np.add.reduce, np.zeros(len(layering.q) + 1)
    heights, q[1:] = np.empty((len(q), len(rho))), layering.q
    heights[0], heights[1:-1], heights[-1] = first, layering.thicknesses[:, None], depth
    heights[1:] *= layering.k[:, None]
    straight = total(heights)
    t = rho / straight
    t = t * (1.0 + 0.5 * np.minimum(t * t, 0.36) * (q @ heights) / straight)
    for _ in range(ROOT_STEPS):
        bent = 1.0 / (1.0 + q[:, None] * (t * t))
        part = heights * np.sqrt(bent)
        value = total(part)
        part *= bent
        slope = total(part)
        part *= bent
        curve = q @ part
        miss, before = rho - value * t, t
        step = miss * slope / (slope * slope - 1.5 * miss * t * curve)
        t = t + step
        size, bound = np.abs(step), STEADY * t + 1e-300
        if (size <= bound).all():
            break
    # With C, the sum of q h k b^5/2: V' = (F' - V) / t, V'' = 2 (V - F') / t^2 - 3 C, F'' = -3 t C.
    share, bend = step / np.maximum(before, 1e-300), curve * step
    value = value + (slope - value) * (share - share * share) - 1.5 * bend * step
    return value, slope - 3.0 * before * bend, t, (t < STEEPEST) & (size <= bound)


def pose_arrays(
    points: FloatArray, lens: FloatArray, centre: FloatArray, rotation: FloatArray, c: float,
    layering: Layering,
) -> tuple[bool, FloatArray, FloatArray]:  # fmt: skip
    """Return whether all points are seen, their ideal images (2, n), and both rows (2, 7, n)."""
    normal, moving, last = layering.normal, layering.moving, len(layering.thicknesses)
    m = normal[:, None]
    with np.errstate(all="ignore"):
        away = points - centre[:, None]
        height = -float(normal @ (layering.point - (0.0 if moving else centre)))
        a = rotation.T @ away if moving else away
        w = normal @ a
        along = a - m * w
        rho2 = np.einsum("ij,ij->j", along, along)
        depth, first = -w - height, height - float(layering.thicknesses.sum())
        value, slope, t, settled = apparent_depths(np.sqrt(rho2), first, depth, layering)
        u = along - m * value
        in_camera = u if moving else rotation.T @ u
        scale = -c / in_camera[2]
        image = in_camera[:2] * scale
        # The derivatives of `_sight`, then those of `_row`: axes, rows, points.
        by_height = value / slope
        by_w = -layering.k[last] * by_height / np.sqrt(1.0 + layering.q[last] * t * t)
        change = m * (1.0 + by_w) - (value - slope) * by_height / np.maximum(rho2, 1e-300) * along
        by_u = np.empty((3, 2, points.shape[1]))
        np.multiply(np.swapaxes(lens[:, :2], 0, 1), scale, out=by_u[:2])
        linear = np.einsum("ijk,jk->ik", lens[:, :2], image)
        np.multiply(linear, scale / c, out=by_u[2])
        if not moving:
            by_u = (rotation @ by_u.reshape(3, -1)).reshape(by_u.shape)
        raised = (normal @ by_u.reshape(3, -1)).reshape(linear.shape)
        centred, turned, arm = by_u - raised * change[:, None], by_u, u
        if moving:
            centred = (rotation @ centred.reshape(3, -1)).reshape(by_u.shape)
            turned, arm = centred, away
        else:
            centred += m[:, None] * (raised * (by_height + by_w))
        table = np.empty((7, *linear.shape))
        np.add(linear, lens[:, 2], out=table[0])
        np.negative(centred, out=table[1:4])
        table[4] = turned[1] * arm[2] - turned[2] * arm[1]
        table[5] = turned[2] * arm[0] - turned[0] * arm[2]
        table[6] = turned[0] * arm[1] - turned[1] * arm[0]
    is_seen = first > 0.0 and bool((settled & (depth >= 0.0) & (in_camera[2] < 0.0)).all())
    return is_seen, image, np.swapaxes(table, 0, 1)


def pose_steps(rows: FloatArray, damping: float) -> tuple[FloatArray, float]:
    """Return the damped step, and the square of how far it would move the residuals."""
    table = np.swapaxes(rows, 0, 1).reshape(7, -1)
    normal = table @ table.T
    of_pose, right = normal[1:, 1:], normal[1:, 0]
    scale = 1.0 / np.sqrt(of_pose.diagonal() + 1e-300)
    scaled = of_pose * scale[:, None] * scale
    scaled.flat[::7] += damping + 1e-15
    # LAPACK itself: numpy's checks take longer than six unknowns.
    _, solution, failed = dposv(scaled, scale * right)
    if failed:  # not positive by a rounding
        solution = np.linalg.solve(scaled, scale * right)
    step = -scale * solution
    return step, float(step @ of_pose @ step)


def turned_rotation(rotation: FloatArray, v: FloatArray) -> FloatArray:
    """Return a rotation turned by a small vector, by Cayley's form: exact to second order."""
    cross = skew(v)
    once = cross @ rotation
    turned: FloatArray = rotation + (once + 0.5 * (cross @ once)) / (1.0 + 0.25 * float(v @ v))
    return turned
