"""Faces from files: GeoJSON, drawings, and those that are kept beside a pair."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.faces.faces import BreakLine, Face, Faces, Occluder
from bifocal.files import without_ending
from bifocal.model import Photo
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.output import check_ending

#: What is drawn on layers whose names hold these words.
LAYERS = ("FACE", "BREAK", "OCCLUDER")
#: Behind the pair's name.
ENDING = ".faces.geojson"
#: Given instead of a file: those beside the pair are left alone.
NONE = "none"
#: No façade goes deeper behind its wall, in distances of the near camera.
DEEPEST = 10.0


def read_faces(path: Path) -> Faces:
    """Return the faces, break lines and occluders of a GeoJSON file or a DXF drawing.

    Raises
    ------
    InputError
        If the file is missing or damaged, or what it holds is none of these.
    """
    check_ending(path, remark("faces.ending"), ".geojson", ".json", ".dxf")
    faces = _read_drawing(path) if path.suffix.lower() == ".dxf" else Faces.read(path)
    if not faces:
        raise InputError(remark("faces.none", path=path))
    return faces


def beside(source: Path | str) -> Path:
    """Return where the faces of a pair, set or survey workbook are kept.

    Examples
    --------
    >>> beside("site/wall.pair.json").as_posix()
    'site/wall.faces.geojson'
    """
    path = Path(source)
    return path.with_name(without_ending(path.name) + ENDING)


def faces_path(faces: Path | None, *sources: object) -> Path | None:
    """Return the file of faces that is given, else the first kept beside a source; None: none."""
    if faces is not None:
        return None if faces.name == NONE else faces
    places = [beside(source) for source in sources if isinstance(source, Path | str)]
    return next((place for place in places if place.exists()), None)


def given_faces(given: Faces | Path | None) -> tuple[Faces | None, tuple[str, ...]]:
    """Return faces as they are, or those of a file, and what to say of them."""
    if given is None or isinstance(given, Faces):
        return given, ()
    faces = read_faces(given)
    about = {"name": given.name, "faces": len(faces.faces), "breaks": len(faces.breaks)}
    return faces, (remark("faces.used", occluders=len(faces.occluders), **about),)


def check_faces(faces: Faces | None, photos: Sequence[Photo]) -> tuple[str, ...]:
    """Refuse faces at a relief where no wall can be; return which of them no photo shows.

    Raises
    ------
    InputError
        If one lies beyond a camera, or farther behind the wall than any façade is deep.
    """
    near = min(photo.distance for photo in photos)
    shown = [box for photo in photos if (box := _shown(photo)) is not None]
    remarks = []
    for face in faces.faces if faces else ():
        corners = face.rings[0]
        r = face.points[:, 2]
        if face.plane is not None:
            r = face.plane[0] + corners @ face.plane[1:]
        finite = r[np.isfinite(r)]
        if len(finite) and not (-DEEPEST * near < finite.min() and finite.max() < near):
            about = {"name": face.name, "low": finite.min(), "high": finite.max(), "near": near}
            raise InputError(remark("faces.beyond", **about))
        low, high = corners.min(axis=0), corners.max(axis=0)
        if len(shown) == len(photos) and not any(
            (low <= box[1]).all() and (high >= box[0]).all() for box in shown
        ):
            remarks.append(remark("faces.outside", name=face.name))
    return tuple(remarks)


def _shown(photo: Photo) -> tuple[FloatArray, FloatArray] | None:
    """Return the least and greatest X, Y that a photo shows of the wall; None: not known."""
    if photo.image_size is None:
        return None
    width, height = photo.image_size
    edge = np.array([[0, 0], [width, 0], [0, height], [width, height]], np.float64) - 0.5
    places = photo.plane_from_pixels(edge)
    return (places.min(axis=0), places.max(axis=0)) if np.isfinite(places).all() else None


def keep_faces(faces: Path | None, source: Path) -> tuple[str, ...]:
    """Keep faces that are given for the first time beside the pair, for later runs; say so."""
    if faces is None or faces.name == NONE or not source.is_file():
        return ()
    kept = beside(source)
    if not kept.exists():
        with suppress(InputError, OSError):  # a folder that cannot be written keeps nothing
            read_faces(faces).write(kept)
            return (remark("faces.kept", name=kept.name),)
    elif kept.resolve() != faces.resolve():
        return (remark("faces.others_kept", name=kept.name),)
    return ()


def _read_drawing(path: Path) -> Faces:
    """Return what stands on the layers of a DXF drawing, in metres whatever its unit."""
    import ezdxf
    from ezdxf import units

    try:
        drawing = ezdxf.readfile(path)
    except (OSError, ezdxf.DXFError, UnicodeError) as error:
        raise InputError(remark("faces.drawing", path=path, why=error)) from None
    metres = 1.0
    if drawing.units:
        metres = float(units.conversion_factor(units.InsertUnits(drawing.units), units.M))
    shapes: dict[str, list[Any]] = {layer: [] for layer in LAYERS}
    for entity in drawing.modelspace().query("LINE LWPOLYLINE POLYLINE"):
        layer = next((word for word in LAYERS if word in entity.dxf.layer.upper()), None)
        if layer is None:
            continue
        corners, closed = _corners(entity)
        corners = corners * metres
        name = f"{entity.dxf.layer} {entity.dxf.handle}"
        if layer == "BREAK":
            line = np.vstack([corners, corners[:1]]) if closed else corners
            shapes[layer].append(BreakLine(name=name, line=_without_zero(line)))
            continue
        if not closed or len(corners) < 3:
            raise InputError(remark("faces.not_closed", path=path, name=name))
        rings = (np.ascontiguousarray(corners[:, :2]),)
        shapes[layer].append(
            Occluder(name=name, rings=rings) if layer == "OCCLUDER" else _face(name, rings, corners)
        )
    return Faces(*(tuple(shapes[layer]) for layer in LAYERS))


def _corners(entity: Any) -> tuple[FloatArray, bool]:
    """Return the corners of a line or polyline, (n, 3), and whether it is closed."""
    kind = entity.dxftype()
    if kind == "LINE":
        return np.array([entity.dxf.start, entity.dxf.end], float), False
    if kind == "LWPOLYLINE":
        flat = np.array([point[:2] for point in entity.get_points()], float)
        rise = float(entity.dxf.get("elevation", 0.0))
        corners = np.column_stack([flat, np.full(len(flat), rise)])
    else:
        corners = np.array([vertex.dxf.location for vertex in entity.vertices], float)
    shut = bool(entity.closed if kind == "LWPOLYLINE" else entity.is_closed)
    ends = len(corners) > 3 and bool((corners[0] == corners[-1]).all())
    return corners[:-1] if ends else corners, shut or ends


def _without_zero(corners: FloatArray) -> FloatArray:
    """Return corners of which those drawn flat, all at 0, say nothing about relief."""
    if corners[:, 2].any():
        return corners
    return np.column_stack([corners[:, :2], np.full(len(corners), np.nan)])


def _face(name: str, rings: tuple[FloatArray, ...], corners: FloatArray) -> Face:
    """Return the face of a closed polyline: at its elevation, or through its corners."""
    z = corners[:, 2]
    if not z.any():
        return Face(name=name, rings=rings)
    if np.ptp(z) == 0:
        return Face(name=name, rings=rings, plane=np.array([z[0], 0.0, 0.0]))
    points = np.column_stack([corners, np.full(len(corners), np.nan)])
    return Face(name=name, rings=rings, points=points)
