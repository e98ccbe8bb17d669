"""Calibrations of other particle trackers: MyPTV's folders, proPTV's markers, OpenLPT's cameras.

MyPTV keeps a camera in a file of its name, ``Tsai model camera`` in the first line, and control
points of each camera, proPTV nothing but these, both as lines of column, row, X, Y, Z. Their
polynomials are no cameras: these are made from the points. OpenLPT's cameras are OpenCV's, with
a plate of glass where there is one.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from multimedia.exchange.opencv_camera import FREE, camera_of
from multimedia.media import EXTERIOR, Camera, FlatInterface, farthest_miss, nearest_camera
from multimedia.projects import ImagePoints, ObjectPoints, Project, place_name
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.arrays import FloatArray, floats_of_words
from photocore.camera import LensData, rotation_from_vector, world_from_camera
from photocore.errors import InputError
from photocore.textfile import read_text, readable

_TSAI, _ZOLOF, _OPENLPT = "Tsai model camera", "extendedZolof", "# Camera Model"
#: How names of lists of control points run in MyPTV and proPTV; where they lie.
_POINTS = re.compile(r"cal_?points|markers", re.IGNORECASE)
_FOLDERS = ("", "Calibration", "calibration", "input/calibration")
#: Bytes that tell what a file is; side of the grid on which lenses are compared.
_HEAD, _GRID = 400, 25
#: Principal distances that are tried as starts, in widths of the image; share of it beyond which
#: what a camera leaves at its points is no camera; points and depth that it needs at least.
_STARTS, _MISFIT, _FEWEST, _DEPTH = (1.0, 2.0, 4.0, 8.0), 0.02, 8, 0.01
_KIND = "file of a particle tracker"
#: Headings of OpenLPT's files, older and newer.
_PLATE = {
    "point": r"reference point|farthest interface", "normal": r"normal vector|camera->object",
    "indices": r"refractive index|obj->win->air", "widths": r"^width of|plate thickness",
}  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class _ControlList:
    """Control points of one camera."""

    path: Path
    pixels: FloatArray
    xyz: FloatArray


def is_ptv_calibration(folder: Path) -> bool:
    """Whether a folder holds cameras or lists of control points of these programs."""
    return any(_files(folder).values())


def read_ptv_calibration(folder: Path, *, pitch: float, unit: str) -> Project:
    """Return the project of a folder: its cameras, and control points where there are any.

    Raises
    ------
    InputError
        Naming file and place of what cannot be used.
    """
    files = _files(folder)
    cameras: dict[str, Camera] = {}
    media: dict[str, FlatInterface] = {}
    media_of: dict[str, str] = {}
    remarks: list[str] = []
    for path in files["camera"]:
        is_tsai = read_text(path, _KIND).startswith(_TSAI)
        camera, wall, notes = (_myptv if is_tsai else _openlpt)(path, pitch)
        number = _number(path)
        if number in cameras:
            raise InputError(
                remark("exchange.two_cameras", of=path, file=cameras[number].name, number=number)
            )
        cameras[number] = camera
        remarks += notes
        if wall is not None:
            label = next((k for k, m in media.items() if _is_one(m, wall)), f"w{len(media) + 1}")
            media.setdefault(label, wall)
            media_of[camera.name] = label
    lists: dict[str, _ControlList] = {}
    for path in files["points"]:
        points, number = _points(path), _number(path)
        if number not in lists or len(points.xyz) > len(lists[number].xyz):
            lists[number] = points
    if len(lists) < len(files["points"]):
        names = ", ".join(sorted(points.path.name for points in lists.values()))
        remarks.append(remark("exchange.longest_lists", of=folder, names=names))
    for number, points in sorted(lists.items()):
        if number not in cameras:
            cameras[number], note = _of_points(points, f"cam{number}", pitch)
            remarks.append(note)
    if not cameras:
        raise InputError(remark("exchange.polynomials_alone", of=files["polynomial"][0]))
    ordered = sorted(cameras.items(), key=lambda item: (len(item[0]), item[0]))
    places = {place_name(x): x for points in lists.values() for x in points.xyz}
    seen_by = [(camera, lists[number]) for number, camera in ordered if number in lists]
    image = [c.described_sensor().image_from_pixel(points.pixels) for c, points in seen_by]
    return Project(
        cameras=tuple(camera for _, camera in ordered),
        media=media, media_of=tuple(media_of.get(c.name, "") for _, c in ordered),
        object_points=ObjectPoints(
            ids=tuple(places), xyz=np.array(list(places.values())).reshape(-1, 3)
        ),
        image_points=ImagePoints(
            cameras=tuple(c.name for c, points in seen_by for _ in points.xyz),
            ids=tuple(place_name(x) for _, points in seen_by for x in points.xyz),
            image=np.concatenate([np.empty((0, 2)), *image]),
        ),
        sigma_image=0.5 * pitch, unit=unit, name=folder.resolve().name,
        extra={"source": "particle tracker"}, remarks=tuple(remarks),
    )  # fmt: skip


def _files(folder: Path) -> dict[str, list[Path]]:
    """Return the files of a folder by what they hold."""
    files: dict[str, list[Path]] = {"camera": [], "polynomial": [], "points": []}
    for place in dict.fromkeys((folder / name).resolve() for name in _FOLDERS):
        for path in sorted(place.iterdir()) if place.is_dir() else ():
            if not path.is_file() or path.suffix.lower() not in ("", ".txt"):
                continue
            with readable(path, _KIND), path.open("rb") as stream:
                head = stream.read(_HEAD).decode("utf-8", errors="replace")
            if head.startswith(_TSAI) or _OPENLPT in head:
                files["camera"].append(path)
            elif head.startswith(_ZOLOF):
                files["polynomial"].append(path)
            elif _POINTS.search(path.name):
                files["points"].append(path)
    return files


def _number(path: Path) -> str:
    """Return the number of the camera in a file's name: the last, or the name without any."""
    numbers = re.findall(r"\d+", path.stem)
    return str(int(numbers[-1])) if numbers else path.stem


