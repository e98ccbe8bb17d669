"""A pinhole camera in the plane frame, and the homography, nadir and distance that replace it.

The plane frame has Z = 0 on the reference plane and Z up towards the cameras, so a camera at
C = (N, d) with camera matrix K and rotation R (``x_camera = R (P - C)``, z forwards) sees the plane
through ``pixel ~ K R [e1 e2 -C] (X, Y, 1)``. Conversely that homography together with N and d gives
K and R back: eight numbers and three are the eleven of a pinhole camera.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from photocore.arrays import FloatArray


class Pinhole(NamedTuple):
    """Camera matrix (3, 3) [px], rotation camera from plane frame (3, 3), centre (3,) [m]."""

    matrix: FloatArray
    rotation: FloatArray
    centre: FloatArray


def camera_matrix(focal: float, aspect: float, column: float, row: float) -> FloatArray:
    """Return K with fx = focal, fy = focal * aspect and no skew. [px]"""
    return np.array([[focal, 0.0, column], [0.0, focal * aspect, row], [0.0, 0.0, 1.0]])


def rotation_matrix(vector: FloatArray) -> FloatArray:
    """Return the rotation by |vector| radians about vector (Rodrigues), exact at zero."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(a)/a and (1 - cos a)/a² through sinc: no division by zero.
    sine = np.sinc(angle / np.pi)
    half = np.sinc(angle / (2 * np.pi))
    return np.eye(3) + sine * cross + 0.5 * half**2 * (cross @ cross)


def pixel_from_plane(camera: Pinhole) -> FloatArray:
    """Return the homography from (X, Y, 1) on the reference plane to pixels, shape (3, 3)."""
    columns = np.eye(3)
    columns[:, 2] = -camera.centre
    return camera.matrix @ camera.rotation @ columns


def plane_from_pixel(camera: Pinhole) -> FloatArray:
    """Return the homography from pixels to the reference plane, largest element 1 in size."""
    matrix = np.linalg.inv(pixel_from_plane(camera))
    return matrix / matrix[2, 2] if abs(matrix[2, 2]) > 1e-12 else matrix


def pinhole_from_plane(matrix: FloatArray, nadir: FloatArray, distance: float) -> Pinhole:
    """Return the camera of a plane-from-pixel homography, nadir and distance.

    Notes
    -----
    ``K R = inv(H) inv([e1 e2 -C])`` up to scale; its RQ decomposition with a positive diagonal and
    det R = +1 is unique.

    Examples
    --------
    >>> camera = Pinhole(camera_matrix(2000.0, 1.0, 50.0, 40.0), np.diag([1.0, -1.0, -1.0]),
    ...                  np.array([1.0, 2.0, 10.0]))
    >>> back = pinhole_from_plane(plane_from_pixel(camera), np.array([1.0, 2.0]), 10.0)
    >>> float(abs(back.matrix - camera.matrix).max()) < 1e-9
    True
    """
    centre = np.array([nadir[0], nadir[1], distance])
    columns = np.eye(3)
    columns[:, 2] = -centre
    product = np.linalg.inv(matrix) @ np.linalg.inv(columns)
    upper, rotation = _rq(product)
    signs = np.sign(np.diag(upper))
    upper, rotation = upper * signs, signs[:, None] * rotation
    if np.linalg.det(rotation) < 0:  # the homography's sign is free, the camera's is not
        rotation = -rotation
    return Pinhole(upper / upper[2, 2], rotation, centre)


def _rq(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return upper triangular and orthogonal factors: matrix = upper @ orthogonal."""
    flip = np.eye(3)[::-1]
    q, r = np.linalg.qr((flip @ matrix).T)
    return flip @ r.T @ flip, flip @ q.T


def project(camera: Pinhole, xyz: FloatArray) -> FloatArray:
    """Return pixels of points (..., 3), shape (..., 2); NaN for points behind the camera."""
    seen = (xyz - camera.centre) @ camera.rotation.T
    depth = seen[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ray = np.where((depth > 0)[..., None], seen[..., :2] / depth[..., None], np.nan)
    focal = np.array([camera.matrix[0, 0], camera.matrix[1, 1]])
    skew = camera.matrix[0, 1] * ray[..., 1]
    pixels = ray * focal + camera.matrix[:2, 2]
    pixels[..., 0] += skew
    return pixels


def projection_rows(camera: Pinhole, xyz: FloatArray) -> FloatArray:
    """Return the derivative of the pixel by the point, shape (n, 2, 3). [px/m]"""
    seen = (xyz - camera.centre) @ camera.rotation.T
    depth = seen[:, 2]
    mapped = camera.matrix @ camera.rotation
    pixels = project(camera, xyz)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (mapped[None, :2] - pixels[:, :, None] * mapped[None, None, 2]) / depth[
            :, None, None
        ]


def fundamental(first: Pinhole, second: Pinhole) -> FloatArray:
    """Return F with x2ᵀ F x1 = 0 for homogeneous pixels of one point, shape (3, 3)."""
    joined = second.matrix @ second.rotation @ first.rotation.T @ np.linalg.inv(first.matrix)
    x, y, z = second.matrix @ second.rotation @ (first.centre - second.centre)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return cross @ joined


def plane_transfer(first: Pinhole, second: Pinhole, plane: FloatArray) -> FloatArray:
    """Return the homography from pixels 1 to pixels 2 over the plane z = a + b X + c Y."""
    lift = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [plane[1], plane[2], plane[0]]])
    views = []
    for camera in (first, second):
        shifted = lift.copy()
        shifted[:, 2] -= camera.centre
        views.append(camera.matrix @ camera.rotation @ shifted)
    return views[1] @ np.linalg.inv(views[0])


def tilt(camera: Pinhole) -> FloatArray:
    """Return the optical axis' X and Y components per unit towards the wall, shape (2,).

    (0, 0) for an image plane parallel to the wall; (tan a, 0) for a camera looking a to the right.
    """
    axis = camera.rotation[2]
    return axis[:2] / -axis[2]


def triangulate(
    first: Pinhole, second: Pinhole, pixels1: FloatArray, pixels2: FloatArray
) -> FloatArray:
    """Return where two rays meet, shape (n, 3): linear, each equation in units of a pixel."""
    rows = []
    for camera, pixels in ((first, pixels1), (second, pixels2)):
        mapped = camera.matrix @ camera.rotation
        offset = -mapped @ camera.centre
        for axis in (0, 1):
            left = pixels[:, axis, None] * mapped[2] - mapped[axis]
            right = offset[axis] - pixels[:, axis] * offset[2]
            rows.append((left, right))
    design = np.stack([left for left, _ in rows], axis=1)
    value = np.stack([right for _, right in rows], axis=1)
    normal = design.transpose(0, 2, 1) @ design
    side = np.einsum("nij,ni->nj", design, value)
    with np.errstate(invalid="ignore"):
        bad = ~np.isfinite(normal).all(axis=(1, 2)) | (
            np.abs(np.linalg.det(np.nan_to_num(normal))) <= 0
        )
    normal[bad] = np.eye(3)
    xyz = np.linalg.solve(normal, side[..., None])[..., 0]
    xyz[bad] = np.nan
    return xyz
