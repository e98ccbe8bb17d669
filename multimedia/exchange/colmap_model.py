"""COLMAP's text models: cameras.txt, images.txt, points3D.txt; refractive cameras too.

COLMAP counts pixels from the corner of the image and stores poses camera from world as quaternion
and translation, y down, z forwards (its documentation, Output Format). COLMAP Underwater adds to a
line of cameras.txt the name of the port and its parameters: FLATPORT Nx Ny Nz distance thickness na
ng nw, with the normal outwards in the camera frame and the distance to the inner face; DOMEPORT Cx
Cy Cz radius thickness na ng nw, the radius being that of the inner face.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path, PurePosixPath

import numpy as np

from multimedia.exchange.opencv_camera import camera_of, inexact, opencv_of
from multimedia.media import Camera, FlatInterface, Interfaces, Sphere
from multimedia.projects import FLIP, ImagePoints, ObjectPoints, Project
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.arrays import floats_of_words
from photocore.errors import InputError
from photocore.programs import (
    CORNER,
    camera_words,
    digits,
    image_words,
    read_colmap_model,
    write_colmap_model,
)

_PORTS = ("FLATPORT", "DOMEPORT")
_NONE = -1


def read_colmap(folder: Path, *, pitch: float, unit: str) -> Project:
    """Return the project of a text model: one camera per image, with its points.

    Parameters
    ----------
    folder : path
        Holding cameras.txt, images.txt and, for object points, points3D.txt.
    pitch : float
        Width of a pixel, which COLMAP does not know. [mm]
    unit : str
        Of the model's lengths, which COLMAP does not know either.

    Raises
    ------
    InputError
        Naming file and line of what cannot be read.
    """
    model = read_colmap_model(folder)
    media = {f"port{k}": _port(words, folder / "cameras.txt")
             for k, words in model.ports.items() if words and words[0] != "NONE"}  # fmt: skip
    views, with_points = model.images, [view for view in model.images if view.ids]
    names = _names([view.name for view in views])
    cameras = tuple(
        camera_of(model.lenses[v.camera], v.rotation, v.translation, pitch=pitch, name=name)
        for v, name in zip(views, names, strict=True)
    )
    return Project(
        cameras=cameras,
        media=media,
        media_of=tuple(f"port{v.camera}" if f"port{v.camera}" in media else "" for v in views),
        object_points=ObjectPoints(ids=tuple(model.ids), xyz=model.points),
        image_points=ImagePoints(
            cameras=tuple(n for n, v in zip(names, views, strict=True) for _ in v.ids),
            ids=tuple(name for view in with_points for name in view.ids),
            image=np.concatenate([
                c.sensor.image_from_pixel(v.pixels)  # type: ignore[union-attr]
                for c, v in zip(cameras, views, strict=True) if v.ids
            ]) if with_points else np.empty((0, 2)),
        ),
        sigma_image=0.5 * pitch,
        unit=unit,
        name=folder.resolve().name,
        extra={"source": "COLMAP text model"},
    )  # fmt: skip


def write_colmap(folder: Path, project: Project, *, overwrite: bool = False) -> tuple[str, ...]:
    """Write a project as a text model; return what is not exactly as in the project."""
    views = {camera.name: opencv_of(camera) for camera in project.cameras}
    numbers = {name: str(k) for k, name in enumerate(project.object_points.ids, start=1)}
    remarks = [*inexact(views)]
    if all(name.isdecimal() and name == str(int(name)) for name in numbers):
        numbers = {name: name for name in numbers}
    elif numbers:
        remarks.append("COLMAP has numbers for points: they count from 1 in the project's order.")
    lines: dict[str, str] = {}
    images, tracks = [], {name: list[str]() for name in numbers}
    for k, (camera, view) in enumerate(zip(project.cameras, views.values(), strict=True), start=1):
        lens = camera_words(view.matrix, view.coefficients, view.size, fisheye=view.fisheye)
        content = f"{lens}{_port_words(camera, project.interface_of(k - 1))}"
        number = lines.setdefault(content, str(len(lines) + 1))
        images.append(f"{k} {image_words(view.rotation, view.translation, number, camera.name)}")
        rows = project.image_points.of_camera(camera.name)
        images.append(_keypoints(project, camera, rows, k, numbers, tracks))
    points = [
        f"{numbers[name]} {digits(place)} 128 128 128 0 {' '.join(tracks[name])}".rstrip()
        for name, place in zip(project.object_points.ids, project.object_points.xyz, strict=True)
    ]
    cameras = [f"{number} {content}" for content, number in lines.items()]
    write_colmap_model(folder, cameras, images, points, overwrite=overwrite)
    return tuple(remarks)


def _keypoints(
    project: Project,
    camera: Camera,
    rows: Sequence[int],
    number: int,
    numbers: dict[str, str],
    tracks: dict[str, list[str]],
) -> str:
    """Return the line of points of an image, and note them in the tracks of their points."""
    assert camera.sensor is not None  # opencv_of has looked
    pixels = camera.sensor.pixel_from_image(project.image_points.image[list(rows)]) + CORNER
    parts = []
    for k, (row, pixel) in enumerate(zip(rows, pixels, strict=True)):
        name = project.image_points.ids[row]
        parts.append(f"{digits(pixel)} {numbers.get(name, str(_NONE))}")
        if name in tracks:
            tracks[name].append(f"{number} {k}")
    return " ".join(parts)


def _port(words: Sequence[str], path: Path) -> FlatInterface | Interfaces:
    """Return the port that the words after a lens describe, in our camera frame."""
    kind, values = words[0], floats_of_words(words[1:], path, f"{words[0]} parameters")
    if kind not in _PORTS or len(values) != 8:
        raise InputError(
            f"{path}: {kind} with {len(values)} parameters after the lens: known are "
            f"{' and '.join(_PORTS)} with 8."
        )
    if kind == "FLATPORT" and not np.linalg.norm(values[:3]) > 0:
        raise InputError(f"{path}: FLATPORT: its normal must not be zero; expected Nx Ny Nz.")
    first, (size, thickness), indices = FLIP @ values[:3], values[3:5], tuple(values[5:].tolist())
    if kind == "FLATPORT":
        return FlatInterface(
            layers=Layers(indices=indices, thicknesses=(float(thickness),)),
            point=first / np.linalg.norm(first) * (size + thickness),
            normal=-first,
            moves_with_camera=True,
        )
    return Interfaces(
        surfaces=tuple(Sphere(centre=first, radius=float(r)) for r in (size, size + thickness)),
        indices=indices,
        with_camera=(True, True),
    )


def _port_words(camera: Camera, media: FlatInterface | Interfaces | None) -> str:
    """Return what follows the lens in cameras.txt: nothing, or the port as the camera has it."""
    if media is None:
        return ""
    if isinstance(media, FlatInterface) and len(media.indices) in (2, 3):
        glass = float(sum(media.layers.thicknesses))
        medium = media.medium(camera)
        indices = media.indices if len(media.indices) == 3 else (*media.indices, media.indices[1])
        distance = float(medium.height - glass)
        normal = -(FLIP @ medium.normal)
        return f" FLATPORT {digits([*normal, distance, glass, *indices])}"
    if isinstance(media, Interfaces) and len(media.surfaces) == 2:
        inner, outer = media.surfaces
        if isinstance(inner, Sphere) and isinstance(outer, Sphere):
            first, second = (
                FLIP @ (s.centre if moves else camera.vectors_to(s.centre))
                for s, moves in zip((inner, outer), media.with_camera, strict=True)
            )
            if np.abs(first - second).max() <= 1e-12 * inner.radius:
                wall = outer.radius - inner.radius
                return f" DOMEPORT {digits([*first, inner.radius, wall, *media.indices])}"
    raise InputError(remark("exchange.colmap_media", name=camera.name))


def _names(names: Sequence[str]) -> list[str]:
    """Return the names of photos without folder and ending where that leaves them different."""
    short = [PurePosixPath(name).stem for name in names]
    return short if len(set(short)) == len(short) else list(names)
