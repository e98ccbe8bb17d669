"""OpenCV's calibrations: FileStorage YAML, XML or JSON, and plain JSON, one camera or two.

Names of keys are no standard; those of OpenCV's own samples and tutorials are understood. A pose
is ``R`` and ``T`` or ``rvec`` and ``tvec``, camera from world. ``fisheye_model: 1`` (OpenCV's own
sample) or ``distortion_model: equidistant`` (ROS, Kalibr) says that k1 to k4 are a fisheye's. A
stereo file has K1 D1 K2 D2 R T (or M1 ...): the second camera from the first, whose frame is
the world's.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.exchange.opencv_camera import OpencvCamera, camera_of, left_out, opencv_of
from multimedia.media import Camera
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import (
    FISHEYE_KEY,
    LensData,
    checked_rotation,
    opencv_values,
    rotation_from_vector,
)
from photocore.errors import InputError
from photocore.output import atomic_folder, atomic_path
from photocore.textfile import check_name

ENDINGS = (".yml", ".yaml", ".json", ".xml")
_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M", "mtx", "intrinsic_matrix")
_TERMS = ("distortion_coefficients", "dist_coeffs", "distCoeffs", "Distortion_Coefficients", "D",
          "dist", "distortion")  # fmt: skip
_TURN = ("R", "rotation", "rotation_matrix", "rvec", "rotation_vector")
_SHIFT = ("T", "t", "translation", "tvec", "translation_vector")
_WIDTH = ("image_width", "image_Width", "width")
_HEIGHT = ("image_height", "image_Height", "height")
_SIZE = ("image_size", "imageSize", "size", "resolution")

#: Returns the value of a key as numbers, None where there is none.
_Get = Callable[[str], FloatArray | None]


def read_opencv(path: Path, *, pitch: float, unit: str) -> Project:
    """Return the project of a calibration file, or of all in a folder, one camera each.

    Raises
    ------
    InputError
        Naming the key that is missing or damaged.
    """
    check_name(path)
    files = [path]
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in ENDINGS)
    cameras: list[Camera] = []
    remarks: list[str] = []
    for file in files:
        of_file, notes = _cameras(file, opencv_values(file).get, pitch)
        cameras += of_file
        remarks += notes
    if not cameras:
        raise InputError(f"{path}: holds no calibration ({', '.join(ENDINGS)}).")
    return Project(
        cameras=tuple(cameras), sigma_image=0.5 * pitch, unit=unit, name=path.stem,
        extra={"source": "OpenCV"}, remarks=tuple(remarks),
    )  # fmt: skip


def write_opencv(path: Path, project: Project, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write one camera into a .yml, .yaml or .json file, several into a folder of .yml files."""
    views = {camera.name: opencv_of(camera) for camera in project.cameras}
    single = path.suffix.lower() in (".yml", ".yaml", ".json")
    if single and len(views) > 1:
        raise InputError(remark("exchange.one_camera_a_file", of=path, count=len(views)))
    odd = [name for name in views if not single and Path(name).name != name]
    if odd:
        raise InputError(remark("exchange.no_file_name", of=path, name=odd[0]))
    texts = {name: _calibration_text(path, view) for name, view in views.items()}
    if single:
        with atomic_path(path, overwrite=overwrite) as temporary:
            temporary.write_text("".join(texts.values()), encoding="utf-8")
    else:
        with atomic_folder(path, overwrite=overwrite) as folder:
            for name, text in texts.items():
                (folder / f"{name}.yml").write_text(text, encoding="utf-8")
    return left_out(project, views, "OpenCV", "calibrations")


def _calibration_text(path: Path, view: OpencvCamera) -> str:
    """Return the calibration of a camera; JSON if the file's name says so, else YAML."""
    import cv2

    form = "JSON" if path.suffix.lower() == ".json" else "YAML"
    flags = cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY
    storage = cv2.FileStorage("", flags | getattr(cv2, f"FILE_STORAGE_FORMAT_{form}"))
    storage.write("image_width", view.size[0])
    storage.write("image_height", view.size[1])
    storage.write("camera_matrix", view.matrix)
    storage.write("distortion_coefficients", view.coefficients[None])
    storage.write("R", np.ascontiguousarray(view.rotation))
    storage.write("T", view.translation[:, None])
    if view.fisheye:
        storage.write(FISHEYE_KEY, 1)
    return str(storage.releaseAndGetString())


def _cameras(path: Path, get: _Get, pitch: float) -> tuple[list[Camera], list[str]]:
    """Return the camera of a file, or the two of a stereo file, and remarks."""
    size: Any = _first(get, *_SIZE)
    width, height = _first(get, *_WIDTH), _first(get, *_HEIGHT)
    if size is None and width is not None and height is not None:
        size = np.array([width.item(), height.item()])
    if size is None or size.size != 2:
        raise InputError(f"{path}: lacks image_width and image_height; add both.")
    flag = get(FISHEYE_KEY)
    fisheye = flag is not None and bool(np.any(flag))
    turn, shift = _first(get, *_TURN), _first(get, *_SHIFT)
    numbers = ("1", "2") if _first(get, "K1", "M1", "camera_matrix1") is not None else ("",)
    cameras = []
    for number in numbers:
        matrix = _first(get, *(key + number for key in _MATRIX))
        terms = _first(get, *(key + number for key in _TERMS))
        if matrix is None or matrix.shape != (3, 3):
            raise InputError(f"{path}: lacks camera_matrix{number} (3 x 3).")
        model, count = ("fisheye", 4) if fisheye else ("opencv", 5)
        terms = np.zeros(count) if terms is None else np.ravel(terms)
        lens = LensData(matrix, terms, model, tuple(size.ravel().tolist()), f"OpenCV, {path.name}")
        here = number != "1" and turn is not None and shift is not None
        rotation, translation = _pose(path, turn, shift) if here else (np.eye(3), np.zeros(3))
        name = f"{path.stem}{number}"
        cameras.append(camera_of(lens, rotation, translation, pitch=pitch, name=name))
    if turn is None or shift is None:
        return cameras, [f"{path.name}: has no pose (R and T); its camera stands in the origin."]
    return cameras, []


def _pose(
    path: Path, turn: FloatArray | None, shift: FloatArray | None
) -> tuple[FloatArray, FloatArray]:
    """Return a pose from a matrix or Rodrigues' vector, and a translation."""
    if turn is None or shift is None or shift.size != 3 or turn.size not in (3, 9):
        raise InputError(f"{path}: R must be 3 x 3 or a vector of 3, T a vector of 3.")
    if turn.size == 3:
        return rotation_from_vector(np.ravel(turn)), np.ravel(shift)
    return checked_rotation(turn.reshape(3, 3), f"{path}: R"), np.ravel(shift)


def _first(get: _Get, *names: str) -> FloatArray | None:
    return next((value for name in names if (value := get(name)) is not None), None)
