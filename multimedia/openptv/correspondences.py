"""Which targets of different cameras are of one particle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from multimedia.media import Camera, Media, OpticalMedia, Sensor, as_media, project
from multimedia.openptv.ray_meetings import meeting_rays
from multimedia.openptv.target_map import TargetMap
from multimedia.orientation import image_rays, nearest_points, refuse_curved_rays
from photocore.arrays import FloatArray, IntArray, each_once
from photocore.errors import InputError

#: Farthest that a target may lie from where its particle is seen. [px]
TOLERANCE = 2.0
#: Shares of it within which particles are sought, one after the other; of what is found within all
#: but the last only what misses by half as much counts, for where two rays meet a third misses by
#: up to twice its error.
STAGES = (0.25, 1.0)
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
    So those that all cameras see, and well, are sought first, within less than the tolerance:
    what they leave is little.
    """
    sensors = [c.described_sensor("its sensor is not described; targets need it.") for c in cameras]
    if len(cameras) < 2 or not 2 <= fewest <= len(cameras):
        raise InputError(f"correspondences: {len(cameras)} cameras, at least {fewest} to agree.")
    placed = [as_media(each) for each in media]
    refuse_curved_rays(placed, "correspondences")
    targets = [t.reshape(-1, 2) for t in targets]
    image = [s.image_from_pixel(t) for s, t in zip(sensors, targets, strict=True)]
    rays = [image_rays(c, i, m) for c, i, m in zip(cameras, image, placed, strict=True)]
    frame = _Exposure(cameras, targets, placed, sensors, image, rays)
    free = [np.arange(len(pixels)) for pixels in targets]
    parts: list[tuple[FloatArray, IntArray, FloatArray]] = [
        (np.empty((0, 3)), np.empty((0, len(cameras)), dtype=np.int64), np.empty(0))
    ]
    for agree, share in product(sorted({len(cameras), fewest}, reverse=True), STAGES):
        is_last = (agree, share) == (fewest, STAGES[-1])
        limit = tolerance * share * (1.0 if share == STAGES[-1] else 0.5)
        parts.append(frame.particles(free, tolerance * share, limit, agree, every=is_last))
        free = [np.setdiff1d(rows, used) for rows, used in zip(free, parts[-1][1].T, strict=True)]
    xyz, numbers, misfit = (np.concatenate(part) for part in zip(*parts, strict=True))
    order = np.lexsort((misfit, -(numbers >= 0).sum(axis=1)))
    return xyz[order], numbers[order], misfit[order]


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
    turns: Sequence[int] = range(DECOYS),
) -> FloatArray:
    """Return how many "particles" seen by 0, 1, 2 ... cameras come by chance, at most.

    Parameters
    ----------
    cameras, targets, media, tolerance, fewest
        As for `correspondences`.
    turns : sequence of int
        Which of the displacements are tried.

    Notes
    -----
    Counted, not computed: the targets of each camera are displaced in a direction of its own, by
    far more than the tolerance, so that no two are of one particle while there are as many of
    them in the same clusters. True particles leave fewer targets to chance than there are here.
    """
    away, counts = max(_DISPLACED[0], _DISPLACED[1] * tolerance), np.zeros(len(cameras) + 1)
    for turn in turns:
        # Golden angles: no shift or turn of the object moves the images like this, and for two
        # cameras, whose one condition a displacement may keep, the other frame breaks it.
        angles = 2.4 * np.arange(len(cameras)) + turn * np.pi / 2
        shifts = away * np.column_stack([np.cos(angles), np.sin(angles)])
        moved = [t.reshape(-1, 2) + shift for t, shift in zip(targets, shifts, strict=True)]
        _, numbers, _ = correspondences(cameras, moved, media, tolerance=tolerance, fewest=fewest)
        counts += np.bincount((numbers >= 0).sum(axis=1), minlength=len(counts))
    return counts / len(turns)


def is_chance(found: FloatArray, chance: FloatArray, decoys: float = DECOYS) -> bool:
    """Whether no number of cameras agrees on more particles than chance makes them.

    Parameters
    ----------
    found, chance : ndarray, shape (cameras + 1,)
        Particles by the number of cameras that saw them, and those of `expected_by_chance`.
    decoys : float
        Displacements of a frame that these are the mean of.
    """
    from scipy.stats import binom

    ours, theirs = (np.cumsum(counts[::-1]) for counts in (found, decoys * chance))
    by_chance = binom.sf(ours - 1, ours + theirs, 1 / (1 + decoys)) > RISK
    return bool((by_chance | (ours == 0)).all() and theirs[-1] > 0)


