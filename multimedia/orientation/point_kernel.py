"""Points from rays by machine code: what `multimedia.orientation.intersection` does with numpy.

Only points whose iteration settles come from here. What is missing, behind, singular or seen very
obliquely is left to numpy's road, which says what is wrong. The loops over points in `_trace`,
`_straighten` and `_equations` are such that the processor does several at once: no point stops
early, and what all share is read before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from multimedia.media import Camera, FlatInterface, OpticalMedia, ray_beyond
from multimedia.orientation.object_rays import cofactors, times
from multimedia.orientation.point_status import PointStatus
from multimedia.orientation.pose_arrays import Layering
from multimedia.orientation.pose_kernel import dot, less, out, seen_point
from multimedia.orientation.quick_pose import layering_of
from photocore.adjustment.outliers import CONTROLLED
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import STEPS, Brown, Convention, bent, bent_slopes, towards
from photocore.compiled import compiled, inlined

#: Gauss-Newton steps: exact rays need one, picks a few pixels off three.
MOST_STEPS = 25
#: A step smaller than this share of the distance ends the iteration: 1e-12 of 1 m is 1e-9 mm.
SMALL = 1e-12
#: Up to this share of the distance, a step changes images linearly: what is left is its square.
LINEAR = 1e-8
#: Largest angle between two rays below which a point is called weak. [rad]
WEAK_ANGLE = np.radians(2.0)
_OK, _WEAK, _GROSS_ERROR = (
    int(status) for status in (PointStatus.OK, PointStatus.WEAK, PointStatus.GROSS_ERROR)
)
#: Points worked on at a time: their rows stay in the processor's first caches.
BATCH = 256
#: Arrays of `multimedia.orientation.intersection.IntersectedPoints`, in its order.
Arrays = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, FloatArray, IntArray
]


class Views(NamedTuple):
    """Cameras before parallel layers as plain numbers, m of them.

    Attributes
    ----------
    centres, rotations, c : ndarray, shape (m, 3), (m, 3, 3), (m,)
    terms : ndarray, shape (m, 8)
        Of the lenses; `photocore.camera.distortion` has the equations.
    before, after : ndarray, shape (m, 2)
        What is added to the argument of the lens's formula, and to its result. [mm]
    inverse : ndarray of bool, shape (m,)
        Whether the formula gives ideal image coordinates.
    layering : Layering
        Each of its values for all cameras, with one inner layer, perhaps of no thickness.
    """

    centres: FloatArray
    rotations: FloatArray
    c: FloatArray
    terms: FloatArray
    before: FloatArray
    after: FloatArray
    inverse: BoolArray
    layering: Layering


@inlined
def _placed(views: Views, k: int) -> tuple[Any, Any, Layering]:
    """Return centre, rotation and layers of a camera as numbers, which loops need not read anew."""
    r, layers = views.rotations[k], views.layering
    centre, m, p = views.centres[k], layers.normal[k], layers.point[k]
    rotation = (
        (r[0, 0], r[0, 1], r[0, 2]),
        (r[1, 0], r[1, 1], r[1, 2]),
        (r[2, 0], r[2, 1], r[2, 2]),
    )
    return (
        (centre[0], centre[1], centre[2]),
        rotation,
        Layering(
            (p[0], p[1], p[2]), (m[0], m[1], m[2]), layers.moving[k], (layers.thicknesses[k, 0],),
            (layers.k[k, 0], layers.k[k, 1]), (layers.q[k, 0], layers.q[k, 1]),
        ),
    )  # fmt: skip


@compiled
def _straighten(terms: FloatArray, rows: FloatArray) -> None:
    """Put the points for which B gives points (2, n) in their place, NaN where there is none."""
    n = rows.shape[1]
    at = rows.copy()
    for _ in range(STEPS):
        more = 0
        for i in range(n):
            x, y = rows[0, i], rows[1, i]
            step_x, step_y = towards(terms, at[0, i], at[1, i], x, y)
            at[0, i], at[1, i] = at[0, i] + step_x, at[1, i] + step_y
            more |= max(abs(step_x), abs(step_y)) > 1e-9 * (1.0 + max(abs(x), abs(y)))
        if not more:
            break
    for i in range(n):
        x, y = rows[0, i], rows[1, i]
        seen_x, seen_y = bent(terms, at[0, i], at[1, i])
        off = max(abs(seen_x - x), abs(seen_y - y))
        settled = off <= 1e-11 * (1.0 + max(abs(x), abs(y)))
        rows[0, i] = at[0, i] if settled else np.nan
        rows[1, i] = at[1, i]


@compiled
def _trace(views: Views, k: int, image: FloatArray, rays: FloatArray) -> None:
    """Write origins and directions in the object's medium, (6, n), NaN where there are none."""
    centre, rotation, layering = _placed(views, k)
    m, point, moving, c = layering.normal, layering.point, layering.moving, views.c[k]
    height = -dot(m, point) if moving else dot(m, less(centre, 1.0, point))
    terms, before, after = views.terms[k].copy(), views.before[k], views.after[k]
    for i in range(rays.shape[1]):
        rays[0, i], rays[1, i] = image[i, 0] - after[0], image[i, 1] - after[1]
    if views.inverse[k]:
        for i in range(rays.shape[1]):
            rays[0, i], rays[1, i] = bent(terms, rays[0, i], rays[1, i])
    else:
        _straighten(terms, rays[:2])
    shift_x, shift_y = before[0], before[1]
    for i in range(rays.shape[1]):
        direction = (rays[0, i] - shift_x, rays[1, i] - shift_y, -c)
        if not moving:
            direction = out(rotation, direction)
        ahead, o, d = ray_beyond(direction, m, height, layering.thicknesses, layering.k)
        if moving:
            o, d = out(rotation, o), out(rotation, d)
        rays[0, i], rays[1, i], rays[2, i] = o[0] + centre[0], o[1] + centre[1], o[2] + centre[2]
        rays[3, i], rays[4, i], rays[5, i] = d[0] if ahead else np.nan, d[1], d[2]


