"""First camera of a photo taken through media, from control points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bifocal import rays
from bifocal.model.interior_orientation import Interior
from bifocal.model.pair_media import PairMedia
from bifocal.orientation.starts.space_resection import resect
from photocore.arrays import BoolArray, FloatArray
from photocore.camera.pinhole import Pinhole
from photocore.errors import GeometryError

#: Rounds in which points are put where they seem to be; it settles in three to six. Then the
#: camera moves by less than a share of its distance.
ROUNDS, SETTLED = 12, 1e-5


def resect_through(
    xyz: FloatArray, pixels: FloatArray, interior: Interior, media: PairMedia, number: int
) -> tuple[Pinhole, BoolArray]:
    """Return an approximate camera behind media and which points agree with it.

    Parameters
    ----------
    xyz, pixels, interior
        As of `bifocal.orientation.starts.space_resection.resect`.
    media : PairMedia
    number : int
        0 for the far camera, 1 for the near one.

    Raises
    ------
    GeometryError
        As of `resect`.

    Notes
    -----
    A camera in air sees the points where their straight rays of the first medium are (Maas 2015,
    Eqs. 1 and 2: the radial shift). Seen near the axis, that is a scene compressed in depth by
    n_1 / n_m behind a surface that stays with it, and behind a port a lens n_m / n_1 times as long;
    from there both are found in turn.
    """
    bent = media.layers.indices[0] / media.layers.indices[-1]
    if media.depth is not None:
        squeezed = xyz.copy()
        squeezed[:, 2] = media.depth - (media.depth - xyz[:, 2]) * bent
        camera, agree = resect(squeezed, pixels, interior)
        ratio = camera.matrix[0, 0] / interior.focal
    else:
        longer = replace(interior, focal=interior.focal / bent)
        camera, agree = resect(xyz, pixels, longer)
        ratio = camera.matrix[0, 0] * bent / interior.focal
    # A principal distance that was searched is found; it is not searched in every round.
    known = replace(
        interior, focal=interior.focal * ratio, sigma_focal=min(interior.sigma_focal, 0.02)
    )
    for _ in range(ROUNDS):
        there = np.zeros(len(xyz), dtype=bool)
        if media.z0(number, camera) >= 0:
            seeming = _seeming(camera, media, number, xyz)
            there = np.asarray(np.isfinite(seeming).all(axis=1))
        if there.sum() < 4:
            raise GeometryError(
                "the control points do not lie behind the media as they are given. Check --depth "
                "or --port, the indices in their order from the camera to the wall, and metres."
            )
        before = camera.centre
        camera, fits = resect(seeming[there], pixels[there], known)
        agree = there.copy()
        agree[there] = fits
        if np.linalg.norm(camera.centre - before) < SETTLED * before[2]:
            break
    return camera, agree


def _seeming(camera: Pinhole, media: PairMedia, number: int, xyz: FloatArray) -> FloatArray:
    """Return points moved along their heights onto the straight rays that show them, (n, 3)."""
    foot = media.foot(number, camera)
    away = rays.plane_position(xyz, foot) - foot.nadir
    reach = 1.0 - xyz[:, 2:] / foot.distance
    return np.concatenate([foot.nadir + away * reach, xyz[:, 2:]], axis=1)
