"""Two photos set up against each other: common points, the dominant plane, both cameras.

Nothing but the photos and what is known of the lenses; the scale is one unit of far distance. What
the photos cannot give is refused with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model.pair import apply_homography
from bifocal.orientation.features import Features, drop_repeated, match_features
from bifocal.orientation.interior_orientation import Cameras, Interiors
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, fundamental, homogeneous, triangulate
from photocore.errors import GeometryError

#: Fewer common points than this and any two photos may seem to match by chance.
FEWEST_MATCHES = 40
#: A plane that holds a smaller share of the common points is not "the wall".
FEWEST_ON_PLANE = 0.12


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ties:
    """Common points of two photos, ideal pixels.

    Attributes
    ----------
    pixels1, pixels2 : ndarray, shape (m, 2)
    homography : ndarray, shape (3, 3)
        Photo 2 from photo 1 over the dominant plane.
    on_plane : ndarray of bool, shape (m,)
    tolerance : float
        Precision the points were judged with. [px]
    """

    pixels1: FloatArray
    pixels2: FloatArray
    homography: FloatArray
    on_plane: BoolArray
    tolerance: float

    @property
    def parallax(self) -> FloatArray:
        """How far the points leave the plane in photo 2, shape (m,). [px]"""
        on_plane = apply_homography(self.homography, self.pixels1)
        return np.linalg.norm(self.pixels2 - on_plane, axis=1)


def find_ties(
    first: Features, second: Features, interiors: Interiors, names: tuple[str, str]
) -> Ties:
    """Match features and keep those that obey one epipolar geometry.

    Raises
    ------
    GeometryError
        If the photos have too little in common, or no dominant plane.
    """
    rows1, rows2 = match_features(first, second)
    x1, x2 = first.pixels[rows1], second.pixels[rows2]
    keep = drop_repeated(x1, x2)
    x1, x2 = interiors[0].ideal(x1[keep]), interiors[1].ideal(x2[keep])
    tolerance = 1.5 * max(first.reduction, second.reduction)
    # Unknown lens distortion bends epipolar lines by some pixels.
    if max(interior.sigma_radial for interior in interiors) > 0:
        tolerance = max(tolerance, 0.0012 * max(interiors[0].image_size))
    agree = _one_geometry(x1, x2, tolerance)
    count = int(agree.sum())
    if count < FEWEST_MATCHES or count < 0.08 * len(x1):
        raise GeometryError(
            f"{names[0]} and {names[1]} have too little in common ({count} matching details of "
            f"{min(len(first.pixels), len(second.pixels))}): they show different walls, or one is "
            "blurred, or they were taken from very different directions. Check that both show the "
            "same wall."
        )
    x1, x2 = x1[agree], x2[agree]
    homography, on_plane = _dominant_plane(x1, x2, 1.5 * tolerance, 8000)
    if on_plane.sum() < max(FEWEST_ON_PLANE * count, 20):
        raise GeometryError(
            f"no plane: only {int(on_plane.sum())} of {count} common points lie on one plane. The "
            "method needs a wall as reference. Frame the photos so that the wall fills them, or "
            "give control points on the wall (--control)."
        )
    return Ties(
        pixels1=x1, pixels2=x2, homography=homography, on_plane=on_plane, tolerance=tolerance
    )


def _one_geometry(x1: FloatArray, x2: FloatArray, tolerance: float) -> BoolArray:
    """Return which matches obey one fundamental matrix or one homography (a flat wall)."""
    if len(x1) < 8:
        return np.zeros(len(x1), dtype=bool)
    cv2.setRNGSeed(7)
    _, on_plane = _dominant_plane(x1, x2, tolerance, 4000)
    matrix, mask = cv2.findFundamentalMat(x1, x2, cv2.USAC_MAGSAC, tolerance, 0.9999, 4000)
    agree = np.zeros(len(x1), bool) if matrix is None else mask.ravel().astype(bool)
    # A flat scene leaves F free: there the homography is the better witness.
    return agree if agree.sum() > 1.1 * on_plane.sum() else agree | on_plane


def _dominant_plane(
    x1: FloatArray, x2: FloatArray, tolerance: float, iterations: int
) -> tuple[FloatArray, BoolArray]:
    """Return the dominant homography and its points."""
    matrix, mask = cv2.findHomography(
        x1, x2, cv2.USAC_MAGSAC, tolerance, maxIters=iterations, confidence=0.9999
    )
    if matrix is None:
        return np.eye(3), np.zeros(len(x1), dtype=bool)
    return np.asarray(matrix, dtype=np.float64), mask.ravel().astype(bool)


def plane_scale(ties: Ties, image_size: tuple[int, int]) -> float:
    """Return the scale of photo 2 against photo 1 on the plane, at its points' middle."""
    middle = np.median(ties.pixels1[ties.on_plane], axis=0)
    step = 0.01 * max(image_size)
    corners = middle + step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    moved = apply_homography(ties.homography, corners)
    area = abs(np.linalg.det(np.stack([moved[0] - moved[1], moved[2] - moved[3]])))
    return float(np.sqrt(area) / (2 * step))


