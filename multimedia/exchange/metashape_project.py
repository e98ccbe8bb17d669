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

from multimedia.exchange.opencv_camera import OpencvCamera, camera_of, left_out, opencv_of
from multimedia.projects import Project
from photocore.camera import TERMS
from photocore.output import atomic_path
from photocore.programs import FRAME, digits, read_metashape_project


def read_metashape(path: Path, *, pitch: float, unit: str) -> Project:
    """Return the project of all aligned cameras of the first chunk; no points.

    Raises
    ------
    InputError
        Naming what is missing or cannot be used.
    """
    read = read_metashape_project(path)
    cameras = tuple(
        camera_of(
            v.lens._replace(camera_matrix=v.camera.matrix), v.rotation, -v.rotation @ v.centre,
            pitch=pitch, name=v.name,
        )
        for v in read.views
    )  # fmt: skip
    notes = (
        () if read.metres else ("the chunk has no transform: its frame and scale are arbitrary.",)
    )
    return Project(
        cameras=cameras, sigma_image=0.5 * pitch, unit=unit, name=path.stem,
        extra={"source": "Metashape"}, remarks=(*read.remarks, *notes),
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
    for key, default in FRAME.items():
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
