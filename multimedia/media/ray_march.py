"""Forward ray tracing, surface by surface, with the derivatives that travel along.

Snell's law for unit vectors, with the normal n against the ray and mu = n1 / n2:
``d' = mu d + (mu cos a - cos b) n``, ``cos a = -n . d``, ``cos b = sqrt(1 - mu^2 sin^2 a)``
(Kotowski 1988). Its differential carries the derivatives by the start direction and by whatever
else changes (`PathChanges`) through to the last medium.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from multimedia.media.graded_medium import GradedRays
from multimedia.media.ray_paths import RayPaths, RayStatus
from multimedia.media.surface_motion import SurfaceMotion
from multimedia.media.surface_sequence import SurfaceSequence
from multimedia.media.surfaces import RefractingSurface
from photocore.arrays import FloatArray, IntArray
from photocore.camera import skew

#: A ray may meet the next surface this far behind itself (share of the scene): surfaces in touch.
TOUCH = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathChanges:
    """What else may change than the start direction: k parameters.

    Attributes
    ----------
    starts : ndarray, shape (k, 3)
        How the start of the rays moves.
    motions : tuple of tuple of SurfaceMotion or None
        Per parameter and surface.
    indices : ndarray, shape (k, media)
    gradients : ndarray, shape (k,)
        Of the index of the last medium by depth.
    """

    starts: FloatArray
    motions: tuple[tuple[SurfaceMotion | None, ...], ...]
    indices: FloatArray
    gradients: FloatArray

    @property
    def count(self) -> int:
        """Number of parameters."""
        return len(self.starts)


class March(NamedTuple):
    """Rays after the last surface, with derivatives by the two start angles and the changes."""

    vertices: FloatArray  # (n, k, 3)
    directions: FloatArray  # (n, k + 1, 3)
    steps: FloatArray  # (n, 2 + changes, 3): derivative of the last vertex
    bends: FloatArray  # (n, 2 + changes, 3): derivative of the last direction
    status: IntArray  # (n,)

    @property
    def paths(self) -> RayPaths:
        """Without derivatives."""
        return RayPaths(vertices=self.vertices, directions=self.directions, status=self.status)

    def take(self, rows: IntArray) -> March:
        """Return some of the rays."""
        return March._make(field[rows] for field in self)


class _Meeting(NamedTuple):
    """Rays at one surface: how far they came, where they are, and how they were refracted."""

    distance: FloatArray  # (n,)
    place: FloatArray  # (n, 3)
    outward: FloatArray  # (n, 3): the surface's normal
    normal: FloatArray  # (n, 3): turned against the ray
    cos_a: FloatArray
    cos_b: FloatArray
    ratio: FloatArray  # (n,) or (1,)
    heading: FloatArray  # (n, 3): before

    @property
    def factor(self) -> FloatArray:
        """Share of the normal in the new direction."""
        return self.ratio * self.cos_a - self.cos_b

    @property
    def bent(self) -> FloatArray:
        """Direction behind the surface."""
        return self.ratio[:, None] * self.heading + self.factor[:, None] * self.normal


def march_rays(
    origins: FloatArray,
    directions: FloatArray,
    interfaces: SurfaceSequence,
    *,
    derivatives: bool = True,
    frame: FloatArray | None = None,
    changes: PathChanges | None = None,
) -> March:
    """Trace unit directions; with derivatives by steps along the two vectors of ``frame``."""
    count, total = len(interfaces.surfaces), len(origins)
    vertices = np.full((total, count, 3), np.nan)
    headings = np.full((total, count + 1, 3), np.nan)
    headings[:, 0] = directions
    status = np.zeros(total, dtype=np.int64)
    here, heading = origins, directions
    more = changes.count if changes is not None else 0
    step: FloatArray = np.zeros((total, 2 + more, 3))
    bend: FloatArray = np.zeros((total, 2 + more, 3))
    if frame is not None:
        bend[:, :2] = frame
    if changes is not None:
        step[:, 2:] = changes.starts
    before: RefractingSurface | None = None
    for number, surface in enumerate(interfaces.surfaces):
        met = _meet(here, heading, interfaces, number, status, again=surface is before)
        with np.errstate(invalid="ignore", divide="ignore"):
            bent = met.bent
            if derivatives:
                step, bend = _carried(step, bend, met, interfaces, number, changes)
        here, heading, before = met.place, bent, surface
        vertices[:, number], headings[:, number + 1] = here, heading
    lost = status != RayStatus.OK
    vertices[lost], headings[lost] = np.nan, np.nan
    return March(vertices, headings, step, bend, status)


def _meet(
    here: FloatArray, heading: FloatArray, interfaces: SurfaceSequence, number: int,
    status: IntArray, *, again: bool,
) -> _Meeting:  # fmt: skip
    """Return how rays meet a surface; note in ``status`` which of them do not get through."""
    surface = interfaces.surfaces[number]
    scale = np.abs(here).max(-1) + 1e-300
    # A surface met twice in a row must be left first; different ones may touch.
    beyond = (1e-9 if again else -TOUCH) * scale
    distance = surface.hop(here, heading, beyond)
    status[(status == RayStatus.OK) & ~np.isfinite(distance)] = RayStatus.MISSED
    place = here + distance[:, None] * heading
    outward = surface.normals(place)
    incline = (outward * heading).sum(-1)
    normal = np.where((incline > 0)[:, None], -outward, outward)
    cos_a = np.abs(incline)
    after = np.atleast_1d(interfaces.index_behind(number, place))
    ratio = interfaces.indices[number] / after
    square = 1 - ratio * ratio * (1 - cos_a) * (1 + cos_a)
    status[(status == RayStatus.OK) & (square < 0)] = RayStatus.TOTAL_REFLECTION
    with np.errstate(invalid="ignore"):
        cos_b = np.sqrt(square)
    return _Meeting(distance, place, outward, normal, cos_a, cos_b, ratio, heading)


def _carried(
    step: FloatArray, bend: FloatArray, met: _Meeting, interfaces: SurfaceSequence, number: int,
    changes: PathChanges | None,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return the derivatives of vertex and direction behind a surface from those before it."""
    normal, cos_a, cos_b, ratio = met.normal, met.cos_a, met.cos_b, met.ratio
    flipped = ((met.outward * met.heading).sum(-1) > 0)[:, None, None]
    # The vertex slides along the surface, the normal turns, Snell's law follows.
    free = step + met.distance[:, None, None] * bend
    velocity, spin = _surface_changes(step.shape, met, number, changes)
    toward = free if velocity is None else free - velocity
    slide = (toward @ normal[:, :, None])[..., 0] / cos_a[:, None]
    step = free + slide[..., None] * met.heading[:, None, :]
    along = step if velocity is None else step - velocity
    turned = interfaces.surfaces[number].curvature(met.place, met.outward, along)
    turned = np.where(flipped, -turned, turned)
    if spin is not None and spin.any():
        turned = turned + (normal @ skew(spin).transpose(0, 2, 1)).transpose(1, 0, 2)
    d_cos_a = -(bend @ normal[:, :, None])[..., 0]
    d_cos_a -= (turned @ met.heading[:, :, None])[..., 0]
    d_factor = ratio[:, None] * d_cos_a - (ratio * ratio * cos_a / cos_b)[:, None] * d_cos_a
    bend = ratio[:, None, None] * bend + met.factor[:, None, None] * turned
    d_ratio = _ratio_changes(step, met, interfaces, number, changes)
    if d_ratio is not None:
        sine2 = (1 - cos_a) * (1 + cos_a)
        d_factor = d_factor + d_ratio * (cos_a + ratio * sine2 / cos_b)[:, None]
        bend = bend + d_ratio[..., None] * met.heading[:, None, :]
    return step, bend + d_factor[..., None] * normal[:, None, :]


