"""Refraction correction of points measured through a water surface as if it were not there.

A point cloud or DEM made with ordinary photogrammetry shows the bottom too high: its points are
where the straight rays in air would meet. With the cameras that saw a point the true position
follows rigorously, without them its depth is stretched by the refractive index.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from multimedia.bathymetry.corrected_points import (
    BathymetryStatus,
    CorrectedPoints,
    Precision,
    WaterSurface,
    as_water_surface,
    checked_water_index,
)
from multimedia.bathymetry.visible_points import VisiblePoints
from multimedia.media import Medium, Plane, SurfaceSequence, aim_rays, shifts, tangents_of
from multimedia.refraction import Layers
from photocore.arrays import BoolArray, FloatArray, IntArray, as_floats, as_points
from photocore.errors import GeometryError, InputError

#: Rays per block: bounds memory however many points and cameras there are.
BLOCK_RAYS = 400_000
#: Newton needs 3 to 5 steps.
MOST_STEPS = 30
#: A step of this share of the scene size is the last: convergence is quadratic, so its square is
#: what is left. The slopes of rasters and meshes have kinks; there the step itself must vanish.
LAST_STEP, LAST_STEP_KINKED = 3e-8, 1e-12
#: Step of the differences for the index, and for the level as a share of the camera height.
DIFFERENCE = 1e-5
#: Least depth of a point under a plane, as a share of the camera's height: a few roundings.
JUST_UNDER = 1e-13
#: Two rays of a smaller angle do not fix a point. [rad]
SMALLEST_ANGLE = 1e-4


def correct_bathymetry(
    points: ArrayLike,
    *,
    water_level: float | WaterSurface,
    refractive_index: float,
    cameras: ArrayLike | None = None,
    visible: ArrayLike | csr_array | None = None,
    max_angle: float | None = None,
    rise: ArrayLike | None = None,
    precision: Precision | None = None,
) -> CorrectedPoints:
    r"""Correct apparent points under water for the refraction at the water surface.

    Parameters
    ----------
    points : array_like, shape (..., 3)
        Points as ordinary photogrammetry gives them, Z up. Points above the water stay as they are.
        [m]
    water_level : float or WaterSurface
        Height of the water [m], or a `Plane`, `RasterSurface`, `MeshSurface` or `WaveSurface`.
    refractive_index : float
        Refractive index of the water relative to the air, 1.33 to 1.35.
    cameras : array_like, shape (m, 3), optional
        Projection centres, above the water. Without them every point is treated as if seen from
        straight above. [m]
    visible : array_like of bool, shape (..., m), or sparse array, shape (n, m), optional
        Which camera saw which point; all of them by default. A point seen by fewer than two
        cameras (or by rays that hardly differ) gets the nadir correction and says so.
    max_angle : float, optional
        Cameras see nothing farther than this from the vertical below them. [rad]
    rise : array_like, shape (m,), optional
        By how much the water stood higher when each camera took its photo (tide). A plane's only.
        [m]
    precision : Precision, optional
        Standard deviations, carried through to the result.

    Returns
    -------
    CorrectedPoints
        Positions, depths, how each point was treated, and covariances.

    Raises
    ------
    InputError, GeometryError
        If the index is none of water, shapes do not match, or a camera is not above the water.

    Notes
    -----
    Nadir: the apparent depth a becomes n a; X and Y stay. This leaves the planimetric shift and,
    for cameras off the vertical, several per cent of the depth.

    Rigorous: let u_i(P) be the direction in air of the refracted ray from camera C_i to the true
    point P. The apparent point A is where the straight rays meet best, that is where
    :math:`\sum_i w_i (I - u_i u_i^T)(A - C_i) = 0` with :math:`w_i = 1/|A - C_i|^2` (equal
    precision in the images). These are three equations for the three coordinates of P, solved by
    Newton's method with exact derivatives; P, A and their covariance follow without any
    assumption on depth or angle. With ``rise`` every ray is refracted at the level of its own
    photo; depths count from ``water_level``.

    Examples
    --------
    A stone seen 195.7 mm under water of level 1.8075 m is in truth 65.7 mm deeper (Gueguen and
    Mandlburger 2024, Table 1):

    >>> apparent = [0.3, 0.2, 1.8075 - 0.1957]
    >>> result = correct_bathymetry(apparent, water_level=1.8075, refractive_index=1.33575)
    >>> print(round(float(result.xyz[2]) - apparent[2], 4))
    -0.0657
    """
    xyz = as_points(points, "points", dimension=3)
    shape = xyz.shape[:-1]
    flat = xyz.reshape(-1, 3)
    surface, n_water = as_water_surface(water_level), checked_water_index(refractive_index)
    rises = _checked_rise(rise, cameras, surface)
    centres = _checked_cameras(cameras, surface, rises)
    rays = VisiblePoints.checked(visible, centres, max_angle, shape)
    precision = precision or Precision()
    if precision.wave[0] > 0 and not isinstance(surface, Plane):
        raise InputError("precision: a wave upon what has its own form; give the mean height.")
    count = len(flat)
    result = (
        np.empty((count, 3)), np.empty(count), np.empty(count, np.int64), np.empty((count, 3, 3))
    )  # fmt: skip
    for part, row, camera in rays.blocks(flat, BLOCK_RAYS):
        pairs = (row, camera)
        corrected = _correct_block(flat[part], surface, n_water, centres, rises, pairs, precision)
        for whole, piece in zip(result, corrected, strict=True):
            whole[part] = piece
    return CorrectedPoints(
        xyz=result[0].reshape(xyz.shape),
        depth=result[1].reshape(shape),
        status=result[2].reshape(shape),
        covariance=result[3].reshape(*shape, 3, 3) if precision != Precision() else None,
    )


def _correct_block(
    apparent: FloatArray,
    surface: WaterSurface,
    index: float,
    centres: FloatArray,
    rises: FloatArray,
    pairs: tuple[IntArray, IntArray],
    precision: Precision,
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Return position, depth, status and covariance of one block of points.

    ``pairs`` are rows and cameras of what was seen, sorted by row.
    """
    level = surface.height_at(apparent[:, :2])
    below = level - apparent[:, 2]
    status = np.where(below > 0, BathymetryStatus.NADIR, BathymetryStatus.DRY).astype(np.int64)
    status[np.isnan(below)] = BathymetryStatus.NO_SURFACE
    status[~np.isfinite(apparent).all(-1)] = BathymetryStatus.FAILED
    xyz = apparent.copy()
    covariance = np.broadcast_to(np.eye(3) * precision.point**2, (len(xyz), 3, 3)).copy()
    intersected = np.bincount(pairs[0], minlength=len(xyz)) >= 2
    highest = rises.max(initial=0.0)
    # Between low and high water the rays decide.
    rows = np.flatnonzero(intersected & (below > -highest))
    wet = np.flatnonzero(status == BathymetryStatus.NADIR)
    xyz[wet, 2] = level[wet] - index * below[wet]
    covariance[wet, 2, 2] = (
        (index * precision.point) ** 2
        + (below[wet] * precision.index) ** 2
        + ((1 - index) * precision.level) ** 2
    )
    rows = rows[status[rows] != BathymetryStatus.FAILED]
    if rows.size:
        task = _Task.near(apparent, rows, centres, pairs, surface, index, rises)
        points, ok, weak = _solve(task, xyz[rows])
        xyz[rows[~weak]] = np.where(ok[~weak, None], points[~weak], np.nan)
        status[rows[~weak]] = np.where(ok[~weak], BathymetryStatus.RAYS, BathymetryStatus.FAILED)
        if precision != Precision():
            good = np.flatnonzero(ok & ~weak)
            covariance[rows[good]] = _propagate(task.take(good), points[good], precision)
    depth = np.maximum(surface.height_at(xyz[:, :2]) - xyz[:, 2], 0.0)
    covariance[status == BathymetryStatus.FAILED] = np.nan
    return xyz, depth, status, covariance


