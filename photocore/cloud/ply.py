"""PLY point clouds and meshes: ASCII and binary, every property and element kept."""

from __future__ import annotations

import re
import shutil
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from photocore.arrays import FloatArray, IntArray
from photocore.cloud.model import (
    PIECE,
    Cloud,
    CloudPiece,
    NewAttributes,
    NewValues,
    PieceWriter,
    checked_positions,
)
from photocore.errors import InputError
from photocore.provenance import provenance

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
#: The older names, which every program reads.
_NAMES = {kind: name for name, kind in list(_TYPES.items())[:8]}
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
#: Longest heading and longest line of one.
_MOST_LINES, _LONGEST_LINE = 10_000, 65_536


@dataclass(slots=True)
class _PlyElement:
    name: str
    count: int
    #: (property, type), or (property, (count type, item type)) for a list.
    properties: list[tuple[str, Any]] = field(default_factory=list)


class PlyCloud(Cloud):
    """A PLY file whose first element is ``vertex``."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        with path.open("rb") as file:
            self._lines, self._format, self._elements = _read_header(file, path)
            self._start = file.tell()
        if not self._elements or self._elements[0].name != "vertex":
            raise InputError(f"{path}: its first element is not 'vertex'; save it again as PLY.")
        vertex = self._elements[0]
        if any(isinstance(kind, tuple) for _, kind in vertex.properties):
            raise InputError(f"{path}: vertices with list properties are not supported.")
        names = [name for name, _ in vertex.properties]
        if not {"x", "y", "z"} <= set(names):
            raise InputError(f"{path}: its vertices have no x, y and z; found {', '.join(names)}.")
        if len(set(names)) < len(names):
            raise InputError(f"{path}: its vertices have two properties of one name.")
        if vertex.count == 0:
            raise InputError(f"{path}: holds no points.")
        self._order = _ORDERS[self._format]
        self._dtype = np.dtype([(name, self._order + kind) for name, kind in vertex.properties])
        self._count = vertex.count
        if self._dtype["x"].itemsize == 4:
            self.remarks.append(
                "Coordinates are 32-bit floats: 7 digits. Map coordinates lose centimetres so."
            )

    def has(self, name: str) -> bool:
        """Return whether the vertices have a property."""
        return name in (self._dtype.names or ())

    def pieces(
        self,
        *,
        numbers: Sequence[str] = (),
        texts: Sequence[str] = (),  # noqa: ARG002
    ) -> Iterator[CloudPiece]:
        """Yield pieces of the vertices."""
        with self.path.open("rb") as file:
            file.seek(self._start)
            for first in range(0, self._count, PIECE):
                rows = self._rows(file, self._dtype, min(PIECE, self._count - first), "point")
                xyz = np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"])
                attributes = {k: rows[k].astype(np.float64) for k in numbers if self.has(k)}
                yield CloudPiece(
                    xyz=checked_positions(self.path, xyz), raw=rows, numbers=attributes
                )

    def _rows(self, file: BinaryIO, dtype: np.dtype[Any], count: int, what: str) -> NDArray[Any]:
        """Return the next so many points or faces; a text line may go on behind a face's."""
        short = InputError(
            f"{self.path}: ends before its last {what}; it is damaged: copy or export it again."
        )
        if self._format != "ascii":
            size = count * dtype.itemsize
            if size > self.path.stat().st_size - file.tell():
                raise short
            return np.frombuffer(file.read(size), dtype)
        start = file.tell()
        lines = list(islice(file, count))
        if len(lines) < count or not lines[0].strip():
            raise short
        fields = len(dtype.names or ())
        columns = range(fields) if what == "face" else None
        try:
            rows = np.loadtxt(lines, dtype, comments=None, usecols=columns, ndmin=1)
        except (ValueError, OverflowError) as error:
            raise InputError(
                f"{self.path}: among the {what}s after byte {start}: {error}; its heading says "
                f"{fields} numbers a line. The file is damaged."
            ) from None
        if len(rows) < count:  # blank lines
            raise short
        return rows

    @contextmanager
    def _written(self, path: Path, extra: NewAttributes) -> Iterator[PieceWriter]:
        """Yield a writer; what follows the vertices in the file is copied when it closes."""
        more = np.dtype([(name, self._order + kind) for name, (kind, _) in extra.items()])
        dtype = np.dtype([*self._dtype.descr, *more.descr])
        first = next(
            number
            for number, line in enumerate(self._lines)
            if line == "end_header"
            or (line.startswith("element") and not line.startswith("element vertex"))
        )
        lines = [*self._lines[:first], *_properties(more), *self._lines[first:]]
        with path.open("wb") as out, self.path.open("rb") as source:
            out.write(_heading(lines))

            def write(piece: CloudPiece, xyz: FloatArray, values: NewValues) -> None:
                rows: Any = np.empty(len(xyz), dtype)
                for name in piece.raw.dtype.names:
                    rows[name] = piece.raw[name]
                for axis, name in enumerate("xyz"):
                    changed = xyz[:, axis] != piece.xyz[:, axis]
                    rows[name][changed] = xyz[changed, axis]
                for name, column in values.items():
                    rows[name] = column
                if self._format == "ascii":
                    for row in rows:
                        out.write(" ".join(_shortest(value) for value in row).encode() + b"\n")
                else:
                    out.write(rows.tobytes())

            yield write
            self._skip_vertices(source)
            shutil.copyfileobj(source, out)

    def _skip_vertices(self, source: BinaryIO) -> None:
        source.seek(self._start)
        if self._format == "ascii":
            deque(islice(source, self._count), maxlen=0)
        else:
            source.seek(self._count * self._dtype.itemsize, 1)

    def read_faces(self) -> IntArray:
        """Return the triangles of a mesh, shape (m, 3): numbers of their vertices, from 0.

        Raises
        ------
        InputError
            If it has no faces, or faces that are no triangles.
        """
        faces = self._elements[1] if len(self._elements) > 1 else None
        if faces is None or faces.name != "face" or not faces.count or not faces.properties:
            raise InputError(f"{self.path}: holds no faces; a water surface needs triangles.")
        (_, corners), *others = faces.properties
        is_text = self._format == "ascii"
        if not isinstance(corners, tuple) or (others and not is_text):
            raise InputError(f"{self.path}: faces with further properties are not supported.")
        kinds = zip(("count", "a", "b", "c"), (corners[0], *[corners[1]] * 3), strict=True)
        dtype = np.dtype([(name, self._order + kind) for name, kind in kinds])
        with self.path.open("rb") as file:
            self._skip_vertices(file)
            rows = self._rows(file, dtype, faces.count, "face")
        if (rows["count"] != 3).any():
            raise InputError(f"{self.path}: every face must be a triangle; triangulate the mesh.")
        return np.column_stack([rows[corner].astype(np.int64) for corner in "abc"])


