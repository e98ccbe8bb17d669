"""A pinhole camera: projection with derivatives, and the homography that replaces it on a plane.

The object frame has Z = 0 on the reference plane and Z up towards the cameras, so a camera at
C = (N, d) with camera matrix K and rotation R (``x_camera = R (P - C)``, z forwards) sees the plane
through ``pixel ~ K R [e1 e2 -C] (X, Y, 1)``. Conversely that homography together with N and d gives
K and R back: eight numbers and three are the eleven of a pinhole camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from photocore.arrays import FloatArray
from photocore.camera.rotation import AXES_CROSS, by_rotation, rotation_from_vector, skew
from photocore.camera.similarity import Similarity

#: What a camera is differentiated by: logarithms of fx and fy / fx, principal point [px], a small
#: turn about the object frame's axes [rad], projection centre [m].
PARAMETERS = (
    "focal length", "aspect", "column", "row", "turn X", "turn Y", "turn Z", "X", "Y", "Z"
)  # fmt: skip


class Pinhole(NamedTuple):
    """A camera without distortion.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        Camera matrix. [px]
    rotation : ndarray, shape (3, 3)
        Camera from object frame.
    centre : ndarray, shape (3,)
        Projection centre. [m]
    """

    matrix: FloatArray
    rotation: FloatArray
    centre: FloatArray

    @property
    def tilt(self) -> FloatArray:
        """The optical axis' X and Y components per unit towards the plane, shape (2,).

        (0, 0) for an image plane parallel to it; (tan a, 0) for a camera looking a to the right.
        """
        axis = self.rotation[2]
        return axis[:2] / -axis[2]

    def moved(self, rotation: FloatArray, origin: FloatArray) -> Pinhole:
        """Return the camera in a frame whose axes are the rows of ``rotation``, with new origin."""
        return self._replace(
            rotation=self.rotation @ rotation.T, centre=rotation @ (self.centre - origin)
        )

    def carried(self, frame: Similarity) -> Pinhole:
        """Return the camera in the target frame of a similarity."""
        rotation = self.rotation @ frame.rotation.T
        return self._replace(rotation=rotation, centre=frame(self.centre))

    def stepped(self, step: FloatArray) -> Pinhole:
        """Return the camera after adding to its `PARAMETERS`, the turn as a rotation vector."""
        focal = self.matrix[0, 0] * np.exp(step[0])
        aspect = self.matrix[1, 1] / self.matrix[0, 0] * np.exp(step[1])
        return Pinhole(
            camera_matrix(focal, aspect, *(self.matrix[:2, 2] + step[2:4])),
            self.rotation @ rotation_from_vector(step[4:7]),
            self.centre + step[7:10],
        )


class ProjectedPoints(NamedTuple):
    """Where points are seen, with derivatives.

    Attributes
    ----------
    pixels : ndarray, shape (n, 2)
        Column and row. [px]
    by_point : ndarray, shape (n, 2, 3)
        Derivatives by the point. [px/m]
    by_camera : ndarray, shape (n, 2, 10)
        Derivatives by `PARAMETERS`.
    """

    pixels: FloatArray
    by_point: FloatArray
    by_camera: FloatArray


def camera_matrix(focal: float, aspect: float, column: float, row: float) -> FloatArray:
    """Return K with fx = focal, fy = focal * aspect and no skew. [px]"""
    return np.array([[focal, 0.0, column], [0.0, focal * aspect, row], [0.0, 0.0, 1.0]])


def pixel_from_plane(camera: Pinhole, plane: FloatArray | None = None) -> FloatArray:
    """Return the homography from (X, Y, 1) on a plane to pixels, shape (3, 3).

    ``plane`` is (a, b, c) of z = a + b X + c Y; without it the reference plane.
    """
    lift = np.diag([1.0, 1.0, 0.0])
    if plane is not None:
        lift[2] = plane[1], plane[2], plane[0]
    lift[:, 2] -= camera.centre
    return camera.matrix @ camera.rotation @ lift


def plane_from_pixel(camera: Pinhole) -> FloatArray:
    """Return the homography from pixels to the reference plane, last element 1 unless it is 0."""
    matrix = np.linalg.inv(pixel_from_plane(camera))
    return matrix / matrix[2, 2] if abs(matrix[2, 2]) > 1e-12 else matrix


def central(vectors: FloatArray, distance: float = 1.0) -> FloatArray:
    """Return the central projection (x, y) = distance (u_x, u_y) / u_z; NaN behind the camera.

    Parameters
    ----------
    vectors : ndarray, shape (..., 3)
        u, from the projection centre to the points, or as refraction lets them seem.
    distance : float
        Principal distance: 1 for vectors that K has been applied to, in pixels; negative where the
        camera's z axis points backwards. Points before the camera have distance / u_z > 0.

    Returns
    -------
    ndarray, shape (..., 2)
        In the unit of the distance.

    Examples
    --------
    >>> central(np.array([0.5, 0.25, -2.0]), -20.0).tolist()
    [5.0, 2.5]
    """
    return _central(vectors, distance)[0]


def central_with_jacobian(
    vectors: FloatArray, distance: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Return `central` of vectors (n, 3) and its derivatives by them, shape (n, 2, 3)."""
    image, scale = _central(vectors, distance)
    by_vectors: FloatArray = np.zeros((len(vectors), 2, 3))
    by_vectors[:, 0, 0] = by_vectors[:, 1, 1] = scale
    scale = scale / -distance
    np.multiply(image[:, 0], scale, out=by_vectors[:, 0, 2])
    np.multiply(image[:, 1], scale, out=by_vectors[:, 1, 2])
    return image, by_vectors


