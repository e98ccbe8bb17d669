"""A camera's pose as matrix or quaternion in the project file, by conventions written out here."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from multimedia import Camera, GeometryError, InputError, project, read_project
from photocore.camera.rotation import quaternion_from_rotation, rotation_from_quaternion

CENTRE, RVEC = np.array([0.3, -0.2, 1.1]), np.array([2.9, 0.4, -0.3])
POINTS = np.array([[0.1, 0.05, -0.2], [-0.1, 0.2, 0.1], [0.3, 0.0, 0.0], [0.0, -0.1, -0.3]])
#: OpenCV's pose: x_camera = R x_world + T, y down, z forwards.
R = cv2.Rodrigues(RVEC)[0]
T = -R @ CENTRE
C_MM, PITCH = 25.0, 0.01
BEGIN = """format = "multimedia-project/1"
[[camera]]
c = 25.0
sensor = { width = 2000, height = 1500, pitch = 0.01 }
"""


def quaternion(rotation: np.ndarray) -> list[float]:
    """Return w, x, y, z by axis and angle, as OpenCV finds them."""
    vector = cv2.Rodrigues(rotation)[0].ravel()
    angle = np.linalg.norm(vector)
    return [np.cos(angle / 2), *(vector / angle * np.sin(angle / 2))]


def read(tmp_path: Path, pose: str) -> Camera:
    path = tmp_path / "p.toml"
    path.write_text(BEGIN + pose + "\n")
    return read_project(path).cameras[0]


def line(key: str, value: np.ndarray) -> str:
    return f"{key} = {np.asarray(value).tolist()}"


OURS = R.T @ np.diag([1.0, -1.0, -1.0])
WAYS = {
    "rotation": [line("centre", CENTRE), line("rotation", OURS)],
    "quaternion": [line("centre", CENTRE), line("quaternion", quaternion(OURS))],
    "pose": [line("pose", np.column_stack([OURS, CENTRE]))],
    "opencv rotation": [line("centre", CENTRE), line("rotation", R.T), 'axes = "opencv"'],
    "opencv quaternion": [
        line("centre", CENTRE), line("quaternion", quaternion(R.T)), 'axes = "opencv"',
    ],
    "opencv extrinsics": [line("camera_from_world", np.column_stack([R, T])), 'axes = "opencv"'],
    "opencv 4 x 4": [
        line("camera_from_world", np.vstack([np.column_stack([R, T]), [0, 0, 0, 1]])),
        'axes = "opencv"',
    ],
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_every_way_gives_the_camera_that_opencv_projects_with(tmp_path, way):
    camera = read(tmp_path, "\n".join(WAYS[way]))
    matrix = np.array([[C_MM / PITCH, 0, 999.5], [0, C_MM / PITCH, 749.5], [0, 0, 1]])
    theirs = cv2.projectPoints(POINTS, RVEC, T, matrix, None)[0].reshape(-1, 2)
    ours = camera.sensor.pixel_from_image(project(camera, POINTS))
    assert np.abs(ours - theirs).max() < 1e-9


def test_quaternions_come_back_from_any_rotation():
    rng = np.random.default_rng(2)
    for q in [*rng.standard_normal((50, 4)), *np.eye(4), [1e-9, 1, 0, 0], [0, 0.6, -0.8, 0]]:
        unit = np.array(q) / np.linalg.norm(q)
        back = quaternion_from_rotation(rotation_from_quaternion(unit))
        assert np.abs(np.abs(back @ unit) - 1.0) < 1e-15


@pytest.mark.parametrize(
    ("pose", "error", "message"),
    [
        ("centre = [0, 0, 1]", InputError, "rotation is omega, phi, kappa or one of"),
        ("centre = [0, 0, 1]\nomega = 1\nquaternion = [1, 0, 0, 0]", InputError, "more than once"),
        ("centre = [0, 0, 1]\nquaternion = [1, 0, 0]", InputError, "must be 4 numbers"),
        ("centre = [0, 0, 1]\nquaternion = [1, 1, 0, 0]", GeometryError, "of length 1, found 1.41"),
        ("centre = [0, 0, 1]\nrotation = [[1, 0, 0], [0, 1, 0]]", InputError, "3 rows of 3"),
        ("centre = [0, 0, 1]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", GeometryError,
         "mirrors"),
        ("pose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [5, 6, 7, 1]]", InputError,
         "column by column"),
        ("centre = [0, 0, 1]\npose = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1]]", InputError,
         "leave centre out"),
        ("centre = [0, 0, 1]\nrotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\naxes = 'up'",
         InputError, "axes must be one of"),
    ],
)  # fmt: skip
def test_what_is_no_pose_is_named(tmp_path, pose, error, message):
    with pytest.raises(error, match=message):
        read(tmp_path, pose)