def first_cameras(ties: Ties, interiors: Interiors) -> Cameras:
    """Return approximate cameras in the frame of the dominant plane, far distance 1.

    Notes
    -----
    The homography between calibrated photos is ``R + t nᵀ / d``: up to four decompositions. The one
    in which the common points lie in front of both cameras and on their epipolar lines is it.
    """
    matrices = [interior.matrix for interior in interiors]
    _, turns, shifts, normals = cv2.decomposeHomographyMat(
        np.linalg.inv(matrices[1]) @ ties.homography @ matrices[0], np.eye(3)
    )
    cameras = [
        _in_plane_frame(matrices, turn, sign * shift.ravel(), sign * normal.ravel())
        for turn, shift, normal in zip(turns, shifts, normals, strict=True)
        for sign in (1.0, -1.0)
    ]
    possible = [pair for pair in cameras if pair is not None]
    if not possible:
        raise GeometryError(
            "the two photos give no camera in front of the wall. Check the focal lengths "
            "(--focal1, --focal2) and that both photos show the same wall."
        )
    return min(possible, key=lambda pair: _cost(ties, pair))


def _in_plane_frame(
    matrices: list[FloatArray], turn: FloatArray, shift: FloatArray, normal: FloatArray
) -> Cameras | None:
    """Return both cameras in a frame on the plane, Y as upright as photo 1 is."""
    if normal[2] <= 0.05:  # the plane must be in front of camera 1
        return None
    z_axis = -normal / np.linalg.norm(normal)
    up = np.array([0.0, -1.0, 0.0])
    y_axis = up - (up @ z_axis) * z_axis
    if np.linalg.norm(y_axis) < 0.1:
        return None
    y_axis /= np.linalg.norm(y_axis)
    rotation1 = np.stack([np.cross(y_axis, z_axis), y_axis, z_axis], axis=1)
    centre1 = np.array([0.0, 0.0, 1.0])
    centre2 = centre1 + rotation1.T @ (-turn.T @ shift)
    if centre2[2] <= 0.02:
        return None
    return (
        Pinhole(matrices[0], rotation1, centre1),
        Pinhole(matrices[1], turn @ rotation1, centre2),
    )


def _cost(ties: Ties, cameras: Cameras) -> float:
    """Return a robust cost: epipolar misfit, and points behind a camera."""
    line = homogeneous(ties.pixels1) @ fundamental(*cameras).T
    misfit = np.abs((homogeneous(ties.pixels2) * line).sum(1)) / np.maximum(
        np.hypot(line[:, 0], line[:, 1]), 1e-300
    )
    xyz = triangulate(*cameras, ties.pixels1, ties.pixels2)
    lowest = min(camera.centre[2] for camera in cameras)
    behind = ~(xyz[:, 2] < lowest) & ~ties.on_plane
    wide = 4 * ties.tolerance
    return float(np.minimum(np.nan_to_num(misfit, nan=wide), wide).sum() + wide * behind.sum())


def rotation_only(ties: Ties, interiors: Interiors) -> bool:
    """Return whether the photos differ only by turning and zooming the camera (no movement).

    The homography between calibrated photos taken from one place is a rotation, whatever they show.
    """
    matrices = [interior.matrix for interior in interiors]
    joined = np.linalg.inv(matrices[1]) @ ties.homography @ matrices[0]
    values = np.linalg.svd(joined, compute_uv=False)
    slack = 0.02 + 2 * float(np.hypot(interiors[0].sigma_focal, interiors[1].sigma_focal))
    return bool(values[0] / values[2] - 1 < slack)
