"""What the page is told of a state: all of it, or what changed since one that it holds."""

from __future__ import annotations

import json
import secrets
from collections import OrderedDict
from collections.abc import Mapping
from threading import Lock
from typing import Any

#: Header of a request in which the page names the edition that it holds.
HELD = "x-edition"
#: Editions that are kept: of each tab the last, while others ask.
_KEPT = 8
#: Lists whose rows have names: of these only rows that differ are sent.
_OF_ROWS = ("points", "control", "lines", "shapes")
#: What the page itself brings up to date between two states.
_ALWAYS = ("jobs",)

#: A state in words that nothing changes any more: each value, and each row of a list.
_Words = dict[str, str | dict[str, str]]


class StateEditions:
    """The states that were sent last, each with the number of its edition."""

    def __init__(self) -> None:
        self._kept: OrderedDict[str, _Words] = OrderedDict()
        # A page outlives its server: the next one's editions must not be taken for these.
        self._server, self._count, self._lock = secrets.token_hex(4), 0, Lock()

    def next(self, state: Mapping[str, Any], held: str | None) -> dict[str, object]:
        """Return a state as it is sent, with its ``edition`` for who asks for it.

        Parameters
        ----------
        state : mapping
            As `state_of` returns it.
        held : str or None
            Edition that the page holds; None of who does not ask for editions.

        Returns
        -------
        dict
            The whole state; where the edition held is known what changed ``since`` it: ``values``
            by key, and of lists the ``rows`` that differ and the names of all in ``order``.
        """
        if held is None:
            return dict(state)
        words = _words(state)
        with self._lock:
            before = self._kept.get(held)
            self._count += 1
            edition = f"{self._server}.{self._count}"
            self._kept[edition] = words
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)
        if before is None:
            return {**state, "edition": edition}
        values: dict[str, object] = {}
        rows: dict[str, object] = {}
        for key, value in state.items():
            now, then = words[key], before.get(key)
            if isinstance(now, dict) and isinstance(then, dict):
                if list(now.items()) != list(then.items()):
                    changed = [row for row in value if now[row["name"]] != then.get(row["name"])]
                    rows[key] = {"order": list(now), "rows": changed}
            elif key in _ALWAYS or now != then:
                values[key] = value
        return {"edition": edition, "since": held, "values": values, "rows": rows}


def _words(state: Mapping[str, Any]) -> _Words:
    return {
        key: {row["name"]: json.dumps(row) for row in value}
        if key in _OF_ROWS
        else json.dumps(value)
        for key, value in state.items()
    }
