"""Pair file in, relief map, preview and point cloud out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bifocal.faces.faces import Faces
from bifocal.faces.faces_files import check_faces, given_faces
from bifocal.faces.suggestions import suggest_faces
from bifocal.files.made_from import PAIR_TAG, MadeFrom, photos_of
from bifocal.files.photos import photo_infos
from bifocal.model.basis import rests_on
from bifocal.model.doubts import unit_of
from bifocal.model.pair import Pair
from bifocal.model.photo import Photo
from bifocal.model.photo_set import PhotoSet, pair_or_set
from bifocal.model.relief_map import ReliefMap
from bifocal.relief_maps import dense_relief
from bifocal.relief_maps.dense_matching import DenseRelief
from bifocal.relief_maps.frame import values_at
from bifocal.relief_maps.relief_files import write_preview
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.cli import Progress, no_progress
from photocore.cloud import write_cloud
from photocore.errors import GeometryError
from photocore.images import to_eight_bit
from photocore.large_photos import Pixels, open_photo
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
    faces : Faces or Path, optional
        Planes, edges and occluders that were drawn, or their file.
    suggested : Path, optional
        Where faces go that would mend what is not measured (.geojson).
    overwrite : bool
    """

    out: Path
    preview: Path | None = None
    cloud: Path | None = None
    gsd: float | None = None
    bounds: tuple[float, float, float, float] | None = None
    quality: str = "standard"
    relief_range: tuple[float, float] | None = None
    faces: Faces | Path | None = None
    suggested: Path | None = None
    overwrite: bool = False


@all_or_none()
def relief_of_pair(
    source: Pair | PhotoSet | Path, job: ReliefJob, *, progress: Progress = no_progress
) -> tuple[dict[str, object], tuple[str, ...]]:
    """Make the relief map of a pair, a pair file or a set.

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
    photos = pair_or_set(source)
    infos = photo_infos(photos)
    _check_outputs(job, *(info.path for info in infos))
    faces, notes = given_faces(job.faces)
    notes += check_faces(faces, photos_of(photos))
    of_set = (photos.image1, photos.image2) if isinstance(photos, Pair) else photos.photos
    pair = photos if isinstance(photos, Pair) else photos.pair(*photos.pairs()[0][:2])
    named = Path(source).name if isinstance(source, Path | str) else ""
    tags = {
        "BIFOCAL_D1": f"{pair.image1.distance:.6g}",
        "BIFOCAL_D2": f"{pair.image2.distance:.6g}",
        PAIR_TAG: named or str(pair.extra.get("name", "")),
        "BIFOCAL_UNIT": unit_of(pair.extra),
        **MadeFrom.of(of_set, faces=(faces or Faces()).digest).tags(),
    }
    with ExitStack() as stack:
        images = [stack.enter_context(open_photo(info.path, progress)) for info in infos]
        result = dense_relief(
            photos, *images, gsd=job.gsd, bounds=job.bounds, quality=job.quality,
            relief_range=job.relief_range, faces=faces, progress=progress,
        )  # fmt: skip
        if not result.known.any():
            raise GeometryError(remark("relief.none_within_bounds"))
        written = _written(result, job, of_set, images, tags)
    basis = rests_on(
        pair, setup="the pair as given", picks="the photos' own misfit across the radius, measured"
    )
    summary = result.summary() | {"rests_on": basis, "written": [str(path) for path in written]}
    return summary, (*photos.remarks, *notes, *result.notes, *result.registration.remarks)


def _written(
    result: DenseRelief, job: ReliefJob, photos: Sequence[Photo], images: Sequence[Pixels],
    tags: Mapping[str, str],
) -> list[Path]:  # fmt: skip
    """Write the files asked for and return them."""
    result.write(job.out, overwrite=job.overwrite, tags=tags)
    written = [job.out]
    if job.preview is not None:
        write_preview(job.preview, result, overwrite=job.overwrite)
        written.append(job.preview)
    if job.cloud is not None:
        xyz, attributes = coloured_cloud(result, photos, images)
        write_cloud(
            job.cloud, xyz, attributes, comment="metres, plane frame",
            descriptions={"sigma": "sigma of relief, m"}, overwrite=job.overwrite,
        )  # fmt: skip
        written.append(job.cloud)
    if job.suggested is not None:
        suggest_faces(result, photos, images).write(job.suggested, overwrite=job.overwrite)
        written.append(job.suggested)
    return written


def coloured_cloud(
    relief: ReliefMap, photos: Sequence[Photo], images: Sequence[Pixels]
) -> tuple[FloatArray, dict[str, NDArray[Any]]]:
    """Return the known points of a relief map, coloured by the first photo that has each in frame.

    Returns
    -------
    xyz : ndarray, shape (n, 3)
        X, Y, relief. [m]
    attributes : dict of str to ndarray, shape (n,)
        ``red``, ``green``, ``blue`` (8 bits), ``sigma`` of the relief [m], ``quality``.
    """
    pictures = [to_eight_bit(np.asarray(image)) for image in images]
    pictures = [np.repeat(p[..., None], 3, axis=2) if p.ndim == 2 else p for p in pictures]
    positions, colours = [], []
    for row in range(0, relief.shape[0], _ROWS):
        rows = slice(row, row + _ROWS)
        finite = relief.known[rows]
        if not finite.any():
            continue
        xyz = np.column_stack([relief.plane_positions(rows)[finite], relief.r[rows][finite]])
        positions.append(xyz)
        colours.append(_colours(xyz, photos, pictures))
    finite = relief.known
    attributes = dict(zip(("red", "green", "blue"), np.concatenate(colours).T, strict=True))
    attributes |= {
        "sigma": relief.sigma[finite].astype(np.float32),
        "quality": relief.quality[finite],
    }
    return np.concatenate(positions), attributes


def _colours(
    xyz: FloatArray, photos: Sequence[Photo], pictures: Sequence[NDArray[Any]]
) -> NDArray[Any]:
    """Return the colours of points in the first photo that has each in frame, (n, 3)."""
    pixels = photos[0].project(xyz)
    colours = values_at(pictures[0], pixels, cv2.INTER_LINEAR)
    for number in range(1, len(photos) if len(photos) > 2 else 1):
        size = np.array(pictures[number - 1].shape[1::-1])
        with np.errstate(invalid="ignore"):
            beyond = ~((pixels >= 0) & (pixels <= size - 1)).all(axis=-1)
        if not beyond.any():
            break
        pixels[beyond] = photos[number].project(xyz[beyond])
        colours[beyond] = values_at(pictures[number], pixels[beyond], cv2.INTER_LINEAR)
    return colours


def _check_outputs(job: ReliefJob, *inputs: Path) -> None:
    """Refuse, before any work, outputs that could not be written."""
    check_ending(job.out, "the relief map is written as .tif.", ".tif", ".tiff")
    check_ending(job.preview, "the preview is written as .png.", ".png")
    rule = "point clouds are written as .ply, .las or .laz."
    check_ending(job.cloud, rule, ".ply", ".las", ".laz")
    check_ending(job.suggested, "suggested faces are written as .geojson.", ".geojson")
    for path in (job.out, job.preview, job.suggested):
        check_not_input(path, *inputs, *((job.faces,) if isinstance(job.faces, Path) else ()))
    check_all_writable(job.out, job.preview, job.cloud, job.suggested, overwrite=job.overwrite)
