"""Poses to start a resection from, found without any approximate value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from multimedia.media import Camera, OpticalMedia
from photocore.arrays import FloatArray
from photocore.camera import cameras_seeing
from photocore.errors import LARGEST, GeometryError

#: Camera frame with y down and z forwards (OpenCV) from ours.
_FLIP = np.diag([1.0, -1.0, -1.0])
#: Rounds of "apparent points from the pose, pose from the apparent points".
_ROUNDS = 4


def pose_starts(
    camera: Camera, control: FloatArray, image: FloatArray, media: OpticalMedia
) -> Iterator[Camera]:
    """Yield the camera itself, then poses from which it may have seen the control points.

    Parameters
    ----------
    camera : Camera
        Beyond the first pose only its interior orientation is used.
    control : ndarray, shape (n, 3)
        At least 3 points.
    image : ndarray, shape (n, 2)
        [mm]
    media : OpticalMedia
        What the camera looks through.

    Yields
    ------
    Camera
        Best guesses first is not promised; those that take time to find are found when asked for.

    Notes
    -----
    Maas' modular idea the other way round: once points are replaced by apparent ones on the
    camera's straight rays, any pose solver for one medium serves. The first apparent points are
    those of a camera looking along the normal, which need no pose; then the pose found gives
    better ones.
    """
    yield camera
    ideal = camera.ideal(image)
    good = np.isfinite(ideal).all(axis=1)
    if good.sum() < 3:
        return
    control, ideal = control[good], ideal[good]
    if len(set(media.indices)) == 1:
        yield from _straight(camera, control, ideal)
        return
    apparent = media.seen_from_afar(control)
    if apparent is not None:
        starts = _straight(camera, apparent, ideal)
    else:
        # Seen through its port a camera has, to first order, a longer principal distance; the
        # pose this gives is refined by apparent points like any other.
        starts = _straight(camera, control, ideal)
        distance = camera.principal_distance
        longer = replace(camera, principal_distance=distance * media.indices[-1])
        starts += [
            replace(pose, principal_distance=distance) for pose in _straight(longer, control, ideal)
        ]
    for start in starts:
        yield from _refined(start, control, ideal, media)


def _refined(
    start: Camera, control: FloatArray, ideal: FloatArray, media: OpticalMedia
) -> list[Camera]:
    """Return the start and what the apparent points make of it."""
    pose = start
    for _ in range(_ROUNDS):
        try:
            vectors = media.apparent_vectors(pose, control)
        except GeometryError:
            break
        apparent = pose.centre + vectors @ pose.rotation.T
        if not np.isfinite(apparent).all():
            break
        poses = _straight(pose, apparent, ideal)
        if not poses:
            break
        # Of the mirror poses of a flat target keep the branch this start belongs to.
        pose = min(poses, key=lambda other: -float(np.trace(other.rotation.T @ pose.rotation)))
    return [start] if pose is start else [start, pose]


def _straight(camera: Camera, control: FloatArray, ideal: FloatArray) -> list[Camera]:
    """Return the poses OpenCV finds for straight rays."""
    import cv2

    methods = [cv2.SOLVEPNP_SQPNP]
    spread = np.linalg.svd(control - control.mean(axis=0), compute_uv=False)
    if len(control) >= 4 and spread[2] < 1e-3 * spread[0]:
        methods.append(cv2.SOLVEPNP_IPPE)
    if len(control) == 3:
        methods.append(cv2.SOLVEPNP_P3P)
    if len(control) >= 6:
        methods.append(cv2.SOLVEPNP_EPNP)
    rays = ideal * (1.0, -1.0) / camera.principal_distance
    return [
        replace(camera, centre=pose.centre, rotation=pose.rotation.T @ _FLIP)
        for pose in cameras_seeing(control, rays, np.eye(3), methods=methods)
        if (np.abs(pose.centre) <= LARGEST).all()
    ]
