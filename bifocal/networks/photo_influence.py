"""A photo that drags the others of a set: without it they agree better than chance allows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bifocal.networks.joint_adjustment import JointAdjustment, JointUnknowns, adjust_jointly
from photocore.errors import PhotogrammetryError

#: Photos of a set that are left out in turn: one adjustment each.
FEWEST, MOST = 4, 8
#: So many times less a photo's rays weigh where it is left out; its own camera is still found.
WEAK = 30.0
#: A photo's rays misfit by so many times the variance of all others: honest ones of simulated sets
#: by 2, of a church's four photos by 3; one of these bent by 1.5 px by 9.
LIMIT = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DraggingPhoto:
    """A photo that contradicts what the others agree on.

    Attributes
    ----------
    name : str
    test : float
        Variance that its rays add, over that of the rest.
    moved : float
        By how much, the most. [m]
    """

    name: str
    test: float
    moved: float


def dragging_photo(adjusted: JointAdjustment) -> DraggingPhoto | None:
    """Return the photo that drags the others most, if any does beyond chance.

    Notes
    -----
    The sum of squares that falls away with a photo, over its redundancy, against what is left over
    the rest's: a test of two variances.
    """
    rays = adjusted.observations
    count = len(rays.names)
    if not FEWEST <= count <= MOST or not adjusted.of_cameras.any():
        return None
    start = JointUnknowns(
        cameras=adjusted.cameras, xyz=np.where(np.isfinite(adjusted.xyz), adjusted.xyz, 0.0),
        radial=adjusted.radial,
    )  # fmt: skip
    worst: DraggingPhoto | None = None
    for k, name in enumerate(rays.names):
        weak = np.where(rays.camera == k, WEAK * rays.sigma, rays.sigma)
        try:
            without = adjust_jointly(replace(rays, sigma=weak), start)
        except PhotogrammetryError:
            continue
        share = 2 * int((rays.camera == k).sum()) * adjusted.redundancy / (2 * len(rays.camera))
        squares = without.sigma0**2 * without.redundancy
        fallen = adjusted.sigma0**2 * adjusted.redundancy - squares
        test = (fallen / share) / (squares / max(adjusted.redundancy - share, 1.0))
        if test > max(LIMIT, worst.test if worst else 0.0):
            change = [without.cameras[j].centre - adjusted.cameras[j].centre
                      for j in range(count) if j != k]  # fmt: skip
            worst = DraggingPhoto(name=name, test=test, moved=float(np.abs(change).max()))
    return worst
