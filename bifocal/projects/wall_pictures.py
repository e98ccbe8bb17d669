"""The picture of a project's walls: each square on, from the photo that shows it best."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from bifocal.model import Lens
from bifocal.orientation import resampled
from bifocal.projects.wall_frame import ProjectWall
from photocore.arrays import BoolArray, ByteArray
from photocore.camera import project
from photocore.images import read_grey, write_image
from photocore.programs import ForeignView

#: Longer side of a wall's picture, and the height of its line. [px]
SIDE, LINE = 800, 40


def write_wall_pictures(
    path: Path, walls: Sequence[ProjectWall], words: Sequence[str], views: Sequence[ForeignView],
    files: Mapping[str, Path | None], *, overwrite: bool = False,
) -> None:  # fmt: skip
    """Write one picture of all walls, below each other, each under its words."""
    pictures = [squared(wall, views, files) for wall in walls]
    sheet = np.zeros((sum(len(p) + LINE for p in pictures), SIDE), np.uint8)
    top = 0
    for text, picture in zip(words, pictures, strict=True):
        font = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(sheet, text, (10, top + LINE - 12), font, 0.7, 255, 1, cv2.LINE_AA)
        top += LINE
        sheet[top : top + len(picture), : picture.shape[1]] = picture
        top += len(picture)
    write_image(path, sheet, overwrite=overwrite)


def squared(
    wall: ProjectWall, views: Sequence[ForeignView], files: Mapping[str, Path | None]
) -> ByteArray:
    """Return the wall square on, by the photo that shows most of it, of such the squarest."""
    left, lower, right, upper = wall.bounds
    gsd = max(right - left, upper - lower) / SIDE
    x, y = np.arange(left, right, gsd)[:SIDE], np.arange(upper, lower, -gsd)[:SIDE]
    places = np.stack([*np.meshgrid(x, y), np.zeros((len(y), len(x)))], axis=-1)
    best, most = (np.zeros((len(y), len(x)), np.uint8)), 0.0
    for view in sorted(views, key=lambda one: one.rotation[2] @ wall.frame.rotation[2]):
        camera, path = view.camera.carried(wall.frame), files[view.name]
        if path is None or camera.centre[2] <= 0 or camera.rotation[2, 2] >= 0:
            continue
        ahead: BoolArray = (places - camera.centre) @ camera.rotation[2] > 0.1 * camera.centre[2]
        pixels = np.full((*ahead.shape, 2), np.nan)
        pixels[ahead] = Lens(**view.lens._asdict()).distort(project(camera, places[ahead]))
        inside = np.asarray(
            ((pixels > 0) & (pixels < np.array(view.lens.image_size) - 1)).all(axis=-1), bool
        )
        # A tenth more of the wall is worth a photo taken more aslant.
        if inside.mean() > most + 0.1:
            most = float(inside.mean())
            best = resampled(read_grey(path), np.where(np.expand_dims(inside, -1), pixels, np.nan))
    return best
