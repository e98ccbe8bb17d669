"""Control held against itself: its own variance, and whether it was measured in two groups.

Thousands of common points drown a dozen control points: what these miss by shows in their own
residuals only, never in the sigma of unit weight.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from bifocal.orientation.orientation_stages import OrientedPair
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import ConvergenceError, GeometryError


@dataclass(frozen=True, slots=True)
class GroupTest:
    """When control is weighed less than stated, and when two groups of it are named."""

    fewest: int = 6  #: Fewer points tell no variance.
    believed: float = 1.5  #: Misfits up to so many times their sigma are chance: 12 degrees of it.
    told: float = 2.0  #: A sentence from here on.
    searched: float = 3.0  #: Groups are looked for where a point misses by so many times its sigma.
    apart: float = 5.0  #: Groups are apart by so many times the sigma of the offset.
    explains: float = 2.0  #: And leave a misfit so many times smaller.
    carried: float = 0.05  #: Where distances are known no better, control carries the lenses too.


GROUPS = GroupTest()


def weighed_by_control(pair: OrientedPair) -> OrientedPair:
    """Return the pair with control as precise as its own residuals show, said where that is less.

    The root mean square of the points' tests, each as if it had been left out, is one where
    control is as precise as stated; beyond, its standard deviations and the picks' grow by it.
    """
    observations, used = pair.observations, pair.observations.pick_used
    tests = pair.adjusted.control_test[used & observations.control.positioned]
    cameras = enumerate(pair.adjusted.cameras, start=1)
    calibrated = all(
        pair.adjusted.sigma("Z", number) < GROUPS.carried * float(camera.centre[2])
        for number, camera in cameras
    )
    if len(tests) < GROUPS.fewest or not calibrated:
        return pair
    times = float(np.sqrt(np.mean(tests**2)))
    many = int((~used).sum()) > max(2, len(used) // 4)
    words, apart = _groups(pair) if tests.max() >= GROUPS.searched or many else ("", 0.0)
    if times >= GROUPS.believed or words:
        times, control = max(times, 1.0), observations.control
        control = replace(control, sigma=np.maximum(control.sigma * times, apart / 2))
        sigma = observations.sigma_pick * times
        pair = pair.readjusted(control=control, sigma_pick=sigma)
    if times >= GROUPS.told or words:
        pair = pair.told(words or remark("orientation.control_worse", times=times))
    return pair


def _groups(pair: OrientedPair) -> tuple[str, float]:
    """Return where control falls into two groups that fit by themselves, and how far apart [m].

    Nowhere: nothing and zero.
    """
    control = pair.observations.control
    picked = np.isfinite(np.hstack([control.pixels1, control.pixels2])).all(axis=1)
    points = np.flatnonzero(control.positioned & picked)
    best, words, apart = np.inf, "", 0.0
    for axis, at, first in _splits(control.xyz[:, :2], points):
        second = np.isin(np.arange(len(first)), points) & ~first
        try:
            alone = pair.readjusted(pick_used=first).adjusted
        except (GeometryError, ConvergenceError):
            continue
        picks = control.pixels1, control.pixels2
        away = (alone.media.meeting(alone.cameras, *picks) - control.xyz)[:, :2]
        offset = np.median(away[first], axis=0) - np.median(away[second], axis=0)
        rest = np.concatenate([away[k] - np.median(away[k], axis=0) for k in (first, second)])
        spread = float(1.4826 * np.median(np.abs(rest)))
        size, count = float(np.linalg.norm(offset)), min(first.sum(), second.sum())
        whole = float(np.std(np.concatenate([rest[: first.sum()], rest[first.sum() :] + offset])))
        if size < GROUPS.apart * max(spread, 1e-4) * np.sqrt(2 / count):
            continue
        if whole > GROUPS.explains * spread and spread < best:
            best, apart = spread, size
            about = {
                "axis": "XY"[axis],
                "at": at,
                "right": 1000 * offset[0],
                "up": 1000 * offset[1],
            }
            words = remark("orientation.control_groups", **about)
    return words, apart


def _splits(xy: FloatArray, points: np.ndarray) -> Iterator[tuple[int, float, BoolArray]]:
    """Yield axis, place and the points below it, at the two widest gaps along X and along Y."""
    for axis in (0, 1):
        order = points[np.argsort(xy[points, axis])]
        gaps = np.diff(xy[order, axis])
        gaps[: min(3, len(gaps))] = gaps[max(len(gaps) - 3, 0) :] = 0.0  # four on either side
        for k in np.argsort(-gaps)[:2]:
            if gaps[k] > 0:
                low = np.zeros(len(xy), dtype=bool)
                low[order[: k + 1]] = True
                yield axis, float(xy[order[k : k + 2], axis].mean()), low