def _central(vectors: FloatArray, distance: float) -> tuple[FloatArray, FloatArray]:
    """Return `central` and distance / u_z, the scale of the image."""
    with np.errstate(divide="ignore", over="ignore"):
        scale = distance / vectors[..., 2]
    # At depth 0 the scale is infinite, of either sign.
    if not (before := (scale > 0) & (scale < np.inf)).all():
        scale = np.where(before, scale, np.nan)
    image: FloatArray = np.empty((*vectors.shape[:-1], 2))
    np.multiply(vectors[..., 0], scale, out=image[..., 0])
    np.multiply(vectors[..., 1], scale, out=image[..., 1])
    return image, scale


def project(camera: Pinhole, xyz: FloatArray) -> FloatArray:
    """Return pixels of points (..., 3), shape (..., 2); NaN for points behind the camera."""
    return central((xyz - camera.centre) @ (camera.matrix @ camera.rotation).T)


def project_with_jacobian(camera: Pinhole, xyz: FloatArray) -> ProjectedPoints:
    """Return pixels of points (n, 3) with their derivatives; all NaN behind the camera."""
    mapped, away = camera.matrix @ camera.rotation, xyz - camera.centre
    pixels, by_mapped = central_with_jacobian(away @ mapped.T)
    by_point = (by_mapped.reshape(-1, 3) @ mapped).reshape(-1, 2, 3)
    by_camera = np.zeros((len(xyz), 2, len(PARAMETERS)))
    offset = pixels - camera.matrix[:2, 2]
    by_camera[:, :, 0] = offset
    by_camera[:, 1, 1] = offset[:, 1]
    by_camera[:, 0, 2] = by_camera[:, 1, 3] = 1.0
    # Turned by a small v the camera sees R (P - C + v x (P - C)).
    by_camera[:, :, 4:7] = by_rotation(by_point, away)
    by_camera[:, :, 7:] = -by_point
    return ProjectedPoints(pixels, by_point, by_camera)


def ray_on_plane(camera: Pinhole, pixels: FloatArray) -> FloatArray:
    """Return where rays meet the reference plane, as points of relief zero, shape (n, 3)."""
    ray = homogeneous(pixels) @ np.linalg.inv(camera.matrix).T @ camera.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ray[:, 2] < 0, -camera.centre[2] / ray[:, 2], np.nan)
    points = camera.centre + reach[:, None] * ray
    points[:, 2] = np.where(np.isfinite(points[:, 0]), 0.0, np.nan)
    return points


def homogeneous(pixels: FloatArray) -> FloatArray:
    """Return (column, row, 1), shape (n, 3)."""
    return np.column_stack([pixels, np.ones(len(pixels))])


def fundamental(first: Pinhole, second: Pinhole) -> FloatArray:
    """Return F with x2ᵀ F x1 = 0 for homogeneous pixels of one point, shape (3, 3)."""
    return fundamental_with_jacobian(first, second)[0]


def fundamental_with_jacobian(first: Pinhole, second: Pinhole) -> tuple[FloatArray, FloatArray]:
    """Return F and its derivatives by both cameras' `PARAMETERS`, shape (20, 3, 3).

    Notes
    -----
    With M = K R the rays of pixels x1, x2 are M1⁻¹ x1 and M2⁻¹ x2; they and the base b = C1 - C2
    lie in one plane: ``F = M2⁻ᵀ [b]x M1⁻¹``.
    """
    base = skew(first.centre - second.centre)
    rays, by_rays = [], []
    for camera in (first, second):
        inverse = np.linalg.inv(camera.matrix @ camera.rotation)
        rays.append(inverse)
        by_rays.append(-inverse @ _mapped_by_camera(camera) @ inverse)
    left, right = rays[1].T, rays[0]
    by_centre = left @ AXES_CROSS @ right
    by_turned = np.swapaxes(by_rays[1], 1, 2) @ base @ right
    parts = [left @ base @ by_rays[0], by_centre, by_turned, -by_centre]
    return left @ base @ right, np.concatenate(parts)


