"""A set of photos in, a COLMAP text model out, so that dense programs can go on."""

from __future__ import annotations

from pathlib import Path, PurePath

import numpy as np

from bifocal.model import Photo, PhotoSet, pinhole
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import InputError, located
from photocore.images import image_info
from photocore.output import check_not_input
from photocore.programs import camera_words, image_words, write_colmap_model

#: Camera matrices of homography and lens that differ by no more are one. [px]
SAME, SKEWED = 1e-3, 1e-2


def write_colmap(photos: PhotoSet, folder: Path | str, *, overwrite: bool = False) -> None:
    """Write a set of photos as a text model of COLMAP: cameras and photos, no points.

    Parameters
    ----------
    photos : PhotoSet
        In air; its frame becomes the model's, in metres.
    folder : path
        For cameras.txt, images.txt and points3D.txt.
    overwrite : bool
        Whether a folder that exists may be replaced.

    Raises
    ------
    InputError
        If a photo's camera or lens is none that COLMAP knows, or its size is not known.
    """
    if photos.layers is not None:
        raise InputError("the photos look through other media; COLMAP's models of photos in air "
                         "cannot say so.")  # fmt: skip
    cameras: dict[str, str] = {}
    images, files = [], [photo.file or photo.name for photo in photos.photos]
    short = [PurePath(file).name for file in files]
    names = short if len(set(short)) == len(short) else files
    for number, photo in enumerate(photos.photos, start=1):
        with located(photo.name):
            words, rotation, centre = _in_words(photo)
        camera = cameras.setdefault(words, str(len(cameras) + 1))
        words = image_words(rotation, -rotation @ centre, camera, names[number - 1])
        images += [f"{number} {words}", ""]
    lines = [f"{number} {words}" for words, number in cameras.items()]
    write_colmap_model(Path(folder), lines, images, [], overwrite=overwrite)


def export_photos(source: Path, folder: Path, *, overwrite: bool = False) -> None:
    """Write the set or pair of a file as a text model of COLMAP.

    Raises
    ------
    InputError
        If the file is none of them, or as `write_colmap`.
    """
    check_not_input(folder, source)
    photos = PhotoSet.read(source)
    with located(source):
        write_colmap(photos, folder, overwrite=overwrite)


def _in_words(photo: Photo) -> tuple[str, FloatArray, FloatArray]:
    """Return what COLMAP says of a photo's lens, and the photo's rotation and centre."""
    size = photo.image_size or image_info(photo.path).size
    camera, lens = pinhole(photo), photo.lens
    matrix = camera.matrix
    terms: FloatArray = np.zeros(0)
    if abs(matrix[0, 1]) / matrix[1, 1] * size[1] > SKEWED:
        raise InputError(remark("projects.no_square_axes"))
    if lens is not None:
        if lens.model == "radial" or np.abs(lens.camera_matrix - matrix).max() > SAME:
            raise InputError(remark("projects.two_matrices"))
        matrix, terms = lens.camera_matrix, lens.coefficients
    fisheye = lens is not None and lens.model == "fisheye"
    words = camera_words(matrix, terms, size, fisheye=fisheye)
    return words, camera.rotation, camera.centre
