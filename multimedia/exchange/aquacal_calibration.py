"""AquaCal's calibration.json: cameras in air above a level water surface, world Z downwards.

Each camera has K, dist_coeffs and image_size, and R, t camera from world; ``water_z`` is where the
surface is, ``interface`` its normal (from water to air) and the two indices. Lengths in metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.exchange.opencv_camera import camera_of, inexact, opencv_of
from multimedia.media import FlatInterface
from multimedia.projects import FLIP, METRES, Project
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.camera import LensData, checked_rotation
from photocore.errors import InputError
from photocore.jsonfile import read_object, write_object
from photocore.sections import FileSection

VERSION = "1.0"
#: What its reader insists on and a project does not have; kept from a file that was imported.
_NEEDED: Mapping[str, object] = {
    "board": {"squares_x": 0, "squares_y": 0, "square_size": 0.0, "marker_size": 0.0,
              "dictionary": ""},
    "diagnostics": {"reprojection_error_rms": 0.0, "reprojection_error_per_camera": {},
                    "validation_3d_error_mean": 0.0, "validation_3d_error_std": 0.0},
    "metadata": {"calibration_date": "", "software_version": "", "config_hash": "",
                 "num_frames_used": 0, "num_frames_holdout": 0, "seed": None},
}  # fmt: skip
_LEVEL = 1e-9


def is_aquacal(data: Mapping[str, object]) -> bool:
    """Whether a JSON object is a calibration of AquaCal."""
    return isinstance(data.get("cameras"), Mapping) and "interface" in data


def read_aquacal(path: Path, *, pitch: float) -> Project:
    """Return the project of a calibration, in metres, its frame with Z downwards.

    Raises
    ------
    InputError
        Naming camera and key of what cannot be used.
    """
    data = read_object(path, what="AquaCal calibration")
    if not is_aquacal(data):
        raise InputError(f"{path}: has no cameras and interface; is it a calibration of AquaCal?")
    surface = FileSection(data, str(path)).section("interface")
    normal = surface.numbers("normal", (3,))
    indices = tuple(surface.number(key) for key in ("n_air", "n_water"))
    cameras, media_of = [], []
    media: dict[str, FlatInterface] = {}
    for label in data["cameras"]:
        where = f"{path}, camera {label}"
        node = FileSection(data["cameras"][label], where)
        inner, outer = node.section("intrinsics"), node.section("extrinsics")
        lens = LensData(
            camera_matrix=inner.numbers("K", (3, 3)),
            coefficients=np.ravel(inner.numbers("dist_coeffs")),
            model="fisheye" if inner.get("is_fisheye") else "opencv",
            image_size=tuple(inner.numbers("image_size", (2,)).tolist()),
            source=f"AquaCal, {path.name}",
        )
        turn = checked_rotation(outer.numbers("R", (3, 3)), f"{where}: R")
        t = np.ravel(outer.numbers("t"))
        cameras.append(camera_of(lens, turn, t, pitch=pitch, name=str(node.get("name", label))))
        level = node.number("water_z")
        # Cameras that see one surface share it.
        name = next((k for k, m in media.items() if m.point[2] == level), f"water{len(media) + 1}")
        media.setdefault(
            name,
            FlatInterface(layers=Layers(indices=indices), point=(0, 0, level), normal=normal),  # type: ignore[arg-type]
        )
        media_of.append(name)
    return Project(
        cameras=tuple(cameras), media=media, media_of=tuple(media_of), sigma_image=0.5 * pitch,
        name=path.stem, extra={"source": "AquaCal", "aquacal": _kept(data)},
    )  # fmt: skip


def write_aquacal(path: Path, project: Project, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write a project whose cameras look through one level water surface.

    Returns
    -------
    tuple of str
        What is not exactly as in the project: frame turned to Z downwards, metres.

    Raises
    ------
    InputError
        If a camera looks through anything but a water surface perpendicular to Z.
    """
    factor = METRES[project.unit]
    surfaces = [_surface(project, k) for k in range(len(project.cameras))]
    first = surfaces[0]
    if any(s.normal[2] * first.normal[2] < 0 or s.indices != first.indices for s in surfaces):
        raise InputError("AquaCal has one normal and one pair of indices for all cameras.")
    up = bool(first.normal[2] > 0)
    turn = FLIP if up else np.eye(3)
    views = {camera.name: opencv_of(camera) for camera in project.cameras}
    cameras = {
        name: {
            "name": name,
            "intrinsics": {
                "K": view.matrix, "dist_coeffs": view.coefficients, "image_size": list(view.size)
            } | ({"is_fisheye": True} if view.fisheye else {}),
            "extrinsics": {"R": view.rotation @ turn, "t": view.translation * factor},
            "water_z": float((turn @ surface.point)[2]) * factor,
        }
        for (name, view), surface in zip(views.items(), surfaces, strict=True)
    }  # fmt: skip
    n_air, n_water = first.indices
    kept = project.extra.get("aquacal")
    kept = kept if isinstance(kept, Mapping) else {}
    content = {
        "version": VERSION,
        "cameras": cameras,
        "interface": {"normal": [0.0, 0.0, -1.0], "n_air": n_air, "n_water": n_water},
    } | {key: kept.get(key, value) for key, value in _NEEDED.items()}
    write_object(path, content, overwrite=overwrite)
    remarks = [*inexact(views)]
    if up:
        remarks.append("the frame was turned about X by 180 degrees: AquaCal's Z is downwards.")
    if factor != 1.0:
        remarks.append(f"lengths were converted from {project.unit} to m.")
    return tuple(remarks)


def _surface(project: Project, k: int) -> FlatInterface:
    """Return the water surface of a camera, with the level under it as its point."""
    camera, media = project.cameras[k], project.interface_of(k)
    if not isinstance(media, FlatInterface) or len(media.indices) != 2 or media.moves_with_camera:
        raise InputError(remark("exchange.aquacal_media", name=camera.name))
    if abs(abs(media.normal[2]) - 1.0) > _LEVEL:
        raise InputError(
            f"camera {camera.name}: its water surface is not level (normal "
            f"{media.normal.round(6).tolist()}); AquaCal's is perpendicular to Z."
        )
    return media


def _kept(data: Mapping[str, Any]) -> dict[str, dict[str, object]]:
    """Return what of a file the project does not use, without nulls, which TOML lacks."""
    kept = {key: dict(data[key]) for key in _NEEDED if isinstance(data.get(key), Mapping)}
    return {key: {k: v for k, v in part.items() if v is not None} for key, part in kept.items()}
