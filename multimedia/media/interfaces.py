"""A sequence of surfaces with the media between them, from the camera to the object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.surfaces import Cylinder, Plane, Sphere, Surface
from multimedia.refraction.layers import Layers, checked_indices
from photocore.arrays import BoolArray, FloatArray, read_only
from photocore.errors import GeometryError, InputError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Interfaces:
    """Surfaces in the order in which a ray from the camera meets them (Kotowski 1988).

    Attributes
    ----------
    surfaces : tuple of Surface
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

    surfaces: tuple[Surface, ...]
    indices: tuple[float, ...]
    with_camera: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "surfaces", tuple(self.surfaces))
        set_(self, "indices", checked_indices(self.indices))
        set_(self, "with_camera", tuple(self.with_camera) or (False,) * len(self.surfaces))
        if len(self.indices) != len(self.surfaces) + 1:
            raise InputError(
                f"indices: {len(self.surfaces)} surfaces lie between {len(self.surfaces) + 1} "
                f"media, but {len(self.indices)} indices are given."
            )
        if len(self.with_camera) != len(self.surfaces):
            raise InputError(
                f"with_camera: expected {len(self.surfaces)} values, one per surface, "
                f"found {len(self.with_camera)}."
            )
        for surface, moves in zip(self.surfaces, self.with_camera, strict=True):
            if moves and not isinstance(surface, Plane | Sphere | Cylinder):
                raise GeometryError(
                    f"with_camera: a {type(surface).__name__} stands still in the object frame; "
                    "only a Plane, Sphere or Cylinder can be fixed to the camera."
                )

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
        InputError
            If the matrix is not a rotation (a scale, or a mirrored frame).
        """
        rotation = read_only(world_from_camera, "world_from_camera", shape=(3, 3))
        translation = read_only(centre, "centre", shape=(3,))
        if not (
            np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9) and np.linalg.det(rotation) > 0
        ):
            raise InputError("world_from_camera: not a rotation matrix (orthogonal, det = +1).")
        surfaces = tuple(
            surface.moved(rotation, translation)
            if moves and isinstance(surface, Plane | Sphere | Cylinder)
            else surface
            for surface, moves in zip(self.surfaces, self.with_camera, strict=True)
        )
        return Interfaces(surfaces=surfaces, indices=self.indices)

    def shifted(self, vector: ArrayLike) -> Interfaces:
        """Return the interfaces moved by a vector; used to work near the origin."""
        return Interfaces(
            surfaces=tuple(surface.shifted(vector) for surface in self.surfaces),
            indices=self.indices,
            with_camera=self.with_camera,
        )

    def reversed(self) -> Interfaces:
        """Return the same media in the order of a ray from the object."""
        return Interfaces(
            surfaces=self.surfaces[::-1],
            indices=self.indices[::-1],
            with_camera=self.with_camera[::-1],
        )

    def with_indices(self, indices: Sequence[float]) -> Interfaces:
        """Return the same surfaces between other media."""
        return Interfaces(
            surfaces=self.surfaces, indices=tuple(indices), with_camera=self.with_camera
        )

    def separates(self, starts: FloatArray, ends: FloatArray) -> BoolArray:
        """Return whether each pair of points lies on the sides the sequence demands, shape (n,).

        A surface listed an odd number of times must have the two points on different sides, one
        listed twice on the same side. A point on the surface belongs to both.
        """
        good = np.ones(len(starts), dtype=bool)
        for surface in dict.fromkeys(self.surfaces):
            crossings = sum(other is surface for other in self.surfaces)
            product = surface.side(starts) * surface.side(ends)
            good &= (product <= 0) if crossings % 2 else (product >= 0)
        return good
