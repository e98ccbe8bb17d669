"""The equations of a bundle adjustment: which unknown is which column, residuals, derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from multimedia.adjustment.unknowns import Unknowns
from multimedia.media.camera import EXTERIOR, Camera
from multimedia.media.flat_interface import FlatInterface
from multimedia.media.interfaces import Interfaces
from multimedia.media.projection import project_with_jacobian
from multimedia.projects.model import Project
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.errors import GeometryError, InputError
from photocore.rotation import rotation_from_vector

#: Media parameters that are properties of a material: one value for all media unless named.
_MATERIAL = ("index", "thickness")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """Everything that changes during the iteration.

    Attributes
    ----------
    cameras : tuple of Camera
    media : mapping of str to FlatInterface
    points : ndarray, shape (p, 3)
        World coordinates; those on plates follow from the pose.
    poses : tuple of (rotation (3, 3), shift (3,))
        World from plate.
    drift : ndarray, shape (u,)
        Sum of all steps of the dense unknowns: for priors, and for values that count from 0.
    """

    cameras: tuple[Camera, ...]
    media: Mapping[str, FlatInterface | Interfaces]
    points: FloatArray
    poses: tuple[tuple[FloatArray, FloatArray], ...]
    drift: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Observations:
    """Image points as the adjustment uses them: row r sees point ``point[r]`` in camera ..."""

    rows: tuple[IntArray, ...]
    point: IntArray
    image: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """Place of every dense unknown.

    Attributes
    ----------
    labels : tuple of str
    exterior : tuple of int or None per camera
        First of six columns.
    interior : tuple of int or None per camera
        First column of its set.
    media : tuple of (media name, parameter, column)
    plates : tuple of int
        First of six columns of each plate.
    points : ndarray of int, shape (p, 3)
        Column of a coordinate that is a dense unknown (ends of scale bars), else -1.
    """

    labels: tuple[str, ...]
    exterior: tuple[int | None, ...]
    interior: tuple[int | None, ...]
    media: tuple[tuple[str, str, int], ...]
    plates: tuple[int, ...]
    points: IntArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linear:
    """Weighted linear equations of one state.

    Attributes
    ----------
    miss : ndarray, shape (n, 2)
        Computed minus measured over sigma.
    columns : list of ndarray per camera
        Dense columns its rows touch.
    dense : list of ndarray per camera, shape (n_k, 2, c_k)
    by_point : ndarray, shape (n, 2, 3)
        Derivatives by the eliminated coordinates; 0 where a coordinate is not one.
    extra_miss : ndarray, shape (e,)
        Weighted coordinates, priors, scale bars.
    extra_dense : ndarray, shape (e, u)
    extra_point : ndarray of int, shape (e,)
        Eliminated point the row also touches, else -1.
    extra_by_point : ndarray, shape (e, 3)
    """

    miss: FloatArray
    columns: list[IntArray]
    dense: list[FloatArray]
    by_point: FloatArray
    extra_miss: FloatArray
    extra_dense: FloatArray
    extra_point: IntArray
    extra_by_point: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """A project and the unknowns wanted of it, turned into equations.

    Attributes
    ----------
    project : Project
    unknowns : Unknowns
    ids : tuple of str
        All object points, control first, new ones behind.
    start : State
    observations : Observations
    columns : Columns
    plate_of : ndarray of int, shape (p,)
        Plate of each point, -1 for none.
    local : ndarray, shape (p, 3)
        Coordinates in the plate's frame.
    free : ndarray of bool, shape (p, 3)
        Coordinates eliminated as unknowns of their own.
    known : ndarray, shape (p, 3)
        Given coordinates of weighted points.
    known_sigma : ndarray, shape (p, 3)
        Their standard deviations, NaN where not weighted.
    """

    project: Project
    unknowns: Unknowns
    ids: tuple[str, ...]
    start: State
    observations: Observations
    columns: Columns
    plate_of: IntArray
    local: FloatArray
    free: BoolArray
    known: FloatArray
    known_sigma: FloatArray
    names: tuple[tuple[str, ...], tuple[str, ...]] = field(default=(EXTERIOR, ()))

    @property
    def dense_count(self) -> int:
        """Number of dense unknowns."""
        return len(self.columns.labels)

    def linear(self, state: State) -> Linear | None:
        """Return the equations at a state; None if a point is not seen there."""
        observations = self.observations
        miss = np.empty((len(observations.point), 2))
        by_point = np.zeros((len(observations.point), 2, 3))
        columns: list[IntArray] = []
        dense: list[FloatArray] = []
        for k, camera in enumerate(state.cameras):
            rows = observations.rows[k]
            found = self._camera_rows(state, k, camera, rows)
            if found is None:
                return None
            miss[rows], at, block, by_point[rows] = found
            columns.append(at)
            dense.append(block / observations.sigma[rows][:, :, None])
        miss = (miss - observations.image) / observations.sigma
        by_point /= observations.sigma[:, :, None]
        extra_miss, extra_dense, extra_point, extra_by_point = self._extra(state)
        return Linear(
            miss=miss, columns=columns, dense=dense, by_point=by_point, extra_miss=extra_miss,
            extra_dense=extra_dense, extra_point=extra_point, extra_by_point=extra_by_point,
        )  # fmt: skip

    def _camera_rows(
        self, state: State, k: int, camera: Camera, rows: IntArray
    ) -> tuple[FloatArray, IntArray, FloatArray, FloatArray] | None:
        """Return image, touched columns, their derivatives and those by free coordinates."""
        place = self.columns
        medium = self.project.media_of[k]
        interface = state.media[medium] if medium else None
        outer = EXTERIOR if place.exterior[k] is not None else ()
        inner = self.unknowns.interior if place.interior[k] is not None else ()
        own = [(name, column) for who, name, column in place.media if who == medium and medium]
        points = state.points[self.observations.point[rows]]
        try:
            found = project_with_jacobian(
                camera, points, interface, camera_names=(*outer, *inner),
                interface_names=tuple(name for name, _ in own),
            )  # fmt: skip
        except GeometryError:
            return None
        if not np.isfinite(found.image).all():
            return None
        first, second = place.exterior[k], place.interior[k]
        at = [
            *(range(first, first + 6) if first is not None else ()),
            *(range(second, second + len(inner)) if second is not None else ()),
            *(column for _, column in own),
        ]
        blocks = [found.by_camera, found.by_interface]
        which = self.observations.point[rows]
        for plate, column in enumerate(place.plates):
            on = self.plate_of[which] == plate
            if on.any():
                _, shift = state.poses[plate]
                arm = points - shift
                by_pose = np.zeros((len(rows), 2, 6))
                by_pose[on, :, :3] = found.by_point[on]
                # A small turn v moves the point by v x arm: row . (v x arm) = (arm x row) . v.
                by_pose[on, :, 3:] = np.cross(arm[on][:, None, :], found.by_point[on])
                blocks.append(by_pose)
                at += range(column, column + 6)
        ends = np.unique(which[(place.points[which] >= 0).any(axis=1)])
        for end in ends:
            by_end = np.where((which == end)[:, None, None], found.by_point, 0.0)
            moving = place.points[end] >= 0
            blocks.append(by_end[:, :, moving])
            at += place.points[end][moving].tolist()
        eliminated = found.by_point * self.free[which][:, None, :]
        return found.image, np.array(at, dtype=np.int64), np.concatenate(blocks, 2), eliminated

    def _extra(self, state: State) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
        """Return the rows of weighted coordinates, priors and scale bars."""
        miss: list[float] = []
        dense: list[FloatArray] = []
        point: list[int] = []
        by_point: list[FloatArray] = []

        def add(value: float, columns: Mapping[int, float], at: int, row: FloatArray) -> None:
            line = np.zeros(self.dense_count)
            for column, derivative in columns.items():
                line[column] = derivative
            miss.append(value)
            dense.append(line)
            point.append(at)
            by_point.append(row)

        nothing = np.zeros(3)
        for j, axis in np.argwhere(np.isfinite(self.known_sigma)).tolist():
            sigma = self.known_sigma[j, axis]
            value = (state.points[j, axis] - self.known[j, axis]) / sigma
            column = int(self.columns.points[j, axis])
            if column >= 0:
                add(value, {column: 1.0 / sigma}, -1, nothing)
            else:
                add(value, {}, j, np.eye(3)[axis] / sigma)
        for label, sigma in self.unknowns.priors.items():
            column = self.columns.labels.index(label)
            add(state.drift[column] / sigma, {column: 1.0 / sigma}, -1, nothing)
        for bar in self.unknowns.scale_bars:
            i, j = self.ids.index(bar.first), self.ids.index(bar.second)
            offset = state.points[j] - state.points[i]
            length = float(np.linalg.norm(offset))
            along = offset / length / bar.sigma
            columns = {
                int(c): float(sign * v)
                for end, sign in ((i, -1.0), (j, 1.0))
                for c, v in zip(self.columns.points[end], along, strict=True)
                if c >= 0
            }
            add((length - bar.length) / bar.sigma, columns, -1, nothing)
        return (
            np.array(miss),
            np.array(dense).reshape(len(miss), self.dense_count),
            np.array(point, dtype=np.int64),
            np.array(by_point).reshape(len(miss), 3),
        )

    def advance(self, state: State, step: FloatArray, point_step: FloatArray) -> State | None:
        """Return the state after a step, None where it is impossible."""
        place = self.columns
        try:
            cameras = tuple(
                self._stepped_camera(camera, k, step) for k, camera in enumerate(state.cameras)
            )
            media = dict(state.media)
            for name, interface in state.media.items():
                own = [(p, float(step[c])) for who, p, c in place.media if who == name]
                if own and isinstance(interface, FlatInterface):
                    media[name] = interface.stepped([p for p, _ in own], [v for _, v in own])
        except (InputError, GeometryError):
            return None
        points = state.points + point_step * self.free
        dense = place.points >= 0
        points[dense] += step[place.points[dense]]
        poses = []
        for plate, column in enumerate(place.plates):
            rotation, shift = state.poses[plate]
            turned = rotation_from_vector(step[column + 3 : column + 6]) @ rotation
            moved = shift + step[column : column + 3]
            poses.append((turned, moved))
            on = self.plate_of == plate
            points[on] = self.local[on] @ turned.T + moved
        return State(
            cameras=cameras, media=media, points=points, poses=tuple(poses),
            drift=state.drift + step,
        )  # fmt: skip

    def _stepped_camera(self, camera: Camera, k: int, step: FloatArray) -> Camera:
        """Return one camera after a step."""
        first, second = self.columns.exterior[k], self.columns.interior[k]
        names: list[str] = []
        change: list[float] = []
        if first is not None:
            names += EXTERIOR
            change += step[first : first + 6].tolist()
        if second is not None:
            names += self.unknowns.interior
            change += step[second : second + len(self.unknowns.interior)].tolist()
        return camera.stepped(names, change) if names else camera


def place_columns(
    project: Project, unknowns: Unknowns, ids: Sequence[str], movable: BoolArray
) -> Columns:
    """Return the place of every dense unknown; refuse names that the project does not have.

    Raises
    ------
    InputError
        Naming an unknown camera, media, media parameter, prior or scale-bar end.
    """
    labels: list[str] = []
    strange = set(unknowns.fixed_cameras) - set(project.camera_names)
    if strange:
        raise InputError(f"fixed_cameras: there is no camera {', '.join(sorted(strange))}.")
    exterior: list[int | None] = []
    for camera in project.cameras:
        fixed = camera.name in unknowns.fixed_cameras
        exterior.append(None if fixed else len(labels))
        labels += [] if fixed else [f"{camera.name}:{name}" for name in EXTERIOR]
    interior: list[int | None] = [None] * len(project.cameras)
    if unknowns.interior:
        first_of: dict[str, int] = {}
        for k, camera in enumerate(project.cameras):
            group = _interior_group(camera.name, unknowns.shared_interior)
            if group not in first_of:
                first_of[group] = len(labels)
                labels += [f"{group}:{name}" for name in unknowns.interior]
            interior[k] = first_of[group]
    media = _media_columns(project, unknowns.media, labels)
    plates = []
    for plate in unknowns.plates:
        plates.append(len(labels))
        labels += [f"plate {plate}:{name}" for name in EXTERIOR]
    points = np.full((len(ids), 3), -1, dtype=np.int64)
    row_of = {name: row for row, name in enumerate(ids)}
    for bar in unknowns.scale_bars:
        for end in (bar.first, bar.second):
            if end not in row_of:
                raise InputError(f"scale bar {bar.first}-{bar.second}: no point is called {end}.")
            row = row_of[end]
            for axis in range(3):
                if movable[row, axis] and points[row, axis] < 0:
                    points[row, axis] = len(labels)
                    labels.append(f"point {end}:{'XYZ'[axis]}")
    missing = [label for label in unknowns.priors if label not in labels]
    if missing:
        raise InputError(
            f"priors: {', '.join(missing)} is not estimated; unknowns are {', '.join(labels[:40])}."
        )
    return Columns(
        labels=tuple(labels), exterior=tuple(exterior), interior=tuple(interior), media=media,
        plates=tuple(plates), points=points,
    )  # fmt: skip


def _interior_group(camera: str, shared: bool | Mapping[str, str]) -> str:
    """Return the name of a camera's set of interior parameters."""
    if shared is True:
        return "interior"
    if shared is False:
        return camera
    return shared.get(camera, camera)


