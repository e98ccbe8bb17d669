"""Ray tracing through any sequence of surfaces (Kotowski 1988), forward and inverse.

Forward: a ray leaves the camera, is refracted at one surface after the other by Snell's law in
vector form, and its derivative with respect to the start direction travels along with it.
Inverse: the ray that reaches a given object point, by Newton's method on the start direction.
This is the second road beside the radial shift: no formula is shared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.height_field import HeightField
from multimedia.media.least_time import least_time_path
from multimedia.media.ray_march import March, PathChanges, drift_at, march_rays, miss_of
from multimedia.media.ray_paths import RayPaths, RayStatus
from multimedia.media.surface_sequence import SurfaceSequence
from multimedia.media.surfaces import Plane
from photocore.arrays import BoolArray, FloatArray, as_points

#: Rays per block: keeps the working set of a block in the cache and memory constant.
BLOCK = 32_768
#: Newton needs 3 to 6 steps on flat water; waves and grazing rays up to 20.
MOST_STEPS = 60
#: Halvings of a Newton step that loses the ray or makes the miss worse.
MOST_HALVINGS = 8
#: A step that leaves more than this share of the miss is a stall: other starts are tried.
STALLED = 0.97
#: Other starts lie on rings around the best direction, so many misses wide (at the point).
RINGS = (1.5, 6.0, 25.0)
RING_STARTS = 6
#: A path is accepted when it misses the point by less than this share of the scene size.
TOLERANCE = 1e-13
#: Stages in which the indices are brought in when the straight start does not reach the point.
STAGES = (8, 64)


_Reached = tuple[March, BoolArray]


def trace_rays(origins: ArrayLike, directions: ArrayLike, interfaces: SurfaceSequence) -> RayPaths:
    """Trace rays from the camera through every interface.

    Parameters
    ----------
    origins : array_like, shape (..., 3)
        Starts, usually the projection centre. [m, or any unit of the interfaces]
    directions : array_like, shape (..., 3)
        Directions in the first medium, of any length; broadcast against the origins.
    interfaces : SurfaceSequence
        Surfaces and indices, all in the frame of the origins (see `Interfaces.seen_from`).

    Returns
    -------
    RayPaths
        Vertices, directions and a status per ray; NaN for rays that are totally reflected or miss
        a surface.

    Notes
    -----
    Snell's law in vector form, see `multimedia.media.ray_march`. In a last medium whose index
    changes with depth the direction is that where the ray enters it.

    References
    ----------
    .. [1] Kotowski, "Phototriangulation in multi-media photogrammetry", IAPRS XXVII, 1988.

    Examples
    --------
    A ray that meets water at 45 degrees goes on at asin(sin 45 / 1.3333) = 32.03 degrees:

    >>> from multimedia import Interfaces
    >>> water = Interfaces.flat_water(0.0, refractive_index=4 / 3)
    >>> path = trace_rays([0.0, 0.0, 1.0], [1.0, 0.0, -1.0], water)
    >>> path.vertices.round(9).tolist(), np.degrees(np.arcsin(path.directions[1, 0])).round(2)
    ([[1.0, 0.0, 0.0]], np.float64(32.03))
    """
    return _blockwise(
        lambda start, heading: (
            march_rays(start, _unit(heading), interfaces, derivatives=False).paths
        ),
        as_points(origins, "origins", dimension=3),
        as_points(directions, "directions", dimension=3),
    )


def aim_rays(
    centres: ArrayLike, points: ArrayLike, interfaces: SurfaceSequence, *, jacobian: bool = False,
    headings: FloatArray | None = None,
) -> RayPaths:  # fmt: skip
    """Find the ray from each projection centre that reaches each object point.

    Parameters
    ----------
    centres : array_like, shape (..., 3)
        Projection centres; broadcast against the points. [m, or any unit of the interfaces]
    points : array_like, shape (..., 3)
        Object points behind the last interface.
    interfaces : SurfaceSequence
        Surfaces and indices, all in the frame of the points (see `Interfaces.seen_from`).
    jacobian : bool
        Also return how the direction at the camera changes with the point.
    headings : ndarray, shape (..., 3), optional
        Unit directions at the centres of rays to points nearby, tried first; NaN where unknown.

    Returns
    -------
    RayPaths
        The paths; a point on the wrong side of an interface, or one no ray reaches, gets NaN and a
        status. Where a wavy surface offers several rays, the one found is the nearest to the
        straight line.

    Notes
    -----
    Newton's method on the two angles of the start direction, with the exact derivative of the
    traced ray; it shoots from the optically thinner end, where flat interfaces cannot reflect
    totally, and starts along the straight line. If that fails, the path of least time is sought
    (planes), or the refraction is brought in by stages (other surfaces).
    The miss at the point is below 1e-13 of the scene size (1e-10 mm in a scene of one metre).

    Examples
    --------
    A point 1.5 m deep, seen from 1 m above the water: the ray of `trace_rays` goes through it.

    >>> from multimedia import Interfaces
    >>> water = Interfaces.flat_water(0.0, refractive_index=4 / 3)
    >>> point = [1 + 1.5 * np.tan(np.arcsin(np.sin(np.pi / 4) * 0.75)), 0, -1.5]
    >>> aim_rays([0, 0, 1], point, water).vertices.round(12).tolist()
    [[1.0, 0.0, 0.0]]
    """

    def aim(centre: FloatArray, target: FloatArray, known: FloatArray) -> RayPaths:
        paths = _aim_block(centre, target, interfaces, known)
        if not jacobian:
            return paths
        derivative, _ = pointing_changes(centre, target, paths.directions[:, 0], interfaces)
        return replace(paths, jacobian=derivative)

    known = np.full(3, np.nan) if headings is None else headings
    return _blockwise(
        aim, as_points(centres, "centres", dimension=3), as_points(points, "points", dimension=3),
        known,
    )  # fmt: skip


def _blockwise(work: Callable[..., RayPaths], *vectors: FloatArray) -> RayPaths:
    """Return what ``work`` makes of vectors per ray, block by block, in their common shape."""
    whole = np.broadcast_arrays(*vectors)
    shape = whole[0].shape[:-1]
    flat = [each.reshape(-1, 3) for each in whole]
    parts = [
        work(*(each[start : start + BLOCK] for each in flat))
        for start in range(0, max(len(flat[0]), 1), BLOCK)
    ]

    def joined(arrays: list[Any]) -> Any:
        return np.concatenate(arrays).reshape((*shape, *arrays[0].shape[1:]))

    jacobians = [part.jacobian for part in parts]
    return RayPaths(
        vertices=joined([part.vertices for part in parts]),
        directions=joined([part.directions for part in parts]),
        status=joined([part.status for part in parts]),
        jacobian=None if jacobians[0] is None else joined(jacobians),
    )


def _aim_block(
    centre: FloatArray, target: FloatArray, interfaces: SurfaceSequence, known: FloatArray
) -> RayPaths:
    """Return the rays from centre to target; known headings are tried first."""
    count = len(interfaces.surfaces)
    vertices = np.full((len(target), count, 3), np.nan)
    directions = np.full((len(target), count + 1, 3), np.nan)
    finite = np.asarray(np.isfinite(centre + target).all(-1))
    status = np.where(finite, RayStatus.NOT_CONVERGED, RayStatus.MISSED).astype(np.int64)
    status[finite & ~interfaces.separates(centre, target)] = RayStatus.WRONG_SIDE
    # Shoot from the thinner medium: through flat interfaces no such ray is totally reflected.
    backwards = interfaces.indices[0] > interfaces.indices[-1] and not interfaces.is_graded
    path = interfaces.reversed() if backwards else interfaces
    start, end = (target, centre) if backwards else (centre, target)
    rows = np.flatnonzero(status == RayStatus.NOT_CONVERGED)
    if not backwards:
        near = rows[np.isfinite(known[rows, 0])]
        _, march, _, reached = _newton(start[near], end[near], known[near], path)
        done = near[reached]
        vertices[done], directions[done] = march.vertices[reached], march.directions[reached]
        status[done] = RayStatus.OK
        rows = np.flatnonzero(status == RayStatus.NOT_CONVERGED)
    for attempt in _attempts(path):
        if not rows.size:
            break
        march, reached = attempt(start[rows], end[rows])
        done = rows[reached]
        vertices[done], directions[done] = march.vertices[reached], march.directions[reached]
        status[done] = RayStatus.OK
        # Keep the reason why the last attempt lost the ray, if it did.
        rows, lost = rows[~reached], march.status[~reached]
        status[rows] = np.where(lost == RayStatus.OK, RayStatus.NOT_CONVERGED, lost)
    if backwards:
        vertices, directions = vertices[:, ::-1], -directions[:, ::-1]
    return RayPaths(vertices=vertices, directions=directions, status=status)


def _attempts(path: SurfaceSequence) -> Iterator[Callable[[FloatArray, FloatArray], _Reached]]:
    """Yield ways to find a ray, the cheap one first; each is tried on what the others left."""
    yield partial(_by_stages, path=path, stages=1)
    flat = all(isinstance(surface, Plane) for surface in path.surfaces) and not path.is_graded
    if flat:
        yield partial(_by_least_time, path=path)
    first, *finer = STAGES
    yield partial(_by_stages, path=path, stages=first)
    if not flat:
        # Waves leave points whose straight start lies across a crest.
        for ring in RINGS:
            yield partial(_from_ring, path=path, ring=ring)
        if all(isinstance(surface, HeightField) for surface in path.surfaces):
            return  # finer stages found no ray more in 3000 pairs of cameras and waves
    for stages in finer:
        yield partial(_by_stages, path=path, stages=stages)


def _by_stages(
    start: FloatArray, end: FloatArray, *, path: SurfaceSequence, stages: int
) -> _Reached:
    """Start along the straight line and bring the refraction in by stages."""
    heading = _unit(end - start)
    for stage in range(1, stages):
        # Geometric mean of "no refraction" and the real indices.
        share = stage / stages
        indices = [path.indices[0] ** (1 - share) * index**share for index in path.indices]
        heading = _newton(start, end, heading, path.with_indices(indices))[0]
    _, march, _, reached = _newton(start, end, heading, path)
    return march, reached


def _by_least_time(start: FloatArray, end: FloatArray, *, path: SurfaceSequence) -> _Reached:
    """Take the path of least time, for planes only."""
    vertices, directions, reached = least_time_path(start, end, path)
    # Shooting along that direction gains the last digits, where it can follow.
    rows = np.flatnonzero(reached)
    _, march, _, followed = _newton(start[rows], end[rows], directions[rows, 0], path)
    done = rows[followed]
    vertices[done], directions[done] = march.vertices[followed], march.directions[followed]
    empty = np.zeros((len(start), 2, 3))
    status = np.where(reached, RayStatus.OK, RayStatus.TOTAL_REFLECTION).astype(np.int64)
    return March(vertices, directions, empty, empty, status), reached


def _from_ring(
    start: FloatArray, end: FloatArray, *, path: SurfaceSequence, ring: float
) -> _Reached:
    """Start beside the best direction that the straight start leads to, on all bearings at once."""
    best, _, size, _ = _newton(start, end, _unit(end - start), path)
    width = ring * size / np.linalg.norm(end - start, axis=-1)
    bearings = 2 * np.pi * np.arange(RING_STARTS) / RING_STARTS
    across = np.stack([np.cos(bearings), np.sin(bearings)], axis=1) @ _across(best)
    tried = _unit(best[:, None] + width[:, None, None] * across).reshape(-1, 3)
    starts, ends = (np.repeat(each, RING_STARTS, axis=0) for each in (start, end))
    _, march, _, reached = _newton(starts, ends, tried, path)
    # Of the bearings that lead there, the first.
    first = reached.reshape(-1, RING_STARTS).argmax(axis=1)
    chosen = np.arange(len(start)) * RING_STARTS + first
    return march.take(chosen), reached[chosen]


def _newton(
    start: FloatArray, end: FloatArray, heading: FloatArray, path: SurfaceSequence
) -> tuple[FloatArray, March, FloatArray, BoolArray]:
    """Turn start directions until the traced rays pass through the end points."""
    scale = np.linalg.norm(end - start, axis=-1) + np.abs(end).max(-1) + np.abs(start).max(-1)
    scale = scale + 1e-300
    heading = heading.copy()
    frame = _across(heading)
    march = march_rays(start, heading, path, frame=frame)
    miss, size = miss_of(end, march, path)
    rows = np.flatnonzero(np.isfinite(size))
    for _ in range(MOST_STEPS):
        if not rows.size:
            break
        across, change = _sensitivity(end[rows], march.take(rows), path)
        turn = _solve_2x2(change, (across @ miss[rows, :, None])[..., 0])
        old = size[rows].copy()
        pending, share = rows, np.ones(len(rows))
        for _ in range(MOST_HALVINGS):
            place = np.searchsorted(rows, pending)
            tried = _unit(
                heading[pending]
                + share[place, None] * (turn[place, :, None] * frame[pending]).sum(-2)
            )
            tried_frame = _across(tried)
            new = march_rays(start[pending], tried, path, frame=tried_frame)
            new_miss, new_size = miss_of(end[pending], new, path)
            with np.errstate(invalid="ignore"):
                better = new_size < old[place]
            good = pending[better]
            heading[good], frame[good] = tried[better], tried_frame[better]
            miss[good], size[good] = new_miss[better], new_size[better]
            for whole, piece in zip(march, new, strict=True):
                whole[good] = piece[better]
            pending = pending[~better]
            # At the rounding level no step makes it better: that ray is done.
            pending = pending[size[pending] > 0.1 * TOLERANCE * scale[pending]]
            if not pending.size:
                break
            share[np.searchsorted(rows, pending)] *= 0.5
        # Polish below the tolerance while it pays; above it give up when progress stalls.
        enough = np.where(size[rows] <= TOLERANCE * scale[rows], 0.5, STALLED)
        rows = rows[size[rows] < enough * old]
    last = march.vertices[:, -1] if march.vertices.shape[1] else start
    with np.errstate(invalid="ignore"):
        ahead = ((end - last) * march.directions[:, -1]).sum(-1) >= -1e-9 * scale
        reached = (size <= TOLERANCE * scale) & ahead
    return heading, march, size, reached


def _sensitivity(
    end: FloatArray, march: March, path: SurfaceSequence, changes: PathChanges | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return a frame across the ray at the end point and, in it, how the ray moves there.

    ``change[n, i, j]`` is the movement along frame vector i per unit of parameter j: the two start
    angles, then the changes.
    """
    heading, drift = drift_at(end, march, path, changes)
    frame = _across(heading)
    return frame, np.einsum("nik,njk->nij", frame, drift)


