"""Which way is up on the wall: from the façade's own straight lines, or two points."""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.orientation.alignment import Interior
from bifocal.orientation.pinhole import Pinhole, plane_from_pixel
from photocore.arrays import ByteArray, FloatArray

#: Façade lines farther than this from the photo's own upright are not asked. [deg]
WIDEST = 20.0


def apply(matrix: FloatArray, pixels: FloatArray) -> FloatArray:
    """Return pixels on the plane."""
    mapped = np.column_stack([pixels, np.ones(len(pixels))]) @ matrix.T
    return mapped[:, :2] / mapped[:, 2:]


def facade_turn(image: ByteArray, camera: Pinhole, interior: Interior) -> tuple[float, float]:
    """Return the turn that makes the façade's lines upright and level, and their agreement.

    Parameters
    ----------
    image : ndarray, shape (h, w)
    camera : Pinhole
    interior : Interior

    Returns
    -------
    turn : float
        Counter-clockwise turn to apply to the plane frame's axes. [rad]
    share : float
        Share of line length within 1° of it or of its perpendicular; below 0.25 trust nothing.
    """
    reduction = max(1.0, float(np.sqrt(image.size / 1.5e6)))
    size = (round(image.shape[1] / reduction), round(image.shape[0] / reduction))
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    lines = cv2.createLineSegmentDetector().detect(small)[0]
    if lines is None:
        return 0.0, 0.0
    ends: FloatArray = (np.asarray(lines, dtype=np.float64).reshape(-1, 2) + 0.5) * reduction - 0.5
    ends = np.array(apply(plane_from_pixel(camera), interior.ideal(ends))).reshape(-1, 2, 2)
    reach = 6 * camera.centre[2]
    ends = ends[(np.linalg.norm(ends - camera.centre[:2], axis=2) < reach).all(axis=1)]
    along = ends[:, 1] - ends[:, 0]
    length = np.hypot(along[:, 0], along[:, 1])
    degrees = (np.rad2deg(np.arctan2(along[:, 1], along[:, 0])) + 45.0) % 90.0 - 45.0
    near = (np.abs(degrees) < WIDEST) & (length > 0.01 * camera.centre[2])
    degrees, weight = degrees[near], length[near] ** 1.5
    if len(degrees) < 20:
        return 0.0, 0.0
    trial = np.arange(-WIDEST, WIDEST, 0.05)
    votes = np.exp(-0.5 * ((trial[:, None] - degrees) / 0.4) ** 2) @ weight
    best = trial[votes.argmax()]
    for _ in range(3):
        close = np.abs(degrees - best) < 1.0
        best = float(np.average(degrees[close], weights=weight[close]))
    return float(np.deg2rad(best)), float(weight[close].sum() / weight.sum())


def turned(camera: Pinhole, turn: float, origin: FloatArray) -> Pinhole:
    """Return the camera in axes turned counter-clockwise about an origin on the plane."""
    cosine, sine = np.cos(turn), np.sin(turn)
    new_from_old = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    moved = camera.centre - np.append(origin, 0.0)
    return camera._replace(rotation=camera.rotation @ new_from_old.T, centre=new_from_old @ moved)