def read_ply_mesh(path: Path) -> tuple[FloatArray, IntArray]:
    """Return vertices (n, 3) and triangles (m, 3) of a PLY mesh.

    Raises
    ------
    InputError
        If it has no faces, or faces that are no triangles.
    """
    cloud = PlyCloud(path)
    return np.concatenate([piece.xyz for piece in cloud.pieces()]), cloud.read_faces()


def write_ply(
    path: Path, xyz: FloatArray, attributes: Mapping[str, NDArray[Any]], *, comment: str
) -> None:
    """Write a binary PLY; see `photocore.cloud.write_cloud`."""
    columns = dict(zip("xyz", xyz.T, strict=True)) | dict(attributes)
    dtype = [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
    rows = np.empty(len(xyz), dtype)
    for name, values in columns.items():
        rows[name] = values
    comments = [f"comment {_ascii(line)}" for line in (comment, *provenance().lines())]
    lines = ["ply", "format binary_little_endian 1.0", *comments,
             f"element vertex {len(rows)}", *_properties(rows.dtype), "end_header"]  # fmt: skip
    path.write_bytes(_heading(lines) + rows.tobytes())


def _ascii(text: str) -> str:
    """Return one line of a heading, which is ASCII and not endless."""
    return " ".join(text.encode("ascii", "replace").decode("ascii").split())[:1000]


def _properties(dtype: np.dtype[Any]) -> list[str]:
    """Return the heading's lines on the fields of a structured type."""
    return [f"property {_NAMES[dtype[name].str[1:]]} {name}" for name in dtype.names or ()]


def _heading(lines: Sequence[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode("utf-8")


def _read_header(file: BinaryIO, path: Path) -> tuple[list[str], str, list[_PlyElement]]:
    """Return header lines, format and elements; leaves the file at the first vertex."""
    if file.readline(_LONGEST_LINE).strip() != b"ply":
        raise InputError(f"{path}: is not a PLY file.")
    lines, form = ["ply"], ""
    elements: list[_PlyElement] = []
    for _ in range(_MOST_LINES):
        line = file.readline(_LONGEST_LINE).decode("utf-8", errors="replace").strip()
        lines.append(line)
        match line.split():
            case ["end_header"]:
                if form not in _ORDERS:
                    raise InputError(f"{path}: PLY format {form!r} is not known.")
                return lines, form, elements
            case ["format", form, *_]:
                pass
            case ["element", name, count] if re.fullmatch(r"[0-9]{1,12}", count):
                elements.append(_PlyElement(name, int(count)))
            case ["property", "list", counter, item, name] if elements:
                kinds = (_type(counter, path), _type(item, path))
                elements[-1].properties.append((name, kinds))
            case ["property", kind, name] if elements:
                elements[-1].properties.append((name, _type(kind, path)))
            case ["format" | "element" | "property", *_]:
                raise InputError(
                    f"{path}: line {len(lines)} of its PLY heading, {line!r:.60}, cannot be "
                    "understood; the file is damaged."
                )
    raise InputError(f"{path}: its PLY heading has no end; the file is damaged.")


def _type(name: str, path: Path) -> str:
    if name not in _TYPES:
        raise InputError(f"{path}: property type {name} is not known.")
    return _TYPES[name]


def _shortest(value: Any) -> str:
    """Return the shortest text that reads back to the same number of its own type."""
    if isinstance(value, np.integer):
        return str(int(value))
    return np.format_float_positional(value, unique=True, trim="-")
