"""Tracks as OpenPTV's rt_is and ptv_is files, as tables, and as HDF5."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.openptv import rt_is_text
from multimedia.projects import write_columns
from multimedia.tracking.tracks import Tracks
from photocore.arrays import FloatArray, IntArray
from photocore.errors import InputError, MissingExtraError
from photocore.output import atomic_path
from photocore.provenance import program
from photocore.tables.csvwrite import Columns

#: Endings of tables and of HDF5.
TABLES, HDF5 = (".csv", ".xlsx"), (".h5", ".hdf5")


def columns_of(tracks: Tracks, targets: IntArray, cameras: Sequence[str], units: tuple[str, str]
               ) -> Columns:  # fmt: skip
    """Return the columns of a table of tracks, points after each other.

    Parameters
    ----------
    tracks : Tracks
    targets : ndarray of int, shape (n, cameras)
        Targets of each point, -1 where a camera did not see it.
    cameras : sequence of str
    units : tuple of str
        Of lengths and of velocities.
    """
    columns: Columns = {
        "track": (tracks.track + 1).astype(str).tolist(),
        "frame": tracks.frame.astype(str).tolist(),
    }
    for prefix, values, unit in (
        ("", tracks.xyz, units[0]), ("sigma_", tracks.sigma, units[0]),
        ("v", tracks.velocity, units[1]), ("sigma_v", tracks.velocity_sigma, units[1]),
    ):  # fmt: skip
        columns |= {f"{prefix}{axis} [{unit}]": values[:, k] for k, axis in enumerate("XYZ")}
    columns["differs"] = ["yes" if odd else "" for odd in tracks.outlier.tolist()]
    columns |= {
        f"{name} target": [str(n) if n >= 0 else "" for n in targets[:, k].tolist()]
        for k, name in enumerate(cameras)
    }
    return columns


def check_tracks_path(path: Path) -> None:
    """Refuse an ending that is no format of tracks, and HDF5 without its extra."""
    if path.suffix.lower() not in TABLES + HDF5:
        raise InputError(f"{path}: tracks are written as .csv, .xlsx or .h5; give such an ending.")
    if path.suffix.lower() in HDF5:
        try:
            import h5py  # noqa: F401
        except ImportError:
            raise MissingExtraError("Writing HDF5", "hdf") from None


def write_tracks(path: Path, tracks: Tracks, targets: IntArray, cameras: Sequence[str],
                 units: tuple[str, str], *, overwrite: bool) -> None:  # fmt: skip
    """Write tracks as a table or as HDF5, by the ending; parameters as for `columns_of`."""
    if path.suffix.lower() in TABLES:
        write_columns(path, columns_of(tracks, targets, cameras, units), overwrite=overwrite)
        return
    import h5py

    arrays: Mapping[str, tuple[Any, str]] = {
        "track": (tracks.track + 1, ""), "frame": (tracks.frame, ""),
        "xyz": (tracks.xyz, units[0]), "sigma": (tracks.sigma, units[0]),
        "velocity": (tracks.velocity, units[1]),
        "velocity_sigma": (tracks.velocity_sigma, units[1]),
        "differs": (tracks.outlier, ""), "targets": (targets, ""),
    }  # fmt: skip
    with atomic_path(path, overwrite=overwrite) as temporary, h5py.File(temporary, "w") as file:
        file.attrs["program"], file.attrs["cameras"] = program(), list(cameras)
        file.attrs["axes"] = ["X", "Y", "Z"]
        for name, (values, unit) in arrays.items():
            data = file.create_dataset(name, data=values, compression="gzip", shuffle=True)
            if unit:
                data.attrs["unit"] = unit


def openptv_files(
    tracks: Tracks, frames: Sequence[int], places: Sequence[FloatArray], targets: Sequence[IntArray]
) -> dict[str, str]:
    """Return rt_is and ptv_is of every frame, by their names.

    Parameters
    ----------
    tracks : Tracks
    frames : sequence of int
        Numbers of the frames.
    places : sequence of ndarray, shape (n_t, 3)
        All particles of each frame. [mm]
    targets : sequence of ndarray of int, shape (n_t, cameras)

    Notes
    -----
    ptv_is holds the number of the particle in the frame before (-1 for none) and after (-2), from
    0; it knows no links across a frame.
    """
    before = [np.full(len(xyz), -1) for xyz in places]
    after = [np.full(len(xyz), -2) for xyz in places]
    at = tracks.frame - (frames[0] if len(frames) else 0)
    same = (np.diff(tracks.track) == 0) & (np.diff(tracks.frame) == 1)
    for k in np.flatnonzero(same).tolist():
        before[at[k + 1]][tracks.number[k + 1]] = tracks.number[k]
        after[at[k]][tracks.number[k]] = tracks.number[k + 1]
    written = {}
    for t, name in enumerate(frames):
        written[f"rt_is.{name}"] = rt_is_text(places[t], targets[t])
        rows = zip(before[t].tolist(), after[t].tolist(), places[t].tolist(), strict=True)
        lines = [
            f"{one:4d} {two:4d} {x:10.3f} {y:10.3f} {z:10.3f}\n" for one, two, (x, y, z) in rows
        ]
        written[f"ptv_is.{name}"] = f"{len(lines)}\n" + "".join(lines)
    return written
