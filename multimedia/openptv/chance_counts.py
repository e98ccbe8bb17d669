"""Particles of frames beside those that come by chance, and the tolerance that would do."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from multimedia.openptv.correspondences import (
    DECOYS,
    correspondences,
    expected_by_chance,
    is_chance,
)
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.machine import cores

#: Share of all particles from which on chance is worth a smaller tolerance, and share of those
#: beyond chance that this has to keep.
WORTH_LESS, KEPT = 0.1, 0.98
#: Tolerances that are proposed [px], and the standard deviation of a target that they hold at
#: least so many times: where two rays meet, a third misses by up to twice its own error (scenes:
#: 100 to 1500 particles of four cameras, .05 to .3 px).
_PROPOSED, _SIGMAS = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0), 5.0
#: The same by what is found with the smaller tolerance, which chance blurs less (5000 particles).
_SIGMAS_LEFT = 4.0
#: Targets of a camera, in all frames, from which on one displacement of each frame tells enough:
#: of so many a hundred particles by chance vary by a tenth.
_MANY = 3000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChanceCounts:
    """What is found in some frames with a tolerance.

    Attributes
    ----------
    tolerance : float
        [px]
    found, chance : ndarray, shape (cameras + 1,)
        Particles by the number of cameras that saw them, and how many at most come by chance.
    misfit, rays : ndarray, shape (p,)
        Of all particles: root mean square distance of their targets from where they are seen
        [px], and how many these are.
    decoys : float
        Displacements of a frame by which chance was counted.
    """

    tolerance: float
    found: FloatArray
    chance: FloatArray
    misfit: FloatArray
    rays: FloatArray
    decoys: float

    @property
    def is_chance(self) -> bool:
        """Whether no number of cameras agrees on more particles than chance makes them."""
        return is_chance(self.found, self.chance, self.decoys)

    @property
    def true(self) -> float:
        """Particles beyond chance."""
        return float(self.found.sum() - self.chance.sum())

    @property
    def sigma_px(self) -> float:
        """Standard deviation of a target by what the particles beyond chance miss. [px]"""
        from scipy.stats import chi2

        if not len(self.misfit):
            return 0.0
        squares = self.misfit**2 * self.rays / chi2.ppf(0.5, 2 * self.rays - 3)
        # Those of chance miss by more: the median of the others is a lower quantile of all.
        share = np.clip(self.true / len(self.misfit), 0.05, 1.0)
        return float(np.sqrt(np.quantile(squares, share / 2)))


def chance_counts(
    content: Project, frames: Sequence[Sequence[FloatArray]], tolerance: float, fewest: int
) -> ChanceCounts:
    """Return what is found in frames: targets of each camera [px]."""
    count = len(content.cameras) + 1
    # Of many targets one displacement a frame, each in its turn, tells as much as two of few.
    decoys = (
        1
        if len(frames) >= DECOYS
        and min(sum(map(len, targets)) for targets in zip(*frames, strict=True)) > _MANY
        else DECOYS
    )

    def tried(task: tuple[Sequence[FloatArray], int | None]) -> tuple[FloatArray, ...]:
        """Return misfits and rays of what is in a frame, or how many come by a displacement."""
        targets, turn = task
        scene = (content.cameras, targets, content.interfaces)
        if turn is None:
            _, numbers, misfit = correspondences(*scene, tolerance=tolerance, fewest=fewest)
            return misfit, (numbers >= 0).sum(axis=1)
        options: Any = {"tolerance": tolerance, "fewest": fewest, "turns": (turn,)}
        return (expected_by_chance(*scene, **options),)

    # What takes longest comes first.
    tasks = [(targets, (k + turn) % DECOYS) for k, targets in enumerate(frames)
             for turn in range(decoys)]  # fmt: skip
    with ThreadPoolExecutor(cores()) as pool:
        parts = list(pool.map(tried, [*tasks, *((targets, None) for targets in frames)]))
    chance = np.sum([counts for (counts,) in parts[: len(tasks)]], axis=0) / decoys
    misfits, rays = (np.concatenate(part) for part in zip(*parts[len(tasks) :], strict=True))
    return ChanceCounts(
        tolerance=tolerance, found=np.bincount(rays, minlength=count).astype(float),
        chance=chance, misfit=misfits, rays=rays.astype(float), decoys=decoys,
    )  # fmt: skip


def narrower_counts(
    content: Project, frames: Sequence[Sequence[FloatArray]], counts: ChanceCounts, fewest: int
) -> ChanceCounts | None:
    """Return what is found with a smaller tolerance that keeps the particles and drops chance.

    None where there is none: it is tried on the frames, and nothing counts that was not counted.
    """
    if counts.chance.sum() <= WORTH_LESS * counts.found.sum() or counts.true <= 0:
        return None
    for tolerance in _PROPOSED:
        if not _SIGMAS * counts.sigma_px <= tolerance < counts.tolerance:
            continue
        fewer = chance_counts(content, frames, tolerance, fewest)
        if fewer.chance.sum() >= 0.5 * counts.chance.sum():  # with more there is more chance
            break
        if tolerance >= _SIGMAS_LEFT * fewer.sigma_px and fewer.true >= KEPT * counts.true:
            return fewer
    return None


def tolerance_remarks(
    counts: ChanceCounts, fewer: ChanceCounts | None, key: str = "targets.tolerance"
) -> tuple[str, ...]:
    """Return what there is to say of a smaller tolerance, if there is one."""
    if fewer is None:
        return ()
    values = {"sigma": fewer.sigma_px, "tolerance": fewer.tolerance, "wide": counts.tolerance}
    for name, one in (("few", fewer), ("many", counts)):
        values |= {name: round(float(one.chance.sum())), f"{name}_of": one.found.sum()}
    return (remark(key, **values),)
