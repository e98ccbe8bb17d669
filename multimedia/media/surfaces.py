"""Interfaces between media that a ray can meet: plane of any tilt, sphere, cylinder.

A surface answers four questions, for many rays at once: on which side a point lies, how far a ray
travels to its next meeting with the surface, the unit normal there, and how the normal turns when
the point moves (the shape operator, which the derivative of a refracted ray needs).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_floats, positive, read_only
from photocore.errors import GeometryError


class RefractingSurface(ABC):
    """What ray tracing asks of an interface. All arrays are float64, points on the last axis."""

    __slots__ = ()

    @abstractmethod
    def side(self, points: FloatArray) -> FloatArray:
        """Return a value per point, shape (...): its sign tells the side, zero is on the surface.

        Positive on the side the normals point to. [unit of the points]
        """

    @abstractmethod
    def hop(self, origins: FloatArray, directions: FloatArray, beyond: FloatArray) -> FloatArray:
        """Return the distance along each ray to the first meeting farther than ``beyond``.

        Shape (n,); NaN where the ray never meets the surface.
        """

    @abstractmethod
    def normals(self, points: FloatArray) -> FloatArray:
        """Return the unit normals at points of the surface, shape (n, 3)."""

    @abstractmethod
    def curvature(self, points: FloatArray, normals: FloatArray, steps: FloatArray) -> FloatArray:
        """Return how the unit normals change when points of the surface move along it.

        ``steps`` are k tangent vectors per point, shape (n, k, 3); so is the result.
        """

    @abstractmethod
    def shifted(self, vector: ArrayLike) -> Self:
        """Return the surface moved by a vector."""

    def moved(self, rotation: FloatArray, translation: FloatArray) -> Self:  # noqa: ARG002
        """Return the surface of one frame as seen in another, x' = rotation x + translation.

        Raises
        ------
        GeometryError
            Unless it is a `RigidSurface`.
        """
        raise GeometryError(remark("surface.fixed_to_camera", kind=type(self).__name__))


class RigidSurface(RefractingSurface):
    """A surface that can be fixed to a camera: it is known wherever it is moved and turned."""

    __slots__ = ()

    @abstractmethod
    def moved(self, rotation: FloatArray, translation: FloatArray) -> Self:
        """Return the surface of one frame as seen in another, x' = rotation x + translation."""

    def shifted(self, vector: ArrayLike) -> Self:
        """Return the surface moved by a vector."""
        return self.moved(np.eye(3), as_floats(vector, "vector"))


