"""The pose of a camera before parallel layers, with as little as possible around the arithmetic.

What `photocore.adjustment` does for any network, without its generality: 20 control points are so
few that its bookkeeping takes longer than the sums. What walks over the points has a second road in
`multimedia.orientation.pose_arrays`, without numba. `seen_points` is the half of `point_equations`
without the pose, for points to be found.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from multimedia.orientation.pose_arrays import (
    ROOT_STEPS,
    SETTLED,
    STEEPEST,
    Layering,
    Vector,
    apparent_depths,
    pose_arrays,
    pose_steps,
    turned_rotation,
)
from photocore.arrays import BoolArray, FloatArray
from photocore.compiled import Kernel, compiled, inlined

#: Steps after which the general adjustment takes over; from 20 mm and 2 degrees off it takes 4.
MOST_STEPS = 20


@inlined
def out(r: FloatArray, v: Vector) -> Vector:
    """Return R v."""
    return (
        r[0][0] * v[0] + r[0][1] * v[1] + r[0][2] * v[2],
        r[1][0] * v[0] + r[1][1] * v[1] + r[1][2] * v[2],
        r[2][0] * v[0] + r[2][1] * v[1] + r[2][2] * v[2],
    )


@inlined
def into(r: FloatArray, v: Vector) -> Vector:
    """Return R^T v."""
    return (
        r[0][0] * v[0] + r[1][0] * v[1] + r[2][0] * v[2],
        r[0][1] * v[0] + r[1][1] * v[1] + r[2][1] * v[2],
        r[0][2] * v[0] + r[1][2] * v[1] + r[2][2] * v[2],
    )


@inlined
def dot(a: Any, b: Any) -> Any:
    """Return the product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def less(a: Any, factor: Any, b: Any) -> Vector:
    """Return a - factor b."""
    return a[0] - factor * b[0], a[1] - factor * b[1], a[2] - factor * b[2]


@inlined
def _times(a: Any, factor: Any) -> Vector:
    return a[0] * factor, a[1] * factor, a[2] * factor


@inlined
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _apparent_depth_by_loops(
    rho: Any, first: float, depth: Any, layering: Layering
) -> tuple[Any, ...]:
    """Return V, F' and t of a point at rho, and whether the iteration settled."""
    inner, last = layering.thicknesses, len(layering.thicknesses)
    k, q = layering.k[last], layering.q[last]
    straight, bulge = first + depth * k, depth * k * q
    for i in range(last):
        straight = straight + inner[i] * layering.k[i]
        bulge = bulge + inner[i] * layering.k[i] * layering.q[i]
    t = rho / straight
    t = t * (1.0 + 0.5 * np.minimum(t * t, 0.36) * bulge / straight)
    value, slope, step = straight, straight, t
    for _ in range(ROOT_STEPS):
        square = t * t
        bent = 1.0 / (1.0 + q * square)
        part = depth * k * np.sqrt(bent)
        value, slope, curve = first + part, first + part * bent, part * bent * bent * q
        for i in range(last):
            bent = 1.0 / (1.0 + layering.q[i] * square)
            part = inner[i] * layering.k[i] * np.sqrt(bent)
            value, slope = value + part, slope + part * bent
            curve = curve + part * bent * bent * layering.q[i]
        miss = rho - value * t
        step = miss * slope / (slope * slope - 1.5 * miss * t * curve)
        t = t + step
    # V follows the last step by V' d(t^2) = (F' - V) dt / t.
    value = value + (slope - value) * (step / np.maximum(t, 1e-300))
    return value, slope, t, (t < STEEPEST) & (np.abs(step) <= SETTLED * t + 1e-300)


def _apparent_depth_of(rho: Any, first: Any, depth: Any, layering: Layering) -> tuple[Any, ...]:
    """Return the same as `_apparent_depth_by_loops`, of many points by fewer calls of numpy."""
    road = apparent_depths if np.ndim(rho) else _apparent_depth_by_loops
    return road(rho, first, depth, layering)


_apparent_depth = Kernel(_apparent_depth_by_loops, plain=_apparent_depth_of, inline=True)


@inlined
def _by_point(
    by_seen: Vector, rotation: FloatArray, moving: bool, m: FloatArray, change: Vector
) -> tuple[Any, ...]:
    """Return derivatives by u, along the normal and by the point, from those by the seen vector."""
    by_u = by_seen if moving else out(rotation, by_seen)
    raised = dot(by_u, m)
    by_point = less(by_u, raised, change)
    return by_u, raised, out(rotation, by_point) if moving else by_point


