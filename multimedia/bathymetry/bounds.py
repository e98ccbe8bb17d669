"""What bounds a correction beside the water level: the shore on a map, classes of points."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.bathymetry.corrected_points import BathymetryStatus, CorrectedPoints
from multimedia.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import LARGEST, InputError, MissingExtraError
from photocore.jsonfile import read_object

#: Endings of the files of an area.
GEOJSON, SHAPES = (".geojson", ".json"), (".shp",)
#: The attribute that LAS calls so.
CLASS = "classification"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bounds:
    """Where water is, and which points lie in it.

    Attributes
    ----------
    rings : tuple of ndarray, shape (n, 2)
        Boundaries of all areas and of the islands in them; none: everywhere. [m]
    classes : tuple of int
        Classes of points that are corrected; none: all.
    path : Path or None
        Of the area, for messages.
    """

    rings: tuple[FloatArray, ...] = ()
    classes: tuple[int, ...] = ()
    path: Path | None = None

    def __bool__(self) -> bool:
        return bool(self.rings or self.classes)

    def hold(self, xyz: FloatArray, classes: FloatArray | None = None) -> BoolArray:
        """Return which points (..., 3) may be corrected, of their classes (...) if any count."""
        inside: BoolArray = np.ones(xyz.shape[:-1], dtype=bool)
        if self.rings:
            inside = _within(self.rings, xyz[..., :2])
        if self.classes and classes is not None:
            inside &= np.isin(classes, self.classes)
        return inside

    def applied(self, given: FloatArray, result: CorrectedPoints, inside: BoolArray,
                sigma: float) -> CorrectedPoints:  # fmt: skip
        """Return a result with all points outside as they were given, good to a sigma [m]."""
        covariance = result.covariance
        if covariance is not None:
            covariance = np.where(inside[..., None, None], covariance, sigma**2 * np.eye(3))
        return replace(
            result, xyz=np.where(inside[..., None], result.xyz, given),
            depth=np.where(inside, result.depth, 0.0), covariance=covariance,
            status=np.where(inside, result.status, BathymetryStatus.OUTSIDE),
        )  # fmt: skip


def read_bounds(area: Path | None, classes: Sequence[int]) -> Bounds:
    """Return the bounds that an area file and classes make.

    Parameters
    ----------
    area : path, optional
        Polygons of a GeoJSON (.geojson, .json) or of a shapefile (.shp), in the reference system
        of the data.
    classes : sequence of int

    Raises
    ------
    InputError
        If the file holds no polygon, or a coordinate that is none.
    """
    rings: list[FloatArray] = []
    if area is not None:
        for geometry in _geometries(area):
            rings += _rings(geometry, area)
        if not rings:
            raise InputError(remark("bathymetry.no_polygon", of=area))
    return Bounds(rings=tuple(rings), classes=tuple(classes), path=area)


def _geometries(path: Path) -> Iterator[Mapping[str, object]]:
    """Yield the geometries of a file as GeoJSON has them."""
    suffix = path.suffix.lower()
    if suffix in GEOJSON:
        yield from _geometries_of(read_object(path, what="GeoJSON of the area"))
        return
    if suffix not in SHAPES:
        raise InputError(remark("bathymetry.area_ending", of=path))
    try:
        import shapefile
    except ImportError:
        raise MissingExtraError("Reading shapefiles", "shapes") from None
    # pyshp lets through what its parts say of files that are none.
    damage = (shapefile.ShapefileException, struct.error, OSError, ValueError, IndexError)
    try:
        with shapefile.Reader(str(path)) as reader:
            yield from (shape.__geo_interface__ for shape in reader.shapes() if shape.points)
    except damage as error:
        raise InputError(remark("bathymetry.bad_shapes", of=path, error=error)) from None


def _geometries_of(part: Any) -> Iterator[Mapping[str, object]]:
    """Yield the geometries of a collection, a feature or a geometry."""
    if not isinstance(part, Mapping):
        return
    for inner in (*(part.get("features") or ()), *(part.get("geometries") or ())):
        yield from _geometries_of(inner)
    if part.get("type") == "Feature":
        yield from _geometries_of(part.get("geometry"))
    elif "coordinates" in part:
        yield part


def _rings(geometry: Mapping[str, object], path: Path) -> list[FloatArray]:
    """Return the rings of a polygon or several; none of other geometries."""
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    polygons: Any = {"Polygon": [coordinates], "MultiPolygon": coordinates}.get(str(kind), [])
    try:
        rings = [np.array([point[:2] for point in ring], float) for p in polygons for ring in p]
        # NaN is not below anything.
        good = all(ring.ndim == 2 and (np.abs(ring) <= LARGEST).all() for ring in rings)
    except (TypeError, ValueError, IndexError):
        good = False
    if not good or any(len(ring) < 3 for ring in rings):
        raise InputError(remark("bathymetry.bad_ring", of=path))
    return rings


def _within(rings: Sequence[FloatArray], xy: FloatArray) -> BoolArray:
    """Return which places (..., 2) lie within an odd number of rings: islands are not water."""
    from skimage.measure import points_in_poly

    flat = xy.reshape(-1, 2)
    inside: BoolArray = np.zeros(len(flat), dtype=bool)
    for ring in rings:
        low, high = ring.min(axis=0), ring.max(axis=0)
        near = np.flatnonzero(((flat >= low) & (flat <= high)).all(axis=1))
        # About its corner: coordinates of a national grid take the digits of float32 and more.
        inside[near] ^= points_in_poly(flat[near] - low, ring - low)
    return inside.reshape(xy.shape[:-1])
