"""The files of a multi-plane calibration: multi_planes.par, and .crd with .fix beside it.

OpenPTV writes two files for every calibration image: ``.crd`` with the number and the image
coordinates of each target it took, ``.fix`` with number, X, Y and Z of the point it took it for,
in the same order. ``multi_planes.par`` has the number of positions of the body and a stem of file
names for each, to which the number of the camera is added.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from multimedia.media import Sensor
from multimedia.openptv.openptv_files import KIND
from multimedia.openptv.plane_sets import PlaneCandidates, PlaneSet
from photocore.arrays import FloatArray, IntArray, floats_of_words
from photocore.errors import InputError
from photocore.textfile import read_text

#: OpenPTV's number of a point for which it found no target.
_NOT_FOUND = -999
#: Fewer points than this make no set.
_FEWEST = 4
#: Names of copies: looked at last.
_COPY = re.compile(r"copy|old|backup|ba?c?k(?![a-z])|~|\(\d+\)", re.IGNORECASE)
_CAMERA_WORD = re.compile(r"[_\- ]*cam(era)?[_\- ]*$", re.IGNORECASE)


def read_stems(path: Path) -> list[str]:
    """Read multi_planes.par: the stems of file names of each position of the body.

    Raises
    ------
    InputError
        If fewer stems follow than the first line announces.
    """
    lines = [line.strip() for line in read_text(path, KIND).splitlines() if line.strip()]
    count = int(floats_of_words(lines[:1] or [""], path, "line 1 (number of planes)")[0])
    stems = [line.replace("\\", "/") for line in lines[1 : 1 + count]]
    if count < 1 or len(stems) < count:
        raise InputError(
            f"{path}: its first line announces {count} planes, {len(stems)} names follow."
        )
    return stems


def labels_of(stems: Sequence[str]) -> list[str]:
    """Return a name for each position: ``cal/plane1_cam`` and ``cal/plane1/cam`` are ``plane1``."""
    labels = []
    for number, stem in enumerate(stems, start=1):
        parts = [_CAMERA_WORD.sub("", part) for part in stem.split("/")]
        named = [part for part in parts if part]
        labels.append(named[-1] if named else f"plane{number}")
    if len(set(labels)) < len(labels):
        return [f"plane{number}" for number in range(1, len(stems) + 1)]
    return labels


def read_set(crd: Path, fix: Path, *, sensor: Sensor, label: str, source: str) -> PlaneSet:
    """Read a .crd file and the .fix file that goes with it.

    ``fix`` may also be a calibration body, ``.txt``: its points are then those of the .crd file,
    one by one, as OpenPTV takes them. Image coordinates are pixels, or mm from the centre of the
    sensor as older versions of OpenPTV wrote them: those lie on both sides of zero.

    Raises
    ------
    InputError
        If the two do not belong together, or what is read lies off the sensor.
    """
    numbers, places = _rows(crd, 3)
    body, xyz = _rows(fix, 4)
    whole = fix.suffix.lower() == ".txt" and len(numbers) == len(body)
    if whole or (len(numbers) == len(body) and ((numbers == body) | (numbers == _NOT_FOUND)).all()):
        order = np.arange(len(body), dtype=np.int64)
    else:
        order = _by_number(crd, fix, numbers, body)
    listed = numbers != _NOT_FOUND
    places, xyz = places[listed], xyz[order[listed]]
    _, row, count = np.unique(xyz, axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        number = numbers[listed][row[int(count.argmax())]]
        raise InputError(
            f"{crd} and {fix.name}: {int((count > 1).sum())} points stand there more than once, "
            f"such as that of number {number:g}."
        )
    if len(places) < _FEWEST:
        raise InputError(f"{crd}: holds {len(places)} points; expected at least {_FEWEST}.")
    half = np.array([sensor.width, sensor.height]) * sensor.pixel_size / 2
    in_mm = (places < 0).any() and (np.abs(places) <= 1.01 * half).all()
    image = places if in_mm else sensor.image_from_pixel(places)
    if not (np.abs(image) <= 1.01 * half).all():
        raise InputError(
            f"{crd}: {int((np.abs(image) > 1.01 * half).any(axis=1).sum())} of {len(image)} points "
            f"lie off the sensor of {sensor.width} x {sensor.height} px."
        )
    return PlaneSet(label=label, source=source, image=image, xyz=xyz)


def find_sets(
    folder: Path, stems: Sequence[str], images: Sequence[str], sensor: Sensor
) -> tuple[tuple[PlaneCandidates, ...], tuple[str, ...]]:
    """Return what each camera has, and what could not be used.

    Parameters
    ----------
    folder : path
        Of the experiment; all folders below are searched, since names and places of real
        experiments disagree with what multi_planes.par says.
    stems : sequence of str
        From `read_stems`; empty without multi_planes.par.
    images : sequence of str
        Calibration image of each camera, as in ptv.par.
    sensor : Sensor
        For the units of the image coordinates.
    """
    paths = [path for path in sorted(folder.rglob("*")) if not path.name.startswith(".")]
    files, bodies, texts = (
        [path for path in paths if path.suffix.lower() == ending]
        for ending in (".crd", ".fix", ".txt")
    )
    labels, odd = labels_of(stems), dict[str, None]()
    cameras = []
    for k, image in enumerate(images):
        number = _camera_number(image, k)
        positions = []
        for stem, label in zip(stems, labels, strict=True):
            # Any name with the position and the camera in it will do; OpenPTV's own comes first.
            ours = _named(files, folder, label, number, first=f"{stem}{number}.tif")
            theirs = _named(bodies, folder, label, number, first=f"{stem}{number}.tif")
            theirs += [path for path in texts if _position(label).search(path.name)]
            positions.append(_pairs(folder, ours, theirs, sensor, label, odd))
        name = Path(image.replace("\\", "/")).name
        named = [path for path in files if path.name.lower() == f"{name}.crd".lower()]
        whole = _pairs(folder, named, [], sensor, "", odd)
        cameras.append(PlaneCandidates(positions=tuple(positions), together=whole))
    return tuple(cameras), tuple(odd)


def _pairs(
    folder: Path,
    files: Sequence[Path],
    bodies: Sequence[Path],
    sensor: Sensor,
    label: str,
    odd: dict[str, None],
) -> tuple[PlaneSet, ...]:
    """Return the sets that each .crd makes with the .fix beside it, else with another's."""
    sets: list[PlaneSet] = []
    for crd in files:
        beside = crd.with_suffix(".FIX")
        beside = beside if beside.is_file() else crd.with_suffix(".fix")
        for fix in dict.fromkeys([*([beside] if beside.is_file() else []), *bodies]):
            source = crd.relative_to(folder).as_posix()
            if fix != beside:
                source += f" with {fix.relative_to(folder).as_posix()}"
            try:
                sets.append(read_set(crd, fix, sensor=sensor, label=label, source=source))
            except InputError as error:
                if fix.suffix.lower() == ".fix":  # other text may be of anything
                    odd[f"left out: {error}"] = None
                continue
            break
        else:
            if beside not in bodies and not beside.is_file():
                name = crd.relative_to(folder).as_posix()
                odd[f"{name} was left out: no {beside.name} says which points these are."] = None
    return tuple(sets)