def _surface_changes(
    shape: tuple[int, ...], met: _Meeting, number: int, changes: PathChanges | None
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return how the surface moves where it is met, (n, k, 3), and how it turns, (k, 3)."""
    motions = [each[number] for each in changes.motions] if changes is not None else []
    if not any(motions):
        return None, None
    velocity, spin = np.zeros(shape), np.zeros(shape[1:])
    for k, motion in enumerate(motions, start=2):
        if motion is not None:
            velocity[:, k] = motion.velocity(met.place, met.outward)
            spin[k] = motion.rotation
    return velocity, spin


def _ratio_changes(
    step: FloatArray, met: _Meeting, interfaces: SurfaceSequence, number: int,
    changes: PathChanges | None,
) -> FloatArray | None:  # fmt: skip
    """Return how the ratio of the indices changes, (n, k); None if it does not."""
    last = number + 1 == len(interfaces.surfaces)
    graded = last and interfaces.is_graded
    if not graded and (changes is None or not (changes.indices.any() or changes.gradients.any())):
        return None
    d_before, d_after = np.zeros((2, *step.shape[:2]))
    if changes is not None:
        d_before[:, 2:] = changes.indices[:, number]
        d_after[:, 2:] = changes.indices[:, number + 1]
        if last:
            depth = interfaces.level - met.place[:, 2]
            d_after[:, 2:] += depth[:, None] * changes.gradients
    if last:
        d_after -= interfaces.gradient * step[:, :, 2]
    before = interfaces.indices[number]
    return (d_before - met.ratio[:, None] * d_after) * (met.ratio / before)[:, None]


def graded_rays(march: March, interfaces: SurfaceSequence) -> GradedRays:
    """Return the rays of a march as they enter the last medium, if that is graded."""
    place = march.vertices[:, -1]
    index = np.broadcast_to(
        interfaces.index_behind(len(interfaces.surfaces) - 1, place), len(place)
    )
    return GradedRays(
        origins=place, index=index, momenta=index[:, None] * march.directions[:, -1],
        gradient=interfaces.gradient_vector,
    )  # fmt: skip


def drift_at(
    end: FloatArray, march: March, interfaces: SurfaceSequence, changes: PathChanges | None
) -> tuple[FloatArray, FloatArray]:
    """Return the direction in which each ray passes its end point, and how it moves there.

    Returns
    -------
    heading : ndarray, shape (n, 3)
        Unit vectors.
    drift : ndarray, shape (n, 2 + changes, 3)
        What lies along the heading has no meaning.
    """
    heading = march.directions[:, -1]
    if not interfaces.is_graded and (changes is None or not changes.gradients.any()):
        ahead = ((end - march.vertices[:, -1]) * heading).sum(-1)
        return heading, march.steps + ahead[:, None, None] * march.bends
    rays = graded_rays(march, interfaces)
    tau = rays.nearest(end)
    along = rays.at(tau)[1]
    gradients = np.zeros((march.steps.shape[1], 3))
    d_index = march.steps @ rays.gradient
    if changes is not None:
        gradients[2:, 2] = -changes.gradients
        depth = interfaces.level - rays.origins[:, 2]
        d_index[:, 2:] += changes.indices[:, -1] + depth[:, None] * changes.gradients
    momenta = d_index[..., None] * heading[:, None, :] + rays.index[:, None, None] * march.bends
    drift = rays.drift(tau, march.steps, d_index, momenta, gradients)
    with np.errstate(invalid="ignore"):
        return along / np.linalg.norm(along, axis=-1, keepdims=True), drift


def miss_of(
    end: FloatArray, march: March, interfaces: SurfaceSequence
) -> tuple[FloatArray, FloatArray]:
    """Return the vector from the ray to the point, at right angles, and its length; NaN if lost."""
    miss: FloatArray
    if interfaces.is_graded:
        rays = graded_rays(march, interfaces)
        place, along = rays.at(rays.nearest(end))
        toward = end - place
        with np.errstate(invalid="ignore"):
            share = (toward * along).sum(-1) / (along * along).sum(-1)
        miss = toward - share[:, None] * along
    else:
        toward = end - march.vertices[:, -1]
        heading = march.directions[:, -1]
        miss = toward - (toward * heading).sum(-1)[:, None] * heading
    return miss, np.sqrt((miss * miss).sum(-1))
