"""Which targets of different cameras are of one particle."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from multimedia.media.camera import Camera, Sensor
from multimedia.media.projection import Media, project
from multimedia.orientation.intersection import intersect_rays
from multimedia.orientation.object_rays import image_rays, nearest_points
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError

#: Farthest that a target may lie from where its particle is seen. [px]
TOLERANCE = 2.0
#: Frames of targets that have nothing to do with each other, and how far they are displaced: so
#: many pixels, or so many tolerances. Risk of calling chance particles.
DECOYS, _DISPLACED, RISK = 2, (40.0, 10.0), 0.001
#: Pairs of rays worked on at a time.
_BLOCK = 200_000


def correspondences(
    cameras: Sequence[Camera],
    targets: Sequence[FloatArray],
    media: Sequence[Media],
    *,
    tolerance: float = TOLERANCE,
    fewest: int = 3,
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Return particles and the targets they were seen as.

    Parameters
    ----------
    cameras : sequence of Camera
        Two or more, with their sensors.
    targets : sequence of ndarray, shape (n_k, 2)
        Detected targets of each camera. [px]
    media : sequence
        What each camera looks through.
    tolerance : float
        Farthest that a target may lie from where its particle is seen. [px]
    fewest : int
        Cameras that must have seen a particle. With two many are by chance.

    Returns
    -------
    xyz : ndarray, shape (p, 3)
        [object unit]
    numbers : ndarray of int, shape (p, cameras)
        Rows of the targets, -1 where a camera did not see the particle.
    misfit : ndarray, shape (p,)
        Root mean square distance of its targets from where it is seen. [px]

    Notes
    -----
    Any two targets whose rays meet within the tolerance, on epipolar curves of each other
    therefore, propose a particle; the other cameras look for it where they would see it. Of all
    proposals the ones seen by most cameras are taken, the best fitting first, each target once.
    """
    sensors = [c.described_sensor("its sensor is not described; targets need it.") for c in cameras]
    if len(cameras) < 2 or not 2 <= fewest <= len(cameras):
        raise InputError(f"correspondences: {len(cameras)} cameras, at least {fewest} to agree.")
    image = [s.image_from_pixel(t.reshape(-1, 2)) for s, t in zip(sensors, targets, strict=True)]
    rays = [image_rays(c, i, m) for c, i, m in zip(cameras, image, media, strict=True)]
    found: list[IntArray] = [np.empty((0, len(cameras)), dtype=np.int64)]
    for a, b in combinations(range(len(cameras)), 2):
        step = max(1, _BLOCK // max(1, len(image[b])))
        for first in range(0, len(image[a]), step):
            rows = np.arange(first, min(first + step, len(image[a])))
            one, two = (m.ravel() for m in np.meshgrid(rows, np.arange(len(image[b]))))
            pairs = [(rays[a][k][one], rays[b][k][two]) for k in range(2)]
            with np.errstate(invalid="ignore"):
                points = nearest_points(pairs[0], pairs[1])
            found.append(_seen(cameras, targets, media, sensors, points, tolerance))
            own = (found[-1][:, a] == one) & (found[-1][:, b] == two)
            found[-1] = found[-1][own & ((found[-1] >= 0).sum(axis=1) >= fewest)]
    numbers = np.unique(np.concatenate(found), axis=0)
    # The row behind the last, -1, is that of no target.
    padded = [np.vstack([i, [np.nan, np.nan]]) for i in image]
    grid = np.stack([i[n] for i, n in zip(padded, numbers.T, strict=True)])
    xyz = intersect_rays(cameras, grid, list(media)) if len(numbers) else np.empty((0, 3))
    misfit = _misfits(cameras, media, sensors, xyz, grid)
    good = misfit <= tolerance
    xyz, numbers, misfit = xyz[good], numbers[good], misfit[good]
    kept = _each_once(numbers, np.lexsort((misfit, -(numbers >= 0).sum(axis=1))))
    return xyz[kept], numbers[kept], misfit[kept]


def expected_by_chance(
    cameras: Sequence[Camera],
    targets: Sequence[FloatArray],
    media: Sequence[Media],
    *,
    tolerance: float = TOLERANCE,
    fewest: int = 3,
) -> FloatArray:
    """Return how many "particles" seen by 0, 1, 2 ... cameras come by chance, at most.

    Parameters
    ----------
    cameras, targets, media, tolerance, fewest
        As for `correspondences`.

    Notes
    -----
    Counted, not computed: the targets of each camera are displaced in a direction of its own, by
    far more than the tolerance, so that no two are of one particle while there are as many of
    them in the same clusters. True particles leave fewer targets to chance than there are here.
    """
    away, counts = max(_DISPLACED[0], _DISPLACED[1] * tolerance), np.zeros(len(cameras) + 1)
    for turn in range(DECOYS):
        # Golden angles: no shift or turn of the object moves the images like this, and for two
        # cameras, whose one condition a displacement may keep, the other frame breaks it.
        angles = 2.4 * np.arange(len(cameras)) + turn * np.pi / 2
        shifts = away * np.column_stack([np.cos(angles), np.sin(angles)])
        moved = [t.reshape(-1, 2) + shift for t, shift in zip(targets, shifts, strict=True)]
        _, numbers, _ = correspondences(cameras, moved, media, tolerance=tolerance, fewest=fewest)
        counts += np.bincount((numbers >= 0).sum(axis=1), minlength=len(counts))
    return counts / DECOYS


def is_chance(found: FloatArray, chance: FloatArray) -> bool:
    """Whether no number of cameras agrees on more particles than chance makes them.

    Parameters
    ----------
    found, chance : ndarray, shape (cameras + 1,)
        Particles by the number of cameras that saw them, and those of `expected_by_chance`.
    """
    from scipy.stats import binom

    ours, theirs = (np.cumsum(counts[::-1]) for counts in (found, DECOYS * chance))
    by_chance = binom.sf(ours - 1, ours + theirs, 1 / (1 + DECOYS)) > RISK
    return bool((by_chance | (ours == 0)).all() and theirs[-1] > 0)


def _seen(
    cameras: Sequence[Camera],
    targets: Sequence[FloatArray],
    media: Sequence[Media],
    sensors: Sequence[Sensor],
    points: FloatArray,
    tolerance: float,
) -> IntArray:
    """Return the nearest target of every camera to where it sees each point, -1 where none is."""
    from scipy.spatial import cKDTree

    numbers = np.full((len(points), len(cameras)), -1, dtype=np.int64)
    alive = np.flatnonzero(np.isfinite(points).all(axis=1))
    for k, camera in enumerate(cameras):
        if not len(targets[k]) or not len(alive):
            continue
        places = sensors[k].pixel_from_image(project(camera, points[alive], media[k]))
        good = np.isfinite(places).all(axis=1)
        away, nearest = cKDTree(targets[k]).query(places[good], distance_upper_bound=tolerance)
        hit = np.isfinite(away)
        numbers[alive[good][hit], k] = nearest[hit]
    return numbers


def _misfits(
    cameras: Sequence[Camera],
    media: Sequence[Media],
    sensors: Sequence[Sensor],
    xyz: FloatArray,
    image: FloatArray,
) -> FloatArray:
    """Return the root mean square distance of targets from where their particles are seen. [px]"""
    if not len(xyz):
        return np.empty(0)
    seen = np.stack([project(c, xyz, m) for c, m in zip(cameras, media, strict=True)])
    pitch = np.array([sensor.pitch for sensor in sensors])[:, None]
    squares = (((seen - image) / pitch) ** 2).sum(axis=-1)
    with np.errstate(invalid="ignore"):  # a proposal that no camera sees has no misfit
        return np.sqrt(np.nansum(squares, axis=0) / np.isfinite(squares).sum(axis=0))


def _each_once(numbers: IntArray, order: IntArray) -> IntArray:
    """Return the rows, in this order, whose targets no row before has used."""
    used, kept = set[tuple[int, int]](), []
    for row in order.tolist():
        mine = [(k, n) for k, n in enumerate(numbers[row].tolist()) if n >= 0]
        if used.isdisjoint(mine):
            kept.append(row)
            used.update(mine)
    return np.array(kept, dtype=np.int64)
