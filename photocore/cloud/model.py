"""Point clouds of any size, read and written in pieces with every attribute kept."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from photocore.arrays import FloatArray
from photocore.errors import InputError

#: Points per piece: some 100 MB at the most, whatever the attributes.
CHUNK = 200_000
#: Attribute that marks a cloud this package has corrected.
MARK = "refraction"


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """A piece of a cloud.

    Attributes
    ----------
    xyz : ndarray, shape (n, 3)
    numbers : dict of str to ndarray, shape (n,)
        Further numeric columns that were asked for and exist.
    texts : dict of str to list of str
        Further text columns that were asked for and exist.
    raw : object
        What the writer needs to give every attribute back.
    """

    xyz: FloatArray
    raw: Any
    numbers: Mapping[str, FloatArray] = field(default_factory=dict)
    texts: Mapping[str, list[str]] = field(default_factory=dict)


class CloudWriter(Protocol):
    """Takes corrected pieces."""

    def write(self, chunk: Chunk, xyz: FloatArray, extra: Mapping[str, FloatArray]) -> None:
        """Write a piece with new positions; rows whose position is unchanged stay bit for bit.

        ``extra`` holds the new attributes named when the writer was made.
        """


class Cloud(ABC):
    """An open point cloud."""

    path: Path
    #: What the user should know about the file.
    remarks: list[str]

    @abstractmethod
    def chunks(self, *, numbers: Sequence[str] = (), texts: Sequence[str] = ()) -> Iterator[Chunk]:
        """Yield the cloud in pieces, with the further columns asked for."""

    @abstractmethod
    def writer(self, path: Path, extra: Sequence[str]) -> AbstractContextManager[CloudWriter]:
        """Return a writer of the same format with new attributes of these names."""

    @abstractmethod
    def has(self, name: str) -> bool:
        """Return whether the cloud has an attribute of that name."""


def open_cloud(path: Path | str) -> Cloud:
    """Open a point cloud by its ending.

    Raises
    ------
    InputError
        If the file is missing, of an unknown kind, damaged or without points.
    """
    from multimedia.bathymetry.cloud_csv import CsvCloud
    from multimedia.bathymetry.cloud_las import LasCloud
    from multimedia.bathymetry.cloud_ply import PlyCloud

    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a point cloud (.csv .ply .las .laz).")
    if not path.is_file():
        raise InputError(f"{path}: no such file.")
    kinds: dict[str, type[Cloud]] = {
        ".csv": CsvCloud,
        ".txt": CsvCloud,
        ".xyz": CsvCloud,
        ".ply": PlyCloud,
        ".las": LasCloud,
        ".laz": LasCloud,
    }
    kind = kinds.get(path.suffix.lower())
    if kind is None:
        raise InputError(
            f'{path}: the ending "{path.suffix}" is not known; a DEM is a .tif, a point cloud a '
            ".csv, .txt, .xyz, .ply, .las or .laz file."
        )
    return kind(path)  # type: ignore[call-arg]
