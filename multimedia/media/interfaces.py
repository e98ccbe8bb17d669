"""Interfaces of any form between camera and object, seen through by ray tracing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multimedia.media.camera import EXTERIOR, Camera
from multimedia.media.optical_media import OpticalMedia, Sight, SightDerivatives
from multimedia.media.ray_paths import RayStatus
from multimedia.media.ray_tracing import aim_rays, trace_rays
from multimedia.media.surface_sequence import SurfaceSequence
from multimedia.media.surfaces import Plane, RefractingSurface
from multimedia.refraction.layers import Layers
from photocore.arrays import FloatArray, read_only
from photocore.errors import InputError
from photocore.rotation import checked_rotation, skew

#: Step of central differences as a share of the distance: paths are exact to 1e-13 of the scene,
#: so differences are good to 1e-8.
STEP = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Interfaces(SurfaceSequence, OpticalMedia):
    """Surfaces in the order in which a ray from the camera meets them (Kotowski 1988).

    Attributes
    ----------
    surfaces : tuple of RefractingSurface
        One per interface. A ray may cross the same surface twice: list it twice.
    indices : tuple of float
        Refractive indices of the media, from the camera's to the object's; one more than surfaces.
    with_camera : tuple of bool
        Per surface: True if it is given in the camera frame and moves with the camera (the window
        or dome of a housing), False if it stands still in the object frame (a tank, the sea).

    Examples
    --------
    Air, a 10 mm glass plate tilted a little, water (metres):

    >>> glass = Plane(point=[0, 0, 0.01], normal=[0.02, 0, 1])
    >>> tank = Interfaces(surfaces=(glass, glass.shifted([0, 0, -0.01])), indices=(1, 1.5, 1.337))
    >>> len(tank.surfaces)
    2
    """

    surfaces: tuple[RefractingSurface, ...]
    indices: tuple[float, ...]
    with_camera: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        SurfaceSequence.__post_init__(self)
        moving = tuple(self.with_camera) or (False,) * len(self.surfaces)
        object.__setattr__(self, "with_camera", moving)
        if len(self.with_camera) != len(self.surfaces):
            raise InputError(
                f"with_camera: expected {len(self.surfaces)} values, one per surface, "
                f"found {len(self.with_camera)}."
            )
        for surface, moves in zip(self.surfaces, self.with_camera, strict=True):
            if moves:
                surface.moved(np.eye(3), np.zeros(3))  # refuses what is not rigid

    @classmethod
    def flat_water(cls, level: float, *, index: float, air: float = 1.0) -> Interfaces:
        """Return the horizontal water surface Z = level under air."""
        return cls(surfaces=(Plane.level(level),), indices=(air, index))

    @classmethod
    def parallel(
        cls,
        layers: Layers,
        *,
        point: ArrayLike = (0.0, 0.0, 0.0),
        normal: ArrayLike = (0.0, 0.0, 1.0),
        with_camera: bool = False,
    ) -> Interfaces:
        """Return plane-parallel layers, the model of Maas, as surfaces.

        Parameters
        ----------
        layers : Layers
            Media from the camera to the object.
        point : array_like, shape (3,)
            A point of the last interface, the one that touches the object's medium.
        normal : array_like, shape (3,)
            Towards the cameras.
        with_camera : bool
            Whether point and normal are given in the camera frame and move with it.
        """
        last = Plane(point=point, normal=normal)  # type: ignore[arg-type]
        inner = np.asarray(layers.thicknesses)
        heights = np.append(np.cumsum(inner[::-1])[::-1], 0.0)
        surfaces = tuple(last.shifted(height * last.normal) for height in heights)
        moves = (with_camera,) * len(surfaces)
        return cls(surfaces=surfaces, indices=layers.indices, with_camera=moves)

    def seen_from(self, centre: ArrayLike, world_from_camera: ArrayLike) -> Interfaces:
        """Return the interfaces for one camera, all of them in the object frame.

        Parameters
        ----------
        centre : array_like, shape (3,)
            Projection centre in the object frame.
        world_from_camera : array_like, shape (3, 3)
            Rotation that turns camera directions into object directions.

        Raises
        ------
        GeometryError
            If the matrix is not a rotation (a scale, or a mirrored frame).
        """
        rotation = checked_rotation(world_from_camera, "world_from_camera", tolerance=1e-9)
        translation = read_only(centre, "centre", shape=(3,))
        surfaces = tuple(
            surface.moved(rotation, translation) if moves else surface
            for surface, moves in zip(self.surfaces, self.with_camera, strict=True)
        )
        return Interfaces(surfaces=surfaces, indices=self.indices)

    def seen(self, camera: Camera, points: FloatArray) -> tuple[FloatArray, NDArray[np.object_]]:
        """Return vectors as long as those to the points, along the rays that reach them.

        Where there is no ray, also the label of its `RayStatus`.
        """
        fixed = self.seen_from(camera.centre, camera.rotation)
        paths = aim_rays(camera.centre, points, fixed)
        labels = np.array(["", *(code.label for code in RayStatus if code)], dtype=object)
        distance = np.linalg.norm(points - camera.centre, axis=-1, keepdims=True)
        return distance * (paths.directions[:, 0] @ camera.rotation), labels[paths.status]

    def object_rays(self, camera: Camera, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Trace directions of the camera frame into the last medium."""
        fixed = self.seen_from(camera.centre, camera.rotation)
        paths = trace_rays(camera.centre, directions @ camera.rotation.T, fixed)
        return paths.vertices[..., -1, :], paths.directions[..., -1, :]

    def sight(
        self, camera: Camera, points: FloatArray, *, exterior: bool, names: Sequence[str] = ()
    ) -> Sight:
        """Return directions with derivatives; of the parameters ``index1``, ``index2``... only.

        Notes
        -----
        Analytic by the point, and by the camera as far as the interfaces stand still with the
        object (rotation) or all move with the camera (everything). What remains, the shift of a
        camera before interfaces that stand still, and the indices, are central differences.
        """
        fixed = self.seen_from(camera.centre, camera.rotation)
        paths = aim_rays(camera.centre, points, fixed, jacobian=True)
        directions: FloatArray = paths.directions[:, 0]
        by_point: FloatArray = camera.rotation.T @ np.asarray(paths.jacobian)
        pose = [self._by_exterior(camera, points, directions, by_point)] if exterior else []
        by_exterior = np.concatenate([np.empty((len(points), 3, 0)), *pose], axis=-1)
        by_indices = [self._by_index(camera, points, name)[..., None] for name in names]
        by_media = np.concatenate([np.empty((len(points), 3, 0)), *by_indices], axis=-1)

        def derivatives(by_seen: FloatArray) -> SightDerivatives:
            return SightDerivatives(by_seen @ by_point, by_seen @ by_exterior, by_seen @ by_media)

        return Sight(directions @ camera.rotation, derivatives)

    def _directions(self, camera: Camera, points: FloatArray) -> FloatArray:
        """Return the unit vectors in the first medium towards points, in the camera frame."""
        fixed = self.seen_from(camera.centre, camera.rotation)
        vectors: FloatArray = aim_rays(camera.centre, points, fixed).directions[:, 0]
        return vectors @ camera.rotation

    def _by_exterior(
        self, camera: Camera, points: FloatArray, directions: FloatArray, by_point: FloatArray
    ) -> FloatArray:
        """Return the derivatives of unit vectors by centre and rotation vector, (n, 3, 6)."""
        distances = np.linalg.norm(points - camera.centre, axis=1)
        distance = float(np.median(distances)) if len(points) else 1.0

        def changed(steps: FloatArray) -> FloatArray:
            def at(sign: float, step: FloatArray) -> FloatArray:
                return self._directions(camera.stepped(EXTERIOR, sign * step), points)

            sizes = np.linalg.norm(steps, axis=1)
            both = [(at(1.0, step) - at(-1.0, step)) / 2.0 for step in steps]
            return np.stack(both, axis=-1) / sizes

        # R^T d turns by R^T (d x v): d is the ray where the interfaces stand still, the vector to
        # the point where they turn with the camera.
        by_turn: FloatArray
        by_centre, by_turn = -by_point, by_point @ skew(points - camera.centre)
        if not all(self.with_camera):
            by_centre = changed(STEP * distance * np.eye(6)[:3])
            turned = camera.rotation.T @ skew(directions)
            by_turn = changed(STEP * np.eye(6)[3:]) if any(self.with_camera) else turned
        return np.concatenate([by_centre, by_turn], axis=-1)

    def _by_index(self, camera: Camera, points: FloatArray, name: str) -> FloatArray:
        """Return the derivative of unit vectors by one refractive index."""
        known = [f"index{k}" for k in range(1, len(self.indices) + 1)]
        if name not in known:
            raise InputError(
                f"interface parameter {name}: of ray-traced surfaces only {', '.join(known)} can "
                "be estimated."
            )
        place = known.index(name)

        def at(step: float) -> FloatArray:
            indices = [n + step * (k == place) for k, n in enumerate(self.indices)]
            return self.with_indices(indices)._directions(camera, points)

        # Vacuum is the lower limit of an index: differences on one side there.
        if self.indices[place] < 1.0 + STEP:
            here, one, two = at(0.0), at(STEP), at(2 * STEP)
            return (4.0 * one - 3.0 * here - two) / (2 * STEP)
        return _difference(at, STEP)


def _difference(function: Callable[[float], FloatArray], size: float) -> FloatArray:
    """Return the central difference."""
    return (function(size) - function(-size)) / (2.0 * size)
