"""``transforms.json`` of instant-ngp, nerfstudio and their kin.

Matrices lead from the camera into the world, x right, y up, z backwards (OpenGL); intrinsics stand
once or in every frame, pixels counted from the corner (nerfstudio's Data conventions).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from photocore.camera import LensData, checked_rotation, lens_data, nearest_rotation
from photocore.errors import InputError
from photocore.programs.json_values import JsonValue
from photocore.programs.model import ForeignProject, ForeignView
from photocore.programs.photos import PhotoFinder
from photocore.remarks import remark

#: From OpenGL's axes of a camera.
TURN = np.diag([1.0, -1.0, -1.0])
_FISHEYES = ("OPENCV_FISHEYE", "FISHEYE")
_FLAT = ("", "OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "SIMPLE_RADIAL", "RADIAL")


def read_nerf(path: Path, value: JsonValue, photos: PhotoFinder) -> ForeignProject:
    """Return the photos of a ``transforms.json``; no points.

    Raises
    ------
    InputError
        Naming the key that is missing or wrong.
    """
    views = []
    for frame in value["frames"].each():
        name = frame["file_path"].text().replace("\\", "/").removeprefix("./")
        matrix = frame["transform_matrix"].numbers(-1, 4)
        if matrix.shape not in ((3, 4), (4, 4)):
            raise frame["transform_matrix"].wrong("4 x 4 numbers")
        turn = checked_rotation(matrix[:3, :3], f"{path}: matrix of {name}", tolerance=1e-4)
        keys = {key: one.value for key, one in (*value.items(), *frame.items())}
        lens = _lens(JsonValue(keys, frame.where), name, path, photos)
        views.append(ForeignView(name, lens, TURN @ nearest_rotation(turn).T, matrix[:3, 3]))
    if not views:
        raise InputError(remark("programs.no_pose", of=path))
    return ForeignProject("NeRF", tuple(views))


def _lens(camera: JsonValue, name: str, path: Path, photos: PhotoFinder) -> LensData:
    kind = camera.get("camera_model", "").text().upper()
    fisheye = kind in _FISHEYES or bool(camera.get("is_fisheye", 0).value)
    terms = [camera.get(key, 0.0).number() for key in ("k1", "k2", "p1", "p2", "k3", "k4")]
    if not (fisheye or kind in _FLAT) or (terms[5] and not fisheye):
        raise InputError(remark("programs.lens_model", of=path, kind=kind or "k4", count=6))
    stated = "w" in camera and "h" in camera
    size = (camera["w"].number(), camera["h"].number()) if stated else photos.size(name)
    if "fl_x" in camera:
        focal = [camera["fl_x"].number(), camera.get("fl_y", camera["fl_x"].value).number()]
    else:
        focal = [size[0] / 2 / np.tan(camera["camera_angle_x"].number() / 2)] * 2
    centre = [camera.get(key, side / 2).number() - 0.5
              for key, side in zip(("cx", "cy"), size, strict=True)]  # fmt: skip
    terms = [terms[0], terms[1], terms[4], terms[5]] if fisheye else terms[:5]
    return lens_data(focal, centre, terms, size, f"transforms, {path.name}", fisheye=fisheye)
