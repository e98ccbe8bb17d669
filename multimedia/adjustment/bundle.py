"""Bundle adjustment through the media: cameras, object points, plates and the media themselves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from multimedia.adjustment.bundle_columns import place_columns, with_common_values
from multimedia.adjustment.bundle_equations import Bundle, ImageObservations
from multimedia.adjustment.interior_choice import choose_interior, with_interior
from multimedia.adjustment.media_unknowns import WITH_VALUE
from multimedia.adjustment.plausibility import (
    EXACT,
    refuse_impossible_media,
    remarks_on_unknowns,
    wand_remarks,
    with_model_error,
)
from multimedia.adjustment.start_poses import bars_for, with_poses
from multimedia.adjustment.unknowns import AUTO, Adjustment, Unknowns
from multimedia.media.camera import EXTERIOR, Camera
from multimedia.orientation.calibration_covariance import with_covariance
from multimedia.orientation.intersection import intersect
from multimedia.orientation.object_rays import image_rays, nearest_points
from multimedia.orientation.plate_poses import FEWEST, plate_pose
from multimedia.projects.model import ObjectPoints, Project
from multimedia.remarks import remark
from photocore.adjustment import Fit, huber_weights
from photocore.adjustment.network import NetworkState
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera.rotation import skew
from photocore.camera.similarity import fit_similarity
from photocore.errors import ConvergenceError, GeometryError, InputError

#: Robust weights settle in a few rounds; more change nothing that matters.
ROBUST_ROUNDS = 8
#: Shares of the way from a camera to the surface: how close to it rays have to meet for their point
#: to start beyond it, and how far beyond.
_NEAR, _INSIDE = 0.1, 1e-3
#: Rounds and relative change in which the weight of the image coordinates settles.
BALANCE_ROUNDS, BALANCED = 5, 0.05


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
        If the data leave a combination of unknowns open: the message names them. If an index, a
        thickness, a radius or a gradient comes out as none that the media can have.
    ConvergenceError
        If the iteration does not settle.

    Notes
    -----
    Weighted least squares of image coordinates projected through the media (Maas 2015, Sect. 2),
    with the refractive index of any medium as an unknown (Maas 2015 on Maas 1995, Sect. 5).
    Analytic derivatives throughout. Up to 400 unknowns are solved by orthogonal decomposition;
    beyond, the points are eliminated (Schur complement). Without control points the datum of a
    free network is that of Helmert's inner constraints over the points (small problems) or over
    the cameras and plates (large ones, and where all points are on plates).
    """
    unknowns = unknowns or Unknowns()
    if project.without_pose:
        project, posed = with_poses(project, unknowns)
        result = bundle_adjust(project, unknowns)
        return replace(result, remarks=(*posed, *result.remarks))
    if unknowns.interior == AUTO:
        chosen = choose_interior(project, unknowns, bundle_adjust)
        result = bundle_adjust(project, with_interior(unknowns, chosen))
        choice = remark("bundle.chosen", names=", ".join(chosen) or "none")
        return replace(result, remarks=(choice, *result.remarks))
    bundle, remarks = prepare(project, unknowns)
    columns = bundle.columns
    if not columns.labels and not bundle.free.any():
        raise InputError("adjust: nothing to estimate; free a camera or add new points.")
    weights = np.ones_like(bundle.observations.image)
    bundle, fitted = _balanced(bundle, bundle.network.solve(bundle.start), weights)
    for _ in range(ROBUST_ROUNDS if unknowns.robust is not None else 0):
        assert unknowns.robust is not None
        plain = fitted.residuals[: weights.size].reshape(-1, 2) / np.sqrt(weights)
        new = huber_weights(plain, unknowns.robust)
        if np.abs(new - weights).max() < 1e-3:
            break
        weights = new
        fitted = _weighted(bundle, weights).network.solve(fitted.state)
        bundle, fitted = _balanced(bundle, fitted, weights)
    result = _adjustment(bundle, fitted, weights, remarks)
    refuse_impossible_media(bundle.project, columns, result, unknowns.priors)
    observations = bundle.observations
    order = tuple(observations.source[rows] for rows in observations.rows)
    result = with_model_error(result, order, unknowns.plates)
    doubts = wand_remarks(result, unknowns)
    doubts += remarks_on_unknowns(bundle.project, columns, result)
    whose = {f"{camera}:{name}": at for camera, labels in zip(project.camera_names, columns.cameras,
             strict=True) for name, at in labels.items()}  # fmt: skip
    whose |= {
        f"{of}:{name}": at for of, labels in columns.media.items() for name, at in labels.items()
    }
    project, lost = with_covariance(result.project, whose, result.covariance)
    return replace(result, project=project, remarks=(*result.remarks, *doubts, *lost))


