"""What is handed on to a workflow, in place of its work: nothing may be lost on the way."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pytest


def leaves(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each plain value of an object by its name in what holds it."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from leaves(getattr(value, field.name), field.name)
    elif isinstance(value, Mapping):
        for key, one in value.items():
            yield from leaves(one, str(key))
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for one in value:
            yield from leaves(one, name)
    else:
        yield name, value.tolist() if isinstance(value, np.ndarray) else value


class Recorded:
    """Takes the place of functions by their dotted names, and notes what each is given."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **answers: Any) -> None:
        self.calls: dict[str, list[tuple[str, Any]]] = {}
        self._patch, self._answers = monkeypatch, answers

    def instead_of(self, *names: str) -> None:
        for name in names:
            self._patch.setattr(name, self._noting(name.rpartition(".")[2]))

    def _noting(self, name: str) -> Any:
        def noted(*values: Any, **named: Any) -> Any:
            self.calls.setdefault(name, []).extend([*leaves(values), *leaves(named)])
            return self._answers.get(name)

        return noted

    def values(self, name: str) -> list[Any]:
        return [value for _, value in self.calls[name]]
