"""A camera behind media: where it shows points, and how that moves with camera and media.

The one set of derivatives through media, for the adjustment of a pair (`bifocal.orientation`) and
for what the covariance of its cameras does to points (`bifocal.model.orientation_precision`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bifocal import rays
from bifocal.media import PLACING, MediaPath
from multimedia import Layers
from photocore.arrays import FloatArray
from photocore.camera.distortion import inverse_2x2
from photocore.camera.pinhole import Pinhole, project, project_with_jacobian


class RefractedView(NamedTuple):
    """Pixels (n, 2) with derivatives by point (n, 2, 3), camera (n, 2, 10) and media (n, 2, k).

    The camera's `PARAMETERS`; of the media `common_names`, then `bifocal.media.PLACING`.
    """

    pixels: FloatArray
    by_point: FloatArray
    by_camera: FloatArray
    by_media: FloatArray


def common_names(layers: Layers) -> tuple[str, ...]:
    """Return the names of what both photos' media have in common, counted from the camera.

    Examples
    --------
    >>> common_names(Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.01,)))
    ('index1', 'index2', 'index3', 'thickness1')
    """
    return (
        *(f"index{k}" for k in range(1, len(layers.indices) + 1)),
        *(f"thickness{k}" for k in range(1, len(layers.thicknesses) + 1)),
    )


def media_names(layers: Layers) -> tuple[str, ...]:
    """Return the names of all that places and bends both photos' rays."""
    placing = (f"{name} {number}" for number in (1, 2) for name in PLACING)
    return (*common_names(layers), *placing)


def foot_of(camera: Pinhole, path: MediaPath) -> rays.Foot:
    """Return a camera reduced to what relief needs."""
    return rays.Foot(camera.centre[:2], float(camera.centre[2]), path)


def seen_through(camera: Pinhole, path: MediaPath, xyz: FloatArray) -> FloatArray:
    """Return the pixels of points (n, 3) behind media, shape (n, 2); NaN where none leads there."""
    apparent = rays.plane_position(xyz, foot_of(camera, path))
    return project(camera, np.column_stack([apparent, np.zeros(len(xyz))]))


def view_through(camera: Pinhole, path: MediaPath, xyz: FloatArray) -> RefractedView:
    """Return the pixels of points behind media, with their derivatives.

    Parameters
    ----------
    camera : Pinhole
        Its centre stands over the reference plane.
    path : MediaPath
        What lies between it and the plane, of the camera's own distance.
    xyz : ndarray, shape (n, 3)
        Points. [m]

    Returns
    -------
    RefractedView
        All NaN where a point is before the last interface, or no ray leads to it.

    Notes
    -----
    The pixel shows the apparent position q, on the straight ray of the first medium. At a kept
    point the ray ``A(q, u) + r S(q, u) = P`` gives ``dq = -(d(A + r S)/dq)^-1 d(A + r S)/du du``.
    """
    foot = foot_of(camera, path)
    apparent = rays.plane_position(xyz, foot)
    view = project_with_jacobian(camera, np.column_stack([apparent, np.zeros(len(xyz))]))
    by_apparent = view.by_point[:, :, :2]
    by_distance, by_nadir = rays.orientation_rows(xyz, foot)
    by_camera = view.by_camera.copy()
    by_camera[:, :, 7:9] += by_apparent @ by_nadir
    by_camera[:, :, 9] += (by_apparent @ by_distance[..., None])[..., 0]
    away = apparent - foot.nadir
    _, place, slope = path.trace_with_jacobian(away)
    inverse = inverse_2x2(place + xyz[:, 2, None, None] * slope)
    return RefractedView(
        pixels=view.pixels,
        by_point=by_apparent @ rays.design_rows(xyz, foot),
        by_camera=by_camera,
        by_media=-by_apparent @ inverse @ path.moved_by_media(away, xyz[:, 2]),
    )
