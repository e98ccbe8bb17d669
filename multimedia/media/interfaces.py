"""Interfaces of any form between camera and object, seen through by ray tracing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multimedia.media.camera import Camera
from multimedia.media.optical_media import OpticalMedia, Sight, SightDerivatives
from multimedia.media.ray_march import PathChanges
from multimedia.media.ray_paths import RayStatus
from multimedia.media.ray_tracing import aim_rays, pointing_changes, trace_rays
from multimedia.media.surface_motion import Body, SurfaceMotion, bodies_of
from multimedia.media.surface_sequence import SurfaceSequence
from multimedia.media.surfaces import Plane, RefractingSurface
from multimedia.refraction import Layers
from photocore.arrays import FloatArray, as_floats, read_only
from photocore.camera import checked_rotation, skew
from photocore.errors import InputError


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
    gradient, level : float
        In the object frame, see `SurfaceSequence`; 0: the object's medium is the same everywhere.

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
    def flat_water(cls, level: float, *, refractive_index: float, air: float = 1.0) -> Interfaces:
        """Return the horizontal water surface Z = level under air."""
        return cls(surfaces=(Plane.level(level),), indices=(air, refractive_index))

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
        return replace(self, surfaces=surfaces, with_camera=())

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

    @property
    def curves_in_object(self) -> bool:
        """Whether the index of the last medium changes with depth."""
        return self.is_graded

    @property
    def bodies(self) -> tuple[Body, ...]:
        """Surfaces that keep their form together, such as the two faces of a dome."""
        return bodies_of(self.surfaces, self.with_camera)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of everything that an adjustment may estimate.

        Of each body: ``centreX``, ``centreY``, ``centreZ`` and ``radius`` of spheres; ``shift1``,
        ``shift2`` across and ``tilt1``, ``tilt2`` of the axis and ``radius`` of cylinders;
        ``offset``, ``tilt1``, ``tilt2`` of planes, as in `FlatInterface`. Those of a body whose
        first surface is number k > 1 end in ``@k``. The radius is that of the first face; all
        grow alike. Then ``thickness1``... of the layers between the faces of one body, the last
        face staying where it is, ``index1``... and ``gradient``.
        """
        bodies = self.bodies
        return (
            *(name for body in bodies for name in body.parameters),
            *(name for body in bodies for name in body.layers),
            *(f"index{k}" for k in range(1, len(self.indices) + 1)),
            "gradient",
        )

    def value(self, name: str) -> float:
        """Return a parameter; offsets, shifts and tilts count from where the body is."""
        self._refuse_unknown([name])
        if name == "gradient":
            return self.gradient
        if name.startswith("index"):
            return self.indices[int(name[5:]) - 1]
        return self._body_of(name).value(name)

    def stepped(self, names: Sequence[str], step: ArrayLike) -> Interfaces:
        """Return the interfaces after adding ``step`` to the named parameters.

        Raises
        ------
        InputError
            If a name is unknown, or an index or radius leaves what is possible.
        """
        self._refuse_unknown(names)
        surfaces, indices, gradient = list(self.surfaces), list(self.indices), self.gradient
        for name, size in zip(names, as_floats(step, "step").tolist(), strict=True):
            if name == "gradient":
                gradient += size
            elif name.startswith("index"):
                indices[int(name[5:]) - 1] += size
            else:
                body = self._body_of(name)
                for k, motion in enumerate(body.motions(name), start=body.first - 1):
                    surfaces[k] = motion.applied(surfaces[k], size)
        # A surface that is met twice stays one.
        kept: dict[int, RefractingSurface] = {}
        moved = tuple(
            kept.setdefault(id(old), new) for old, new in zip(self.surfaces, surfaces, strict=True)
        )
        return replace(self, surfaces=moved, indices=tuple(indices), gradient=gradient)

    def sight(
        self, camera: Camera, points: FloatArray, *, exterior: bool, names: Sequence[str] = (),
        before: float = 0.0,  # noqa: ARG002
    ) -> Sight:  # fmt: skip
        """Return directions with derivatives, all of them analytic."""
        self._refuse_unknown(names)
        fixed = self.seen_from(camera.centre, camera.rotation)
        directions: FloatArray = aim_rays(camera.centre, points, fixed).directions[:, 0]
        # Where nothing moves with the camera, a turn of it only turns what it sees.
        pose = (6 if any(self.with_camera) else 3) if exterior else 0
        changes = self._changes(camera, pose, names)
        centres = np.broadcast_to(camera.centre, points.shape)
        by_point, by_changes = pointing_changes(centres, points, directions, fixed, changes)
        by_pose = np.zeros((len(points), 3, 6 if exterior else 0))
        by_pose[:, :, :pose] = by_changes[:, :, :pose]
        if exterior:
            by_pose[:, :, 3:] += skew(directions)
        slopes = [camera.rotation.T @ d for d in (by_point, by_pose, by_changes[:, :, pose:])]

        def derivatives(by_seen: FloatArray) -> SightDerivatives:
            return SightDerivatives(*(by_seen @ slope for slope in slopes))

        return Sight(directions @ camera.rotation, derivatives)

    def _changes(self, camera: Camera, pose: int, names: Sequence[str]) -> PathChanges:
        """Return centre, turn (as far as ``pose`` goes) and named parameters as changes of rays."""
        count, none = pose + len(names), (None,) * len(self.surfaces)
        starts, motions = np.zeros((count, 3)), []
        indices, gradients = np.zeros((count, len(self.indices))), np.zeros(count)
        starts[: min(pose, 3)] = np.eye(3)[: min(pose, 3)]
        for k in range(pose):
            axis = np.eye(3)[k % 3]
            motion = (
                SurfaceMotion(shift=axis)
                if k < 3
                else SurfaceMotion(rotation=axis, pivot=camera.centre)
            )
            motions.append(tuple(motion if moves else None for moves in self.with_camera))
        for k, name in enumerate(names, start=pose):
            if name == "gradient":
                gradients[k] = 1.0
            elif name.startswith("index"):
                indices[k, int(name[5:]) - 1] = 1.0
            motions.append(none if gradients[k] or indices[k].any() else self._moved(name, camera))
        return PathChanges(
            starts=starts, motions=tuple(motions), indices=indices, gradients=gradients
        )

    def _moved(self, name: str, camera: Camera) -> tuple[SurfaceMotion | None, ...]:
        """Return how each surface moves with a parameter, in the object frame."""
        body = self._body_of(name)
        motions: list[SurfaceMotion | None] = [None] * len(self.surfaces)
        for k, motion in enumerate(body.motions(name), start=body.first - 1):
            moves = self.with_camera[k]
            motions[k] = motion.seen_from(camera.rotation, camera.centre) if moves else motion
        return tuple(motions)

    def _body_of(self, name: str) -> Body:
        """Return the body that has a parameter."""
        return next(b for b in self.bodies if name in b.parameters or name in b.layers)

    def _refuse_unknown(self, names: Sequence[str]) -> None:
        """Refuse names that are no parameter."""
        parameters = self.parameter_names
        for name in names:
            if name not in parameters:
                raise InputError(f"interface parameter {name}: not one of {', '.join(parameters)}.")
