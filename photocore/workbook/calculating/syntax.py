"""The text of a formula, read into its parts."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np

from photocore.workbook.calculating.values import TRUTH, Cells, Unknown, number_cells, text_cells

Node = tuple[Any, ...]

_TOKEN = re.compile(
    r"""\s*(?:(?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?(?![\w!:])|\.\d+)
    |"(?P<text>(?:[^"]|"")*)"|(?P<error>\#[A-Z/0]+[!?]?)
    |(?P<table>\w+)\[(?:\[\#(?P<part>This\ Row|Headers|Data)\],\[(?P<key>[^\]]+)\]
        |(?P<whole>[^\[\]#@]+))\]
    |(?:(?:'(?P<quoted>(?:[^']|'')+)'|(?P<sheet>\w+))!)?(?P<area>\$?[A-Z]{1,3}\$?\d+(?::\$?[A-Z]{1,3}\$?\d+)?
        |\$?[A-Z]{1,3}:\$?[A-Z]{1,3})(?![\w(.])
    |(?P<function>[A-Za-z_][\w.]*)\(|(?P<name>[A-Za-z_\\][\w.]*)(?![\[!])
    |(?P<sign><>|<=|>=|[-+*/^&=<>(),%]))""",
    re.VERBOSE,
)
_RANK = {"=": 1, "<>": 1, "<": 1, ">": 1, "<=": 1, ">=": 1, "&": 2, "+": 3, "-": 3,
         "*": 4, "/": 4, "^": 6}  # fmt: skip
_SIGN_RANK = 7


class _Reader:
    """Reads the text of a formula into nested tuples."""

    def __init__(self, text: str) -> None:
        self.tokens: list[re.Match[str]] = []
        self.next, position = 0, 0
        while position < len(text.rstrip()):
            token = _TOKEN.match(text, position)
            if token is None:
                raise Unknown(text[position : position + 20])
            self.tokens.append(token)
            position = token.end()

    def sign(self) -> str | None:
        """Return the sign that comes next, None where there is another thing."""
        return self.tokens[self.next]["sign"] if self.next < len(self.tokens) else None

    def whole(self) -> Node:
        """Return all of it."""
        node = self.expression(0)
        if self.next < len(self.tokens):
            raise Unknown(self.tokens[self.next][0])
        return node

    def expression(self, least: int) -> Node:
        """Return what binds more closely than a rank."""
        left = self.operand()
        while (sign := self.sign()) is not None:
            if sign == "%":
                self.next += 1
                left = ("sign", "/", left, ("value", number_cells([[100.0]])))
            elif _RANK.get(sign, 0) > least:
                self.next += 1
                left = ("sign", sign, left, self.expression(_RANK[sign]))
            else:
                break
        return left

    def operand(self) -> Node:
        """Return what stands between signs."""
        if self.next >= len(self.tokens):
            raise Unknown("an end too early")
        token = self.tokens[self.next]
        self.next += 1
        match token.lastgroup and {k: v for k, v in token.groupdict().items() if v is not None}:
            case {"sign": "-" | "+" as sign}:
                inner = self.expression(_SIGN_RANK)
                return (
                    inner
                    if sign == "+"
                    else ("sign", "*", inner, ("value", number_cells([[-1.0]])))
                )
            case {"sign": "("}:
                inner = self.expression(0)
                if self.sign() != ")":
                    raise Unknown("(")
                self.next += 1
                return inner
            case {"number": number}:
                return "value", number_cells([[float(number)]])
            case {"text": text}:
                return "value", text_cells([[str(text).replace('""', '"')]])
            case {"error": _}:
                return "value", number_cells([[np.nan]])
            case {"table": table, **column}:
                return "table", table, column.get("part", ""), column.get("key") or column["whole"]
            case {"area": area, **place}:
                title = str(place.get("quoted", place.get("sheet", ""))).replace("''", "'")
                return "area", title, area.replace("$", "")
            case {"function": name}:
                return "call", name.upper().removeprefix("_XLFN."), *self.arguments()
            case {"name": name}:
                upper = name.upper()
                if upper in ("TRUE", "FALSE"):
                    return "value", number_cells([[upper == "TRUE"]], kind=TRUTH)
                return "name", name
        raise Unknown(token[0])

    def arguments(self) -> list[Node]:
        """Return the arguments of a function, behind its bracket."""
        given: list[Node] = []
        while self.sign() != ")":
            is_blank = self.sign() == ","
            given.append(("value", Cells.of([None])) if is_blank else self.expression(0))
            if self.sign() == ",":
                self.next += 1
            elif self.sign() != ")":
                raise Unknown("an open bracket")
        self.next += 1
        return given


@lru_cache(maxsize=4096)
def parts_of(text: str) -> Node:
    """Return the parts of a formula: nested tuples of what each is and what it holds.

    Raises
    ------
    Unknown
        If it has something that is not known.
    """
    return _Reader(text).whole()
