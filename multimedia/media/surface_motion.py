"""How surfaces may differ from what they are: moved, turned, grown; the unknowns of an adjustment.

Faces that belong to one body (the two sides of a dome, a tube or a pane) keep their form together:
they are concentric, coaxial or parallel, and what an adjustment estimates is where the body is, how
large, and how thick.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from multimedia.media.surfaces import (
    Cylinder,
    Plane,
    RefractingSurface,
    RigidSurface,
    Sphere,
    tangents_of,
)
from photocore.arrays import FloatArray
from photocore.camera import rotation_from_vector, skew

#: Faces belong to one body if centres, axes or normals agree to this share of their size.
TOGETHER = 1e-9
#: Names of the parameters of a body; those of its layers and media are numbered from the camera.
_OF_BODY: dict[type, tuple[str, ...]] = {
    Plane: ("offset", "tilt1", "tilt2"),
    Sphere: ("centreX", "centreY", "centreZ", "radius"),
    Cylinder: ("shift1", "shift2", "tilt1", "tilt2", "radius"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurfaceMotion:
    """A small change of a surface, per unit of a parameter.

    Attributes
    ----------
    shift : ndarray, shape (3,)
        Of the pivot.
    rotation : ndarray, shape (3,)
        Rotation vector about the pivot. [rad]
    pivot : ndarray, shape (3,)
    growth : float
        Of the radius of a round surface; a plane moves along its normal by it.
    """

    shift: FloatArray = field(default_factory=lambda: np.zeros(3))
    rotation: FloatArray = field(default_factory=lambda: np.zeros(3))
    pivot: FloatArray = field(default_factory=lambda: np.zeros(3))
    growth: float = 0.0

    def velocity(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return how points that stick to the surface move, shape (n, 3)."""
        moved: FloatArray = np.broadcast_to(self.shift, points.shape)
        if self.rotation.any():
            moved = moved + (points - self.pivot) @ skew(self.rotation).T
        return moved + self.growth * normals if self.growth else moved

    def seen_from(self, rotation: FloatArray, centre: FloatArray) -> SurfaceMotion:
        """Return the change in the frame in which a point of this one is rotation x + centre."""
        return SurfaceMotion(
            shift=rotation @ self.shift, rotation=rotation @ self.rotation,
            pivot=rotation @ self.pivot + centre, growth=self.growth,
        )  # fmt: skip

    def applied(self, surface: RefractingSurface, step: float) -> RefractingSurface:
        """Return the surface after a step of the parameter."""
        turned = rotation_from_vector(step * self.rotation)
        moved = surface.moved(turned, step * self.shift + self.pivot - turned @ self.pivot)
        if isinstance(moved, Sphere | Cylinder):
            return replace(moved, radius=moved.radius + step * self.growth)
        assert isinstance(moved, Plane)
        return moved.shifted(step * self.growth * moved.normal)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Body:
    """Neighbouring surfaces that keep their form together.

    Attributes
    ----------
    first : int
        Number of its first surface, counted from the camera, from 1.
    surfaces : tuple of RigidSurface
        All of one kind.
    """

    first: int
    surfaces: tuple[RigidSurface, ...]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of its own parameters; those of bodies farther on end in @ and their number."""
        suffix = f"@{self.first}" if self.first > 1 else ""
        return tuple(name + suffix for name in _OF_BODY[type(self.surfaces[0])])

    @property
    def layers(self) -> dict[str, int]:
        """Names of the thicknesses between its faces, and the face before each.

        None where a surface is listed twice (a tube that is looked right through).
        """
        if len(set(map(id, self.surfaces))) < len(self.surfaces):
            return {}
        thick = enumerate(np.abs(np.diff(self.heights)).tolist())
        return {f"thickness{self.first + k}": k for k, height in thick if height > 0}

    @property
    def heights(self) -> FloatArray:
        """Radii, or the places of planes along the first normal."""
        first = self.surfaces[0]
        if isinstance(first, Plane):
            return np.array([first.normal @ s.point for s in self.surfaces if isinstance(s, Plane)])
        return np.array([s.radius for s in self.surfaces if isinstance(s, Sphere | Cylinder)])

    def value(self, name: str) -> float:
        """Return a parameter; offsets, shifts and tilts count from where the body is."""
        if name in self.layers:
            k = self.layers[name]
            return float(abs(self.heights[k + 1] - self.heights[k]))
        first, kind = self.surfaces[0], name.partition("@")[0]
        if kind == "radius":
            return float(self.heights[0])
        if isinstance(first, Sphere):
            return float(first.centre["XYZ".index(kind[-1])])
        return 0.0

    def motions(self, name: str) -> tuple[SurfaceMotion, ...]:
        """Return how each face changes with a parameter."""
        count = len(self.surfaces)
        if name in self.layers:
            # The last face stays where it is, those before make room.
            k, first = self.layers[name], self.surfaces[0]
            away = -float(np.sign(self.heights[k + 1] - self.heights[k]))
            before = SurfaceMotion(growth=away)
            if isinstance(first, Plane):
                before = SurfaceMotion(shift=away * first.normal)
            return (before,) * (k + 1) + (SurfaceMotion(),) * (count - k - 1)
        return (self._motion(name.partition("@")[0]),) * count

    def _motion(self, kind: str) -> SurfaceMotion:
        """Return the change of all faces together."""
        last = self.surfaces[-1]
        if kind == "radius":
            return SurfaceMotion(growth=1.0)
        if isinstance(last, Sphere):
            return SurfaceMotion(shift=np.eye(3)["XYZ".index(kind[-1])])
        assert isinstance(last, Plane | Cylinder)
        along = last.normal if isinstance(last, Plane) else last.axis
        if kind == "offset":
            return SurfaceMotion(shift=along)
        direction = tangents_of(along)[int(kind[-1]) - 1]
        if kind.startswith("shift"):
            return SurfaceMotion(shift=direction)
        return SurfaceMotion(rotation=direction, pivot=last.point)


def bodies_of(
    surfaces: Sequence[RefractingSurface], with_camera: Sequence[bool]
) -> tuple[Body, ...]:
    """Return the bodies that neighbouring surfaces belong to; waves and rasters have none."""
    groups: list[tuple[int, list[RigidSurface]]] = []
    for number, surface in enumerate(surfaces, start=1):
        if not isinstance(surface, RigidSurface):
            continue
        if (
            groups
            and groups[-1][0] + len(groups[-1][1]) == number
            and with_camera[number - 2] == with_camera[number - 1]
            and _belong_together(groups[-1][1][-1], surface)
        ):
            groups[-1][1].append(surface)
        else:
            groups.append((number, [surface]))
    return tuple(Body(first=first, surfaces=tuple(faces)) for first, faces in groups)


def _belong_together(first: RigidSurface, second: RigidSurface) -> bool:
    """Return whether two faces are concentric, coaxial or parallel."""
    if isinstance(first, Sphere) and isinstance(second, Sphere):
        apart = np.linalg.norm(first.centre - second.centre)
        return bool(apart <= TOGETHER * max(first.radius, second.radius))
    if isinstance(first, Plane) and isinstance(second, Plane):
        return bool(np.linalg.norm(np.cross(first.normal, second.normal)) <= TOGETHER)
    if isinstance(first, Cylinder) and isinstance(second, Cylinder):
        between = np.linalg.norm(np.cross(second.point - first.point, first.axis))
        parallel = np.linalg.norm(np.cross(first.axis, second.axis)) <= TOGETHER
        return bool(parallel and between <= TOGETHER * max(first.radius, second.radius))
    return False
