"""The equations of a bundle adjustment: residuals, derivatives, steps, the datum."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.sparse import hstack

from multimedia.adjustment.bundle_columns import BundleColumns
from multimedia.adjustment.unknowns import Unknowns
from multimedia.media import EXTERIOR, FlatInterface, as_media, project_with_jacobian
from multimedia.projects import Project
from photocore.adjustment import BlockEquations, Fit
from photocore.adjustment.network import LARGEST, Network, NetworkState, Rows
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.camera import by_rotation, skew
from photocore.errors import GeometryError

#: A motion of everything is a datum defect if it moves image points by less than this share of
#: what its parts would move them on their own.
_DEFECT = 1e-9
#: Share of a camera's height above the faces by which points may lie before the last one on the
#: way: a point that may not go there holds all others up.
BEFORE = 0.2
#: Residuals that no adjustment is right with, once they fall no more: so many of their standard
#: deviations, and such a share of the principal distance.
HOPELESS = (20.0, 1e-3)


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bundle:
    """A project and the unknowns wanted of it, turned into equations.

    Attributes
    ----------
    project : Project
    unknowns : Unknowns
    ids : tuple of str
        All object points, control first, new ones behind.
    start : NetworkState
        Blocks ``camera``, ``media`` and ``plate``: the last is world from plate, as the pose of a
        camera. World coordinates of points on plates follow from it.
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
    before : float
        As for `project_with_jacobian`.
    """

    project: Project
    unknowns: Unknowns
    ids: tuple[str, ...]
    start: NetworkState
    observations: ImageObservations
    columns: BundleColumns
    plate_of: IntArray
    local: FloatArray
    free: BoolArray
    known: FloatArray
    known_sigma: FloatArray
    datum: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    before: float = BEFORE

    @property
    def network(self) -> Network:
        """The unknowns and what observes them.

        Image coordinates come first (x and y of each in turn), then weighted coordinates, priors,
        scale bars and the datum.
        """
        frees, place = np.argwhere(self.free).tolist(), self.columns
        size = float(np.abs(self.observations.image).max(initial=0.0))
        finest = float(self.observations.sigma.min(initial=1.0))
        nearest = min(camera.principal_distance for camera in self.project.cameras)
        cameras, plates = (dict(enumerate(some)) for some in (place.cameras, place.plates))
        return Network(
            labels=place.labels, free=self.free, kept=place.points,
            columns={"camera": cameras, "media": place.media, "plate": plates},
            names=[f"point {self.ids[j]}:{'XYZ'[k]}" for j, k in frees],
            terms=(self._images, self._known, self._scale_bars, self._datum), moved=self._carried,
            # Projecting rounds a few times: ten units in the last place of the largest coordinate.
            rounding=2e-15 * size / finest,
            hopeless=max(HOPELESS[0], HOPELESS[1] * nearest / finest), blame=self._worst,
        )  # fmt: skip

    def weighted(self, weights: FloatArray) -> Bundle:
        """Return the equations with robust weights of the image coordinates, shape (n, 2)."""
        sigma = self.observations.sigma / np.sqrt(weights)
        return replace(self, observations=replace(self.observations, sigma=sigma))

    def before_faces(self, state: NetworkState) -> tuple[FloatArray, FloatArray]:
        """Return how far points lie before flat faces they are seen through, and the normals.

        Shapes (p,) and (p, 3); 0 for points beyond them.
        """
        distance, normals = np.zeros(len(self.ids)), np.zeros((len(self.ids), 3))
        for k, rows in enumerate(self.observations.rows):
            which, medium = self.observations.point[rows], self.project.media_of[k]
            media = as_media(state.blocks["media"][medium] if medium else None)
            if not isinstance(media, FlatInterface):
                continue
            camera, point, normal = state.blocks["camera"][k], media.point, media.normal
            if media.moves_with_camera:
                point, normal = camera.centre + camera.rotation @ point, camera.rotation @ normal
            away = (state.points[which] - point) @ normal
            further = away > distance[which]
            distance[which[further]], normals[which[further]] = away[further], normal
        return distance, normals

    def _worst(self, fitted: Fit[NetworkState]) -> str:
        """Return the camera, and the plate if any, whose image points fit worst."""
        observations = self.observations
        misses = fitted.residuals[: observations.image.size].reshape(-1, 2) * observations.sigma
        camera = np.repeat(
            np.arange(len(observations.rows)), [len(rows) for rows in observations.rows]
        )
        camera = camera[np.argsort(np.concatenate(observations.rows), kind="stable")]
        plate = self.plate_of[observations.point]
        groups = np.unique(np.column_stack([camera, plate]), axis=0).tolist()
        sizes = [np.sqrt(np.mean(misses[(camera == k) & (plate == p)] ** 2)) for k, p in groups]
        k, p = groups[int(np.argmax(sizes))]
        on = f", plate {self.unknowns.plates[p]}" if p >= 0 else ""
        return f"camera {self.project.camera_names[k]}{on} ({max(sizes):.2g} mm)"

    def _carried(self, state: NetworkState) -> NetworkState:
        """Return a state with the points on plates where their poses put them."""
        for plate, pose in state.blocks["plate"].items():
            on = self.plate_of == plate
            state.points[on] = self.local[on] @ pose.rotation.T + pose.centre
        return state

    def _images(self, state: NetworkState, rows: Rows) -> bool:
        observations, place, media = self.observations, self.columns, state.blocks["media"]
        image = np.empty(observations.image.shape)
        lines = rows.count + np.arange(image.size).reshape(image.shape)
        for k, own in enumerate(observations.rows):
            which, medium = observations.point[own], self.project.media_of[k]
            of_camera, through = place.cameras[k], place.media.get(medium, {})
            points = state.points[which]
            try:
                view = project_with_jacobian(
                    state.blocks["camera"][k], points, media[medium] if medium else None,
                    camera_names=tuple(of_camera), interface_names=tuple(through),
                    before=self.before,
                )  # fmt: skip
            except GeometryError:
                return False
            image[own] = view.image
            weight = 1.0 / observations.sigma[own][:, :, None]
            by_point, at = view.by_point * weight, lines[own][..., None]
            rows.by_label(at, list(of_camera.values()), view.by_camera * weight)
            rows.by_label(at, list(through.values()), view.by_interface * weight)
            for plate, pose in state.blocks["plate"].items():
                on = self.plate_of[which] == plate
                turned = by_rotation(by_point[on], points[on] - pose.centre)
                by_pose = np.concatenate([by_point[on], turned], axis=2)
                rows.by_label(at[on], list(place.plates[plate].values()), by_pose)
            rows.by_points(lines[own], which[:, None], by_point)
        rows.add((image - observations.image) / observations.sigma)
        return bool(np.isfinite(image).all())

    def _known(self, state: NetworkState, rows: Rows) -> bool:
        at = np.nonzero(np.isfinite(self.known_sigma))
        rows.known(rows.places[at], (state.points - self.known)[at], self.known_sigma[at])
        columns = np.array(list(self.columns.priors), dtype=np.int64)
        rows.known(columns, state.drift[columns], np.array(list(self.columns.priors.values())))
        return True

    def _scale_bars(self, state: NetworkState, rows: Rows) -> bool:
        for bar in self.unknowns.scale_bars:
            ends = np.array([self.ids.index(bar.first), self.ids.index(bar.second)])
            offset = state.points[ends[1]] - state.points[ends[0]]
            length = float(np.linalg.norm(offset))
            along = np.stack([-offset, offset]) / length / bar.sigma
            rows.by_points(rows.add(np.array([(length - bar.length) / bar.sigma])), ends, along)
        return True

    def _datum(self, state: NetworkState, rows: Rows) -> bool:
        if len(self.datum):
            moved = np.concatenate([state.drift, (state.points - self.start.points).ravel()])
            points = np.where(self.free, rows.places, -1).ravel()
            columns = np.concatenate([np.arange(len(self.columns.labels)), points])
            rows.by_label(rows.add(self.datum @ moved)[:, None], columns, self.datum)
        return True

    def datum_rows(self) -> FloatArray:
        """Return the inner constraints of a free network, shape (defect, u + 3 p).

        Shift, turn and scale of everything that the observations do not feel must not move the
        points on average: Helmert's inner constraints; in a network so large that its points are
        eliminated, or with all of them on plates, the cameras and plates. Which of the seven
        motions are not felt is found from the equations themselves, since a glass fixed in the
        world leaves fewer of them.
        """
        state, stay = self.start, len(self.columns.labels)
        linear = replace(self.network, largest=0).equations(state)
        if self.unknowns.control != "free" or not isinstance(linear, BlockEquations):
            return np.zeros((0, 0))
        motion = self._motions()
        jacobian = hstack([linear.design, linear.eliminated], "csr")
        parts = abs(jacobian) @ abs(motion)
        _, values, right = np.linalg.svd(jacobian @ motion, full_matrices=False)
        rows = right[values <= _DEFECT * np.linalg.norm(parts)] @ motion.T
        on_bars = self.columns.points[self.columns.points >= 0]  # points that are not eliminated
        of_points = rows[:, on_bars]
        if linear.unknowns > LARGEST or not (self.free.any() or len(on_bars)):
            rows[:, stay:] = rows[:, on_bars] = 0.0
            rows *= self._lengths_of_turns()
        else:
            rows[:, :stay] = 0.0
            rows[:, on_bars] = of_points
        # As heavy as the columns it holds, so that their scaling does not suffer.
        scale = np.sqrt(jacobian.power(2).sum(axis=0).A1)
        relative = np.linalg.norm(rows / np.where(scale > 0, scale, 1.0), axis=1, keepdims=True)
        return rows / np.where(relative > 0, relative, 1.0)

    def _lengths_of_turns(self) -> FloatArray:
        """Return what makes a turn of a camera or plate weigh as its way about the points would.

        Two cameras turn about the line through both without moving: in radians beside lengths
        their turns would weigh nothing.
        """
        weights, place = np.ones(len(self.columns.labels) + self.free.size), self.columns
        middle = self.start.points.mean(axis=0)
        poses = (*self.start.blocks["camera"].values(), *self.start.blocks["plate"].values())
        for at, pose in zip((*place.cameras, *place.plates), poses, strict=True):
            if EXTERIOR[0] in at:
                arm = pose.centre - middle
                weights[[at[name] for name in EXTERIOR[3:]]] = float(arm @ arm) or 1.0
        return weights

    def _motions(self) -> FloatArray:
        """Return how shift, turn and scale of everything move every unknown, (u + 3 p, 7)."""
        state, place, stay = self.start, self.columns, len(self.columns.labels)
        middle = state.points.mean(axis=0)
        reach = float(np.abs(state.points - middle).max()) or 1.0
        motion = np.zeros((stay + self.free.size, 7))
        poses = (*state.blocks["camera"].values(), *state.blocks["plate"].values())
        for at, pose in zip((*place.cameras, *place.plates), poses, strict=True):
            if EXTERIOR[0] in at:
                motion[[at[name] for name in EXTERIOR[:3]]] = _moved(pose.centre, middle, reach)
                motion[[at[name] for name in EXTERIOR[3:]], 3:6] = np.eye(3) / reach
        points = np.array([_moved(point, middle, reach) for point in state.points])
        kept = place.points >= 0
        motion[place.points[kept]] = points[kept]
        motion[stay:] = (points * self.free[:, :, None]).reshape(-1, 7)
        return motion


def _moved(place: FloatArray, middle: FloatArray, reach: float) -> FloatArray:
    """Return how the seven motions move one place, shape (3, 7)."""
    arm = (place - middle) / reach
    # A small turn v moves the end of an arm by v x arm.
    return np.column_stack([np.eye(3), -skew(arm), arm])
