"""What a survey on the page consists of: frozen records, and changes that can be taken back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any, cast

from bifocal.model import WorldFrame
from bifocal.survey import DOUBT_CODES, PLANE_CODES

#: A pick: column and row in the photo as taken. [px]
Pixel = tuple[float, float]
#: Picks in the far and the near photo; None where there is none.
Picks = tuple[Pixel | None, Pixel | None]
#: X, Y, r as measured otherwise; None where unknown. [m]
Known = tuple[float | None, float | None, float | None]

#: Types of points and the code that stands for them in the workbook's column `code`.
CODES = {"plain": "", "wall": "PLANE", "check": "CHECK", "control": "CONTROL"}


@dataclass(frozen=True, slots=True, kw_only=True)
class PickedPoint:
    """A point of the survey.

    Attributes
    ----------
    name : str
    order : int
        Place in the list; stays when the point is renamed.
    picks : Picks
    code, note : str
        As in the workbook.
    use : bool
        False for points that are listed but take no part.
    reference : Known or None
        What was measured otherwise, to check against. [m]
    """

    name: str
    order: int
    picks: Picks = (None, None)
    code: str = ""
    note: str = ""
    use: bool = True
    reference: Known | None = None

    @property
    def type(self) -> str:
        """One of `CODES`, or doubtful; other codes of the user's count as plain."""
        code = self.code.strip().upper()
        if code.startswith(DOUBT_CODES):
            return "doubtful"
        if code in PLANE_CODES:
            return "wall"
        return next((name for name, word in CODES.items() if word and word == code), "plain")

    @property
    def is_complete(self) -> bool:
        """Whether both photos are picked."""
        return None not in self.picks

    def picked(self, image: int, pixel: Pixel | None) -> PickedPoint:
        """Return the point with a pick of photo 1 or 2 set or taken away."""
        return replace(self, picks=with_pick(self.picks, image, pixel))

    def doubted(self, image: int, *, doubtful: bool) -> PickedPoint:
        """Return the point with the pick of a photo accepted in doubt, or made by hand."""
        mark = f"{DOUBT_CODES[0]} {image}"
        if doubtful:
            return replace(self, code=mark)
        other = self.type != "doubtful" or self.code == f"{DOUBT_CODES[0]} {3 - image}"
        return self if other else replace(self, code="")


@dataclass(frozen=True, slots=True, kw_only=True)
class PickedControl:
    """A control point of the orientation: where it is on the wall, and in the photos."""

    name: str
    order: int
    known: Known = (None, None, None)
    picks: Picks = (None, None)
    use: bool = True

    def picked(self, image: int, pixel: Pixel | None) -> PickedControl:
        """Return the point with a pick of photo 1 or 2 set or taken away."""
        return replace(self, picks=with_pick(self.picks, image, pixel))


@dataclass(frozen=True, slots=True, kw_only=True)
class TapedLength:
    """A distance taped between two control points. [m]"""

    start: str
    end: str
    length: float
    sigma: float | None = None


#: Name of the drawn length that gives the scale; all others check it.
GIVES_SCALE = "length"


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleLength:
    """A length drawn on the wall in one photo: gives a pair its scale, or checks it. [px, m]"""

    image: int
    ends: tuple[Pixel, Pixel]
    length: float
    sigma: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WallSpot:
    """A spot of the far photo on the face that is the wall. [px]"""

    pixel: Pixel


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnLine:
    """A polyline through points, on a layer of the drawing."""

    name: str
    layer: str
    points: tuple[str, ...]
    closed: bool = False


#: A corner of a shape: column and row in photo 1 [px], relief there [m].
Corner = tuple[float, float, float]
#: Shapes that relief and orthophoto obey, and outlines that are measured and drawn.
SHAPES = ("face", "break", "occluder", "outline")


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnShape:
    """A polygon or line drawn on the wall: one of `SHAPES`; outlines lie on a layer."""

    name: str
    kind: str
    corners: tuple[Corner, ...]
    layer: str = ""


#: An orientation that was accepted: its pair file, and what was reported of it.
Accepted = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pasted:
    """How control points that were pasted were read.

    Attributes
    ----------
    frame : WorldFrame or None
        Where X, Y, r lie, if they were made of E, N, H.
    remarks : tuple of str
    """

    frame: WorldFrame | None
    remarks: tuple[str, ...]