class _Task(NamedTuple):
    """Points with the cameras that saw them, in coordinates near the origin."""

    apparent: FloatArray  # (n, 3)
    centres: FloatArray  # (m, 3)
    row: IntArray  # (k,), point of each pair that was seen, ascending
    camera: IntArray  # (k,)
    weight: FloatArray  # (k,)
    surface: WaterSurface
    n_water: float
    rises: FloatArray  # (m,)
    origin: FloatArray  # (3,), to be added again
    heading: FloatArray  # (k, 3), in air, of the rays last found; NaN before

    @classmethod
    def near(
        cls,
        apparent: FloatArray,
        rows: IntArray,
        centres: FloatArray,
        pairs: tuple[IntArray, IntArray],
        surface: WaterSurface,
        index: float,
        rises: FloatArray,
    ) -> _Task:
        """Move some points of a block to the origin: map coordinates would cost six digits."""
        origin = np.round(apparent[rows].mean(0))
        row, camera = _of_rows(pairs, rows, len(apparent))
        local, at = apparent[rows] - origin, centres - origin
        weight = 1 / ((local[row] - at[camera]) ** 2).sum(-1)
        return cls(local, at, row, camera, weight, surface.shifted(-origin), index, rises, origin,
                   np.full((len(row), 3), np.nan))  # fmt: skip

    def take(self, rows: IntArray) -> _Task:
        """Return the task for some of the points, ascending."""
        if len(rows) == len(self.apparent):
            return self
        row, camera, weight, heading = _of_rows(
            (self.row, self.camera, self.weight, self.heading), rows, len(self.apparent)
        )
        return self._replace(
            apparent=self.apparent[rows], row=row, camera=camera, weight=weight, heading=heading
        )

    @property
    def starts(self) -> IntArray:
        """First pair of each point: sums over runs; every point has a camera."""
        return np.searchsorted(self.row, np.arange(len(self.apparent)))


