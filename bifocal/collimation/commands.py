"""Every command of the page: what it changes, told from the survey as it stands.

A command never looks at anything but the survey and its own fields, so that replaying the journal
gives the same survey again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from bifocal.collimation.exchange import exchange_step, turned_picks
from bifocal.collimation.fields import (
    LONGEST_NAME,
    SETUP,
    FieldError,
    Fields,
    pixel_of,
    text_of,
    tupled,
)
from bifocal.collimation.pasted import pasted_control
from bifocal.collimation.records import (
    CODES,
    GIVES_SCALE,
    Change,
    DrawnLine,
    DrawnShape,
    Known,
    PickedControl,
    PickedPoint,
    ScaleLength,
    SurveyState,
    TapedLength,
    WallSpot,
)
from bifocal.remarks import remark
from photocore.errors import InputError

#: A larger survey is another one.
MOST_POINTS = 20_000
#: So many shapes, of so many corners, a person draws.
MOST_SHAPES, MOST_CORNERS = 2_000, 500


def changes_of(state: SurveyState, command: Fields) -> list[Change]:
    """Return what a command changes of the records, and change the rest of the state.

    Parameters
    ----------
    state : SurveyState
    command : Fields
        As `fields_of` returns it.

    Raises
    ------
    InputError
        If it is impossible; nothing is changed then.
    """
    op = command["op"]
    if op == "photos.exchange" and command.get("step"):
        return exchange_step(state, command, _exchanged_lenses(state))
    if op in _SETTINGS:
        _SETTINGS[op](state, command)
        return []
    return _RECORDS[op](state, command)


def _known(command: Fields, before: Known | None) -> Known:
    """Return the coordinates a command gives; those it does not name stay as they were."""
    x, y, r = (
        command.get(key, old)
        for key, old in zip(("X", "Y", "r"), before or (None, None, None), strict=True)
    )
    return x, y, r


def _named(kind: str, state: SurveyState, command: Fields) -> Any:
    """Return the point, line or control point that a command names."""
    named = getattr(state, kind).get(command["name"])
    if named is None:
        raise InputError(remark(f"page.no_{kind.removesuffix('s')}", name=command["name"]))
    return named


def _renamed(kind: str, state: SurveyState, command: Fields) -> tuple[Any, list[Change]]:
    """Return what a command gives another name, and the changes; none where it has that name."""
    before, new = _named(kind, state, command), command["new"]
    if new == before.name:
        return before, []
    if new in getattr(state, kind):
        raise InputError(remark(f"page.taken_{kind.removesuffix('s')}", name=new))
    after = replace(before, name=new)
    return before, [Change(kind, before.name, before, None), Change(kind, new, None, after)]


def _pick(state: SurveyState, command: Fields) -> list[Change]:
    name = command.get("name") or state.free_name()
    image, pixel = command["image"], pixel_of(command)
    before = state.points.get(name)
    if before is None and len(state.points) >= MOST_POINTS:
        raise InputError(remark("page.most_points", most=MOST_POINTS))
    after = (before or PickedPoint(name=name, order=state.next_order())).picked(image, pixel)
    if "doubtful" in command:  # a pick that is only moved stays what it is
        after = after.doubted(image, doubtful=command["doubtful"])
    return [Change("points", name, before, after)]


def _unpick(state: SurveyState, command: Fields) -> list[Change]:
    before = _named("points", state, command)
    after = before.picked(command["image"], None).doubted(command["image"], doubtful=False)
    gone = after.picks == (None, None) and after.reference is None
    return [Change("points", before.name, before, None if gone else after)]


def _rename(state: SurveyState, command: Fields) -> list[Change]:
    before, changes = _renamed("points", state, command)
    for line in state.lines.values() if changes else ():
        names = tuple(command["new"] if name == before.name else name for name in line.points)
        if names != line.points:
            changes.append(Change("lines", line.name, line, replace(line, points=names)))
    return changes


def _type(state: SurveyState, command: Fields) -> list[Change]:
    before, kind = _named("points", state, command), command["type"]
    if kind == before.type:
        return []
    if before.type == "doubtful" and kind != "plain":
        raise InputError(remark("page.in_doubt", name=before.name))
    return [Change("points", before.name, before, replace(before, code=CODES[kind]))]


def _reference(state: SurveyState, command: Fields) -> list[Change]:
    before = _named("points", state, command)
    coordinates = _known(command, before.reference)
    after = replace(before, reference=None if coordinates == (None, None, None) else coordinates)
    return [Change("points", before.name, before, after)]


def _delete(state: SurveyState, command: Fields) -> list[Change]:
    before = _named("points", state, command)
    shorter = [
        Change("lines", line.name, line, None if len(rest) < 2 else replace(line, points=rest))
        for line in state.lines.values()
        if (rest := tuple(name for name in line.points if name != before.name)) != line.points
    ]
    return [Change("points", before.name, before, None), *shorter]


def _line_set(state: SurveyState, command: Fields) -> list[Change]:
    name = command["name"]
    before = state.lines.get(name)
    if before is not None:  # what is not named stays as it was
        kept = {"layer": before.layer, "points": list(before.points), "closed": before.closed}
        command = {**kept, **command}
    command = {"layer": "", "points": [], "closed": False, **command}
    layer, points = text_of(command, "layer"), command["points"]
    if len(points) < 2:
        raise FieldError(remark("page.line_of_two"))
    unknown = [point for point in points if point not in state.points]
    if unknown:
        raise InputError(f"points: there is no point {unknown[0][:40]}.")
    line = DrawnLine(name=name, layer=layer, points=tuple(points), closed=command["closed"])
    return [Change("lines", name, before, line)]


def _line_delete(state: SurveyState, command: Fields) -> list[Change]:
    line = _named("lines", state, command)
    return [Change("lines", line.name, line, None)]


def _shape_set(state: SurveyState, command: Fields) -> list[Change]:
    kind, number = command["kind"], len(state.shapes) + 1
    while (free := f"{kind[0].upper()}{number}") in state.shapes:
        number += 1
    name = command.get("name") or free
    least = 2 if kind == "break" else 3
    if not least <= len(command["corners"]) <= MOST_CORNERS:
        raise FieldError(remark("page.shape_corners", least=least))
    before = state.shapes.get(name)
    if before is None and len(state.shapes) >= MOST_SHAPES:
        raise InputError(remark("page.most_points", most=MOST_SHAPES))
    layer = command.get("layer") or ("" if before is None else before.layer)
    shape = DrawnShape(name=name, kind=kind, corners=tupled(command["corners"]), layer=layer)
    return [Change("shapes", name, before, shape)]


def _shape_delete(state: SurveyState, command: Fields) -> list[Change]:
    shape = _named("shapes", state, command)
    return [Change("shapes", shape.name, shape, None)]


def _control_name(state: SurveyState, command: Fields) -> str:
    return command.get("name") or state.free_name("C")


def _control_set(state: SurveyState, command: Fields) -> list[Change]:
    name = _control_name(state, command)
    before = state.control.get(name)
    coordinates = _known(command, before.known if before else None)
    after = replace(before or PickedControl(name=name, order=state.next_order()), known=coordinates)
    return [Change("control", name, before, after)]


def _control_pick(state: SurveyState, command: Fields) -> list[Change]:
    name, image = _control_name(state, command), command["image"]
    pixel = None if command.get("column") is None else pixel_of(command)
    before = state.control.get(name)
    if before is None and pixel is None:
        raise InputError(remark("page.no_control", name=name))
    after = (before or PickedControl(name=name, order=state.next_order())).picked(image, pixel)
    return [Change("control", name, before, after)]


def _control_rename(state: SurveyState, command: Fields) -> list[Change]:
    before, changes = _renamed("control", state, command)
    for key, tape in state.tapes.items() if changes else ():
        ends = [command["new"] if e == before.name else e for e in (tape.start, tape.end)]
        if before.name in (tape.start, tape.end):
            moved = replace(tape, start=ends[0], end=ends[1])
            changes += [Change("tapes", key, tape, None), _taped(state, moved)]
    return changes


def _control_delete(state: SurveyState, command: Fields) -> list[Change]:
    before = _named("control", state, command)
    tapes = [
        Change("tapes", key, tape, None)
        for key, tape in state.tapes.items()
        if before.name in (tape.start, tape.end)
    ]
    return [Change("control", before.name, before, None), *tapes]


def _control_paste(state: SurveyState, command: Fields) -> list[Change]:
    earlier = state.pasted.get("control")
    rows, pasted = pasted_control(
        command["text"].encode("utf-8", "replace").decode(),
        {name: point.picks for name, point in state.control.items()},
        earlier.frame if earlier and state.control else None,
    )
    changes = [Change("pasted", "control", earlier, pasted)]
    for name, coordinates, picks in rows:
        before = state.control.get(name)
        start = before or PickedControl(name=name, order=state.next_order())
        after = replace(start, known=coordinates, picks=picks)
        changes.append(Change("control", name, before, after))
    return changes


def _control_add(state: SurveyState, command: Fields) -> list[Change]:
    """Add targets that a job found, to be given their coordinates; taken names get another."""
    changes, names = [], set(state.control)
    for entry in command["control"]:
        name = entry["name"]
        while name in names:
            name = f"{name}b"
        names.add(name)
        point = PickedControl(name=name, order=state.next_order(), picks=tupled(entry["picks"]))
        changes.append(Change("control", name, None, point))
    return changes


def _taped(state: SurveyState, tape: TapedLength) -> Change:
    key = "|".join(sorted((tape.start, tape.end)))
    return Change("tapes", key, state.tapes.get(key), tape)


def _tape_set(state: SurveyState, command: Fields) -> list[Change]:
    start, end = command["from"], command["to"]
    length, sigma = command.get("length"), command.get("sigma")
    if start == end:
        raise InputError(remark("page.tape_of_two"))
    if length is None:
        raise FieldError(remark("page.tape_length"))
    missing = [name for name in (start, end) if name not in state.control]
    if missing:
        raise InputError(remark("page.pick_control", name=missing[0]))
    return [_taped(state, TapedLength(start=start, end=end, length=length, sigma=sigma))]


def _tape_delete(state: SurveyState, command: Fields) -> list[Change]:
    key = "|".join(sorted((command["from"], command["to"])))
    if key not in state.tapes:
        raise InputError(remark("page.no_tape"))
    return [Change("tapes", key, state.tapes[key], None)]


def _control_use(state: SurveyState, command: Fields) -> list[Change]:
    before = _named("control", state, command)
    return [Change("control", before.name, before, replace(before, use=command["use"]))]


def _length_set(state: SurveyState, command: Fields) -> list[Change]:
    return [_drawn_length(state, command, GIVES_SCALE)]


def _length_check(state: SurveyState, command: Fields) -> list[Change]:
    """Draw a taped length that gives no scale, and so checks it."""
    number = 1
    while (free := f"K{number}") in state.scale:
        number += 1
    name = command.get("name") or free
    if name == GIVES_SCALE:
        raise FieldError(remark("page.gives_scale", name=name))
    return [_drawn_length(state, command, name)]


def _drawn_length(state: SurveyState, command: Fields, name: str) -> Change:
    a, b = command["ends"]
    if max(abs(a[0] - b[0]), abs(a[1] - b[1])) < 2:
        raise FieldError(remark("page.length_ends"))
    if command["length"] is None:
        raise FieldError(remark("page.tape_length"))
    drawn = ScaleLength(
        image=command["image"], ends=tupled(command["ends"]), length=command["length"],
        sigma=command.get("sigma"),
    )  # fmt: skip
    return Change("scale", name, state.scale.get(name), drawn)


def _length_delete(state: SurveyState, command: Fields) -> list[Change]:
    name = command.get("name") or GIVES_SCALE
    if name not in state.scale:
        raise InputError(remark("page.no_length"))
    return [Change("scale", name, state.scale.get(name), None)]


def _wall_set(state: SurveyState, command: Fields) -> list[Change]:
    spot = None if command.get("column") is None else WallSpot(pixel=pixel_of(command))
    return [Change("wall", "spot", state.wall.get("spot"), spot)]


def _lens_set(state: SurveyState, command: Fields) -> None:
    image = command["image"]
    values = {key: command[key] for key in ("focal_mm", "sensor_width_mm") if key in command}
    state.lenses[image] = state.lenses.get(image, {}) | values


def _setup_set(state: SurveyState, command: Fields) -> None:
    fields = {key: command[key] for key in command if key in SETUP}
    if not fields:
        raise InputError(f"nothing to set; known are {', '.join(SETUP)}.")
    state.setup |= fields


def _exchange(state: SurveyState, command: Fields) -> None:
    """Exchange far and near photo as a job found them; no orientation stays.

    Older journals know it as the user's own, too.
    """
    state.points = {n: _turned(p) for n, p in state.points.items()}
    state.control = {n: _turned(p) for n, p in state.control.items()}
    state.lenses = _exchanged_lenses(state)
    state.scale = {k: replace(one, image=3 - one.image) for k, one in state.scale.items()}
    state.wall, state.shapes = {}, {}
    state.ordered = command.get("found") is not True
    state.forget_orientation()
    state.orientation = {}
    state.done, state.undone = (
        [[Change(c.kind, c.key, _turned(c.before), _turned(c.after)) for c in x] for x in history]
        for history in (state.done, state.undone)
    )
    if state.stage in ("points", "products"):
        state.stage = "orientation"


def _exchanged_lenses(state: SurveyState) -> dict[int, dict[str, float | None]]:
    """Return the lenses with their photos, unless the longer one was typed for the far photo."""
    if (lens_ratio(state.lenses.get(1, {}), state.lenses.get(2, {})) or 0.0) > 1.0:
        return state.lenses
    return {3 - image: lens for image, lens in state.lenses.items()}


def _turned(record: Any) -> Any:
    """Return a record with the picks of both photos exchanged, where it has some."""
    if isinstance(record, ScaleLength):
        return replace(record, image=3 - record.image)
    if isinstance(record, WallSpot | DrawnShape):  # of the other photo now
        return None
    if not hasattr(record, "picks"):
        return record
    return turned_picks(record)


def lens_ratio(*photos: Fields) -> float | None:
    """Return how much longer the lens of the first photo is; None where that is not known."""
    focals: list[Any] = [photo.get("focal_mm") for photo in photos]
    sensors: list[Any] = [photo.get("sensor_width_mm") for photo in photos]
    if None in focals:
        return None
    return float(focals[0] / focals[1] * (sensors[1] / sensors[0] if all(sensors) else 1.0))


def _points_add(state: SurveyState, command: Fields) -> list[Change]:
    """Add points that a job found; names that are taken get another number."""
    entries = command["points"]
    if len(entries) + len(state.points) > MOST_POINTS:
        raise InputError(f"points: a survey holds at most {MOST_POINTS}.")
    changes, names = [], set(state.points)
    for entry in entries:
        name = entry["name"]
        while name in names:
            name = f"{name}b"
        names.add(name)
        point = PickedPoint(
            name=name, order=state.next_order(), picks=tupled(entry["picks"]),
            code=(entry.get("code") or "")[:LONGEST_NAME], note=(entry.get("note") or "")[:200],
        )  # fmt: skip
        changes.append(Change("points", name, None, point))
    return changes


def _set(key: str, state: SurveyState, command: Fields) -> None:
    setattr(state, key, command[key])


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
    "shape.set": _shape_set,
    "shape.delete": _shape_delete,
    "control.set": _control_set,
    "control.pick": _control_pick,
    "control.rename": _control_rename,
    "control.delete": _control_delete,
    "control.use": _control_use,
    "control.add": _control_add,
    "length.set": _length_set,
    "length.check": _length_check,
    "length.delete": _length_delete,
    "wall.set": _wall_set,
    "control.paste": _control_paste,
    "tape.set": _tape_set,
    "tape.delete": _tape_delete,
}
_SETTINGS: dict[Any, Callable[[SurveyState, Fields], None]] = {
    "photo.set": _lens_set,
    "setup.set": _setup_set,
    "photos.exchange": _exchange,
    "stage.set": partial(_set, "stage"),
    "language.set": partial(_set, "language"),
}
