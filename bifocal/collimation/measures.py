"""Distances, heights and angles between picked points, with their standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: X, Y, r of a point and their covariance.
Place = tuple[FloatArray, FloatArray]


def measure(places: Sequence[Place]) -> dict[str, float | None]:
    """Return what is measured between points in their order.

    Parameters
    ----------
    places : sequence of (ndarray of shape (3,), ndarray of shape (3, 3))
        X, Y, r [m] and their covariance [m²]; points count as independent of each other, since
        each has its own picks. What the orientation leaves open is common to all, and not in it.

    Returns
    -------
    dict
        ``distance``, ``horizontal``, ``vertical`` and ``depth`` from the first to the last point
        with ``sigma_...`` [m]: slope distance, its part level (along X and r), the rise Y, and the
        step in relief; ``inclination`` [deg] of the line above the level. ``length`` along all
        points [m]. With three points or more ``angle`` at the second one. [deg]

    Raises
    ------
    InputError
        If there are fewer than two points.
    """
    if len(places) < 2:
        raise InputError(remark("page.measure_of_two"))
    xyz = np.array([place[0] for place in places])
    covariances = [place[1] for place in places]
    whole = np.zeros((3 * len(places), 3 * len(places)))
    for row, covariance in enumerate(covariances):
        whole[3 * row : 3 * row + 3, 3 * row : 3 * row + 3] = covariance
    ends = np.array([xyz[0], xyz[-1]])
    pair = np.zeros((6, 6))
    pair[:3, :3], pair[3:, 3:] = covariances[0], covariances[-1]
    out: dict[str, float | None] = {}
    for name, function in (
        ("distance", _distance), ("horizontal", _horizontal), ("vertical", _vertical),
        ("depth", _depth), ("inclination", _inclination),
    ):  # fmt: skip
        out[name], out[f"sigma_{name}"] = _with_sigma(function, ends, pair)
    out["sigma"] = out["sigma_distance"]
    out["length"], out["sigma_length"] = _with_sigma(_length, xyz, whole)
    out["angle"], out["sigma_angle"] = (None, None)
    if len(places) > 2:
        out["angle"], out["sigma_angle"] = _with_sigma(_angle, xyz[:3], whole[:9, :9])
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
