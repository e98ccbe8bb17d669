"""Lenses: board photos, straight lines or the database in; lens file or undistorted photos out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bifocal.calibration.board_calibration import Calibration
from bifocal.calibration.board_photos import calibrate
from bifocal.calibration.lens_database import lens_from_database
from bifocal.calibration.plumb_line import (
    GIVEN_FOCAL,
    GUESSED_FOCAL,
    PlumbLine,
    calibrate_from_lines,
    find_straight_edges,
)
from bifocal.files import judged_focal
from bifocal.model import SIGMA_FOCAL, Lens
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.cli import Progress, no_progress
from photocore.errors import InputError, located
from photocore.images import ImageArray, image_info, read_grey, read_image, write_image
from photocore.output import all_or_none, check_all_writable, check_not_input, check_writable
from photocore.tables import Column, read_table


def calibrate_from_boards(
    images: Sequence[Path],
    out: Path,
    *,
    overwrite: bool = False,
    progress: Progress = no_progress,
    **options: Any,
) -> Calibration:
    """Calibrate from board photos and write the lens file; ``options`` are those of `calibrate`."""
    check_not_input(out, *images)
    check_writable(out, overwrite=overwrite)
    _common_size(images)
    result = calibrate(
        map(read_grey, images), names=_unique_names(images), progress=progress, **options
    )
    result.lens.write(out, overwrite=overwrite)
    return result


def calibrate_from_edges(
    images: Sequence[Path],
    out: Path,
    *,
    lines: Path | None = None,
    focal_px: float | None = None,
    overwrite: bool = False,
) -> tuple[PlumbLine, tuple[str, ...]]:
    """Calibrate from straight façade lines and write the lens file.

    Parameters
    ----------
    images : sequence of Path
        Photos of one lens at one zoom mark; the size, and without ``lines`` the edges, are taken
        from them.
    out : Path
        The lens file.
    lines : Path, optional
        Table of picked points with headings ``line``, ``col [px]``, ``row [px]``.
    focal_px : float, optional
        Principal distance; default from EXIF, else the photo's diagonal. [px]

    Returns
    -------
    result : PlumbLine
    remarks : tuple of str
    """
    check_not_input(out, lines, *images)
    check_writable(out, overwrite=overwrite)
    size = _common_size(images)
    remarks: list[str] = []
    sigma_focal = GIVEN_FOCAL
    if focal_px is None:
        judged = judged_focal(image_info(images[0]))
        focal_px, sigma_focal = judged.focal, judged.sigma
        remarks.extend(filter(None, [judged.doubt]))
    if focal_px is None:
        sigma_focal = GUESSED_FOCAL
        focal_px = float(np.hypot(*size))
        remarks.append(remark("calibration.assumed_focal", focal_px=focal_px))
    if lines is not None:
        chains = _picked_lines(lines)
    else:
        chains = [line for path in images for line in find_straight_edges(read_grey(path))]
    with located(lines or ", ".join(map(str, images[:3]))):
        result = calibrate_from_lines(chains, size, focal_px=focal_px)
    if not result.straightens:
        k1, k2 = result.lens.coefficients[:2]
        remarks.append(remark("calibration.hardly_straighter", k1=k1, k2=k2))
        result = result.without_distortion()
    result = replace(result, lens=replace(result.lens, extra={SIGMA_FOCAL: sigma_focal}))
    result.lens.write(out, overwrite=overwrite)
    return result, tuple(remarks)


def write_database_lens(
    image: Path, out: Path, *, overwrite: bool = False, **names: Any
) -> tuple[Lens, tuple[str, ...]]:
    """Write the lens file of the lens database for a photo; see `lens_from_database`."""
    check_not_input(out, image)
    check_writable(out, overwrite=overwrite)
    entry = lens_from_database(image, **names)
    entry.lens.write(out, overwrite=overwrite)
    return entry.lens, (entry.remark,)


@all_or_none()
def undistort_images(
    images: Sequence[Path],
    lens: str,
    *,
    folder: Path | None = None,
    overwrite: bool = False,
    progress: Progress = no_progress,
    **names: Any,
) -> tuple[list[Path], tuple[str, ...]]:
    """Write photos without lens distortion, each resampled once.

    Parameters
    ----------
    images : sequence of Path
    lens : str
        A lens file, or ``exif`` for the lens database.
    folder : Path, optional
        Where to; default beside each photo. Names get ``_undistorted``.

    Returns
    -------
    written : list of Path
    remarks : tuple of str
    """
    one = None if lens.lower() == "exif" else Lens.read(lens)
    targets = []
    for path in images:
        image_info(path)
        targets.append((folder or path.parent) / f"{path.stem}_undistorted{path.suffix}")
    check_all_writable(*targets, overwrite=overwrite)
    remarks: list[str] = []
    for done, (path, target) in enumerate(zip(images, targets, strict=True)):
        progress(done, len(images), path.name)
        if one is None:
            entry = lens_from_database(path, **names)
            current = entry.lens
            remarks.append(f"{path.name}: {entry.remark}")
        else:
            current = one
        check_size(current, path)
        write_image(target, undistorted(read_image(path), current), overwrite=overwrite)
    progress(len(images), len(images))
    return targets, tuple(remarks)


def check_size(lens: Lens, path: Path) -> None:
    """Refuse a lens that belongs to photos of another size.

    Raises
    ------
    InputError
        If the photo's size is not the lens file's.
    """
    size = image_info(path).size
    if size != lens.image_size:
        turned = " (turned by 90 degrees?)" if size == lens.image_size[::-1] else ""
        raise InputError(
            f"{path}: is {size[0]} x {size[1]} px, the lens file is for "
            f"{lens.image_size[0]} x {lens.image_size[1]} px{turned}. "
            "Calibrate with photos of the same size and zoom."
        )


def undistorted(image: ImageArray, lens: Lens) -> ImageArray:
    """Return the photo without distortion: same size, same camera matrix, cubic, in strips."""
    height, width = image.shape[:2]
    result = np.empty_like(image)
    # Strips keep the coordinate maps small, and below remap's limit of 32767 rows.
    for top in range(0, height, 512):
        bottom = min(top + 512, height)
        columns, rows = _seen_at(lens, top, (width, bottom - top))
        result[top:bottom] = cv2.remap(
            image, columns, rows, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT
        )
    return result


def _seen_at(lens: Lens, top: int, size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return columns and rows where a strip of ideal pixels is seen, single precision. [px]"""
    if lens.model == "radial":
        columns, rows = np.meshgrid(np.arange(size[0]), np.arange(top, top + size[1]))
        pixels = lens.distort(np.stack([columns, rows], axis=-1)).astype(np.float32)
        return np.ascontiguousarray(pixels[..., 0]), np.ascontiguousarray(pixels[..., 1])
    matrix, terms = np.array(lens.camera_matrix), np.array(lens.coefficients)
    strip = matrix.copy()
    strip[1, 2] -= top
    begin = (
        cv2.fisheye.initUndistortRectifyMap
        if lens.model == "fisheye"
        else cv2.initUndistortRectifyMap
    )
    columns, rows = begin(matrix, terms, np.eye(3), strip, size, cv2.CV_32FC1)
    return columns, rows


