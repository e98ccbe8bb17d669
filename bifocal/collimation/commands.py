"""Every command of the page: what it changes, told from the survey as it stands.

A command never looks at anything but the survey and its own fields, so that replaying the journal
gives the same survey again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from bifocal.collimation.pasted import pasted_control
from bifocal.collimation.records import (
    CODES,
    Change,
    DrawnLine,
    Known,
    PickedControl,
    PickedPoint,
    Pixel,
    SurveyState,
    TapedLength,
)
from bifocal.collimation.stated_media import INDICES, MEDIA, check_index
from photocore.errors import InputError
from photocore.workbook.words import LANGUAGES

Fields = Mapping[str, Any]
STAGES = ("photos", "orientation", "points", "products")
#: Set-up values asked of the user.
SETUP = (
    "d1", "d2", "delta_d", "c1", "c2", "sigma_d1", "sigma_d2", "sigma_delta_d", "sigma_d", *MEDIA,
)  # fmt: skip
#: No name, layer or photo is longer, no wall larger.
LONGEST_NAME, LARGEST, MOST_POINTS = 80, 1e6, 20_000


def changes_of(state: SurveyState, command: Fields) -> list[Change]:
    """Return what a command changes of the records, and change the rest of the state.

    Raises
    ------
    InputError
        If it is no command, or one of its fields is impossible; nothing is changed then.
    """
    op = command.get("op")
    if op in _RECORDS:
        return _RECORDS[op](state, command)
    if op in _SETTINGS:
        _SETTINGS[op](state, command)
        return []
    raise InputError(f"there is no command {str(op)[:40]!r}.")


def text_of(command: Fields, key: str) -> str:
    """Return a name: not blank, one line."""
    value = command.get(key)
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{key}: give a name.")
    value = " ".join(value.split())
    if len(value) > LONGEST_NAME or not value.isprintable():
        raise InputError(f"{key}: a name of at most {LONGEST_NAME} letters, please.")
    return value


def number_of(command: Fields, key: str) -> float | None:
    """Return a number or None; text with a decimal comma counts."""
    value = command.get(key)
    if isinstance(value, str):
        typed = value.strip().replace(",", ".").replace("\N{MINUS SIGN}", "-")
        try:
            value = float(typed) if typed else None
        except ValueError:
            raise InputError(f"{key}: {typed[:30]!r} is no number.") from None
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key}: expected a number.")
    if not math.isfinite(value) or abs(value) > LARGEST:
        raise InputError(f"{key}: {value:g} is beyond reason.")
    return float(value)


def positive_of(command: Fields, key: str) -> float | None:
    """Return a number above zero or None."""
    value = number_of(command, key)
    if value is not None and not value > 0:
        raise InputError(f"{key}: must be above zero, got {value:g}.")
    return value


def image_of(command: Fields) -> int:
    """Return the number of a photo."""
    image = command.get("image")
    if image not in (1, 2) or isinstance(image, bool):
        raise InputError("image: 1 is the far photo, 2 the near one.")
    return int(image)


def pixel_of(command: Fields) -> Pixel:
    """Return a pick. [px]"""
    column, row = number_of(command, "column"), number_of(command, "row")
    if column is None or row is None:
        raise InputError("column, row: a pick needs both.")
    return column, row


def _known(command: Fields, before: Known | None) -> Known:
    """Return the coordinates a command gives; those it does not name stay as they were."""
    x, y, r = (
        number_of(command, key) if key in command else old
        for key, old in zip(("X", "Y", "r"), before or (None, None, None), strict=True)
    )
    return x, y, r


def _point(state: SurveyState, command: Fields) -> PickedPoint:
    name = text_of(command, "name")
    if name not in state.points:
        raise InputError(f"there is no point {name}.")
    return state.points[name]


def _pick(state: SurveyState, command: Fields) -> list[Change]:
    name = text_of(command, "name") if command.get("name") else state.free_name()
    image, pixel = image_of(command), pixel_of(command)
    before = state.points.get(name)
    if before is None and len(state.points) >= MOST_POINTS:
        raise InputError(f"a survey holds at most {MOST_POINTS} points; begin another.")
    after = (before or PickedPoint(name=name, order=state.next_order())).picked(image, pixel)
    return [Change("points", name, before, after)]


def _unpick(state: SurveyState, command: Fields) -> list[Change]:
    before = _point(state, command)
    after = before.picked(image_of(command), None)
    gone = after.picks == (None, None) and after.reference is None
    return [Change("points", before.name, before, None if gone else after)]


def _rename(state: SurveyState, command: Fields) -> list[Change]:
    before, new = _point(state, command), text_of(command, "new")
    if new == before.name:
        return []
    if new in state.points:
        raise InputError(f"there is a point {new} already; choose another name.")
    lines = [
        Change("lines", line.name, line, replace(line, points=tuple(
            new if name == before.name else name for name in line.points
        )))
        for line in state.lines.values() if before.name in line.points
    ]  # fmt: skip
    return [
        Change("points", before.name, before, None),
        Change("points", new, None, replace(before, name=new)),
        *lines,
    ]


def _type(state: SurveyState, command: Fields) -> list[Change]:
    before, kind = _point(state, command), command.get("type")
    if kind not in CODES:
        raise InputError(f"type: one of {', '.join(CODES)}.")
    if kind == before.type:
        return []
    return [Change("points", before.name, before, replace(before, code=CODES[kind]))]


def _reference(state: SurveyState, command: Fields) -> list[Change]:
    before = _point(state, command)
    known = _known(command, before.reference)
    after = replace(before, reference=None if known == (None, None, None) else known)
    return [Change("points", before.name, before, after)]


def _delete(state: SurveyState, command: Fields) -> list[Change]:
    before = _point(state, command)
    shorter = [
        Change("lines", line.name, line, None if len(rest) < 2 else replace(line, points=rest))
        for line in state.lines.values()
        if (rest := tuple(name for name in line.points if name != before.name)) != line.points
    ]
    return [Change("points", before.name, before, None), *shorter]


def _line_set(state: SurveyState, command: Fields) -> list[Change]:
    name = text_of(command, "name")
    before = state.lines.get(name)
    if before is not None:  # what is not named stays as it was
        kept = {"layer": before.layer, "points": list(before.points), "closed": before.closed}
        command = {**kept, **command}
    layer, points = text_of(command, "layer"), command.get("points")
    if not isinstance(points, list) or len(points) < 2:
        raise InputError("points: a line joins two points or more.")
    unknown = [str(point) for point in points if point not in state.points]
    if unknown:
        raise InputError(f"points: there is no point {unknown[0][:40]}.")
    line = DrawnLine(
        name=name, layer=layer, points=tuple(points), closed=command.get("closed") is True
    )
    return [Change("lines", name, before, line)]


def _line_delete(state: SurveyState, command: Fields) -> list[Change]:
    name = text_of(command, "name")
    if name not in state.lines:
        raise InputError(f"there is no line {name}.")
    return [Change("lines", name, state.lines[name], None)]


def _control(state: SurveyState, command: Fields) -> PickedControl:
    name = text_of(command, "name")
    if name not in state.control:
        raise InputError(f"there is no control point {name}.")
    return state.control[name]


def _control_name(state: SurveyState, command: Fields) -> str:
    return text_of(command, "name") if command.get("name") else state.free_name("C")


def _control_set(state: SurveyState, command: Fields) -> list[Change]:
    name = _control_name(state, command)
    before = state.control.get(name)
    known = _known(command, before.known if before else None)
    after = replace(
        before or PickedControl(name=name, order=state.next_order()), known=known
    )  # fmt: skip
    return [Change("control", name, before, after)]


def _control_pick(state: SurveyState, command: Fields) -> list[Change]:
    name, image = _control_name(state, command), image_of(command)
    pixel = None if command.get("column") is None else pixel_of(command)
    before = state.control.get(name)
    if before is None and pixel is None:
        raise InputError(f"there is no control point {name}.")
    after = (before or PickedControl(name=name, order=state.next_order())).picked(image, pixel)
    return [Change("control", name, before, after)]


def _control_rename(state: SurveyState, command: Fields) -> list[Change]:
    before, new = _control(state, command), text_of(command, "new")
    if new == before.name:
        return []
    if new in state.control:
        raise InputError(f"there is a control point {new} already; choose another name.")
    changes = [
        Change("control", before.name, before, None),
        Change("control", new, None, replace(before, name=new)),
    ]
    for key, tape in state.tapes.items():
        if before.name in (tape.start, tape.end):
            ends = [new if end == before.name else end for end in (tape.start, tape.end)]
            moved = replace(tape, start=ends[0], end=ends[1])
            changes += [Change("tapes", key, tape, None), _taped(state, moved)]
    return changes


def _control_delete(state: SurveyState, command: Fields) -> list[Change]:
    before = _control(state, command)
    tapes = [
        Change("tapes", key, tape, None)
        for key, tape in state.tapes.items()
        if before.name in (tape.start, tape.end)
    ]
    return [Change("control", before.name, before, None), *tapes]


def _control_paste(state: SurveyState, command: Fields) -> list[Change]:
    text = command.get("text")
    if not isinstance(text, str):
        raise InputError("text: paste a table of control points.")
    changes = []
    for name, known, picks in pasted_control(text):
        before = state.control.get(name)
        start = before or PickedControl(name=name, order=state.next_order())
        both = (picks[0] or start.picks[0], picks[1] or start.picks[1])
        changes.append(
            Change("control", name, before, replace(start, known=known, picks=both))
        )  # fmt: skip
    return changes


def _taped(state: SurveyState, tape: TapedLength) -> Change:
    key = "|".join(sorted((tape.start, tape.end)))
    return Change("tapes", key, state.tapes.get(key), tape)


def _tape_set(state: SurveyState, command: Fields) -> list[Change]:
    start, end = text_of(command, "from"), text_of(command, "to")
    length = positive_of(command, "length")
    if start == end:
        raise InputError("from, to: a tape runs between two points.")
    if length is None:
        raise InputError("length: how long is it, in metres?")
    missing = [name for name in (start, end) if name not in state.control]
    if missing:
        raise InputError(f"there is no control point {missing[0]}; pick it first.")
    sigma = positive_of(command, "sigma")
    return [_taped(state, TapedLength(start=start, end=end, length=length, sigma=sigma))]


def _tape_delete(state: SurveyState, command: Fields) -> list[Change]:
    key = "|".join(sorted((text_of(command, "from"), text_of(command, "to"))))
    if key not in state.tapes:
        raise InputError("there is no tape between these points.")
    return [Change("tapes", key, state.tapes[key], None)]


def _lens_set(state: SurveyState, command: Fields) -> None:
    image = image_of(command)
    values = {key: positive_of(command, key) for key in ("focal_mm", "sensor_width_mm")
              if key in command}  # fmt: skip
    state.lenses[image] = state.lenses.get(image, {}) | values


def _setup_set(state: SurveyState, command: Fields) -> None:
    given = {key: positive_of(command, key) for key in command if key in SETUP}
    if not given:
        raise InputError(f"nothing to set; known are {', '.join(SETUP)}.")
    for key in INDICES:
        check_index(key, given.get(key))
    state.setup |= given


def _exchange(state: SurveyState, command: Fields) -> None:
    """Exchange far and near photo; what was picked goes with them, and no orientation stays.

    A lens goes with its photo too, unless the longer one was typed for the far photo.
    """
    state.points = {n: _turned(p) for n, p in state.points.items()}
    state.control = {n: _turned(p) for n, p in state.control.items()}
    if not (lens_ratio(state.lenses.get(1, {}), state.lenses.get(2, {})) or 0.0) > 1.0:
        state.lenses = {3 - image: lens for image, lens in state.lenses.items()}
    state.ordered = command.get("found") is not True
    state.forget_orientation()
    state.done, state.undone = (
        [[Change(c.kind, c.key, _turned(c.before), _turned(c.after)) for c in x] for x in history]
        for history in (state.done, state.undone)
    )
    if state.stage in ("points", "products"):
        state.stage = "orientation"


def _turned(record: Any) -> Any:
    """Return a record with the picks of both photos exchanged, where it has some."""
    return replace(record, picks=record.picks[::-1]) if hasattr(record, "picks") else record


def lens_ratio(*photos: Fields) -> float | None:
    """Return how much longer the lens of the first photo is; None where that is not known."""
    focals: list[Any] = [photo.get("focal_mm") for photo in photos]
    sensors: list[Any] = [photo.get("sensor_width_mm") for photo in photos]
    if None in focals:
        return None
    return float(focals[0] / focals[1] * (sensors[1] / sensors[0] if all(sensors) else 1.0))


def _points_add(state: SurveyState, command: Fields) -> list[Change]:
    """Add points that a job found; names that are taken get another number."""
    found = command.get("points")
    if not isinstance(found, list) or len(found) + len(state.points) > MOST_POINTS:
        raise InputError(f"points: expected a list; a survey holds at most {MOST_POINTS}.")
    changes, taken = [], set(state.points)
    for entry in found:
        name = text_of(entry, "name")
        while name in taken:
            name = f"{name}b"
        taken.add(name)
        first, second = (pixel_of({"column": c, "row": r}) for c, r in entry["picks"])
        point = PickedPoint(
            name=name, order=state.next_order(), picks=(first, second),
            code=str(entry.get("code", ""))[:LONGEST_NAME], note=str(entry.get("note", ""))[:200],
        )  # fmt: skip
        changes.append(Change("points", name, None, point))
    return changes


def _stage_set(state: SurveyState, command: Fields) -> None:
    if command.get("stage") not in STAGES:
        raise InputError(f"stage: one of {', '.join(STAGES)}.")
    state.stage = command["stage"]


def _language_set(state: SurveyState, command: Fields) -> None:
    if command.get("language") not in LANGUAGES:
        raise InputError(f"language: one of {', '.join(LANGUAGES)}.")
    state.language = command["language"]


_RECORDS: dict[Any, Callable[[SurveyState, Fields], list[Change]]] = {
    "point.pick": _pick,
    "point.unpick": _unpick,
    "point.rename": _rename,
    "point.type": _type,
    "point.reference": _reference,
    "point.delete": _delete,
    "points.add": _points_add,
    "line.set": _line_set,
    "line.delete": _line_delete,
    "control.set": _control_set,
    "control.pick": _control_pick,
    "control.rename": _control_rename,
    "control.delete": _control_delete,
    "control.paste": _control_paste,
    "tape.set": _tape_set,
    "tape.delete": _tape_delete,
}
_SETTINGS: dict[Any, Callable[[SurveyState, Fields], None]] = {
    "photo.set": _lens_set,
    "setup.set": _setup_set,
    "photos.exchange": _exchange,
    "stage.set": _stage_set,
    "language.set": _language_set,
}
