"""Sections of a file of keys (TOML, JSON), each value checked as it is taken."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

import numpy as np

from photocore.arrays import FloatArray, is_finite_number
from photocore.errors import InputError


class FileSection(Mapping[str, object]):
    """A section, and where it stands; a key that is not there is named when it is asked for.

    Parameters
    ----------
    value : mapping
        As read.
    where : str
        How messages call it.
    keys : sequence of str, optional
        All that it may have: others are most often typing errors.

    Raises
    ------
    InputError
        If it is no section, or has a key that nothing reads.
    """

    def __init__(self, value: Any, where: str, keys: Sequence[str] | None = None) -> None:
        self.where = where
        if not isinstance(value, Mapping):
            raise InputError(f"{where}: expected a section of keys, found {value!r:.40}.")
        self._value = value
        for key in value if keys is not None else ():
            if key not in (keys or ()):
                near = get_close_matches(key, keys or (), n=1)
                hint = f" Did you mean {near[0]!r}?" if near else ""
                known = ", ".join(keys or ())
                raise InputError(f"{where}: unknown key {key!r}.{hint} Known: {known}.")

    def __getitem__(self, key: str) -> Any:
        if key not in self._value:
            raise InputError(f"{self.where}: the key {key!r} is missing.")
        return self._value[key]

    def get(self, key: str, default: Any = None) -> Any:
        """Return a value, or the default where it is not there."""
        return self._value.get(key, default)

    def __contains__(self, key: object) -> bool:
        return key in self._value

    def __iter__(self) -> Iterator[str]:
        return iter(self._value)

    def __len__(self) -> int:
        return len(self._value)

    def number(self, key: str) -> float:
        """Return a finite number."""
        if not is_finite_number(self[key]):
            raise self.wrong(key, "a number")
        return float(self[key])

    def section(self, key: str) -> FileSection:
        """Return a section of it."""
        return FileSection(self[key], f"{self.where}, {key}")

    def numbers(
        self, key: str, *shapes: tuple[int, ...], default: Sequence[float] | None = None
    ) -> FloatArray:
        """Return finite numbers, a list or rows of equal length, of one of the shapes."""
        if default is not None and key not in self:
            return np.array(default, dtype=np.float64)
        given = self[key]
        is_table = isinstance(given, list) and bool(given) and isinstance(given[0], list)
        rows = given if is_table else [given]
        good = all(isinstance(row, list) and all(map(is_finite_number, row)) for row in rows)
        if good and len({len(row) for row in rows}) == 1:
            table = np.array(given, dtype=np.float64)
            if not shapes or table.shape in shapes:
                return table
        sizes = (" rows of ".join(map(str, shape)) for shape in shapes)
        raise self.wrong(key, f"{' or '.join(f'{size} numbers' for size in sizes) or 'numbers'}")

    def flag(self, key: str) -> bool:
        """Return true or false; the latter where nothing is said."""
        if not isinstance(self.get(key, False), bool):
            raise self.wrong(key, "true or false")
        return bool(self.get(key, False))

    def wrong(self, key: str, wanted: str) -> InputError:
        """Return the error that says what a value must be."""
        return InputError(f"{self.where}: {key} must be {wanted}, found {self[key]!r:.60}.")