@inlined
def _row(
    lens: FloatArray, x: Any, y: Any, scale: Any, c: float, rotation: FloatArray, moving: bool,
    m: FloatArray, change: Vector, by_height: Any, away: Vector, u: Vector,
) -> tuple[Any, ...]:  # fmt: skip
    """Return a residual and its derivatives, from those of V by the point and the height."""
    linear = lens[0] * x + lens[1] * y
    by_seen = (lens[0] * scale, lens[1] * scale, linear * scale / c)
    by_u, raised, by_point = _by_point(by_seen, rotation, moving, m, change)
    if moving:
        centre, turn = by_point, _cross(by_point, away)
    else:
        # Faces that stand still: the height follows the centre, and the whole seen vector turns.
        centre, turn = less(by_point, -raised * by_height, m), _cross(by_u, u)
    return (
        linear + lens[2], -centre[0], -centre[1], -centre[2], turn[0], turn[1], turn[2],
    )  # fmt: skip


@inlined
def _sight(
    point: Any, centre: FloatArray, rotation: FloatArray, c: float, layering: Layering
) -> tuple[Any, ...]:
    r"""Return where a point, or each of many, is seen, and how V changes.

    Returns
    -------
    possible : bool
        Whether the point is seen, and not too obliquely.
    x, y, scale : float
        Ideal image coordinates, and theirs over the seen vector's. [mm]
    change, by_height : tuple of 3, float
        Derivatives of V + w by the point and by the height of the camera.
    away, u : tuple of 3
        From the centre to the point, and the direction in which it is seen.

    Notes
    -----
    In the frame in which the layers rest let a be the vector from the centre to the point, m the
    normal, w = m . a, rho the distance from the normal through the centre, and

    .. math:: V = \frac{\rho}{\tan\beta_1} = \sum_i \frac{h_i k_i}{\sqrt{1 + q_i t^2}}

    the depth at which the point seems to lie, with t = tan(beta_1), k and q of
    `multimedia.refraction.tangent`. The point is seen along u = a - (w + V) m, which is Maas'
    shift. With V' = dV / d(t^2) and F' = V + 2 t^2 V':

    .. math:: \frac{\partial V}{\partial \rho^2} = \frac{V'}{V F'}, \qquad
              \frac{\partial V}{\partial h_i} = \frac{V}{F'} \frac{k_i}{\sqrt{1 + q_i t^2}} .
    """
    m, moving, last = layering.normal, layering.moving, len(layering.thicknesses)
    away = (point[0] - centre[0], point[1] - centre[1], point[2] - centre[2])
    face = less(layering.point, 0.0 if moving else 1.0, centre)
    a, height = into(rotation, away) if moving else away, -dot(m, face)
    w = dot(m, a)
    depth, first = -w - height, height
    for i in range(last):
        first = first - layering.thicknesses[i]
    along = less(a, w, m)  # the faces
    rho2 = dot(along, along)
    value, slope, t, settled = _apparent_depth(np.sqrt(rho2), first, depth, layering)
    u = less(along, value, m)
    in_camera = u if moving else into(rotation, u)
    scale = -c / in_camera[2]
    x, y = in_camera[0] * scale, in_camera[1] * scale
    by_w = -layering.k[last] * value / (slope * np.sqrt(1.0 + layering.q[last] * t * t))
    # On the axis V' t^2 = (F' - V) / 2 and rho^2 vanish together; what V' is does not matter there.
    by_rho2 = (value - slope) * value / (np.maximum(rho2, 1e-300) * slope)
    change = less(_times(m, 1.0 + by_w), by_rho2, along)
    by_height = value / slope + by_w
    possible = settled & (first > 0.0) & (depth >= 0.0) & (in_camera[2] < 0.0)
    return possible, x, y, scale, change, by_height, away, u


@inlined
def point_equations(
    point: Any, lens: FloatArray, centre: FloatArray, rotation: FloatArray, c: float,
    layering: Layering,
) -> tuple[Any, ...]:  # fmt: skip
    """Return what a point, or each of many, adds to the equations of a pose.

    Parameters
    ----------
    point : ndarray, shape (3,) or (3, n)
    lens : ndarray, shape (2, 3) or (2, 3, n)
        Residuals in x and y are linear in the ideal image coordinates: ``l0 x + l1 y + l2``.
    centre, rotation, c
        Of the camera.
    layering : Layering

    Returns
    -------
    possible : bool
        Whether the point is seen, and not too obliquely.
    x, y : float
        Ideal image coordinates. [mm]
    by_x, by_y : tuple of 7
        Residuals, and their derivatives by centre and small rotation vector in the world.
    """
    possible, x, y, scale, change, by_height, away, u = _sight(point, centre, rotation, c, layering)
    m, moving = layering.normal, layering.moving
    by_x = _row(lens[0], x, y, scale, c, rotation, moving, m, change, by_height, away, u)
    by_y = _row(lens[1], x, y, scale, c, rotation, moving, m, change, by_height, away, u)
    return possible, x, y, by_x, by_y


