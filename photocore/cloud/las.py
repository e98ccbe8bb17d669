"""LAS and LAZ point clouds: every dimension, record and header field kept."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.bathymetry.clouds import CHUNK, MARK, Chunk, Cloud, CloudWriter
from photocore.arrays import FloatArray
from photocore.errors import InputError


class LasCloud(Cloud):
    """A LAS 1.0 to 1.4 file, compressed or not."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.remarks: list[str] = []
        with self._reading() as reader:
            self._header = reader.header
            self._evlrs = reader.evlrs
        if self._header.point_count == 0:
            raise InputError(f"{path}: holds no points.")
        records = [record.user_id for record in self._header.vlrs]
        records += [record.user_id for record in self._evlrs or ()]
        if "LASF_Projection" not in records:
            self.remarks.append(
                f"{path.name} has no coordinate reference system; its coordinates are taken as "
                "metres, like those of the cameras."
            )

    @contextmanager
    def _reading(self) -> Iterator[Any]:
        """Yield an open reader; a damaged file becomes a message."""
        import laspy

        try:
            with laspy.open(self.path) as reader:
                yield reader
        except (laspy.errors.LaspyException, ValueError, EOFError, RuntimeError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(
                f"{self.path}: cannot be read as LAS; it is damaged or cut off ({error})."
            ) from None

    def has(self, name: str) -> bool:
        """Return whether the points have a dimension."""
        return name in self._header.point_format.dimension_names

    def chunks(
        self,
        *,
        numbers: Sequence[str] = (),
        texts: Sequence[str] = (),  # noqa: ARG002
    ) -> Iterator[Chunk]:
        """Yield pieces of the cloud."""
        seen = 0
        with self._reading() as reader:
            for points in reader.chunk_iterator(CHUNK):
                seen += len(points)
                xyz = np.column_stack([np.asarray(points[axis], float) for axis in "xyz"])
                wanted = {k: np.asarray(points[k], float) for k in numbers if self.has(k)}
                yield Chunk(xyz=xyz, raw=points, numbers=wanted)
        if seen != self._header.point_count:
            raise InputError(
                f"{self.path}: its header promises {self._header.point_count} points, the file "
                f"holds {seen}; it is cut off."
            )

    @contextmanager
    def writer(self, path: Path, extra: Sequence[str]) -> Iterator[CloudWriter]:
        """Yield a writer with the same header, records and point format plus new dimensions."""
        import laspy

        header = copy.deepcopy(self._header)
        header.add_extra_dims(
            [
                laspy.ExtraBytesParams(
                    name=name,
                    type=np.uint8 if name == MARK else np.float32,
                    description=_DESCRIPTIONS.get(name, ""),
                )
                for name in extra
            ]
        )
        compressed = self.path.suffix.lower() == ".laz"
        with laspy.open(path, mode="w", header=header, do_compress=compressed) as out:
            yield _LasWriter(out, header)
            if self._evlrs:
                out.write_evlrs(self._evlrs)


_DESCRIPTIONS = {
    MARK: "0 dry 1 nadir 2 rays 3 4 none",
    "water_depth": "true depth under water",
    "sigma_X": "standard deviation",
    "sigma_Y": "standard deviation",
    "sigma_Z": "standard deviation",
}


class _LasWriter:
    def __init__(self, out: Any, header: Any) -> None:
        self._out, self._header = out, header

    def write(self, chunk: Chunk, xyz: FloatArray, extra: Mapping[str, FloatArray]) -> None:
        """Write points; whole numbers of the file change only where the position does."""
        import laspy

        points = laspy.ScaleAwarePointRecord.zeros(len(xyz), header=self._header)
        for name in chunk.raw.point_format.dimension_names:
            points[name] = chunk.raw[name]
        for axis, name in enumerate("XYZ"):
            # A LAS coordinate is a whole number and cannot say "unknown": such a point stays.
            changed = (xyz[:, axis] != chunk.xyz[:, axis]) & np.isfinite(xyz[:, axis])
            steps = np.round(
                (xyz[changed, axis] - self._header.offsets[axis]) / self._header.scales[axis]
            )
            if np.abs(steps).max(initial=0.0) > np.iinfo(np.int32).max:
                raise InputError(
                    f"corrected {name} does not fit the scale {self._header.scales[axis]:g} of the "
                    "LAS file; rewrite the file with a coarser scale first."
                )
            whole = np.array(points[name])
            whole[changed] = steps.astype(np.int32)
            points[name] = whole
        for name, values in extra.items():
            points[name] = values
        self._out.write_points(points)
