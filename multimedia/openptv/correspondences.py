"""Which targets of different cameras are of one particle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from multimedia.media.camera import Camera, Sensor
from multimedia.media.projection import Media, project
from multimedia.openptv.ray_meetings import meeting_rays
from multimedia.orientation.intersection import intersect_rays
from multimedia.orientation.object_rays import image_rays, nearest_points
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError

#: Farthest that a target may lie from where its particle is seen. [px]
TOLERANCE = 2.0
#: Frames of targets that have nothing to do with each other, and how far they are displaced: so
#: many pixels, or so many tolerances. Risk of calling chance particles.
DECOYS, _DISPLACED, RISK = 2, (40.0, 10.0), 0.001


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
    frame = _Exposure(cameras, targets, media, sensors, rays, tolerance, fewest)
    few = proposing_pairs(len(cameras), fewest)
    proposals = [np.empty((0, len(cameras)), dtype=np.int64)]
    proposals += [frame.proposals(a, b, np.arange(len(targets[a])), np.arange(len(targets[b])))
              for a, b in few]  # fmt: skip
    # What they leave is sought from all pairs: rays of a poor calibration miss each other.
    matched = np.concatenate(proposals)
    unmatched = [np.setdiff1d(np.arange(len(t)), matched[:, k]) for k, t in enumerate(targets)]
    others = combinations(range(len(cameras)), 2)
    proposals += [
        frame.proposals(a, b, unmatched[a], unmatched[b]) for a, b in others if (a, b) not in few
    ]
    numbers = np.unique(np.concatenate(proposals), axis=0)
    # The row behind the last, -1, is that of no target.
    padded = [np.vstack([i, [np.nan, np.nan]]) for i in image]
    grid = np.stack([i[n] for i, n in zip(padded, numbers.T, strict=True)])
    xyz = intersect_rays(cameras, grid, list(media)) if len(numbers) else np.empty((0, 3))
    misfit = _misfits(cameras, media, sensors, xyz, grid)
    good = misfit <= tolerance
    xyz, numbers, misfit = xyz[good], numbers[good], misfit[good]
    kept = _each_once(numbers, np.lexsort((misfit, -(numbers >= 0).sum(axis=1))))
    return xyz[kept], numbers[kept], misfit[kept]


def proposing_pairs(cameras: int, fewest: int) -> list[tuple[int, int]]:
    """Return pairs of cameras of which so many cameras, whichever they are, hold at least one.

    Of cameras in one group less than that, two stand in one group.

    >>> proposing_pairs(4, 3)
    [(0, 2), (1, 3)]
    """
    groups = fewest - 1
    return [(a, b) for a, b in combinations(range(cameras), 2) if a % groups == b % groups]


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


@dataclass(frozen=True, slots=True, eq=False)
class _Exposure:
    """Targets of all cameras, and their rays in the object."""

    cameras: Sequence[Camera]
    targets: Sequence[FloatArray]
    media: Sequence[Media]
    sensors: Sequence[Sensor]
    rays: Sequence[tuple[FloatArray, FloatArray]]
    tolerance: float
    fewest: int

    def width(self, camera: int, some: IntArray) -> tuple[FloatArray, float]:
        """Return how far rays may miss their particle: where they start, and more per length."""
        # On oblique rays what the tolerance moves at the face counts more than square to it.
        pitch = float(self.sensors[camera].pixel_size.max())
        per_length = 2.0 * self.tolerance * pitch / self.cameras[camera].principal_distance
        away = self.rays[camera][0][some] - self.cameras[camera].centre
        return per_length * np.sqrt(np.einsum("ni,ni->n", away, away)), per_length

    def proposals(self, a: int, b: int, some: IntArray, others: IntArray) -> IntArray:
        """Return the targets of all cameras of what some of camera a and of b propose, (p, m)."""
        (o1, d1), (o2, d2) = self.rays[a], self.rays[b]
        first, second = (o1[some], d1[some]), (o2[others], d2[others])
        one, two = meeting_rays(first, second, self.width(a, some), self.width(b, others))
        one, two = some[one], others[two]
        points = nearest_points([o1[one], o2[two]], [d1[one], d2[two]])
        numbers = np.full((len(points), len(self.cameras)), -1, dtype=np.int64)
        for k in {*range(len(self.cameras))} - {a, b}:
            numbers[:, k] = self.seen(k, points)
        enough = (numbers >= 0).sum(axis=1) >= self.fewest - 2
        one, two, points, numbers = one[enough], two[enough], points[enough], numbers[enough]
        for k, numbered in ((a, one), (b, two)):
            numbers[:, k] = np.where(self.seen(k, points) == numbered, numbered, -1)
        return numbers[(numbers[:, [a, b]] >= 0).all(axis=1)]

    def seen(self, camera: int, points: FloatArray) -> IntArray:
        """Return the nearest target to where a camera sees each point, -1 where none is, (n,)."""
        from scipy.spatial import cKDTree

        numbers = np.full(len(points), -1, dtype=np.int64)
        targets = self.targets[camera]
        if not len(targets) or not len(points):
            return numbers
        image = project(self.cameras[camera], points, self.media[camera])
        places = self.sensors[camera].pixel_from_image(image)
        good = np.flatnonzero(np.isfinite(places).all(axis=1))
        away, nearest = cKDTree(targets).query(places[good], distance_upper_bound=self.tolerance)
        numbers[good] = np.where(np.isfinite(away), nearest, -1)
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
    projected = np.stack([project(c, xyz, m) for c, m in zip(cameras, media, strict=True)])
    pitch = np.array([sensor.pixel_size for sensor in sensors])[:, None]
    squares = (((projected - image) / pitch) ** 2).sum(axis=-1)
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