def _weighted(bundle: Bundle, weights: FloatArray) -> Bundle:
    """Return the equations with robust weights of the image coordinates, shape (n, 2)."""
    observations = bundle.observations
    return replace(
        bundle, observations=replace(observations, sigma=observations.sigma / np.sqrt(weights))
    )


def _balanced(
    bundle: Bundle, fitted: Fit[NetworkState], weights: FloatArray
) -> tuple[Bundle, Fit[NetworkState]]:
    """Weigh image coordinates by what they are worth where priors stand beside them.

    Their sigmas only matter against one another until a prior is stated in its own unit: an
    image coordinate called five times too good would then push an index off by five times. With
    robust weights they are worth what remains without the gross errors.
    """
    for _ in range(BALANCE_ROUNDS if bundle.columns.priors else 0):
        observations = bundle.observations
        of_images = slice(0, observations.image.size)
        free = float(fitted.linear.redundancy_numbers[of_images].sum())
        worth = (
            float(np.sqrt((fitted.residuals[of_images] ** 2).sum() / free)) if free > 1e-6 else 1.0
        )
        if abs(worth - 1) < BALANCED or worth * observations.sigma.min() < EXACT:
            break
        bundle = replace(
            bundle, observations=replace(observations, sigma=observations.sigma * worth)
        )
        fitted = _weighted(bundle, weights).network.solve(fitted.state)
    return bundle, fitted


def prepare(project: Project, unknowns: Unknowns) -> tuple[Bundle, tuple[str, ...]]:
    """Return the equations of a project, and remarks about what was left out."""
    project = with_common_values(project, unknowns)
    unknowns = replace(unknowns, scale_bars=bars_for(project, unknowns))
    ids, rows, remarks = _used_points(project, unknowns)
    place = {name: row for row, name in enumerate(ids)}
    control = project.object_points
    points = np.full((len(ids), 3), np.nan)
    sigma = np.zeros((len(ids), 3))
    plate_of = np.full(len(ids), -1, dtype=np.int64)
    keep = [k for k, name in enumerate(control.ids) if name in place]
    with_control = [place[control.ids[k]] for k in keep]
    points[with_control], sigma[with_control] = control.xyz[keep], control.sigma[keep]
    for plate, name in enumerate(unknowns.plates):
        on = [place[control.ids[k]] for k in keep if control.groups[k] == name]
        if len(on) < 3:
            raise InputError(
                f"plates: {name!r} has {len(on)} object points in the images, at least 3 needed."
            )
        plate_of[on] = plate
    local = np.where(plate_of[:, None] >= 0, points, 0.0)
    movable = _movable(unknowns, points, sigma, plate_of)
    columns = place_columns(project, unknowns, ids, movable)
    poses = _start_poses(project, unknowns.plates, ids, plate_of, local)
    for plate, pose in enumerate(poses):
        on = plate_of == plate
        points[on] = local[on] @ pose.rotation.T + pose.centre
    points = _start_points(project, ids, points)
    weighted = movable & np.isfinite(sigma) & (sigma > 0) & (unknowns.control != "free")
    cameras, plates = dict(enumerate(project.cameras)), dict(enumerate(poses))
    start = NetworkState(
        blocks={"camera": cameras, "media": project.media, "plate": plates}, points=points,
        drift=np.zeros(len(columns.labels)),
    )  # fmt: skip
    bundle = Bundle(
        project=project, unknowns=unknowns, ids=ids, start=start,
        observations=_observations(project, rows, place), columns=columns, plate_of=plate_of,
        local=local, free=movable & (columns.points < 0), known=points,
        known_sigma=np.where(weighted, sigma, np.nan),
    )  # fmt: skip
    return replace(bundle, datum=bundle.datum_rows()), remarks