def _media_columns(
    project: Project, wanted: Sequence[str], labels: list[str]
) -> tuple[tuple[str, str, int], ...]:
    """Append the media unknowns to labels and return (media, parameter, column) of each."""
    used = [name for name in dict.fromkeys(project.media_of) if name]
    if wanted and not used:
        raise InputError("media: no camera looks through anything; there is nothing to estimate.")
    places: list[tuple[str, str, int]] = []
    for item in wanted:
        who, _, parameter = item.rpartition(":")
        owners = [who] if who else used
        for owner in owners:
            if owner not in project.media:
                raise InputError(f"media: there are no media {owner!r}, only {', '.join(used)}.")
            interface = project.media[owner]
            if not isinstance(interface, FlatInterface):
                raise InputError(
                    f"media: {owner} is ray-traced; only plane-parallel media can be estimated."
                )
            allowed = interface.parameter_names
            if parameter not in allowed:
                raise InputError(
                    f"media: {owner} has no {parameter!r}; its parameters are {', '.join(allowed)}."
                )
        common = not who and parameter.startswith(_MATERIAL)
        if common:
            places += [(owner, parameter, len(labels)) for owner in owners]
            labels.append(parameter)
        else:
            for owner in owners:
                places.append((owner, parameter, len(labels)))
                labels.append(f"{owner}:{parameter}")
    if len(set(labels)) != len(labels):
        raise InputError(f"media: {', '.join(wanted)} names the same unknown twice.")
    return tuple(places)


def with_common_values(project: Project, wanted: Sequence[str]) -> Project:
    """Return the project with one start value for parameters that are common to all media."""
    media = dict(project.media)
    for item in wanted:
        if ":" in item or not item.startswith(_MATERIAL):
            continue
        flat = {
            name: interface
            for name, interface in media.items()
            if name in project.media_of
            and isinstance(interface, FlatInterface)
            and item in interface.parameter_names
        }
        values = [interface.value(item) for interface in flat.values()]
        if len(set(values)) > 1:
            mean = float(np.mean(values))
            for name, interface in flat.items():
                media[name] = interface.stepped([item], [mean - interface.value(item)])
    return replace(project, media=media)
