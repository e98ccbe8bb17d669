"""Bundle adjustment through the media: cameras, object points, plates and the media themselves."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np

from multimedia.adjustment.bundle_dense import LARGEST, solve_dense
from multimedia.adjustment.bundle_problem import (
    Observations,
    Problem,
    State,
    place_columns,
    with_common_values,
)
from multimedia.adjustment.bundle_sparse import redundancy_numbers, solve_sparse
from multimedia.adjustment.bundle_starts import start_points, start_poses
from multimedia.adjustment.unknowns import Adjustment, Unknowns
from multimedia.media.camera import EXTERIOR, Camera
from multimedia.media.flat_interface import FlatInterface
from multimedia.projects.model import ObjectPoints, Project
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.errors import GeometryError, InputError

#: Robust weights settle in a few rounds; more change nothing that matters.
ROBUST_ROUNDS = 8


def bundle_adjust(project: Project, unknowns: Unknowns | None = None) -> Adjustment:
    """Adjust cameras, object points and media together.

    Parameters
    ----------
    project : Project
        Cameras with start values, media, image points, control points. Points that are measured
        in two cameras or more and are not control are determined as new points.
    unknowns : Unknowns, optional
        What to estimate; by default every exterior orientation and every new point.

    Returns
    -------
    Adjustment

    Raises
    ------
    InputError
        If the project lacks measurements, or names in ``unknowns`` do not exist.
    GeometryError
        If the data leave a combination of unknowns open: the message names them.
    ConvergenceError
        If the iteration does not settle.

    Notes
    -----
    Weighted least squares of image coordinates projected through the media (Maas 2015, Sect. 2),
    with the refractive index of any medium as an unknown (Maas 2015 on Maas 1995, Sect. 5).
    Analytic derivatives throughout. Up to 400 unknowns are solved by orthogonal decomposition;
    beyond, the points are eliminated (Schur complement). Without control points the datum of a
    free network is that of Helmert's inner constraints over the points (small problems) or over
    the cameras (large ones).
    """
    unknowns = unknowns or Unknowns()
    problem, remarks = prepare(project, unknowns)
    weights = np.ones_like(problem.observations.image)
    solution = _solve(problem, weights)
    if unknowns.robust is not None:
        for _ in range(ROBUST_ROUNDS):
            # Residuals in units of the robust spread: the median of |N| is 0.6745.
            spread = max(float(np.median(np.abs(solution.miss))) / 0.6745, 1e-300)
            size = np.maximum(np.abs(solution.miss) / spread, 1e-300)
            new = np.minimum(1.0, unknowns.robust / size)
            if np.abs(new - weights).max() < 1e-3:
                break
            weights = new
            solution = _solve(replace(problem, start=solution.state), weights)
    return _result(problem, solution, weights, remarks)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solution:
    """What either way of solving gives, for unit weight."""

    state: State
    miss: FloatArray
    cofactor: FloatArray
    point_cofactor: FloatArray
    redundancy_numbers: FloatArray
    square_sum: float
    redundancy: int
    iterations: int


def prepare(project: Project, unknowns: Unknowns) -> tuple[Problem, tuple[str, ...]]:
    """Return the equations of a project, and remarks about what was left out."""
    project = with_common_values(project, unknowns.media)
    ids, rows, remarks = _used_points(project, unknowns)
    place = {name: row for row, name in enumerate(ids)}
    control = project.object_points
    points = np.full((len(ids), 3), np.nan)
    sigma = np.zeros((len(ids), 3))
    plate_of = np.full(len(ids), -1, dtype=np.int64)
    given = np.array([place[name] for name in control.ids if name in place], dtype=np.int64)
    keep = np.array([k for k, name in enumerate(control.ids) if name in place], dtype=np.int64)
    points[given] = control.xyz[keep]
    assert control.sigma is not None
    sigma[given] = control.sigma[keep]
    for plate, name in enumerate(unknowns.plates):
        on = [place[i] for i, g in zip(control.ids, control.groups, strict=True) if g == name]
        if len(on) < 3:
            raise InputError(f"plates: {name!r} has {len(on)} object points, at least 3 needed.")
        plate_of[on] = plate
    local = np.where(plate_of[:, None] >= 0, points, 0.0)
    movable = _movable(unknowns, points, sigma, plate_of)
    observations = _observations(project, rows, place)
    columns = place_columns(project, unknowns, ids, movable)
    poses = start_poses(project, unknowns.plates, ids, plate_of, local)
    for plate, (rotation, shift) in enumerate(poses):
        on_plate = plate_of == plate
        points[on_plate] = local[on_plate] @ rotation.T + shift
    points = start_points(project, ids, points)
    weighted = movable & np.isfinite(sigma) & (sigma > 0) & (plate_of < 0)[:, None]
    if unknowns.control == "free":
        weighted[:] = False
    start = State(
        cameras=project.cameras, media=dict(project.media), points=points, poses=poses,
        drift=np.zeros(len(columns.labels)),
    )  # fmt: skip
    problem = Problem(
        project=project, unknowns=unknowns, ids=ids, start=start, observations=observations,
        columns=columns, plate_of=plate_of, local=local, free=movable & (columns.points < 0),
        known=points, known_sigma=np.where(weighted, sigma, np.nan),
    )  # fmt: skip
    return problem, remarks


def _used_points(
    project: Project, unknowns: Unknowns
) -> tuple[tuple[str, ...], list[int], tuple[str, ...]]:
    """Return the points that can be used, the image rows that see them, and remarks."""
    images, control = project.image_points, project.object_points
    if not images.ids:
        raise InputError("adjust: the project has no image points.")
    rays = Counter(images.ids)
    known = set(control.ids)
    alone = [name for name, count in rays.items() if name not in known and count < 2]
    if unknowns.control == "free":
        plates = {
            i for i, g in zip(control.ids, control.groups, strict=True) if g in unknowns.plates
        }
        alone += [name for name in known - plates if 0 < rays[name] < 2]
    unseen = [name for name in control.ids if rays[name] == 0]
    remarks = []
    for names, why in ((alone, "measured in one camera only"), (unseen, "measured in no camera")):
        if names:
            shown = ", ".join(names[:8]) + (" ..." if len(names) > 8 else "")
            remarks.append(f"{len(names)} point(s) {why}, left out: {shown}")
    dropped = set(alone)
    rows = [row for row, name in enumerate(images.ids) if name not in dropped]
    on_bars = {end for bar in unknowns.scale_bars for end in (bar.first, bar.second)}
    used = {images.ids[row] for row in rows} | (on_bars & known)
    ids = [name for name in control.ids if name in used]
    ids += [name for name in images.names if name in used and name not in known]
    if not rows:
        raise InputError("adjust: no point is measured in two cameras or is a control point.")
    return tuple(ids), rows, tuple(remarks)


def _movable(
    unknowns: Unknowns, points: FloatArray, sigma: FloatArray, plate_of: IntArray
) -> BoolArray:
    """Return which coordinates are unknowns of their own."""
    new: BoolArray = np.isnan(points)
    if unknowns.control == "free":
        movable: BoolArray = np.ones_like(new)
    elif unknowns.control == "weighted":
        if np.isnan(sigma[~new[:, 0]]).any():
            raise InputError(
                "control = weighted: every control point needs a sigma (0 for an error-free one)."
            )
        movable = new | (sigma > 0)
    else:
        movable = new | (np.nan_to_num(sigma) > 0)
    return movable & (plate_of < 0)[:, None]


def _observations(project: Project, rows: list[int], place: dict[str, int]) -> Observations:
    """Return the image points of the used rows."""
    images = project.image_points
    line = {name: k for k, name in enumerate(project.camera_names)}
    camera = np.array([line[images.cameras[row]] for row in rows])
    assert images.sigma is not None
    sigma = images.sigma[rows]
    return Observations(
        rows=tuple(np.flatnonzero(camera == k) for k in range(len(project.cameras))),
        point=np.array([place[images.ids[row]] for row in rows]),
        image=images.image[rows],
        sigma=np.where(np.isnan(sigma), project.sigma_image, sigma),
    )


def _solve(problem: Problem, weights: FloatArray) -> _Solution:
    """Adjust with the given weights, the dense or the sparse way."""
    seen = problem.observations
    problem = replace(problem, observations=replace(seen, sigma=seen.sigma / np.sqrt(weights)))
    unknowns = problem.dense_count + int(problem.free.sum())
    if unknowns == 0:
        raise InputError("adjust: nothing to estimate; free a camera or add new points.")
    observed = 2 * len(seen.point)
    if unknowns > LARGEST:
        sparse = solve_sparse(problem, what="adjustment")
        extra = len(sparse.linear.extra_miss)
        return _Solution(
            state=sparse.state, miss=sparse.linear.miss / np.sqrt(weights),
            cofactor=sparse.cofactor, point_cofactor=sparse.point_cofactor,
            redundancy_numbers=redundancy_numbers(problem, sparse), square_sum=sparse.cost,
            redundancy=observed + extra - unknowns, iterations=sparse.iterations,
        )  # fmt: skip
    found, datum = solve_dense(problem, what="adjustment")
    dense = problem.dense_count
    points = np.zeros((len(problem.ids), 3, 3))
    frees = np.argwhere(problem.free)
    for a, (j, axis) in enumerate(frees.tolist()):
        for b in range(max(0, a - 2), min(len(frees), a + 3)):
            if frees[b, 0] == j:
                points[j, axis, frees[b, 1]] = found.cofactor[dense + a, dense + b]
    numbers = found.redundancy_numbers[:observed].reshape(-1, 2)
    residuals = found.residuals[: len(found.residuals) - len(datum)]
    return _Solution(
        state=found.state, miss=residuals[:observed].reshape(-1, 2) / np.sqrt(weights),
        cofactor=found.cofactor[:dense, :dense], point_cofactor=points,
        redundancy_numbers=numbers, square_sum=float(residuals @ residuals),
        redundancy=found.redundancy, iterations=found.iterations,
    )  # fmt: skip


def _result(
    problem: Problem, solution: _Solution, weights: FloatArray, remarks: tuple[str, ...]
) -> Adjustment:
    """Return everything in the project's own terms."""
    project, seen = problem.project, problem.observations
    factor = np.nan
    if solution.redundancy > 0:
        factor = float(np.sqrt(solution.square_sum / solution.redundancy))
    unit = float(np.sqrt(np.mean(seen.sigma**2)))
    # The image rows, back in the order of the project's own table.
    rows = _rows_of(problem)
    count = len(project.image_points.ids)
    residuals, normed, numbers, weight = (np.full((count, 2), np.nan) for _ in range(4))
    residuals[rows] = -solution.miss * seen.sigma
    with np.errstate(divide="ignore", invalid="ignore"):
        own = factor * np.sqrt(np.maximum(solution.redundancy_numbers, 0.0) / weights)
        normed[rows] = np.where(solution.redundancy_numbers > 1e-9, -solution.miss / own, np.nan)
    numbers[rows], weight[rows] = solution.redundancy_numbers, weights
    points, covariance = _points(problem, solution, factor)
    adjusted = replace(
        project, cameras=solution.state.cameras, media=solution.state.media, object_points=points
    )
    values, change = _values(problem, solution.state)
    return Adjustment(
        project=adjusted, names=problem.columns.labels, values=values,
        covariance=change @ solution.cofactor @ change.T * factor**2,
        point_covariance=covariance, residuals=residuals, standardised=normed,
        redundancy_numbers=numbers, weights=weight, sigma0=factor * unit,
        redundancy=solution.redundancy, iterations=solution.iterations,
        sigma0_of=_sigma0_of(problem, solution, weights, unit), remarks=remarks,
    )  # fmt: skip


