"""Faces, break lines and occluders: what a person draws of a wall, in X, Y of the plane frame."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from bifocal.model import Grid
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray, as_floats, positive
from photocore.errors import LARGEST, InputError, located
from photocore.jsonfile import plain, read_object, write_object
from photocore.provenance import digest_of

Ring = FloatArray
Kind = Literal["face", "break", "occluder"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Face:
    """A part of the wall that is one plane: a window, a shutter, a door leaf, a reveal.

    Attributes
    ----------
    name : str
    rings : tuple of ndarray, shape (n, 2)
        Its outline, then holes in it: X, Y of the plane frame. [m]
    plane : ndarray, shape (3,), optional
        Relief at X = Y = 0 and its slopes: ``r = plane[0] + plane[1] X + plane[2] Y``. [m, -, -]
    points : ndarray, shape (n, 4)
        X, Y, r of points on it and sigma of r, NaN where not known: where no plane is given, they
        tell it; where there are none either, the relief measured inside does. [m]
    sigma : float, optional
        Standard deviation of a given plane. [m]
    mends : float, optional
        Of a suggested face the share of the picture that is not measured and lies within.
    """

    name: str = ""
    rings: tuple[Ring, ...]
    plane: FloatArray | None = None
    points: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    sigma: float | None = None
    mends: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BreakLine:
    """An edge of the relief, across which the two sides do not mix: a jamb, a cornice.

    Attributes
    ----------
    name : str
    line : ndarray, shape (n, 3)
        X, Y and relief of the edge, NaN where not given; given, the side that is nearer to it in
        relief runs up to it. [m]
    """

    name: str = ""
    line: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Occluder:
    """What stands before the wall and is none of it: a tree, a car, a cable.

    Attributes
    ----------
    name : str
    rings : tuple of ndarray, shape (n, 2)
        What it covers in photo 1, as X, Y where the wall would be. [m]
    relief : float, optional
        Its own: with it one knows what it covers in other photos. [m]
    """

    name: str = ""
    rings: tuple[Ring, ...]
    relief: float | None = None


@dataclass(frozen=True, slots=True)
class Faces:
    """All that was drawn of a wall; where faces overlap the later one counts.

    Attributes
    ----------
    faces : tuple of Face
    breaks : tuple of BreakLine
    occluders : tuple of Occluder

    Examples
    --------
    >>> door = Face(name="door", rings=(np.array([[0, 0], [1, 0], [1, 2], [0, 2.0]]),),
    ...             plane=np.array([-0.24, 0, 0]))
    >>> again = Faces.from_dict(Faces(faces=(door,)).to_dict())
    >>> again.faces[0].name, again.faces[0].plane.tolist(), len(again)
    ('door', [-0.24, 0.0, 0.0], 1)
    """

    faces: tuple[Face, ...] = ()
    breaks: tuple[BreakLine, ...] = ()
    occluders: tuple[Occluder, ...] = ()

    def __len__(self) -> int:
        """Return how many things were drawn."""
        return len(self.faces) + len(self.breaks) + len(self.occluders)

    @classmethod
    def read(cls, path: Path | str) -> Faces:
        """Return what a GeoJSON file holds; `bifocal.faces.faces_files` reads drawings, too.

        Raises
        ------
        InputError
            If it is missing or damaged, or a feature is none of these.
        """
        data = read_object(path, what="GeoJSON file of faces")
        with located(path):
            return cls.from_dict(data)

    @classmethod
    def from_dict(cls, data: Mapping[str, object]) -> Faces:
        """Return what a GeoJSON object holds; raise as `read`."""
        items = data.get("features", [data])
        if not isinstance(items, list):
            raise InputError(remark("faces.no_features"))
        shapes: dict[str, list[Any]] = {"face": [], "break": [], "occluder": []}
        for number, item in enumerate(items, start=1):
            try:
                kind, shape = _shape_of(item)
                shapes[kind].append(shape)
            except (KeyError, TypeError, ValueError, AttributeError) as error:
                raise InputError(remark("faces.unusable", number=number, why=_why(error))) from None
        return cls(*(tuple(shapes[kind]) for kind in ("face", "break", "occluder")))

    def to_dict(self) -> dict[str, object]:
        """Return it as a GeoJSON object."""
        features = [*map(_face_feature, self.faces)]
        for edge in self.breaks:
            has_relief = np.isfinite(edge.line[:, 2]).all()
            line = edge.line if has_relief else edge.line[:, :2]
            features.append(_feature("break", edge.name, "LineString", line.tolist()))
        for one in self.occluders:
            more = {} if one.relief is None else {"relief": one.relief}
            features.append(_feature("occluder", one.name, "Polygon", _closed(one.rings), **more))
        return {"type": "FeatureCollection", "features": features}

    @property
    def digest(self) -> str:
        """What tells them from others: 16 letters; empty where there are none."""
        return digest_of(plain(self.to_dict()))[:16] if self else ""

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write a GeoJSON file; `read` reads it back."""
        write_object(path, self.to_dict(), overwrite=overwrite, as_is=True)


