"""Rays through planes by Fermat's principle: the path of least time.

Through planes of any tilt the travel time is a convex function of where the ray crosses them, so
its minimum always exists and damped Newton always finds it, also where shooting loses the ray:
beside the critical angle, through thin gaps of a thinner medium, on an interface itself.
"""

from __future__ import annotations

import numpy as np

from multimedia.media.surface_sequence import SurfaceSequence
from multimedia.media.surfaces import Plane, tangents_of
from photocore.arrays import BoolArray, FloatArray

#: A thin gap beside the critical angle gains a factor of 1.5 per step: 60 steps for 1e10.
MOST_STEPS = 120
MOST_HALVINGS = 40
#: Snell's law is met when the refracted components differ by less than this (of an index).
TOLERANCE = 1e-13
#: Legs shorter than this share of the scene have no direction of their own (touching surfaces).
SHORTEST = 1e-15
#: Cosine to the normal below which a leg runs along its surface.
GRAZING = 1e-9


def least_time_path(
    starts: FloatArray, ends: FloatArray, interfaces: SurfaceSequence
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return crossings (n, k, 3), directions (n, k + 1, 3), and which paths obey Snell's law.

    All surfaces must be planes that separate start and end.
    """
    every = [surface for surface in interfaces.surfaces if isinstance(surface, Plane)]
    kept = _apart(every, starts, ends)
    planes = [every[number] for number in kept]
    media = [0, *(number + 1 for number in kept)]
    crossings, directions, good = _least_time(
        starts, ends, planes, np.array(interfaces.indices)[media]
    )
    if len(kept) == len(every):
        return crossings, directions, good
    # Media of no thickness: the crossing is that of the next surface, Snell gives the direction.
    at = np.searchsorted(kept, np.arange(len(every)))
    full = np.empty((len(starts), len(every) + 1, 3))
    full[:, media] = directions
    for number in sorted(set(range(len(every) + 1)) - set(media)):
        before = directions[:, at[number - 1]]
        ratio = interfaces.indices[media[at[number - 1]]] / interfaces.indices[number]
        normal = every[number - 1].normal
        along = before @ normal
        across = ratio * (before - along[:, None] * normal)
        with np.errstate(invalid="ignore"):
            up = np.copysign(np.sqrt(1 - (across * across).sum(-1)), along)
        full[:, number] = across + up[:, None] * normal
    return crossings[:, at], full, good


def _apart(planes: list[Plane], starts: FloatArray, ends: FloatArray) -> list[int]:
    """Return the last of each group of planes that coincide: no medium lies between those."""
    size = float(np.abs(starts - ends).max(initial=0.0))
    kept = []
    for number, plane in enumerate(planes):
        following = planes[number + 1] if number + 1 < len(planes) else None
        if (
            following is None
            or abs(plane.normal @ following.normal) < 1 - 1e-15
            or abs(float(plane.side(following.point))) > 1e-15 * size
        ):
            kept.append(number)
    return kept


def _least_time(
    starts: FloatArray, ends: FloatArray, planes: list[Plane], indices: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Do the same for planes that lie apart."""
    count, total = len(planes), len(starts)
    bases = np.stack([tangents_of(plane.normal) for plane in planes])  # (k, 2, 3)
    scale = np.linalg.norm(ends - starts, axis=-1) + 1e-300
    crossings = np.empty((total, count, 3))
    for number, plane in enumerate(planes):
        above, below = plane.side(starts), plane.side(ends)
        share = above / np.where(above == below, 1.0, above - below)
        crossings[:, number] = starts + share[:, None] * (ends - starts)
    rows = np.arange(total)
    for _ in range(MOST_STEPS):
        corners = _corners(starts[rows], crossings[rows], ends[rows])
        gradient, hessian, time = _time(corners, bases, indices, scale[rows])
        step = -_solve(hessian, gradient).reshape(-1, count, 2)
        move = np.einsum("nka,kai->nki", step, bases)
        slope = (gradient.reshape(step.shape) * step).sum((-1, -2))
        share = np.ones(len(rows))
        # Near the minimum rounding of the time hides the gain: a full step is right there.
        waiting = np.abs(slope) >= 1e-12 * time
        for _ in range(MOST_HALVINGS):
            tried = crossings[rows] + share[:, None, None] * move
            later = _lengths(_corners(starts[rows], tried, ends[rows]), scale[rows]) @ indices
            waiting &= later > time + 1e-4 * share * slope
            if not waiting.any():
                break
            share[waiting] *= 0.5
        crossings[rows] += share[:, None, None] * move
        large = np.abs(step).max((-1, -2)) > 1e-16 * scale[rows]
        rows = rows[large & (np.abs(gradient).max(-1) > 0.01 * TOLERANCE)]
        if not rows.size:
            break
    corners = _corners(starts, crossings, ends)
    gradient, _, _ = _time(corners, bases, indices, scale)
    legs = np.diff(corners, axis=1)
    directions = legs / np.maximum(np.linalg.norm(legs, axis=-1, keepdims=True), 1e-300)
    # A component of a short leg is only known to the rounding of its ends.
    shortest = np.linalg.norm(legs, axis=-1).min(-1)
    rounding = 8 * np.finfo(float).eps * np.abs(corners).max((-1, -2))
    allowed = TOLERANCE + rounding / np.maximum(shortest, 1e-300)
    good = np.abs(gradient).max(-1) <= np.minimum(allowed, 1e-9) * indices.max()
    # An end on an interface: a leg along it is the limit of total reflection, no ray.
    for leg, plane, points in ((0, planes[0], starts), (-1, planes[-1], ends)):
        touches = np.abs(plane.side(points)) <= 100 * SHORTEST * scale
        runs = np.linalg.norm(legs[:, leg], axis=-1) > 100 * SHORTEST * scale
        along = np.abs(directions[:, leg] @ plane.normal) < GRAZING
        good &= ~(touches & runs & along)
    return crossings, directions, np.asarray(good)


def _solve(hessian: FloatArray, gradient: FloatArray) -> FloatArray:
    """Solve stacked systems whose rows differ by many orders: scaled to a unit diagonal first."""
    square = np.diagonal(hessian, axis1=-2, axis2=-1)
    # A leg seen exactly end on has no stiffness left after rounding.
    diagonal = np.sqrt(np.where(square > 0, square, square.max(-1, keepdims=True)))
    scaled = hessian / (diagonal[:, :, None] * diagonal[:, None, :])
    scaled += 1e-15 * np.eye(diagonal.shape[-1])
    solution = np.linalg.solve(scaled, (gradient / diagonal)[..., None])[..., 0]
    result: FloatArray = solution / diagonal
    return result


def _corners(starts: FloatArray, crossings: FloatArray, ends: FloatArray) -> FloatArray:
    """Return start, crossings and end in one array, shape (n, k + 2, 3)."""
    return np.concatenate([starts[:, None], crossings, ends[:, None]], axis=1)


def _lengths(corners: FloatArray, scale: FloatArray) -> FloatArray:
    """Return the lengths of the legs, smoothed where a leg has none, shape (n, k + 1)."""
    legs = np.diff(corners, axis=1)
    length: FloatArray = np.sqrt((legs * legs).sum(-1) + (SHORTEST * scale[:, None]) ** 2)
    return length


def _time(
    corners: FloatArray, bases: FloatArray, indices: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return gradient (n, 2k) and Hessian (n, 2k, 2k) of the travel time, and the time."""
    count = len(bases)
    length = _lengths(corners, scale)
    unit = np.diff(corners, axis=1) / length[..., None]
    pull = indices[:, None] * unit
    gradient = np.einsum("kai,nki->nka", bases, pull[:, :-1] - pull[:, 1:])
    stiff = (np.eye(3) - unit[..., :, None] * unit[..., None, :]) * (indices / length)[
        ..., None, None
    ]
    hessian = np.zeros((len(corners), count, 2, count, 2))
    for k in range(count):
        both = stiff[:, k] + stiff[:, k + 1]
        hessian[:, k, :, k] = bases[k] @ both @ bases[k].T
        if k + 1 < count:
            cross = -bases[k] @ stiff[:, k + 1] @ bases[k + 1].T
            hessian[:, k, :, k + 1] = cross
            hessian[:, k + 1, :, k] = cross.transpose(0, 2, 1)
    flat = hessian.reshape(len(corners), 2 * count, 2 * count)
    return gradient.reshape(len(corners), -1), flat, length @ indices
