"""Where a camera stands and looks, as a project file may say it: angles, matrix or quaternion."""

from __future__ import annotations

import numpy as np

from multimedia.media import EXTERIOR
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import (
    checked_rotation,
    nearest_rotation,
    rotation_from_quaternion,
    world_from_camera,
)
from photocore.errors import InputError
from photocore.sections import FileSection

#: Keys of a pose beside ``centre``; one of the ways, or the three angles.
WAYS = ("rotation", "quaternion", "pose", "camera_from_world")
POSE_KEYS = ("centre", *EXTERIOR[3:], *WAYS, "axes")
#: Camera frame with y down and z forwards (OpenCV, COLMAP, Metashape) from ours, and back.
FLIP = np.diag([1.0, -1.0, -1.0])
_AXES = ("photogrammetric", "opencv")
#: Printed matrices have some seven decimals.
_PRINTED = 1e-5


def read_pose(value: FileSection) -> tuple[FloatArray, FloatArray]:
    """Return the projection centre and the world-from-camera rotation of a camera's section.

    Raises
    ------
    InputError
        If no way or more than one of stating the rotation is used, or a number is missing.
    GeometryError
        If the numbers are no rotation.
    """
    where = value.where
    ways = [key for key in WAYS if key in value]
    angles = [key for key in EXTERIOR[3:] if key in value]
    if len(ways) > 1 or (ways and angles):
        raise InputError(
            remark("project.rotation_twice", of=where, names=", ".join([*ways, *angles]))
        )
    axes = value.get("axes", _AXES[0])
    if axes not in _AXES:
        raise InputError(f"{where}: axes must be one of {', '.join(_AXES)}, found {axes!r:.40}.")
    if not ways:
        if "axes" in value:
            raise InputError(f"{where}: axes belongs to a matrix or quaternion; angles have ours.")
        return value.numbers("centre", (3,)), _from_angles(value)
    centre, rotation = _from_matrix(value, ways[0])
    return centre, rotation @ FLIP if axes == "opencv" else rotation


def _from_angles(value: FileSection) -> FloatArray:
    """Return the rotation by omega, phi and kappa in degrees."""
    if lost := [key for key in EXTERIOR[3:] if key not in value]:
        raise InputError(
            f"{value.where}: the key {lost[0]!r} is missing; a camera's rotation is omega, phi, "
            f"kappa or one of {', '.join(WAYS)}."
        )
    angles = np.array([value.number(key) for key in EXTERIOR[3:]])
    if (np.abs(angles) > 720.0).any():
        raise InputError(remark("project.degrees", of=value.where, angles=angles.tolist()))
    # Whole turns do not matter.
    turns = np.radians(np.remainder(angles + 180.0, 360.0) - 180.0)
    return world_from_camera(*(float(a) for a in turns))


def _from_matrix(value: FileSection, way: str) -> tuple[FloatArray, FloatArray]:
    """Return centre and rotation as one of `WAYS` states them, in the file's camera axes."""
    what = f"{value.where}, {way}"
    if way == "quaternion":
        parts = value.numbers(way, (4,))
        return value.numbers("centre", (3,)), rotation_from_quaternion(parts, what)
    if way == "rotation":
        rotation = _rotation(value.numbers(way, (3, 3)), what)
        return value.numbers("centre", (3,)), rotation
    matrix = value.numbers(way, (3, 4), (4, 4))
    if "centre" in value:
        raise InputError(f"{what}: has the place in its last column; leave centre out.")
    if len(matrix) == 4 and not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise InputError(f"{what}: its last row must be 0, 0, 0, 1; is it given column by column?")
    rotation = _rotation(matrix[:3, :3], what)
    if way == "pose":
        return matrix[:3, 3], rotation
    return -rotation.T @ matrix[:3, 3], rotation.T


def _rotation(matrix: FloatArray, what: str) -> FloatArray:
    """Return a matrix that is a rotation but for its printed decimals as one that is."""
    checked = checked_rotation(matrix, what, tolerance=_PRINTED)
    return nearest_rotation(checked)
