"""A project turned into the equations of its bundle adjustment, with a start for every unknown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container, Sequence
from dataclasses import replace

import numpy as np

from multimedia.adjustment.bundle_columns import place_columns, with_common_values
from multimedia.adjustment.bundle_equations import Bundle, ImageObservations
from multimedia.adjustment.start_poses import bars_for
from multimedia.adjustment.unknowns import Unknowns
from multimedia.media import Camera
from multimedia.orientation import FEWEST, image_rays, intersect, nearest_points, plate_pose
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.adjustment.network import NetworkState
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import fit_similarity
from photocore.errors import ConvergenceError, GeometryError, InputError

#: Shares of the way from a camera to the surface: how close to it rays have to meet for their point
#: to start beyond it, and how far beyond.
_NEAR, _INSIDE = 0.1, 1e-3


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
    filled[missing] = _met(project, [ids[j] for j in missing.tolist()])
    lost = [ids[j] for j in missing.tolist() if np.isnan(filled[j]).any()]
    if lost:
        raise GeometryError(remark("adjust.rays_lost", names=", ".join(lost[:8])))
    return filled


def points_without_start(project: Project, fixed: Container[str]) -> set[str]:
    """Return the names of new points whose rays do not meet beyond the interface from the start."""
    rays = Counter(project.image_points.ids)
    names = [name for name, count in rays.items() if name not in fixed and count > 1]
    places = _intersected(project, names)
    return {names[j] for j in np.flatnonzero(np.isnan(places[:, 0]))}


def _met(project: Project, names: Sequence[str]) -> FloatArray:
    """Return where rays meet beyond the interface, or just before it; NaN where they do neither."""
    places = _intersected(project, names)
    missing = np.flatnonzero(np.isnan(places).any(axis=1))
    places[missing] = _just_inside(project, [names[j] for j in missing.tolist()])
    return places


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
        xyz = _intersected(project, [ids[j] for j in on.tolist()])
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


def _intersected(project: Project, names: Sequence[str]) -> FloatArray:
    """Return points intersected from the start orientations; NaN where that fails."""
    if not names or len(project.cameras) < 2:
        return np.full((len(names), 3), np.nan)
    image, _ = project.image_points.grid(project.camera_names, names)
    return intersect(project.cameras, image, project.interfaces).xyz


def _just_inside(project: Project, names: Sequence[str]) -> FloatArray:
    """Return starts for points whose rays meet just before they enter the object's medium.

    In the midst of where they enter, and a little on. NaN where they meet elsewhere.
    """
    cameras = project.cameras
    image, _ = project.image_points.grid(project.camera_names, names)
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