@compiled
def _begin(rays: FloatArray, seen: BoolArray, xyz: FloatArray, angle: FloatArray) -> BoolArray:
    """Write the points nearest to rays (m, 6, n), and the widest angles; return which have one."""
    m, n = seen.shape
    usable = np.zeros(n, dtype=np.bool_)
    for i in range(n):
        xx, xy, xz, yy, yz, zz, right_x, right_y, right_z = (0.0,) * 9
        count, chord, whole = 0, 0.0, True
        for k in range(m):
            if not seen[k, i]:
                continue
            x, y, z = rays[k, 3, i], rays[k, 4, i], rays[k, 5, i]
            o = rays[k, 0, i], rays[k, 1, i], rays[k, 2, i]
            whole, count = whole and x == x, count + 1
            along = o[0] * x + o[1] * y + o[2] * z
            xx, xy, xz = xx + (1.0 - x * x), xy - x * y, xz - x * z
            yy, yz, zz = yy + (1.0 - y * y), yz - y * z, zz + (1.0 - z * z)
            right_x, right_y = right_x + (o[0] - along * x), right_y + (o[1] - along * y)
            right_z += o[2] - along * z
            for j in range(k):
                if seen[j, i]:
                    gap_x, gap_y, gap_z = rays[j, 3, i] - x, rays[j, 4, i] - y, rays[j, 5, i] - z
                    chord = max(chord, gap_x * gap_x + gap_y * gap_y + gap_z * gap_z)
        adjugate, determinant, regular = cofactors(xx, xy, xz, yy, yz, zz)
        at = times(adjugate, (right_x, right_y, right_z))
        usable[i] = whole and count > 1 and regular
        angle[i] = 2.0 * np.arcsin(min(0.5 * np.sqrt(chord), 1.0))
        for j in range(3):
            xyz[j, i] = at[j] / determinant if usable[i] else 0.0
    return usable


