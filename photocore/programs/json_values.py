"""Values of another program's JSON, each knowing where it stands for the message."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from photocore.arrays import FloatArray
from photocore.errors import LARGEST, InputError
from photocore.jsonfile import read_json


@dataclass(frozen=True, slots=True)
class JsonValue:
    """A value and its place.

    Attributes
    ----------
    value : object
    where : str
        File and keys.
    """

    value: Any
    where: str

    @classmethod
    def read(cls, path: Path) -> JsonValue:
        """Return what a file holds."""
        return cls(read_json(path, what="project"), f"{path}: ")

    def __contains__(self, key: str) -> bool:
        return isinstance(self.value, dict) and key in self.value

    def __getitem__(self, key: str) -> JsonValue:
        if key not in self:
            raise InputError(f"{self.where or 'the file'} lacks {key!r}.")
        return JsonValue(self.value[key], f"{self.where} {key}")

    def get(self, key: str, default: Any) -> JsonValue:
        """Return a value that may be missing."""
        return self[key] if key in self else JsonValue(default, f"{self.where} {key}")

    def items(self) -> Iterator[tuple[str, JsonValue]]:
        """Yield keys and values of an object."""
        if not isinstance(self.value, dict):
            raise self.wrong("an object")
        return ((key, self[key]) for key in self.value)

    def each(self) -> Iterator[JsonValue]:
        """Yield the values of a list; an empty text is an empty list, as boost writes it."""
        if not isinstance(self.value, list) and self.value != "":
            raise self.wrong("a list")
        return (JsonValue(item, f"{self.where} {k}") for k, item in enumerate(self.value))

    def numbers(self, *shape: int) -> FloatArray:
        """Return numbers, also those written as text; -1 in the shape: any number of them."""
        try:
            array = np.array(self.value or [], dtype=np.float64)
            array = array.reshape(shape)
        except (TypeError, ValueError, OverflowError):
            raise self.wrong(f"numbers, {' x '.join(map(str, shape)).replace('-1', 'n')}") from None
        if not (np.abs(array) <= LARGEST).all():
            raise self.wrong("finite numbers")
        return array

    def number(self) -> float:
        """Return one number."""
        if isinstance(self.value, bool | list | dict | None):
            raise self.wrong("a number")
        return float(JsonValue([self.value], self.where).numbers(1)[0])

    def text(self) -> str:
        """Return a text, or a number's."""
        if not isinstance(self.value, str | int):
            raise self.wrong("a text")
        return str(self.value)

    def wrong(self, expected: str) -> InputError:
        """Return the complaint that something else was expected."""
        return InputError(f"{self.where}: expected {expected}, found {self.value!r:.60}.")
