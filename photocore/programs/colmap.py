"""COLMAP's models, text and binary: cameras, images and points3D.

Pixels are counted from the corner of the image; poses lead from the world into the camera, as
quaternion and translation, y down, z forwards (its documentation, Output Format).
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from photocore.arrays import FloatArray, floats_of_words
from photocore.camera import (
    COLMAP_NUMBERS,
    LensData,
    colmap_lens,
    colmap_parameters,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from photocore.errors import LARGEST, InputError
from photocore.output import atomic_folder
from photocore.programs.model import ForeignProject, ForeignView
from photocore.textfile import read_text, readable

_KIND = "file of a COLMAP model"
#: From the corner of the image, as COLMAP counts, to pixel centres.
CORNER = 0.5
_NONE = -1


class ColmapImage(NamedTuple):
    """One image: name, number of its camera, pose, pixels and the points they are of."""

    name: str
    camera: str
    rotation: FloatArray
    translation: FloatArray
    pixels: FloatArray
    ids: list[str]


class ColmapModel(NamedTuple):
    """Lenses by their numbers, what follows them in text, images, points."""

    lenses: dict[str, LensData]
    ports: dict[str, Sequence[str]]
    images: list[ColmapImage]
    ids: list[str]
    points: FloatArray


def is_colmap(folder: Path, ending: str = ".txt") -> bool:
    """Whether a folder holds a model in files of this ending."""
    return all((folder / f"{name}{ending}").is_file() for name in ("cameras", "images"))


def count_images(folder: Path) -> int:
    """Return how many images a model holds, without reading them."""
    if not is_colmap(folder):
        return _Bytes(folder / "images.bin").count()
    words = (line.split(maxsplit=9) for line in _lines(folder / "images.txt"))
    return sum(len(word) == 10 and word[0].isdecimal() for word in words)


def read_colmap_project(folder: Path) -> ForeignProject:
    """Return photos and points of a model.

    Raises
    ------
    InputError
        Naming file and place of what cannot be read.
    """
    model = read_colmap_model(folder)
    views = (
        ForeignView(
            image.name, model.lenses[image.camera], image.rotation,
            -image.rotation.T @ image.translation,
        )
        for image in model.images
    )  # fmt: skip
    return ForeignProject("COLMAP", tuple(views), model.points)


def read_colmap_model(folder: Path) -> ColmapModel:
    """Return what a model's files hold, binary ones where there are no text files.

    Raises
    ------
    InputError
        Naming file and place of what cannot be read.
    """
    binary = not is_colmap(folder) and is_colmap(folder, ".bin")
    model = _binary_model(folder) if binary else _text_model(folder)
    if not model.images:
        raise InputError(f"{folder / 'images'}{'.bin' if binary else '.txt'}: holds no images.")
    return model


def _text_model(folder: Path) -> ColmapModel:
    lenses: dict[str, LensData] = {}
    ports: dict[str, Sequence[str]] = {}
    path = folder / "cameras.txt"
    for line in _lines(path):
        words = line.split()
        if len(words) < 5:
            raise InputError(f"{path}: {line!r:.60} is not a COLMAP camera line.")
        lenses[words[0]], used = colmap_lens(words, path, more=True)
        ports[words[0]] = words[used:]
    images = list(_images(folder / "images.txt", lenses))
    points = folder / "points3D.txt"
    ids, xyz = _points(points) if points.is_file() else ([], np.empty((0, 3)))
    return ColmapModel(lenses, ports, images, ids, xyz)


def write_colmap_model(
    folder: Path, cameras: Sequence[str], images: Sequence[str], points: Sequence[str],
    *, overwrite: bool = False,
) -> None:  # fmt: skip
    """Write a text model, whole or not at all.

    Parameters
    ----------
    folder : path
    cameras, images, points : sequence of str
        Lines of its three files; of an image the line of its pose and that of its points.
    overwrite : bool
        Whether a folder that exists may be replaced.
    """
    heads = (
        ("cameras", "CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]", cameras),
        ("images", "IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
         "#   POINTS2D[] as (X, Y, POINT3D_ID)", images),
        ("points3D", "POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)",
         points),
    )  # fmt: skip
    with atomic_folder(folder, overwrite=overwrite) as temporary:
        for name, head, rows in heads:
            text = "\n".join([f"#   {head}", *rows]) + "\n"
            (temporary / f"{name}.txt").write_text(text, encoding="utf-8", newline="\n")


def camera_words(
    matrix: FloatArray, coefficients: FloatArray, size: Sequence[int], *, fisheye: bool = False
) -> str:
    """Return what cameras.txt says of a lens after its number.

    Parameters
    ----------
    matrix : ndarray, shape (3, 3)
        fx, fy, cx, cy; integers at pixel centres. [px]
    coefficients : ndarray, shape (k,)
        In OpenCV's order, up to k6; of a fisheye k1 to k4.
    size : sequence of int
        Width and height. [px]
    fisheye : bool

    Raises
    ------
    InputError
        If COLMAP has no model with these terms.
    """
    terms = np.trim_zeros(coefficients, "b")
    models = {0: "PINHOLE", 4: "OPENCV", 8: "FULL_OPENCV"} if not fisheye else {4: "OPENCV_FISHEYE"}
    count = min((count for count in models if len(terms) <= count), default=None)
    if count is None:
        raise InputError(
            "COLMAP has no lens model with thin-prism or tilted terms; undistort the photos first."
        )
    numbers = (*matrix.diagonal()[:2], *(matrix[:2, 2] + CORNER), *terms, *[0.0] * count)
    return f"{models[count]} {size[0]} {size[1]} {digits(numbers[: 4 + count])}"


def image_words(rotation: FloatArray, translation: FloatArray, camera: str, name: str) -> str:
    """Return what images.txt says of a photo after its number."""
    pose = digits((*quaternion_from_rotation(rotation), *translation))
    return f"{pose} {camera} {name}"


def digits(values: Sequence[float] | FloatArray) -> str:
    """Return numbers with all their digits, a blank between them."""
    return " ".join(f"{v:.17g}" for v in values)


def _images(path: Path, lenses: dict[str, LensData]) -> Iterator[ColmapImage]:
    """Read images.txt: two lines per image, the second of them may be empty."""
    lines = iter(enumerate(read_text(path, _KIND).splitlines(), start=1))
    for number, first in lines:
        if first.startswith("#") or not first.strip():
            continue
        _, second = next(lines, (0, ""))
        words = first.split(maxsplit=9)
        where = f"{path}, line {number}"
        if len(words) != 10:
            raise InputError(
                f"{where}: expected IMAGE_ID, QW to TZ, CAMERA_ID, NAME; found {first!r:.60}."
            )
        if not words[0].isdecimal():
            raise InputError(f"{where}: IMAGE_ID {words[0]!r:.60} is no whole number.")
        pose = floats_of_words(words[1:8], path, f"line {number}")
        table = floats_of_words(second.split(), path, f"line {number + 1}")
        if len(table) % 3:
            raise InputError(f"{path}, line {number + 1}: expected X, Y, POINT3D_ID of each point.")
        yield _image(words[9], words[8], pose, table.reshape(-1, 3), where, lenses)


def _image(
    name: str, camera: str, pose: FloatArray, table: FloatArray, where: str,
    lenses: dict[str, LensData],
) -> ColmapImage:  # fmt: skip
    """Return an image of a quaternion with a translation, and of x, y, id of each of its points."""
    if camera not in lenses:
        raise InputError(f"{where}: camera {camera} is not in cameras.txt.")
    rows = np.flatnonzero(table[:, 2] != _NONE)
    # Two keypoints of one image may be said to be of one point; the first is kept.
    rows = rows[np.sort(np.unique(table[rows, 2], return_index=True)[1])]
    rotation = rotation_from_quaternion(pose[:4], f"{where}, quaternion")
    ids = [str(int(v)) for v in table[rows, 2]]
    return ColmapImage(name, camera, rotation, pose[4:], table[rows, :2] - CORNER, ids)


def _points(path: Path) -> tuple[list[str], FloatArray]:
    """Read points3D.txt."""
    ids, xyz = [], []
    for line in _lines(path):
        words = line.split()
        if len(words) < 4:
            raise InputError(f"{path}: {line!r:.60} is not a COLMAP point.")
        ids.append(words[0])
        xyz.append(floats_of_words(words[1:4], path, f"point {words[0]}"))
    return ids, np.array(xyz).reshape(-1, 3)


def _lines(path: Path) -> list[str]:
    return [
        line
        for line in read_text(path, _KIND).splitlines()
        if line.strip() and not line.startswith("#")
    ]


class _Bytes:
    """A binary file read from its beginning on; little-endian."""

    def __init__(self, path: Path) -> None:
        with readable(path, _KIND, missing=_KIND):
            self.data, self.place, self.path = path.read_bytes(), 0, path

    def skip(self, size: int) -> int:
        """Return the present place and go on by so many bytes."""
        start, self.place = self.place, self.place + size
        if self.place > len(self.data):
            raise InputError(f"{self.path}: ends at byte {len(self.data)}, before its content.")
        return start

    def take(self, form: str) -> tuple[Any, ...]:
        """Return values as `struct` names them."""
        return struct.unpack_from(f"<{form}", self.data, self.skip(struct.calcsize(f"<{form}")))

    def count(self) -> int:
        """Return how many follow."""
        return int(self.take("Q")[0])

    def finite(self, count: int, kind: Any = "<f8") -> Any:
        """Return so many values of a kind, all of them numbers that float64 can hold."""
        kind = np.dtype(kind)
        values = np.frombuffer(self.data, kind, count, self.skip(count * kind.itemsize))
        if not (np.abs(values["xy"] if kind.names else values) <= LARGEST).all():
            raise InputError(f"{self.path}: holds what is no finite number before {self.place}.")
        return values

    def keypoints(self) -> FloatArray:
        """Return x, y and the number of the point of all that follow, shape (n, 3)."""
        rows = self.finite(self.count(), [("xy", "<f8", 2), ("id", "<i8")])
        return np.column_stack([rows["xy"], rows["id"]])

    def text(self) -> str:
        """Return the text up to the next zero."""
        end = self.data.find(b"\0", self.place)
        if end < 0:
            raise InputError(f"{self.path}: ends within a name.")
        start = self.skip(end + 1 - self.place)
        try:
            return self.data[start:end].decode("utf-8")
        except UnicodeDecodeError:
            raise InputError(f"{self.path}: a name at byte {start} is no text.") from None


def _binary_model(folder: Path) -> ColmapModel:
    lenses: dict[str, LensData] = {}
    file = _Bytes(folder / "cameras.bin")
    for _ in range(file.count()):
        number, model, width, height = file.take("IiQQ")
        if model not in COLMAP_NUMBERS:
            raise InputError(f"{file.path}: COLMAP camera model {model} is not read.")
        name = COLMAP_NUMBERS[model]
        values = file.finite(colmap_parameters(name)).tolist()
        words = [str(number), name, str(width), str(height), *map(repr, values)]
        lenses[str(number)] = colmap_lens(words, file.path)[0]
    file, images = _Bytes(folder / "images.bin"), []
    for _ in range(file.count()):
        number = file.take("I")[0]
        pose, camera, name = file.finite(7), str(file.take("I")[0]), file.text()
        where = f"{file.path}, image {number}"
        images.append(_image(name, camera, pose, file.keypoints(), where, lenses))
    ids, xyz, points = [], [], folder / "points3D.bin"
    if points.is_file():
        file = _Bytes(points)
        for _ in range(file.count()):
            ids.append(str(file.take("Q")[0]))
            xyz.append(file.finite(3))
            file.skip(11)  # colour and error
            file.skip(8 * file.count())
    return ColmapModel(lenses, {}, images, ids, np.array(xyz).reshape(-1, 3))
