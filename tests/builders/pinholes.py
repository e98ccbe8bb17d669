"""Pinhole cameras worked out apart from the package: turns, matrices and what they see."""

import numpy as np
from scipy.spatial.transform import Rotation

from bifocal import Pinhole


def camera_matrix(focal: float, aspect: float, column: float, row: float) -> np.ndarray:
    """Return K with fx = focal, fy = focal * aspect and no skew. [px]"""
    return np.array([[focal, 0.0, column], [0.0, focal * aspect, row], [0.0, 0.0, 1.0]])


def rotation_from_vector(vector: np.ndarray | list[float]) -> np.ndarray:
    """Return the rotation about a vector by its length, shape (3, 3)."""
    return Rotation.from_rotvec(vector).as_matrix()


def project(camera: Pinhole, xyz: np.ndarray) -> np.ndarray:
    """Return pixels of points in front of a camera, shape (..., 2)."""
    seen = (xyz - camera.centre) @ camera.rotation.T @ camera.matrix.T
    return seen[..., :2] / seen[..., 2:]
