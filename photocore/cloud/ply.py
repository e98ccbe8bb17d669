"""PLY point clouds and meshes: ASCII and binary, every property and element kept."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from multimedia.bathymetry.clouds import CHUNK, MARK, Chunk, Cloud, CloudWriter
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(slots=True)
class _Element:
    name: str
    count: int
    #: (property, type), or (property, (count type, item type)) for a list.
    properties: list[tuple[str, Any]] = field(default_factory=list)


class PlyCloud(Cloud):
    """A PLY file whose first element is ``vertex``."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.remarks: list[str] = []
        with path.open("rb") as file:
            self._header, self._format, self._elements = _read_header(file, path)
            self._start = file.tell()
        if not self._elements or self._elements[0].name != "vertex":
            raise InputError(f"{path}: its first element is not 'vertex'; save it again as PLY.")
        vertex = self._elements[0]
        if any(isinstance(kind, tuple) for _, kind in vertex.properties):
            raise InputError(f"{path}: vertices with list properties are not supported.")
        names = [name for name, _ in vertex.properties]
        if not {"x", "y", "z"} <= set(names):
            raise InputError(f"{path}: its vertices have no x, y and z; found {', '.join(names)}.")
        if vertex.count == 0:
            raise InputError(f"{path}: holds no points.")
        order = _ORDERS[self._format]
        self._dtype = np.dtype([(name, order + kind) for name, kind in vertex.properties])
        self._count = vertex.count
        if self._dtype["x"].itemsize == 4:
            self.remarks.append(
                "Coordinates are 32-bit floats: 7 digits. Map coordinates lose centimetres so."
            )

    def has(self, name: str) -> bool:
        """Return whether the vertices have a property."""
        return name in (self._dtype.names or ())

    def chunks(
        self,
        *,
        numbers: Sequence[str] = (),
        texts: Sequence[str] = (),  # noqa: ARG002
    ) -> Iterator[Chunk]:
        """Yield pieces of the vertices."""
        with self.path.open("rb") as file:
            file.seek(self._start)
            for first in range(0, self._count, CHUNK):
                rows = self._read(file, min(CHUNK, self._count - first))
                xyz = np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"])
                wanted = {k: rows[k].astype(np.float64) for k in numbers if self.has(k)}
                yield Chunk(xyz=xyz, raw=rows, numbers=wanted)

    def _read(self, file: BinaryIO, count: int) -> np.ndarray[Any, Any]:
        if self._format != "ascii":
            data = file.read(count * self._dtype.itemsize)
            if len(data) < count * self._dtype.itemsize:
                raise InputError(f"{self.path}: ends before its last point; it is damaged.")
            return np.frombuffer(data, self._dtype)
        rows = np.empty(count, self._dtype)
        names = self._dtype.names or ()
        for number in range(count):
            cells = file.readline().split()
            try:
                rows[number] = tuple(
                    self._dtype[name].type(cell) for name, cell in zip(names, cells, strict=True)
                )
            except ValueError:
                raise InputError(
                    f"{self.path}: vertex {number + 1} has {len(cells)} values that are not the "
                    f"{len(names)} numbers of its heading; the file is damaged."
                ) from None
        return rows

    @contextmanager
    def writer(self, path: Path, extra: Sequence[str]) -> Iterator[CloudWriter]:
        """Yield a writer; what follows the vertices in the file is copied when it closes."""
        ends = [
            number
            for number, line in enumerate(self._header)
            if line == "end_header"
            or (line.startswith("element") and not line.startswith("element vertex"))
        ]
        new = [f"property {'uchar' if name == MARK else 'float'} {name}" for name in extra]
        lines = [*self._header[: ends[0]], *new, *self._header[ends[0] :]]
        order = _ORDERS[self._format]
        more = [(name, "u1" if name == MARK else order + "f4") for name in extra]
        dtype = np.dtype([*self._dtype.descr, *more])
        with path.open("wb") as out, self.path.open("rb") as source:
            out.write(("\n".join(lines) + "\n").encode("utf-8"))
            yield _PlyWriter(out, dtype, ascii_=self._format == "ascii")
            self._skip_vertices(source)
            shutil.copyfileobj(source, out)

    def _skip_vertices(self, source: BinaryIO) -> None:
        source.seek(self._start)
        if self._format == "ascii":
            for _ in range(self._count):
                source.readline()
        else:
            source.seek(self._count * self._dtype.itemsize, 1)


