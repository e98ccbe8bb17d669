"""AliceVision's and Meshroom's ``.sfm`` (JSON) and OpenMVG's ``sfm_data.json``, its forebear.

Poses are x = R (X - C), y down, z forwards; both programs look photos up at whole numbers for the
centres of pixels (their ``UndistortImage``). AliceVision writes matrices column by column, numbers
as text, and what a version means by its intrinsics stands in its reader
(``sfmDataIO/jsonIO.cpp``): principal points from the corner before 1.2.1, focal lengths in pixels
before 1.2.2, the inverse of the pixels' ratio before 1.2.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray
from photocore.camera import LensData, checked_rotation, lens_data, nearest_rotation
from photocore.errors import InputError
from photocore.programs.json_values import JsonValue
from photocore.programs.model import ForeignProject, ForeignView
from photocore.remarks import remark

#: Which of OpenCV's terms k1 k2 p1 p2 k3 a model's own are, by its names in both programs.
_BROWN = {
    "disto_k1": (0,), "radial1": (0,), "radialk1": (0,),
    "disto_k3": (0, 1, 4), "radial3": (0, 1, 4), "radialk3": (0, 1, 4),
    "disto_t2": (0, 1, 4, 2, 3), "brown": (0, 1, 4, 2, 3),
    "pinhole": (), "none": (),
}  # fmt: skip
_FISHEYES = ("fisheye", "fisheye4")


def read_alicevision(path: Path, value: JsonValue) -> ForeignProject:
    """Return the posed photos and the landmarks of a ``.sfm`` file.

    Raises
    ------
    InputError
        Naming the key that is missing or wrong.
    """
    version = tuple(int(part) for part in value.get("version", [1, 0, 0]).numbers(3))
    lenses = {lens["intrinsicId"].text(): lens for lens in value.get("intrinsics", []).each()}
    poses = {pose["poseId"].text(): pose["pose"]["transform"]
             for pose in value.get("poses", []).each()}  # fmt: skip
    views, unposed = [], 0
    for view in value["views"].each():
        pose = poses.get(view.get("poseId", "").text())
        if pose is None or "rigId" in view:
            unposed += 1
            continue
        name, number = view["path"].text().replace("\\", "/"), view.get("intrinsicId", "").text()
        if number not in lenses:
            raise InputError(f"{path}: intrinsic {number!r} of photo {name} is not in the file.")
        rotation = pose["rotation"].numbers(9).reshape(3, 3).T
        lens = _alicevision_lens(lenses[number], version, path)
        views.append(_view(name, lens, rotation, pose["center"], path))
    points = [point["X"].numbers(3) for point in value.get("structure", []).each()]
    return _project("AliceVision", path, views, unposed, points)


def _alicevision_lens(lens: JsonValue, version: tuple[int, ...], path: Path) -> LensData:
    size = lens["width"].number(), lens["height"].number()
    middle = np.array(size) / 2 if version >= (1, 2, 1) else np.zeros(2)
    centre = lens["principalPoint"].numbers(2) + middle
    if version < (1, 2, 0):
        focal = np.full(2, lens["pxFocalLength"].number())
    elif version < (1, 2, 2):
        focal = lens["pxFocalLength"].numbers(2)
    else:
        fx = lens["focalLength"].number() / lens.get("sensorWidth", 36.0).number() * size[0]
        ratio = lens.get("pixelRatio", 1.0).number()
        focal = np.array([fx, fx * ratio if version >= (1, 2, 5) else fx / ratio])
    kind = lens["type"].text().lower()
    if kind == "pinhole" and "distortionType" in lens:
        kind = lens["distortionType"].text().lower()
    numbers = lens.get("distortionParams", []).numbers(-1)
    undone = lens.get("undistortionParams", []).numbers(-1)
    if undone.any():
        kind = lens.get("undistortionType", "an undistortion").text()
    return _lens(focal, centre, kind, numbers, size, path)


def read_openmvg(path: Path, value: JsonValue) -> ForeignProject:
    """Return the posed photos and the landmarks of a ``sfm_data.json``.

    Raises
    ------
    InputError
        Naming the key that is missing or wrong.
    """
    lenses = {lens["key"].text(): _content(lens) for lens in value.get("intrinsics", []).each()}
    poses = {pose["key"].text(): pose["value"] for pose in value.get("extrinsics", []).each()}
    views, unposed = [], 0
    for view in map(_content, value["views"].each()):
        pose = poses.get(view["id_pose"].text())
        if pose is None:
            unposed += 1
            continue
        name = str(Path(view.get("local_path", "").text()) / view["filename"].text())
        number = view["id_intrinsic"].text()
        if number not in lenses:
            raise InputError(f"{path}: intrinsic {number!r} of photo {name} is not in the file.")
        lens = _openmvg_lens(lenses[number], path)
        views.append(_view(name, lens, pose["rotation"].numbers(3, 3), pose["center"], path))
    points = [point["value"]["X"].numbers(3) for point in value.get("structure", []).each()]
    return _project("OpenMVG", path, views, unposed, points)


def _content(item: JsonValue) -> JsonValue:
    """Return what a pointer holds, its base class' values among its own."""
    data = item["value"]["ptr_wrapper"]["data"]
    merged = dict(data.items())
    while "value0" in data:
        data = data["value0"]
        merged = dict(data.items()) | merged
    return JsonValue({key: one.value for key, one in merged.items()}, item.where)


def _openmvg_lens(lens: JsonValue, path: Path) -> LensData:
    size = lens["width"].number(), lens["height"].number()
    focal = np.full(2, lens["focal_length"].number())
    kind = next((key for key in (*_BROWN, *_FISHEYES) if key in lens), "pinhole")
    terms = lens.get(kind, []).numbers(-1)
    return _lens(focal, lens["principal_point"].numbers(2), kind, terms, size, path)


def _lens(
    focal: FloatArray, centre: FloatArray, kind: str, given: FloatArray,
    size: Sequence[float], path: Path,
) -> LensData:  # fmt: skip
    """Return a lens of either program."""
    fisheye = kind in _FISHEYES
    order = tuple(range(4)) if fisheye else _BROWN.get(kind)
    if order is None or len(order) != len(given):
        raise InputError(remark("programs.lens_model", of=path, kind=kind, count=len(given)))
    terms = np.zeros(4 if fisheye else 5)
    terms[list(order)] = given
    return lens_data(
        focal.tolist(), centre.tolist(), terms.tolist(), size, f"{kind}, {path.name}",
        fisheye=fisheye,
    )  # fmt: skip


def _view(
    name: str, lens: LensData, rotation: FloatArray, centre: JsonValue, path: Path
) -> ForeignView:
    turn = checked_rotation(rotation, f"{path}: rotation of {name}", tolerance=1e-5)
    return ForeignView(name, lens, nearest_rotation(turn), centre.numbers(3))


def _project(
    program: str, path: Path, views: list[ForeignView], unposed: int, points: list[FloatArray]
) -> ForeignProject:
    if not views:
        raise InputError(remark("programs.no_pose", of=path))
    notes = (f"{unposed} photos without a pose of their own left out.",) if unposed else ()
    return ForeignProject(program, tuple(views), np.array(points).reshape(-1, 3), remarks=notes)
