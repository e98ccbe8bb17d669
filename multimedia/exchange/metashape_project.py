"""Metashape's cameras as XML (File, Export, Export Cameras, Agisoft XML).

A camera's transform is world from camera, 4 x 4 row by row, y down and z forwards, in the frame of
the chunk, whose own transform (rotation, translation, scale) leads to the world. Image points count
from the corner of the image: u = w / 2 + cx + x' f + x' b1, v = h / 2 + cy + y' f.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import numpy as np

from multimedia.exchange.opencv_camera import OpencvCamera, camera_of, digits, left_out, opencv_of
from multimedia.media.camera import Camera
from multimedia.projects.model import Project
from photocore.arrays import FloatArray
from photocore.camera.fisheye import TERMS
from photocore.camera.lensformats import LensData, metashape_lens, xml_root
from photocore.camera.rotation import checked_rotation, nearest_rotation
from photocore.errors import LARGEST, InputError
from photocore.output import atomic_path
from photocore.textfile import read_text

_KIND = "Metashape file"
#: The chunk's transform where it has none: its frame is the world's.
_FRAME = dict[str, FloatArray](rotation=np.eye(3), translation=np.zeros(3), scale=np.ones(1))
#: Printed matrices have at least so many digits.
_PRINTED = 1e-5


def read_metashape(path: Path, *, pitch: float, unit: str) -> Project:
    """Return the project of all aligned cameras of the first chunk; no points.

    Raises
    ------
    InputError
        Naming what is missing or cannot be used.
    """
    root = xml_root(path, read_text(path, _KIND, form=" (XML)"))
    chunk = root if root.tag == "chunk" else root.find(".//chunk")
    if chunk is None:
        raise InputError(f"{path}: holds no chunk; export the cameras as Agisoft XML.")
    sensors = chunk.findall("./sensors/sensor")
    lenses = {sensor.get("id", ""): _lens(sensor, path) for sensor in sensors}
    rotation, translation, scale = _world_from_chunk(chunk, path)
    cameras: list[Camera] = []
    remarks: list[str] = []
    for node in chunk.findall("./cameras//camera"):
        name = node.get("label") or f"camera {node.get('id', '')}"
        text = node.findtext("transform")
        if text is None:
            remarks.append(f"{name}: is not aligned; left out.")
            continue
        lens = lenses.get(node.get("sensor_id", ""), "has no calibration")
        if isinstance(lens, str):
            raise InputError(f"{path}: the sensor of camera {name} {lens}.")
        matrix = _numbers(text, 16, path, f"transform of camera {name}").reshape(4, 4)
        turn = checked_rotation(matrix[:3, :3], f"{path}: transform of {name}", tolerance=_PRINTED)
        world = rotation @ nearest_rotation(turn)
        centre = scale * (rotation @ matrix[:3, 3]) + translation
        cameras.append(camera_of(lens, world.T, -world.T @ centre, pitch=pitch, name=name))
    if not cameras:
        raise InputError(f"{path}: holds no aligned camera.")
    if chunk.find("./transform/scale") is None:
        remarks.append("the chunk has no transform: its frame and scale are arbitrary.")
    return Project(
        cameras=tuple(cameras), sigma_image=0.5 * pitch, unit=unit, name=path.stem,
        extra={"source": "Metashape"}, remarks=tuple(remarks),
    )  # fmt: skip


def write_metashape(path: Path, project: Project, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write the cameras of a project; return what is not exactly as in the project."""
    views = {camera.name: opencv_of(camera) for camera in project.cameras}
    document = ElementTree.Element("document", version="2.0.0")
    chunk = SubElement(document, "chunk", label=project.name or "multimedia")
    sensors, cameras = SubElement(chunk, "sensors"), SubElement(chunk, "cameras")
    for number, (name, view) in enumerate(views.items()):
        _add_sensor(sensors, number, name, view)
        camera = SubElement(cameras, "camera", id=str(number), sensor_id=str(number), label=name)
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = view.rotation.T, -view.rotation.T @ view.translation
        SubElement(camera, "transform").text = digits(matrix.ravel())
    # The chunk's frame is the project's.
    transform = SubElement(chunk, "transform")
    for key, default in _FRAME.items():
        SubElement(transform, key).text = digits(default.ravel())
    ElementTree.indent(document)
    with atomic_path(path, overwrite=overwrite) as temporary:
        content = ElementTree.tostring(document, encoding="unicode")
        head = '<?xml version="1.0" encoding="UTF-8"?>\n'
        temporary.write_text(f"{head}{content}\n", encoding="utf-8")
    return left_out(project, views, "Metashape", "camera file")


def _add_sensor(parent: ElementTree.Element, number: int, name: str, view: OpencvCamera) -> None:
    """Add the sensor of a camera with its calibration."""
    (width, height), d = view.size, view.coefficients
    kind = "fisheye" if view.fisheye else "frame"
    sensor = SubElement(parent, "sensor", id=str(number), label=name, type=kind)
    size = {"width": str(width), "height": str(height)}
    SubElement(sensor, "resolution", size)
    node = SubElement(sensor, "calibration", {"type": kind, "class": "adjusted"})
    SubElement(node, "resolution", size)
    fx, fy = view.matrix[0, 0], view.matrix[1, 1]
    cx, cy = view.matrix[:2, 2] + 0.5 - np.array(view.size) / 2
    # p1 and p2 are exchanged against OpenCV's, see `photocore.camera.lensformats`.
    keys, terms = ("k1", "k2", "k3", "p1", "p2"), d if view.fisheye else d[[0, 1, 4, 3, 2]]
    named = zip(TERMS if view.fisheye else keys, terms.tolist(), strict=True)
    for key, value in {"f": fy, "cx": cx, "cy": cy, "b1": fx - fy, **dict(named)}.items():
        if value or key in ("f", "cx", "cy"):
            SubElement(node, key).text = f"{value:.17g}"


def _lens(sensor: ElementTree.Element, path: Path) -> LensData | str:
    """Return the lens of a sensor, or what is wrong with it."""
    kind = sensor.get("type", "frame")
    if kind not in ("frame", "fisheye"):
        return f"is of the type {kind}; projects hold frame cameras and fisheyes"
    nodes = sensor.findall("calibration")
    best = [node for node in nodes if node.get("class") == "adjusted"] or nodes
    if not best:
        return "has no calibration"
    return metashape_lens(best[0], path, fisheye=kind == "fisheye")


def _world_from_chunk(
    chunk: ElementTree.Element, path: Path
) -> tuple[FloatArray, FloatArray, float]:
    """Return rotation, translation and scale of the chunk, or of its only component."""
    node = chunk.find("./transform")
    if node is None or node.find("scale") is None:
        found = chunk.findall("./components/component/transform")
        node = found[0] if len(found) == 1 else None
    if node is None:
        return np.eye(3), np.zeros(3), 1.0
    parts = dict(_FRAME)
    for key, default in _FRAME.items():
        if (text := node.findtext(key)) is not None:
            parts[key] = _numbers(text, default.size, path, f"{key} of the chunk")
    matrix = parts["rotation"].reshape(3, 3)
    turn = checked_rotation(matrix, f"{path}: rotation of the chunk", tolerance=_PRINTED)
    return nearest_rotation(turn), parts["translation"], float(parts["scale"][0])


def _numbers(text: str, count: int, path: Path, where: str) -> FloatArray:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        raise InputError(f"{path}: the {where} holds what is no number.") from None
    if len(values) != count or not (np.abs(values) <= LARGEST).all():
        raise InputError(f"{path}: the {where} must be {count} numbers, found {len(values)}.")
    return values
