"""Point clouds in the formats people bring: .ply, .las, .laz and text, of any size."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from photocore.arrays import FloatArray
from photocore.cloud.model import Cloud
from photocore.errors import InputError
from photocore.output import atomic_path
from photocore.textfile import check_file


def open_cloud(path: Path | str) -> Cloud:
    """Open a point cloud by its ending.

    Raises
    ------
    InputError
        If the file is missing, of an unknown kind, damaged or without points.
    """
    from photocore.cloud.las import LasCloud
    from photocore.cloud.ply import PlyCloud
    from photocore.cloud.text import TextCloud

    path = Path(path)
    check_file(path, folder="; name a point cloud (.csv .ply .las .laz).")
    kinds: dict[str, type[TextCloud | PlyCloud | LasCloud]] = {
        **dict.fromkeys((".csv", ".txt", ".xyz"), TextCloud),
        ".ply": PlyCloud,
        **dict.fromkeys((".las", ".laz"), LasCloud),
    }
    kind = kinds.get(path.suffix.lower())
    if kind is None:
        raise InputError(
            f'{path}: the ending "{path.suffix}" is not known; a DEM is a .tif, a point cloud a '
            ".csv, .txt, .xyz, .ply, .las or .laz file."
        )
    return kind(path)


def write_cloud(
    path: Path | str,
    xyz: FloatArray,
    attributes: Mapping[str, NDArray[Any]],
    *,
    comment: str = "metres",
    descriptions: Mapping[str, str] | None = None,
    overwrite: bool = False,
) -> None:
    """Write a new point cloud as .ply, .las or .laz; whole or not at all.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
        Positions, all known. [m]
    attributes : mapping of str to ndarray, shape (n,)
        Name to values, kept in their own type. LAS has places of its own for some of them:
        ``red``, ``green``, ``blue`` (8 bits become 16), ``quality`` (its user data) and
        ``uncertain`` (1 becomes class 7, noise).
    comment : str
        Written into the heading of a PLY.
    descriptions : mapping of str to str
        What an attribute is, kept by LAS.

    Raises
    ------
    InputError
        If the ending is another, the points do not fit the format, or writing fails.
    """
    from photocore.cloud.las import check_extent, write_las
    from photocore.cloud.ply import write_ply

    path = Path(path)
    ending = path.suffix.lower()
    if ending not in (".ply", ".las", ".laz"):
        raise InputError(f"{path}: point clouds are written as .ply, .las or .laz.")
    if ending != ".ply":
        check_extent(path, xyz)
    with atomic_path(path, overwrite=overwrite) as temporary:
        if ending == ".ply":
            write_ply(temporary, xyz, attributes, comment=comment)
        else:
            write_las(temporary, xyz, attributes, descriptions=descriptions or {})