Record = (
    PickedPoint
    | PickedControl
    | TapedLength
    | DrawnLine
    | DrawnShape
    | ScaleLength
    | WallSpot
    | Accepted
    | Pasted
)


@dataclass(frozen=True, slots=True)
class Change:
    """One record that came, went or changed; None where there is none."""

    kind: str
    key: str
    before: Record | None
    after: Record | None

    @property
    def reversed(self) -> Change:
        """The change that takes this one back."""
        return Change(self.kind, self.key, self.after, self.before)


@dataclass(slots=True)
class SurveyState:
    """The survey as it stands after a number of commands.

    Attributes
    ----------
    points, control, tapes, lines, shapes : dict
        Records by name; tapes by ``from|to``.
    scale, wall : dict
        The length that gives the scale, as ``length``; the spot that names the wall, as ``spot``.
    orientation : dict
        The orientation that was accepted on the page, as ``pair``.
    pasted : dict
        How the control points that were pasted last were read, as ``control``.
    setup : dict of str to float or None
        Distances and principal distances asked of the user. [m, mm]
    lenses : dict of int to dict
        Focal length and sensor width of each photo, where typed. [mm]
    stage, language : str
        Where the user is, and in which language.
    ordered : bool
        Whether the user exchanged the photos himself.
    revision : int
        Number of the last command.
    undone, done : list of lists of Change
        What redo and undo take up.
    """

    points: dict[str, PickedPoint] = field(default_factory=dict)
    control: dict[str, PickedControl] = field(default_factory=dict)
    tapes: dict[str, TapedLength] = field(default_factory=dict)
    lines: dict[str, DrawnLine] = field(default_factory=dict)
    shapes: dict[str, DrawnShape] = field(default_factory=dict)
    scale: dict[str, ScaleLength] = field(default_factory=dict)
    wall: dict[str, WallSpot] = field(default_factory=dict)
    orientation: dict[str, Accepted] = field(default_factory=dict)
    pasted: dict[str, Pasted] = field(default_factory=dict)
    setup: dict[str, float | None] = field(default_factory=dict)
    lenses: dict[int, dict[str, float | None]] = field(default_factory=dict)
    stage: str = ""
    language: str = ""
    ordered: bool = False
    revision: int = 0
    count: int = 0
    done: list[list[Change]] = field(default_factory=list)
    undone: list[list[Change]] = field(default_factory=list)

    def apply(self, changes: Iterable[Change]) -> None:
        """Put changes into effect."""
        for change in changes:
            if change.kind == "settings":
                for name, value in cast("dict[str, object]", change.after).items():
                    setattr(self, name, value)
                continue
            records: dict[str, object] = getattr(self, change.kind)
            if change.after is None:
                records.pop(change.key, None)
            else:
                records[change.key] = change.after

    def forget_orientation(self) -> None:
        """Let go of an orientation that was accepted; nothing can be taken back to it."""
        self.orientation.pop("pair", None)
        self.done, self.undone = (
            [changes for changes in history if changes[0].kind != "orientation"]
            for history in (self.done, self.undone)
        )

    def next_order(self) -> int:
        """Return a place in the list after all given so far."""
        self.count += 1
        return self.count

    def free_name(self, prefix: str = "P") -> str:
        """Return the next unused name of points and control points."""
        names = self.points.keys() | self.control.keys()
        number = len(self.points if prefix == "P" else self.control) + 1
        while f"{prefix}{number:02d}" in names:
            number += 1
        return f"{prefix}{number:02d}"

    def sorted_points(self) -> list[PickedPoint]:
        """Return the points in the order in which they came."""
        return sorted(self.points.values(), key=lambda point: point.order)

    def sorted_control(self) -> list[PickedControl]:
        """Return the control points in the order in which they came."""
        return sorted(self.control.values(), key=lambda point: point.order)


def with_pick(picks: Picks, image: int, pixel: Pixel | None) -> Picks:
    """Return both picks with that of photo 1 or 2 replaced."""
    return (pixel, picks[1]) if image == 1 else (picks[0], pixel)
