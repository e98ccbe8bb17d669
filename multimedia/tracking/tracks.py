"""Tracks of particles: positions of many frames in, who is who and how fast out."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.remarks import remark
from multimedia.tracking.chance import fitted, points_by_chance, widened
from multimedia.tracking.linking import LinkRules, in_tracks, linked, usual_step
from multimedia.tracking.velocities import differs_from_neighbours, track_velocities
from photocore.arrays import BoolArray, FloatArray, IntArray, as_points, positive
from photocore.errors import InputError
from photocore.machine import cores

#: Frames for which a particle may be missing, and points of the shortest track.
GAP, SHORTEST = 2, 4
#: Points of chance for each in a track from which on the tracks are chance: .84 and more where two
#: links of three were wrong. Tracks of chance that are too few to tell.
CHANCE, FEW = 0.8, 10
#: Points of chance for each in a track from which on they are told of.
DOUBTFUL = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracks:
    """Particles that were followed, track by track, each in time.

    Attributes
    ----------
    track : ndarray of int, shape (n,)
        Number of the track, from 0, of each point.
    frame, number : ndarray of int, shape (n,)
        Frame of each point, and which of the particles of that frame it is, from 0.
    xyz : ndarray, shape (n, 3)
        [object unit]
    covariance : ndarray, shape (n, 3, 3)
        Of the positions; NaN if none were given.
    velocity : ndarray, shape (n, 3)
        [object unit per second, or per frame]
    velocity_covariance : ndarray, shape (n, 3, 3)
    outlier : ndarray of bool, shape (n,)
        Whether the velocity differs from those of the particles around.
    step, change : float
        Largest displacement of a particle of unknown velocity, and largest distance from where
        one of known is predicted, in the median. [object unit]
    drift : ndarray, shape (3,)
        Displacement from frame to frame about which ``step`` counts; 0 where none was needed.
        [object unit]
    particles : int
        Of all frames, in tracks or not.
    by_chance : int
        Points that are in tracks by the same rules where each frame is displaced by steps of its
        own: as many of these may be chance.
    """

    track: IntArray
    frame: IntArray
    number: IntArray
    xyz: FloatArray
    covariance: FloatArray
    velocity: FloatArray
    velocity_covariance: FloatArray
    outlier: BoolArray
    step: float
    change: float
    drift: FloatArray
    particles: int
    by_chance: int

    @property
    def count(self) -> int:
        """Number of tracks."""
        return int(self.track.max(initial=-1)) + 1

    @property
    def remarks(self) -> tuple[str, ...]:
        """What is doubtful about the tracks as a whole."""
        points = len(self.track)
        if self.by_chance <= DOUBTFUL * points:
            return ()
        return (remark("tracks.partly_chance", chance=self.by_chance, points=points),)

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of X, Y, Z, shape (n, 3). [object unit]"""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))

    @property
    def velocity_sigma(self) -> FloatArray:
        """Standard deviations of the velocities, shape (n, 3)."""
        return np.sqrt(np.diagonal(self.velocity_covariance, axis1=1, axis2=2))


def track_particles(
    places: Sequence[ArrayLike],
    *,
    frames: Sequence[int] | None = None,
    rate: float = 1.0,
    covariances: Sequence[FloatArray] | None = None,
    step: float | None = None,
    change: float | None = None,
    gap: int = GAP,
    shortest: int = SHORTEST,
) -> Tracks:
    """Follow particles through frames.

    Parameters
    ----------
    places : sequence of array_like, shape (n_t, 3)
        Particles of each frame, in any order. [object unit]
    frames : sequence of int, optional
        Numbers of the frames, by default from 0, without a hole.
    rate : float
        Frames per second; with 1 velocities are per frame.
    covariances : sequence of ndarray, shape (n_t, 3, 3), optional
        Of the positions.
    step : float, optional
        Largest displacement from frame to frame of a particle of which nothing is known; by
        default half the mean distance between particles, about the drift that most share where
        without it nothing shows but chance, or more. [object unit]
    change : float, optional
        Largest distance from where its velocity predicts a particle; by default those around
        predict with it, and it is 3.5 times the median of the links around. [object unit]
    gap : int
        Frames for which a particle may be missing.
    shortest : int
        Points that a track must have; of three many are by chance.

    Returns
    -------
    Tracks

    Raises
    ------
    InputError
        If there are fewer than three frames, the options are impossible, or the tracks are
        those of chance.

    Examples
    --------
    Two particles that pass each other:

    >>> frames = [[(t, 0.0, 0.0), (3.0 - t, 1.0, 0.0)] for t in range(4)]
    >>> tracks = track_particles(frames, step=1.5)
    >>> tracks.count, tracks.velocity[0].round(9).tolist()
    (2, [1.0, 0.0, 0.0])
    """
    clouds = [as_points(xyz, "places", dimension=3).reshape(-1, 3) for xyz in places]
    names = np.arange(len(clouds)) if frames is None else np.asarray(frames, dtype=np.int64)
    if len(clouds) < 3 or len(names) != len(clouds) or (np.diff(names) != 1).any():
        raise InputError(remark("tracks.few_frames", count=len(clouds), names=names.tolist()[:5]))
    if not all(np.isfinite(xyz).all() for xyz in clouds):
        raise InputError("places: every coordinate must be a finite number.")
    if gap < 0 or shortest < 3:
        raise InputError(f"gap {gap}, shortest {shortest}: no less than 0, and no less than 3.")
    positive(rate, "rate", unit="frames per second")
    widest = usual_step(clouds) if step is None else positive(step, "step")
    rules = LinkRules(step=widest, change=widest, gap=gap)
    if change is not None:
        rules = LinkRules(step=widest, change=positive(change, "change"), gap=gap)
    else:
        rules = widened(clouds, rules, shortest) if step is None else fitted(clouds, rules)
    names_of = np.repeat(names, [len(xyz) for xyz in clouds])
    number = np.concatenate([np.arange(len(xyz)) for xyz in clouds])
    unknown = np.full((len(number), 3, 3), np.nan)
    covariance = unknown if covariances is None else np.concatenate(list(covariances))
    with ThreadPoolExecutor(cores()) as pool:
        counting = pool.submit(points_by_chance, clouds, rules, shortest)
        previous = linked(clouds, rules)
        order, track = in_tracks(previous, shortest)
        frame, xyz, covariance = names_of[order], np.concatenate(clouds)[order], covariance[order]
        velocity, velocity_covariance = track_velocities(xyz, covariance, frame / rate, track)
        precision, moments = (
            np.nan_to_num(velocity_covariance),
            [np.flatnonzero(frame == n) for n in names],
        )
        differ = pool.map(
            lambda now: differs_from_neighbours(xyz[now], velocity[now], precision[now]), moments
        )
        outlier: BoolArray = np.zeros(len(xyz), dtype=bool)
        for now, odd in zip(moments, differ, strict=True):
            outlier[now] = odd
        chance = counting.result()
    if chance > max(CHANCE * len(order), FEW * shortest):
        raise InputError(remark("tracks.chance", points=len(order), chance=chance, step=rules.step))
    return Tracks(
        track=track, frame=frame, number=number[order], xyz=xyz, covariance=covariance,
        velocity=velocity, velocity_covariance=velocity_covariance, outlier=outlier,
        step=rules.step, change=rules.change, drift=np.array(rules.drift),
        particles=len(previous), by_chance=chance,
    )  # fmt: skip