def tangents_of(normal: FloatArray) -> FloatArray:
    """Return two unit vectors at right angles to a unit normal and to each other, shape (2, 3)."""
    axis = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(normal, axis)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane(RigidSurface):
    """A plane of any tilt.

    Attributes
    ----------
    point : ndarray, shape (3,)
        Any point of the plane.
    normal : ndarray, shape (3,)
        Its normal; made a unit vector. Default: the vertical.

    Examples
    --------
    >>> surface = Plane.level(1.8075)
    >>> float(surface.side(np.array([0.0, 0.0, 2.0])).round(4))
    0.1925
    """

    point: FloatArray
    normal: FloatArray = (0.0, 0.0, 1.0)  # type: ignore[assignment]

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", read_only(self.point, "point", shape=(3,)))
        object.__setattr__(self, "normal", unit_vector(self.normal, "normal"))

    @classmethod
    def level(cls, height: float) -> Plane:
        """Return the horizontal plane Z = height."""
        return cls(point=(0.0, 0.0, height))  # type: ignore[arg-type]

    @classmethod
    def tilted(cls, height: float, *, slope_x: float, slope_y: float) -> Plane:
        """Return the plane Z = height + slope_x X + slope_y Y."""
        return cls(
            point=(0.0, 0.0, height),  # type: ignore[arg-type]
            normal=(-slope_x, -slope_y, 1.0),  # type: ignore[arg-type]
        )

    @property
    def middle(self) -> float:
        """The height of its point."""
        return float(self.point[2])

    def height_at(self, xy: FloatArray) -> FloatArray:
        """Return the height above each position, shape (...); no plane that stands on edge."""
        offset: FloatArray = (xy - self.point[:2]) @ (self.normal[:2] / self.normal[2])
        return self.point[2] - offset

    def side(self, points: FloatArray) -> FloatArray:
        """Return the signed distance to the plane."""
        distance: FloatArray = (points - self.point) @ self.normal
        return distance

    def hop(self, origins: FloatArray, directions: FloatArray, beyond: FloatArray) -> FloatArray:
        """Return the distance to the plane along each ray; NaN for rays along or away from it."""
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = -self.side(origins) / (directions @ self.normal)
        return np.where((distance > beyond) & np.isfinite(distance), distance, np.nan)

    def normals(self, points: FloatArray) -> FloatArray:
        """Return the one normal for every point."""
        return np.broadcast_to(self.normal, points.shape)

    def curvature(self, points: FloatArray, normals: FloatArray, steps: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return zero: the normal of a plane never turns."""
        return np.zeros_like(steps)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> Plane:
        """Return the plane given in one frame as seen in another, x' = rotation x + translation."""
        return Plane(point=rotation @ self.point + translation, normal=rotation @ self.normal)


class _RoundSurface(RigidSurface):
    """What spheres and cylinders share; normals point outwards. Subclasses say what is radial."""

    __slots__ = ()

    radius: float

    @abstractmethod
    def _radial(self, vectors: FloatArray) -> FloatArray:
        """Return the part of vectors in which the surface is a circle."""

    @abstractmethod
    def _offset(self, points: FloatArray) -> FloatArray:
        """Return the radial part of the vectors from the centre to points."""

    def side(self, points: FloatArray) -> FloatArray:
        """Return the distance outside the surface, negative inside."""
        distance: FloatArray = np.linalg.norm(self._offset(points), axis=-1) - self.radius
        return distance

    def hop(self, origins: FloatArray, directions: FloatArray, beyond: FloatArray) -> FloatArray:
        """Return the distance to the next meeting with the surface; NaN where there is none."""
        return _hop_round(self._offset(origins), self._radial(directions), self.radius, beyond)

    def normals(self, points: FloatArray) -> FloatArray:
        """Return the outward radii."""
        return self._offset(points) / self.radius

    def curvature(self, points: FloatArray, normals: FloatArray, steps: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return the radial part of the steps, over the radius."""
        return self._radial(steps) / self.radius


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sphere(_RoundSurface):
    """A sphere, such as the inner or outer face of a dome port; normals point outwards.

    Attributes
    ----------
    centre : ndarray, shape (3,)
        Its centre.
    radius : float
        Its radius, in the unit of the centre.
    """

    centre: FloatArray
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", read_only(self.centre, "centre", shape=(3,)))
        object.__setattr__(self, "radius", positive(self.radius, "radius"))

    def _radial(self, vectors: FloatArray) -> FloatArray:
        """Return the vectors."""
        return vectors

    def _offset(self, points: FloatArray) -> FloatArray:
        """Return the vectors from the centre."""
        return points - self.centre

    def moved(self, rotation: FloatArray, translation: FloatArray) -> Sphere:
        """Return the sphere given in one frame as seen in another."""
        return replace(self, centre=rotation @ self.centre + translation)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cylinder(_RoundSurface):
    """An endless circular cylinder, such as one wall of a glass tube; normals point outwards.

    Attributes
    ----------
    point : ndarray, shape (3,)
        Any point of the axis.
    axis : ndarray, shape (3,)
        Direction of the axis; made a unit vector.
    radius : float
        Radius, in the unit of the point.
    """

    point: FloatArray
    axis: FloatArray
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", read_only(self.point, "point", shape=(3,)))
        object.__setattr__(self, "axis", unit_vector(self.axis, "axis"))
        object.__setattr__(self, "radius", positive(self.radius, "radius"))

    def _radial(self, vectors: FloatArray) -> FloatArray:
        """Return the part of vectors at right angles to the axis."""
        return vectors - (vectors @ self.axis)[..., None] * self.axis

    def _offset(self, points: FloatArray) -> FloatArray:
        """Return the shortest vectors from the axis."""
        return self._radial(points - self.point)

    def moved(self, rotation: FloatArray, translation: FloatArray) -> Cylinder:
        """Return the cylinder given in one frame as seen in another."""
        return replace(self, point=rotation @ self.point + translation, axis=rotation @ self.axis)


def _hop_round(
    offset: FloatArray, directions: FloatArray, radius: float, beyond: FloatArray
) -> FloatArray:
    """Return the first root beyond ``beyond`` of |offset + t directions| = radius.

    For the cylinder the vectors are the parts across its axis, so directions may be short.
    """
    a = (directions * directions).sum(-1)
    half_b = (offset * directions).sum(-1)
    length = np.sqrt((offset * offset).sum(-1))
    # (|offset| - r)(|offset| + r), not the difference of squares: exact beside the surface.
    c = (length - radius) * (length + radius)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Discriminant from the distance of the ray to the centre: no cancellation far away.
        nearest = offset - (half_b / a)[..., None] * directions
        gap = np.sqrt((nearest * nearest).sum(-1))
        root = np.sqrt(a * (radius - gap) * (radius + gap))
        # The two roots without subtracting near-equal numbers: q / a and c / q.
        q = -(half_b + np.copysign(root, half_b))
        first, second = q / a, c / q
        near, far = np.fmin(first, second), np.fmax(first, second)
        distance = np.where(near > beyond, near, np.where(far > beyond, far, np.nan))
    return np.where(np.isfinite(distance), distance, np.nan)


def unit_vector(vector: ArrayLike, name: str) -> FloatArray:
    """Return a read-only unit vector."""
    array = read_only(vector, name, shape=(3,))
    length = float(np.linalg.norm(array))
    if length == 0:
        raise GeometryError(f"{name}: the vector (0, 0, 0) has no direction.")
    return read_only(array / length, name)