def _of_rows(pairs: tuple[Any, ...], rows: IntArray, count: int) -> tuple[Any, ...]:
    """Return the pairs of some of ``count`` rows, numbered anew; the first entry is the row."""
    number = np.full(count, -1)
    number[rows] = np.arange(len(rows))
    row = number[pairs[0]]
    kept = row >= 0
    return (row[kept], *(part[kept] for part in pairs[1:]))


def _solve(task: _Task, start: FloatArray) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Return true positions, which were found, and which have rays too parallel to be fixed."""
    point = start - task.origin
    scale = np.sqrt(1 / np.minimum.reduceat(task.weight, task.starts))
    ok = np.zeros(len(point), dtype=bool)
    weak = ok.copy()
    rows = np.arange(len(point))
    last = LAST_STEP if isinstance(task.surface, Plane) else LAST_STEP_KINKED
    highest = task.rises.max(initial=0.0)
    water = task.surface.shifted((0.0, 0.0, highest)) if highest else task.surface
    for step_number in range(MOST_STEPS):
        part = task.take(rows)
        balance, normal, change = _balance(part, point[rows])
        task.heading[np.isin(task.row, rows)] = part.heading
        if step_number == 0:
            # Smallest over largest eigenvalue of the normal matrix: the square of the ray angle.
            values = np.linalg.eigvalsh(np.nan_to_num(normal))
            weak[rows] = values[:, 0] < SMALLEST_ANGLE**2 * values[:, 2]
        usable = np.isfinite(change).all((-1, -2)) & np.isfinite(balance).all(-1) & ~weak[rows]
        rows, part = rows[usable], part.take(np.flatnonzero(usable))
        if not rows.size:
            break
        step = np.linalg.solve(change[usable], balance[usable, :, None])[..., 0]
        point[rows] += _kept_in_water(water, point[rows], step)
        # Judged by the whole step: one that was shortened has not arrived.
        length = np.linalg.norm(step, axis=-1) / scale[rows]
        ok[rows] = length <= LAST_STEP
        rows = rows[length > last]
        if not rows.size:
            break
    return point + task.origin, ok, weak


def _kept_in_water(surface: WaterSurface, point: FloatArray, step: FloatArray) -> FloatArray:
    """Shorten steps that would more than halve or double a depth: rays that hardly differ."""
    depth = surface.height_at(point[:, :2]) - point[:, 2]
    change = surface.height_at(point[:, :2] + step[:, :2]) - point[:, 2] - step[:, 2] - depth
    with np.errstate(invalid="ignore", divide="ignore"):
        share = np.fmin(1.0, np.where(change < 0, 0.5, 1.0) * depth / np.abs(change))
    return step * share[:, None]


def _balance(task: _Task, point: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return sum w (I - u u')(A - C), the normal matrix, and minus the derivative by the point."""
    row, camera, weight = task.row, task.camera, task.weight
    heading, derivative = _pointing(task, point)
    toward = task.apparent[row] - task.centres[camera]
    along = (heading * toward).sum(-1)
    aside = toward - along[:, None] * heading
    outer = np.eye(3) - heading[:, :, None] * heading[:, None, :]
    # d(u u') r = (u . r) du + u (r . du)
    change = along[:, None, None] * derivative
    change += heading[:, :, None] * (toward[:, None, :] @ derivative)
    starts = task.starts
    return (
        np.add.reduceat(weight[:, None] * aside, starts),
        np.add.reduceat(weight[:, None, None] * outer, starts),
        np.add.reduceat(weight[:, None, None] * change, starts),
    )


