"""Where a plate of known form is, from one camera that looks at it through the media."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multimedia.media import Camera, FlatInterface, Interfaces
from multimedia.orientation.resection import resect
from photocore.arrays import FloatArray

#: Points of a plate that one camera must see.
FEWEST = 4


def plate_pose(
    camera: Camera,
    local: FloatArray,
    image: FloatArray,
    media: FlatInterface | Interfaces | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the pose of a plate from its points in one image.

    Parameters
    ----------
    camera : Camera
        In the world.
    local : ndarray, shape (n, 3)
        Points in the frame of the plate. [object unit]
    image : ndarray, shape (n, 2)
        [mm]
    media : FlatInterface, Interfaces or None
        What the camera looks through.

    Returns
    -------
    rotation, shift : ndarray, shape (3, 3) and (3,)
        World from plate.

    Raises
    ------
    GeometryError, ConvergenceError, InputError
        As `resect`; GeometryError too where a surface cannot be carried with the camera.

    Notes
    -----
    Camera and media are carried round the plate together: a resection in the plate's frame, whose
    starts are straight-ray poses, gives where the camera would stand, hence where the plate is.
    """
    pose = resect(camera, local, image, carried_by(camera, media)).camera
    rotation = camera.rotation @ pose.rotation.T
    return rotation, camera.centre - rotation @ pose.centre


def carried_by(
    camera: Camera, media: FlatInterface | Interfaces | None
) -> FlatInterface | Interfaces | None:
    """Return media that move with the camera and are now where the given ones are."""
    turn = camera.rotation.T
    if isinstance(media, Interfaces):
        surfaces = tuple(
            surface if moves else surface.moved(turn, -turn @ camera.centre)
            for surface, moves in zip(media.surfaces, media.with_camera, strict=True)
        )
        # A gradient goes by the height in the world; for a start its mean does.
        moving = (True,) * len(surfaces)
        return replace(media, surfaces=surfaces, with_camera=moving, gradient=0.0)
    if media is None or media.moves_with_camera:
        return media
    point = turn @ (np.asarray(media.point) - camera.centre)
    return replace(media, point=point, normal=turn @ media.normal, moves_with_camera=True)
