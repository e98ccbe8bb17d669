"""Plane-parallel layers and where they are: a tank wall, a water surface, the port of a housing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multimedia.media.camera import Camera
from multimedia.media.collinearity import (
    Medium,
    Shifts,
    image_vectors,
    rays_in_object_space,
    shifts,
)
from multimedia.media.optical_media import OpticalMedia, Sight, SightDerivatives, by_pose
from multimedia.media.surfaces import tangents_of, unit_vector
from multimedia.refraction import Layers
from photocore.arrays import FloatArray, as_floats, read_only
from photocore.camera import rotation_from_vector
from photocore.errors import GeometryError, InputError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlatInterface(OpticalMedia):
    """Parallel layers on a plane of any tilt.

    Attributes
    ----------
    layers : Layers
        Media from the camera to the object.
    point : ndarray, shape (3,)
        Any point of the *last* face, the one that touches the object's medium. [object unit]
    normal : ndarray, shape (3,)
        Normal of the faces towards the camera; made a unit vector.
    moves_with_camera : bool
        Whether point and normal are given in the camera frame (x right, y up, z backwards, origin
        at the projection centre), as for the port of a housing, or in the world.

    Examples
    --------
    A port 5 mm thick whose outer face is 30 mm before the projection centre:

    >>> port = FlatInterface(
    ...     layers=Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.005,)),
    ...     point=(0, 0, -0.030), normal=(0, 0, 1), moves_with_camera=True)
    >>> port.parameter_names
    ('offset', 'tilt1', 'tilt2', 'thickness1', 'index1', 'index2', 'index3')
    """

    layers: Layers
    point: FloatArray = (0.0, 0.0, 0.0)  # type: ignore[assignment]
    normal: FloatArray = (0.0, 0.0, 1.0)  # type: ignore[assignment]
    moves_with_camera: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", unit_vector(self.normal, "normal"))
        object.__setattr__(self, "point", read_only(self.point, "point", shape=(3,)))

    @property
    def indices(self) -> tuple[float, ...]:
        """Refractive indices from the camera's medium to the object's."""
        return self.layers.indices

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of everything that an adjustment may estimate.

        ``offset``: shift of all faces along the normal; ``tilt1``, ``tilt2``: turn of the normal
        about `tangents`; ``thickness1``... of the inner layers, the last face staying where it
        is; ``index1``... from the camera's medium to the object's.
        """
        count = len(self.layers.indices)
        return (
            "offset",
            "tilt1",
            "tilt2",
            *(f"thickness{k}" for k in range(1, count - 1)),
            *(f"index{k}" for k in range(1, count + 1)),
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is odd about the layers."""
        return self.layers.remarks

    def mirror_normal(self, points: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return a direction in the faces: mirrored along them, points stay beyond them."""
        return self.tangents[0]

    @property
    def tangents(self) -> FloatArray:
        """Two unit vectors in the faces, at right angles, shape (2, 3)."""
        return tangents_of(self.normal)

    def value(self, name: str) -> float:
        """Return a parameter; offset and tilts count from where the interface is."""
        values = (0.0, 0.0, 0.0, *self.layers.thicknesses, *self.layers.indices)
        return values[self.parameter_names.index(name)]

    def stepped(self, names: Sequence[str], step: ArrayLike) -> Self:
        """Return the interface after adding ``step`` to the named parameters.

        Raises
        ------
        InputError
            If a name is unknown, or an index or thickness leaves what is possible.
        """
        change = dict(zip(names, as_floats(step, "step").tolist(), strict=True))
        unknown = [name for name in change if name not in self.parameter_names]
        if unknown:
            raise InputError(
                f"interface parameter {unknown[0]}: not one of {', '.join(self.parameter_names)}."
            )
        moved = {name: self.value(name) + change.get(name, 0.0) for name in self.parameter_names}
        offset, tilt1, tilt2, *materials = moved.values()
        thin = len(self.layers.thicknesses)
        return replace(
            self,
            layers=Layers(indices=tuple(materials[thin:]), thicknesses=tuple(materials[:thin])),
            point=self.point + offset * self.normal,
            normal=rotation_from_vector([tilt1, tilt2] @ self.tangents) @ self.normal,
        )

    def medium(self, camera: Camera) -> Medium:
        """Return the layers as ``camera`` meets them.

        Raises
        ------
        GeometryError
            If the camera is not in the first medium: inside the glass or beyond it.
        """
        if self.moves_with_camera:
            normal, height = self.normal, -float(self.normal @ self.point)
        else:
            normal = self.normal @ camera.rotation
            height = float(self.normal @ (camera.centre - self.point))
        thickness = float(sum(self.layers.thicknesses))
        if not height >= thickness:
            who = f"camera {camera.name}" if camera.name else "the camera"
            where = "inside the layers" if height > 0 else "on the object's side of the interface"
            raise GeometryError(
                f"{who} is {where}: its centre is {height:g} above the last face, but the "
                f"layers are {thickness:g} thick, in the unit of the centre. Check the signs of "
                "the normal (it points from the object to the camera) and the units of centre, "
                "point and thicknesses."
            )
        return Medium(normal=normal, height=height, layers=self.layers)

    def apparent_vectors(self, camera: Camera, points: FloatArray) -> FloatArray:
        """Return the vectors to the points, raised along the normal."""
        return image_vectors(camera.vectors_to(points), self.medium(camera))

    def seen_from_afar(self, points: FloatArray) -> FloatArray | None:
        """Return where points seem to be along the normal; None if that moves with the camera."""
        if self.moves_with_camera:
            return None
        thicknesses = self.layers.thicknesses
        raised = ((self.point - points) @ self.normal) * (1.0 - self.indices[0] / self.indices[-1])
        for thickness, index in zip(thicknesses, self.indices[1:-1], strict=True):
            raised = raised + thickness * (1.0 - self.indices[0] / index)
        return points + raised[:, None] * self.normal

    def seen(self, camera: Camera, points: FloatArray) -> tuple[FloatArray, NDArray[np.object_]]:
        """Return `apparent_vectors`, and which points lie before the last face."""
        medium = self.medium(camera)
        vectors = camera.vectors_to(points)
        before = vectors @ medium.normal + medium.height > 0
        reasons = np.where(before, "before the interface", "").astype(object)
        return image_vectors(vectors, medium), reasons

    def object_rays(self, camera: Camera, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Refract directions of the camera frame into the last medium, in closed form."""
        origins, rays = rays_in_object_space(directions, self.medium(camera))
        return origins @ camera.rotation.T + camera.centre, rays @ camera.rotation.T

    def sight(
        self, camera: Camera, points: FloatArray, *, exterior: bool, names: Sequence[str] = (),
        before: float = 0.0,
    ) -> Sight:  # fmt: skip
        """Return the vectors of `apparent_vectors` with analytic derivatives."""
        medium = self.medium(camera)
        vectors = camera.vectors_to(points)
        shift = shifts(vectors, medium, media=bool(names), before=before)
        apparent = vectors + shift.g[:, None] * medium.normal

        def derivatives(by_seen: FloatArray) -> SightDerivatives:
            # u = a + g(rho^2, w) m: the change of g adds a product of two vectors to the identity.
            along = (by_seen.reshape(-1, 3) @ medium.normal).reshape(-1, 2)  # d(image)/dg
            by_vector = along[:, :, None] * shift.gradient(vectors, medium)[:, None, :]
            by_vector += by_seen
            # Before faces that stand still rho and depth do not change with the rotation: the
            # whole seen vector turns; and the height changes with the centre.
            turning = (by_vector, vectors) if self.moves_with_camera else (by_seen, apparent)
            by_point, by_exterior = by_pose(camera, by_vector, turning if exterior else None)
            if exterior and not self.moves_with_camera:
                by_height = along * shift.by_height[:, None]
                by_exterior[..., :3] += by_height[:, :, None] * self.normal
            by_media = np.empty((len(points), 2, len(names)))
            for k, name in enumerate(names):
                by_media[:, :, k] = self._by_parameter(name, camera, vectors, by_seen, along, shift)
            return SightDerivatives(by_point, by_exterior, by_media)

        return Sight(apparent, derivatives)

    def _by_parameter(
        self,
        name: str,
        camera: Camera,
        vectors: FloatArray,
        by_seen: FloatArray,
        along: FloatArray,
        shift: Shifts,
    ) -> FloatArray:
        """Return the derivatives of the image by one of `parameter_names`, shape (n, 2)."""
        if name == "offset":
            return along * -shift.by_height[:, None]
        if name.startswith("thickness"):
            return along * shift.by_thicknesses[:, [int(name[9:]) - 1]]
        if name.startswith("index"):
            return along * shift.by_indices[:, [int(name[5:]) - 1]]
        to_camera: FloatArray = np.eye(3) if self.moves_with_camera else camera.rotation
        centre = -self.point if self.moves_with_camera else camera.centre - self.point
        # d(normal), in the interface's own frame
        turn = np.cross(self.tangents[int(name[-1]) - 1], self.normal)
        turn_camera = turn @ to_camera
        change = (shift.by_w - 2.0 * shift.w * shift.by_rho2) * (vectors @ turn_camera)
        change += shift.by_height * float(centre @ turn)
        return along * change[:, None] + (by_seen @ turn_camera) * shift.g[:, None]
