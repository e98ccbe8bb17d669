"""VisualSFM's ``.nvm``.

A line a camera: name, f, quaternion (w x y z) from the world into the camera, centre, r, 0; y down,
z forwards, pixels from the middle of the photo. Its distortion corrects what was measured:
ideal = m (1 + r m²), m in units of f (its manual, and Multicore Bundle Adjustment's
``SetNormalizedMeasurementDistortion``). Blanks in names are written as quotation marks.

A calibration that was kept fixed stands in the first line: ``NVM_V3 FixedK fx cx fy cy r``, the
principal point from the corner of the first pixel; written by others, from the middle of the photo.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray, floats_of_words
from photocore.camera import FittedLens, fitted_lens, lens_data, rotation_from_quaternion
from photocore.errors import InputError
from photocore.programs.model import ForeignProject, ForeignView, chosen_part
from photocore.programs.photos import PhotoFinder
from photocore.remarks import remark
from photocore.textfile import read_text


def read_visualsfm(path: Path, photos: PhotoFinder, part: str | None = None) -> ForeignProject:
    """Return one of the models of a ``.nvm``, the largest unless another is named.

    Raises
    ------
    InputError
        Naming what is missing or cannot be used.
    """
    lines = [line for line in read_text(path, "NVM file").splitlines()
             if line.strip() and not line.startswith("#")]  # fmt: skip
    head = lines[0].split() if lines else []
    if head[:1] != ["NVM_V3"] or head[1:2] not in ([], ["FixedK"]) or len(head) not in (1, 6, 7):
        raise InputError(remark("programs.nvm", of=path, head=" ".join(head)[:40]))
    fixed = floats_of_words(head[2:], path, "FixedK").tolist()
    models: dict[str, tuple[list[str], list[str]]] = {}
    place = 1
    while place < len(lines) and (count := _count(lines, place, path)):
        cameras, place = lines[place + 1 : place + 1 + count], place + 1 + count
        points = _count(lines, place, path) if place < len(lines) else 0
        models[f"model {len(models) + 1}"] = cameras, lines[place + 1 : place + 1 + points]
        if len(cameras) < count or len(models[f"model {len(models)}"][1]) < points:
            raise InputError(f"{path}: is cut short or damaged.")
        place += 1 + points
    if not models:
        raise InputError(remark("programs.no_pose", of=path))
    name, remarks = chosen_part({key: len(held[0]) for key, held in models.items()}, part, path)
    views, fits = [], dict[str, None]()
    for line in models[name][0]:
        words = line.rsplit(maxsplit=10)
        values = floats_of_words(words[1:], path, f"camera {words[0]}")
        if len(values) != 10:
            raise InputError(f"{path}: camera {words[0]}: expected 10 numbers.")
        photo = words[0].replace('"', " ").replace("\\", "/")
        fit = _lens([values[0], *values[8:9]], fixed, photos.size(photo), path)
        rotation = rotation_from_quaternion(values[1:5], f"{path}: camera {photo}, quaternion")
        views.append(ForeignView(photo, fit.lens, rotation, values[5:8]))
        fits |= dict.fromkeys(fit.remarks)
    places = [floats_of_words(line.split()[:3], path, "point") for line in models[name][1]]
    xyz = np.array(places).reshape(-1, 3)
    return ForeignProject("VisualSFM", tuple(views), xyz, remarks=(*remarks, *fits))


def _count(lines: list[str], place: int, path: Path) -> int:
    if not (word := lines[place].strip()).isdecimal():
        raise InputError(f"{path}: expected a number of cameras or points, found {word!r:.40}.")
    return int(word)


def _lens(
    free: Sequence[float], fixed: Sequence[float], size: tuple[int, int], path: Path
) -> FittedLens:
    """Return a camera's lens: its focal length and r, and what was fixed for all, if anything."""
    middle, source = (np.array(size) - 1) / 2, f"VisualSFM, {path.name}"
    focal, radial = [free[0]] * 2, free[1]
    if fixed:
        focal, centre = [fixed[0], fixed[2]], np.array([fixed[1], fixed[3]])
        middle = (middle if (np.abs(centre) < 0.25 * np.array(size)).all() else -0.5) + centre
        radial = radial or (*fixed, 0.0)[4]
    if not radial:
        return FittedLens(lens_data(focal, middle.tolist(), [], size, source))

    def ideal(pixels: FloatArray) -> FloatArray:
        away = (pixels - middle) / focal
        return np.asarray(away * (1.0 + radial * (away**2).sum(axis=1, keepdims=True)))

    return fitted_lens(ideal, size, source)
