"""Cameras of which only images are known: relative orientation, scaled by distances in the object.

First as if the object's medium were all around, seen with a longer principal distance: pairs by
their essential matrix, more cameras by resection. Then the faces are placed, tilt and depth tried,
and cameras turn and move until their rays through the media meet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from multimedia.media import Camera, FlatInterface, Interfaces, Plane, as_media
from multimedia.orientation.camera_chains import (
    StraightPoses,
    stands_still,
    straight_chains,
    straightened,
)
from multimedia.orientation.object_rays import nearest_points
from multimedia.orientation.ray_misses import (
    ImagesOfCameras,
    cost,
    images_with_distances,
    noise_as_angle,
    object_rays,
    settled,
    typical_miss,
)
from multimedia.projects import FLIP, Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import rotation_from_vector
from photocore.errors import GeometryError, InputError

#: How far the faces are tilted against the cameras' mean axis, and in how many directions. [deg]
_TILTS, _DIRECTIONS = (15.0, 30.0), 6
#: Where the faces are tried, as shares of the way from the points to the cameras.
_DEPTHS = (0.75, 0.5, 0.25)
#: So many places of the faces, best first, are improved.
_TRIED = 12
#: Rays that miss the typical point by so many times what noise explains are right at once, and by
#: so many sigmas of an image coordinate no start.
_RIGHT, _WRONG = 1.5, 20.0
#: So many right starts of two cameras are compared.
_OF_TWO = 4


def relative_orientation(project: Project, distances: Sequence[tuple[str, str, float]]) -> Project:
    """Return a project whose cameras have poses, found from their images alone.

    Parameters
    ----------
    project : Project
        Cameras with their interior orientation, media, image points. Poses are not read.
    distances : sequence of (str, str, float)
        Two points and how far they are apart: the two ends of a wand. [object unit]

    Returns
    -------
    Project
        Poses that an adjustment can start from. Where the media stand still the faces are where
        the project has them, and the points' middle is before them; else the frame is that of the
        first camera.

    Raises
    ------
    InputError
        If no distance is seen, or media that stand still are not flat.
    GeometryError
        If cameras share too few points, or no poses bring their rays together.

    Notes
    -----
    Essential matrices (Nister 2004) of image coordinates divided by the last index, which is what a
    camera that looks squarely through flat faces sees to first order (Maas 2015, Eq. 3 for small
    angles); rays through ports that move with their cameras are traced. Then least squares of the
    angles by which rays through the media miss one another, and of the distances.
    """
    for camera, media in zip(project.cameras, project.interfaces, strict=True):
        if stands_still(media) and still_face(media) is None:
            raise InputError(remark("orient.curved", name=camera.name))
    images = images_with_distances(project, distances)
    rays = np.array([straightened(*each) for each in zip(
        images.cameras, images.image, images.media, strict=True)])  # fmt: skip
    few = images.few()
    unit = noise_as_angle(project)
    least, views, right = np.inf, project.cameras, 0
    for start in _starts(project, images, few, straight_chains(rays, images, project.camera_names)):
        miss, settled = _brought_together(few, start, unit)
        if miss < least:
            least, views = miss, settled
        right += miss < _RIGHT * unit * few.share_of_noise
        # Two rays a point fit nearly as well before a face that is elsewhere: the best of several.
        if right == (_OF_TWO if len(views) == 2 else 1):
            break
    if not least < _WRONG * unit:
        miss = least / unit * project.sigma_image
        raise GeometryError(remark("orient.no_poses", miss=miss, limit=_WRONG))
    return replace(project, cameras=_before_faces(few, views), without_pose=())


def _starts(
    project: Project, images: ImagesOfCameras, few: ImagesOfCameras, chains: Sequence[StraightPoses]
) -> list[tuple[Camera, ...]]:
    """Return the places of the faces to begin with, of each chain those that fit best."""
    ranked = []
    for poses in chains:
        placed = [(cost(few, views), n, views) for n, views in
                  enumerate(_placed(project, images, poses))]  # fmt: skip
        ranked += sorted(placed)[: _TRIED // len(chains)]
    return [views for *_, views in sorted(ranked, key=lambda each: each[0])]


def _brought_together(
    few: ImagesOfCameras, start: tuple[Camera, ...], unit: float
) -> tuple[float, tuple[Camera, ...]]:
    """Return the typical miss [rad] and the cameras, gross errors left out where they disturb."""
    views = settled(few, start)
    miss = typical_miss(few, views)
    if miss < _RIGHT * unit * few.share_of_noise or miss > _WRONG * unit:
        return miss, views
    refined = settled(few, views, "cauchy", 3 * unit)
    return min((miss, views), (typical_miss(few, refined), refined), key=lambda each: each[0])


def still_face(media: FlatInterface | Interfaces | None) -> tuple[FloatArray, FloatArray] | None:
    """Return point and normal of the last face of flat media that stand still."""
    if isinstance(media, FlatInterface) and not media.moves_with_camera:
        return media.point, media.normal
    if isinstance(media, Interfaces) and not any(media.with_camera):
        last = media.surfaces[-1]
        return (last.point, last.normal) if isinstance(last, Plane) else None
    return None


def _placed(
    project: Project, images: ImagesOfCameras, poses: StraightPoses
) -> Iterator[tuple[Camera, ...]]:
    """Yield cameras before faces that stand still, tilted and in depths as they may be."""
    turns = poses.turns.transpose(0, 2, 1) @ FLIP
    middle = np.nanmedian(poses.points, axis=0)
    faces = {k: face for k, media in enumerate(images.media) if (face := still_face(media))}
    if not faces:
        home, origin = turns[0].T, poses.centres[0]
        yield _at(project, home @ turns, (poses.centres - origin) @ home.T)
        return
    at, normals = (np.array(column) for column in zip(*faces.values(), strict=True))
    axes, centres = -turns[list(faces)][..., 2], poses.centres[list(faces)]
    # The turn that brings the cameras' axes nearest to the normals (Kabsch).
    left, _, right = np.linalg.svd(-normals.T @ axes)
    squarely = left @ np.diag([1, 1, np.linalg.det(left @ right)]) @ right
    across = np.linalg.svd(normals)[2][1:]
    tilts = [np.zeros(3)]
    for tilt in np.radians(_TILTS):
        for way in np.arange(_DIRECTIONS) * 2 * np.pi / _DIRECTIONS:
            tilts.append(tilt * np.array([np.cos(way), np.sin(way)]) @ across)
    for tilt in tilts:
        turn = rotation_from_vector(tilt) @ squarely
        before = at.mean(axis=0) - turn @ middle
        height = ((centres - middle) @ turn.T * normals).sum(axis=1)
        reach = (((centres @ turn.T + before) - at) * normals).sum(axis=1)
        for depth in _DEPTHS:
            shift = before + np.linalg.lstsq(normals, depth * height - reach, rcond=None)[0]
            views = _at(project, turn @ turns, poses.centres @ turn.T + shift)
            yield tuple(
                _in_front(camera, *faces[k], images.media[k]) if k in faces else camera
                for k, camera in enumerate(views)
            )


def _before_faces(images: ImagesOfCameras, cameras: tuple[Camera, ...]) -> tuple[Camera, ...]:
    """Return the cameras moved along the faces until the points' middle is before them.

    Nothing else says where along them the frame is.
    """
    faces = [face for media in images.media if (face := still_face(media))]
    if not faces:
        return cameras
    rays = [object_rays(images, k, camera) for k, camera in enumerate(cameras)]
    origins, along = (list(parts) for parts in zip(*rays, strict=True))
    at, normals = (np.array(column) for column in zip(*faces, strict=True))
    way = at.mean(axis=0) - np.nanmedian(nearest_points(origins, along), axis=0)
    way -= np.linalg.pinv(normals) @ (normals @ way)
    return tuple(replace(camera, centre=camera.centre + way) for camera in cameras)


def _in_front(
    camera: Camera, point: FloatArray, normal: FloatArray, media: FlatInterface | Interfaces | None
) -> Camera:
    """Return a camera of straight rays brought to where it looks along the same axis through media.

    Its axis bends at the face, and its centre is nearer by the ratio of the indices.
    """
    indices = as_media(media).indices
    ratio = indices[-1] / indices[0]
    axis = camera.looks_along
    down = float(-axis @ normal)
    height = float((camera.centre - point) @ normal)
    if down < 0.1 or height <= 0:
        return camera
    aside = ratio * (axis + down * normal)
    aside *= min(1.0, 0.9 / max(float(np.linalg.norm(aside)), 1e-12))
    bent = aside - np.sqrt(1 - aside @ aside) * normal
    turn = np.cross(axis, bent)
    sine = float(np.linalg.norm(turn))
    turn *= np.arcsin(min(sine, 1.0)) / max(sine, 1e-12)
    reach = height / down
    return replace(
        camera, centre=camera.centre + reach * axis - reach / ratio * bent,
        rotation=rotation_from_vector(turn) @ camera.rotation,
    )  # fmt: skip


def _at(project: Project, turns: FloatArray, centres: FloatArray) -> tuple[Camera, ...]:
    """Return the cameras at these poses."""
    return tuple(
        replace(camera, rotation=turn, centre=centre)
        for camera, turn, centre in zip(project.cameras, turns, centres, strict=True)
    )
