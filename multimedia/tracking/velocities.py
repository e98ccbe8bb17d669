"""Velocities along tracks with their precision, and vectors that differ from their neighbours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from photocore.arrays import BoolArray, FloatArray, IntArray

#: Points of a track to which a parabola is fitted.
WINDOW = 5
#: Sigmas beyond which the cubics of all tracks differ from their parabolas by more than noise.
_CERTAIN = 3.0
#: Neighbours with which a vector is compared; ratio to their own spread beyond which it is odd.
_NEIGHBOURS, _ODD = 8, 4.0


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
    changes: what the slope of a cubic differs by, beyond the noise of that difference and on the
    average of a track, is added to the variance if it cannot be chance in all tracks. Where that
    makes it larger than the cubic's, the cubic counts. A polynomial has two points more than its
    degree, or is a line.
    """
    slopes = [_slopes(xyz, covariance, times, track, degree) for degree in (2, 3)]
    (velocity, own), (other, its) = slopes
    sizes = np.bincount(track)
    noise = np.diagonal(its - own, axis1=1, axis2=2)
    excess = np.nan_to_num((other - velocity) ** 2 - noise)
    mean = np.stack([np.bincount(track, axis) for axis in excess.T], axis=1) / sizes[:, None]
    # Windows overlap: one in five is independent of the others.
    chance = np.sqrt(2.0 * WINDOW * np.nansum(noise**2, axis=0))
    left_out = np.where(excess.sum(axis=0) > _CERTAIN * chance, np.maximum(mean, 0.0), 0.0)[track]
    own = own + left_out[:, :, None] * np.eye(3)
    total = [np.trace(c, axis1=1, axis2=2) for c in (own, its)]
    means = [np.bincount(track, np.nan_to_num(t)) for t in total]
    cubic = (means[0] > means[1])[track]
    return (
        np.where(cubic[:, None], other, velocity), np.where(cubic[:, None, None], its, own)
    )  # fmt: skip


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
    weights = (np.linalg.pinv(across @ design, hermitian=True) @ across)[:, 1] / scale[:, None]
    weights[length < 2] = np.nan
    velocity = np.einsum("nk,nki->ni", weights, xyz[rows])
    return velocity, np.einsum("nk,nkij->nij", weights**2, covariance[rows])


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
    The normalised median test (Westerweel and Scarano 2005) among the eight nearest: distance
    from their median over the median of their own distances, its floor the vectors' precision.
    """
    odd: BoolArray = np.zeros(len(xyz), dtype=bool)
    good = np.flatnonzero(np.isfinite(velocity).all(axis=1))
    if len(good) <= _NEIGHBOURS:
        return odd
    near = good[cKDTree(xyz[good]).query(xyz[good], k=_NEIGHBOURS + 1)[1][:, 1:]]
    median = np.median(velocity[near], axis=1)
    spread = np.median(np.linalg.norm(velocity[near] - median[:, None], axis=2), axis=1)
    noise = np.sqrt(np.trace(covariance[good], axis1=1, axis2=2))
    odd[good] = np.linalg.norm(velocity[good] - median, axis=1) > _ODD * (spread + noise)
    return odd