def _named(
    files: Sequence[Path], folder: Path, label: str, number: int, *, first: str
) -> list[Path]:
    """Return the files whose names tell this position and camera, the likeliest first."""
    position = _position(label)
    camera = re.compile(rf"cam(era)?[_\- ]?0*{number}(?!\d)", re.IGNORECASE)
    ranked = []
    for path in files:
        name = path.relative_to(folder).as_posix()
        exact = name.rpartition(".")[0] == first
        if exact or (position.search(name) and camera.search(path.name)):
            ranked.append((not exact, _COPY.search(name) is not None, name.count("/"), name, path))
    return [entry[-1] for entry in sorted(ranked)]


def _position(label: str) -> re.Pattern[str]:
    """Return what finds a position of the body in a name."""
    return re.compile(rf"(?<![a-z0-9]){re.escape(label)}(?!\d)", re.IGNORECASE)


def _camera_number(image: str, k: int) -> int:
    """Return the number of a camera in file names: that of its calibration image."""
    match = re.search(r"cam(?:era)?[_\- ]?0*(\d+)", Path(image.replace("\\", "/")).name, re.I)
    return int(match.group(1)) if match else k + 1


def _rows(path: Path, width: int) -> tuple[FloatArray, FloatArray]:
    """Return the numbers and the coordinates of a .crd or .fix file."""
    lines = [line.split() for line in read_text(path, KIND).splitlines() if line.strip()]
    for place, line in enumerate(lines, start=1):
        if len(line) != width:
            raise InputError(f"{path}, line {place}: found {len(line)} values, expected {width}.")
    words = [word for line in lines for word in line]
    table = floats_of_words(words, path, "value {}").reshape(-1, width)
    return table[:, 0], table[:, 1:]


def _by_number(crd: Path, fix: Path, numbers: FloatArray, body: FloatArray) -> IntArray:
    """Return the row of the body of each number; refuse files that do not belong together."""
    place = {number: row for row, number in enumerate(body.tolist())}
    in_body = [number in place or number == _NOT_FOUND for number in numbers.tolist()]
    if len(place) < len(body) or not all(in_body):
        raise InputError(
            f"{crd} and {fix.name} hold {len(numbers)} and {len(body)} points whose numbers "
            "differ: they are of different calibrations."
        )
    return np.array([place.get(number, 0) for number in numbers.tolist()], dtype=np.int64)
