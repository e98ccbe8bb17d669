"""Bundler's ``bundle.out`` with its list of photos.

P = R X + t, the camera looks along -z and y is up: p = -P / P.z, p' = f (1 + k1 p² + k2 p⁴) p in
pixels from the middle of the photo (Bundler's manual, Output format). It says nothing of the
photos' size: they have to be at hand.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray, floats_of_words
from photocore.camera import checked_rotation, lens_data, nearest_rotation
from photocore.errors import InputError
from photocore.programs.model import ForeignProject, ForeignView
from photocore.textfile import read_text

#: From axes with y up and z backwards.
_TURN = np.diag([1.0, -1.0, -1.0])


def read_bundler(path: Path, size_of: Callable[[str], tuple[int, int]]) -> ForeignProject:
    """Return the registered photos and the points of a bundle file.

    Parameters
    ----------
    path : path
        The file; the list of photos lies beside it or a folder up.
    size_of : callable
        Returns width and height of a photo. [px]

    Raises
    ------
    InputError
        Naming what is missing or cannot be used.
    """
    lines = [line for line in read_text(path, "bundle file").splitlines() if line[:1] != "#"]
    words = " ".join(lines).split()
    if len(words) < 2 or not all(word.isdecimal() for word in words[:2]):
        raise InputError(f"{path}: does not begin with the numbers of cameras and points.")
    cameras, count = map(int, words[:2])
    end = 2 + 15 * cameras
    if len(words) < end:
        raise InputError(f"{path}: holds fewer than {cameras} cameras of 15 numbers.")
    blocks = floats_of_words(words[2:end], path, "camera number {}").reshape(-1, 15)
    names = _names(path, cameras)
    views = []
    for name, block in zip(names, blocks, strict=True):
        if not block[0]:  # not registered
            continue
        rotation = checked_rotation(
            block[3:12].reshape(3, 3), f"{path}: rotation of {name}", tolerance=1e-5
        )
        size = size_of(name)
        middle = [(side - 1) / 2 for side in size]
        lens = lens_data([block[0]] * 2, middle, [*block[1:3], 0, 0], size, f"Bundler, {path.name}")
        turn = nearest_rotation(rotation)
        views.append(ForeignView(name, lens, _TURN @ turn, -turn.T @ block[12:]))
    if not views:
        raise InputError(f"{path}: holds no registered photo.")
    unregistered = cameras - len(views)
    notes = (f"{unregistered} photos that are not registered left out.",) if unregistered else ()
    points = _points(words[end:], count, path)
    return ForeignProject("Bundler", tuple(views), points, remarks=notes)


def _names(path: Path, cameras: int) -> list[str]:
    """Return the names in the list of photos."""
    folders = (path.parent, path.parent.parent)
    places = [folder / name for folder in folders for name in (f"{path.name}.list.txt", "list.txt")]
    place = next((place for place in places if place.is_file()), None)
    if place is None:
        raise InputError(f"{path}: its list of photos, list.txt, is not beside it; copy it there.")
    lines = [line.split() for line in read_text(place, "list of photos").splitlines()]
    names = [words[0] for words in lines if words]
    if len(names) != cameras:
        raise InputError(
            f"{place}: lists {len(names)} photos, {path.name} has {cameras} cameras; give "
            "one line to each."
        )
    return names


def _points(words: list[str], count: int, path: Path) -> FloatArray:
    """Return positions: of each point follow a colour and so many views of four numbers each."""
    points, place = [], 0
    for k in range(count):
        head = words[place : place + 7]
        if len(head) < 7 or not head[6].isdecimal():
            raise InputError(f"{path}: point {k + 1} of {count} is cut short or damaged.")
        points.append(floats_of_words(head[:3], path, f"point {k + 1}"))
        place += 7 + 4 * int(head[6])
    return np.array(points).reshape(-1, 3)
