"""The project file: TOML a person can read, with tables of points beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.media import (
    EXTERIOR,
    Camera,
    Cylinder,
    Distortion,
    FlatInterface,
    Interfaces,
    MeshSurface,
    Plane,
    RasterSurface,
    RefractingSurface,
    Sensor,
    Sphere,
    WaveSurface,
)
from multimedia.projects.camera_poses import POSE_KEYS, read_pose
from multimedia.projects.model import (
    SIGMA_IMAGE,
    SIGMA_PIXEL,
    ImagePoints,
    ObjectPoints,
    Project,
    refuse_repeated,
)
from multimedia.projects.point_tables import (
    METRES,
    image_columns,
    object_columns,
    read_image_points,
    read_object_points,
    write_columns,
)
from multimedia.projects.surface_files import read_mesh, read_raster, wave_rows, waves_of
from multimedia.refraction import Layers
from multimedia.remarks import remark
from photocore.arrays import is_finite_number, positive
from photocore.camera import NAMES, Brown, Convention, Fisheye
from photocore.errors import GeometryError, InputError, located
from photocore.output import all_or_none, atomic_path, check_all_writable, relative_name
from photocore.sections import FileSection
from photocore.tables.csvwrite import Columns
from photocore.textfile import check_name, read_toml

FORMAT = "multimedia-project/1"
#: Each kind of ray-traced surface and its keys.
_KINDS: Mapping[str, tuple[Callable[..., RefractingSurface], tuple[str, ...]]] = {
    "plane": (Plane, ("point", "normal")),
    "sphere": (Sphere, ("centre", "radius")),
    "cylinder": (Cylinder, ("point", "axis", "radius")),
    "raster": (RasterSurface, ("file",)),
    "mesh": (MeshSurface, ("file",)),
    "waves": (WaveSurface, ("level", "waves")),
}
#: Surfaces whose form lies in a file beside the project.
_FILED: Mapping[str, Callable[[Path], Any]] = {"raster": read_raster, "mesh": read_mesh}
_SENSOR_KEYS = ("width", "height", "pitch", "origin")
_HEAD = """\
# Project of the `multimedia` commands; object lengths in `unit`, image lengths in mm, angles in
# degrees. Tables of points: paths relative to this file.
"""


def read_project(path: Path | str, *, posed: bool = True) -> Project:
    """Read a project file and its tables.

    Parameters
    ----------
    path : path
        The project file (.toml).
    posed : bool
        Refuse cameras whose pose the file leaves out; otherwise they are `Project.without_pose`.

    Returns
    -------
    Project
        With the points of its tables.

    Raises
    ------
    InputError
        Naming file, section and key.
    GeometryError
        If a camera is impossible.
    """
    path = Path(path)
    data = _toml(path)
    try:
        project = _project(data, path.parent)
        if posed and project.without_pose:
            raise InputError(remark("project.without_pose", names=", ".join(project.without_pose)))
        return project
    except GeometryError as error:
        raise GeometryError(f"{path}: {error}") from None
    except InputError as error:
        if type(error) is not InputError or str(error).startswith(str(path.parent / "")):
            raise
        raise InputError(f"{path}: {error}") from None


def project_files(path: Path | str) -> tuple[Path, ...]:
    """Return a project file and the tables and surfaces it names, whether they are there or not.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    path = Path(path)
    data = _toml(path)
    names = [data.get(key) for key in ("object_points", "image_points")]
    media = data.get("media")
    for section in media.values() if isinstance(media, Mapping) else ():
        surfaces = section.get("surfaces") if isinstance(section, Mapping) else None
        for surface in surfaces if isinstance(surfaces, list) else ():
            names += [surface.get("file")] if isinstance(surface, Mapping) else []
    return (path, *(path.parent / name for name in names if isinstance(name, str)))


def write_project(path: Path | str, project: Project, *, overwrite: bool = False) -> list[Path]:
    """Write a project file and, beside it, the tables it names.

    The tables are called after the project: ``tank.toml`` goes with ``tank_object_points.csv``
    and ``tank_image_points.csv``.

    Parameters
    ----------
    path : path
        The project file (.toml).
    project : Project
        What is written.
    overwrite : bool
        Whether existing files may be replaced.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        If a file exists and ``overwrite`` is false.
    """
    import tomli_w

    path = Path(path)
    data = project_data(project, path.parent)
    tables: dict[Path, Columns] = {}
    if project.object_points.ids:
        table = path.with_name(f"{path.stem}_object_points.csv")
        data["object_points"] = table.name
        tables[table] = object_columns(project.object_points, project.unit)
    if project.image_points.ids:
        table = path.with_name(f"{path.stem}_image_points.csv")
        data["image_points"] = table.name
        tables[table] = image_columns(project.image_points, project.cameras)
    # Tables (arrays of them too) must follow the plain keys.
    order = sorted(data, key=lambda key: isinstance(data[key], dict | list))
    check_all_writable(path, *tables, overwrite=overwrite)
    with all_or_none():
        for table, columns in tables.items():
            write_columns(table, columns, overwrite=overwrite)
        with atomic_path(path, overwrite=overwrite) as temporary:
            text = _HEAD + tomli_w.dumps({key: data[key] for key in order})
            temporary.write_text(text, encoding="utf-8")
    return [path, *tables]