def pointing_changes(
    centre: FloatArray, target: FloatArray, heading: FloatArray, interfaces: SurfaceSequence,
    changes: PathChanges | None = None,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Return how the unit direction at the camera changes while its ray leads to the target.

    Parameters
    ----------
    centre, target, heading : ndarray, shape (n, 3)
        Starts, ends, and the directions of `aim_rays` between them.
    interfaces : SurfaceSequence
    changes : PathChanges, optional
        Parameters of the start, the surfaces and the media, all in the frame of the rays.

    Returns
    -------
    by_target : ndarray, shape (n, 3, 3)
    by_changes : ndarray, shape (n, 3, k)

    Notes
    -----
    The miss at the target, a function of the two start angles and everything else, stays zero.
    """
    frame = _across(heading)
    march = march_rays(centre, heading, interfaces, frame=frame, changes=changes)
    end_frame, change = _sensitivity(target, march, interfaces, changes)
    right = np.concatenate([end_frame, -change[:, :, 2:]], axis=-1)
    columns = [_solve_2x2(change, right[:, :, k]) for k in range(right.shape[-1])]
    moved = np.einsum("nji,njk->nik", frame, np.stack(columns, axis=-1))
    return moved[..., :3], moved[..., 3:]


def _solve_2x2(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solve stacked 2 x 2 systems; NaN where singular (a caustic)."""
    a, b, c, d = matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 0], matrix[:, 1, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / (a * d - b * c)
        first = (d * right[:, 0] - b * right[:, 1]) * scale
        second = (a * right[:, 1] - c * right[:, 0]) * scale
    return np.stack([first, second], axis=-1)


def _across(headings: FloatArray) -> FloatArray:
    """Return two unit vectors at right angles to each unit vector, shape (n, 2, 3).

    Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017: no branch, no pole.
    """
    x, y, z = headings.T
    sign = np.copysign(1.0, z)
    a = -1 / (sign + z)
    b = x * y * a
    first = np.stack([1 + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return np.stack([first, second], axis=-2)


def _unit(vectors: FloatArray) -> FloatArray:
    """Return unit vectors; NaN for a vector without length."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