def _is_one(one: FlatInterface, two: FlatInterface) -> bool:
    same = all(np.allclose(*pair) for pair in ((one.point, two.point), (one.normal, two.normal)))
    return same and one.layers == two.layers


def _points(path: Path) -> _ControlList:
    """Read lines of column, row, X, Y, Z."""
    rows = []
    for number, line in enumerate(read_text(path, _KIND).splitlines(), start=1):
        words = line.split("#")[0].replace(",", " ").split()
        if words and len(words) != 5:
            raise InputError(remark("exchange.five_numbers", of=path, line=number, size=len(words)))
        if words:
            rows.append(floats_of_words(words, path, f"line {number}"))
    if len(rows) < _FEWEST:
        raise InputError(remark("exchange.few_points", of=path, count=len(rows), least=_FEWEST))
    table = np.array(rows)
    if len(np.unique(table[:, 2:], axis=0)) < len(table):
        raise InputError(remark("exchange.points_twice", of=path))
    return _ControlList(path, table[:, :2], table[:, 2:])


def _of_points(points: _ControlList, name: str, pitch: float) -> tuple[Camera, str]:
    """Return the camera in air, its principal point in the middle, that sees the points best."""
    size = np.ceil(points.pixels.max(axis=0)).astype(int) + 1
    depth = np.linalg.svd(points.xyz - points.xyz.mean(axis=0), compute_uv=False)
    if depth[2] < _DEPTH * depth[0]:
        raise InputError(remark("exchange.points_in_a_plane", of=points.path))
    unit = depth[0] / np.sqrt(len(points.xyz))
    world, image = (a.astype(np.float32)[None] for a in (points.xyz / unit, points.pixels))
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_PRINCIPAL_POINT
    flags |= cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST
    flags |= cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    best = (np.inf, np.eye(3), np.zeros(3), np.zeros(3))
    for start in _STARTS:
        matrix = np.array([[start * size[0], 0, (size[0] - 1) / 2],
                           [0, start * size[0], (size[1] - 1) / 2], [0, 0, 1]])  # fmt: skip
        try:
            rest, matrix, _, turns, shifts = cv2.calibrateCamera(
                list(world), list(image), tuple(size.tolist()), matrix, np.zeros(5), flags=flags
            )
        except cv2.error:
            continue
        if rest < best[0] and float(shifts[0][2, 0]) > 0:
            best = (rest, matrix, turns[0].ravel(), shifts[0].ravel())
    rest, matrix, turn, shift = best
    if not rest < _MISFIT * size[0]:
        raise InputError(remark("exchange.no_camera_of_points", of=points.path, rest=rest))
    sides = (float(size[0]), float(size[1]))
    lens = LensData(matrix, np.zeros(5), "opencv", sides, points.path.name)
    camera = camera_of(lens, rotation_from_vector(turn), shift * unit, pitch=pitch, name=name)
    return camera, remark(
        "exchange.camera_of_points", name=name, file=points.path.name, rest=rest,
        width=size[0], height=size[1],
    )  # fmt: skip


