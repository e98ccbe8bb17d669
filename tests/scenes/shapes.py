"""Building blocks of a synthetic façade: convex solids, convex cavities, materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from tests.scenes.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """How a surface looks.

    Attributes
    ----------
    colour : tuple of float
        Reflectance of red, green and blue, 0..1.
    contrast : float
        Standard deviation of the texture relative to the colour.
    courses : tuple of float or None
        Height, length and joint width of blocks laid in courses. [m]
    tint : float
        Standard deviation of the blocks' brightness.
    mirror : float
        Share of the light that comes mirrored from the other side of the street.
    """

    colour: tuple[float, float, float]
    contrast: float = 0.1
    courses: tuple[float, float, float] | None = None
    tint: float = 0.05
    mirror: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Round:
    """A quadric |weights * (p - centre)| <= 1: cylinder (one weight 0), ellipsoid or sphere.

    Attributes
    ----------
    centre, weights : ndarray, shape (3,)
        Centre [m] and reciprocal half axes [1/m].
    """

    centre: FloatArray
    weights: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Convex:
    """A convex body: half-spaces n·p <= c and, optionally, a quadric.

    Attributes
    ----------
    planes : ndarray, shape (m, 4)
        Outward unit normals and offsets. [m]
    box : ndarray, shape (2, 3)
        Lower and upper corner of a bounding box. [m]
    material : Material
    round_part : Round or None
    parent : int
        For a cavity: index of the cavity whose floor it is sunk into, -1 for the wall itself.
    """

    planes: FloatArray
    box: FloatArray
    material: Material
    round_part: Round | None = None
    parent: int = -1


@dataclass(slots=True, kw_only=True)
class Target:
    """A survey target painted on a face parallel to the wall.

    Attributes
    ----------
    name : str
    position : tuple of float
        X, Y of its centre. [m]
    diameter : float [m]
    kind : str
        ``disc`` (black on white) or ``checker``.
    """

    name: str
    position: tuple[float, float]
    diameter: float = 0.06
    kind: str = "disc"


@dataclass(slots=True, kw_only=True)
class Scene:
    """A façade: the plane Z = 0 with cavities sunk into it and solids standing on it.

    Attributes
    ----------
    wall : Material
    solids, cavities : list of Convex
        Cavities in an order in which parents come first.
    targets : list of Target
    corners : dict of str to tuple of float
        Named sharp corners (X, Y, Z). [m]
    texel : float
        Finest detail of the textures. [m]
    sun : ndarray, shape (3,)
        Unit vector towards the light.
    ambient : float
        Share of the light that reaches the shadows.
    seed : int
        Of the textures.
    """

    wall: Material
    solids: list[Convex] = field(default_factory=list)
    cavities: list[Convex] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)
    corners: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    texel: float = 0.0025
    sun: FloatArray = field(default_factory=lambda: np.array([-0.40, 0.52, 0.755]))
    ambient: float = 0.5
    seed: int = 1

    def add(self, *bodies: Convex) -> None:
        """Put solids on the wall."""
        self.solids.extend(bodies)

    def sink(self, body: Convex) -> int:
        """Sink a cavity and return its index, to be the parent of others."""
        self.cavities.append(body)
        return len(self.cavities) - 1


def box(
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float],
    material: Material,
    *,
    parent: int = -1,
) -> Convex:
    """Return an axis-parallel block (or, sunk, a recess whose floor is at ``z[0]``)."""
    low, high = np.array([x[0], y[0], z[0]]), np.array([x[1], y[1], z[1]])
    planes = np.vstack([np.column_stack([np.eye(3), high]), np.column_stack([-np.eye(3), -low])])
    return Convex(planes=planes, box=np.stack([low, high]), material=material, parent=parent)


def prism(
    profile: Sequence[tuple[float, float]],
    span: tuple[float, float],
    material: Material,
    *,
    along: str = "x",
    parent: int = -1,
) -> Convex:
    """Return a convex polygon drawn out along an axis.

    Parameters
    ----------
    profile : sequence of (float, float)
        Corners in either sense, in the two other axes in the order x, y, z. [m]
    span : tuple of float
        From, to along the axis. [m]
    material : Material
    along : str
        ``x`` (mouldings: profile in y, z), ``y`` (x, z) or ``z`` (outlines: x, y).
    parent : int
        For cavities, see `Convex`.
    """
    axis = "xyz".index(along)
    others = [i for i in range(3) if i != axis]
    corners = np.asarray(profile, dtype=np.float64)
    following = np.roll(corners, -1, axis=0)
    edges = following - corners
    area = float((corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]).sum())
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) * np.sign(area)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    planes = np.zeros((len(corners) + 2, 4))
    planes[:-2, others] = normals
    planes[:-2, 3] = (normals * corners).sum(1)
    planes[-2, axis], planes[-2, 3] = 1.0, span[1]
    planes[-1, axis], planes[-1, 3] = -1.0, -span[0]
    bounds = np.zeros((2, 3))
    bounds[:, axis] = span
    bounds[:, others] = corners.min(0), corners.max(0)
    return Convex(planes=planes, box=bounds, material=material, parent=parent)


def column(
    centre: tuple[float, float],
    radius: float,
    y: tuple[float, float],
    material: Material,
) -> Convex:
    """Return an upright round column about (x, z)."""
    x, z = centre
    low, high = np.array([x - radius, y[0], z - radius]), np.array([x + radius, y[1], z + radius])
    planes = np.array([[0.0, 1.0, 0.0, y[1]], [0.0, -1.0, 0.0, -y[0]]])
    shape = Round(centre=np.array([x, 0.0, z]), weights=np.array([1 / radius, 0.0, 1 / radius]))
    return Convex(planes=planes, box=np.stack([low, high]), material=material, round_part=shape)


def roll(
    centre: tuple[float, float],
    radius: float,
    x: tuple[float, float],
    material: Material,
) -> Convex:
    """Return a round moulding along X about (y, z)."""
    y, z = centre
    low, high = np.array([x[0], y - radius, z - radius]), np.array([x[1], y + radius, z + radius])
    planes = np.array([[1.0, 0.0, 0.0, x[1]], [-1.0, 0.0, 0.0, -x[0]]])
    shape = Round(centre=np.array([0.0, y, z]), weights=np.array([0.0, 1 / radius, 1 / radius]))
    return Convex(planes=planes, box=np.stack([low, high]), material=material, round_part=shape)


def boss(
    centre: tuple[float, float, float], half_axes: tuple[float, float, float], material: Material
) -> Convex:
    """Return an ellipsoid (a carved boss when half sunk in the wall)."""
    middle, half = np.array(centre), np.array(half_axes)
    return Convex(
        planes=np.array([[0.0, 0.0, -1.0, -(middle[2] - half[2])]]),
        box=np.stack([middle - half, middle + half]),
        material=material,
        round_part=Round(centre=middle, weights=1 / half),
    )


def arch_outline(
    x: tuple[float, float], y: tuple[float, float], *, facets: int = 16
) -> list[tuple[float, float]]:
    """Return the outline of a round-headed opening; ``y[1]`` is the springing line."""
    middle, radius = (x[0] + x[1]) / 2, (x[1] - x[0]) / 2
    angles = np.linspace(0.0, np.pi, facets + 1)
    head = [(float(middle + radius * np.cos(a)), float(y[1] + radius * np.sin(a))) for a in angles]
    return [(x[0], y[0]), (x[1], y[0]), *head]
