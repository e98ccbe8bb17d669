"""What the job of each kind is told, and what it answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypedDict

from bifocal.model import LengthCheck
from bifocal.orientation import AlignOptions
from photocore.arrays import FloatArray


@dataclass(frozen=True, kw_only=True)
class JobTask:
    """What a job is told; its class is its kind.

    Attributes
    ----------
    quiet : bool
        Whether the program began it by itself.
    causes : mapping of str to str
        Digests of what its product is made of, as they were when it began.
    """

    quiet: bool = False
    causes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class AlignTask(JobTask):
    """Orient two photos; ``free_scale``: one measure gives the scale, whenever it is typed."""

    far: Path
    near: Path
    out: Path
    options: AlignOptions
    free_scale: bool


@dataclass(frozen=True, kw_only=True)
class RectifyTask(JobTask):
    """Bring one photo alone to scale by a rectangle of the wall, with drawings.

    Attributes
    ----------
    corners : ndarray, shape (4, 2)
        Of the rectangle. [px]
    sides : tuple of float
        Its width and height. [m]
    settings : mapping
        Options by the names of the command's.
    """

    photo: Path
    out: Path
    folder: Path
    overwrite: bool
    corners: FloatArray
    sides: tuple[float, float]
    settings: Mapping[str, object]


@dataclass(frozen=True, kw_only=True)
class PairTask(JobTask):
    """What is done with a pair."""

    pair: Path


class TargetsTask(PairTask):
    """Find the targets that both photos show."""


@dataclass(frozen=True, kw_only=True)
class MatchTask(PairTask):
    """Find points that both photos show."""

    count: int
    features: bool


@dataclass(frozen=True, kw_only=True)
class SuggestTask(PairTask):
    """Find the faces that the program would draw."""

    relief: Path


@dataclass(frozen=True, kw_only=True)
class JoinTask(PairTask):
    """Adjust a pair and further photos of its wall together."""

    photos: Sequence[Path]
    out: Path
    options: AlignOptions


class ReliefSettings(TypedDict, total=False):
    """Options of the relief, by the command's names."""

    gsd: float
    bounds: tuple[float, float, float, float]
    quality: str


class ImageSettings(TypedDict, total=False):
    """Options of the orthophoto, by the command's names."""

    gsd: float
    bounds: tuple[float, float, float, float]
    scale: float
    image: str


class SheetSettings(TypedDict, total=False):
    """Options of the drawing, by the command's names."""

    scale: float
    dpi: float
    paper: str
    sections: Sequence[str]


@dataclass(frozen=True, kw_only=True)
class ProductTask(PairTask):
    """What is made of the pair, or of the set that holds it and further photos."""

    photo_set: Path | None
    out: Path
    overwrite: bool


@dataclass(frozen=True, kw_only=True)
class MapTask(ProductTask):
    """Measure the relief."""

    settings: ReliefSettings


@dataclass(frozen=True, kw_only=True)
class ImageTask(ProductTask):
    """Make the orthophoto, moved by a relief; ``dpi``: of the drawing that it is for."""

    settings: ImageSettings
    relief: Path | None
    dpi: float | None


@dataclass(frozen=True, kw_only=True)
class SheetTask(ImageTask):
    """Make drawings, report and 3-D view.

    Attributes
    ----------
    relief_first, ortho_first : MapTask, ImageTask or None
        What is lacking or out of date is made before them.
    title : str
        Empty: that of the pair.
    stem : str
        How the names of the documents begin.
    ortho : Path
    lengths : mapping of str to LengthCheck
        Lengths that check the scale.
    sheet : SheetSettings
    language : str
    mark : Path or None
        The workbook of the points.
    """

    relief_first: MapTask | None
    ortho_first: ImageTask | None
    title: str
    stem: str
    ortho: Path
    lengths: Mapping[str, LengthCheck]
    sheet: SheetSettings
    language: str
    mark: Path | None


class Joined(TypedDict):
    """What became of photos that joined a pair."""

    remarks: list[str]
    lenses: list[str]


class Rectified(TypedDict):
    """What became of one photo alone; ``misfits`` from each corner to where it fits. [px]"""

    words: list[str]
    files: Sequence[str]
    misfits: list[list[float]]


class FoundPoint(TypedDict):
    """A point that both photos show."""

    name: str
    picks: list[list[float]]
    code: str
    note: str


class FoundPoints(TypedDict):
    """Points that both photos show."""

    points: list[FoundPoint]


class FoundShapes(TypedDict):
    """Faces that the program would draw."""

    shapes: list[dict[str, object]]


class ProductMade(TypedDict):
    """What is to be said of a product."""

    remarks: Sequence[str]


class SheetsMade(ProductMade):
    """Files of drawings and documents, and those that were made before them, by kind."""

    files: list[str]
    made: dict[str, list[str]]
