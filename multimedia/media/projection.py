"""Collinearity through the media: object points to image points, with analytic derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.camera import ANY_INTERIOR, EXTERIOR, Camera
from multimedia.media.flat_interface import FlatInterface
from multimedia.media.optical_media import OpticalMedia, StraightRays
from multimedia.refraction import Layers
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.camera import Fisheye, central, central_with_jacobian
from photocore.errors import InputError

#: What may be given to look through: parallel layers whose last face is the plane Z = 0, the same
#: anywhere else (`FlatInterface`), surfaces of any form (`Interfaces`, ray-traced), or nothing.
Media = Layers | OpticalMedia | None
#: Points worked on at a time; their scratch rows stay in the processor's cache.
BLOCK = 8192
#: Field of view (half, as a tangent) beyond which image coordinates are no millimetres.
WIDEST = 4.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Projection:
    """Image points with their derivatives.

    Attributes
    ----------
    image : ndarray, shape (n, 2)
        [mm]
    by_point : ndarray, shape (n, 2, 3)
        With respect to X, Y, Z of the object point.
    by_camera : ndarray, shape (n, 2, k)
        With respect to the camera parameters asked for; omega, phi, kappa stand for the small
        rotation vector of `Camera.stepped`.
    by_interface : ndarray, shape (n, 2, m)
        With respect to the interface parameters asked for, as in `FlatInterface.stepped`.
    """

    image: FloatArray
    by_point: FloatArray
    by_camera: FloatArray
    by_interface: FloatArray


def as_media(media: Media) -> OpticalMedia:
    """Return bare layers as an interface whose last face is the plane Z = 0, None as nothing.

    Layers of one index are one medium: their faces bend no ray and bound nothing.
    """
    if media is None:
        return StraightRays()
    if isinstance(media, Layers | FlatInterface) and len(set(media.indices)) == 1:
        return StraightRays()
    return FlatInterface(layers=media) if isinstance(media, Layers) else media


def project(camera: Camera, points: ArrayLike, media: Media = None) -> FloatArray:
    r"""Image coordinates of object points seen through the media.

    Parameters
    ----------
    camera : Camera
        Exterior and interior orientation.
    points : array_like, shape (..., 3)
        X, Y, Z. [unit of the camera's centre]
    media : Layers, FlatInterface, Interfaces or None
        Bare `Layers` have their last face in the plane Z = 0 with the camera above and the
        points below; a `FlatInterface` lies anywhere; `Interfaces` of any form are ray-traced.
        None: straight rays.

    Returns
    -------
    ndarray, shape (..., 2)
        Measured image coordinates, x right, y up, origin at the centre of the sensor. NaN for
        points behind the camera or not beyond the last face (`projection_status` says which).
        [mm]

    Raises
    ------
    GeometryError
        If the camera is not in the first medium.

    Notes
    -----
    Collinearity with the radially shifted point, exact for any tilt and number of parallel
    layers: Maas 2015, Sect. 2; see `multimedia.media.collinearity`.

    References
    ----------
    .. [1] Maas, "A modular geometric model for underwater photogrammetry", ISPRS Archives 2015.

    Examples
    --------
    A point 0.2 deep in water seems 0.15 deep to a camera right above, so at 0.1 off the axis
    and 0.5 above the water its image lies farther out than without water:

    >>> camera = Camera.from_angles((0, 0, 0.5), 0.0, 0.0, 0.0, principal_distance=25.0)
    >>> water = Layers(indices=(1.0, 1.337), thicknesses=())
    >>> project(camera, (0.1, 0.0, -0.2)).round(4).tolist()
    [3.5714, 0.0]
    >>> project(camera, (0.1, 0.0, -0.2), water).round(4).tolist()
    [3.8532, 0.0]
    """
    xyz = as_points(points, "points", dimension=3)
    media = as_media(media)
    flat = _known(xyz.reshape(-1, 3))
    image: FloatArray = np.empty((len(flat), 2))
    for start in range(0, max(len(flat), 1), BLOCK):
        part = slice(start, start + BLOCK)
        image[part] = _image_of(media.apparent_vectors(camera, flat[part]), camera)
    return image.reshape(*xyz.shape[:-1], 2)


def _known(points: FloatArray) -> FloatArray:
    """Return points with NaN in place of infinities: both have no image."""
    return np.where(np.isinf(points), np.nan, points) if np.isinf(points).any() else points


def projection_status(camera: Camera, points: ArrayLike, media: Media = None) -> list[str]:
    """Return why each point is or is not seen.

    Parameters
    ----------
    camera, points, media
        As for `project`; points of shape (n, 3).

    Returns
    -------
    list of str
        ``ok``, ``not a number``, ``before the interface``, ``behind the camera`` (of a fisheye
        ``90 degrees or more off the axis``),
        ``outside the lens model`` or ``outside the sensor`` (still projected).
    """
    xyz = as_points(points, "points", dimension=3).reshape(-1, 3)
    vectors, reasons = as_media(media).seen(camera, _known(xyz))
    image = _image_of(vectors, camera)
    outside: BoolArray = np.zeros(len(xyz), dtype=bool)
    if camera.sensor is not None:
        offset = np.abs(camera.sensor.pixel_from_image(image) - camera.sensor.origin)
        size = np.array([camera.sensor.width, camera.sensor.height])
        outside = np.asarray((offset > size / 2).any(axis=-1))
    status = np.full(len(xyz), "ok", dtype=object)
    status[outside] = "outside the sensor"
    status[np.isnan(image).any(axis=-1)] = "outside the lens model"
    fisheye = isinstance(camera.distortion, Fisheye)
    behind = "90 degrees or more off the axis" if fisheye else "behind the camera"
    status[vectors[:, 2] >= 0] = behind
    hidden = reasons != ""
    status[hidden] = reasons[hidden]
    status[~np.isfinite(xyz).all(axis=-1)] = "not a number"
    return status.tolist()


def project_with_jacobian(
    camera: Camera,
    points: FloatArray,
    media: Media = None,
    *,
    camera_names: Sequence[str] = (),
    interface_names: Sequence[str] = (),
    before: float = 0.0,
) -> Projection:
    """Project points and differentiate by points, camera and interface.

    Parameters
    ----------
    camera, media
        As for `project`.
    points : ndarray, shape (n, 3)
        Object points.
    camera_names : sequence of str
        Of `EXTERIOR` (omega, phi, kappa together) and `ANY_INTERIOR`, in any order.
    interface_names : sequence of str
        Of `FlatInterface.parameter_names`.
    before : float
        As for `OpticalMedia.sight`.

    Returns
    -------
    Projection
    """
    exterior = any(name in EXTERIOR for name in camera_names)
    # Faces of layers that an adjustment may change are there, whatever their indices are now.
    between = media if interface_names and isinstance(media, FlatInterface) else as_media(media)
    sight = between.sight(camera, points, exterior=exterior, names=interface_names, before=before)
    image, by_seen, by_interior = _through_lens(camera, sight.vectors, camera_names)
    by_point, by_exterior, by_interface = sight.derivatives(by_seen)
    by_camera = np.empty((len(points), 2, len(camera_names)))
    for k, name in enumerate(camera_names):
        by_camera[:, :, k] = (
            by_exterior[:, :, EXTERIOR.index(name)] if name in EXTERIOR else by_interior[name]
        )
    return Projection(
        image=image, by_point=by_point, by_camera=by_camera, by_interface=by_interface
    )


def _through_lens(
    camera: Camera, seen: FloatArray, names: Sequence[str]
) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
    """Return the images of camera-frame vectors with their derivatives.

    Returns
    -------
    image : ndarray, shape (n, 2)
    by_seen : ndarray, shape (n, 2, 3)
    by_interior : dict of ndarray, shape (n, 2)
        By each of ``names`` that belongs to the interior orientation.
    """
    ideal, by_seen = central_with_jacobian(seen, -camera.principal_distance)
    interior = [name for name in names if name in ANY_INTERIOR]
    by_c = ideal / camera.principal_distance
    if camera.distortion.is_identity and set(interior) <= {"c"}:
        return ideal + camera.principal_point, by_seen, {"c": by_c}
    image, by_ideal, by_own = camera.distortion.measured_with_jacobian(
        ideal, camera.principal_point, interior, camera.principal_distance
    )
    by_interior = {name: by_own[:, :, k] for k, name in enumerate(interior)}
    if "c" in by_interior:
        by_interior["c"] = by_interior["c"] + (by_ideal @ by_c[..., None])[..., 0]
    return image, by_ideal @ by_seen, by_interior


def _image_of(seen: FloatArray, camera: Camera) -> FloatArray:
    """Return measured image coordinates of camera-frame vectors in the first medium, (n, 2)."""
    return camera.measured(central(seen, -camera.principal_distance))


def refuse_pixels(camera: Camera, image: FloatArray) -> None:
    """Refuse image coordinates that are no millimetres.

    Raises
    ------
    InputError
        If they lie far off the sensor, or farther out than any lens sees.
    """
    who = f"camera {camera.name}: " if camera.name else ""
    farthest = float(np.nanmax(np.abs(image), initial=0.0))
    limit = WIDEST * camera.principal_distance
    if camera.sensor is not None:
        limit = min(limit, 1.5 * camera.sensor.half_diagonal)
    if farthest > limit:
        raise InputError(
            f"{who}an image point lies {farthest:.4g} mm from the centre, but the principal "
            f"distance is {camera.principal_distance:g} mm"
            + (
                f" and the sensor ends at {camera.sensor.half_diagonal:.4g} mm"
                if camera.sensor is not None
                else ""
            )
            + ". Are these pixels? Give millimetres, or columns headed col and row with the sensor."
        )
