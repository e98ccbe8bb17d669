"""Pair file in, relief map, preview and point cloud out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.files.photos import photo_info
from bifocal.model.basis import rests_on
from bifocal.model.pair import Pair
from bifocal.model.relief_map import ReliefMap
from bifocal.relief_maps import dense_relief
from bifocal.relief_maps.frame import values_at
from bifocal.relief_maps.relief_files import write_preview
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.cli import Progress, no_progress
from photocore.cloud import write_cloud
from photocore.errors import GeometryError
from photocore.images import ImageArray, read_image, to_eight_bit
from photocore.output import all_or_none, check_all_writable, check_ending, check_not_input

_ROWS = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliefJob:
    """What to make of a pair.

    Attributes
    ----------
    out : Path
        Relief map, GeoTIFF.
    preview, cloud : Path or None
        Picture (.png) and point cloud (.ply, .las, .laz).
    gsd : float or None
        Pixel of the map. [m]
    bounds : tuple of float or None
        X min, Y min, X max, Y max. [m]
    quality : str
        ``fast``, ``standard`` or ``best``.
    relief_range : tuple of float or None
        Least and greatest relief to expect. [m]
    overwrite : bool
    """

    out: Path
    preview: Path | None = None
    cloud: Path | None = None
    gsd: float | None = None
    bounds: tuple[float, float, float, float] | None = None
    quality: str = "standard"
    relief_range: tuple[float, float] | None = None
    overwrite: bool = False


@all_or_none()
def relief_of_pair(
    pair_file: Pair | Path, job: ReliefJob, *, progress: Progress = no_progress
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Make the relief map of a pair file.

    Returns
    -------
    summary : dict
        Figures of the map and the files written.
    remarks : tuple of str
        What the user should know.

    Raises
    ------
    InputError, GeometryError
        If a file or an option is unusable, or the photos do not fit; nothing is then written.
    """
    pair = Pair.of(pair_file)
    _check_outputs(job, pair)
    image1, image2 = (read_image(photo_info(pair, number).path) for number in (1, 2))
    result = dense_relief(
        pair, image1, image2, gsd=job.gsd, bounds=job.bounds, quality=job.quality,
        relief_range=job.relief_range, progress=progress,
    )  # fmt: skip
    if not result.known.any():
        raise GeometryError(remark("relief.none_within_bounds"))
    named = "" if isinstance(pair_file, Pair) else Path(pair_file).name
    tags = {
        "BIFOCAL_D1": f"{pair.image1.distance:.6g}",
        "BIFOCAL_D2": f"{pair.image2.distance:.6g}",
        "BIFOCAL_PAIR": named or str(pair.extra.get("name", "")),
    }
    result.write(job.out, overwrite=job.overwrite, tags=tags)
    written = [job.out]
    if job.preview is not None:
        write_preview(job.preview, result, overwrite=job.overwrite)
        written.append(job.preview)
    if job.cloud is not None:
        xyz, attributes = coloured_cloud(result, pair, image1)
        write_cloud(
            job.cloud, xyz, attributes, comment="metres, plane frame",
            descriptions={"sigma": "sigma of relief, m"}, overwrite=job.overwrite,
        )  # fmt: skip
        written.append(job.cloud)
    basis = rests_on(
        pair, setup="the pair as given", picks="the photos' own misfit across the radius, measured"
    )
    summary = result.summary() | {"rests_on": basis, "written": [str(path) for path in written]}
    return summary, (*pair.remarks, *result.registration.remarks)


def coloured_cloud(
    relief: ReliefMap, pair: Pair, image1: ImageArray
) -> tuple[FloatArray, dict[str, NDArray[Any]]]:
    """Return the known points of a relief map with the colours of photo 1.

    Returns
    -------
    xyz : ndarray, shape (n, 3)
        X, Y, relief. [m]
    attributes : dict of str to ndarray, shape (n,)
        ``red``, ``green``, ``blue`` (8 bits), ``sigma`` of the relief [m], ``quality``.
    """
    picture = to_eight_bit(image1)
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    positions, colours = [], []
    for row in range(0, relief.shape[0], _ROWS):
        rows = slice(row, row + _ROWS)
        known = relief.known[rows]
        if not known.any():
            continue
        xyz = np.column_stack([relief.plane_positions(rows)[known], relief.r[rows][known]])
        positions.append(xyz)
        colours.append(values_at(picture, pair.image1.project(xyz), cv2.INTER_LINEAR))
    known = relief.known
    attributes = dict(zip(("red", "green", "blue"), np.concatenate(colours).T, strict=True))
    attributes |= {
        "sigma": relief.sigma[known].astype(np.float32),
        "quality": relief.quality[known],
    }
    return np.concatenate(positions), attributes


def _check_outputs(job: ReliefJob, pair: Pair) -> None:
    """Refuse, before any work, outputs that could not be written."""
    check_ending(job.out, "the relief map is written as .tif.", ".tif", ".tiff")
    check_ending(job.preview, "the preview is written as .png.", ".png")
    rule = "point clouds are written as .ply, .las or .laz."
    check_ending(job.cloud, rule, ".ply", ".las", ".laz")
    for path in (job.out, job.preview):
        check_not_input(path, *pair.photo_files)
    check_all_writable(job.out, job.preview, job.cloud, overwrite=job.overwrite)
