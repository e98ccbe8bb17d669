"""What a report tells of one pair, gathered from its files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import compress
from pathlib import Path
from typing import Any, ClassVar, Protocol, cast

import cv2
import numpy as np

from bifocal.files import ROWS, MadeFrom, check_maps, colour_strips, photo_infos, photos_of
from bifocal.model import (
    Bounds,
    Diagnostics,
    LengthCheck,
    MapSurface,
    Pair,
    Photo,
    PhotoSet,
    Quality,
    RasterReader,
    ReliefMap,
    check_scale,
    deviations_by_photo,
    pair_or_set,
)
from bifocal.options import defaults_of, typed
from bifocal.remarks import remark
from bifocal.reports.control_survey import is_exchanged, solve_control
from bifocal.survey import SolvedSurvey
from bifocal.workbook import solve
from photocore.arrays import ByteArray, FloatArray
from photocore.errors import InputError, located
from photocore.images import read_image, to_eight_bit
from photocore.reports import Words

#: Longer side of pictures in a report. [px]
SIDE = 1000
_WORKBOOKS = {".xlsx", ".xlsm", ".ods", ".csv"}


class Timed(Protocol):
    """What knows how long a step took, and where."""

    @property
    def seconds(self) -> float:
        """That it took."""

    @property
    def machine(self) -> str:
        """On which it did."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepTold:
    """A step that made something the report shows.

    Attributes
    ----------
    name : str
    settings : tuple of str
        As a survey file has them.
    defaults : tuple of str
        What held where nothing was said, likewise.
    seconds : float or None
        None where no time is to be told.
    machine : str
    """

    name: str
    settings: tuple[str, ...]
    defaults: tuple[str, ...]
    seconds: float | None
    machine: str

    @classmethod
    def of(cls, name: str, options: Mapping[str, object], timed: Timed | None = None) -> StepTold:
        """Return it from the options of a survey's step."""
        return cls(
            name=name,
            settings=tuple(typed(options, in_file=True)),
            defaults=tuple(typed(defaults_of(name, options), in_file=True)),
            seconds=None if timed is None else timed.seconds,
            machine="" if timed is None else timed.machine,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportTask:
    """What a report of one pair is made from besides its pair file or workbook.

    Attributes
    ----------
    title : str
        Empty: the name of the file.
    language : str
    scale : float, optional
        1:scale that was asked for.
    control, check : Path, optional
        Tables of control points and of independent check points.
    unit : str
        Of their coordinates; empty: as the headings say.
    columns : str, optional
        Which column of theirs is which; by default as the headings say.
    far : Path, optional
        Photo that the tables call the far one.
    relief, ortho : Path, optional
        Relief map and orthophoto.
    view : Path, optional
        Page that shows the relief in three dimensions; the report leads to it.
    project : mapping of str to str
        Client, place, surveyor and the like, by the names of `bifocal.options.PROJECT`.
    steps : tuple of StepTold
        How what the report shows was made.
    lengths : mapping of str to LengthCheck
        Lengths taped on site that check the scale, by their names.
    """

    #: What is given as it is typed.
    PLAIN: ClassVar = ("title", "language", "scale", "unit", "columns")

    title: str = ""
    language: str = "en"
    scale: float | None = None
    control: Path | None = None
    check: Path | None = None
    unit: str = ""
    columns: str | None = None
    far: Path | None = None
    relief: Path | None = None
    ortho: Path | None = None
    view: Path | None = None
    project: Mapping[str, str] = field(default_factory=dict)
    steps: tuple[StepTold, ...] = ()
    lengths: Mapping[str, LengthCheck] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportedPhoto:
    """A photo made small: its pixels, the full size [px], and pixels per pixel of the picture."""

    photo: Photo
    picture: ByteArray
    size: tuple[int, int]
    reduction: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairContent:
    """What is known of a pair, or of a set of photos.

    Attributes
    ----------
    task : ReportTask
    pair : Pair
        Of a set its best.
    of_set : PhotoSet or None
        The set of three photos and more.
    source : Path
        Pair file or workbook.
    setup : mapping
        Diagnostics that `align` left in the pair file; empty without.
    solution : SolvedSurvey or None
        Points measured, and what they were compared with.
    photos : tuple of ReportedPhoto
        Far and near one, or all of a set; empty where there are no files.
    relief : ReliefMap or None
    ortho : (picture, bounds) or None
    ortho_gsd : float
        Pixel of the orthophoto. [m]
    ortho_basis : mapping of str to float
        Parts of it on measured and interpolated relief, on the plane, and seen by neither photo;
        empty where the file does not say.
    """

    task: ReportTask
    pair: Pair
    source: Path
    setup: Diagnostics
    solution: SolvedSurvey | None
    photos: tuple[ReportedPhoto, ...]
    relief: ReliefMap | None
    ortho: tuple[ByteArray, Bounds] | None
    ortho_gsd: float
    ortho_basis: Mapping[str, float] = field(default_factory=dict)
    of_set: PhotoSet | None = None

    @property
    def cameras(self) -> tuple[Photo, ...]:
        """The photos as their file has them: far and near one, or all of a set."""
        return (self.pair.image1, self.pair.image2) if self.of_set is None else self.of_set.photos

    @property
    def orientation(self) -> FloatArray | None:
        """Covariance of all of them."""
        return self.pair.orientation if self.of_set is None else self.of_set.orientation

    @property
    def deviations(self) -> Sequence[Mapping[str, float | None]]:
        """Standard deviations of each camera by the keys of a set's file, where known."""
        if self.of_set is None:
            return deviations_by_photo(self.setup)
        return self.setup.get("standard_deviations") or [{}] * len(self.of_set)

    def names(self, say: Words) -> tuple[str, ...]:
        """Return what the photos are called."""
        return (say("far"), say("near")) if self.of_set is None else self.of_set.names

    @property
    def title(self) -> str:
        """Title of its part of the report."""
        return self.task.title or str(self.pair.extra.get("name") or self.source.name.split(".")[0])

    @property
    def control_ids(self) -> frozenset[str]:
        """Points that the orientation rests on."""
        return frozenset(row["id"] for row in self.setup.get("control", ()) if row.get("used"))

    @property
    def has_check(self) -> bool:
        """Whether the points compared took no part in the orientation."""
        if self.solution is None:
            return False
        compared = np.asarray(np.isfinite(self.solution.check.errors).any(axis=1))
        return not self.control_ids.intersection(compress(self.solution.check.ids, compared))

    def map_errors(self) -> tuple[list[str], FloatArray, FloatArray]:
        """Return map minus known relief at measured pixels of the compared points.

        Returns
        -------
        list of str
            Names of the points.
        ndarray, shape (n,)
            Errors of the map. [m]
        ndarray, shape (n,)
            Standard deviations that the map states there. [m]
        """
        if self.relief is None or self.solution is None:
            return [], np.zeros(0), np.zeros(0)
        reference = self.solution.survey.known
        rows = np.flatnonzero(reference.used & np.isfinite(reference.xyz).all(axis=1))
        pixels = np.rint(self.relief.grid.pixel_of(reference.xyz[rows, :2])).astype(int)
        height, width = self.relief.shape
        inside = ((pixels >= 0) & (pixels < [width, height])).all(axis=1)
        rows, (column, row) = rows[inside], pixels[inside].T
        errors = self.relief.sample(reference.xyz[rows, :2]) - reference.xyz[rows, 2]
        good = np.isfinite(errors) & (self.relief.quality[row, column] == Quality.MEASURED)
        sigma = np.asarray(self.relief.sigma[row, column], dtype=float)
        return [reference.ids[k] for k in rows[good]], errors[good], sigma[good]


def read_content(source: Path, task: ReportTask, *, pictures: bool = True) -> PairContent:
    """Return what a pair file or a solved workbook and the task's files tell.

    Parameters
    ----------
    source : Path
    task : ReportTask
    pictures : bool
        Read the photos, too.

    Raises
    ------
    InputError
        If a file is missing or is not what it should be.
    """
    solution: SolvedSurvey | None = None
    of_set: PhotoSet | None = None
    named: Pair | PhotoSet | None = None
    if source.suffix.lower() in _WORKBOOKS:
        if task.control or task.check:
            raise InputError(remark("report.own_check", of=source))
        solution = solve(source)
        pair = solution.pair
        setup: Any = pair.extra.get("setup")
        if solution.pair_path is not None:
            named = Pair.read(solution.pair_path)
            setup = named.extra.get("setup")
            pair = _with_photos(pair, solution.pair_path)
    else:
        named = pair_or_set(source)
        setup = named.extra.get("setup")
        of_set = named if isinstance(named, PhotoSet) else None
        if of_set is not None and isinstance(setup, dict):
            lists = setup.get("focal_px"), setup.get("standard_deviations")
            if not all(isinstance(values, list) and len(values) == len(of_set) for values in lists):
                setup = None  # that of other photos, or of the project of another program
        pair = named.best_pair() if isinstance(named, PhotoSet) else named
        if task.control or task.check:
            exchanged = task.far is not None and is_exchanged(named, task.far)
            solution = solve_control(
                source, control=task.control, check=task.check, exchanged=exchanged,
                photos=2 if of_set is None else len(of_set), language=task.language, unit=task.unit,
                columns=task.columns,
            )  # fmt: skip
    if named is not None:
        if task.scale:
            check_scale(named.extra, source)
        remarks = check_maps(MadeFrom.of(photos_of(named)), relief=task.relief, ortho=task.ortho)
        pair = replace(pair, remarks=(*pair.remarks, *remarks)) if remarks else pair
    ortho, gsd = (None, 0.0) if task.ortho is None else ortho_thumbnail(task.ortho)
    return PairContent(
        task=task,
        pair=pair,
        source=source,
        setup=cast("Diagnostics", setup if isinstance(setup, dict) else {}),
        solution=solution,
        of_set=of_set,
        photos=_photos(of_set or pair) if pictures else (),
        relief=None if task.relief is None else _relief(task.relief),
        ortho=ortho,
        ortho_gsd=gsd,
        ortho_basis={} if task.ortho is None else _basis(task.ortho),
    )


def _relief(path: Path) -> ReliefMap:
    """Return a relief map; refuse one that knows nothing, or infinite values."""
    relief = ReliefMap.read(path)
    with located(path):
        MapSurface.of_array(relief.r, relief.grid)
    return relief


def _with_photos(pair: Pair, path: Path) -> Pair:
    """Return a workbook's pair with the photo files its pair file names."""
    named = Pair.read(path)
    first = replace(pair.image1, file=named.image1.file)
    second = replace(pair.image2, file=named.image2.file)
    return replace(pair, folder=named.folder, image1=first, image2=second)


def _photos(source: Pair | PhotoSet) -> tuple[ReportedPhoto, ...]:
    """Return all photos made small; none where a file is not named or not there."""
    photos = []
    originals = (source.image1, source.image2) if isinstance(source, Pair) else source.photos
    if not all(photo.file and photo.path.is_file() for photo in originals):
        return ()
    for photo, info in zip(originals, photo_infos(source), strict=True):
        image = to_eight_bit(read_image(info.path))
        height, width = image.shape[:2]
        reduction = max(1.0, max(width, height) / SIDE)
        size = (round(width / reduction), round(height / reduction))
        picture = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        photos.append(
            ReportedPhoto(photo=photo, picture=picture, size=(width, height), reduction=reduction)
        )
    return tuple(photos)


def _basis(path: Path) -> dict[str, float]:
    """Return what parts of an orthophoto rest on; empty where the file does not say."""
    with RasterReader(path) as reader:
        basis: dict[str, float] = json.loads(reader.tags.get("BIFOCAL_BASIS", "{}"))
        return basis


def ortho_thumbnail(path: Path, *, side: int = SIDE) -> tuple[tuple[ByteArray, Bounds], float]:
    """Return an orthophoto made small, empty pixels white, and its pixel. [m]

    Raises
    ------
    InputError
        If the file cannot be read or holds no colours.
    """
    with RasterReader(path) as reader:
        if reader.dtype not in (np.uint8, np.uint16):
            raise InputError(remark("report.no_ortho", of=path, dtype=reader.dtype))
        grid = reader.grid
        step = 1
        while max(grid.width, grid.height) / step > 1.5 * side and step < ROWS:
            step *= 2
        strips = []
        for colours, valid in colour_strips(reader):
            shown = np.where(valid[..., None] > 0, colours, np.uint8(255))
            size = (max(1, shown.shape[1] // step), max(1, shown.shape[0] // step))
            strips.append(np.asarray(cv2.resize(shown, size, interpolation=cv2.INTER_AREA)))
        return (np.concatenate(strips), grid.bounds), grid.gsd