@compiled
def _equations(
    views: Views, k: int, image: FloatArray, sigma: FloatArray, seen: BoolArray, xyz: FloatArray,
    rows: FloatArray, sums: FloatArray,
) -> None:  # fmt: skip
    """Write a camera's weighted derivatives and residuals, (8, n), and add up their products.

    Rows are the derivatives by the point of x, then of y, and both residuals; zero where the
    camera does not see a point. The sums (9, n) are the normal matrix and the right-hand side;
    NaN where there is no image.
    """
    n, c = rows.shape[1], views.c[k]
    centre, rotation, layering = _placed(views, k)
    for i in range(n):
        possible, x, y, by_x, by_y = seen_point(
            (xyz[0, i], xyz[1, i], xyz[2, i]), centre, rotation, c, layering
        )
        for j in range(3):
            rows[j, i], rows[3 + j, i] = by_x[j], by_y[j]
        rows[6, i], rows[7, i] = x if possible else np.nan, y
    terms, before, after = views.terms[k].copy(), views.before[k], views.after[k]
    shift_x, shift_y, at_x, at_y = before[0], before[1], after[0], after[1]
    inverse = views.inverse[k]
    argument = rows[6:].copy()
    if inverse:
        _straighten(terms, argument)
    for i in range(n):
        x, y = argument[0, i] + shift_x, argument[1, i] + shift_y
        a, b, e, f = bent_slopes(terms, x, y)
        if inverse:
            whole = a * f - b * e
            a, b, e, f = f / whole, -b / whole, -e / whole, a / whole
        else:
            x, y = bent(terms, x, y)
        one, two = 1.0 / sigma[i, 0], 1.0 / sigma[i, 1]
        v, w = (image[i, 0] - x - at_x) * one, (image[i, 1] - y - at_y) * two
        if not seen[i]:
            one, two, v, w = 0.0, 0.0, 0.0, 0.0
        for j in range(3):
            by_x, by_y = rows[j, i], rows[3 + j, i]
            rows[j, i], rows[3 + j, i] = (a * by_x + b * by_y) * one, (e * by_x + f * by_y) * two
        rows[6, i], rows[7, i] = v, w
    for i in range(n):
        a, b, c, v = rows[0, i], rows[1, i], rows[2, i], rows[6, i]
        d, e, f, w = rows[3, i], rows[4, i], rows[5, i], rows[7, i]
        sums[0, i] += a * a + d * d
        sums[1, i] += a * b + d * e
        sums[2, i] += a * c + d * f
        sums[3, i] += b * b + e * e
        sums[4, i] += b * c + e * f
        sums[5, i] += c * c + f * f
        sums[6, i] += a * v + d * w
        sums[7, i] += b * v + e * w
        sums[8, i] += c * v + f * w


