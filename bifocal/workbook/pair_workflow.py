"""A survey workbook wherever a pair file is taken: the set-up as typed, its points as relief."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bifocal.model import Lens, Pair, Photo, PhotoSet, Points, of_distances, pair_or_set
from bifocal.remarks import remark
from bifocal.survey import SurveySetup
from bifocal.workbook.reading.reader import read_survey
from bifocal.workbook.sources import BOOKS, described_pair
from bifocal.workbook.workflow import solve
from photocore.arrays import FloatArray, not_negative
from photocore.errors import InputError, located
from photocore.images import image_info
from photocore.names import on_disk
from photocore.output import all_or_none, check_all_writable, check_ending, relative_name

#: Standard deviation of a distance by tape: it ends at the lens, the ray in its entrance pupil. [m]
SIGMA_DISTANCE = 0.02


def is_workbook(path: Path | str) -> bool:
    """Tell by its ending whether a file is a workbook, and so no pair file."""
    return Path(path).suffix.lower() in BOOKS


def read_pair(path: Path | str) -> Pair:
    """Return the pair of a pair file, or of a survey workbook exactly as its set-up is typed.

    Parameters
    ----------
    path : path
        A pair file, or a survey workbook (``.xlsx .xlsm .ods``) whose sheet `Setup` names the
        photos (``photo_1``, ``photo_2``) beside distances and principal distances.

    Returns
    -------
    Pair
        Nothing is registered anew: of an ideal set-up both photos look square at the wall from one
        nadir point. ``remarks`` says what was assumed because its cells are blank.

    Raises
    ------
    InputError, GeometryError
        If the file or the set-up cannot be used; the message names file and cells.
    """
    if not is_workbook(path):
        return Pair.read(path)
    path = Path(path)
    setup = read_survey(path).setup
    with located(setup.where):
        pair = _general(setup, path) if setup.matrices is not None else _ideal(setup, path.parent)
    return replace(pair, extra={"name": path.stem, **pair.extra})


def read_photos(path: Path | str) -> Pair | PhotoSet:
    """Return a set of three photos or more, or a pair: that of a set of two, else as `read_pair`.

    Raises
    ------
    InputError, GeometryError
        If the file cannot be used.
    """
    return read_pair(path) if is_workbook(path) else pair_or_set(path)


@all_or_none()
def write_pair(
    book: Path, out: Path, *, sigma_distance: float = SIGMA_DISTANCE, overwrite: bool = False
) -> Pair:
    """Write the pair file of a survey workbook's set-up, exactly as it is typed, and return it.

    Parameters
    ----------
    book : path
        Survey workbook that names its photos, as for `read_pair`.
    out : path
        ``.json``; photos are named as seen from its folder.
    sigma_distance : float
        Standard deviation of d_1 and d_2, carried to every point; the scales of the photos count
        as exact. [m]
    overwrite : bool

    Raises
    ------
    InputError, GeometryError
        If the set-up lacks something, or is that of a pair file already.
    """
    check_ending(out, f"a pair file ends in .json; write --out {out.stem}.pair.json.", ".json")
    check_all_writable(out, overwrite=overwrite)
    not_negative(sigma_distance, "sigma_distance", unit="m")
    setup = read_survey(book).setup
    if setup.matrices is not None:
        raise InputError(
            remark("survey.setup_of_file", of=setup.where, file=setup.pair_file or "not named")
        )
    pair = read_pair(book)
    first, second = (
        replace(photo, file=relative_name(pair.folder / (photo.file or ""), out.parent))
        for photo in (pair.image1, pair.image2)
    )
    stated = of_distances(pair.d1, pair.d2, sigma_distance)
    typed = {"setup": {"way": "as set up", "source": book.name, "assumed": list(pair.remarks)}}
    written = Pair(image1=first, image2=second, orientation=stated, extra=typed)
    written.write(out, overwrite=overwrite)
    return replace(written, folder=out.parent, remarks=pair.remarks)


def _general(setup: SurveySetup, path: Path) -> Pair:
    """Return the pair whose homographies the workbook holds, with its photos."""
    named = path.parent / setup.pair_file if setup.pair_file else None
    file = named if named is not None and named.is_file() else None
    pair = described_pair(setup, file, path.parent)
    if pair is None:
        raise InputError("the distances d_1 and d_2 are needed beside the homographies.")
    if setup.media and not setup.refracted:
        pair = pair.in_air()
    first, second = pair.as_given
    typed = _photo_files(setup, path.parent)
    stated = Pair.read(file) if file is not None and not all(typed) else None
    if stated is not None:
        typed = tuple(
            name or str(stated.photo_file(number)) for number, name in enumerate(typed, start=1)
        )
    if not all(typed):
        raise InputError(NO_PHOTOS)
    sigma = setup.measuring.sigma_px
    return replace(
        pair,
        image1=replace(first, file=typed[0], sigma_pixel=sigma or first.sigma_pixel),
        image2=replace(second, file=typed[1], sigma_pixel=sigma or second.sigma_pixel),
        exchanged=False,
        remarks=(),
    )


#: What is said where a workbook names no photos.
NO_PHOTOS = (
    "photo_1 and photo_2 are blank: type the names of both photo files, relative to the workbook."
)


def _photo_files(setup: SurveySetup, folder: Path) -> tuple[str, ...]:
    """Return both photos as typed, found whichever way the folders are separated."""
    names = [
        str(Path(name)) if (folder / name).is_file() else name.replace("\\", "/")
        for name in (setup.photo1, setup.photo2)
    ]
    files = [on_disk(folder / name) for name in names]
    return tuple(
        name if not file.is_file() or (folder / name).is_file() else relative_name(file, folder)
        for name, file in zip(names, files, strict=True)
    )


def _ideal(setup: SurveySetup, folder: Path) -> Pair:
    """Return the ideal pair in pixels of its photos."""
    setup.pair()  # the refusals of the survey come first
    names = _photo_files(setup, folder)
    if not all(names):
        raise InputError(NO_PHOTOS)
    taking = setup.taking
    if taking.c1 is None or taking.c2 is None:
        raise InputError("c_1 and c_2, the principal distances [mm], are needed to use the photos.")
    setup.check_scales()
    setup = setup.but(enlargement1=1.0, enlargement2=1.0)  # of prints; these are the photos
    sizes = [image_info(folder / name).size for name in names]
    remarks = [*setup.remarks]
    pitch = taking.pitch
    if pitch is None:
        if setup.sensor is None:
            raise InputError(remark("survey.no_pixel_size"))
        pitch = max(setup.sensor) / max(sizes[0])
        remarks.append(remark("survey.pixel_assumed", size=1000 * pitch))
    nadirs = []
    for number, nadir, size in zip(
        (1, 2), (setup.taking.nadir1, setup.taking.nadir2), sizes, strict=True
    ):
        if nadir is None:
            nadir = ((size[0] - 1) / 2, (size[1] - 1) / 2)
            remarks.append(remark("survey.nadir_assumed", number=number))
        nadirs.append(nadir)
    pair = Pair.ideal(
        d1=taking.d1 or np.nan, d2=taking.d2 or np.nan, c1=taking.c1, c2=taking.c2,
        pixel_size=pitch, nadir1=nadirs[0], nadir2=nadirs[1], sigma=setup.precision / pitch,
    )  # fmt: skip
    photos = [
        replace(
            photo, file=name, image_size=size, plane_from_pixel=_corrected(photo, matrix),
            lens=_in_pixels(setup.lens(image), pitch, nadirs[image - 1], size),
        )
        for image, photo, name, size, matrix in zip(
            (1, 2), pair.as_given, names, sizes, setup.adjusted, strict=True
        )
    ]  # fmt: skip
    if setup.media and setup.refracted:
        photos = [replace(p, **setup.media.through(k)) for k, p in enumerate(photos, start=1)]
    return Pair(
        image1=photos[0],
        image2=photos[1],
        folder=folder,
        remarks=tuple(f"{setup.where}: {remark}" for remark in remarks),
    )


def _in_pixels(
    lens: Lens | None, pitch: float, nadir: tuple[float, float], size: tuple[int, int]
) -> Lens | None:
    """Return a lens for the pixels of a photo that is stated in millimetres from its nadir."""
    if lens is None or not lens.coefficients.any():
        return None
    c, (u, v) = lens.camera_matrix[0, 0] / pitch, lens.principal_point / pitch
    matrix = np.array([[c, 0.0, nadir[0] + u], [0.0, c, nadir[1] - v], [0.0, 0.0, 1.0]])
    return replace(lens, camera_matrix=matrix, image_size=size)


def _corrected(photo: Photo, matrix: FloatArray | None) -> FloatArray:
    """Return the homography of a photo whose millimetres the set-up corrects by a matrix."""
    if matrix is None:
        return photo.plane_from_pixel
    metres = (photo.scale_number or 1000.0) / 1000.0
    scale = np.diag([metres, metres, 1.0])
    return np.asarray(scale @ matrix @ np.linalg.inv(scale) @ photo.plane_from_pixel)


def is_survey(path: Path | str) -> bool:
    """Tell whether a workbook is taken as a pair: it states distances and names its photos."""
    setup = read_survey(path).setup
    return None not in (setup.taking.d1, setup.taking.d2) and bool(setup.photo1 and setup.photo2)


def points_of(path: Path | str) -> Points | None:
    """Return the points of a survey workbook, solved as its set-up says; None where it has none.

    Raises
    ------
    InputError, GeometryError
        As `bifocal.solve`.
    """
    if not len(read_survey(path).points):
        return None
    return solve(path).to_points()
