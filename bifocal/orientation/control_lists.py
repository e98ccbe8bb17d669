"""Lists of control points: a row a photo made one a point, and E, N, H made a wall's X, Y, r."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath

import numpy as np

from bifocal.model import FARTHEST_WALL, WorldFrame, frame_of, lies_how
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import CellError, InputError, WorkbookError
from photocore.names import called, nearest
from photocore.tables import Table
from photocore.tables.advice import advice
from photocore.tables.axes import HEIGHT
from photocore.tables.heading_words import bare

#: What heights and relief are called, and what has a height or numbers that are none of a point.
_THIRD = tuple(map(bare, (*HEIGHT, "relief", "rilievo", "z")))
_OF_TOOLS = re.compile(
    r"antenn|prism|pole|rod|instr|refle[ck]|target|mira|canna|sigma|std|rms|err|acc|\bh[irt]\b|time"
)
#: Pixels that programs write for "not seen", where several points have them.
_UNSEEN = ((0.0, 0.0), (-1.0, -1.0))


class NoFrontError(InputError):
    """E, N, H of an upright wall of which no photo tells the front."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ListedPoints:
    """Points of a table, and where each is seen.

    Attributes
    ----------
    rows : list of int
        The row of the table that stands for each point.
    picks : list of ndarray, shape (n, 2)
        In each photo, NaN where not seen. [px]
    remarks : tuple of str
    """

    rows: list[int]
    picks: list[FloatArray]
    remarks: tuple[str, ...] = ()


def is_long(table: Table, keys: Sequence[str], photos: Sequence[str]) -> bool:
    """Whether a table has a row for each photo that shows a point, not one for each point."""
    if "photo" not in table.present or not photos:
        return False
    if len(photos) == 1:
        fits = any(called(name, photos) for name in table.texts("photo") if name)
        return set(keys) <= table.present and (fits or bool(table.repeated("id")))
    return {"col", "row"} <= table.present and not set(keys) & table.present


def of_rows(
    table: Table,
    keys: Sequence[str],
    photos: Sequence[str | Sequence[str]],
    coordinates: FloatArray,
    *,
    all_known: bool = False,
) -> ListedPoints:
    """Return the points of a table with a row a photo; ``coordinates`` are filled in by name.

    Rows of other photos are left out and named; with ``all_known`` they are errors.

    Raises
    ------
    InputError, WorkbookError
        If no row is of these photos, or rows contradict each other.
    """
    column, row = (table.numbers(key) for key in keys)
    titles = [one if isinstance(one, str) else one[0] for one in photos]
    short = [PurePath(title).name for title in titles]
    titles = short if len(set(short)) == len(short) else titles
    picks: dict[tuple[str, int], int] = {}
    errors: list[CellError] = []
    places = table.first_rows("id", coordinates, errors)
    strange: list[str] = []
    for k, (name, photo) in enumerate(zip(table.texts("id"), table.texts("photo"), strict=True)):
        if not name:
            errors.append(table.error(k, "id", "is blank; every row needs the point's name."))
            continue
        shown = called(photo, photos) if photo else []
        if len(shown) > 1:
            message = f'"{photo}" may be {" or ".join(titles[n] for n in shown)}.'
            errors.append(table.error(k, "photo", message))
        elif not shown and all_known:
            message = remark("survey.strange_photo", known=", ".join(titles))
            errors.append(table.error(k, "photo", message))
        elif not shown:
            strange += [photo] if photo else []
        elif picks.setdefault((name, shown[0]), k) != k:
            before = table.cell(picks[name, shown[0]], "id")
            message = f'"{name}" is picked in this photo in {before} already.'
            errors.append(table.error(k, "photo", message))
    if errors:
        raise WorkbookError(errors)
    names = list(dict.fromkeys(strange))
    if not picks:
        near = next((n for title in titles if (n := nearest(title, names))), "-")
        about = {"photos": ", ".join(titles), "listed": ", ".join(names[:5]), "near": near}
        raise InputError(remark("control.no_such_photo", of=table.file, **about))
    order = [table.texts("id")[k] for k in places]
    pixels = [np.full((len(order), 2), np.nan) for _ in photos]
    for (name, photo_number), k in picks.items():
        pixels[photo_number][order.index(name)] = column[k], row[k]
    shown_names = ", ".join(names[:5])
    notes = (remark("control.other_photos", count=len(names), names=shown_names),) if names else ()
    return ListedPoints(rows=places, picks=pixels, remarks=notes)


