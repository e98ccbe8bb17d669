"""Metashape's cameras as XML (File, Export, Export Cameras, Agisoft XML).

A camera's transform is world from camera, 4 x 4 row by row, y down and z forwards, in the frame of
the chunk, whose own transform (rotation, translation, scale) leads to the world. Image points count
from the corner of the image: u = w / 2 + cx + x' f + x' b1, v = h / 2 + cy + y' f.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from photocore.arrays import FloatArray, floats_of_words
from photocore.camera.lensformats import LensData, metashape_lens, xml_root
from photocore.camera.rotation import checked_rotation, nearest_rotation
from photocore.errors import InputError
from photocore.programs.model import ForeignProject, ForeignView
from photocore.textfile import read_text

#: The chunk's transform where it has none: its frame is the world's.
FRAME = dict[str, FloatArray](rotation=np.eye(3), translation=np.zeros(3), scale=np.ones(1))
#: Printed matrices have at least so many digits.
_PRINTED = 1e-5


def read_metashape_project(path: Path) -> ForeignProject:
    """Return the aligned cameras of the first chunk; no points.

    Raises
    ------
    InputError
        Naming what is missing or cannot be used.
    """
    root = xml_root(path, read_text(path, "Metashape file", form=" (XML)"))
    chunk = root if root.tag == "chunk" else root.find(".//chunk")
    if chunk is None:
        raise InputError(f"{path}: holds no chunk; export the cameras as Agisoft XML.")
    sensors = chunk.findall("./sensors/sensor")
    lenses = {sensor.get("id", ""): _lens(sensor, path) for sensor in sensors}
    rotation, translation, scale = _world_from_chunk(chunk, path)
    views: list[ForeignView] = []
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
        views.append(ForeignView(name, lens, world.T, centre))
    if not views:
        raise InputError(f"{path}: holds no aligned camera.")
    scaled = "the chunk's transform" if chunk.find("./transform/scale") is not None else ""
    return ForeignProject("Metashape", tuple(views), metres=scaled, remarks=tuple(remarks))


def _lens(sensor: ElementTree.Element, path: Path) -> LensData | str:
    """Return the lens of a sensor, or what is wrong with it."""
    kind = sensor.get("type", "frame")
    if kind not in ("frame", "fisheye"):
        return f"is of the type {kind}; frame cameras and fisheyes alone are read; leave it out"
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
    parts = dict(FRAME)
    for key, default in FRAME.items():
        if (text := node.findtext(key)) is not None:
            parts[key] = _numbers(text, default.size, path, f"{key} of the chunk")
    matrix = parts["rotation"].reshape(3, 3)
    turn = checked_rotation(matrix, f"{path}: rotation of the chunk", tolerance=_PRINTED)
    return nearest_rotation(turn), parts["translation"], float(parts["scale"][0])


def _numbers(text: str, count: int, path: Path, where: str) -> FloatArray:
    values = floats_of_words(text.split(), path, where)
    if len(values) != count:
        raise InputError(f"{path}: the {where} must be {count} numbers, found {len(values)}.")
    return values
