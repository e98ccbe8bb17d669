"""Cameras and media in OpenPTV's terms, exactly where it has them, otherwise as near as it can.

OpenPTV counts distortion from the centre of the sensor, stretches both axes alike by ``scx`` and
turns the y axis by ``she``: image = scx (x' - sin(she) y', cos(she) y'). One pixel size serves all
cameras, so a scale of x against y that they share becomes the shape of the pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from multimedia.media import (
    EXTERIOR,
    Camera,
    FlatInterface,
    Interfaces,
    Sensor,
    brown_of,
    farthest_miss,
    nearest_camera,
    project,
    sensor_rays,
)
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import Brown, Convention
from photocore.errors import InputError

_NEEDED = "OpenPTV needs its sensor."
#: What OpenPTV has and a direction-preserving change of the camera may use.
_FREE = (*EXTERIOR[3:], "c", "xh", "yh", "k1", "k2", "k3", "p1", "p2", "shear")
#: Beyond so many pixels a camera is another one. The four cameras of a real tank, calibrated with a
#: scale each (0.991 to 1.004, sigma 0.001 to 0.03), move by 0.02 to 1.15 px at their points.
FARTHEST = 1.2
#: A misfit of rounding is none; from CLOSE on the object points say which camera is nearest. [px]
NO_MISFIT, CLOSE = 1e-10, 0.05
#: OpenPTV's glass vector has no direction where its tip is in the origin: a picometre off it does.
_SHORTEST = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpenptvCamera:
    """A camera as .ori and .addpar hold it.

    Attributes
    ----------
    camera : Camera
        With OpenPTV's convention, its scale and the origin of its sensor.
    scale : float
        ``scx``.
    misfit : float
        Farthest that an image point of the given camera moves. [px]
    at_points : bool
        Whether that is said of the object points only, the centre having moved too.
    """

    camera: Camera
    scale: float
    misfit: float
    at_points: bool = False


def common_sensor(cameras: Sequence[Camera]) -> Sensor:
    """Return the one sensor of ptv.par that comes nearest to those of all cameras.

    Raises
    ------
    InputError
        If a camera has none, or one of another size.
    """
    sensors = [camera.described_sensor(_NEEDED) for camera in cameras]
    first, ratios = sensors[0], []
    for camera, sensor in zip(cameras, sensors, strict=True):
        if (sensor.width, sensor.height) != (first.width, first.height):
            raise InputError(
                f"camera {camera.name}: its photos of {sensor.width} x {sensor.height} px are not "
                f"of the size of the others, {first.width} x {first.height}: OpenPTV has one."
            )
        lens = brown_of(camera, "OpenPTV")
        # Which height of a pixel makes scale and shear those of OpenPTV.
        shape = np.sqrt(lens.scale**2 - np.sin(lens.shear) ** 2) / np.cos(lens.shear)
        if lens.convention is Convention.PHOTOGRAMMETRIC:
            shape = 1.0 / lens.scale
        ratios.append(float(sensor.pixel_size[1] / sensor.pixel_size[0] * shape))
    pitch = np.array([first.pixel_size[0], first.pixel_size[0] * np.median(ratios)])
    size = np.array([first.width, first.height])
    return Sensor(width=first.width, height=first.height, pixel_size=pitch, origin=size / 2)


def in_openptvs_terms(
    camera: Camera, sensor: Sensor, *, points: FloatArray, media: FlatInterface
) -> OpenptvCamera:
    """Return the camera of OpenPTV that sees directions where ``camera`` does.

    Parameters
    ----------
    camera : Camera
        Of any convention.
    sensor : Sensor
        From `common_sensor`.
    points : ndarray, shape (n, 3)
        Object points; may be none. [object unit]
    media : FlatInterface
        What the camera looks through.

    Raises
    ------
    InputError
        If that is impossible to a pixel.

    Notes
    -----
    Exact for cameras without distortion, with distortion about the centre of the sensor, and of
    OpenPTV's own convention. Brown's formula about a principal point off the centre differs by
    its terms of the fifth order and an affine part; those are met by least squares over the sensor,
    rotation and interior orientation free, the centre fixed: rays keep their places in all media.
    A scale of its own (cameras share one pixel shape) no direction can make good; in a calibration
    it goes with the position of the camera, so then the camera is fitted to what it sees of the
    object points.
    """
    described = camera.described_sensor(_NEEDED)
    rays, pixels = sensor_rays(camera)
    start, scale = _start(camera, described, sensor)
    target = sensor.image_from_pixel(pixels) / scale
    misfit = farthest_miss(start, rays, target * scale, scale=scale)
    if misfit > NO_MISFIT:
        start = nearest_camera(start, rays, target, _FREE)
        misfit = farthest_miss(start, rays, target * scale, scale=scale)
    at_points = misfit > CLOSE and len(points) >= len(_FREE)
    if at_points:
        image = project(camera, points, media)
        places = described.pixel_from_image(image)
        inside = ((places > -0.5) & (places < (described.width, described.height))).all(axis=1)
        target = sensor.image_from_pixel(places[inside]) / scale
        nearer = nearest_camera(start, points[inside], target, EXTERIOR[:3] + _FREE, media=media)
        miss = farthest_miss(nearer, points[inside], target * scale, scale=scale, media=media)
        at_points = miss < misfit
        start, misfit = (nearer, miss) if at_points else (start, misfit)
    if not misfit <= FARTHEST:
        raise InputError(remark("openptv.lens_misfit", name=camera.name, misfit=misfit))
    return OpenptvCamera(camera=start, scale=scale, misfit=misfit, at_points=at_points)


def wall_of(camera: Camera, media: FlatInterface | Interfaces | None) -> FlatInterface:
    """Return the glass that stands in the world and is three media, as OpenPTV wants it.

    Raises
    ------
    InputError
        If OpenPTV cannot hold it.
    """
    who = f"camera {camera.name}"
    if media is None:
        return _no_glass(camera)
    if not isinstance(media, FlatInterface) or len(media.layers.indices) > 3:
        raise InputError(remark("openptv.three_media", of=who))
    layers = media.layers
    if len(layers.indices) == 2:
        layers = Layers(indices=(*layers.indices, layers.indices[1]), thicknesses=(0.0,))
    if not media.moves_with_camera:
        return replace(media, layers=layers)
    return FlatInterface(
        layers=layers,
        point=camera.centre + camera.rotation @ media.point,
        normal=camera.rotation @ media.normal,
    )


def _no_glass(camera: Camera) -> FlatInterface:
    """Return three media of one index before a camera that looks through none."""
    # OpenPTV wants the camera beyond the origin, seen along the glass vector.
    away = float(np.linalg.norm(camera.centre))
    normal = camera.centre / away if away > 0 else camera.rotation[:, 2]
    same = Layers(indices=(1.0, 1.0, 1.0), thicknesses=(0.0,))
    return FlatInterface(layers=same, normal=normal)


def glass_vector(camera: Camera, wall: FlatInterface) -> FloatArray:
    """Return the vector from the origin to the foot on the water side of the glass.

    Raises
    ------
    InputError
        If the origin lies on the camera's side of it: the vector would point the wrong way.
    """
    reach = float(wall.point @ wall.normal)
    if len(set(wall.indices)) == 1:
        # Nothing is refracted: any glass before the camera will do.
        return np.asarray(_SHORTEST * wall.normal)
    if reach < -_SHORTEST:
        raise InputError(remark("openptv.origin", name=camera.name))
    return np.asarray(max(reach, _SHORTEST) * wall.normal)


def _start(camera: Camera, own: Sensor, sensor: Sensor) -> tuple[Camera, float]:
    """Return the camera with the same coefficients in OpenPTV's terms, and scx."""
    lens = brown_of(camera, "OpenPTV")
    stretch = float(sensor.pixel_size[0] / own.pixel_size[0])
    scale = lens.scale * stretch
    turn = float(np.arcsin(np.sin(lens.shear) / lens.scale))
    shift = sensor.image_from_pixel(own.origin) / scale
    axes = np.array([[1.0, -np.sin(turn)], [0.0, np.cos(turn)]])
    if lens.convention is Convention.OPENPTV:
        centre = camera.principal_point + shift
    else:
        moved = own.pixel_from_image(camera.principal_point)
        centre = np.linalg.solve(axes, sensor.image_from_pixel(moved) / scale)
    sign = 1.0
    if lens.convention is Convention.PHOTOGRAMMETRIC:
        sign, scale, centre = -1.0, stretch, sensor.image_from_pixel(
            own.pixel_from_image(camera.principal_point)
        ) / stretch  # fmt: skip
    terms = {name: sign * getattr(lens, name) for name in ("k1", "k2", "k3", "p1", "p2")}
    brown = Brown(**terms, shear=sign * turn, convention=Convention.OPENPTV)
    return replace(camera, principal_point=centre, distortion=brown, sensor=sensor), scale
