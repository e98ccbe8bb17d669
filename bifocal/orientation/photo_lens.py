"""A lens as one photo sees it: scaled with a resized photo, turned with a turned camera."""

from __future__ import annotations

import numpy as np

from bifocal.model.lens import Lens
from photocore.arrays import FloatArray
from photocore.errors import InputError

#: Upright pixel from stored pixel for each EXIF orientation: the linear part.
_TURNS = {
    1: ((1, 0), (0, 1)), 2: ((-1, 0), (0, 1)), 3: ((-1, 0), (0, -1)), 4: ((1, 0), (0, -1)),
    5: ((0, 1), (1, 0)), 6: ((0, -1), (1, 0)), 7: ((0, -1), (-1, 0)), 8: ((0, 1), (-1, 0)),
}  # fmt: skip


def lens_of_photo(lens: Lens, size: tuple[int, int], *, orientation: int = 1) -> Lens:
    """Return the lens for an upright photo of a given size.

    Parameters
    ----------
    lens : Lens
        Calibrated on photos as the sensor gives them, or upright ones of the same size.
    size : tuple of int
        Width and height of the upright photo. [px]
    orientation : int
        EXIF orientation of the stored photo.

    Raises
    ------
    InputError
        If the photo is not a resized or turned version of the calibrated format.
    """
    if size == lens.image_size:
        return lens
    stored = (size[1], size[0]) if orientation >= 5 else size
    factor = stored[0] / lens.image_size[0]
    if abs(stored[1] / lens.image_size[1] / factor - 1) > 0.002:
        raise InputError(
            f"the lens was calibrated on photos of {lens.image_size[0]} x {lens.image_size[1]} px, "
            f"this photo has {size[0]} x {size[1]}: it was cropped, or is of another camera. Use "
            "the uncropped photo, or calibrate with photos like this one."
        )
    matrix = np.diag([factor, factor, 1.0]) @ lens.camera_matrix
    matrix[:2, 2] += (factor - 1.0) / 2.0  # pixel centres are at integers
    turn = np.array(_TURNS[orientation], dtype=np.float64)
    coefficients = np.array(lens.coefficients)
    if orientation != 1:
        matrix = _turned_matrix(matrix, turn, size)
        coefficients = _turned_coefficients(lens, coefficients, turn)
    return Lens(
        camera_matrix=matrix,
        coefficients=coefficients,
        model=lens.model,
        image_size=size,
        sigma0=lens.sigma0,
        source=f"{lens.source} (resized or turned)".strip(),
    )


def _turned_matrix(matrix: FloatArray, turn: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Return the camera matrix after turning the pixels about the photo's middle."""
    last = np.array([size[0] - 1.0, size[1] - 1.0])
    stored_last = np.abs(turn.T) @ last
    centre = turn @ (matrix[:2, 2] - stored_last / 2) + last / 2
    focal = np.abs(turn) @ np.diag(matrix)[:2]
    return np.array([[focal[0], 0.0, centre[0]], [0.0, focal[1], centre[1]], [0.0, 0.0, 1.0]])


def _turned_coefficients(lens: Lens, coefficients: FloatArray, turn: FloatArray) -> FloatArray:
    """Return coefficients after turning: radial ones stay, (p2, p1) turns like a vector."""
    if lens.model == "fisheye" or not len(coefficients):
        return coefficients
    if len(coefficients) > 8:
        raise InputError(
            "a lens with thin-prism or tilt terms cannot be turned with an EXIF-turned photo; "
            "calibrate with photos turned the same way."
        )
    tangential = turn @ np.array([coefficients[3], coefficients[2]])
    coefficients[2], coefficients[3] = tangential[1], tangential[0]
    return coefficients
