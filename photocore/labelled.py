"""Status codes that carry their meaning in words."""

from __future__ import annotations

from enum import IntEnum
from typing import Self


class LabelledCode(IntEnum):
    """A code whose members are given as number and words: ``MISSED = 1, "misses an interface"``.

    Attributes
    ----------
    label : str
        The meaning in words, as tables show it.
    """

    label: str

    def __new__(cls, code: int, label: str = "") -> Self:
        """Return the member of a code, with its words."""
        member = int.__new__(cls, code)
        member._value_, member.label = code, label
        return member