class _PlyWriter:
    def __init__(self, out: BinaryIO, dtype: np.dtype[Any], *, ascii_: bool) -> None:
        self._out, self._dtype, self._ascii = out, dtype, ascii_

    def write(self, chunk: Chunk, xyz: FloatArray, extra: Mapping[str, FloatArray]) -> None:
        """Write vertices."""
        rows = np.empty(len(xyz), self._dtype)
        for name in chunk.raw.dtype.names:
            rows[name] = chunk.raw[name]
        for axis, name in enumerate("xyz"):
            changed = xyz[:, axis] != chunk.xyz[:, axis]
            rows[name][changed] = xyz[changed, axis]
        for name, values in extra.items():
            rows[name] = values
        if self._ascii:
            for row in rows:
                self._out.write(" ".join(_shortest(value) for value in row).encode() + b"\n")
        else:
            self._out.write(rows.tobytes())


def read_ply_mesh(path: Path) -> tuple[FloatArray, IntArray]:
    """Return vertices (n, 3) and triangles (m, 3) of a PLY mesh.

    Raises
    ------
    InputError
        If it has no faces, or faces that are no triangles.
    """
    cloud = PlyCloud(path)
    vertices = np.concatenate([chunk.xyz for chunk in cloud.chunks()])
    faces = next((e for e in cloud._elements if e.name == "face" and e.count), None)
    if faces is None or faces is not cloud._elements[1]:
        raise InputError(f"{path}: holds no faces; a water surface needs triangles.")
    with path.open("rb") as file:
        cloud._skip_vertices(file)
        if cloud._format == "ascii":
            lines = [file.readline().split() for _ in range(faces.count)]
            if any(line[:1] != [b"3"] or len(line) < 4 for line in lines):
                raise InputError(f"{path}: every face must be a triangle; triangulate the mesh.")
            return vertices, np.array([line[1:4] for line in lines]).astype(np.int64)
        if len(faces.properties) != 1 or not isinstance(faces.properties[0][1], tuple):
            raise InputError(f"{path}: faces with further properties are not supported.")
        counter, item = faces.properties[0][1]
        order = _ORDERS[cloud._format]
        dtype = np.dtype([("count", order + counter), ("vertex", order + item, 3)])
        data = file.read(faces.count * dtype.itemsize)
    if len(data) < faces.count * dtype.itemsize:
        raise InputError(f"{path}: ends before its last face; it is damaged or not triangulated.")
    rows = np.frombuffer(data, dtype)
    if (rows["count"] != 3).any():
        raise InputError(f"{path}: every face must be a triangle; triangulate the mesh.")
    return vertices, rows["vertex"].astype(np.int64)


def _read_header(file: BinaryIO, path: Path) -> tuple[list[str], str, list[_Element]]:
    """Return header lines, format and elements; leaves the file at the first vertex."""
    if file.readline().strip() != b"ply":
        raise InputError(f"{path}: is not a PLY file.")
    lines, form = ["ply"], ""
    elements: list[_Element] = []
    for _ in range(10_000):
        line = file.readline().decode("utf-8", errors="replace").strip()
        lines.append(line)
        words = line.split()
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2])))
        elif words[:1] == ["property"] and elements:
            kinds = words[2:4] if words[1] == "list" else words[1:2]
            if not set(kinds) <= set(_TYPES):
                raise InputError(f"{path}: property type {' '.join(kinds)} is not known.")
            kind: Any = tuple(_TYPES[k] for k in kinds) if words[1] == "list" else _TYPES[words[1]]
            elements[-1].properties.append((words[-1], kind))
        elif line == "end_header":
            if form not in _ORDERS:
                raise InputError(f"{path}: PLY format {form!r} is not known.")
            return lines, form, elements
    raise InputError(f"{path}: its PLY heading has no end; the file is damaged.")


def _shortest(value: Any) -> str:
    """Return the shortest text that reads back to the same number of its own type."""
    if isinstance(value, np.integer):
        return str(int(value))
    return np.format_float_positional(value, unique=True, trim="-")