@compiled
def _judge(
    found: Arrays, point: int, inverse: tuple[float, ...], step: tuple[float, float, float],
    sigma: FloatArray, rows: FloatArray, seen: BoolArray, limits: FloatArray,
) -> None:  # fmt: skip
    """Write precision, residuals and tests of a point; rows (m, 8) are of its last step."""
    _, covariance, residuals, normed, sigma0, count, angle, status = found
    place, square, rays = (0, 1, 2, 1, 3, 4, 2, 4, 5), 0.0, 0
    for j in range(9):
        covariance[point, j // 3, j % 3] = inverse[place[j]]
    for k in range(len(seen)):
        if not seen[k]:
            continue
        rays += 1
        for axis in range(2):
            a = rows[k, 3 * axis], rows[k, 3 * axis + 1], rows[k, 3 * axis + 2]
            # So short a step changes a residual linearly, to rounding.
            v = rows[k, 6 + axis] - dot(a, step)
            # Cofactor of a weighted residual: 1 - a N^-1 a^T.
            spread = 1.0 - dot(times(inverse, a), a)
            square += v * v
            residuals[k, point, axis] = v * sigma[k, point, axis]
            if spread > CONTROLLED:
                normed[k, point, axis] = v / np.sqrt(spread)
    sigma0[point], count[point] = np.sqrt(square / (2 * rays - 3)), rays
    status[point] = _OK if angle[point] >= WEAK_ANGLE else _WEAK
    if square > limits[rays]:
        status[point] = _GROSS_ERROR


@compiled
def settled_points(
    views: Views, image: FloatArray, sigma: FloatArray, limits: FloatArray, found: Arrays
) -> BoolArray:
    """Intersect points, and return which of them settled.

    Parameters
    ----------
    views : Views
        Of m cameras.
    image, sigma : ndarray, shape (m, n, 2)
        Measured, NaN where not seen, and standard deviations. [mm]
    limits : ndarray, shape (m + 1,)
        Of the square sum, by the number of rays.
    found : tuple of ndarray
        Written where a point settled.
    """
    m, n, _ = image.shape
    points, angle = found[0], found[6]
    settled, first = np.zeros(n, dtype=np.bool_), views.centres[0]
    for start in range(0, n, BATCH):
        stop = min(start + BATCH, n)
        count = stop - start
        rays, rows, xyz = np.empty((m, 6, count)), np.empty((m, 8, count)), np.empty((3, count))
        before, finite = np.empty(count), np.empty((m, count), dtype=np.bool_)
        for k in range(m):
            for i in range(count):
                finite[k, i] = np.isfinite(image[k, start + i, 0] + image[k, start + i, 1])
            _trace(views, k, image[k, start:stop], rays[k])
        active, reach = _begin(rays, finite, xyz, angle[start:stop]), np.zeros(count)
        for j in range(3):
            for i in range(count):
                reach[i] = max(reach[i], abs(xyz[j, i] - first[j]))
        for number in range(MOST_STEPS):
            sums, going = np.zeros((9, count)), False
            for k in range(m):
                one, sigmas = image[k, start:stop], sigma[k, start:stop]
                _equations(views, k, one, sigmas, finite[k], xyz, rows[k], sums)
            for i in range(count):
                if not active[i]:
                    continue
                adjugate, whole, regular = cofactors(
                    sums[0, i], sums[1, i], sums[2, i], sums[3, i], sums[4, i], sums[5, i]
                )
                x, y, z = times(adjugate, (sums[6, i], sums[7, i], sums[8, i]))
                x, y, z = x / whole, y / whole, z / whole
                xyz[0, i], xyz[1, i], xyz[2, i] = xyz[0, i] + x, xyz[1, i] + y, xyz[2, i] + z
                size = np.sqrt(x * x + y * y + z * z) / reach[i]
                # Each step is shorter than the last by the same factor: the next one need not be
                # made to know that it is nothing.
                following = size * min(size / before[i], 1.0) if number else size
                before[i] = size
                done = regular and following <= SMALL and size <= LINEAR
                active[i] = regular and not done
                going = going or active[i]
                if done:
                    p, (a, b, c, d, e, f) = start + i, adjugate
                    inverse = a / whole, b / whole, c / whole, d / whole, e / whole, f / whole
                    for j in range(3):
                        points[p, j] = xyz[j, i]
                    _judge(found, p, inverse, (x, y, z), sigma, rows[:, :, i], finite[:, i], limits)
                    settled[p] = True
            if not going:
                break
    return settled


def views_of(cameras: Sequence[Camera], media: Sequence[OpticalMedia]) -> Views | None:
    """Return cameras and media as plain numbers.

    None for other lenses than `Brown` and other media than parallel layers, one of glass at most.

    Raises
    ------
    GeometryError
        If a camera is not in its first medium.
    """
    for camera, item in zip(cameras, media, strict=True):
        if isinstance(item, FlatInterface):
            item.medium(camera)
    lenses = [c.distortion for c in cameras if isinstance(c.distortion, Brown)]
    layered = (one for one in map(layering_of, media) if one is not None)
    layerings = [_with_inner_layer(one) for one in layered if len(one.thicknesses) <= 1]
    if not len(lenses) == len(layerings) == len(cameras):
        return None
    points = np.array([camera.principal_point for camera in cameras])
    about_centre = np.array([lens.convention is Convention.OPENPTV for lens in lenses])[:, None]
    return Views(
        centres=np.array([camera.centre for camera in cameras]),
        rotations=np.array([camera.rotation for camera in cameras]),
        c=np.array([camera.principal_distance for camera in cameras]),
        terms=np.array([lens.terms for lens in lenses]),
        before=np.where(about_centre, points, 0.0), after=np.where(about_centre, 0.0, points),
        inverse=np.array([lens.convention is Convention.PHOTOGRAMMETRIC for lens in lenses]),
        layering=Layering(*(np.array(values) for values in zip(*layerings, strict=True))),
    )  # fmt: skip


def _with_inner_layer(one: Layering) -> Layering:
    """Return a layering with an inner layer, of no thickness if it had none."""
    if len(one.thicknesses):
        return one
    return one._replace(thicknesses=np.zeros(1), k=np.append(1.0, one.k), q=np.append(0.0, one.q))
