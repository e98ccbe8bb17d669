"""OpenSfM's and OpenDroneMap's ``reconstruction.json``.

Poses lead from the world into the camera, x = R X + t, R as a rotation vector, y down, z forwards.
Image coordinates are from the middle of the photo in units of its longer side, so are focal lengths
and principal points. The world is east, north, up about ``reference_lla``, in metres where the
photos told their positions (OpenSfM's documentation, Geometric Models, Dataset Structure).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from photocore.camera import LensData, lens_data, rotation_from_vector
from photocore.errors import InputError
from photocore.programs.json_values import JsonValue
from photocore.programs.model import ForeignProject, ForeignView, chosen_part

#: Distortion terms of each model in OpenCV's order; of fisheyes in that of OpenCV's fisheye.
_TERMS = {
    "perspective": ("k1", "k2", "p1", "p2"),
    "brown": ("k1", "k2", "p1", "p2", "k3"),
    "radial": ("k1", "k2", "p1", "p2"),
    "simple_radial": ("k1", "k2", "p1", "p2"),
    "fisheye": ("k1", "k2", "k3", "k4"),
    "fisheye_opencv": ("k1", "k2", "k3", "k4"),
}


def read_opensfm(path: Path, value: JsonValue, part: str | None = None) -> ForeignProject:
    """Return one of the reconstructions that a file holds, the largest unless another is named.

    Raises
    ------
    InputError
        Naming the key that is missing or wrong.
    """
    parts = {str(number): one for number, one in enumerate(value.each(), start=1)}
    sizes = {name: len(dict(one["shots"].items())) for name, one in parts.items()}
    if not any(sizes.values()):
        raise InputError(f"{path}: holds no reconstruction with photos.")
    name, remarks = chosen_part(sizes, part, path)
    best = parts[name]
    lenses = {key: _lens(camera, path) for key, camera in best["cameras"].items()}
    views = []
    for name, shot in best["shots"].items():
        camera = shot["camera"].text()
        if camera not in lenses:
            raise InputError(f"{path}: camera {camera!r} of photo {name} is not among the cameras.")
        rotation = rotation_from_vector(shot["rotation"].numbers(3))
        centre = -rotation.T @ shot["translation"].numbers(3)
        views.append(ForeignView(name, lenses[camera], rotation, centre))
    points = [point["coordinates"].numbers(3) for _, point in best.get("points", {}).items()]
    place = best.get("reference_lla", {})
    is_placed = any(place.get(key, 0.0).number() for key in ("latitude", "longitude"))
    return ForeignProject(
        "OpenSfM", tuple(views), np.array(points).reshape(-1, 3),
        metres="the positions of the photos or ground control" if is_placed else "",
        remarks=remarks,
    )  # fmt: skip


def _lens(camera: JsonValue, path: Path) -> LensData:
    kind = camera.get("projection_type", "perspective").text()
    if kind not in _TERMS:
        raise camera.get("projection_type", "").wrong(f"one of {', '.join(_TERMS)}")
    size = camera["width"].number(), camera["height"].number()
    unit = max(size)
    keys = ("focal_x", "focal_y") if "focal_x" in camera else ("focal", "focal")
    focal = [unit * camera[key].number() for key in keys]
    centre = [
        unit * camera.get(key, 0.0).number() + (side - 1) / 2
        for key, side in zip(("c_x", "c_y"), size, strict=True)
    ]
    terms = [camera.get(key, 0.0).number() for key in _TERMS[kind]]
    fisheye = kind.startswith("fisheye")
    return lens_data(focal, centre, terms, size, f"OpenSfM {kind}, {path.name}", fisheye=fisheye)