def _rows_of(problem: Problem) -> IntArray:
    """Return the row of the project's image points that each observation came from."""
    images = problem.project.image_points
    cameras = problem.project.camera_names
    camera = np.empty(len(problem.observations.point), dtype=np.int64)
    for k, own in enumerate(problem.observations.rows):
        camera[own] = k
    row_of = {pair: row for row, pair in enumerate(zip(images.cameras, images.ids, strict=True))}
    return np.array(
        [
            row_of[cameras[k], problem.ids[j]]
            for k, j in zip(camera, problem.observations.point, strict=True)
        ],
        dtype=np.int64,
    )


def _points(
    problem: Problem, solution: _Solution, factor: float
) -> tuple[ObjectPoints, FloatArray]:
    """Return the adjusted object points and their covariances."""
    place = problem.columns
    covariance = solution.point_cofactor * factor**2
    for j in np.flatnonzero((place.points >= 0).any(axis=1)):
        axes = np.flatnonzero(place.points[j] >= 0)
        block = solution.cofactor[np.ix_(place.points[j][axes], place.points[j][axes])]
        covariance[j][np.ix_(axes, axes)] = block * factor**2
    for plate, first in enumerate(place.plates):
        pose = solution.cofactor[first : first + 6, first : first + 6] * factor**2
        shift = solution.state.poses[plate][1]
        for j in np.flatnonzero(problem.plate_of == plate):
            x, y, z = solution.state.points[j] - shift
            lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
            rows = np.concatenate([np.eye(3), lever], axis=1)
            covariance[j] = rows @ pose @ rows.T
    control = problem.project.object_points
    group = dict(zip(control.ids, control.groups, strict=True))
    ids = (*problem.ids, *(name for name in control.ids if name not in set(problem.ids)))
    rest = np.array([control.ids.index(name) for name in ids[len(problem.ids) :]], dtype=np.int64)
    xyz = np.concatenate([solution.state.points, control.xyz[rest]])
    unseen = np.full((len(rest), 3, 3), np.nan)
    full = np.concatenate([covariance, unseen])
    return ObjectPoints(
        ids=ids, xyz=xyz, sigma=np.sqrt(np.diagonal(full, axis1=1, axis2=2)),
        groups=tuple(group.get(name, "new") for name in ids),
    ), full  # fmt: skip