def _common_size(images: Sequence[Path]) -> tuple[int, int]:
    """Return the size all photos share."""
    if not images:
        raise InputError("name at least one photo.")
    sizes = {path: image_info(path).size for path in images}
    first = sizes[images[0]]
    odd = [path for path, size in sizes.items() if size != first]
    if odd:
        raise InputError(
            f"{odd[0]}: is {sizes[odd[0]][0]} x {sizes[odd[0]][1]} px, {images[0]} is "
            f"{first[0]} x {first[1]} px; all photos must come from one camera, not cropped, held "
            "the same way."
        )
    focals = {image_info(path).focal_length for path in images} - {None}
    if len(focals) > 1:
        raise InputError(remark("calibration.zoomed", focals=", ".join(map(str, focals))))
    return first


def _unique_names(images: Sequence[Path]) -> list[str]:
    """Return file names, with folders where names repeat."""
    names = [path.name for path in images]
    return [str(p) if names.count(p.name) > 1 else p.name for p in images]


def _picked_lines(path: Path) -> list[FloatArray]:
    """Return the points of each line in a table."""
    table = read_table(
        path,
        [
            Column("line", aliases=("id", "name"), kind="text", required=True),
            Column("col", aliases=("column", "x"), kind="number", required=True),
            Column("row", aliases=("y",), kind="number", required=True),
        ],
    )
    names = list(table.values["line"])
    points = np.column_stack([table.values["col"], table.values["row"]])
    return [points[[n == name for n in names]] for name in dict.fromkeys(names)]