def inside(rings: tuple[Ring, ...], grid: Grid) -> BoolArray:
    """Return the pixels of a grid whose centres lie within rings, holes left out.

    Exact at any pixel size: each row of centres is cut with the edges themselves (even-odd rule).
    """
    crossings = np.zeros((grid.height, grid.width + 1), np.int32)
    for ring in rings:
        start = grid.pixel_of(ring)
        for (c0, r0), (c1, r1) in zip(start, np.roll(start, -1, axis=0), strict=True):
            low, high = sorted((r0, r1))
            first, last = max(int(np.ceil(low)), 0), min(int(np.ceil(high)), grid.height)
            if first >= last:
                continue
            rows = np.arange(first, last)
            columns = c0 + (rows - r0) * (c1 - c0) / (r1 - r0)
            at = np.clip(np.ceil(columns), 0, grid.width).astype(np.int64)
            np.add.at(crossings, (rows, at), 1)
    return np.asarray(crossings.cumsum(axis=1)[:, :-1] % 2 == 1)


def _shape_of(item: Mapping[str, Any]) -> tuple[Kind, Face | BreakLine | Occluder]:
    """Return the kind and what a feature holds."""
    entry = {**item, **(item.get("properties") or {})}
    geometry = item.get("geometry") or item
    kind, form, parts = entry["kind"], geometry["type"], geometry["coordinates"]
    name = str(entry.get("name") or "")
    if kind == "break":
        if form != "LineString":
            raise ValueError("LineString")
        return "break", BreakLine(name=name, line=_corners(parts, 2))
    if kind not in ("face", "occluder"):
        raise ValueError(f"kind {kind!r}")
    if form != "Polygon":
        raise ValueError("Polygon")
    corners = [_opened(_corners(part, 3)) for part in parts]
    rings = tuple(np.ascontiguousarray(ring[:, :2]) for ring in corners)
    if kind == "occluder":
        return "occluder", Occluder(name=name, rings=rings, relief=_number(entry, "relief"))
    relief = _number(entry, "relief")
    points: FloatArray = np.empty((0, 4))
    plane: FloatArray | None = None
    if (
        plane_given := entry.get("plane", None if relief is None else [relief, 0.0, 0.0])
    ) is not None:
        plane = as_floats(plane_given, "plane")
        if plane.shape != (3,) or not (np.abs(plane) <= LARGEST).all():
            raise ValueError("plane")
    if entry.get("points"):
        rows = [[*row, np.nan][:4] for row in entry["points"]]
        points = as_floats(rows, "points")
    elif plane is None and np.isfinite(corners[0][:, 2]).all():  # drawn in three dimensions
        points = np.column_stack([corners[0], np.full(len(corners[0]), np.nan)])
    if plane is None and len(points) and (len(points) < 3 or not np.isfinite(points[:, :3]).all()):
        raise ValueError("points")
    sigma, mends = _number(entry, "sigma"), _number(entry, "mends")
    if sigma is not None:
        positive(sigma, "sigma", unit="m")
    return "face", Face(
        name=name, rings=rings, plane=plane, points=points, sigma=sigma, mends=mends
    )


def _face_feature(face: Face) -> dict[str, object]:
    more: dict[str, object] = {}
    if face.plane is not None and not face.plane[1:].any():
        more["relief"] = float(face.plane[0])
    elif face.plane is not None:
        more["plane"] = face.plane.tolist()
    if len(face.points):
        more["points"] = [[v for v in row if np.isfinite(v)] for row in face.points.tolist()]
    more |= {key: value for key in ("sigma", "mends") if (value := getattr(face, key)) is not None}
    return _feature("face", face.name, "Polygon", _closed(face.rings), **more)


def _feature(kind: Kind, name: str, form: str, parts: Any, **more: Any) -> dict[str, object]:
    named = {"name": name} if name else {}
    return {
        "type": "Feature",
        "properties": {"kind": kind, **named, **more},
        "geometry": {"type": form, "coordinates": parts},
    }


def _closed(rings: tuple[Ring, ...]) -> list[Any]:
    """Return rings that end where they begin, as GeoJSON has them."""
    return [[*ring.tolist(), ring[0].tolist()] for ring in rings]


def _opened(ring: FloatArray) -> FloatArray:
    """Return a ring without its first point once more."""
    return ring[:-1] if len(ring) > 3 and (ring[0, :2] == ring[-1, :2]).all() else ring


def _corners(rows: Any, least: int) -> FloatArray:
    """Return positions as X, Y, relief, NaN where the last is not given."""
    corners = as_floats([[*row, np.nan][:3] for row in rows], "coordinates")
    # NaN of the relief that is not given is not above anything.
    if (
        len(corners) < least
        or not (np.abs(corners[:, :2]) <= LARGEST).all()
        or (np.abs(corners[:, 2]) > LARGEST).any()
    ):
        raise ValueError("coordinates")
    return corners


def _number(properties: Mapping[str, object], key: str) -> float | None:
    value = properties.get(key)
    if value is None:
        return None
    if not isinstance(value, int | float | str) or isinstance(value, bool):
        raise ValueError(key)
    if not abs(number := float(value)) <= LARGEST:
        raise ValueError(key)
    return number


def _why(error: Exception) -> str:
    """Return what is wrong with a feature: the key that lacks, or what is not as it should be."""
    return str(error).strip("'\"") if isinstance(error, KeyError | ValueError) else "geometry"
