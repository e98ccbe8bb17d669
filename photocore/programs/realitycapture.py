"""RealityCapture's and RealityScan's cameras: ``.xmp`` beside the photos, or a table (``.csv``).

Focal lengths are those of 35 mm film, 36 mm for the longer side; principal points are from the
middle of the photo in units of the longer side; k1 to k4, t1, t2 are Brown's in OpenCV's order. In
XMP the rotation leads from the world into the camera, y down, z forwards, row by row. In the table
a camera that looks down is turned by roll about y, pitch about x, -heading about z (Epic's page
"RealityCapture XMP Camera Math").
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray, floats_of_words
from photocore.camera import FittedLens, brown_lens, checked_rotation, nearest_rotation, xml_root
from photocore.errors import InputError
from photocore.programs.model import ForeignProject, ForeignView
from photocore.programs.nerf import TURN
from photocore.programs.photos import PhotoFinder
from photocore.remarks import remark
from photocore.textfile import read_text

_SPACE = "capturingreality.com/ns/xcr"
_TABLE = ("name", "x", "y", "alt", "heading", "pitch", "roll", "f")
#: No photos of a wall stand as near as that in metres: longitudes and latitudes do (2 km).
_DEGREES = 0.02
_TERMS = ("k1", "k2", "k3", "k4", "t1", "t2")


def holds_xmp(folder: Path) -> bool:
    """Whether a folder holds photos' places as XMP."""
    return any(_SPACE in read_text(path, "XMP file") for path in folder.glob("*.xmp"))


def read_reality_xmp(folder: Path, photos: PhotoFinder) -> ForeignProject:
    """Return the photos of a folder of ``.xmp`` files; no points.

    Raises
    ------
    InputError
        Naming file and key of what is missing or wrong.
    """
    views, fits, unposed = [], dict[str, None](), 0
    for path in sorted(folder.glob("*.xmp")):
        values = _values(path)
        if "Rotation" not in values or "Position" not in values:
            unposed += _SPACE in read_text(path, "XMP file")
            continue
        turn = _numbers(values, "Rotation", 9, path).reshape(3, 3)
        turn = checked_rotation(turn, f"{path}: Rotation", tolerance=1e-5)
        kind = values.get("DistortionModel", "perspective").lower()
        terms: FloatArray = np.zeros(6)
        if kind.startswith("brown"):
            terms = _numbers(values, "DistortionCoeficients", 6, path)
        elif kind != "perspective":
            raise InputError(remark("programs.lens_model", of=path, kind=kind, count=6))
        if _numbers(values | {"Skew": values.get("Skew", "0")}, "Skew", 1, path)[0]:
            raise InputError(remark("programs.lens_model", of=path, kind="Skew", count=1))
        keys = ("FocalLength35mm", "PrincipalPointU", "PrincipalPointV", "AspectRatio")
        default = {"PrincipalPointU": "0", "PrincipalPointV": "0", "AspectRatio": "1"}
        inner = [_numbers(default | values, key, 1, path)[0] for key in keys]
        fit = _lens(inner, terms, photos.size(path.stem), path)
        fits |= dict.fromkeys(fit.remarks)
        centre = _numbers(values, "Position", 3, path)
        views.append(ForeignView(path.stem, fit.lens, nearest_rotation(turn), centre))
    if not views:
        raise InputError(remark("programs.no_pose", of=folder))
    remarks = (f"{unposed} photos without a pose of their own left out.",) if unposed else ()
    return ForeignProject("RealityCapture", tuple(views), remarks=(*remarks, *fits))


def _values(path: Path) -> dict[str, str]:
    """Return RealityCapture's attributes and elements by their names."""
    values: dict[str, str] = {}
    for node in xml_root(path, read_text(path, "XMP file")).iter():
        for key, text in (*node.attrib.items(), (node.tag, node.text or "")):
            if _SPACE in key:
                values[key.rpartition("}")[2]] = text
    return values


def _numbers(values: Mapping[str, str], key: str, count: int, path: Path) -> FloatArray:
    numbers = floats_of_words(values.get(key, "").split(), path, key)
    if len(numbers) != count:
        raise InputError(f"{path}: {key} must be {count} numbers, found {len(numbers)}.")
    return numbers


def read_reality_table(path: Path, photos: PhotoFinder) -> ForeignProject:
    """Return the photos of a table of internal and external parameters; no points.

    Raises
    ------
    InputError
        Naming the column or row that is missing or wrong.
    """
    views, fits = [], dict[str, None]()
    for number, row in _rows(path):
        where = f"row {number}"
        lacking = [key for key in _TABLE if key not in row]
        if lacking:
            raise InputError(
                remark("programs.reality_columns", of=path, lacking=", ".join(lacking))
            )
        words = [row.get(key) or "0" for key in (*_TABLE[1:], "px", "py", *_TERMS)]
        values = floats_of_words(words, path, where)
        heading, pitch, roll = np.deg2rad(values[3:6])
        world = _turn(2, -heading) @ _turn(0, pitch) @ _turn(1, roll)
        fit = _lens([*values[6:9], 1.0], values[9:], photos.size(row["name"]), path)
        fits |= dict.fromkeys(fit.remarks)
        views.append(ForeignView(row["name"], fit.lens, TURN @ world.T, values[:3]))
    if not views:
        raise InputError(remark("programs.no_pose", of=path))
    plan = np.array([view.centre[:2] for view in views])
    if (
        len(views) > 1
        and (np.abs(plan) <= [180, 90]).all()
        and np.ptp(plan, axis=0).max() < _DEGREES
    ):
        raise InputError(remark("programs.reality_degrees", of=path))
    return ForeignProject("RealityCapture", tuple(views), remarks=tuple(fits))


def _rows(path: Path) -> Iterator[tuple[int, dict[str, str]]]:
    lines = read_text(path, "table of cameras").splitlines()
    start = 1 if lines and lines[0].startswith("#cameras") else 0
    rows = list(csv.reader(lines[start:]))
    heads = [head.strip().lstrip("#").lower() for head in rows[0]] if rows else []
    for number, row in enumerate(rows[1:], start=start + 2):
        if row:
            yield number, dict(zip(heads, map(str.strip, row), strict=False))


def _turn(axis: int, angle: float) -> FloatArray:
    """Return the turn about an axis, right-handed."""
    matrix, (first, second) = np.eye(3), ((axis + 1) % 3, (axis + 2) % 3)
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[second, first], matrix[first, second] = np.sin(angle), -np.sin(angle)
    return matrix


def _lens(inner: list[float], terms: FloatArray, size: tuple[int, int], path: Path) -> FittedLens:
    """Return a lens of f [mm of 36], principal point [longer sides] and fy / fx."""
    longer, source = max(size), f"RealityCapture, {path.name}"
    focal = np.array([inner[0], inner[0] * inner[3]]) * longer / 36.0
    centre = np.array(inner[1:3]) * longer + (np.array(size) - 1) / 2
    tangential = [*terms[4:].tolist(), 0.0, 0.0]
    return brown_lens(
        focal.tolist(), centre.tolist(), terms[:4].tolist(), tangential, size, source
    )  # fmt: skip