def without_unseen(
    picks: Sequence[FloatArray], ids: Sequence[str]
) -> tuple[list[FloatArray], list[str]]:
    """Return picks without those that stand for "not seen", and what is said of them."""
    notes: list[str] = []
    cleaned: list[FloatArray] = []
    for number, pixels in enumerate(picks, start=1):
        clean = pixels.copy()
        for place in _UNSEEN:
            rows = np.flatnonzero((pixels == place).all(axis=1))
            if len(rows) > 1:
                clean[rows] = np.nan
                names = ", ".join(ids[row] for row in rows[:10])
                place_words = f"{place[0]:g}, {place[1]:g}"
                notes.append(remark("control.unseen", photo=number, names=names, place=place_words))
        cleaned.append(clean)
    return cleaned, notes


def in_plane_frame(
    table: Table, xyz: FloatArray, heights: FloatArray, picks: Sequence[FloatArray],
    frame: WorldFrame | None,
) -> tuple[FloatArray, WorldFrame | None, list[str]]:  # fmt: skip
    """Return X, Y, r, and the frame in which they are E, N, H where the table holds these.

    Parameters
    ----------
    table : Table
        With the headings.
    xyz, heights : ndarray, shape (n, 3), (n,)
        X, Y, r as the headings say, and the column H. [m]
    picks : sequence of ndarray, shape (n, 2)
        [px]
    frame : WorldFrame or None
        That of a pair; by default that of these points.

    Raises
    ------
    InputError
        If E, N, H lie on a line or slope, or no photo tells the wall's front.
    """
    has_height = bool(np.isfinite(heights).any()) and not np.isfinite(xyz[:, 2]).any()
    is_space = bare(table.headings.get("r", "")).startswith("z") and not has_height
    if not (has_height or is_space):
        is_far = np.nanmax(np.abs(xyz[:, :2]), initial=0.0) > FARTHEST_WALL
        return xyz, frame, strange_third(table, in_plan=bool(is_far))
    world = np.column_stack([xyz[:, :2], heights if has_height else xyz[:, 2]])
    notes: list[str] = []
    plain = [bare(table.headings.get(key, "")) for key in "XY"] == ["x", "y"]
    is_geodetic = plain and table.columns["Y"] < table.columns["X"]
    if is_geodetic:
        world = world[:, [1, 0, 2]]
    if is_geodetic or (has_height and plain):
        notes.append(remark(f"control.{'geodetic' if is_geodetic else 'x_is_east'}"))
    whole = np.isfinite(world).all(axis=1)
    if frame is None:
        lies = lies_how(world[whole]) if whole.sum() > 2 else "line"
        if is_space and lies != "upright":
            return xyz, None, []
        if lies in ("line", "sloping"):
            raise InputError(remark(f"control.{lies}", of=table.file))
        frame = frame_of(world[whole], [pixels[whole] for pixels in picks])
        if frame is None:
            raise NoFrontError(remark("control.no_front", of=table.file))
        notes.append(_described(frame))
    plane = np.full_like(xyz, np.nan)
    plane[whole] = frame.to_plane(world[whole])
    return plane, frame, notes


def lacks_axis(table: Table, path: Path | str, missing: str, option: str = "--columns") -> str:
    """Return the complaint about a list without coordinates in plan, and what is not understood."""
    text = remark("control.lone_axis", path=path, missing=missing)
    names = ", ".join(f'"{name}"' for name in table.strange) or "-"
    how = advice("rename", option, first=missing[0])
    return f"{text} {remark('control.not_understood', names=names)} {how}"


def strange_third(
    table: Table,
    east: str = "X",
    thirds: Sequence[str] = ("r", "H"),
    option: str = "--columns",
    *,
    in_plan: bool = False,
) -> list[str]:
    """Return a remark on a heading that is nearly one of heights or relief, where both are absent.

    Beside E and N, or X and Y `in_plan`, it is refused: without it all points would lie on one
    line or plane; whatever numbers stand beside these are named.
    """
    if not table.present.isdisjoint(thirds):
        return []
    in_plan |= not bare(table.headings.get(east, "x")).startswith("x")
    strange = [text for text in table.strange if not _OF_TOOLS.search(text.casefold())]
    for heading in strange:
        parts = [bare(heading), *re.split(r"[\W\d_]+", heading.casefold())]
        if near := next((near for part in parts if (near := _near_third(part))), ""):
            doubt = remark("control.strange_third", heading=heading, near=near)
            words = f"{doubt} {advice('rename', option, first=thirds[-1])}"
            if in_plan:
                raise InputError(f"{table.file}: {words}")
            return [words]
    return [remark("control.beside_plan", names=", ".join(strange))] if in_plan and strange else []


def _near_third(word: str) -> str:
    """Return the word of heights or relief that a word is, or nearly is."""
    return word if word in _THIRD else nearest(word, [one for one in _THIRD if len(one) > 2])


def _described(frame: WorldFrame) -> str:
    """Return what is said of a frame that was found."""
    if not frame.is_upright:
        return remark("control.level", height=frame.height)
    about = {"east": frame.east, "north": frame.north, "azimuth": np.rad2deg(frame.azimuth)}
    return remark("control.upright", **about)
