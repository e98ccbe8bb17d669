"""The direction in which a camera sees points through ray-traced interfaces, with derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from multimedia.media.camera import EXTERIOR, Camera
from multimedia.media.interfaces import Interfaces
from multimedia.media.ray_tracing import aim_rays, trace_rays
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: Step of central differences as a share of the distance: paths are exact to 1e-13 of the scene,
#: so differences are good to 1e-8.
_STEP = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sight:
    """Unit vectors towards points, in the camera frame, with derivatives.

    Attributes
    ----------
    vectors : ndarray, shape (n, 3)
    by_point : ndarray, shape (n, 3, 3)
    by_exterior : dict
        Parameter of `EXTERIOR` to ndarray, shape (n, 3).
    by_indices : ndarray, shape (n, 3, k)
        Of the refractive indices asked for.
    """

    vectors: FloatArray
    by_point: FloatArray
    by_exterior: dict[str, FloatArray]
    by_indices: FloatArray


def sight_vectors(camera: Camera, points: FloatArray, interfaces: Interfaces) -> FloatArray:
    """Return the unit vector in the first medium towards each point, in the camera frame."""
    fixed = interfaces.seen_from(camera.centre, camera.rotation)
    paths = aim_rays(camera.centre, points, fixed)
    vectors: FloatArray = paths.directions[..., 0, :] @ camera.rotation
    return vectors


def object_rays(
    camera: Camera, directions: FloatArray, interfaces: Interfaces
) -> tuple[FloatArray, FloatArray]:
    """Return origin and unit direction of rays in the last medium, in the world, shape (n, 3)."""
    fixed = interfaces.seen_from(camera.centre, camera.rotation)
    paths = trace_rays(camera.centre, directions @ camera.rotation.T, fixed)
    return paths.vertices[..., -1, :], paths.directions[..., -1, :]


def sight(
    camera: Camera,
    points: FloatArray,
    interfaces: Interfaces,
    *,
    exterior: bool,
    index_names: Sequence[str] = (),
) -> Sight:
    """Return directions with derivatives.

    Parameters
    ----------
    camera, points, interfaces
        As for `multimedia.project`.
    exterior : bool
        Whether the derivatives by the exterior orientation are wanted.
    index_names : sequence of str
        ``index1``, ``index2``... from the camera's medium on.

    Notes
    -----
    Analytic by the point, and by the camera as far as the interfaces stand still with the object
    (rotation) or all move with the camera (everything). What remains, the shift of a camera before
    interfaces that stand still, and the indices, are central differences.
    """
    fixed = interfaces.seen_from(camera.centre, camera.rotation)
    paths = aim_rays(camera.centre, points, fixed, jacobian=True)
    rotation = camera.rotation
    vectors: FloatArray = paths.directions[:, 0] @ rotation
    if paths.jacobian is None:
        raise AssertionError("aim_rays was asked for the derivative")
    by_point: FloatArray = rotation.T @ paths.jacobian
    moving = interfaces.with_camera
    by_exterior: dict[str, FloatArray] = {}
    distance = (
        float(np.median(np.linalg.norm(points - camera.centre, axis=1))) if len(points) else 1
    )

    def changed(name: str, size: float) -> FloatArray:
        def at(step: float) -> FloatArray:
            values = [step * (other == name) for other in EXTERIOR]
            return sight_vectors(camera.stepped(EXTERIOR, values), points, interfaces)

        return _difference(at, size)

    if exterior:
        if moving and all(moving):
            by_exterior |= {name: -by_point[:, :, k] for k, name in enumerate(EXTERIOR[:3])}
        else:
            by_exterior |= {name: changed(name, _STEP * distance) for name in EXTERIOR[:3]}
        if any(moving) and not all(moving):
            by_exterior |= {name: changed(name, _STEP) for name in EXTERIOR[3:]}
        else:
            # R^T d turns by R^T (d x v): d is the ray where the interfaces stand still, the
            # vector to the point where they turn with the camera.
            for k, name in enumerate(EXTERIOR[3:]):
                axis = np.eye(3)[k]
                if any(moving):
                    turned = np.cross(points - camera.centre, axis)
                    by_exterior[name] = (by_point @ turned[:, :, None])[:, :, 0]
                else:
                    by_exterior[name] = np.cross(paths.directions[:, 0], axis) @ rotation
    by_indices = np.empty((*vectors.shape, len(index_names)))
    for k, name in enumerate(index_names):
        by_indices[:, :, k] = _by_index(camera, points, interfaces, name)
    return Sight(vectors=vectors, by_point=by_point, by_exterior=by_exterior, by_indices=by_indices)


def _by_index(camera: Camera, points: FloatArray, interfaces: Interfaces, name: str) -> FloatArray:
    """Return the derivative by one refractive index."""
    known = [f"index{k}" for k in range(1, len(interfaces.indices) + 1)]
    if name not in known:
        raise InputError(
            f"interface parameter {name}: of ray-traced surfaces only {', '.join(known)} can be "
            "estimated."
        )
    place = known.index(name)

    def at(step: float) -> FloatArray:
        indices = [n + step * (k == place) for k, n in enumerate(interfaces.indices)]
        return sight_vectors(camera, points, interfaces.with_indices(indices))

    # Vacuum is the lower limit of an index: differences on one side there.
    if interfaces.indices[place] < 1.0 + _STEP:
        here, one, two = at(0.0), at(_STEP), at(2 * _STEP)
        return (4.0 * one - 3.0 * here - two) / (2 * _STEP)
    return _difference(at, _STEP)


def _difference(function: Callable[[float], FloatArray], size: float) -> FloatArray:
    """Return the central difference."""
    return (function(size) - function(-size)) / (2.0 * size)
