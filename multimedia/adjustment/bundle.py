"""Bundle adjustment through the media: cameras, object points, plates and the media themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multimedia.adjustment.bundle_equations import Bundle
from multimedia.adjustment.bundle_start import prepare
from multimedia.adjustment.contradictions import SETTLED, contradicting_rows, with_weights
from multimedia.adjustment.interior_choice import choose_interior, with_interior
from multimedia.adjustment.media_unknowns import WITH_VALUE
from multimedia.adjustment.plausibility import (
    EXACT,
    refuse_impossible_media,
    remarks_on_unknowns,
    wand_remarks,
    with_model_error,
)
from multimedia.adjustment.start_poses import with_poses
from multimedia.adjustment.unknowns import AUTO, Adjustment, Unknowns
from multimedia.media import EXTERIOR, Camera
from multimedia.media import project as project_points
from multimedia.orientation import names_of, with_covariance, without_rows
from multimedia.projects import SHOWN, ImagePoints, ObjectPoints, Project
from multimedia.remarks import remark
from photocore.adjustment import Fit, huber_weights
from photocore.adjustment.network import NetworkState
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import skew
from photocore.errors import ConvergenceError, GeometryError, InputError, PhotogrammetryError

#: Robust weights settle in a few rounds; more change nothing that matters.
ROBUST_ROUNDS = 8
#: Rounds and relative change in which the weight of the image coordinates settles.
BALANCE_ROUNDS, BALANCED = 5, 0.05
#: Standard deviations by which a new point may come out before the last face.
BEFORE_FACE = 3.0
#: A largest residual of so many times the typical one may come of another point.
GROSS = 15.0


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
    if unknowns.robust is None:
        try:
            return _with_doubts(_as_chosen(project, unknowns), project, unknowns)
        except (ConvergenceError, GeometryError) as error:
            for words in _contradictions(project, unknowns):
                raise GeometryError(words) from error
            raise
    is_out = contradicting_rows(project, unknowns)
    if not is_out.any():
        return _as_chosen(project, unknowns)
    result = _as_chosen(without_rows(project, is_out), unknowns)
    left_out = remark("bundle.strays", **names_of(project.image_points, is_out))
    return replace(
        _with_rows(result, project.image_points, is_out), remarks=(left_out, *result.remarks)
    )


def _as_chosen(project: Project, unknowns: Unknowns) -> Adjustment:
    """Return the adjustment, with the interior parameters that the data carry where so wanted."""
    if unknowns.interior != AUTO:
        return _adjusted(project, unknowns)
    chosen = choose_interior(project, unknowns, _adjusted)
    result = _adjusted(project, with_interior(unknowns, chosen))
    choice = remark("bundle.chosen", names=", ".join(chosen) or "none")
    return replace(result, remarks=(choice, *result.remarks))


def _with_rows(result: Adjustment, points: ImagePoints, is_out: BoolArray) -> Adjustment:
    """Return an adjustment with the image points that were left out: weight 0, and how far off."""
    place = dict(zip(result.project.object_points.ids, result.project.object_points.xyz,
                     strict=True))  # fmt: skip
    off = np.full((len(is_out), 2), np.nan)
    for row in np.flatnonzero(is_out).tolist():
        k = result.project.camera_index(points.cameras[row])
        if points.ids[row] in place:
            camera, media = result.project.cameras[k], result.project.interface_of(k)
            off[row] = points.image[row] - project_points(camera, place[points.ids[row]], media)

    def filled(values: FloatArray, of_others: FloatArray) -> FloatArray:
        of_others[~is_out] = values
        return of_others

    ones = np.ones_like(off)
    return replace(
        result, project=replace(result.project, image_points=points),
        residuals=filled(result.residuals, off.copy()),
        standardised=filled(result.standardised, off / result.sigma0),
        redundancy_numbers=filled(result.redundancy_numbers, ones.copy()),
        weights=filled(result.weights, np.zeros_like(off)),
        sigma_image=filled(result.sigma_image, result.sigma0 * ones),
    )  # fmt: skip


def _with_doubts(result: Adjustment, start: Project, unknowns: Unknowns) -> Adjustment:
    """Return an adjustment with a remark on image points that contradict the others.

    They are looked for from the start, for the result may have followed them.
    """
    size = np.abs(result.residuals[np.isfinite(result.residuals)])
    if not size.max(initial=0.0) > GROSS * np.median(size):
        return result
    doubts = _contradictions(start, unknowns)
    return replace(result, remarks=(*doubts, *result.remarks))


def _contradictions(project: Project, unknowns: Unknowns) -> tuple[str, ...]:
    """Return what to say of image points that contradict the others, if there are any."""
    try:
        is_wrong = contradicting_rows(project, unknowns)
    except PhotogrammetryError:  # without them, too, something is amiss
        return ()
    if not is_wrong.any():
        return ()
    return (remark("bundle.contradict", **names_of(project.image_points, is_wrong)),)


def _adjusted(project: Project, unknowns: Unknowns) -> Adjustment:
    """Return the adjustment of image points and unknowns as they are."""
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
        if np.abs(new - weights).max() < SETTLED:
            break
        state, weights = with_weights(bundle, fitted.state, unknowns.robust)
        fitted = bundle.weighted(weights).network.solve(state)
        bundle, fitted = _balanced(bundle, fitted, weights)
    result = _adjustment(bundle, fitted, weights, remarks)
    distance, normals = bundle.before_faces(fitted.state)
    spread = result.point_covariance[: len(distance)]
    sigma = np.sqrt(np.einsum("ni,nij,nj->n", normals, spread, normals))
    if (distance > BEFORE_FACE * sigma).any():
        return _without_points(bundle, unknowns, distance > BEFORE_FACE * sigma)
    if distance.any():
        names = [bundle.ids[j] for j in np.flatnonzero(distance).tolist()]
        shown = ", ".join(names[:SHOWN]) + (" ..." if len(names) > SHOWN else "")
        most = f"{distance.max():.2g} {project.unit}"
        within = remark("bundle.before_face", count=len(names), most=most, names=shown)
        result = replace(result, remarks=(*result.remarks, within))
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


def _without_points(bundle: Bundle, unknowns: Unknowns, is_before: BoolArray) -> Adjustment:
    """Return the adjustment without new points that came to lie far before the last face.

    Raises
    ------
    GeometryError
        If others lie there.
    """
    is_new: BoolArray = np.asarray((bundle.free | (bundle.columns.points >= 0)).all(axis=1))
    bars = {end for bar in unknowns.scale_bars for end in (bar.first, bar.second)}
    needed = [bundle.ids[j] for j in np.flatnonzero(is_before).tolist()
              if not is_new[j] or bundle.ids[j] in bars]  # fmt: skip
    if needed:
        raise GeometryError(remark("adjust.before_face", names=", ".join(needed[:8])))
    project, images = bundle.project, bundle.project.image_points
    lost = {bundle.ids[j] for j in np.flatnonzero(is_before).tolist()}
    is_out = np.array([name in lost for name in images.ids])
    result = _adjusted(without_rows(project, is_out), unknowns)
    left_out = remark("bundle.left_before_face", **names_of(images, is_out))
    return replace(_with_rows(result, images, is_out), remarks=(left_out, *result.remarks))


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
        fitted = bundle.weighted(weights).network.solve(fitted.state)
    return bundle, fitted


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