def _myptv(path: Path, pitch: float) -> tuple[Camera, None, list[str]]:
    """Return a camera of MyPTV's Tsai model, its polynomial by the terms of a lens that come near.

    A pixel u v looks along R' (u' + e1, v' + e2, f + e3), u' v' from the principal point and e a
    polynomial of u and v; R turns from the world.
    """
    _, name, *rest = [*read_text(path, _KIND).splitlines(), "", ""]
    values = floats_of_words(" ".join(rest).split(), path, "value {} after the name")
    if len(values) != 26:
        raise InputError(remark("exchange.tsai_numbers", of=path, size=len(values)))
    size, centre, angles, f, offset = values[:2], values[2:5], values[5:8], values[8], values[9:11]
    point = size / 2 + offset
    matrix = np.array([[f, 0, point[0]], [0, f, point[1]], [0, 0, 1]])
    turn = world_from_camera(*angles.tolist())
    sides = (float(size[0]), float(size[1]))
    lens = LensData(matrix, np.zeros(5), "opencv", sides, f"MyPTV, {path.name}")
    label = name.strip() or path.stem
    camera = camera_of(lens, turn, -turn @ centre, pitch=pitch, name=label)
    terms = values[11:].reshape(3, 5)
    if not terms.any():
        return camera, None, []
    u, v = (a.ravel() for a in np.meshgrid(*(np.linspace(0, side - 1, _GRID) for side in size)))
    bent = np.column_stack([u, v, u**2, v**2, u * v]) @ terms.T
    ray = np.column_stack([u - point[0], v - point[1], np.full(u.shape, f)]) + bent
    image = camera.described_sensor().image_from_pixel(np.column_stack([u, v]))
    points = centre + ray @ turn / f
    near = nearest_camera(camera, points, image, (*EXTERIOR[3:], *FREE, "shear"))
    miss = farthest_miss(near, points, image)
    return near, None, [remark("exchange.tsai_polynomial", name=label, miss=miss)]


def _openlpt(path: Path, pitch: float) -> tuple[Camera, FlatInterface | None, list[str]]:
    """Return a camera of OpenLPT, and the glass it looks through."""
    sections: dict[str, str] = {}
    heading = ""
    for line in read_text(path, _KIND).splitlines():
        if line.lstrip().startswith("#"):
            heading = line.lstrip("# ").lower()
        elif line.strip():
            sections[heading] = f"{sections.get(heading, '')} {line}".replace(",", " ")
    model = next((v.strip() for k, v in sections.items() if k.startswith("camera model")), "")
    if model not in ("PINHOLE", "PINPLATE"):
        raise InputError(remark("exchange.openlpt_model", of=path, model=model))
    rows, columns = _values(path, sections, "^image size", 2)
    matrix = _values(path, sections, "^camera matrix", 9).reshape(3, 3)
    terms = _values(path, sections, "^distortion")
    turn = _values(path, sections, "^rotation matrix", 9).reshape(3, 3)
    shift = _values(path, sections, "^translation vector", 3)
    if matrix[1, 1] < 0:  # a frame whose y is up, the camera looking along -z
        flip = np.array([-1.0, 1.0, -1.0])
        turn, shift = flip[:, None] * turn, flip * shift
        matrix = np.abs(matrix)
        terms[2:3] *= -1.0
    lens = LensData(matrix, terms, "opencv", (float(columns), float(rows)), f"OpenLPT, {path.name}")
    camera = camera_of(lens, turn, shift, pitch=pitch, name=path.stem)
    if model == "PINHOLE":
        return camera, None, []
    point, normal = (_values(path, sections, _PLATE[key], 3) for key in ("point", "normal"))
    indices, widths = (_values(path, sections, _PLATE[key]) for key in ("indices", "widths"))
    # From the object to the camera, the normal the other way; the point lies on the object's side.
    layers = Layers(indices=tuple(indices[::-1]), thicknesses=tuple(widths[::-1]))
    return camera, FlatInterface(layers=layers, point=point, normal=-normal), []


def _values(
    path: Path, sections: Mapping[str, str], heading: str, count: int | None = None
) -> FloatArray:
    """Return the numbers below a heading."""
    text = next((text for name, text in sections.items() if re.search(heading, name)), None)
    values = floats_of_words((text or "").split(), path, f"{heading.strip('^')}, value {{}}")
    if text is None or (count is not None and len(values) != count):
        title = heading.strip("^").split("|")[0]
        raise InputError(remark("exchange.openlpt_section", of=path, title=title, size=len(values)))
    return values
