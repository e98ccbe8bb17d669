"""LAS and LAZ point clouds: every dimension, record and header field kept."""

from __future__ import annotations

import copy
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photocore.arrays import FloatArray
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
from photocore.remarks import remark

#: Coordinates of new files are whole multiples of this. [m]
STEP = 1e-4


class LasCloud(Cloud):
    """A LAS 1.0 to 1.4 file, compressed or not."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._check_counts()
        with self._reading() as reader:
            self._header = reader.header
            self._evlrs = reader.evlrs
            records = [record.user_id for record in (*self._header.vlrs, *(self._evlrs or ()))]
        if self._header.point_count == 0:
            raise InputError(f"{path}: holds no points.")
        if "LASF_Projection" not in records:
            self.remarks.append(remark("cloud.no_system", name=path.name))

    def _check_counts(self) -> None:
        """Refuse a header that promises more records than the file has room for.

        laspy would read them one by one, up to four thousand million times nothing.
        """
        with self.path.open("rb") as file:
            head = file.read(247)
        size = self.path.stat().st_size
        records = struct.unpack_from("<I", head, 100)[0] if len(head) >= 104 else 0
        if len(head) == 247 and head[25] >= 4:
            records += struct.unpack_from("<I", head, 243)[0]
        if 54 * records > size:  # the shortest has 54 bytes
            raise InputError(remark("cloud.cut_records", of=self.path, records=records))

        if len(head) > 104 and head[104] & 0x80:
            self._check_chunks(struct.unpack_from("<I", head, 96)[0], size)

    def _check_chunks(self, start: int, size: int) -> None:
        """Refuse a compressed cloud whose table of chunks cannot be: it would end the program.

        The decompressor asks for the memory of as many chunks as the table promises.
        """
        with self.path.open("rb") as file:
            file.seek(start)
            place = file.read(8)
            at = struct.unpack("<q", place)[0] if len(place) == 8 else -2
            if at == -1 and size >= 8:  # written to a stream: the place stands at the end
                file.seek(size - 8)
                at = struct.unpack("<q", file.read(8))[0]
            table = b""
            if start < at < size:
                file.seek(at)
                table = file.read(8)
        # A chunk takes a byte or more of the points.
        if len(table) < 8 or struct.unpack_from("<I", table, 4)[0] > at - start:
            raise InputError(remark("cloud.cut_chunks", of=self.path))

    @contextmanager
    def _reading(self) -> Iterator[Any]:
        """Yield an open reader; a damaged file becomes a message."""
        import laspy

        damage = (laspy.errors.LaspyException, struct.error, ValueError, EOFError, RuntimeError,
                  OverflowError)  # fmt: skip
        try:
            with laspy.open(self.path) as reader:
                yield reader
        except InputError:
            raise
        except damage as error:
            raise InputError(remark("cloud.damaged", of=self.path, error=error)) from None

    def has(self, name: str) -> bool:
        """Return whether the points have a dimension."""
        return name in self._header.point_format.dimension_names

    def pieces(
        self,
        *,
        numbers: Sequence[str] = (),
        texts: Sequence[str] = (),  # noqa: ARG002
    ) -> Iterator[CloudPiece]:
        """Yield pieces of the cloud."""
        count = 0
        with self._reading() as reader:
            for points in reader.chunk_iterator(PIECE):
                count += len(points)
                xyz = np.column_stack([np.asarray(points[axis], float) for axis in "xyz"])
                attributes = {k: np.asarray(points[k], float) for k in numbers if self.has(k)}
                yield CloudPiece(
                    xyz=checked_positions(self.path, xyz), raw=points, numbers=attributes
                )
        if count != self._header.point_count:
            raise InputError(
                f"{self.path}: its header promises {self._header.point_count} points, the file "
                f"holds {count}; it is cut off."
            )

    @contextmanager
    def _written(self, path: Path, extra: NewAttributes) -> Iterator[PieceWriter]:
        """Yield a writer with the same header, records and point format plus new dimensions."""
        import laspy

        header = copy.deepcopy(self._header)
        header.add_extra_dims(
            [
                laspy.ExtraBytesParams(name=name, type=np.dtype(kind), description=text)
                for name, (kind, text) in extra.items()
            ]
        )
        compressed = self.path.suffix.lower() == ".laz"
        with (
            _disk_errors(),
            laspy.open(path, mode="w", header=header, do_compress=compressed) as out,
        ):

            def write(piece: CloudPiece, xyz: FloatArray, values: NewValues) -> None:
                points = laspy.ScaleAwarePointRecord.zeros(len(xyz), header=header)
                for name in piece.raw.point_format.dimension_names:
                    points[name] = piece.raw[name]
                for axis, name in enumerate("XYZ"):
                    self._move(points, axis, name, xyz[:, axis], piece.xyz[:, axis])
                for name, column in values.items():
                    points[name] = column
                out.write_points(points)

            yield write
            if self._evlrs:
                out.write_evlrs(self._evlrs)

    def _move(
        self, points: Any, axis: int, name: str, wanted: FloatArray, given: FloatArray
    ) -> None:
        """Set one coordinate; whole numbers of the file change only where the position does."""
        # A LAS coordinate is a whole number and cannot say "unknown": such a point stays.
        changed = (wanted != given) & np.isfinite(wanted)
        offset, scale = self._header.offsets[axis], self._header.scales[axis]
        steps = np.round((wanted[changed] - offset) / scale)
        if np.abs(steps).max(initial=0.0) > np.iinfo(np.int32).max:
            raise InputError(remark("cloud.coarse_scale", name=name, scale=scale))
        whole = np.array(points[name])
        whole[changed] = steps.astype(np.int32)
        points[name] = whole


def check_extent(path: Path, xyz: FloatArray) -> None:
    """Raise InputError for points too far apart for whole numbers of 32 bits."""
    span, most = float(np.ptp(xyz, axis=0).max()), STEP * np.iinfo(np.int32).max
    if not span < most:
        raise InputError(
            f"{path}: the points span {span:g} m; LAS holds {most / 1000:.0f} km to "
            f"{STEP * 1000:g} mm. Leave the far ones out, or write another format."
        )


@contextmanager
def _disk_errors() -> Iterator[None]:
    """Turn what the compressor says when it cannot write into what Python says."""
    from lazrs import LazrsError

    try:
        yield
    except LazrsError as error:
        raise OSError(f"writing failed, is the disk full? ({error})") from error


def write_las(
    path: Path,
    xyz: FloatArray,
    attributes: Mapping[str, NDArray[Any]],
    *,
    descriptions: Mapping[str, str],
) -> None:
    """Write LAS 1.4 (or LAZ) to 0.1 mm; see `photocore.cloud.write_cloud`."""
    import laspy

    header = laspy.LasHeader(point_format=7 if "red" in attributes else 6, version="1.4")
    header.offsets = np.floor(xyz.min(axis=0))
    header.scales = np.full(3, STEP)
    columns: dict[str, NDArray[Any]] = {}
    for name, values in attributes.items():
        if name == "uncertain":
            # ASPRS classes: 1 unclassified, 7 low point (noise).
            columns["classification"] = np.where(values, 7, 1).astype(np.uint8)
        elif name in ("red", "green", "blue") and values.dtype == np.uint8:
            columns[name] = values.astype(np.uint16) * 257
        else:
            columns["user_data" if name == "quality" else name] = values
    names = set(header.point_format.dimension_names)
    header.add_extra_dims(
        [
            laspy.ExtraBytesParams(
                name=name, type=values.dtype, description=descriptions.get(name, "")
            )
            for name, values in columns.items()
            if name not in names
        ]
    )
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = xyz.T
    for name, values in columns.items():
        cloud[name] = values
    with _disk_errors():
        cloud.write(str(path))