def project_data(project: Project, folder: Path) -> dict[str, object]:
    """Return the content of the project file in a folder, without the names of the tables."""
    data: dict[str, object] = {"format": FORMAT}
    if project.name:
        data["name"] = project.name
    data["unit"] = project.unit
    data["sigma_image"] = float(project.sigma_image)
    data["media"] = {name: _media_data(media, folder) for name, media in project.media.items()}
    data["camera"] = [
        _camera_data(camera, media, posed=camera.name not in project.without_pose)
        for camera, media in zip(project.cameras, project.media_of, strict=True)
    ]
    return data | {k: v for k, v in project.extra.items() if k not in data}


#: Keys of media; at the top of a file, where unknown keys are kept, they would have no effect.
_OF_MEDIA = frozenset(("layers", "indices", "thicknesses", "surfaces", "medium", "gradient"))


def _toml(path: Path) -> dict[str, object]:
    check_name(path)
    if path.is_dir():
        raise InputError(remark("project.is_folder", of=path))
    return read_toml(path, "project file")


def _project(data: dict[str, object], folder: Path) -> Project:
    form = data.pop("format", None)
    if form != FORMAT:
        raise InputError(f'format must be "{FORMAT}", found {form!r}.')
    unit = str(data.pop("unit", "m"))
    if unit not in METRES:
        raise InputError(f"unit: {unit!r} is no unit of length; choose {', '.join(METRES)}.")
    for key in sorted(_OF_MEDIA & data.keys()):
        raise InputError(remark("project.media_section", of=key))
    described = data.pop("media", {})
    if not isinstance(described, dict):
        raise InputError("media: expected sections such as [media.tank].")
    media = {name: _media(value, f"media.{name}", folder) for name, value in described.items()}
    sections = data.pop("camera", [])
    if not isinstance(sections, list) or not sections:
        raise InputError("there is no camera; add at least one section [[camera]].")
    triples = [_camera(value, number) for number, value in enumerate(sections, start=1)]
    cameras = tuple(camera for camera, *_ in triples)
    refuse_repeated([camera.name for camera in cameras], "cameras")
    remarks = [
        f"media.{label}: {remark}" for label, item in media.items() for remark in item.remarks
    ]
    objects, images = ObjectPoints(), ImagePoints()
    if "object_points" in data:
        table = folder / _file_name(data.pop("object_points"), "object_points")
        objects, odd = read_object_points(table, unit=unit)
        remarks += [f"{table.name}: {text}" for text in odd]
    if "image_points" in data:
        table = folder / _file_name(data.pop("image_points"), "image_points")
        images, odd = read_image_points(table, cameras)
        remarks += [f"{table.name}: {text}" for text in odd]
    return Project(
        cameras=cameras,
        media=media,
        media_of=tuple(name for _, name, _ in triples),
        object_points=objects,
        image_points=images,
        sigma_image=_sigma(data, cameras),
        unit=unit,
        name=str(data.pop("name", "")),
        extra=data,
        remarks=tuple(remarks),
        without_pose=tuple(camera.name for camera, _, is_posed in triples if not is_posed),
    )


def _sigma(data: dict[str, object], cameras: tuple[Camera, ...]) -> float:
    """Return the precision of an image coordinate: as given, else half a pixel. [mm]"""
    if "sigma_image" in data:
        value = FileSection(data, "project").number("sigma_image")
        del data["sigma_image"]
        return positive(value, "sigma_image", unit="mm")
    pitches = [camera.sensor.pixel_size.mean() for camera in cameras if camera.sensor is not None]
    return SIGMA_PIXEL * float(np.mean(pitches)) if pitches else SIGMA_IMAGE