def _pointing(task: _Task, point: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return directions in air of the rays of pairs, (k, 3), and their derivatives (k, 3, 3)."""
    row, camera = task.row, task.camera
    if not isinstance(task.surface, Plane):
        water = SurfaceSequence(surfaces=(task.surface,), indices=(1.0, task.n_water))
        path = aim_rays(
            task.centres[camera], point[row], water, jacobian=True, headings=task.heading
        )
        task.heading[:] = path.directions[:, 0]
        return path.directions[:, 0], np.asarray(path.jacobian)
    up = task.surface.normal
    height = (task.surface.side(task.centres) - task.rises * up[2])[camera]
    vectors = point[row] - task.centres[camera]
    # The ray to a point over the water, dry in this photo or lifted by Newton, goes straight.
    above = np.maximum(vectors @ up + height * (1 + JUST_UNDER), 0.0)
    vectors -= above[:, None] * up
    medium = Medium(normal=up, height=height, layers=Layers(indices=(1.0, task.n_water)))
    shift = shifts(vectors, medium, media=False)
    slope = np.where(above[:, None] > 0, 0.0, shift.gradient(vectors, medium))
    ray = vectors + (shift.g + above)[:, None] * up
    length = np.sqrt((ray * ray).sum(-1))[:, None]
    heading = ray / length
    derivative = np.eye(3) + up[:, None] * slope[:, None, :]
    # Only what is at right angles to the ray turns it.
    derivative -= heading[:, :, None] * (heading[:, None, :] @ derivative)
    return heading, derivative / length[:, :, None]


def _propagate(task: _Task, points: FloatArray, precision: Precision) -> FloatArray:
    """Return the covariance of true positions from all that `Precision` names."""
    point = points - task.origin
    _, normal, change = _balance(task, point)
    by_point = np.linalg.solve(change, normal + _weight_change(task, point))
    measured = precision.point**2 * np.eye(3) + precision.direction**2 * np.linalg.inv(normal)
    covariance: FloatArray = by_point @ measured @ by_point.transpose(0, 2, 1)
    if precision.wave[0] > 0:
        rate = np.linalg.solve(change, _wave_noise(task, point, *precision.wave))
        covariance += rate @ rate.transpose(0, 2, 1)
    step = DIFFERENCE * float(np.abs(task.centres[:, 2] - task.apparent[:, 2].mean()).max())
    lift = np.array([0.0, 0.0, step])

    def changed(sign: float) -> dict[str, _Task]:
        return {
            "index": task._replace(n_water=task.n_water + sign * DIFFERENCE),
            "level": task._replace(surface=task.surface.shifted(sign * lift)),
        }

    more, less = changed(1.0), changed(-1.0)
    for name, width in (("index", DIFFERENCE), ("level", step)):
        sigma = getattr(precision, name)
        if sigma > 0:
            difference = _balance(more[name], point)[0] - _balance(less[name], point)[0]
            rate = np.linalg.solve(change, (difference / (2 * width))[..., None])
            covariance += sigma**2 * rate @ rate.transpose(0, 2, 1)
    return covariance


def _wave_noise(task: _Task, point: FloatArray, amplitude: float, length: float) -> FloatArray:
    """Return a root of the covariance of the balance from waves that differ in every photo.

    Where a ray meets the water the surface is higher by h and leans by g. The place X that makes
    the optical path shortest, T [(u - n v) + g (up . (u - n v))] = 0 with the directions u in air,
    v in water and T along the surface, moves to first order, and the ray in air turns. Slopes of a
    wave of any direction and phase have variance (2 pi amplitude / length)^2 / 4 along each axis,
    heights amplitude^2 / 2.
    """
    row, camera, n = task.row, task.camera, task.n_water
    heading, _ = _pointing(task, point)
    assert isinstance(task.surface, Plane)
    up = task.surface.normal
    height = (task.surface.side(task.centres) - task.rises * up[2])[camera]
    air = -height / (heading @ up)
    below = point[row] - task.centres[camera] - air[:, None] * heading
    water = np.linalg.norm(below, axis=1)
    onward = below / water[:, None]

    def across(ray: FloatArray) -> FloatArray:
        return np.eye(3) - ray[:, :, None] * ray[:, None, :]

    turn = across(heading) / air[:, None, None]
    bend = turn + n * across(onward) / water[:, None, None]
    flat = np.eye(3) - np.outer(up, up)
    stiff = flat @ bend @ flat + np.outer(up, up)
    push = np.empty((len(row), 3, 3))  # two slopes, and the height
    push[:, :, :2] = ((heading - n * onward) @ up)[:, None, None] * tangents_of(up).T
    push[:, :, 2] = flat @ bend @ up
    place = -np.linalg.solve(stiff, push)
    place[:, :, 2] += up
    slope = np.pi * amplitude / length
    turned = turn @ (place * [slope, slope, amplitude / np.sqrt(2)])
    toward = task.apparent[row] - task.centres[camera]
    along = (heading * toward).sum(-1)[:, None, None]
    noise = along * turned + heading[:, :, None] * (toward[:, None, :] @ turned)
    noise *= np.where(below @ up < 0, task.weight, 0.0)[:, None, None]
    total = np.add.reduceat(noise @ noise.transpose(0, 2, 1), task.starts)
    values, vectors = np.linalg.eigh(total)
    root: FloatArray = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    return root


def _weight_change(task: _Task, point: FloatArray) -> FloatArray:
    """Return how the balance changes because the weights 1 / |A - C|^2 follow the point A."""
    row, camera = task.row, task.camera
    heading, _ = _pointing(task, point)
    toward = task.apparent[row] - task.centres[camera]
    aside = toward - (heading * toward).sum(-1)[:, None] * heading
    # d(1 / r^2) = -2 r . dr / r^4
    change = -2 * (task.weight**2)[:, None, None] * aside[:, :, None]
    return np.add.reduceat(change * toward[:, None, :], task.starts)


def _checked_rise(
    rise: ArrayLike | None, cameras: ArrayLike | None, surface: WaterSurface
) -> FloatArray:
    """Return by how much the water stood higher for each camera, shape (m,)."""
    count = 0 if cameras is None else as_points(cameras, "cameras", dimension=3).size // 3
    if rise is None:
        return np.zeros(count)
    rises = as_floats(rise, "rise")
    if rises.shape != (count,) or not np.isfinite(rises).all():
        raise InputError(f"rise: expected {count} finite numbers, one for each camera.")
    if not isinstance(surface, Plane):
        raise InputError("rise: the tide lifts a plane; this water surface has its own form.")
    return rises


def _checked_cameras(
    cameras: ArrayLike | None, surface: WaterSurface, rises: FloatArray
) -> FloatArray:
    """Return projection centres, shape (m, 3), all of them above the water."""
    if cameras is None:
        return np.zeros((0, 3))
    centres = as_points(cameras, "cameras", dimension=3).reshape(-1, 3)
    if not len(centres):
        raise InputError("cameras: no camera is given; leave them out for the nadir correction.")
    if not np.isfinite(centres).all():
        raise InputError("cameras: every coordinate must be a finite number.")
    under = np.flatnonzero(surface.side(centres) <= rises)
    if under.size:
        first = centres[under[0]]
        raise GeometryError(
            f"cameras: {under.size} of {len(centres)} are not above the water surface (first: "
            f"number {under[0] + 1} at Z = {first[2]:g} m). Check the water level, the sign of Z "
            "and the unit (m, not mm)."
        )
    return centres
