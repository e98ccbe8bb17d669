"""Poses by the kernel, where camera and media are of its kind; the general adjustment elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multimedia.media import (
    Camera,
    CameraObservations,
    FlatInterface,
    OpticalMedia,
    StraightRays,
    as_media,
    start_at,
)
from multimedia.orientation.pose_arrays import Layering
from multimedia.orientation.pose_kernel import fitted_pose
from multimedia.refraction import ratios
from photocore.adjustment import Fit
from photocore.adjustment.dense import DenseEquations
from photocore.adjustment.network import NetworkState
from photocore.arrays import FloatArray

#: What the kernel's plain road takes, roughly. [s]
POSE_SECONDS = 1e-3
#: Points beyond which numpy's rows are as quick as the loop (20 000: 1.7 us a point against 3.0).
FEW = 2000
#: Rounds of "lens as a linear map about the image points": two, but for lenses that bend strongly.
LENS_ROUNDS = 5
#: Image points that move less, as a share of the principal distance, leave the map as it is: its
#: error is the lens's curvature times the square.
NEAR = 1e-8
#: Straight rays: one medium, and a face right before the projection centre.
_NO_LAYERS = Layering(
    point=np.array([0.0, 0.0, -1e-200]), normal=np.array([0.0, 0.0, 1.0]), moving=True,
    thicknesses=np.zeros(0), k=np.ones(1), q=np.zeros(1),
)  # fmt: skip


def layering_of(media: OpticalMedia) -> Layering | None:
    """Return parallel layers as plain numbers; None for media that the kernel does not know."""
    if isinstance(media, StraightRays):
        return _NO_LAYERS
    if not isinstance(media, FlatInterface) or min(media.indices) < media.indices[0]:
        return None
    k, q = np.array([ratios(index, media.indices[0]) for index in media.indices[1:]]).T
    return Layering(
        point=np.array(media.point), normal=np.array(media.normal),
        moving=media.moves_with_camera, thicknesses=np.array(media.layers.thicknesses),
        k=k.copy(), q=q.copy(),
    )  # fmt: skip


def linear_lens(
    camera: Camera, ideal: FloatArray, image: FloatArray, sigma: FloatArray
) -> FloatArray:
    """Return the weighted residuals as linear in ideal image points, about some.

    Parameters
    ----------
    camera : Camera
        Whose lens it is.
    ideal : ndarray, shape (..., n, 2)
        About where. [mm]
    image, sigma : ndarray, shape (..., n, 2)
        Measured, with standard deviations. [mm]

    Returns
    -------
    ndarray, shape (..., 2, 3, n)
        As for `multimedia.orientation.pose_kernel.point_equations`.
    """
    if camera.distortion.is_identity:
        lens = np.zeros((*ideal.shape[:-2], 2, 3, ideal.shape[-2]))
        weight = np.swapaxes(1.0 / sigma, -2, -1)
        lens[..., 0, 0, :], lens[..., 1, 1, :] = weight[..., 0, :], weight[..., 1, :]
        lens[..., 2, :] = np.swapaxes(camera.principal_point - image, -2, -1) * weight
        return lens
    measured, by_ideal, _ = camera.distortion.measured_with_jacobian(
        ideal, camera.principal_point, (), camera.principal_distance
    )
    rest = measured - image - (by_ideal @ ideal[..., None])[..., 0]
    parts = np.concatenate([by_ideal, rest[..., None]], axis=-1) / sigma[..., None]
    return np.ascontiguousarray(np.moveaxis(parts, -3, -1))


def quick_pose(camera: Camera, observations: CameraObservations) -> Fit[NetworkState] | None:
    """Return the pose that a start leads to; None where the general adjustment has to find it."""
    layering = layering_of(as_media(observations.media))
    ideal = camera.ideal(observations.image)
    if layering is None or not np.isfinite(ideal).all():
        return None
    few = len(ideal) < FEW
    fitted = fitted_pose if few and fitted_pose.pays(POSE_SECONDS) else fitted_pose.plain
    # Copies: numba compiles once more for arrays that may not be written.
    centre, rotation = camera.centre.copy(), camera.rotation.copy()
    points, count = np.ascontiguousarray(observations.points.T), 0
    for _ in range(LENS_ROUNDS):
        lens = linear_lens(camera, ideal, observations.image, observations.sigma)
        steps, centre, rotation, flat, rows = fitted(
            points,
            lens,
            centre,
            rotation,
            camera.principal_distance,
            layering,
            observations.rounding,
        )
        count += steps
        if steps == 0 or not np.isfinite(rows).all():
            return None
        near = np.abs(flat.T - ideal).max() < NEAR * camera.principal_distance
        if near or camera.distortion.is_identity:
            pose = start_at(replace(camera, centre=centre, rotation=rotation))
            table = np.moveaxis(rows, -1, 0).reshape(-1, 7)
            linear = DenseEquations(residuals=table[:, 0], jacobian=table[:, 1:])
            return Fit(state=pose, linear=linear, iterations=count, settled=True)
        ideal = flat.T
    return None
