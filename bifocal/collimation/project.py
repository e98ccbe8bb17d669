"""The files of a survey: found from whatever the page is started with."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.collimation.fields import NOTES, FieldError, fields_of
from bifocal.files import photo_infos
from bifocal.model import Pair, PhotoSet, pair_or_set
from bifocal.remarks import remark
from bifocal.workbook import is_survey, read_pair, read_survey
from photocore.errors import InputError, PhotogrammetryError
from photocore.images import READ, image_info
from photocore.textfile import file_name
from photocore.workbook import open_package

#: Endings of photos looked for in a folder.
PHOTOS = READ
_PAIR, _JOURNAL = ".pair.json", ".journal.jsonl"


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyFiles:
    """Where a survey's files lie, all in one folder unless the user says otherwise.

    Attributes
    ----------
    folder : Path
        Of the workbook, the journal and all results.
    stem : str
        What results are named after.
    workbook, journal : Path
        The workbook may not exist yet.
    pair : Path or None
        Pair file, or the workbook itself where its set-up names the photos; None before the photos
        are oriented.
    photos : tuple of Path
        Far and near photo, and what else shows the wall; empty before they are given.
    photo_set : Path or None
        File of the set that the page was started with.
    """

    folder: Path
    stem: str
    workbook: Path
    pair: Path | None = None
    photos: tuple[Path, ...] = ()
    photo_set: Path | None = None

    @property
    def journal(self) -> Path:
        """The journal, beside the workbook."""
        return self.folder / f"{self.workbook.stem}{_JOURNAL}"

    @property
    def pair_is_workbook(self) -> bool:
        """Whether the workbook's own set-up is the pair."""
        return self.pair is not None and self.pair.resolve() == self.workbook.resolve()

    def beside(self, ending: str) -> Path:
        """Return the path of a result: the stem with an ending."""
        return self.folder / f"{self.stem}{ending}"


def find_files(sources: Sequence[Path], workbook: Path | None = None) -> SurveyFiles:
    """Return the files of the survey that the page is started with.

    Parameters
    ----------
    sources : sequence of Path
        The file of a pair or a set, a survey workbook, a folder, photos (far, near, further
        ones); nothing: the current folder.
    workbook : Path, optional
        Where the points go; default the workbook given, else one named after the pair.

    Raises
    ------
    InputError
        If they are none of these, do not exist, or leave more than one choice.
    """
    if len(sources) > 1:
        return _of_photos(tuple(sources), workbook)
    source = sources[0] if sources else Path()
    if source.is_dir():
        return _of_folder(source, workbook)
    if not source.exists():
        raise InputError(f"{source}: no such file or folder.")
    ending = source.suffix.lower()
    if ending == ".json":
        return _of_pair(source, workbook)
    if ending in (".xlsx", ".xlsm"):
        if workbook is not None and not (workbook.exists() and workbook.samefile(source)):
            raise InputError(f"two workbooks were given, {source} and {workbook}; give one.")
        return _of_workbook(source)
    if ending in PHOTOS:
        raise InputError(remark("page.one_photo", of=source))
    raise InputError(remark("page.unknown_source", of=source))


def _of_pair(source: Path, workbook: Path | None) -> SurveyFiles:
    photos = pair_or_set(source)
    pair, shown = source, []
    if isinstance(photos, PhotoSet):
        best, pair = photos.best_pair(), _best_of(photos, source)
        pair_photos = [best.photo_file(1), best.photo_file(2)]
        shown = [
            *pair_photos,
            *(one.path for one in photos.photos if one.path not in pair_photos),
        ]
    stem = pair.name.removesuffix(".json").removesuffix(".pair")
    book = _workbook(workbook or pair.parent / f"{stem}.xlsx")
    files = SurveyFiles(
        folder=book.parent, stem=stem, workbook=book, pair=pair, photos=tuple(shown),
        photo_set=source if shown else None,
    )  # fmt: skip
    return replace(files, photos=_remembered(files).photos)


def _best_of(photos: PhotoSet, source: Path) -> Path:
    """Return the file of a set's best pair, written beside it once."""
    best = photos.best_pair()
    photo_infos(best)  # what is not there, or another photo, is refused before a file is written
    stem = source.name.removesuffix(".json").removesuffix(".photos")
    named = file_name(f"{stem}-{best.image1.name}-{best.image2.name}")
    pair = source.with_name(f"{named}{_PAIR}")
    if not pair.exists():
        best.write(pair)
    return pair


class JoinedSet:
    """The set that holds a pair and all photos of a survey; read again only when one is another."""

    def __init__(self) -> None:
        self._known: tuple[object, bool] | None = None

    def of(
        self, candidates: Sequence[Path | None], pair: Pair, files: Sequence[Path]
    ) -> Path | None:
        """Return the first file that is such a set, if one is."""
        for path in candidates:
            if path is None or not path.is_file():
                continue
            facts = path, path.stat().st_mtime_ns, pair, tuple(files)
            if self._known is None or self._known[0] != facts:
                self._known = facts, _holds(PhotoSet.read(path), pair, files)
            if self._known[1]:
                return path
        return None


def _holds(photos: PhotoSet, pair: Pair, files: Sequence[Path]) -> bool:
    """Whether a set is one of these photos, and a pair two of them as the set has them."""
    names = {photo.path.resolve() for photo in photos.photos}
    homographies = [photo.plane_from_pixel for photo in photos.photos]
    return names == {path.resolve() for path in files} and all(
        any(np.array_equal(photo.plane_from_pixel, one) for one in homographies)
        for photo in (pair.image1, pair.image2)
    )