@inlined
def seen_point(
    point: Any, centre: FloatArray, rotation: FloatArray, c: float, layering: Layering
) -> tuple[Any, ...]:
    """Return whether a point is seen, its ideal image, and the derivatives of that by the point."""
    possible, x, y, scale, change, _, _, _ = _sight(point, centre, rotation, c, layering)
    m, moving, none = layering.normal, layering.moving, 0.0 * scale
    _, _, by_x = _by_point((scale, none, x * scale / c), rotation, moving, m, change)
    _, _, by_y = _by_point((none, scale, y * scale / c), rotation, moving, m, change)
    return possible, x, y, by_x, by_y


def seen_points(
    points: FloatArray, centre: FloatArray, rotation: FloatArray, c: float, layering: Layering
) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Return which of points (3, n) are seen, ideal images (2, n), derivatives of these (2, 3, n).

    Rows of numpy: one by one, machine code has no more to gain than the rows' memory.
    """
    with np.errstate(all="ignore"):
        is_visible, x, y, by_x, by_y = seen_point.plain(points, centre, rotation, c, layering)
    return is_visible, np.stack((x, y)), np.array((by_x, by_y))


def _rows_one_by_one(
    points: FloatArray, lens: FloatArray, centre: FloatArray, rotation: FloatArray, c: float,
    layering: Layering,
) -> tuple[bool, FloatArray, FloatArray]:  # fmt: skip
    """Return the same as `pose_arrays`."""
    n = points.shape[1]
    ideal, rows, all_seen = np.empty((2, n)), np.empty((2, 7, n)), True
    for i in range(n):
        is_visible, x, y, first, second = point_equations(
            points[:, i], lens[:, :, i], centre, rotation, c, layering
        )
        all_seen = all_seen and is_visible
        ideal[0, i], ideal[1, i] = x, y
        for j in range(7):
            rows[0, j, i], rows[1, j, i] = first[j], second[j]
    return all_seen, ideal, rows


pose_rows = Kernel(_rows_one_by_one, plain=pose_arrays)


def _step_by_loops(rows: FloatArray, damping: float) -> tuple[FloatArray, float]:
    """Return the same as `pose_steps`, by Cholesky's decomposition."""
    normal = np.zeros((7, 7))
    for axis in range(2):
        for i in range(7):
            for j in range(i + 1):
                total = 0.0
                for point in range(rows.shape[2]):
                    total += rows[axis, i, point] * rows[axis, j, point]
                normal[i, j] += total
    root, scale, step = np.zeros((6, 6)), np.zeros(6), np.zeros(6)
    for i in range(6):
        scale[i] = 1.0 / np.sqrt(normal[i + 1, i + 1] + 1e-300)
    for i in range(6):
        for j in range(i + 1):
            rest = normal[i + 1, j + 1] * scale[i] * scale[j]
            if i == j:
                rest += damping + 1e-15
            for k in range(j):
                rest -= root[i, k] * root[j, k]
            root[i, j] = np.sqrt(max(rest, 1e-300)) if i == j else rest / root[j, j]
        step[i] = -scale[i] * normal[i + 1, 0]
        for k in range(i):
            step[i] -= root[i, k] * step[k]
        step[i] /= root[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            step[i] -= root[k, i] * step[k]
        step[i] /= root[i, i]
    moved = 0.0
    for i in range(6):
        step[i] *= scale[i]
    for i in range(6):
        for j in range(6):
            moved += step[i] * normal[max(i, j) + 1, min(i, j) + 1] * step[j]
    return step, moved


pose_step = Kernel(_step_by_loops, plain=pose_steps)


def _turned_by_loops(rotation: FloatArray, v: FloatArray) -> FloatArray:
    """Return the same as `turned_rotation`."""
    half = 1.0 / (1.0 + 0.25 * (v[0] ** 2 + v[1] ** 2 + v[2] ** 2))
    turned = np.empty((3, 3))
    for j in range(3):
        axis = (rotation[0, j], rotation[1, j], rotation[2, j])
        once = _cross(v, axis)
        twice = _cross(v, once)
        for i in range(3):
            turned[i, j] = axis[i] + half * (once[i] + 0.5 * twice[i])
    return turned


turned_pose = Kernel(_turned_by_loops, plain=turned_rotation)


@compiled
def fitted_pose(
    points: FloatArray, lens: FloatArray, centre: FloatArray, rotation: FloatArray, c: float,
    layering: Layering, rounding: float,
) -> tuple[int, FloatArray, FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """Go from a pose to the least square sum by Gauss-Newton, damped where that goes uphill.

    Parameters
    ----------
    points : ndarray, shape (3, n)
    lens : ndarray, shape (2, 3, n)
    centre, rotation, c, layering
        As for `point_equations`.
    rounding : float
        Of a residual, as for `photocore.adjustment.minimise`.

    Returns
    -------
    steps : int
        0 where it does not settle or a pose is impossible.
    centre, rotation : ndarray
    ideal : ndarray, shape (2, n)
        Image points there. [mm]
    rows : ndarray, shape (2, 7, n)
        Residuals and derivatives there.
    """
    is_visible, ideal, rows = pose_rows(points, lens, centre, rotation, c, layering)
    count, cost, damping = 2 * points.shape[1], (rows[:, 0] ** 2).sum(), 0.0
    before = 0.0
    if not is_visible:
        return 0, centre, rotation, ideal, rows
    for number in range(1, MOST_STEPS + 1):
        step, moved = pose_step(rows, damping)
        further, turned = centre + step[:3], turned_pose(rotation, step[3:])
        is_visible, new_ideal, new = pose_rows(points, lens, further, turned, c, layering)
        new_cost = (new[:, 0] ** 2).sum() if is_visible else np.inf
        slack = 1e-13 * cost + 10.0 * rounding * np.sqrt(count * cost) + 100.0 * count * rounding**2
        if not new_cost <= (cost + slack if moved <= slack else cost):
            damping = 10.0 * max(damping, 1e-4)
            if damping > 1e4:
                break
            continue
        # Each step is shorter than the last by the same factor or more: the next one need not be
        # made to know that it is nothing.
        following = np.sqrt(moved) * min(np.sqrt(moved / (before + 1e-300)), 1.0)
        settled = following <= 1e-10 * np.sqrt(cost) + 10.0 * rounding * np.sqrt(count)
        before = moved
        centre, rotation, cost, ideal, rows = further, turned, new_cost, new_ideal, new
        if settled and damping == 0.0:
            return number, centre, rotation, ideal, rows
        damping = 0.0 if damping < 1e-3 else 0.1 * damping
    return 0, centre, rotation, ideal, rows


@compiled
def fitted_poses(
    points: FloatArray, lens: FloatArray, centres: FloatArray, rotations: FloatArray,
    c: FloatArray, layering: Layering, rounding: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:  # fmt: skip
    """Return `fitted_pose` of many cameras, each of the points that it sees.

    Parameters
    ----------
    points : ndarray, shape (m or 1, 3, n)
    lens : ndarray, shape (m, 2, 3, n)
        NaN where a camera does not see a point.
    centres, rotations, c, rounding : ndarray, shape (m, 3), (m, 3, 3), (m,), (m,)
    layering : Layering

    Returns
    -------
    steps : ndarray, shape (m,)
    centres, rotations : ndarray, shape (m, 3), (m, 3, 3)
    ideal : ndarray, shape (m, 2, n)
    rows : ndarray, shape (m, 2, 7, n)
        0 where a camera does not see a point.
    """
    m, n = len(lens), points.shape[2]
    steps, ideal, rows = np.zeros(m), np.zeros((m, 2, n)), np.zeros((m, 2, 7, n))
    placed, turned = np.empty((m, 3)), np.empty((m, 3, 3))
    for i in range(m):
        used = np.flatnonzero(np.isfinite(lens[i, 0, 2]))
        some, lenses = np.empty((3, len(used))), np.empty((2, 3, len(used)))
        block = points[i if len(points) > 1 else 0]
        # Number by number: numba takes seconds to compile that slices are assigned.
        for place, point in enumerate(used):
            for j in range(3):
                some[j, place] = block[j, point]
                lenses[0, j, place], lenses[1, j, place] = (
                    lens[i, 0, j, point],
                    lens[i, 1, j, point],
                )
        steps[i], place_found, turn, image, rows_seen = fitted_pose(
            some, lenses, centres[i], rotations[i], c[i], layering, rounding[i]
        )
        for j in range(3):
            placed[i, j] = place_found[j]
            for k in range(3):
                turned[i, j, k] = turn[j, k]
        for place, point in enumerate(used):
            for axis in range(2):
                ideal[i, axis, point] = image[axis, place]
                for j in range(7):
                    rows[i, axis, j, point] = rows_seen[axis, j, place]
    return steps, placed, turned, ideal, rows