def _values(problem: Problem, state: State) -> tuple[FloatArray, FloatArray]:
    """Return the adjusted dense unknowns, and the change from rotation vectors to angles."""
    place, inner = problem.columns, problem.unknowns.interior
    values, change = state.drift.copy(), np.eye(problem.dense_count)
    for k, camera in enumerate(state.cameras):
        first, second = place.exterior[k], place.interior[k]
        if first is not None:
            values[first : first + 6] = [camera.value(name) for name in EXTERIOR]
            change[first + 3 : first + 6, first + 3 : first + 6] = _rates(camera)
        if second is not None:
            values[second : second + len(inner)] = [camera.value(name) for name in inner]
    for who, name, column in place.media:
        interface = state.media[who]
        if name.startswith(("index", "thickness")) and isinstance(interface, FlatInterface):
            values[column] = interface.value(name)
    for plate, first in enumerate(place.plates):
        rotation, shift = state.poses[plate]
        stand_in = Camera(centre=shift, rotation=rotation, principal_distance=1.0)
        values[first : first + 6] = [*shift, *stand_in.angles]
        change[first + 3 : first + 6, first + 3 : first + 6] = _rates(stand_in)
    for j, axis in np.argwhere(place.points >= 0).tolist():
        values[place.points[j, axis]] = state.points[j, axis]
    return values, change


def _rates(camera: Camera) -> FloatArray:
    """Return the change from rotation vector to angles; NaN where angles have no precision."""
    try:
        return camera.angle_rates()
    except GeometryError:
        return np.full((3, 3), np.nan)


def _sigma0_of(
    problem: Problem, solution: _Solution, weights: FloatArray, unit: float
) -> dict[str, float]:
    """Return sigma0 of each camera: square sum over the sum of redundancy numbers. [mm]"""
    sigma0 = {}
    for k, name in enumerate(problem.project.camera_names):
        rows = problem.observations.rows[k]
        share = float(solution.redundancy_numbers[rows].sum())
        square = float((solution.miss[rows] ** 2 * weights[rows]).sum())
        sigma0[name] = unit * float(np.sqrt(square / share)) if share > 1e-9 else float("nan")
    return sigma0
