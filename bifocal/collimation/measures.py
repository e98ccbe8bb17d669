"""Distances, heights and angles between picked points, with their standard deviations."""

from __future__ import annotations

from typing import Any

import numpy as np

from photocore.arrays import FloatArray


def measure(xyz: FloatArray, covariance: FloatArray) -> dict[str, float | None]:
    """Return what is measured between points in their order.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        X, Y, r of the points. [m]
    covariance : ndarray, shape (3 n, 3 n)
        Of them all together. [m²]

    Returns
    -------
    dict
        ``distance``, ``horizontal``, ``vertical`` and ``depth`` from the first to the last point
        with ``sigma_...`` [m]: slope distance, its part level (along X and r), the rise Y, and the
        step in relief; ``inclination`` [deg] of the line above the level. ``length`` along all
        points [m]. With three points or more ``angle`` at the second one. [deg]
    """
    ends, of_ends = xyz[[0, -1]], np.r_[0:3, -3:0]
    of_both = covariance[np.ix_(of_ends, of_ends)]
    out: dict[str, float | None] = {}
    for name, function in (
        ("distance", _distance), ("horizontal", _horizontal), ("vertical", _vertical),
        ("depth", _depth), ("inclination", _inclination),
    ):  # fmt: skip
        out[name], out[f"sigma_{name}"] = _with_sigma(function, ends, of_both)
    out["sigma"] = out["sigma_distance"]
    out["length"], out["sigma_length"] = _with_sigma(_length, xyz, covariance)
    out["angle"], out["sigma_angle"] = (None, None)
    if len(xyz) > 2:
        out["angle"], out["sigma_angle"] = _with_sigma(_angle, xyz[:3], covariance[:9, :9])
    return out


def _with_sigma(
    function: Any, xyz: FloatArray, covariance: FloatArray
) -> tuple[float | None, float | None]:
    """Return a function of points and its standard deviation by central differences."""
    value = float(function(xyz))
    step = 1e-6 * max(1.0, float(np.ptp(xyz, axis=0).max()))
    gradient = np.zeros(xyz.size)
    for index in range(xyz.size):
        moved = [xyz.copy(), xyz.copy()]
        for sign, points in zip((-1, 1), moved, strict=True):
            points.reshape(-1)[index] += sign * step
        gradient[index] = (function(moved[1]) - function(moved[0])) / (2 * step)
    variance = float(gradient @ covariance @ gradient)
    sigma = float(np.sqrt(variance)) if variance >= 0 else float("nan")
    return (value if np.isfinite(value) else None), (sigma if np.isfinite(sigma) else None)


def _distance(xyz: FloatArray) -> float:
    return float(np.linalg.norm(xyz[1] - xyz[0]))


def _horizontal(xyz: FloatArray) -> float:
    return float(np.hypot(*(xyz[1] - xyz[0])[[0, 2]]))


def _vertical(xyz: FloatArray) -> float:
    return float(xyz[1, 1] - xyz[0, 1])


def _depth(xyz: FloatArray) -> float:
    return float(xyz[1, 2] - xyz[0, 2])


def _inclination(xyz: FloatArray) -> float:
    return float(np.degrees(np.arctan2(_vertical(xyz), _horizontal(xyz))))


def _length(xyz: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(xyz, axis=0), axis=1).sum())


def _angle(xyz: FloatArray) -> float:
    """Return the angle at the second of three points. [deg]"""
    a, b = xyz[0] - xyz[1], xyz[2] - xyz[1]
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))
