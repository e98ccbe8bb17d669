"""What a command may carry, and what a record of the journal: one table for all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from bifocal.collimation.records import CODES, Picks, Pixel
from bifocal.collimation.stated_media import MEDIA
from photocore.errors import InputError
from photocore.workbook.words import LANGUAGES

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
        raise FieldError(f"{key}: give a name.")
    value = " ".join(value.split())
    if len(value) > LONGEST_NAME or not value.isprintable():
        raise FieldError(f"{key}: a name of at most {LONGEST_NAME} letters, please.")
    return value


def number_of(command: Fields, key: str) -> float | None:
    """Return a number or None; text with a decimal comma counts."""
    value = command.get(key)
    if isinstance(value, str):
        typed = value.strip().replace(",", ".").replace("\N{MINUS SIGN}", "-")
        try:
            value = float(typed) if typed else None
        except ValueError:
            raise FieldError(f"{key}: {typed[:30]!r} is no number.") from None
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FieldError(f"{key}: expected a number.")
    if not abs(value) <= LARGEST:  # NaN too
        raise FieldError(f"{key}: is beyond reason; numbers end at {LARGEST:g}.")
    return float(value)


def positive_of(command: Fields, key: str) -> float | None:
    """Return a number above zero or None."""
    value = number_of(command, key)
    if value is not None and not value > 0:
        raise FieldError(f"{key}: must be above zero, got {value:g}.")
    return value


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
        raise FieldError("column, row: a pick needs both.")
    return column, row


def _text(command: Fields, key: str) -> str:
    if not isinstance(value := command.get(key), str):
        raise FieldError(f"{key}: expected text.")
    return value


def _line(command: Fields, key: str) -> str:
    """Return text without what is no character, which no workbook takes."""
    return _text(command, key).encode("utf-8", "replace").decode()


def _flag(command: Fields, key: str) -> bool:
    if not isinstance(value := command.get(key), bool):
        raise FieldError(f"{key}: expected true or false.")
    return value


def _texts(command: Fields, key: str) -> list[str]:
    value = command.get(key)
    if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
        raise FieldError(f"{key}: expected a list of names.")
    return value


def _object(command: Fields, key: str) -> dict[str, Any]:
    if not isinstance(value := command.get(key), dict):
        raise FieldError(f"{key}: expected an object.")
    return value


def _one_of(*words: str) -> Reader:
    def read(command: Fields, key: str) -> str:
        if (value := command.get(key)) not in words:
            raise FieldError(f"{key}: one of {', '.join(words)}.")
        return str(value)

    return read


def _if_any(reader: Reader) -> Reader:
    return lambda command, key: reader(command, key) if command.get(key) else None


def _found(command: Fields, key: str) -> list[dict[str, Any]]:
    """Return the points that a job found."""
    value = command.get(key)
    if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value):
        raise FieldError(f"{key}: expected a list of points.")
    words = ("code", "note")
    return [
        {"name": text_of(entry, "name"), "picks": _picks(entry)}
        | {word: _line(entry, word) for word in words if word in entry}
        for entry in value
    ]


def _rows(command: Fields, key: str) -> dict[str, dict[str, Any]]:
    """Return rows of the workbook, as `PointRow` takes them."""
    rows = {}
    for name in _object(command, key):
        row = _object(command[key], name)
        rows[name] = {word: _line(row, word) for word in ("code", "note")}
        known = row.get("reference")
        known = None if known is None else _numbers(known, "reference", 3, blank=True)
        rows[name] |= {"picks": _picks(row), "use": _flag(row, "use"), "reference": known}
    return rows


def _picks(entry: Fields) -> Picks:
    picks = entry.get("picks")
    if not isinstance(picks, list) or len(picks) != 2:
        raise FieldError("picks: expected those of both photos.")
    first, second = (None if pick is None else _numbers(pick, "picks", 2) for pick in picks)
    return first, second


def _numbers(values: Any, key: str, count: int, *, blank: bool = False) -> Any:
    """Return numbers as a tuple, None among them only where one may be ``blank``."""
    if not isinstance(values, list) or len(values) != count or not all(
        (blank and value is None) or (type(value) in (int, float) and abs(value) < MOST)
        for value in values
    ):  # fmt: skip
        raise FieldError(f"{key}: expected {count} numbers.")
    return tuple(None if value is None else float(value) for value in values)


_NAME = {"name": text_of}
_PLACE = {"X?": number_of, "Y?": number_of, "r?": number_of}
_TAPE = {"from": text_of, "to": text_of}
#: Fields of every command; those with ? may be left out, and others are not taken over.
COMMANDS: Mapping[str, Mapping[str, Reader]] = {
    "point.pick": {
        "name?": _if_any(text_of), "image": image_of, "column?": number_of, "row?": number_of,
        "doubtful?": _flag,
    },
    "point.unpick": {**_NAME, "image": image_of},
    "point.rename": {**_NAME, "new": text_of},
    "point.type": {**_NAME, "type": _one_of(*CODES)},
    "point.reference": {**_NAME, **_PLACE},
    "point.delete": _NAME,
    "points.add": {"points": _found},
    "line.set": {**_NAME, "layer?": text_of, "points?": _texts, "closed?": _flag},
    "line.delete": _NAME,
    "control.set": {"name?": _if_any(text_of), **_PLACE},
    "control.pick": {
        "name?": _if_any(text_of), "image": image_of, "column?": number_of, "row?": number_of,
    },
    "control.rename": {**_NAME, "new": text_of},
    "control.delete": _NAME,
    "control.paste": {"text": _line},
    "tape.set": {**_TAPE, "length?": positive_of, "sigma?": positive_of},
    "tape.delete": _TAPE,
    "photo.set": {"image": image_of, "focal_mm?": positive_of, "sensor_width_mm?": positive_of},
    "setup.set": {f"{key}?": positive_of for key in SETUP},
    "photos.exchange": {},
    "align.accept": {},
    "stage.set": {"stage": _one_of(*STAGES)},
    "language.set": {"language": _one_of(*LANGUAGES)},
    "undo": {},
    "redo": {},
}  # fmt: skip
#: Records of the journal that are notes of the server's own, not commands.
NOTES: Mapping[str, Mapping[str, Reader]] = {
    "files": {"stem": _text, "pair?": _if_any(_text), "photos": _texts},
    "workbook.saved": {"sha256": _text, "at?": number_of},
    "workbook.read": {"rows": _rows, "gone": _texts},
    "made": {"kind": _text, "names": _texts},
    "proposed": {"pair": _text, "report": _object},
    "accepted": {},
}


def fields_of(
    command: Fields, known: Mapping[str, Mapping[str, Reader]] = COMMANDS
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