@dataclass(frozen=True, slots=True, eq=False)
class _Exposure:
    """Targets of all cameras, and their rays in the object."""

    cameras: Sequence[Camera]
    targets: Sequence[FloatArray]
    media: Sequence[OpticalMedia]
    sensors: Sequence[Sensor]
    image: Sequence[FloatArray]
    rays: Sequence[tuple[FloatArray, FloatArray]]

    def particles(
        self, free: Sequence[IntArray], tolerance: float, limit: float, agree: int, *, every: bool
    ) -> tuple[FloatArray, IntArray, FloatArray]:
        """Return particles of targets that are free, their targets and misfits.

        Parameters
        ----------
        free : sequence of ndarray of int
            Rows of the targets of each camera that belong to no particle.
        tolerance, limit : float
            How far targets are sought, and how far they may miss, root mean square. [px]
        agree : int
            Cameras that must have seen a particle.
        every : bool
            Whether what those pairs of cameras leave that suffice is sought from all pairs: rays
            of a poor calibration miss each other.
        """
        count = len(self.cameras)
        maps = [TargetMap(t[f], tolerance) if len(f) else None
                for t, f in zip(self.targets, free, strict=True)]  # fmt: skip
        search = _TargetSearch(self, free, maps, tolerance, agree)
        few = proposing_pairs(count, agree)
        proposals = [np.empty((0, count), dtype=np.int64)]
        proposals += [search.proposals(a, b, free[a], free[b]) for a, b in few]
        if every:
            matched = np.concatenate(proposals)
            rest = [np.setdiff1d(f, m) for f, m in zip(free, matched.T, strict=True)]
            pairs = [pair for pair in combinations(range(count), 2) if pair not in few]
            proposals += [search.proposals(a, b, rest[a], rest[b]) for a, b in pairs]
        numbers = np.unique(np.concatenate(proposals), axis=0)
        xyz, misfit = self.fitted(numbers)
        good = misfit <= limit
        xyz, numbers, misfit = xyz[good], numbers[good], misfit[good]
        order = np.lexsort((misfit, -(numbers >= 0).sum(axis=1)))
        kept = order[each_once(numbers[order])]
        return xyz[kept], numbers[kept], misfit[kept]

    def fitted(self, numbers: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the points nearest to the rays of targets, and the root mean square misfits."""
        xyz = nearest_points(*(
            [_rows(each[part], n) for each, n in zip(self.rays, numbers.T, strict=True)]
            for part in (0, 1)
        ))  # fmt: skip
        squares = np.full((len(self.cameras), len(numbers)), np.nan)
        for k, (camera, sensor) in enumerate(zip(self.cameras, self.sensors, strict=True)):
            away = project(camera, xyz, self.media[k]) - _rows(self.image[k], numbers[:, k])
            squares[k] = ((away / sensor.pixel_size) ** 2).sum(axis=-1)
        with np.errstate(invalid="ignore"):  # a proposal that no camera sees has no misfit
            return xyz, np.sqrt(np.nansum(squares, axis=0) / np.isfinite(squares).sum(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class _TargetSearch:
    """Targets that are free, and how they are sought."""

    frame: _Exposure
    free: Sequence[IntArray]
    maps: Sequence[TargetMap | None]
    tolerance: float
    agree: int

    def width(self, camera: int, some: IntArray) -> tuple[FloatArray, float]:
        """Return how far rays may miss their particle: where they start, and more per length."""
        # On oblique rays what the tolerance moves at the face counts more than square to it.
        pitch = float(self.frame.sensors[camera].pixel_size.max())
        per_length = 2.0 * self.tolerance * pitch / self.frame.cameras[camera].principal_distance
        away = self.frame.rays[camera][0][some] - self.frame.cameras[camera].centre
        return per_length * np.sqrt(np.einsum("ni,ni->n", away, away)), per_length

    def proposals(self, a: int, b: int, some: IntArray, others: IntArray) -> IntArray:
        """Return the targets of all cameras of what some of camera a and of b propose, (p, m)."""
        (o1, d1), (o2, d2) = self.frame.rays[a], self.frame.rays[b]
        meetings = meeting_rays(
            (o1[some], d1[some]), (o2[others], d2[others]),
            self.width(a, some), self.width(b, others),
        )  # fmt: skip
        parts = [np.empty((0, len(self.maps)), dtype=np.int64)]
        parts += [
            self._confirmed(a, b, some[one], others[two], points) for one, two, points in meetings
        ]
        return np.concatenate(parts)

    def _confirmed(
        self, a: int, b: int, one: IntArray, two: IntArray, points: FloatArray
    ) -> IntArray:
        """Return the targets of all cameras of those points that enough of them see."""
        numbers = np.full((len(points), len(self.maps)), -1, dtype=np.int64)
        numbers[:, a], numbers[:, b] = one, two
        unseen = np.zeros(len(points), dtype=np.int64)
        for k in sorted(set(range(len(self.maps))) - {a, b}):
            numbers[:, k] = self.seen(k, points)
            unseen += numbers[:, k] < 0
            enough = unseen <= len(self.maps) - self.agree
            numbers, points, unseen = numbers[enough], points[enough], unseen[enough]
        for k in (a, b):
            same = self.seen(k, points) == numbers[:, k]
            numbers, points = numbers[same], points[same]
        return numbers

    def seen(self, camera: int, points: FloatArray) -> IntArray:
        """Return the nearest target to where a camera sees each point, -1 where none is, (n,)."""
        targets = self.maps[camera]
        if targets is None or not len(points):
            return np.full(len(points), -1, dtype=np.int64)
        image = project(self.frame.cameras[camera], points, self.frame.media[camera])
        nearest = targets.nearest(self.frame.sensors[camera].pixel_from_image(image))
        return np.where(nearest < 0, -1, self.free[camera][nearest])


def _rows(values: FloatArray, numbers: IntArray) -> FloatArray:
    """Return rows by their numbers, NaN for those of -1."""
    return np.vstack([values, np.full((1, values.shape[1]), np.nan)])[numbers]