def _used_points(
    project: Project, unknowns: Unknowns
) -> tuple[tuple[str, ...], list[int], tuple[str, ...]]:
    """Return the points that can be used, the image rows that see them, and remarks."""
    images, control = project.image_points, project.object_points
    if not images.ids:
        raise InputError("adjust: the project has no image points.")
    rays = Counter(images.ids)
    controls = set(control.ids)
    alone = [name for name, count in rays.items() if name not in controls and count < 2]
    if unknowns.control == "free":
        plates = {
            i for i, g in zip(control.ids, control.groups, strict=True) if g in unknowns.plates
        }
        alone += [name for name in controls - plates if 0 < rays[name] < 2]
    unseen = [name for name in control.ids if rays[name] == 0]
    remarks = []
    for names, cameras in ((alone, "one camera only"), (unseen, "no camera")):
        if names:
            shown = ", ".join(names[:8]) + (" ..." if len(names) > 8 else "")
            words = {"points": "point" if len(names) == 1 else "points", "cameras": cameras}
            remarks.append(remark("bundle.left_out", count=len(names), names=shown, **words))
    dropped = set(alone)
    rows = [row for row, name in enumerate(images.ids) if name not in dropped]
    on_bars = {end for bar in unknowns.scale_bars for end in (bar.first, bar.second)}
    used = {images.ids[row] for row in rows} | (on_bars & controls)
    ids = [name for name in control.ids if name in used]
    ids += [name for name in images.names if name in used and name not in controls]
    if not rows:
        raise InputError("adjust: no point is measured in two cameras or is a control point.")
    return tuple(ids), rows, tuple(remarks)


def _movable(
    unknowns: Unknowns, points: FloatArray, sigma: FloatArray, plate_of: IntArray
) -> BoolArray:
    """Return which coordinates are unknowns of their own."""
    new: BoolArray = np.isnan(points)
    if unknowns.control == "weighted" and np.isnan(sigma[~new[:, 0]]).any():
        raise InputError(remark("adjust.control_sigmas"))
    free = unknowns.control == "free"
    return (new | (np.nan_to_num(sigma) > 0) | free) & (plate_of < 0)[:, None]


def _observations(project: Project, rows: list[int], place: dict[str, int]) -> ImageObservations:
    """Return the image points of the used rows."""
    images = project.image_points
    line = {name: k for k, name in enumerate(project.camera_names)}
    camera = np.array([line[images.cameras[row]] for row in rows])
    sigma = images.sigma[rows]
    return ImageObservations(
        source=np.array(rows),
        rows=tuple(np.flatnonzero(camera == k) for k in range(len(project.cameras))),
        point=np.array([place[images.ids[row]] for row in rows]),
        image=images.image[rows],
        sigma=np.where(np.isnan(sigma), project.sigma_image, sigma),
    )


def _start_points(project: Project, ids: Sequence[str], points: FloatArray) -> FloatArray:
    """Return the points with unknown ones intersected from the cameras' start orientations.

    Raises
    ------
    GeometryError
        If the rays of a point meet neither beyond the interface from these starts nor close to it.
    """
    missing = np.flatnonzero(np.isnan(points).any(axis=1))
    filled = points.copy()
    filled[missing] = _intersected(project, ids, missing)
    missing = missing[np.isnan(filled[missing]).any(axis=1)]
    filled[missing] = _just_inside(project, ids, missing)
    lost = [ids[j] for j in missing.tolist() if np.isnan(filled[j]).any()]
    if lost:
        raise GeometryError(remark("adjust.rays_lost", names=", ".join(lost[:8])))
    return filled


