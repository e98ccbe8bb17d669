"""Velocities along tracks with their precision, and vectors that differ from their neighbours."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from multimedia.tracking.neighbours import distances
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.machine import cores

#: Points of a track to which a parabola is fitted.
WINDOW = 5
#: Sigmas beyond which the cubics of all tracks differ from their parabolas by more than noise.
_CERTAIN = 2.0
#: Share of a variance below which a difference is rounding.
_SAME = 1e-9
#: Points of all tracks on the average that count beside those of one.
_SHARED = 2 * WINDOW
#: Neighbours among which a vector has a companion, and particles in all that tell anything; ratio
#: to their distances beyond which it is odd. Tried on vortices, shear and streams of 10 to 50 %.
_COMPANIONS, _FEWEST, _ODD = 16, 8, 4.0


def track_velocities(
    xyz: FloatArray, covariance: FloatArray, times: FloatArray, track: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return velocities and their covariances; NaN where a track has one point only.

    Parameters
    ----------
    xyz, covariance : ndarray, shape (n, 3), (n, 3, 3)
        Points of all tracks, those of one after each other in time.
    times : ndarray, shape (n,)
    track : ndarray of int, shape (n,)
        Number of the track of each.

    Returns
    -------
    velocity : ndarray, shape (n, 3)
        [object unit per unit of time]
    covariance : ndarray, shape (n, 3, 3)
        From those of the points.

    Notes
    -----
    The slope of the least-squares parabola through the five nearest points of the track (Savitzky
    and Golay 1964, here for unequal times, too). A parabola leaves out how the acceleration
    changes: what the slope of a cubic differs by, beyond the noise of that difference over a
    track, is added to the variance if it cannot be chance in all tracks, most of it at the ends
    of the track. A cubic is held against a quartic in the same way, and counts where that makes
    the smaller variance. A polynomial has two points more than its degree, or is a line.
    """
    with ThreadPoolExecutor(cores()) as pool:
        slopes = list(pool.map(
            lambda degree: _slopes(xyz, covariance, times, track, degree), (2, 3, 4)
        ))  # fmt: skip
    worth = [_with_left_out(*pair, track) for pair in pairwise(slopes)]
    velocity, own = slopes[0][0], worth[0]
    means = [np.bincount(track, np.nan_to_num(np.trace(c, axis1=1, axis2=2))) for c in worth]
    cubic = (means[0] > means[1])[track]
    return (
        np.where(cubic[:, None], slopes[1][0], velocity),
        np.where(cubic[:, None, None], worth[1], own),
    )


def _with_left_out(
    fitted: tuple[FloatArray, FloatArray], richer: tuple[FloatArray, FloatArray], track: IntArray
) -> FloatArray:
    """Return covariances of slopes with what polynomials of one degree more differ by.

    The difference is the coefficient of the highest power times a number of the window, large at
    the ends of a track, and so is the root of its noise: what is more than noise over the track
    is shared out as the noise is.
    """
    # Of points of unequal precision the richer may even be the surer.
    noise = np.maximum(np.nan_to_num(np.diagonal(richer[1] - fitted[1], axis1=1, axis2=2)), 0.0)
    # Of a short track both are one polynomial: what these differ by is rounding.
    known = noise > _SAME * np.nan_to_num(np.diagonal(fitted[1], axis1=1, axis2=2))
    excess = np.divide((richer[0] - fitted[0]) ** 2, noise, out=np.ones_like(noise), where=known)
    excess -= 1.0
    count = np.maximum(known.sum(axis=0), 1)
    mean = excess.sum(axis=0) / count
    sums = [np.stack([np.bincount(track, axis) for axis in of.T], axis=1) for of in (excess, known)]
    # A track has few windows: what all have on the average counts as two more.
    ratio = np.maximum((sums[0] + _SHARED * mean) / (sums[1] + _SHARED), 0.0)
    # Windows overlap: one in five is independent of the others.
    certain = mean > _CERTAIN * np.sqrt(2.0 * WINDOW / count)
    left_out = np.where(certain, ratio[track] * noise, 0.0)
    return fitted[1] + left_out[:, :, None] * np.eye(3)


def _slopes(
    xyz: FloatArray, covariance: FloatArray, times: FloatArray, track: IntArray, degree: int
) -> tuple[FloatArray, FloatArray]:
    """Return slopes of polynomials and their covariances."""
    count = len(xyz)
    _, first, sizes = np.unique(track, return_index=True, return_counts=True)
    length, begin = np.repeat(sizes, sizes), np.repeat(first, sizes)
    start = np.clip(np.arange(count) - WINDOW // 2, begin, begin + np.maximum(length - WINDOW, 0))
    rows = start[:, None] + np.arange(WINDOW)
    inside = rows < (begin + length)[:, None]
    rows = np.minimum(rows, count - 1)
    away = np.where(inside, times[rows] - times[:, None], 0.0)
    # In units of the window, for the digits of its powers.
    scale = np.maximum(np.abs(away).max(axis=1, initial=0.0), 1e-300)
    design = inside[..., None] * (away / scale[:, None])[..., None] ** np.arange(degree + 1)
    for power in range(2, degree + 1):
        design[length < power + 2, :, power] = 0.0
    across = np.swapaxes(design, 1, 2)
    normal = across @ design
    powers = np.arange(degree + 1)
    normal[:, powers, powers] += normal[:, powers, powers] == 0.0  # of no effect, but regular
    weights = np.linalg.solve(normal, across)[:, 1] / scale[:, None]
    weights[length < 2] = np.nan
    velocity = np.einsum("nk,nki->ni", weights, xyz[rows])
    own = np.zeros_like(covariance)
    for weight, row in zip(weights.T, rows.T, strict=True):
        own += (weight**2)[:, None, None] * covariance[row]
    return velocity, own


def differs_from_neighbours(
    xyz: FloatArray, velocity: FloatArray, covariance: FloatArray
) -> BoolArray:
    """Return which vectors of one moment differ from those around beyond what these do.

    Parameters
    ----------
    xyz, velocity : ndarray, shape (n, 3)
    covariance : ndarray, shape (n, 3, 3)
        Of the velocities.

    Notes
    -----
    A vector differs that goes with none of the sixteen nearest: the least of its differences from
    theirs is beyond four times the median of the least among themselves, its floor the vectors'
    precision. The normalised median test (Westerweel and Scarano 2005) asks the same of a median,
    which is nobody's where streams cross.
    """
    odd: BoolArray = np.zeros(len(xyz), dtype=bool)
    good = np.flatnonzero(np.isfinite(velocity).all(axis=1))
    if len(good) <= _FEWEST:
        return odd
    count = min(_COMPANIONS, len(good) - 1)
    near = good[cKDTree(xyz[good]).query(xyz[good], k=count + 1)[1][:, 1:]]
    around = velocity[near]
    among = distances(around, around)
    among[:, np.arange(count), np.arange(count)] = np.inf
    usual = np.median(among.min(axis=2), axis=1)
    noise = np.sqrt(np.trace(covariance[good], axis1=1, axis2=2))
    least = np.linalg.norm(around - velocity[good][:, None], axis=2).min(axis=1)
    odd[good] = least > _ODD * (usual + noise)
    return odd
