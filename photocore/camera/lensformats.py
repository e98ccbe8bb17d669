"""Lens calibrations written by other programs, brought to OpenCV's conventions.

Pixels here have integers at pixel centres; COLMAP and Metashape count from the corner of the image,
half a pixel more.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from photocore.arrays import FloatArray, is_finite_number
from photocore.camera.lensdata import LensData
from photocore.camera.lensfit import UNSAID, FittedLens, Function, brown_lens, equidistant
from photocore.camera.pinhole import camera_matrix
from photocore.errors import LARGEST, InputError
from photocore.jsonfile import read_object
from photocore.remarks import remark
from photocore.textfile import check_file, read_text


def read_foreign_lens(path: Path | str) -> LensData:
    """Return the calibration in a COLMAP, Metashape or OpenCV file, told apart by ending.

    ``.txt`` COLMAP ``cameras.txt``, ``.xml`` Metashape (or OpenCV), ``.yml .yaml`` OpenCV.

    Raises
    ------
    InputError
        If the file is missing, of another kind, or uses terms OpenCV's model does not have.
    """
    path = Path(path)
    check_file(path, "lens file", folder=", expected a lens file.")
    ending = path.suffix.lower()
    if ending in {".yml", ".yaml"}:
        return _opencv(path)
    text = read_text(path, "lens calibration")
    if "<!DOCTYPE" in text:
        xml_root(path, text)  # refuses it
    if ending == ".xml":
        return _opencv(path) if "opencv_storage" in text[:500] else _metashape(path, text)
    if ending == ".txt":
        return _colmap(path, text)
    raise InputError(remark("lens.unknown_file", of=path))


def _colmap(path: Path, text: str) -> LensData:
    """Read the one camera of a COLMAP ``cameras.txt``."""
    rows = [line.split() for line in text.splitlines() if line.strip() and line[0] != "#"]
    if len(rows) != 1 or len(rows[0]) < 5:
        raise InputError(remark("lens.many_cameras", of=path, count=len(rows)))
    return colmap_lens(rows[0], path)[0]


#: COLMAP's models: number of parameters, which are fx fy cx cy, and which are OpenCV's
#: coefficients, None for 0.
_COLMAP: dict[str, tuple[int, tuple[int, int, int, int], Sequence[int | None]]] = {
    "SIMPLE_PINHOLE": (3, (0, 0, 1, 2), ()),
    "PINHOLE": (4, (0, 1, 2, 3), ()),
    "SIMPLE_RADIAL": (4, (0, 0, 1, 2), (3, None, None, None)),
    "RADIAL": (5, (0, 0, 1, 2), (3, 4, None, None)),
    "OPENCV": (8, (0, 1, 2, 3), (4, 5, 6, 7)),
    "OPENCV_FISHEYE": (8, (0, 1, 2, 3), (4, 5, 6, 7)),
    "FULL_OPENCV": (12, (0, 1, 2, 3), (4, 5, 6, 7, 8, 9, 10, 11)),
    "SIMPLE_RADIAL_FISHEYE": (4, (0, 0, 1, 2), (3, None, None, None)),
    "RADIAL_FISHEYE": (5, (0, 0, 1, 2), (3, 4, None, None)),
}
#: The numbers that binary files have for them; 7 is FOV.
COLMAP_NUMBERS = dict(zip((0, 1, 2, 3, 4, 5, 6, 8, 9), _COLMAP, strict=True))


def colmap_parameters(model: str) -> int:
    """Return how many parameters a model that is read has."""
    return _COLMAP[model][0]


def colmap_lens(words: Sequence[str], path: Path, *, more: bool = False) -> tuple[LensData, int]:
    """Return the lens of one line of ``cameras.txt``, and how many of its words that took.

    Parameters
    ----------
    words : sequence of str
        CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[].
    path : path
        For messages.
    more : bool
        Whether anything may follow the parameters.
    """
    _, model, *numbers = words
    form = _COLMAP.get(model)
    count = form[0] if form and more else len(numbers) - 2
    try:
        width, height, *p = (float(item) for item in numbers[: 2 + count])
    except ValueError:
        raise InputError(f"{path}: {' '.join(words)!r} is not a COLMAP camera line.") from None
    if form is None or len(p) != form[0]:
        raise InputError(f"{path}: COLMAP camera {model} with {len(p)} parameters is not read.")
    _, (fx, fy, cx, cy), terms = form
    if not (p[fx] > 0 and p[fy] > 0):
        raise InputError(f"{path}: the focal lengths must be above zero [px].")
    lens = LensData(
        camera_matrix(p[fx], p[fy] / p[fx], p[cx] - 0.5, p[cy] - 0.5),
        np.array([0.0 if i is None else p[i] for i in terms]),
        "fisheye" if model.endswith("FISHEYE") else "opencv",
        (width, height),
        f"COLMAP {model}, {path.name}",
    )
    return lens, 4 + count


def _metashape(path: Path, text: str) -> LensData:
    """Read a Metashape camera calibration."""
    root = xml_root(path, text)
    node = root if root.tag == "calibration" else root.find(".//calibration")
    kind = None if node is None else node.findtext("projection")
    if node is None or kind not in PROJECTIONS:
        raise InputError(f"{path}: holds no frame or fisheye calibration of Metashape.")
    fit, shear = metashape_lens(node, path, kind)
    if fit.residual > UNSAID or shear[0, 1]:
        raise InputError(remark("lens.metashape_terms", of=path))
    return fit.lens


def xml_root(path: Path, text: str) -> ElementTree.Element:
    """Return the root of an XML file.

    Raises
    ------
    InputError
        If it is not valid, or declares a document type, which could stand for anything.
    """
    if "<!DOCTYPE" in text:
        raise InputError(remark("lens.doctype", of=path))
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError(f"{path}: is not valid XML ({error}).") from None


#: Angles from the axis by the projected radius, of Metashape's kinds of sensors.
_ANGLES: dict[str, Function | None] = {
    "frame": None,
    "perspective": None,
    "fisheye": equidistant,
    "equidistant_fisheye": equidistant,
    "equisolid_fisheye": lambda radius: 2.0 * np.arcsin(np.where(radius < 2, radius / 2, np.nan)),
}
PROJECTIONS = tuple(_ANGLES)
#: A skew that moves no pixel of a photo this much is none. [px]
_SKEWED = 0.002


def metashape_lens(
    node: ElementTree.Element, path: Path, kind: str
) -> tuple[FittedLens, FloatArray]:
    """Return the lens of a ``calibration`` node, and the shear of its axes, shape (2, 2).

    Its size stands in elements or in ``resolution``.

    Parameters
    ----------
    node : Element
    path : path
        For messages.
    kind : str
        One of `PROJECTIONS`.
    """
    resolution = node.find("resolution")

    def value(name: str) -> float:
        text = node.findtext(name)
        if text is None and resolution is not None:
            text = resolution.get(name)
        try:
            return float(text or 0.0)
        except ValueError:
            raise InputError(f"{path}: <{name}> is not a number.") from None

    width, height, f, b2 = (value(name) for name in ("width", "height", "f", "b2"))
    fx = f + value("b1")
    if not (width > 0 and height > 0 and f > 0 and fx > 0):
        raise InputError(f"{path}: <width>, <height>, <f> and f + b1 must be above zero.")
    k1, k2, k3, k4 = (value(f"k{number}") for number in range(1, 5))
    p1, p2, p3, p4 = (value(f"p{number}") for number in range(1, 5))
    size, source = (width, height), f"Metashape, {path.name}"
    focal, centre = (fx, f), (width / 2 + value("cx") - 0.5, height / 2 + value("cy") - 0.5)
    shear = np.array([[1.0, b2 / fx], [0.0, 1.0]])
    if abs(b2) * height < _SKEWED * f:
        shear = np.eye(2)
    # Metashape's p1 goes with r² + 2x², OpenCV's with 2xy in x: they are exchanged.
    radial, tangential = (k1, k2, k3, k4), (p2, p1, p3, p4)
    fit = brown_lens(
        focal, centre, radial, tangential, size, source, angle=_ANGLES[kind], shear=shear
    )  # fmt: skip
    return fit, shear


def _opencv(path: Path) -> LensData:
    """Read an OpenCV FileStorage calibration."""
    values = opencv_values(path)

    def first(*names: str) -> FloatArray | None:
        return next((values[name] for name in names if name in values), None)

    matrix = first("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M1")
    terms = first(
        "distortion_coefficients", "dist_coeffs", "distCoeffs", "Distortion_Coefficients",
        "D", "D1",
    )  # fmt: skip
    width, height = first("image_width", "image_Width"), first("image_height", "image_Height")
    if matrix is None or matrix.shape != (3, 3) or terms is None:
        raise InputError(f"{path}: lacks camera_matrix (3x3) or distortion_coefficients.")
    if width is None or height is None or width.size != 1 or height.size != 1:
        raise InputError(f"{path}: lacks image_width and image_height; add both.")
    size = (float(width.item()), float(height.item()))
    model = "fisheye" if np.any(values.get(FISHEYE_KEY, 0.0)) else "opencv"
    return LensData(matrix, np.ravel(terms), model, size, f"OpenCV, {path.name}")


#: Says in an OpenCV file that its terms are a fisheye's: OpenCV's own sample writes it as a number;
#: ROS and Kalibr name the model instead.
FISHEYE_KEY = "fisheye_model"
_NAMED = ("distortion_model", "camera_model")
_FISHEYES = ("equidistant", "fisheye")

#: A number, a list or a matrix at the top of OpenCV's YAML; ROS leaves tag and dt out.
_YAML = re.compile(
    r"^(?P<key>\w+):[ \t]*(?:(?P<number>[-+.\w]+)[ \t]*$|\[(?P<list>[^\]\[]*)\]"
    r"|(?:!!opencv-matrix)?\s*\n[ \t]+rows:\s*(?P<rows>\d{1,6})\s+cols:\s*(?P<cols>\d{1,6})\s+"
    r"(?:dt:[^\n]*\s+)?data:\s*\[(?P<data>[^\]\[]*)\])",
    re.MULTILINE,
)


def opencv_values(path: Path) -> dict[str, FloatArray]:
    """Return the numbers, lists and matrices at the top of an OpenCV file by their names.

    YAML and XML of ``FileStorage``, its JSON, and JSON with lists of numbers. Parsed here: OpenCV's
    own reader corrupts memory on damaged files.

    Raises
    ------
    InputError
        If the file is no such file, or a matrix is damaged.
    """
    ending = path.suffix.lower()
    if ending == ".json":
        return _json_values(path)
    text = read_text(path, "lens calibration")
    return _xml_values(path, text) if ending == ".xml" else _yaml_values(path, text)


def _json_values(path: Path) -> dict[str, FloatArray]:
    values: dict[str, FloatArray] = {}
    for key, value in read_object(path, what="OpenCV calibration").items():
        if key in _NAMED and value in _FISHEYES:
            values[FISHEYE_KEY] = np.ones(1)
        elif isinstance(value, Mapping) and {"rows", "cols", "data"} <= value.keys():
            values[key] = _table(path, key, value["data"], [value["rows"], value["cols"]])
        elif isinstance(value, list) or is_finite_number(value):
            values[key] = _table(path, key, value, None)
    return values


def _xml_values(path: Path, text: str) -> dict[str, FloatArray]:
    root = xml_root(path, text)
    if root.tag != "opencv_storage":
        raise InputError(f"{path}: is not an OpenCV calibration file.")
    values = {}
    for node in root:
        words = (node.findtext("data") or node.text or "").split()
        if node.find("data") is not None:
            shape = [node.findtext("rows"), node.findtext("cols")]
            values[node.tag] = _table(path, node.tag, words, shape)
        elif words and all(map(_is_number, words)):
            values[node.tag] = np.array([float(word) for word in words])
    return values


def _yaml_values(path: Path, text: str) -> dict[str, FloatArray]:
    if not re.search(r"^\w+:", text, re.MULTILINE):
        raise InputError(f"{path}: is not an OpenCV calibration file.")
    values: dict[str, FloatArray] = {}
    named = rf"^(?:{'|'.join(_NAMED)}):\s*[\"']?(?:{'|'.join(_FISHEYES)})\b"
    if re.search(named, text, re.MULTILINE):
        values[FISHEYE_KEY] = np.ones(1)
    for match in _YAML.finditer(text):
        words = (match["number"] or match["list"] or match["data"] or "").replace(",", " ").split()
        if match["rows"] is not None:
            shape = [match["rows"], match["cols"]]
            values[match["key"]] = _table(path, match["key"], words, shape)
        elif words and all(map(_is_number, words)):
            values[match["key"]] = np.array([float(word) for word in words])
    for key in re.findall(r"^(\w+):[ \t]*!!opencv-matrix", text, re.MULTILINE):
        if key not in values:
            raise InputError(f"{path}: the matrix {key} is damaged; export the calibration again.")
    return values


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False


def _table(path: Path, key: str, data: Any, shape: Sequence[Any] | None) -> FloatArray:
    """Return numbers, of a shape if one is stated; refuse what is none."""
    try:
        table = np.array(data, dtype=np.float64)
        if shape is not None:
            table = table.reshape(tuple(int(side) for side in shape))
    except (TypeError, ValueError, OverflowError):
        raise InputError(remark("lens.damaged_matrix", of=path, name=key)) from None
    if not (np.abs(table) <= LARGEST).all():
        raise InputError(f"{path}: {key} holds what is no finite number.")
    return table
