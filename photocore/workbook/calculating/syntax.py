"""The text of a formula, read into its parts."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np

from photocore.workbook.calculating.values import (
    TRUTH,
    CellArray,
    Unknown,
    number_cells,
    text_cells,
)

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
        self.signs: list[str | None] = []
        self.next, position, end = 0, 0, len(text.rstrip())
        while position < end:
            token = _TOKEN.match(text, position)
            if token is None:
                raise Unknown(text[position : position + 20])
            self.tokens.append(token)
            self.signs.append(token["sign"])
            position = token.end()
        self.signs.append(None)

    def sign(self) -> str | None:
        """Return the sign that comes next, None where there is another thing."""
        return self.signs[self.next]

    def whole(self) -> Node:
        """Return all of it."""
        node = self.expression(0)
        if self.next < len(self.tokens):
            raise Unknown(self.tokens[self.next][0])
        return node

    def expression(self, least: int) -> Node:
        """Return what binds more closely than a rank."""
        node = self.operand()
        while (sign := self.signs[self.next]) is not None:
            if sign == "%":
                self.next += 1
                node = ("sign", "/", node, ("value", number_cells([[100.0]])))
            elif _RANK.get(sign, 0) > least:
                self.next += 1
                node = ("sign", sign, node, self.expression(_RANK[sign]))
            else:
                break
        return node

    def operand(self) -> Node:
        """Return what stands between signs."""
        if self.next >= len(self.tokens):
            raise Unknown("an end too early")
        token = self.tokens[self.next]
        self.next += 1
        match token.lastgroup:
            case "sign":
                return self._signed(token["sign"])
            case "number":
                return "value", number_cells([[float(token["number"])]])
            case "text":
                return "value", text_cells([[token["text"].replace('""', '"')]])
            case "error":
                return "value", number_cells([[np.nan]])
            case "key" | "whole":
                heading = token["key"] or token["whole"]
                return "table", token["table"], token["part"] or "", heading
            case "area":
                title = (token["quoted"] or token["sheet"] or "").replace("''", "'")
                return "area", title, token["area"].replace("$", "")
            case "function":
                name = token["function"].upper().removeprefix("_XLFN.")
                return "call", name, *self.arguments()
            case _:
                upper = token["name"].upper()
                if upper in ("TRUE", "FALSE"):
                    return "value", number_cells([[upper == "TRUE"]], kind=TRUTH)
                return "name", token["name"]

    def _signed(self, sign: str) -> Node:
        """Return what a sign or a bracket before an operand makes of it."""
        if sign == "(":
            inner = self.expression(0)
            if self.sign() != ")":
                raise Unknown("(")
            self.next += 1
            return inner
        if sign not in "+-":
            raise Unknown(sign)
        inner = self.expression(_SIGN_RANK)
        return inner if sign == "+" else ("sign", "*", inner, ("value", number_cells([[-1.0]])))

    def arguments(self) -> list[Node]:
        """Return the arguments of a function, behind its bracket."""
        nodes: list[Node] = []
        while self.sign() != ")":
            is_blank = self.sign() == ","
            nodes.append(("value", CellArray.of([None])) if is_blank else self.expression(0))
            if self.sign() == ",":
                self.next += 1
            elif self.sign() != ")":
                raise Unknown("an open bracket")
        self.next += 1
        return nodes


@lru_cache(maxsize=4096)
def parts_of(text: str) -> Node:
    """Return the parts of a formula: nested tuples of what each is and what it holds.

    Raises
    ------
    Unknown
        If it has something that is not known.
    """
    return _Reader(text).whole()