def _media(value: Any, where: str, folder: Path) -> FlatInterface | Interfaces:
    if isinstance(value, Mapping) and "surfaces" in value:
        return _surfaces(value, where, folder)
    flat = ("indices", "thicknesses", "point", "normal", "moves_with_camera")
    section = FileSection(value, where, (*flat, *_GRADED))
    layers = Layers.from_dict(value, where=where)
    point = section.numbers("point", (3,), default=(0, 0, 0))
    normal = section.numbers("normal", (3,), default=(0, 0, 1))
    moves = section.flag("moves_with_camera")
    if graded := _graded(section):
        traced = Interfaces.parallel(layers, point=point, normal=normal, with_camera=moves)
        return replace(traced, **graded)
    return FlatInterface(layers=layers, point=point, normal=normal, moves_with_camera=moves)


#: Keys of a last medium whose index changes with depth, and the attributes they become.
_GRADED = {"gradient": "gradient", "gradient_level": "level"}


def _graded(section: FileSection) -> dict[str, Any]:
    """Return by how much the index of the last medium grows with depth, and from which level."""
    return {name: section.number(key) for key, name in _GRADED.items() if key in section}


def _surfaces(value: Mapping[str, object], where: str, folder: Path) -> Interfaces:
    """Return ray-traced surfaces of any form."""
    section = FileSection(value, where, ("indices", "surfaces", *_GRADED))
    listed = section["surfaces"]
    if not isinstance(listed, list) or not listed:
        raise InputError(f"{where}: surfaces must be a list of sections, camera side first.")
    pairs = [_surface(item, f"{where}, surface {k}", folder) for k, item in enumerate(listed, 1)]
    surfaces, moving = zip(*pairs, strict=True)
    indices = section.get("indices")
    if not isinstance(indices, list):
        raise InputError(f"{where}: indices must be a list of numbers, camera side first.")
    graded = _graded(section)
    with located(where):
        return Interfaces(surfaces=surfaces, indices=tuple(indices), with_camera=moving, **graded)


def _surface(item: Any, place: str, folder: Path) -> tuple[RefractingSurface, bool]:
    """Return one ray-traced surface, and whether it moves with the camera."""
    kind = str(item.get("kind", "")) if isinstance(item, Mapping) else ""
    if kind not in _KINDS:
        raise InputError(f"{place}: kind must be one of {', '.join(_KINDS)}, found {kind!r}.")
    form, keys = _KINDS[kind]
    section = FileSection(item, place, ("kind", "moves_with_camera", *keys))
    surface: RefractingSurface
    if kind in _FILED:
        surface = _FILED[kind](folder / _file_name(section["file"], f"{place}, file"))
    elif kind == "waves":
        rows = section["waves"]
        good = isinstance(rows, list) and all(isinstance(row, list) for row in rows)
        if not good or not all(is_finite_number(v) for row in rows for v in row):
            raise section.wrong("waves", "a list of [amplitude, length, direction, phase]")
        surface = waves_of(section.number("level"), rows, place)
    else:
        read = (section.number(k) if k == "radius" else section.numbers(k, (3,)) for k in keys)
        surface = form(**dict(zip(keys, read, strict=True)))
    return surface, section.flag("moves_with_camera")


def _media_data(media: FlatInterface | Interfaces, folder: Path) -> dict[str, object]:
    if isinstance(media, Interfaces):
        graded = {key: getattr(media, name) for key, name in _GRADED.items() if media.is_graded}
        return {
            "indices": list(media.indices),
            **graded,
            "surfaces": [
                _surface_data(surface, folder) | ({"moves_with_camera": True} if moves else {})
                for surface, moves in zip(media.surfaces, media.with_camera, strict=True)
            ],
        }
    moves = {"moves_with_camera": True} if media.moves_with_camera else {}
    return {**media.layers.as_dict(), **_plain(media, "point", "normal"), **moves}


def _surface_data(surface: RefractingSurface, folder: Path) -> dict[str, object]:
    kind = next((kind for kind, (form, _) in _KINDS.items() if type(surface) is form), "")
    if isinstance(surface, WaveSurface):
        return {"kind": kind, "level": float(surface.level), "waves": wave_rows(surface)}
    if isinstance(surface, RasterSurface | MeshSurface) and surface.source:
        return {"kind": kind, "file": relative_name(surface.source, folder)}
    if kind and kind not in _FILED:
        return {"kind": kind} | _plain(surface, *_KINDS[kind][1])
    raise InputError(
        f"a {type(surface).__name__} cannot be written into a project file; it holds "
        f"{', '.join(k for k in _KINDS if k not in _FILED)}, and {' and '.join(_FILED)} read from "
        "a file."
    )