def _start_poses(
    project: Project, plates: Sequence[str], ids: Sequence[str], plate_of: IntArray,
    local: FloatArray,
) -> tuple[Camera, ...]:  # fmt: skip
    """Return the pose of each plate that fits its intersected points best.

    Raises
    ------
    GeometryError
        If neither three points of a plate can be intersected nor one camera sees enough of it, or
        these lie on a line.
    """
    poses = []
    for plate, label in enumerate(plates):
        on = np.flatnonzero(plate_of == plate)
        xyz = _intersected(project, ids, on)
        good = np.isfinite(xyz).all(axis=1)
        if good.sum() < 3:
            poses.append(_pose_from_one(project, [ids[j] for j in on.tolist()], local[on], label))
            continue
        start = fit_similarity(local[on][good], xyz[good])
        shift = start.target_centre - start.rotation @ start.source_centre
        poses.append(Camera(centre=shift, rotation=start.rotation, principal_distance=1.0))
    return tuple(poses)


def _pose_from_one(project: Project, names: Sequence[str], local: FloatArray, label: str) -> Camera:
    """Return the pose of a plate from the camera that sees most of it.

    Raises
    ------
    GeometryError
        If no camera sees enough of its points, or these give no pose.
    """
    image, _ = project.image_points.grid(project.camera_names, names)
    finite: BoolArray = np.asarray(np.isfinite(image).all(axis=2))
    k = int(finite.sum(axis=1).argmax())
    if finite[k].sum() < FEWEST:
        raise GeometryError(remark("adjust.plate_unseen", label=label, fewest=FEWEST))
    try:
        rotation, shift = plate_pose(
            project.cameras[k], local[finite[k]], image[k, finite[k]], project.interface_of(k)
        )
        return Camera(centre=shift, rotation=rotation, principal_distance=1.0)
    except (GeometryError, ConvergenceError, InputError) as error:
        raise GeometryError(
            f"adjust: plate {label}: camera {project.camera_names[k]} gives no start for its pose: "
            f"{error}"
        ) from None


def _intersected(project: Project, ids: Sequence[str], which: IntArray) -> FloatArray:
    """Return points intersected from the start orientations; NaN where that fails."""
    if not which.size or len(project.cameras) < 2:
        return np.full((which.size, 3), np.nan)
    image, _ = project.image_points.grid(project.camera_names, [ids[j] for j in which.tolist()])
    return intersect(project.cameras, image, project.interfaces).xyz


def _just_inside(project: Project, ids: Sequence[str], which: IntArray) -> FloatArray:
    """Return starts for points whose rays meet just before they enter the object's medium.

    In the midst of where they enter, and a little on. NaN where they meet elsewhere.
    """
    cameras = project.cameras
    image, _ = project.image_points.grid(project.camera_names, [ids[j] for j in which.tolist()])
    rays = [image_rays(camera, points, project.interface_of(k))
            for k, (camera, points) in enumerate(zip(cameras, image, strict=True))]  # fmt: skip
    origins, directions = np.array(rays).transpose(1, 0, 2, 3)
    centres = np.array([camera.centre for camera in cameras])
    away = np.linalg.norm(origins - centres[:, None], axis=2)
    meeting = nearest_points(list(origins), list(directions))
    depth = ((meeting - origins) * directions).sum(axis=2)
    count = np.isfinite(depth).sum(axis=0)
    is_near = (np.abs(depth) <= _NEAR * away) | np.isnan(depth)
    entries = np.nansum(origins + _INSIDE * away[..., None] * directions, axis=0)
    entries[(count < 2) | ~is_near.all(axis=0)] = np.nan
    return np.asarray(entries / np.maximum(count, 1)[:, None])


