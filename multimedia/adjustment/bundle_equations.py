"""The equations of a bundle adjustment: residuals, derivatives, steps, the datum."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix, hstack

from multimedia.adjustment.bundle_columns import BundleColumns, Places
from multimedia.adjustment.unknowns import Unknowns
from multimedia.media.camera import EXTERIOR, Camera
from multimedia.media.flat_interface import FlatInterface
from multimedia.media.interfaces import Interfaces
from multimedia.media.projection import project_with_jacobian
from multimedia.projects.model import Project
from photocore.adjustment import LARGEST, BlockEquations, Fit, fit
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera.rotation import by_turn, rotation_from_vector, skew
from photocore.errors import GeometryError, InputError

#: A motion of everything is a datum defect if it moves image points by less than this share of
#: what its parts would move them on their own.
_DEFECT = 1e-9
#: Rotation and shift.
Pose = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BundleState:
    """Everything that changes during the iteration.

    Attributes
    ----------
    cameras : tuple of Camera
    media : mapping of str to FlatInterface or Interfaces
    points : ndarray, shape (p, 3)
        World coordinates; those on plates follow from the pose.
    poses : tuple of (rotation (3, 3), shift (3,))
        World from plate.
    drift : ndarray, shape (u,)
        Sum of all steps of the remaining unknowns: for priors, and for values that count from 0.
    """

    cameras: tuple[Camera, ...]
    media: Mapping[str, FlatInterface | Interfaces]
    points: FloatArray
    poses: tuple[Pose, ...]
    drift: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageObservations:
    """Image points as the adjustment uses them.

    Attributes
    ----------
    source : ndarray of int, shape (n,)
        Row of the project's image points that each one comes from.
    rows : tuple of ndarray of int
        Which of the n each camera measured.
    point : ndarray of int, shape (n,)
        Which object point was measured.
    image, sigma : ndarray, shape (n, 2)
        [mm]
    """

    source: IntArray
    rows: tuple[IntArray, ...]
    point: IntArray
    image: FloatArray
    sigma: FloatArray


class _Entries:
    """Entries of a sparse matrix in the order in which they come."""

    def __init__(self) -> None:
        self.parts: list[list[FloatArray]] = []

    def add(self, rows: ArrayLike, columns: ArrayLike, values: ArrayLike) -> None:
        """Note values at rows and columns that broadcast against them; repeated ones add up."""
        self.parts.append([part.ravel() for part in np.broadcast_arrays(rows, columns, values)])

    def matrix(self, shape: tuple[int, int]) -> csr_matrix:
        """Return the matrix."""
        if not self.parts:
            return csr_matrix(shape)
        rows, columns, values = (np.concatenate(part) for part in zip(*self.parts, strict=True))
        return csr_matrix((values, (rows, columns)), shape=shape)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bundle:
    """A project and the unknowns wanted of it, turned into equations.

    Attributes
    ----------
    project : Project
    unknowns : Unknowns
    ids : tuple of str
        All object points, control first, new ones behind.
    start : BundleState
    observations : ImageObservations
    columns : BundleColumns
    plate_of : ndarray of int, shape (p,)
        Plate of each point, -1 for none.
    local : ndarray, shape (p, 3)
        Coordinates in the plate's frame.
    free : ndarray of bool, shape (p, 3)
        Coordinates that may be eliminated, as unknowns of their own.
    known : ndarray, shape (p, 3)
        Given coordinates of weighted points.
    known_sigma : ndarray, shape (p, 3)
        Their standard deviations, NaN where not weighted.
    datum : ndarray, shape (d, u + 3 p)
        Directions that only the datum of a free network holds.
    """

    project: Project
    unknowns: Unknowns
    ids: tuple[str, ...]
    start: BundleState
    observations: ImageObservations
    columns: BundleColumns
    plate_of: IntArray
    local: FloatArray
    free: BoolArray
    known: FloatArray
    known_sigma: FloatArray
    datum: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    def fit(self, start: BundleState, *, largest: int = LARGEST) -> Fit[BundleState]:
        """Adjust from a start; beyond ``largest`` unknowns by elimination of the points."""
        frees = np.argwhere(self.free).tolist()
        names = [*self.columns.labels, *(f"point {self.ids[j]}:{'XYZ'[k]}" for j, k in frees)]
        size = float(np.abs(self.observations.image).max(initial=0.0))
        # Projecting rounds a few times: ten units in the last place of the largest coordinate.
        rounding = 2e-15 * size / float(self.observations.sigma.min(initial=1.0))
        return fit(
            start, self.equations, self.advance, names=names, what="adjustment", rounding=rounding,
            largest=largest,
        )  # fmt: skip

    def equations(self, state: BundleState) -> BlockEquations | None:
        """Return the equations at a state; None if a point is not seen there.

        Image coordinates come first (x and y of each in turn), then weighted coordinates, priors,
        scale bars and the datum.
        """
        seen = self.observations
        image = np.empty(seen.image.shape)
        design, eliminated = _Entries(), _Entries()
        for k, rows in enumerate(seen.rows):
            projected = self._camera_rows(state, k, rows, design, eliminated)
            if projected is None:
                return None
            image[rows] = projected
        misses = [((image - seen.image) / seen.sigma).ravel()]
        count = misses[0].size
        for miss, columns, values, points, by_points in self._extra_rows(state):
            misses.append(np.array([miss]))
            design.add(count, columns, values)
            eliminated.add(count, points, by_points)
            count += 1
        return BlockEquations(
            residuals=np.concatenate(misses),
            design=design.matrix((count, len(self.columns.labels))),
            eliminated=eliminated.matrix((count, self.free.size)),
            free=self.free,
        )

    def _camera_rows(
        self, state: BundleState, k: int, rows: IntArray, design: _Entries, eliminated: _Entries
    ) -> FloatArray | None:
        """Enter the derivatives of one camera's rows; return its image points, None if unseen."""
        place, which = self.columns, self.observations.point[rows]
        medium = self.project.media_of[k]
        own, through = place.cameras[k], place.media.get(medium, {})
        points = state.points[which]
        try:
            seen = project_with_jacobian(
                state.cameras[k], points, state.media[medium] if medium else None,
                camera_names=tuple(own), interface_names=tuple(through),
            )  # fmt: skip
        except GeometryError:
            return None
        if not np.isfinite(seen.image).all():
            return None
        weight = 1.0 / self.observations.sigma[rows][:, :, None]
        lines = 2 * rows[:, None, None] + np.arange(2)[:, None]
        by_point = seen.by_point * weight
        design.add(lines, list(own.values()), seen.by_camera * weight)
        design.add(lines, list(through.values()), seen.by_interface * weight)
        for plate, pose in enumerate(place.plates):
            on = self.plate_of[which] == plate
            arm = points[on] - state.poses[plate][1]
            design.add(lines[on], _columns(pose, EXTERIOR[:3]), by_point[on])
            design.add(lines[on], _columns(pose, EXTERIOR[3:]), by_turn(by_point[on], arm))
        column = place.points[which]
        end, axis = np.nonzero(column >= 0)
        design.add(lines[end, :, 0], column[end, axis][:, None], by_point[end, :, axis])
        mine = 3 * which[:, None, None] + np.arange(3)
        eliminated.add(lines, mine, by_point * self.free[which][:, None, :])
        return seen.image

    def _extra_rows(
        self, state: BundleState
    ) -> Iterator[tuple[float, ArrayLike, ArrayLike, ArrayLike, ArrayLike]]:
        """Yield weighted coordinates, priors, scale bars and datum: residual and derivatives."""
        place = self.columns
        for j, axis in np.argwhere(np.isfinite(self.known_sigma)).tolist():
            sigma, column = self.known_sigma[j, axis], place.points[j, axis]
            miss = (state.points[j, axis] - self.known[j, axis]) / sigma
            if column >= 0:
                yield miss, column, 1.0 / sigma, 0, 0.0
            else:
                yield miss, 0, 0.0, 3 * j + axis, 1.0 / sigma
        for column, sigma in place.priors.items():
            yield state.drift[column] / sigma, column, 1.0 / sigma, 0, 0.0
        for bar in self.unknowns.scale_bars:
            ends = [self.ids.index(bar.first), self.ids.index(bar.second)]
            offset = state.points[ends[1]] - state.points[ends[0]]
            length = float(np.linalg.norm(offset))
            along = np.stack([-offset, offset]) / length / bar.sigma
            columns = place.points[ends]
            unknown = columns >= 0
            miss = (length - bar.length) / bar.sigma
            yield miss, columns[unknown], along[unknown], 0, 0.0
        moved = np.concatenate([state.drift, (state.points - self.start.points).ravel()])
        stay = len(place.labels)
        for row in self.datum:
            near, far = np.flatnonzero(row[:stay]), np.flatnonzero(row[stay:])
            yield float(row @ moved), near, row[near], far, row[stay + far]

    def advance(self, state: BundleState, step: FloatArray) -> BundleState | None:
        """Return the state after a step, None where it is impossible."""
        place = self.columns
        own = step[: len(place.labels)]
        media = dict(state.media)
        try:
            cameras = tuple(
                camera.stepped(list(at), own[list(at.values())]) if at else camera
                for camera, at in zip(state.cameras, place.cameras, strict=True)
            )
            for name, at in place.media.items():
                media[name] = media[name].stepped(list(at), own[list(at.values())])
        except (InputError, GeometryError):
            return None
        points = state.points.copy()
        points[self.free] += step[len(own) :]
        kept = place.points >= 0
        points[kept] += own[place.points[kept]]
        poses = []
        for plate, (at, (rotation, shift)) in enumerate(
            zip(place.plates, state.poses, strict=True)
        ):
            turned = rotation_from_vector(own[_columns(at, EXTERIOR[3:])]) @ rotation
            moved = shift + own[_columns(at, EXTERIOR[:3])]
            poses.append((turned, moved))
            on = self.plate_of == plate
            points[on] = self.local[on] @ turned.T + moved
        return BundleState(
            cameras=cameras, media=media, points=points, poses=tuple(poses), drift=state.drift + own
        )

    def datum_rows(self) -> FloatArray:
        """Return the inner constraints of a free network, shape (defect, u + 3 p).

        Shift, turn and scale of everything that the observations do not feel must not move the
        points on average: Helmert's inner constraints; in a network so large that its points are
        eliminated, or with all of them on plates, the cameras and plates. Which of the seven
        motions are not felt is found from the equations themselves, since a glass fixed in the
        world leaves fewer of them.
        """
        state, stay = self.start, len(self.columns.labels)
        linear = self.equations(state)
        if self.unknowns.control != "free" or linear is None:
            return np.zeros((0, 0))
        motion = self._motions()
        jacobian = hstack([linear.design, linear.eliminated], "csr")
        parts = abs(jacobian) @ abs(motion)
        _, values, right = np.linalg.svd(jacobian @ motion, full_matrices=False)
        rows = right[values <= _DEFECT * np.linalg.norm(parts)] @ motion.T
        if linear.unknowns > LARGEST or not self.free.any():
            rows[:, stay:] = 0.0
            rows[:, self.columns.points[self.columns.points >= 0]] = 0.0
        else:
            rows[:, :stay] = 0.0
        # As heavy as the columns it holds, so that their scaling does not suffer.
        scale = np.sqrt(jacobian.power(2).sum(axis=0).A1)
        relative = np.linalg.norm(rows / np.where(scale > 0, scale, 1.0), axis=1, keepdims=True)
        return rows / np.where(relative > 0, relative, 1.0)

    def _motions(self) -> FloatArray:
        """Return how shift, turn and scale of everything move every unknown, (u + 3 p, 7)."""
        state, place, stay = self.start, self.columns, len(self.columns.labels)
        middle = state.points.mean(axis=0)
        reach = float(np.abs(state.points - middle).max()) or 1.0
        motion = np.zeros((stay + self.free.size, 7))
        centres = [camera.centre for camera in state.cameras] + [shift for _, shift in state.poses]
        for at, centre in zip((*place.cameras, *place.plates), centres, strict=True):
            if EXTERIOR[0] in at:
                motion[_columns(at, EXTERIOR[:3])] = _moved(centre, middle, reach)
                motion[_columns(at, EXTERIOR[3:]), 3:6] = np.eye(3) / reach
        points = np.array([_moved(point, middle, reach) for point in state.points])
        kept = place.points >= 0
        motion[place.points[kept]] = points[kept]
        motion[stay:] = (points * self.free[:, :, None]).reshape(-1, 7)
        return motion


def _columns(places: Places, names: tuple[str, ...]) -> list[int]:
    """Return the columns of some parameters."""
    return [places[name] for name in names]


def _moved(place: FloatArray, middle: FloatArray, reach: float) -> FloatArray:
    """Return how the seven motions move one place, shape (3, 7)."""
    arm = (place - middle) / reach
    # A small turn v moves the end of an arm by v x arm.
    return np.column_stack([np.eye(3), -skew(arm), arm])
