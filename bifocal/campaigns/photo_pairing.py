"""A survey file from a folder of photos: which of them make a pair."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np

from bifocal.campaigns.survey_file import FORMAT
from bifocal.matching import Features, find_features, match_features
from bifocal.remarks import remark
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.images import ImageInfo, image_info, read_grey
from photocore.output import atomic_path, check_writable, relative_name

ENDINGS = frozenset({".jpg", ".jpeg", ".png", ".tif", ".tiff"})
TABLES = (".csv", ".xlsx", ".ods")
#: Pixels searched for features, and how many: enough to tell photos of one wall from others.
_BUDGET, _FEATURES = 4e5, 1200
#: Features that two photos of one wall share at least, after a homography within so many px. On
#: the sample and the churches pairs share 150 to 700, photos of different walls fewer than 12.
_SHARED, _TOLERANCE = 25, 8.0
#: The long lens has at least this many times the focal length of the short one.
_LONGER = 1.08


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotoPair:
    """Two photos of one wall.

    Attributes
    ----------
    far, near : Path
        The far one has the longer lens.
    shared : int
        Features they share.
    certain : bool
        Whether the focal lengths told which is which; `align` exchanges them where they did not.
    """

    far: Path
    near: Path
    shared: int
    certain: bool


def pair_photos(
    folder: Path, *, progress: Progress = no_progress
) -> tuple[list[PhotoPair], list[Path]]:
    """Return the pairs among the photos of a folder, and the photos that are in none.

    Photos are paired by content; of several candidates the one that shares most and is next
    to it by name wins. EXIF focal lengths say which is the far one, and keep photos of one focal
    length apart.

    Raises
    ------
    InputError
        If the folder is none, or holds fewer than two photos.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder of photos.")
    paths = sorted(p for p in folder.iterdir() if p.suffix.lower() in ENDINGS)
    infos: list[ImageInfo] = []
    for path in paths:
        infos.append(image_info(path))
    if len(infos) < 2:
        raise InputError(f"{folder}: holds {len(infos)} photos; a pair needs two.")
    features = []
    for index, info in enumerate(infos):
        progress(index, len(infos), "looking at photos")
        features.append(find_features(read_grey(info.path), limit=_FEATURES, budget=_BUDGET))
    candidates = []
    for i, j in combinations(range(len(infos)), 2):
        if not _may_pair(infos[i], infos[j]):
            continue
        shared = _shared(features[i], features[j])
        if shared >= _SHARED:
            # Neighbours by name, as cameras number what they take, are likelier a pair.
            candidates.append((shared / (1.0 + 0.1 * (j - i - 1)), i, j, shared))
    pairs, paired = [], set()
    for _, i, j, shared in sorted(candidates, key=lambda c: (-c[0], c[1], c[2])):
        if i in paired or j in paired:
            continue
        paired |= {i, j}
        pairs.append((i, _ordered(infos[i], infos[j], shared)))
    alone = [info.path for k, info in enumerate(infos) if k not in paired]
    return [pair for _, pair in sorted(pairs, key=lambda p: p[0])], alone


def _may_pair(first: ImageInfo, second: ImageInfo) -> bool:
    """Tell whether focal lengths allow a pair; unknown ones do."""
    a, b = _focal_lengths(first, second)
    return not a or not b or max(a, b) >= _LONGER * min(a, b)


def _focal_lengths(first: ImageInfo, second: ImageInfo) -> tuple[float | None, float | None]:
    """Return both focal lengths in one measure: 35 mm equivalents, else those of the lenses. [mm]

    The equivalent of one photo and the true length of the other do not compare.
    """
    a, b = first.focal_length_35, second.focal_length_35
    if a and b:
        return a, b
    return (None, None) if a or b else (first.focal_length, second.focal_length)


def _ordered(first: ImageInfo, second: ImageInfo, shared: int) -> PhotoPair:
    a, b = _focal_lengths(first, second)
    certain = bool(a and b)
    if a and b and b > a:
        first, second = second, first
    return PhotoPair(far=first.path, near=second.path, shared=shared, certain=certain)


def _shared(first: Features, second: Features) -> int:
    """Return how many features agree on one homography."""
    rows, columns = match_features(first, second)
    if len(rows) < 8:
        return 0
    a = np.ascontiguousarray(first.pixels[rows] / first.reduction)
    b = np.ascontiguousarray(second.pixels[columns] / second.reduction)
    cv2.setRNGSeed(1)
    _, good = cv2.findHomography(a, b, cv2.RANSAC, _TOLERANCE)
    return 0 if good is None else int(good.sum())


def write_survey_file(
    out: Path,
    folder: Path,
    pairs: Sequence[PhotoPair],
    unpaired: Sequence[Path],
    *,
    overwrite: bool = False,
) -> None:
    """Write the survey file of a folder's pairs, with what is still to be filled in."""
    check_writable(out, overwrite=overwrite)
    if not pairs:
        raise InputError(remark("campaign.no_pair", of=folder))
    lines = [
        "# Written by `bifocal survey --init`. Names of files are relative to this one.",
        f"format = {_quoted(FORMAT)}",
        f"name = {_quoted(folder.resolve().name)}",
        'out = "results"',
        "# For every pair that does not say otherwise:",
        'scale = "1:50"',
        'products = ["relief", "points", "drawing", "view", "report"]   # and "ortho"',
        'language = "en"                                        # it, de',
    ]
    for number, pair in enumerate(pairs, start=1):
        far, near = (_quoted(relative_name(path, out.parent)) for path in (pair.far, pair.near))
        lines += ["", "[[pair]]", f"name = {_quoted(f'{number:03d} {pair.far.stem}')}"]
        doubt = "" if pair.certain else "   # EXIF tells no focal length: far and near are guessed"
        lines += [f"far = {far}{doubt}", f"near = {near}   # {pair.shared} features in common"]
        control = _table_of(pair)
        if control is None:
            lines.append('control = ""   # table of control points; or auto = true and distance1')
        else:
            lines.append(f"control = {_quoted(relative_name(control, out.parent))}")
    if unpaired:
        names = ", ".join(path.name for path in unpaired)
        lines += ["", f"# In no pair: {names}"]
    with atomic_path(out, overwrite=overwrite) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _table_of(pair: PhotoPair) -> Path | None:
    """Return the table named like one of the photos."""
    for photo in (pair.far, pair.near):
        for ending in TABLES:
            if photo.with_suffix(ending).is_file():
                return photo.with_suffix(ending)
    return None


def _quoted(text: str) -> str:
    """Return a text as TOML wants it: JSON's quoting is a part of TOML's."""
    return json.dumps(text, ensure_ascii=False)