def _adjustment(
    bundle: Bundle, result: Fit[NetworkState], weights: FloatArray, remarks: tuple[str, ...]
) -> Adjustment:
    """Return everything in the project's own terms."""
    project, observations, state = bundle.project, bundle.observations, result.state
    unit = float(np.sqrt(np.mean(observations.sigma**2)))
    of_images = slice(0, weights.size)
    misses = result.residuals[of_images].reshape(-1, 2)
    shares = result.linear.redundancy_numbers[of_images].reshape(-1, 2)
    # The image rows, back in the order of the project's own table.
    rows, count = observations.source, len(project.image_points.ids)
    residuals, normed, numbers, weight, sigma = (np.full((count, 2), np.nan) for _ in range(5))
    residuals[rows] = -misses * observations.sigma / np.sqrt(weights)
    normed[rows] = -result.standardised[of_images].reshape(-1, 2)
    numbers[rows], weight[rows] = shares, weights
    sigma[rows] = observations.sigma * result.sigma0 / np.sqrt(weights)
    points, covariance = _points(bundle, result)
    values, change = _values(bundle, state)
    sigma0_of = {}
    for name, mine in zip(project.camera_names, observations.rows, strict=True):
        share = float(shares[mine].sum())
        square = float((misses[mine] ** 2).sum())
        sigma0_of[name] = unit * float(np.sqrt(square / share)) if share > 1e-9 else float("nan")
    return Adjustment(
        project=replace(
            project, cameras=tuple(state.blocks["camera"].values()), media=state.blocks["media"],
            object_points=points,
        ),
        names=bundle.columns.labels, values=values,
        covariance=change @ result.linear.cofactor @ change.T * result.sigma0**2,
        point_covariance=covariance, residuals=residuals, standardised=normed,
        redundancy_numbers=numbers, weights=weight, sigma_image=sigma,
        sigma0=result.sigma0 * unit, sigma0_of=sigma0_of, redundancy=result.redundancy,
        iterations=result.iterations, remarks=remarks,
    )  # fmt: skip


def _points(bundle: Bundle, result: Fit[NetworkState]) -> tuple[ObjectPoints, FloatArray]:
    """Return the adjusted object points and their covariances."""
    place, cofactor, state = bundle.columns, result.linear.cofactor, result.state
    covariance = result.linear.block_cofactor.copy()
    for j in np.flatnonzero((place.points >= 0).any(axis=1)):
        axes = np.flatnonzero(place.points[j] >= 0)
        columns = place.points[j][axes]
        covariance[j][np.ix_(axes, axes)] = cofactor[np.ix_(columns, columns)]
    for plate, at in enumerate(place.plates):
        pose = cofactor[np.ix_(list(at.values()), list(at.values()))]
        for j in np.flatnonzero(bundle.plate_of == plate):
            arm = state.points[j] - state.blocks["plate"][plate].centre
            rows = np.concatenate([np.eye(3), -skew(arm)], axis=1)
            covariance[j] = rows @ pose @ rows.T
    control = bundle.project.object_points
    group = dict(zip(control.ids, control.groups, strict=True))
    names = set(bundle.ids)
    unseen = [row for row, name in enumerate(control.ids) if name not in names]
    ids = (*bundle.ids, *(control.ids[row] for row in unseen))
    full = np.concatenate([covariance * result.sigma0**2, np.full((len(unseen), 3, 3), np.nan)])
    return ObjectPoints(
        ids=ids, xyz=np.concatenate([state.points, control.xyz[unseen]]),
        sigma=np.sqrt(np.diagonal(full, axis1=1, axis2=2)),
        groups=tuple(group.get(name, "new") for name in ids),
    ), full  # fmt: skip


def _values(bundle: Bundle, state: NetworkState) -> tuple[FloatArray, FloatArray]:
    """Return the adjusted unknowns, and the change from rotation vectors to angles."""
    place = bundle.columns
    values, change = state.drift.copy(), np.eye(len(place.labels))
    poses = (*state.blocks["camera"].values(), *state.blocks["plate"].values())
    for at, camera in zip((*place.cameras, *place.plates), poses, strict=True):
        for name, column in at.items():
            values[column] = camera.value(name)
        turns = [at[name] for name in EXTERIOR[3:] if name in at]
        if turns:
            change[np.ix_(turns, turns)] = _rates(camera)
    for who, at in place.media.items():
        interface = state.blocks["media"][who]
        for name, column in at.items():
            if name.startswith(WITH_VALUE):
                values[column] = interface.value(name)
    kept = place.points >= 0
    values[place.points[kept]] = state.points[kept]
    return values, change


def _rates(camera: Camera) -> FloatArray:
    """Return the change from rotation vector to angles; NaN where angles have no precision."""
    try:
        return camera.angle_rates()
    except GeometryError:
        return np.full((3, 3), np.nan)
