"""What a command may carry, and what a record of the journal: one table for all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from bifocal.collimation.records import CODES, SHAPES, Pixel
from bifocal.collimation.stated_media import INDICES, MEDIA
from bifocal.remarks import remark
from photocore.adjustment.priors import LEAST_INDEX, MOST_INDEX
from photocore.errors import InputError
from photocore.option_types import Number
from photocore.workbook import LANGUAGES

Fields = Mapping[str, Any]
#: Takes a command and a key; returns the value, or raises `FieldError`.
Reader = Callable[[Fields, str], Any]
STAGES = ("photos", "orientation", "points", "products")
#: Set-up values asked of the user.
SETUP = (
    "d1", "d2", "delta_d", "c1", "c2", "sigma_d1", "sigma_d2", "sigma_delta_d", "sigma_d", *MEDIA,
)  # fmt: skip
#: No name, layer or photo is longer, no wall larger; in a workbook, no coordinate of a country.
LONGEST_NAME, LARGEST, MOST = 80, 1e6, 1e12


class FieldError(InputError):
    """A field of a command is not what it has to be; the message begins with its name."""


def text_of(command: Fields, key: str) -> str:
    """Return a name: not blank, one line."""
    value = command.get(key)
    if not isinstance(value, str) or not value.strip():
        raise FieldError(remark("page.give_name", field=key))
    value = " ".join(value.split())
    if len(value) > LONGEST_NAME or not value.isprintable():
        raise FieldError(remark("page.long_name", field=key, most=LONGEST_NAME))
    return value


def _number(**limits: Any) -> Reader:
    """Return a reader of a number within limits, or None; text with a decimal comma counts."""
    kind = Number(**limits)

    def read(command: Fields, key: str) -> float | None:
        value = command.get(key)
        if value is None or (isinstance(value, str) and not value.strip()):
            return None
        try:
            return float(kind.typed(value))
        except ValueError as error:
            raise FieldError(f"{key}: expected {error}, found {value!r:.40}.") from None

    return read


number_of = _number(least=-LARGEST, most=LARGEST)
positive_of = _number(above=0, most=LARGEST)
_index = _number(
    least=LEAST_INDEX, most=MOST_INDEX,
    called="a refractive index (water has about 1.34, glass 1.46 to 1.6),",
)  # fmt: skip


def image_of(command: Fields, key: str = "image") -> int:
    """Return the number of a photo."""
    image = command.get(key)
    if image not in (1, 2) or isinstance(image, bool):
        raise FieldError(f"{key}: 1 is the far photo, 2 the near one.")
    return int(image)


def pixel_of(command: Fields) -> Pixel:
    """Return a pick. [px]"""
    column, row = number_of(command, "column"), number_of(command, "row")
    if column is None or row is None:
        raise FieldError(remark("page.pick_needs_both"))
    return column, row


def _fits(value: Any, shape: Any) -> bool:
    """Whether JSON has a shape: a type, words, (one, another), [each] or [first, second, ...]."""
    if isinstance(shape, tuple):
        return any(_fits(value, each) for each in shape)
    if isinstance(shape, frozenset):
        return isinstance(value, str) and value in shape
    if isinstance(shape, list):
        each = shape * len(value) if isinstance(value, list) and len(shape) == 1 else shape
        return isinstance(value, list) and len(value) == len(each) and all(map(_fits, value, each))
    if isinstance(shape, dict):
        return isinstance(value, dict) and all(_fits(value.get(k), s) for k, s in shape.items())
    if shape is float:
        return type(value) in (int, float) and abs(value) < MOST
    return value is None if shape is None else type(value) is shape


def _of(shape: Any, said: str) -> Reader:
    """Return a reader of what has a shape."""

    def read(command: Fields, key: str) -> Any:
        if not _fits(value := command.get(key), shape):
            raise FieldError(f"{key}: expected {said}.")
        return value

    return read


def _one_of(*words: str) -> Reader:
    return _of(frozenset(words), f"one of {', '.join(words)}")


def _if_any(reader: Reader) -> Reader:
    return lambda command, key: reader(command, key) if command.get(key) else None


def _rows(command: Fields, key: str) -> dict[str, Any]:
    """Return rows of the workbook, as `PointRow` takes them."""
    rows = _of(dict, "rows")(command, key)
    if not _fits(list(rows.values()), [_ROW]):
        raise FieldError(f"{key}: are no rows of a workbook.")
    return {
        name: {word: tupled(value) for word, value in row.items() if word in _ROW}
        for name, row in rows.items()
    }


def tupled(value: Any) -> Any:
    """Return lists, and those in them, as tuples."""
    return tuple(map(tupled, value)) if isinstance(value, list) else value


_TEXT, _FLAG, _TEXTS = _of(str, "text"), _of(bool, "true or false"), _of([str], "a list of names")
_PICK = [float, float]
_FOUND = {"name": str, "picks": [_PICK, _PICK], "code": (None, str), "note": (None, str)}
_ROW = {
    "picks": [(None, _PICK)] * 2, "code": str, "note": str, "use": bool,
    "reference": (None, [(None, float)] * 3),
}  # fmt: skip
_NAME = {"name": text_of}
_PIXEL = {"image": image_of, "column?": number_of, "row?": number_of}
_PLACE = {"X?": number_of, "Y?": number_of, "r?": number_of}
_LENGTH = {
    "image": image_of,
    "ends": _of([_PICK, _PICK], "two pixels"),
    "length": positive_of,
    "sigma?": positive_of,
}
_TAPE = {"from": text_of, "to": text_of}
#: Fields of every command of the page; those with ? may be left out, others are not taken over.
COMMANDS: Mapping[str, Mapping[str, Reader]] = {
    "point.pick": {"name?": _if_any(text_of), **_PIXEL, "doubtful?": _FLAG},
    "point.unpick": {**_NAME, "image": image_of},
    "point.rename": {**_NAME, "new": text_of},
    "point.type": {**_NAME, "type": _one_of(*CODES)},
    "point.reference": {**_NAME, **_PLACE},
    "point.delete": _NAME,
    "line.set": {**_NAME, "layer?": text_of, "points?": _TEXTS, "closed?": _FLAG},
    "line.delete": _NAME,
    "shape.set": {
        "name?": _if_any(text_of),
        "kind": _one_of(*SHAPES),
        "corners": _of([[float, float, float]], "a list of [column, row, relief]"),
        "layer?": text_of,
    },
    "shape.delete": _NAME,
    "control.set": {"name?": _if_any(text_of), **_PLACE},
    "control.pick": {"name?": _if_any(text_of), **_PIXEL},
    "control.rename": {**_NAME, "new": text_of},
    "control.delete": _NAME,
    "control.paste": {"text": _TEXT},
    "tape.set": {**_TAPE, "length?": positive_of, "sigma?": positive_of},
    "tape.delete": _TAPE,
    "control.use": {**_NAME, "use": _FLAG},
    "length.set": _LENGTH,
    "length.check": {"name?": _if_any(text_of), **_LENGTH},
    "length.delete": {"name?": _if_any(text_of)},
    "wall.set": {"column?": number_of, "row?": number_of},
    "photo.set": {"image": image_of, "focal_mm?": positive_of, "sensor_width_mm?": positive_of},
    "setup.set": {f"{key}?": _index if key in INDICES else positive_of for key in SETUP},
    "stage.set": {"stage": _one_of(*STAGES)},
    "language.set": {"language": _one_of(*LANGUAGES)},
    **{op: {} for op in ("photos.exchange", "align.accept", "undo", "redo")},
}
#: Records of the journal that are the server's own.
NOTES: Mapping[str, Mapping[str, Reader]] = {
    "files": {"stem": _TEXT, "pair?": _if_any(_TEXT), "photos": _TEXTS},
    "workbook.saved": {"sha256": _TEXT, "at?": number_of},
    "workbook.read": {"rows": _rows, "gone": _TEXTS},
    "made": {"kind": _TEXT, "names": _TEXTS, "causes?": _of(dict, "digests by cause")},
    "proposed": {"pair": _TEXT, "report": _of(dict, "a report")},
    "accepted": {"pair?": _TEXT},
    "unaligned": {},
}
#: What the journal holds: also the points, and the order of the photos, that a job found.
RECORDS = {
    **COMMANDS, **NOTES, "control.add": {"control": _of([_FOUND], "a list of targets")},
    "points.add": {"points": _of([_FOUND], "a list of points")},
    "undo": {"proposal?": _of(dict, "what was proposed")},
    "photos.exchange": {
        "found?": _FLAG, "step?": _FLAG, "corners?": _of(dict, "corners by shape"),
        **{f"{key}?": _of(dict, "files") for key in ("made", "causes", "proposal")},
    },
}  # fmt: skip


def fields_of(
    command: Fields, known: Mapping[str, Mapping[str, Reader]] = RECORDS
) -> dict[str, Any]:
    """Return a command with ``op``, ``id`` and its fields, each of its type.

    Raises
    ------
    FieldError
        If it is no command, or a field is lacking or wrong: named first.
    """
    op = command.get("op")
    if not isinstance(op, str) or op not in known:
        raise FieldError(f"op: there is no command {ascii(op)[:40]}.")
    read: dict[str, Any] = {"op": op}
    if isinstance(command.get("id"), str):
        read["id"] = text_of(command, "id")
    for name, reader in known[op].items():
        key = name.removesuffix("?")
        if key == name or key in command:
            read[key] = reader(command, key)
    return read
