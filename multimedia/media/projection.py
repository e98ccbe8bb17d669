"""Collinearity through the media: object points to image points, with analytic derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from multimedia.media.camera import EXTERIOR, INTERIOR, Camera
from multimedia.media.collinearity import Shifts, image_vectors, shifts
from multimedia.media.flat_interface import FlatInterface
from multimedia.media.interfaces import Interfaces
from multimedia.media.ray_paths import RayStatus
from multimedia.media.ray_tracing import aim_rays
from multimedia.media.traced_projection import sight, sight_vectors
from multimedia.refraction.layers import Layers
from photocore.arrays import BoolArray, FloatArray, as_points
from photocore.errors import InputError

#: What lies between a camera and the object: parallel layers whose last face is the plane Z = 0,
#: the same anywhere else, surfaces of any form (ray-traced), or nothing.
Media = Layers | FlatInterface | Interfaces | None
Placed = FlatInterface | Interfaces | None
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


def as_interface(media: Media) -> Placed:
    """Return bare layers as an interface whose last face is the plane Z = 0."""
    return FlatInterface(layers=media) if isinstance(media, Layers) else media


def project(camera: Camera, points: ArrayLike, layers: Media = None) -> FloatArray:
    r"""Image coordinates of object points seen through the media.

    Parameters
    ----------
    camera : Camera
        Exterior and interior orientation.
    points : array_like, shape (..., 3)
        X, Y, Z. [unit of the camera's centre]
    layers : Layers, FlatInterface, Interfaces or None
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
    interface = as_interface(layers)
    flat = xyz.reshape(-1, 3)
    image: FloatArray = np.empty((len(flat), 2))
    if isinstance(interface, Interfaces):
        _central(sight_vectors(camera, flat, interface), camera, out=image)
        image = camera.distortion.measured(image, camera.principal_point)
        return image.reshape(*xyz.shape[:-1], 2)
    medium = None if interface is None else interface.medium(camera)
    for start in range(0, len(flat), BLOCK):
        part = slice(start, start + BLOCK)
        vectors = (flat[part] - camera.centre) @ camera.rotation
        seen = vectors if medium is None else image_vectors(vectors, medium)
        _central(seen, camera, out=image[part])
        if camera.distortion.is_identity:
            image[part] += camera.principal_point
        else:
            image[part] = camera.distortion.measured(image[part], camera.principal_point)
    return image.reshape(*xyz.shape[:-1], 2)


def projection_status(camera: Camera, points: ArrayLike, layers: Media = None) -> list[str]:
    """Return why each point is or is not seen.

    Parameters
    ----------
    camera, points, layers
        As for `project`; points of shape (n, 3).

    Returns
    -------
    list of str
        ``ok``, ``not a number``, ``before the interface``, ``behind the camera``,
        ``outside the lens model`` or ``outside the sensor`` (still projected).
    """
    xyz = as_points(points, "points", dimension=3).reshape(-1, 3)
    interface = as_interface(layers)
    vectors: FloatArray = (xyz - camera.centre) @ camera.rotation
    image = project(camera, xyz, interface)
    before: BoolArray = np.zeros(len(xyz), dtype=bool)
    if isinstance(interface, Interfaces):
        paths = aim_rays(camera.centre, xyz, interface.seen_from(camera.centre, camera.rotation))
        vectors = paths.directions[:, 0] @ camera.rotation
    elif interface is not None:
        medium = interface.medium(camera)
        before = vectors @ medium.normal + medium.height > 0
        vectors = image_vectors(vectors, medium)
    outside: BoolArray = np.zeros(len(xyz), dtype=bool)
    if camera.sensor is not None:
        offset = np.abs(camera.sensor.pixel_from_image(image) - camera.sensor.origin)
        size = np.array([camera.sensor.width, camera.sensor.height])
        outside = np.asarray((offset > size / 2).any(axis=-1))
    status = np.full(len(xyz), "ok", dtype=object)
    status[outside] = "outside the sensor"
    status[np.isnan(image).any(axis=-1)] = "outside the lens model"
    status[vectors[:, 2] >= 0] = "behind the camera"
    status[before] = "before the interface"
    if isinstance(interface, Interfaces):
        for code in RayStatus:
            if code != RayStatus.OK:
                status[paths.status == code] = code.label
    status[~np.isfinite(xyz).all(axis=-1)] = "not a number"
    return status.tolist()


def project_with_jacobian(
    camera: Camera,
    points: FloatArray,
    layers: Media = None,
    *,
    camera_names: Sequence[str] = (),
    interface_names: Sequence[str] = (),
) -> Projection:
    """Project points and differentiate by points, camera and interface.

    Parameters
    ----------
    camera, layers
        As for `project`.
    points : ndarray, shape (n, 3)
        Object points.
    camera_names : sequence of str
        Of `EXTERIOR` (omega, phi, kappa together) and `INTERIOR`, in any order.
    interface_names : sequence of str
        Of `FlatInterface.parameter_names`.

    Returns
    -------
    Projection
    """
    interface = as_interface(layers)
    if isinstance(interface, Interfaces):
        return _traced(camera, points, interface, camera_names, interface_names)
    vectors = (points - camera.centre) @ camera.rotation
    if interface is None:
        if interface_names:
            raise InputError("interface parameters: there is no interface to differentiate by.")
        seen, shift, medium = vectors, None, None
    else:
        medium = interface.medium(camera)
        shift = shifts(vectors, medium, media=bool(interface_names))
        seen = vectors + shift.g[:, None] * medium.normal
    lens = _through_lens(camera, seen, camera_names)
    by_seen = lens.by_seen
    by_vector = by_seen
    along = None
    if shift is not None and medium is not None:
        # u = a + g(rho^2, w) m: the change of g adds a product of two vectors to the identity.
        along = (by_seen.reshape(-1, 3) @ medium.normal).reshape(-1, 2)  # d(image)/dg
        twice = 2.0 * shift.by_rho2
        gradient = twice[:, None] * vectors
        gradient += (shift.by_w - twice * shift.w)[:, None] * medium.normal
        by_vector = along[:, :, None] * gradient[:, None, :]
        by_vector += by_seen
    by_point = (by_vector.reshape(-1, 3) @ camera.rotation.T).reshape(-1, 2, 3)
    by_camera = np.empty((len(points), 2, len(camera_names)))
    exterior = _by_exterior(
        camera_names, camera, interface, vectors, by_seen, by_vector, by_point, along, shift
    )
    for k, name in enumerate(camera_names):
        by_camera[:, :, k] = exterior[name] if name in exterior else lens.by_interior[name]
    by_interface = np.empty((len(points), 2, len(interface_names)))
    if interface is not None and shift is not None and along is not None:
        columns = _by_interface(interface_names, camera, interface, vectors, by_seen, along, shift)
        for k, column in enumerate(columns):
            by_interface[:, :, k] = column
    return Projection(
        image=lens.image, by_point=by_point, by_camera=by_camera, by_interface=by_interface
    )


def _traced(
    camera: Camera,
    points: FloatArray,
    interfaces: Interfaces,
    camera_names: Sequence[str],
    interface_names: Sequence[str],
) -> Projection:
    """Project through ray-traced surfaces."""
    exterior = any(name in EXTERIOR for name in camera_names)
    seen = sight(camera, points, interfaces, exterior=exterior, index_names=interface_names)
    lens = _through_lens(camera, seen.vectors, camera_names)
    by_camera = np.empty((len(points), 2, len(camera_names)))
    for k, name in enumerate(camera_names):
        if name in EXTERIOR:
            by_camera[:, :, k] = (lens.by_seen @ seen.by_exterior[name][:, :, None])[:, :, 0]
        else:
            by_camera[:, :, k] = lens.by_interior[name]
    return Projection(
        image=lens.image,
        by_point=lens.by_seen @ seen.by_point,
        by_camera=by_camera,
        by_interface=lens.by_seen @ seen.by_indices,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Lens:
    """Image points of camera-frame vectors, and their derivatives."""

    image: FloatArray
    by_seen: FloatArray  # (n, 2, 3)
    by_interior: dict[str, FloatArray]  # each (n, 2)


def _through_lens(camera: Camera, seen: FloatArray, names: Sequence[str]) -> _Lens:
    """Apply central projection and distortion to vectors in the first medium."""
    ideal = np.empty((len(seen), 2))
    _central(seen, camera, out=ideal)
    own = [name for name in names if name in INTERIOR and name != "c"]
    # d(ideal)/du = -(c / u_z) [1 0 x/c; 0 1 y/c]  with x = -c u_x / u_z.
    lever = -camera.principal_distance / seen[:, 2]
    by_seen: FloatArray = np.zeros((len(seen), 2, 3))
    by_seen[:, 0, 0] = by_seen[:, 1, 1] = lever
    by_seen[:, 0, 2] = lever * (ideal[:, 0] / camera.principal_distance)
    by_seen[:, 1, 2] = lever * (ideal[:, 1] / camera.principal_distance)
    by_c = ideal / camera.principal_distance
    if camera.distortion.is_identity and not own:
        return _Lens(ideal + camera.principal_point, by_seen, {"c": by_c})
    image, by_ideal, by_own = camera.distortion.measured_with_jacobian(
        ideal, camera.principal_point, own
    )
    by_interior = {name: by_own[:, :, k] for k, name in enumerate(own)}
    by_interior["c"] = (by_ideal @ by_c[..., None])[..., 0]
    return _Lens(image, by_ideal @ by_seen, by_interior)


def _central(seen: FloatArray, camera: Camera, *, out: FloatArray) -> None:
    """Write the central projection of camera-frame vectors; NaN behind the camera."""
    depth = seen[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = -camera.principal_distance / depth
    if not (depth < 0).all():
        factor = np.where(depth < 0, factor, np.nan)
    np.multiply(seen[:, 0], factor, out=out[:, 0])
    np.multiply(seen[:, 1], factor, out=out[:, 1])


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


def _by_exterior(
    names: Sequence[str],
    camera: Camera,
    interface: FlatInterface | None,
    vectors: FloatArray,
    by_seen: FloatArray,
    by_vector: FloatArray,
    by_point: FloatArray,
    along: FloatArray | None,
    shift: Shifts | None,
) -> dict[str, FloatArray]:
    """Return the derivatives by centre and rotation vector that ``names`` asks for."""
    if not any(name in EXTERIOR for name in names):
        return {}
    by_centre = -by_point
    # Turning the camera by a small vector v of the world: R^T d changes by R^T (d x v).
    turned, of = by_vector, vectors
    stays = interface is not None and not interface.moves_with_camera
    if stays and interface is not None and along is not None and shift is not None:
        # The height changes with the centre; rho and depth do not change with the rotation, the
        # whole seen vector turns.
        by_height = along * shift.by_height[:, None]
        by_centre = by_centre + by_height[:, :, None] * interface.normal
        turned, of = by_seen, vectors + shift.g[:, None] * (interface.normal @ camera.rotation)
    # row . (a x v) = (row x a) . v, in the camera frame; then v back to the world.
    by_turn = np.cross(turned, of[:, None, :]) @ camera.rotation.T
    columns = {name: by_centre[:, :, k] for k, name in enumerate(EXTERIOR[:3])}
    return columns | {name: by_turn[:, :, k] for k, name in enumerate(EXTERIOR[3:])}


def _by_interface(
    names: Sequence[str],
    camera: Camera,
    interface: FlatInterface,
    vectors: FloatArray,
    by_seen: FloatArray,
    along: FloatArray,
    shift: Shifts,
) -> list[FloatArray]:
    """Return the derivatives by the interface parameters, each of shape (n, 2)."""
    to_camera: FloatArray
    if interface.moves_with_camera:
        to_camera, centre = np.eye(3), -interface.point
    else:
        to_camera, centre = camera.rotation, camera.centre - interface.point
    columns: list[FloatArray] = []
    for name in names:
        if name == "offset":
            columns.append(along * -shift.by_height[:, None])
        elif name in ("tilt1", "tilt2"):
            axis = interface.tangents[int(name[-1]) - 1]
            turn = np.cross(axis, interface.normal)  # d(normal), in the interface's own frame
            turn_camera = turn @ to_camera
            by_w = vectors @ turn_camera
            change = (shift.by_w - 2.0 * shift.w * shift.by_rho2) * by_w
            change += shift.by_height * float(centre @ turn)
            columns.append(along * change[:, None] + (by_seen @ turn_camera) * shift.g[:, None])
        elif name.startswith("thickness"):
            columns.append(along * shift.by_thicknesses[:, [int(name[9:]) - 1]])
        else:
            columns.append(along * shift.by_indices[:, [int(name[5:]) - 1]])
    return columns
