"""Accuracy studies of a set-up before anyone gets wet.

Everything follows from the derivatives of the projection through the media at object points where
something is to be measured: precision, what unknown media do to coordinates, and ray angles.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from multimedia.design.studies import CalibrationCosts, Placement, Study
from multimedia.media import (
    EXTERIOR,
    Camera,
    FlatInterface,
    Interfaces,
    project,
    project_with_jacobian,
    tangents_of,
    unit_vector,
)
from multimedia.orientation import image_rays, intersect, largest_angle, resect
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.arrays import BoolArray, FloatArray, as_points, positive
from photocore.errors import GeometryError, InputError, PhotogrammetryError

#: Rounds of aiming at where a target appears; each leaves a small share of the miss before.
AIMING_ROUNDS = 7
#: Steps in which sensitivities are given: what one can be wrong by on a good day. Lengths in mm, a
#: gradient of the index per mm.
STEPS: Mapping[str, tuple[float, str]] = {
    "index": (0.001, "0.001"),
    "offset": (1.0, "1 mm"),
    "tilt": (float(np.radians(0.1)), "0.1 deg"),
    "thickness": (0.1, "0.1 mm"),
    "radius": (1.0, "1 mm"),
    "centre": (1.0, "1 mm"),
    "shift": (1.0, "1 mm"),
    "gradient": (1e-6, "0.001 per m"),
}
#: Those that count in millimetres; a gradient counts per millimetre.
_LENGTHS = ("offset", "thickness", "radius", "centre", "shift")


def kind_of(parameter: str) -> str:
    """Return which of `STEPS` belongs to a parameter of media.

    Examples
    --------
    >>> [kind_of(name) for name in ("index3", "tank:tilt1", "dome:centreX@3", "gradient")]
    ['index', 'tilt', 'centre', 'gradient']
    """
    return parameter.rpartition(":")[2].partition("@")[0].rstrip("0123456789XYZ")


def study_setup(
    cameras: Sequence[Camera],
    media: Sequence[FlatInterface | Interfaces | None],
    points: FloatArray,
    *,
    sigma_image: float,
    names: Sequence[str] = (),
    millimetre: float = 1e-3,
) -> Study:
    """Return expected precision, ray angles and sensitivities of a set-up.

    Parameters
    ----------
    cameras : sequence of Camera
        At least two.
    media : sequence of FlatInterface, Interfaces or None
        What each camera looks through.
    points : ndarray, shape (n, 3)
        Object points, where measurements are planned. [object unit]
    sigma_image : float
        Precision of an image coordinate. [mm]
    names : sequence of str
        Name of each camera's media; cameras of one name share its unknowns.
    millimetre : float
        A millimetre in object units: 0.001 for metres, 1 for millimetres.

    Returns
    -------
    Study

    Raises
    ------
    InputError
        If there are fewer than two cameras.
    GeometryError
        If no point is seen by two cameras.

    Notes
    -----
    Covariance ``sigma² (sum J^T J)^-1`` over the cameras that see the point; an error of a media
    parameter p moves the intersected point by ``-(sum J^T J)^-1 sum J^T dx/dp``. Both are first
    order: how derivatives change over an error is left out. In a tank 0.2 m deep an index wrong
    by 0.03 moves points by 3.15 mm (RMS of Z), where this says 3.23.
    """
    if len(cameras) < 2:
        raise InputError("design: at least two cameras are needed to intersect anything.")
    positive(sigma_image, "sigma_image", unit="mm")
    points = as_points(points, "points", dimension=3).reshape(-1, 3)
    names = tuple(names) or tuple(str(k) for k in range(len(cameras)))
    normal = np.zeros((len(points), 3, 3))
    moments: dict[str, FloatArray] = {}
    rays, straight = [], []
    seen_by = np.zeros(len(points))
    for camera, interface, name in zip(cameras, media, names, strict=True):
        image = project(camera, points, interface)
        on_sensor: BoolArray = np.all(np.isfinite(image), axis=1) & _on_sensor(camera, image)
        seen_by += on_sensor
        if on_sensor.any():
            parameters = interface.parameter_names if interface is not None else ()
            slopes = project_with_jacobian(
                camera, points[on_sensor], interface, interface_names=parameters
            )
            by_point = slopes.by_point.transpose(0, 2, 1)
            normal[on_sensor] += by_point @ slopes.by_point
            right = by_point @ slopes.by_interface
            for k, parameter in enumerate(parameters):
                key = f"{name}:{parameter}"
                moment = moments.setdefault(key, np.zeros((len(points), 3)))
                moment[on_sensor] += right[:, :, k]
        direction = np.full((len(points), 3), np.nan)
        direction[on_sensor] = image_rays(camera, image[on_sensor], interface)[1]
        rays.append(direction)
        line = points - camera.centre
        line = line / np.linalg.norm(line, axis=1, keepdims=True)
        straight.append(np.where(on_sensor[:, None], line, np.nan))
    enough = seen_by >= 2
    if not enough.any():
        raise GeometryError(remark("design.unseen"))
    inverse = np.full_like(normal, np.nan)
    inverse[enough] = np.linalg.inv(normal[enough])
    sigma = sigma_image * np.sqrt(np.diagonal(inverse, axis1=1, axis2=2))
    sensitivity = {}
    for key, moment in moments.items():
        kind = kind_of(key)
        step = STEPS[kind][0]
        if kind in _LENGTHS:
            step *= millimetre
        elif kind == "gradient":
            step /= millimetre
        moved = np.einsum("nij,nj->ni", inverse, moment)
        sensitivity[key] = np.sqrt(np.nanmean(moved**2, axis=0)) * step
    return Study(
        points=points, sigma=sigma, angle=largest_angle(rays),
        angle_in_air=largest_angle(straight), seen_by=seen_by, sensitivity=sensitivity,
    )  # fmt: skip


def _on_sensor(camera: Camera, image: FloatArray) -> BoolArray:
    """Return which image points lie on the sensor; all, where its size is not known."""
    if camera.sensor is None:
        return np.ones(len(image), dtype=bool)
    pixels = camera.sensor.pixel_from_image(np.nan_to_num(image, nan=1e12))
    size = np.array([camera.sensor.width, camera.sensor.height])
    return np.asarray(((pixels >= -0.5) & (pixels <= size - 0.5)).all(axis=1))


def object_grid(
    extent: tuple[float, float], depths: tuple[float, float], *, count: int = 7
) -> FloatArray:
    """Return count x count points on each of count levels, centred under the origin.

    Parameters
    ----------
    extent : tuple of float
        Width and height of the object space. [object unit]
    depths : tuple of float
        Least and largest depth below the last face, both above 0. [object unit]
    count : int
        Points along X, along Y, and levels.

    Returns
    -------
    ndarray, shape (count³, 3)
        Points below the last face, Z negative. [object unit]

    Examples
    --------
    >>> object_grid((2.0, 1.0), (0.1, 0.5), count=2)[0].tolist()
    [-1.0, -0.5, -0.1]
    """
    low, high = sorted(positive(depth, "depth") for depth in depths)
    x = np.linspace(-extent[0] / 2, extent[0] / 2, count)
    y = np.linspace(-extent[1] / 2, extent[1] / 2, count)
    mesh = np.meshgrid(x, y, -np.linspace(low, high, count), indexing="ij")
    return np.stack([axis.ravel() for axis in mesh], axis=-1)


def ring_of_cameras(
    count: int,
    distance: float,
    half_angle: float,
    *,
    interface: FlatInterface,
    target: ArrayLike,
    principal_distance: float,
) -> tuple[Camera, ...]:
    """Return cameras evenly on a cone about the faces' normal through the target, looking at it.

    Parameters
    ----------
    count : int
        Two stand opposite each other.
    distance : float
        From the point of the last face above the target. [object unit]
    half_angle : float
        Of the cone, in air; 0 puts them all on the axis. [rad]
    interface : FlatInterface
        What they look through, standing still in the world at any place and tilt; a camera that
        would stand inside it raises `GeometryError`.
    target : array_like, shape (3,)
        Point in the object's medium that they aim at as it appears.
    principal_distance : float
        [mm]

    Returns
    -------
    tuple of Camera
        Evenly round the cone.
    """
    cameras = []
    target = as_points(target, "target", dimension=3)
    if interface.moves_with_camera:
        raise InputError(remark("design.moving_interface"))
    normal = interface.normal
    top = target + ((interface.point - target) @ normal) * normal
    # Azimuths from X, or what is left of it in the face.
    level = np.eye(3)[0] - normal[0] * normal
    across = tangents_of(normal)[0] if np.linalg.norm(level) < 0.1 else unit_vector(level, "level")
    for k in range(count):
        azimuth = 2 * np.pi * k / count
        aside = np.cos(azimuth) * across + np.sin(azimuth) * np.cross(normal, across)
        centre = top + distance * (np.cos(half_angle) * normal + np.sin(half_angle) * aside)
        # Aim where the target appears: shift the aim by the image of the target.
        aim = target.copy()
        for _ in range(AIMING_ROUNDS):
            camera = Camera.looking_at(
                centre, aim, principal_distance=principal_distance, name=f"cam{k + 1}"
            )
            pixel = project(camera, target, interface)
            if not np.isfinite(pixel).all():
                raise GeometryError(f"design: camera {k + 1} cannot see the target.")
            aim = centre + camera.rotation @ np.array([*pixel, -principal_distance])
        cameras.append(camera)
    return tuple(cameras)


def compare_placements(
    count: int,
    distance: float,
    *,
    interface: FlatInterface,
    points: FloatArray,
    principal_distance: float,
    sigma_image: float,
    half_angles: Sequence[float] = tuple(np.radians(np.arange(5, 86, 5)).tolist()),
) -> tuple[Placement, ...]:
    """Return the expected precision of rings of cameras of different opening.

    Angles under which a camera cannot see all points are left out.

    Parameters
    ----------
    count, distance, interface, principal_distance
        As in `ring_of_cameras`.
    points : ndarray, shape (n, 3)
        Object points. [object unit]
    sigma_image : float
        Of image coordinates. [mm]
    half_angles : sequence of float
        Openings to try. [rad]

    Returns
    -------
    tuple of Placement
        One for each opening that works.

    Raises
    ------
    GeometryError
        If no opening works.
    """
    target = points.mean(axis=0)
    placements = []
    for half_angle in half_angles:
        try:
            cameras = ring_of_cameras(
                count, distance, half_angle, interface=interface, target=target,
                principal_distance=principal_distance,
            )  # fmt: skip
            study = study_setup(cameras, [interface] * count, points, sigma_image=sigma_image)
        except GeometryError:
            continue
        if (study.seen_by < count).any():
            continue
        sigma, angle = tuple(study.rms_sigma.tolist()), float(np.mean(study.angle))
        placements.append(Placement(half_angle=float(half_angle), sigma=sigma, angle=angle))
    if not placements:
        raise GeometryError(remark("design.no_angle"))
    return tuple(placements)


def calibration_costs(
    cameras: Sequence[Camera],
    interface: FlatInterface,
    points: FloatArray,
    *,
    rng: np.random.Generator,
    sigma_image: float,
    index_error: float = 0.002,
    tilt_error: float = float(np.radians(0.3)),
    water_noise: float = 2.0,
    interior: Sequence[str] = ("c", "xh", "yh", "k1", "scale", "shear"),
) -> CalibrationCosts:
    """Return what calibrating in air costs when measuring in water: the pattern of Table 1.

    Parameters
    ----------
    cameras : sequence of Camera
        As they are.
    interface : FlatInterface
        The glass with water behind it, as assumed in the evaluation.
    points : ndarray, shape (n, 3)
        Every other one serves as control, the rest as check points. [object unit]
    rng : Generator
        Of the noise.
    sigma_image : float
        In air. [mm]
    index_error, tilt_error : float
        By how much the real water and glass differ from what is assumed. [-, rad]
    water_noise : float
        Noise of image coordinates in water over that in air: blur, dispersion, turbidity.
    interior : sequence of str
        What a calibration estimates.

    Returns
    -------
    CalibrationCosts
        Errors and precision of each of the three cases.

    Notes
    -----
    I: air-glass-air, calibrated. II: air-glass-water with the calibration of I. III: the same,
    calibrated again: interior parameters absorb part of what is wrong with the media
    (Maas 2015, Sect. 7).
    """
    last = len(interface.layers.indices)
    dry = replace(
        interface,
        layers=Layers(
            indices=(*interface.layers.indices[:-1], interface.layers.indices[0]),
            thicknesses=interface.layers.thicknesses,
        ),
    )
    real = interface.stepped([f"index{last}", "tilt1"], [index_error, tilt_error])
    control = np.arange(len(points)) % 2 == 0

    def evaluate(
        true_media: FlatInterface, assumed: FlatInterface, start: Sequence[Camera], noise: float,
        estimate: Sequence[str],
    ) -> tuple[list[Camera], tuple[float, ...], float]:  # fmt: skip
        oriented, images, sigma0 = [], [], []
        for camera, first in zip(cameras, start, strict=True):
            image = project(camera, points, true_media)
            image = image + rng.normal(0, noise, image.shape)
            images.append(image)
            result = resect(
                first, points[control], image[control], assumed, estimate=(*EXTERIOR, *estimate)
            )
            oriented.append(result.camera)
            sigma0.append(result.sigma0)
        xyz = intersect(oriented, np.stack(images)[:, ~control], assumed).xyz
        error = np.sqrt(np.nanmean((xyz - points[~control]) ** 2, axis=0))
        return oriented, tuple(error.tolist()), float(np.sqrt(np.mean(np.square(sigma0))))

    try:
        calibrated, first, sigma1 = evaluate(dry, dry, cameras, sigma_image, interior)
        _, second, sigma2 = evaluate(real, interface, calibrated, sigma_image * water_noise, ())
        _, third, sigma3 = evaluate(
            real, interface, calibrated, sigma_image * water_noise, interior
        )
    except PhotogrammetryError as error:
        raise GeometryError(remark("design.not_calibrated", error=error)) from error

    return CalibrationCosts(
        air=first, air_calibration_in_water=second, water=third, sigma0=(sigma1, sigma2, sigma3)
    )
