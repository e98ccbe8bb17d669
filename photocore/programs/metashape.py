"""Metashape's cameras as XML (File, Export, Export Cameras, Agisoft XML).

A camera's transform is world from camera, 4 x 4 row by row, y down and z forwards, in the frame of
the chunk, whose own transform (rotation, translation, scale) leads to the world. Image points count
from the corner of the image: u = w / 2 + cx + x' f + x' b1 + y' b2,
v = h / 2 + cy + y' f.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from photocore.arrays import FloatArray, floats_of_words
from photocore.camera import (
    PROJECTIONS,
    FittedLens,
    checked_rotation,
    metashape_lens,
    nearest_rotation,
    xml_root,
)
from photocore.errors import InputError
from photocore.programs.model import ForeignProject, ForeignView, chosen_part
from photocore.remarks import remark
from photocore.textfile import read_text

#: The chunk's transform where it has none: its frame is the world's.
FRAME = dict[str, FloatArray](rotation=np.eye(3), translation=np.zeros(3), scale=np.ones(1))
#: Printed matrices have at least so many digits.
_PRINTED = 1e-5


def read_metashape_project(path: Path, part: str | None = None) -> ForeignProject:
    """Return the aligned and enabled cameras of one component of a chunk; no points.

    Cameras of two components share no frame: the largest component of the largest chunk is taken
    unless another is named, by chunk, component or both (``chunk 2/1``).

    Raises
    ------
    InputError
        Naming what is missing or cannot be used.
    """
    root = xml_root(path, read_text(path, "Metashape file", form=" (XML)"))
    chunks = [root] if root.tag == "chunk" else root.findall(".//chunk")
    if not chunks:
        raise InputError(f"{path}: holds no chunk; export the cameras as Agisoft XML.")
    parts: dict[str, tuple[ElementTree.Element, str | None]] = {}
    for number, chunk in enumerate(chunks, start=1):
        name = chunk.get("label") or f"chunk {number}"
        held = {node.get("component_id") for node in chunk.findall("./cameras//camera")}
        ids = [node.get("id", "") for node in chunk.findall("./components/component")]
        ids = [key for key in ids if key in held]
        parts |= (
            {f"{name}/{key}": (chunk, key) for key in ids} if ids[1:] else {name: (chunk, None)}
        )
    sizes = {name: len(_aligned(chunk, key)) for name, (chunk, key) in parts.items()}
    if not any(sizes.values()):
        raise InputError(f"{path}: holds no aligned camera.")
    best, remarks = chosen_part(sizes, part, path)
    chunk, component = parts[best]
    sensors = chunk.findall("./sensors/sensor")
    rolling = {sensor.get("id", "") for sensor in sensors if _is_rolling(sensor)}
    lenses = {sensor.get("id", ""): _lens(sensor, path) for sensor in sensors}
    rotation, translation, scale = _world_from_chunk(chunk, component, path)
    views: list[ForeignView] = []
    fitted: dict[str, None] = {}
    aligned = _aligned(chunk, component)
    for node, name in zip(aligned, _names(chunk, aligned, path), strict=True):
        lens = lenses.get(node.get("sensor_id", ""), "has no calibration")
        if isinstance(lens, str):
            raise InputError(f"{path}: the sensor of camera {name} {lens}.")
        fitted |= dict.fromkeys(lens[0].remarks)
        text = f"transform of camera {name}"
        matrix = _numbers(node.findtext("transform", ""), 16, path, text).reshape(4, 4)
        turn = checked_rotation(matrix[:3, :3], f"{path}: transform of {name}", tolerance=_PRINTED)
        world = rotation @ nearest_rotation(turn)
        centre = scale * (rotation @ matrix[:3, 3]) + translation
        views.append(ForeignView(name, lens[0].lens, world.T, centre, lens[1]))
    remarks += tuple(fitted)
    cameras = chunk.findall("./cameras//camera")
    off = [_name(node) for node in cameras if not _is_enabled(node)]
    if off:
        remarks += (remark("programs.disabled", count=len(off), names=", ".join(off[:5])),)
    lost = [node for node in cameras if _is_enabled(node) and node.find("transform") is None]
    remarks += tuple(f"{_name(node)}: is not aligned; left out." for node in lost)
    moving = [_name(node) for node in _aligned(chunk, component)
              if node.get("sensor_id", "") in rolling or _is_rolling(node)]  # fmt: skip
    if moving:
        about = {"count": len(moving), "names": ", ".join(moving[:5])}
        remarks += (remark("programs.rolling_shutter", **about),)
    scaled = "the chunk's transform" if chunk.find("./transform/scale") is not None else ""
    return ForeignProject("Metashape", tuple(views), metres=scaled, remarks=remarks)


def _name(camera: ElementTree.Element) -> str:
    return camera.get("label") or f"camera {camera.get('id', '')}"


def _names(chunk: ElementTree.Element, cameras: list[ElementTree.Element], path: Path) -> list[str]:
    """Return labels, with the group's before those that several cameras share."""
    groups = {camera: f"{group.get('label', '')}/" for group in chunk.findall("./cameras//group")
              for camera in group.findall("camera")}  # fmt: skip
    labels = Counter(map(_name, cameras))
    names = [groups.get(camera, "") * (labels[_name(camera)] > 1) + _name(camera)
             for camera in cameras]  # fmt: skip
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        ids = [camera.get("id", "") for camera, one in zip(cameras, names, strict=True)
               if one == name]  # fmt: skip
        raise InputError(remark("programs.alike", of=path, name=name, ids=", ".join(ids)))
    return names


def _is_enabled(camera: ElementTree.Element) -> bool:
    return camera.get("enabled", "true").strip().lower() not in ("false", "0", "no")


def _is_rolling(node: ElementTree.Element) -> bool:
    """Whether a sensor or camera was adjusted with a rolling shutter."""
    none = ("", "0", "false", "none", "disabled")
    return any(
        child.tag.startswith("rolling_shutter")
        and (len(child) > 0 or (child.text or "").strip().lower() not in none)
        for child in node
    )


def _aligned(chunk: ElementTree.Element, component: str | None) -> list[ElementTree.Element]:
    """Return the cameras of a chunk, or of a component of it, that have a place."""
    return [
        camera
        for camera in chunk.findall("./cameras//camera")
        if _is_enabled(camera)
        and camera.find("transform") is not None
        and component in (None, camera.get("component_id"))
    ]


def _lens(sensor: ElementTree.Element, path: Path) -> tuple[FittedLens, FloatArray] | str:
    """Return the lens of a sensor and the shear of its axes, or what is wrong with it."""
    kind = sensor.get("type", "frame")
    if kind not in PROJECTIONS:
        return f"is of the type {kind}; frame cameras and fisheyes alone are read; leave it out"
    nodes = sensor.findall("calibration")
    best = [node for node in nodes if node.get("class") == "adjusted"] or nodes
    if not best:
        return "has no calibration"
    return metashape_lens(best[0], path, kind)


def _world_from_chunk(
    chunk: ElementTree.Element, component: str | None, path: Path
) -> tuple[FloatArray, FloatArray, float]:
    """Return rotation, translation and scale of the chunk, or of a component of it."""
    node = None if component else chunk.find("./transform")
    if node is None or node.find("scale") is None:
        nodes = chunk.findall("./components/component")
        nodes = [part for part in nodes if component in (None, part.get("id"))]
        node = nodes[0].find("./transform") if len(nodes) == 1 else None
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
