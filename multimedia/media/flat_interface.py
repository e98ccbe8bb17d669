"""Plane-parallel layers and where they are: a tank wall, a water surface, the port of a housing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.camera import Camera
from multimedia.media.collinearity import Medium
from multimedia.refraction.layers import Layers
from photocore.arrays import FloatArray, as_floats, read_only
from photocore.errors import GeometryError, InputError
from photocore.rotation import rotation_from_vector


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlatInterface:
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
        normal = read_only(self.normal, "normal", shape=(3,))
        length = float(np.linalg.norm(normal))
        if length == 0:
            raise GeometryError("normal: the vector (0, 0, 0) has no direction.")
        object.__setattr__(self, "normal", read_only(normal / length, "normal"))
        object.__setattr__(self, "point", read_only(self.point, "point", shape=(3,)))

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
    def tangents(self) -> FloatArray:
        """Two unit vectors in the faces, at right angles, shape (2, 3)."""
        axis = np.eye(3)[np.argmin(np.abs(self.normal))]
        first = np.cross(self.normal, axis)
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(self.normal, first)])

    def value(self, name: str) -> float:
        """Return a parameter; offset and tilts count from where the interface is."""
        if name in ("offset", "tilt1", "tilt2"):
            return 0.0
        kind, number = name[:-1], int(name[-1]) - 1
        source = self.layers.indices if kind == "index" else self.layers.thicknesses
        return float(source[number])

    def stepped(self, names: Sequence[str], step: ArrayLike) -> FlatInterface:
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
        tilt = np.array([change.get("tilt1", 0.0), change.get("tilt2", 0.0)]) @ self.tangents
        layers = self.layers
        if any(name[:5] in ("index", "thick") for name in change):
            layers = replace(
                layers,
                indices=tuple(
                    n + change.get(f"index{k}", 0.0) for k, n in enumerate(layers.indices, 1)
                ),
                thicknesses=tuple(
                    t + change.get(f"thickness{k}", 0.0)
                    for k, t in enumerate(layers.thicknesses, 1)
                ),
            )
        return replace(
            self,
            layers=layers,
            point=self.point + change.get("offset", 0.0) * self.normal,
            normal=rotation_from_vector(tilt) @ self.normal,
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
                f"layers are {thickness:g} thick. Check the signs of the normal (it points from "
                "the object to the camera) and the units of centre, point and thicknesses."
            )
        return Medium(
            normal=normal,
            height=height,
            thicknesses=tuple(self.layers.thicknesses),
            indices=tuple(self.layers.indices),
        )