def plane_transfer(first: Pinhole, second: Pinhole, plane: FloatArray) -> FloatArray:
    """Return the homography from pixels 1 to pixels 2 over the plane z = a + b X + c Y."""
    return pixel_from_plane(second, plane) @ np.linalg.inv(pixel_from_plane(first, plane))


def plane_transfer_with_jacobian(
    first: Pinhole, second: Pinhole, plane: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return `plane_transfer` and its derivatives by both cameras and the plane, (23, 3, 3)."""
    views = [pixel_from_plane(camera, plane) for camera in (first, second)]
    back = np.linalg.inv(views[0])
    transfer = views[1] @ back
    by_camera, by_plane = [], []
    for camera, view in zip((first, second), views, strict=True):
        mapped = camera.matrix @ camera.rotation
        inner = _mapped_by_camera(camera) @ np.linalg.inv(mapped) @ view
        by_centre, by_height = np.zeros((3, 3, 3)), np.zeros((3, 3, 3))
        for axis, column in enumerate((2, 0, 1)):
            by_centre[axis, :, 2] = -mapped[:, axis]
            by_height[axis, :, column] = mapped[:, 2]
        by_camera.append(np.concatenate([inner, by_centre]))
        by_plane.append(by_height)
    parts = [-transfer @ by_camera[0], by_camera[1], by_plane[1] - transfer @ by_plane[0]]
    return transfer, np.concatenate(parts) @ back


def _mapped_by_camera(camera: Pinhole) -> FloatArray:
    """Return the derivatives of K R by the first seven of `PARAMETERS`, shape (7, 3, 3)."""
    by_matrix = np.zeros((4, 3, 3))
    by_matrix[0, 0, 0] = camera.matrix[0, 0]
    by_matrix[:2, 1, 1] = camera.matrix[1, 1]
    by_matrix[2, 0, 2] = by_matrix[3, 1, 2] = 1.0
    turned = camera.matrix @ camera.rotation @ AXES_CROSS
    return np.concatenate([by_matrix @ camera.rotation, turned])


def triangulate(
    first: Pinhole, second: Pinhole, pixels1: FloatArray, pixels2: FloatArray
) -> FloatArray:
    """Return where rays of pixels (n, 2) meet, shape (n, 3); NaN where they do not. [m]"""
    return rays_meeting((first, second), (pixels1, pixels2))


def rays_meeting(cameras: Sequence[Pinhole], pixels_of: Sequence[FloatArray]) -> FloatArray:
    """Return where the rays of two cameras or more meet, shape (n, 3); NaN where they do not. [m]

    Linear least squares, each equation in pixels times the depth of the point.
    """
    design, value = [], []
    for camera, pixels in zip(cameras, pixels_of, strict=True):
        mapped = camera.matrix @ camera.rotation
        rows = pixels[:, :, None] * mapped[2] - mapped[:2]
        design.append(rows)
        value.append(rows @ camera.centre)
    rows, side = np.concatenate(design, axis=1), np.concatenate(value, axis=1)
    normal = np.swapaxes(rows, 1, 2) @ rows
    finite = np.isfinite(normal).all(axis=(1, 2))
    finite[finite] = np.linalg.det(normal[finite]) > 0
    xyz = np.full((len(rows), 3), np.nan)
    right = np.einsum("nij,ni->nj", rows[finite], side[finite])
    xyz[finite] = np.linalg.solve(normal[finite], right[..., None])[..., 0]
    return xyz


def cameras_seeing(
    xyz: FloatArray, pixels: FloatArray, matrix: FloatArray, *, methods: Sequence[int]
) -> list[Pinhole]:
    """Return the cameras from which points are seen where they were measured: space resection.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        At least 3 points.
    pixels : ndarray, shape (n, 2)
        Free of distortion; x right, y down.
    matrix : ndarray, shape (3, 3)
        Camera matrix.
    methods : sequence of int
        OpenCV's ``SOLVEPNP_...``; those that do not take this configuration are passed over.

    Returns
    -------
    list of Pinhole
        All solutions of all methods; possibly none, or some with points behind them.
    """
    import cv2

    middle = xyz.mean(axis=0)
    scale = float(np.abs(xyz - middle).max()) or 1.0
    points, cameras = np.ascontiguousarray((xyz - middle) / scale), []
    for method in methods:
        try:
            _, turns, shifts, _ = cv2.solvePnPGeneric(
                points, np.ascontiguousarray(pixels), matrix, None, flags=method
            )
        except cv2.error:
            continue
        for turn, shift in zip(turns, shifts, strict=True):
            rotation = cv2.Rodrigues(turn)[0]
            centre = middle - scale * (rotation.T @ shift).ravel()
            if np.isfinite(centre).all() and np.isfinite(rotation).all():
                cameras.append(Pinhole(matrix, rotation, centre))
    return cameras
