"""Rays of many overlapping pairs, made from exact cameras and points without a photo."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal import Pinhole
from bifocal.networks.joint_adjustment import JointUnknowns
from bifocal.networks.joint_observations import JointObservations
from tests.builders.pinholes import camera_matrix, project, rotation_from_vector

#: 35 mm at 17.5 m and 19 mm at 9.5 m with 3.8 um pixels, 5000 x 3300 px: 9.5 x 6.3 m of wall.
FOCAL, DISTANCE, SIZE = (9210.0, 5000.0), (17.5, 9.5), (5000, 3300)
STEP, ROW = 6.0, 4.0


@dataclass(frozen=True)
class ManyPairs:
    observations: JointObservations
    start: JointUnknowns
    truth: np.ndarray
    control: int


def many_pairs(
    pairs: int, rng: np.random.Generator, *, columns: int = 0, ties: int = 40, control: int = 6,
    noise: float = 0.4,
) -> ManyPairs:  # fmt: skip
    """A wall in rows of pairs that overlap by a third; control along it, high and low."""
    columns = columns or pairs
    cameras, names = [], []
    for k in range(pairs):
        middle = np.array([STEP * (k % columns), ROW * (k // columns), 0.0])
        for focal, distance, side in zip(FOCAL, DISTANCE, ("far", "near"), strict=True):
            turn = np.diag([1.0, -1, -1]) @ rotation_from_vector(rng.normal(0, 0.01, 3))
            centre = rng.normal(0, 0.05, 3) + middle
            centre[2] += distance
            cameras.append(Pinhole(camera_matrix(focal, 1.0, 2500, 1650), turn, centre))
            names.append(f"{k}, {side}")
    wide, high = STEP * (columns - 1) + 9, ROW * ((pairs - 1) // columns) + 6
    count = ties * pairs
    low, top = [-4.5, -3, -0.5], [wide - 4.5, high - 3, 0.8]
    xyz = rng.uniform(low, top, (count, 3))
    known = np.full((count, 3), np.nan)
    for k, share in enumerate(np.linspace(0, 1, control)):
        xyz[k, :2] = -4 + (wide - 1) * share, -2.5 if k % 2 else high - 3.5
        known[k] = xyz[k] + rng.normal(0, 0.002, 3)
    seen = []
    for number, camera in enumerate(cameras):
        near = np.flatnonzero(np.abs(xyz[:, :2] - camera.centre[:2]).max(axis=1) < 6)
        pixels = project(camera, xyz[near])
        inside = ((pixels > 0) & (pixels < SIZE)).all(axis=1)
        seen += [(number, k, *pixel) for k, pixel in zip(near[inside], pixels[inside], strict=True)]
    rays = np.array(seen)
    observations = JointObservations(
        names=tuple(names), camera=rays[:, 0].astype(int), point=rays[:, 1].astype(int),
        pixels=rays[:, 2:] + rng.normal(0, noise, (len(rays), 2)),
        sigma=np.full(len(rays), noise), ids=tuple(f"P{k}" for k in range(count)),
        known=known, sigma_known=np.full((count, 3), 0.002), sigma_focal=np.zeros(len(cameras)),
    )  # fmt: skip
    off = [np.r_[np.zeros(4), rng.normal(0, 0.003, 3), rng.normal(0, 0.1, 3)] for _ in cameras]
    start = JointUnknowns(
        cameras=tuple(c.stepped(step) for c, step in zip(cameras, off, strict=True)),
        xyz=xyz + rng.normal(0, 0.1, xyz.shape),
    )
    return ManyPairs(observations, start, xyz, control)