def _of_photos(photos: tuple[Path, ...], workbook: Path | None) -> SurveyFiles:
    for number, photo in enumerate(photos):
        image_info(photo)
        if any(photo.samefile(earlier) for earlier in photos[:number]):
            raise InputError(f"{photo}: is given twice; give the far and the near photo.")
    book = _workbook(workbook or photos[0].parent / "survey.xlsx")
    files = SurveyFiles(folder=book.parent, stem=book.stem, workbook=book, photos=photos)
    if workbook is not None and _names_photos(book) and last_opened(files.journal) is None:
        pair = read_pair(book)
        two = [pair.photo_file(1), pair.photo_file(2)]
        if not all(a.is_file() and a.samefile(b) for a, b in zip(two, photos, strict=False)):
            raise InputError(
                f"{book}: its photos (photo_1, photo_2) are {two[0].name} and {two[1].name}, not "
                f"{photos[0].name} and {photos[1].name}; give the workbook alone, or another one."
            )
        return replace(files, pair=book)
    return _remembered(files)


def _of_workbook(workbook: Path) -> SurveyFiles:
    book = _workbook(workbook)
    files = _remembered(SurveyFiles(folder=book.parent, stem=book.stem, workbook=book))
    if files.pair is not None or files.photos:
        return files
    if not book.is_file():
        raise InputError(f"{workbook}: no such file.")
    if is_survey(book):
        return replace(files, pair=book)
    named = read_survey(book).setup.pair_file
    if not named:
        raise InputError(remark("page.no_photos_named", of=workbook, name=workbook.name))
    pair = book.parent / named
    if not pair.is_file():
        raise InputError(f"{workbook}: its pair file {named} is not there.")
    return replace(files, pair=pair)


def _of_folder(folder: Path, workbook: Path | None) -> SurveyFiles:
    if workbook is not None and workbook.exists():
        return _of_workbook(workbook)
    names = sorted(folder.iterdir())
    # Every journal names its files; one that does not was left by a start that failed.
    journals = [path for path in names if path.name.endswith(_JOURNAL) and last_opened(path)]
    pairs = [path for path in names if path.name.endswith(_PAIR)]
    photos = [path for path in names if path.suffix.lower() in PHOTOS]
    for candidates, what in ((journals, "surveys"), ([] if journals else pairs, "pair files")):
        if len(candidates) > 1:
            shown = ", ".join(path.name for path in candidates[:5])
            raise InputError(f"{folder}: holds {len(candidates)} {what} ({shown}); name one.")
    if journals:
        stem = journals[0].name.removesuffix(_JOURNAL)
        book = _workbook(workbook or folder / f"{stem}.xlsx")
        return _remembered(SurveyFiles(folder=folder, stem=stem, workbook=book))
    if pairs:
        return _of_pair(pairs[0], workbook)
    books = [path for path in names if _names_photos(path)] if workbook is None else []
    if len(books) > 1:
        shown = ", ".join(path.name for path in books[:5])
        raise InputError(f"{folder}: holds {len(books)} survey workbooks ({shown}); name one.")
    if books:
        return _of_workbook(books[0])
    if len(photos) == 2:
        return _of_photos((photos[0], photos[1]), workbook)
    book = _workbook(workbook or folder / "survey.xlsx")
    return SurveyFiles(folder=book.parent, stem=book.stem, workbook=book)


def _names_photos(path: Path) -> bool:
    """Whether a file is a workbook whose set-up names its photos."""
    if path.suffix.lower() not in (".xlsx", ".xlsm") or path.name.startswith("~$"):
        return False
    try:
        return path.is_file() and is_survey(path)
    except PhotogrammetryError:  # somebody's workbook that is no survey
        return False


def _workbook(path: Path) -> Path:
    """Return the path of the workbook, refusing what can be none."""
    if path.suffix.lower() not in (".xlsx", ".xlsm"):
        raise InputError(f"{path}: the survey workbook must end in .xlsx.")
    if not path.parent.is_dir():
        raise InputError(f"{path}: the folder {path.parent} does not exist; create it first.")
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except OSError as error:  # links that lead in a circle
        raise InputError(f"{path}: cannot be used ({error.strerror}); name another one.") from None
    else:
        with open_package(path):  # refused before the page is there, if it is none
            pass
    return path


def _remembered(files: SurveyFiles) -> SurveyFiles:
    """Return the files with pair and photos as the journal last named them."""
    record = last_opened(files.journal)
    if record is None:
        return files
    folder = files.folder
    pair = folder / record["pair"] if record.get("pair") else None
    photos = tuple(folder / name for name in record["photos"])
    stem = record["stem"] or files.stem
    return replace(files, stem=stem, pair=files.pair or pair, photos=files.photos or photos)


def last_opened(journal: Path) -> dict[str, Any] | None:
    """Return the last record of a journal that names the survey's files; None without one."""
    if not journal.is_file():
        return None
    last = None
    for line in journal.read_bytes().splitlines():
        if b'"op": "files"' in line:
            # What is wrong with a line is said when the journal is replayed.
            with contextlib.suppress(ValueError, RecursionError, AttributeError, FieldError):
                last = fields_of(json.loads(line), NOTES)
    return last