def _plain(value: object, *keys: str) -> dict[str, object]:
    """Return attributes as a file holds them."""
    return {key: np.asarray(getattr(value, key)).tolist() for key in keys}


#: What a fisheye lens has in place of a convention of Brown's formula.
_FISHEYE = "fisheye"
_CAMERA_KEYS = ("name", "media", *POSE_KEYS, "c", "principal_point", "distortion", "sensor")


def _camera(value: Any, number: int) -> tuple[Camera, str, bool]:
    """Return a camera, its media, and whether its section states a pose."""
    section = FileSection(value, f"camera {number}", _CAMERA_KEYS)
    name = str(section.get("name", f"cam{number}"))
    where = section.where = f"camera {name}"
    is_posed = any(key in section for key in POSE_KEYS)
    centre, rotation = read_pose(section) if is_posed else (np.zeros(3), np.eye(3))
    c = section.number("c")
    sensor = _sensor(section["sensor"], where) if "sensor" in section else None
    if sensor is not None and c > 100.0 * sensor.half_diagonal:
        raise InputError(
            f"{where}: c = {c:g} but the sensor is only {2 * sensor.half_diagonal:.4g} mm across. "
            "Is c in pixels, or the pitch in micrometres? Both are in mm."
        )
    camera = Camera(
        centre=centre,
        rotation=rotation,
        principal_distance=c,
        principal_point=section.numbers("principal_point", (2,), default=(0, 0)),
        distortion=_distortion(value.get("distortion", {}), where, c),
        sensor=sensor,
        name=name,
    )
    return camera, str(value.get("media", "")), is_posed


def _camera_data(camera: Camera, media: str, *, posed: bool) -> dict[str, object]:
    data: dict[str, object] = {"name": camera.name, **({"media": media} if media else {})}
    if posed:
        data["centre"] = camera.centre.tolist()
        data |= dict(zip(EXTERIOR[3:], np.degrees(camera.angles).tolist(), strict=True))
    data["c"] = camera.principal_distance
    data["principal_point"] = camera.principal_point.tolist()
    lens = camera.distortion
    if lens != Brown():
        # Without terms too the convention counts: terms estimated later are of it.
        convention = _FISHEYE if isinstance(lens, Fisheye) else lens.convention.value
        terms = {name: float(getattr(lens, name)) for name in lens.names}
        data["distortion"] = {"convention": convention} | terms
    if (sensor := camera.sensor) is not None:
        size = {"pitch": sensor.pixel_size.tolist()}
        data["sensor"] = _plain(sensor, "width", "height") | size | _plain(sensor, "origin")
    return data


def _sensor(value: Any, where: str) -> Sensor:
    where = f"{where}, sensor"
    section = FileSection(value, where, _SENSOR_KEYS)
    if isinstance(pitch := section.get("pitch"), int | float):
        section = FileSection({**value, "pitch": [pitch, pitch]}, where)
    size = section.numbers("pitch", (2,))
    if (size > 0.2).any():
        raise InputError(f"{where}: a pitch of {size.tolist()} mm? Typical are 0.002 to 0.03 mm.")
    origin = section.numbers("origin", (2,)) if "origin" in section else None
    width, height = (section.number(key) for key in ("width", "height"))
    return Sensor(width=width, height=height, pixel_size=size, origin=origin)  # type: ignore[arg-type]


def _distortion(value: Any, where: str, c: float) -> Distortion:
    where = f"{where}, distortion"
    fisheye = isinstance(value, Mapping) and value.get("convention") == _FISHEYE
    names = Fisheye.names if fisheye else NAMES
    section = FileSection(value, where, ("convention", *names))
    terms = {name: section.number(name) for name in names if name in section}
    if fisheye:
        with located(where):
            return Fisheye(**terms)
    convention = str(section.get("convention", Convention.BROWN.value))
    if convention == "opencv":
        values = [terms.get(name, 0.0) for name in ("k1", "k2", "p1", "p2", "k3")]
        if "scale" in terms or "shear" in terms:
            raise InputError(f"{where}: OpenCV's model has no scale and shear.")
        return Brown.from_opencv(values, principal_distance=c)
    rules = {item.value: item for item in Convention}
    if convention not in rules:
        raise InputError(
            f"{where}: convention {convention!r} is not known; choose {', '.join(rules)}, opencv "
            f"or {_FISHEYE}."
        )
    return Brown(**terms, convention=rules[convention])


def _file_name(value: Any, key: str) -> str:
    if not isinstance(value, str):
        raise InputError(f"{key}: expected the name of a table, found {value!r:.40}.")
    return value
