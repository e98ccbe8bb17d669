"""A camera in the terms of another lens model: the one that sees directions most alike."""

from __future__ import annotations

import numpy as np

from multimedia.media.camera import Camera
from multimedia.media.camera_observations import CameraObservations, camera_of, start_at
from multimedia.media.projection import Media, project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import Brown
from photocore.errors import InputError

#: Points along the sides of the sensor at which cameras are compared.
_GRID = (25, 21)


def brown_of(camera: Camera, program: str) -> Brown:
    """Return the distortion of a camera that follows Brown's formula.

    Raises
    ------
    InputError
        If the camera has a fisheye lens, naming the program that cannot hold it.
    """
    if isinstance(camera.distortion, Brown):
        return camera.distortion
    raise InputError(remark("camera.fisheye_elsewhere", name=camera.name, program=program))


def sensor_rays(camera: Camera) -> tuple[FloatArray, FloatArray]:
    """Return points on the rays of a grid of pixels over the sensor, and these pixels.

    Returns
    -------
    points : ndarray, shape (n, 3)
        At the principal distance before the camera. [object unit]
    pixels : ndarray, shape (n, 2)
        Columns and rows; left out where the distortion cannot be undone.

    Raises
    ------
    InputError
        If the camera has no sensor, or its distortion can be undone nowhere.
    """
    sensor = camera.described_sensor()
    sides = (sensor.width, sensor.height)
    along = [np.linspace(0, side - 1, count) for side, count in zip(sides, _GRID, strict=True)]
    pixels = np.stack(np.meshgrid(*along), axis=-1).reshape(-1, 2)
    ideal = camera.ideal(sensor.image_from_pixel(pixels))
    finite = np.isfinite(ideal).all(axis=1)
    if not finite.any():
        raise InputError(f"camera {camera.name}: its distortion cannot be undone on the sensor.")
    vectors = np.column_stack([ideal, np.full(len(ideal), -camera.principal_distance)])[finite]
    return camera.centre + vectors @ camera.rotation.T, pixels[finite]


def nearest_camera(
    start: Camera,
    points: FloatArray,
    image: FloatArray,
    names: tuple[str, ...],
    *,
    media: Media = None,
) -> Camera:
    """Return the camera that sees points nearest to given image coordinates.

    Parameters
    ----------
    start : Camera
        With the lens model wanted.
    points : ndarray, shape (n, 3)
        [object unit]
    image : ndarray, shape (n, 2)
        [mm]
    names : tuple of str
        Parameters that may change, of `Camera.stepped`.
    media : Layers, FlatInterface, Interfaces or None
        As for `project`.
    """
    what = f"camera {start.name} in the terms of another lens model"
    observations = CameraObservations(
        points=points, image=image, media=media, sigma=np.ones_like(image), what=what
    )
    return camera_of(observations.network(names).minimise(start_at(start), most=60).state)


def farthest_miss(
    camera: Camera,
    points: FloatArray,
    image: FloatArray,
    *,
    scale: float = 1.0,
    media: Media = None,
) -> float:
    """Return how far the worst point lies from given image coordinates. [px]

    ``scale`` multiplies what the camera projects; infinite where a point is not seen.
    """
    pitch = camera.described_sensor().pixel_size
    miss = (project(camera, points, media) * scale - image) / pitch
    largest = float(np.linalg.norm(miss, axis=1).max())
    return largest if np.isfinite(largest) else np.inf
