"""Rays of many cameras to common points of a façade, and what is known of these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.model import PairMedia
from bifocal.networks.camera_knowledge import CameraKnowledge
from photocore.arrays import BoolArray, FloatArray, IntArray

#: Of fewer points with known coordinates no frame follows.
FEWEST_KNOWN = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class JointObservations:
    """Rays of many cameras to common points, and what is known of the points.

    Attributes
    ----------
    names : tuple of str
        Of the cameras, m. A photo is one camera, also where two pairs use it.
    camera, point : ndarray of int, shape (n,)
        Of each ray.
    pixels : ndarray, shape (n, 2)
        Free of lens distortion.
    sigma : ndarray, shape (n,)
        Precision of a coordinate. [px]
    ids : tuple of str
        Of the points, p.
    known : ndarray, shape (p, 3)
        X, Y, r of control points; NaN where not known. [m]
    sigma_known : ndarray, shape (p, 3)
        Their standard deviations. [m]
    sigma_focal : ndarray, shape (m,)
        Relative standard deviation of the focal lengths; 0: held.
    media : tuple of (PairMedia, int)
        What each camera looks through: media of a pair, and 0 or 1 for its far or near camera;
        empty where all are in air.
    pairs : tuple of (int, int)
        The far and the near camera of each pair; empty: 0 and 1, 2 and 3, and so on.
    cameras : CameraKnowledge or None
        Of a set of photos; None where only focal lengths, poses and points are unknown.
    """

    names: tuple[str, ...]
    camera: IntArray
    point: IntArray
    pixels: FloatArray
    sigma: FloatArray
    ids: tuple[str, ...]
    known: FloatArray
    sigma_known: FloatArray
    sigma_focal: FloatArray
    media: tuple[tuple[PairMedia, int], ...] = ()
    pairs: tuple[tuple[int, int], ...] = ()
    cameras: CameraKnowledge | None = None

    def __post_init__(self) -> None:
        if not self.pairs:
            far = range(0, len(self.names) - 1, 2)
            object.__setattr__(self, "pairs", tuple((k, k + 1) for k in far))

    def media_of(self, camera: int) -> tuple[PairMedia, int]:
        """Return what a camera looks through, and which of its pair's cameras it is."""
        return self.media[camera] if self.media else (PairMedia.none(), 0)

    @property
    def frame_is_known(self) -> bool:
        """Whether control points or the wall hold the frame; else the first pair's cameras do."""
        if self.cameras is not None and self.cameras.by_wall:
            return True
        return int(np.isfinite(self.known).all(axis=1).sum()) >= FEWEST_KNOWN

    @property
    def unchecked(self) -> BoolArray:
        """Which points nothing checks: one ray and no more than their relief, shape (p,)."""
        rays = np.bincount(self.point, minlength=len(self.known))
        return np.asarray((rays == 1) & np.isnan(self.known[:, 0]))


def with_rays(observations: JointObservations, keep: BoolArray) -> JointObservations:
    """Return the observations with some of their rays."""
    o = observations
    return replace(
        o, camera=o.camera[keep], point=o.point[keep], pixels=o.pixels[keep], sigma=o.sigma[keep]
    )


def of_one_camera(observations: JointObservations, camera_of: Sequence[int]) -> JointObservations:
    """Return the observations of photos that pairs share as those of one camera each.

    Parameters
    ----------
    observations : JointObservations
        Of the photos of all pairs, far and near in turn.
    camera_of : sequence of int
        Camera that took each of them, counted as they come; what is known of it, and what it looks
        through, is what its first photo says.
    """
    o, first = observations, np.unique(camera_of, return_index=True)[1].tolist()
    camera = np.asarray(camera_of)[o.camera]
    _, once = np.unique(np.column_stack([camera, o.point, o.pixels]), axis=0, return_index=True)
    once.sort()
    return with_rays(
        replace(
            o, names=tuple(o.names[k] for k in first), camera=camera,
            sigma_focal=o.sigma_focal[first],
            media=tuple(o.media[k] for k in first) if o.media else (),
            pairs=tuple((camera_of[far], camera_of[near]) for far, near in o.pairs),
        ),
        np.isin(np.arange(len(camera)), once),
    )  # fmt: skip


def with_enough_rays(observations: JointObservations) -> JointObservations:
    """Leave out the rays of points that one camera sees and are not known, and what holds nothing.

    That is what is known of points without rays, and of all where they are too few for a frame: in
    that of the first pair they would contradict what is held.
    """
    rays = np.unique(np.column_stack([observations.point, observations.camera]), axis=0)
    count = np.bincount(rays[:, 0], minlength=len(observations.ids))
    fixed = np.isfinite(observations.known).all(axis=1) & (count > 0)
    if observations.cameras is not None and observations.cameras.by_wall:
        fixed = np.isfinite(observations.known[:, 2]) & (count > 0)
    elif fixed.sum() < FEWEST_KNOWN:
        fixed[:] = False
    enough = (count >= 2) | fixed
    held = enough & bool(fixed.any())
    coordinates = np.where(held[:, None], observations.known, np.nan)
    return replace(with_rays(observations, enough[observations.point]), known=coordinates)
