"""Images of particles in, files of targets out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.openptv import targets_text
from multimedia.projects import read_project, write_columns
from multimedia.remarks import remark
from multimedia.targets.target_images import TargetImages, find_targets
from photocore.cli import Progress, no_progress
from photocore.errors import InputError, located
from photocore.images import READ, read_image
from photocore.output import (
    atomic_folder,
    check_all_writable,
    check_not_input,
    check_writable,
)
from photocore.tables.csvwrite import Columns

#: Share of targets that may be several before that is said.
_MANY = 0.05
#: Share of the greatest diameter from which on it is what bounds them.
_LARGE = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImageTargets:
    """Targets of one image.

    Attributes
    ----------
    image : path
    targets : TargetImages
    file : path, optional
        OpenPTV's file of them, where one is written.
    """

    image: Path
    targets: TargetImages
    file: Path | None


def targets_of_images(
    images: Sequence[Path],
    *,
    out: Path | None = None,
    threshold: float | None = None,
    scale: float = 12.0,
    smallest: float = 1.0,
    largest: float = 12.0,
    dark: bool = False,
    project: Path | None = None,
    overwrite: bool = False,
    progress: Progress = no_progress,
) -> tuple[list[ImageTargets], list[str]]:
    """Find the targets of images and write them.

    Parameters
    ----------
    images : sequence of path
        Photos or frames, of any cameras.
    out : path, optional
        A folder, for a ``_targets`` file of OpenPTV of each image; or one table of all, .csv or
        .xlsx.
    threshold, scale, smallest, largest, dark
        As `find_targets` takes them.
    project : path, optional
        Whose cameras the ``_targets`` files are for: they count pixels as its sensors do. Without
        one they count from the corner of the image, as OpenPTV does.

    Returns
    -------
    targets : list of ImageTargets
    remarks : list of str
        What to look at.

    Raises
    ------
    InputError
        If an image cannot be read, or two would write the same file.
    """
    is_table = out is not None and out.suffix.lower() in (".csv", ".xlsx")
    names = [_file_name(image) for image in images]
    offset = 0.5 if project is None else _offset(project)
    if out is not None and is_table:
        check_writable(out, overwrite=overwrite)
        check_not_input(out, *images)
    elif out is not None:
        _refuse_repeated(images, names)
        check_all_writable(*(out / name for name in names if out.exists()), overwrite=overwrite)
    listed: list[TargetImages] = []
    for k, image in enumerate(images):
        progress(k, len(images), image.name)
        grey = read_image(image, grey=True)
        with located(image):
            listed.append(
                find_targets(
                    grey,
                    threshold=threshold,
                    scale=scale,
                    smallest=smallest,
                    largest=largest,
                    dark=dark,
                )
            )
    progress(len(images), len(images))
    results = [
        ImageTargets(image=image, targets=one, file=None if out is None or is_table else out / name)
        for image, one, name in zip(images, listed, names, strict=True)
    ]
    if out is not None and is_table:
        write_columns(out, _columns(results), overwrite=overwrite)
    elif out is not None:
        with atomic_folder(out, overwrite=overwrite) as folder:
            for name, one in zip(names, listed, strict=True):
                (folder / name).write_text(_text(one, offset), encoding="utf-8")
    return results, _remarks(results, largest)


def _file_name(image: Path) -> str:
    """Return OpenPTV's name: that of the image, without an ending that programs know."""
    ending = image.suffix.lower()
    return f"{image.stem if ending in READ else image.name}_targets"


def _refuse_repeated(images: Sequence[Path], names: Sequence[str]) -> None:
    by_name: dict[str, Path] = {}
    for image, name in zip(images, names, strict=True):
        if name in by_name:
            first = by_name[name]
            raise InputError(remark("targets.same_file", first=first, second=image, file=name))
        by_name[name] = image


def _offset(project: Path) -> float:
    """Return how much more than from pixel centres the cameras of a project count. [px]"""
    offsets = set()
    for camera in read_project(project, posed=False).cameras:
        sensor = camera.described_sensor()
        middle = (np.array([sensor.width, sensor.height]) - 1) / 2
        more = np.unique(np.round(sensor.origin - middle, 3))
        offsets.add(float(more[0]) if len(more) == 1 and more[0] in (0.0, 0.5) else np.nan)
    if len(offsets) > 1 or not offsets <= {0.0, 0.5}:
        raise InputError(remark("targets.pixels", of=project))
    return offsets.pop()


def _text(targets: TargetImages, offset: float) -> str:
    """Return the targets as OpenPTV reads them: from top to bottom, as it looks for them by row."""
    order = np.argsort(targets.pixels[:, 1], kind="stable")
    return targets_text(
        targets.pixels[order] + offset,
        targets.counts[order],
        targets.extents[order],
        targets.sums[order],
    )


def _columns(images: Sequence[ImageTargets]) -> Columns:
    def joined(name: str, axis: int | None = None) -> Any:
        parts = [getattr(one.targets, name) for one in images]
        return np.concatenate([part if axis is None else part[:, axis] for part in parts])

    return {
        "image": [one.image.name for one in images for _ in range(len(one.targets))],
        "id": [str(k + 1) for one in images for k in range(len(one.targets))],
        "column [px]": joined("pixels", 0),
        "row [px]": joined("pixels", 1),
        "sigma_column [px]": joined("sigma", 0),
        "sigma_row [px]": joined("sigma", 1),
        "diameter [px]": joined("diameter"),
        "height": joined("height"),
        "sum": joined("sums"),
        "pixels": joined("counts").astype(float),
        "merged": ["yes" if flag else "" for one in images for flag in one.targets.merged],
    }


def _remarks(images: Sequence[ImageTargets], largest: float) -> list[str]:
    notes: list[str] = [
        remark("targets.none", of=one.image) for one in images if not len(one.targets)
    ]
    merged = sum(int(one.targets.merged.sum()) for one in images)
    count = sum(len(one.targets) for one in images)
    if merged > _MANY * count:
        notes.append(remark("targets.merged", merged=merged, count=count))
    sizes = np.concatenate([one.targets.diameter for one in images])
    if len(sizes) and np.median(sizes) > _LARGE * largest:
        notes.append(remark("targets.large", largest=largest))
    return notes
