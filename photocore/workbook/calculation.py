"""A workbook's own formulas, calculated: a column of a table at once, single cells one by one.

Functions and rules are those of spreadsheets: a blank counts as 0 or as an empty text, aggregates
pass over what is no number, an error spreads. What no rule is known for is `Unknown`, and so is all
that follows from it.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, reduce
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from openpyxl import Workbook
from openpyxl.worksheet.formula import ArrayFormula

from photocore.arrays import BoolArray, FloatArray
from photocore.workbook.changing.cells import CellValue
from photocore.workbook.reading.grid import (
    LAST_ROW,
    column_letters,
    column_number,
    plain_title,
    split_area,
    split_cell,
)

#: Frames that a chain of formulas may take.
_DEEPEST = 20_000
NUMBER, TEXT, BLANK, ERROR, TRUTH = range(5)

Node = tuple[Any, ...]


class Unknown(Exception):
    """A formula has something that is not known here, or refers to itself."""


@dataclass(frozen=True, slots=True, eq=False)
class Cells:
    """Values of cells: numbers, what each is, texts; rows of a table go down, ranges across.

    Attributes
    ----------
    numbers, kinds : ndarray, shape (rows, cells)
        A truth is 1 or 0.
    texts : ndarray of object, shape (rows, cells)
    size : (int, int)
        Rows and columns of the range that lies across.
    """

    numbers: FloatArray
    kinds: np.ndarray[Any, np.dtype[np.uint8]]
    texts: np.ndarray[Any, np.dtype[np.object_]]
    size: tuple[int, int] = (1, 1)

    @classmethod
    def of(cls, items: list[CellValue], *, size: tuple[int, int] | None = None) -> Cells:
        """Return what stands in cells: across in a range of a size, down without one."""
        shape = (len(items), 1) if size is None else (1, len(items))
        kinds = [_kind(item) for item in items]
        pairs = list(zip(items, kinds, strict=True))
        numbers = [float(v) if k in (NUMBER, TRUTH) and v is not None else 0.0 for v, k in pairs]
        texts = np.array([v if k == TEXT else "" for v, k in pairs], dtype=object)
        return cls(
            np.array(numbers).reshape(shape), np.array(kinds, dtype=np.uint8).reshape(shape),
            texts.reshape(shape), size or (1, 1),
        )  # fmt: skip

    @property
    def is_error(self) -> BoolArray:
        """Where an error stands."""
        return np.asarray(self.kinds == ERROR)

    def shown(self) -> np.ndarray[Any, np.dtype[np.object_]]:
        """Return the values as texts."""
        texts = self.texts.copy()
        for at in zip(*np.nonzero(self.kinds == NUMBER), strict=True):
            texts[at] = f"{self.numbers[at]:.15g}"
        texts[self.kinds == TRUTH] = np.where(self.numbers, "TRUE", "FALSE")[self.kinds == TRUTH]
        return texts

    def at(self, rows: Any) -> Cells:
        """Return some of the rows."""
        return Cells(self.numbers[rows], self.kinds[rows], self.texts[rows])

    def across(self) -> Cells:
        """Return a column of a table as a range."""
        return Cells(self.numbers.T, self.kinds.T, self.texts.T, (len(self.numbers), 1))

    def items(self) -> list[CellValue]:
        """Return what cells show: an empty text for a blank text, NaN for an error."""
        out: list[CellValue] = []
        parts = (part.ravel().tolist() for part in (self.numbers, self.kinds, self.texts))
        for number, kind, text in zip(*parts, strict=True):
            shown = text if kind == TEXT else bool(number) if kind == TRUTH else number
            out.append(float("nan") if kind == ERROR else shown)
        return out


def _kind(item: CellValue) -> int:
    if item is None:
        return BLANK
    if isinstance(item, str):
        return ERROR if item in _ERRORS else TEXT
    if isinstance(item, bool):
        return TRUTH
    return NUMBER if isinstance(item, int | float) and np.isfinite(item) else ERROR


_ERRORS = {"#N/A", "#DIV/0!", "#NUM!", "#VALUE!", "#REF!", "#NAME?", "#NULL!"}


def _numbers(numbers: ArrayLike, bad: ArrayLike = False, *, kind: int = NUMBER) -> Cells:
    values = np.asarray(numbers, dtype=np.float64)
    values, wrong = np.broadcast_arrays(values, np.asarray(bad))
    wrong = wrong | ~np.isfinite(values)
    kinds = np.where(wrong, ERROR, kind).astype(np.uint8)
    return Cells(np.where(wrong, 0.0, values), kinds, np.full(values.shape, "", dtype=object))


def _texts(texts: ArrayLike, bad: ArrayLike = False) -> Cells:
    words = np.asarray(texts, dtype=object)
    kinds = np.where(np.broadcast_to(bad, words.shape), ERROR, TEXT).astype(np.uint8)
    return Cells(np.zeros(words.shape), kinds, words)


def _spread(*cells: Cells) -> list[Cells]:
    shape = np.broadcast_shapes(*(one.numbers.shape for one in cells))
    return [
        Cells(
            np.broadcast_to(one.numbers, shape), np.broadcast_to(one.kinds, shape),
            np.broadcast_to(one.texts, shape), one.size,
        )
        for one in cells
    ]  # fmt: skip


def _as_numbers(cells: Cells) -> tuple[FloatArray, BoolArray]:
    """Return numbers for arithmetic, and where there are none; a text that is a number is one."""
    numbers, bad = cells.numbers, np.asarray(cells.is_error | (cells.kinds == TEXT))
    if (cells.kinds == TEXT).any():
        numbers, bad = numbers.copy(), bad.copy()
        for at in zip(*np.nonzero(cells.kinds == TEXT), strict=True):
            try:
                numbers[at], bad[at] = float(cells.texts[at]), False
            except ValueError:
                continue
    return numbers, bad


# The parts of a formula.

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
                left = ("sign", "/", left, ("value", _numbers([[100.0]])))
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
                return inner if sign == "+" else ("sign", "*", inner, ("value", _numbers([[-1.0]])))
            case {"sign": "("}:
                inner = self.expression(0)
                if self.sign() != ")":
                    raise Unknown("(")
                self.next += 1
                return inner
            case {"number": number}:
                return "value", _numbers([[float(number)]])
            case {"text": text}:
                return "value", _texts([[str(text).replace('""', '"')]])
            case {"error": _}:
                return "value", _numbers([[np.nan]])
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
                    return "value", _numbers([[upper == "TRUE"]], kind=TRUTH)
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
def _read(text: str) -> Node:
    return _Reader(text).whole()


# What functions do. Their arguments lie as rows of a table down, ranges across.


def _compare(sign: str, one: Cells, other: Cells) -> Cells:
    one, other = _spread(one, other)
    bad = one.is_error | other.is_error
    a, b = one.numbers.copy(), other.numbers.copy()
    words = [(c.kinds == TEXT) | (c.kinds == BLANK) for c in (one, other)]
    textual = words[0] & words[1] & ((one.kinds == TEXT) | (other.kinds == TEXT))
    # A text is above every number.
    a[(one.kinds == TEXT) & ~textual], b[(other.kinds == TEXT) & ~textual] = np.inf, np.inf
    if textual.any():
        left, right = ([str(t).casefold() for t in c.texts[textual]] for c in (one, other))
        a[textual] = [(x > y) - (x < y) for x, y in zip(left, right, strict=True)]
        b[textual] = 0.0
    return _numbers(_COMPARISONS[sign](a, b), bad, kind=TRUTH)


_COMPARISONS: Mapping[str, Callable[..., Any]] = {
    "=": np.equal, "<>": np.not_equal, "<": np.less, ">": np.greater, "<=": np.less_equal,
    ">=": np.greater_equal,
}  # fmt: skip
_ARITHMETIC: Mapping[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "^": np.power,
}  # fmt: skip


def _signed(sign: str, one: Cells, other: Cells) -> Cells:
    if sign == "&":
        one, other = _spread(one, other)
        return _texts(one.shown() + other.shown(), one.is_error | other.is_error)
    if sign in _COMPARISONS:
        return _compare(sign, one, other)
    (a, bad), (b, worse) = _as_numbers(one), _as_numbers(other)
    with np.errstate(all="ignore"):
        return _numbers(_ARITHMETIC[sign](a, b), bad | worse)


def _choice(test: Cells, yes: Cells, no: Cells | None = None) -> Cells:
    test, yes, no = _spread(test, yes, no or _numbers([[0.0]], kind=TRUTH))
    bad, holds = test.is_error | (test.kinds == TEXT), test.numbers != 0
    parts = ((yes.numbers, no.numbers), (yes.kinds, no.kinds), (yes.texts, no.texts))
    numbers, kinds, texts = (np.where(holds, a, b) for a, b in parts)
    return Cells(numbers, np.where(bad, ERROR, kinds).astype(np.uint8), texts)


def _or_else(value: Cells, other: Cells) -> Cells:
    return _choice(_numbers(value.is_error, kind=TRUTH), other, value)


def _each(function: Callable[..., Any]) -> Callable[..., Cells]:
    def apply(*given: Cells) -> Cells:
        numbers, bad = zip(*map(_as_numbers, given), strict=True)
        with np.errstate(all="ignore"):
            return _numbers(function(*numbers), reduce(np.logical_or, bad))

    return apply


def _whole(function: Callable[..., Any], *, none: float = 0.0) -> Callable[..., Cells]:
    """Return an aggregate of what are numbers, for each row; ``none`` where there is not one."""

    def apply(*given: Cells) -> Cells:
        rows = max(len(one.numbers) for one in given)
        values = [np.broadcast_to(np.where(one.kinds == NUMBER, one.numbers, np.nan),
                                  (rows, one.numbers.shape[1])) for one in given]  # fmt: skip
        bad = reduce(np.logical_or, (one.is_error.any(axis=1, keepdims=True) for one in given))
        table = np.concatenate(values, axis=1)
        has = np.isfinite(table).any(axis=1, keepdims=True)
        table = np.where(has, table, none)
        return _numbers(function(table, axis=1, keepdims=True), bad)

    return apply


def _count(*kinds: int) -> Callable[..., Cells]:
    def apply(*given: Cells) -> Cells:
        counts = [np.isin(c.kinds, kinds).sum(axis=1, keepdims=True) for c in given]
        return _numbers(reduce(np.add, counts))

    return apply


def _logical(all_of: bool) -> Callable[..., Cells]:
    def apply(*given: Cells) -> Cells:
        parts, bad = [], []
        for one in given:
            counts = np.isin(one.kinds, (NUMBER, TRUTH))
            holds = np.where(counts, one.numbers != 0, all_of)
            parts.append(holds.all(1, keepdims=True) if all_of else holds.any(1, keepdims=True))
            bad.append(one.is_error.any(axis=1, keepdims=True))
        join = np.logical_and if all_of else np.logical_or
        return _numbers(reduce(join, parts), reduce(np.logical_or, bad), kind=TRUTH)

    return apply


def _sum_of_products(*given: Cells) -> Cells:
    bad = reduce(np.logical_or, (one.is_error for one in given))
    product = reduce(np.multiply, (np.where(c.kinds == NUMBER, c.numbers, 0.0) for c in given))
    return _numbers(product.sum(axis=1, keepdims=True), bad.any(axis=1, keepdims=True))


def _position(value: Cells, among: Cells, _: Cells | None = None) -> Cells:
    if len(among.numbers) > 1:
        raise Unknown("MATCH in rows")
    keys: dict[Any, int] = {}
    parts = (among.kinds[0].tolist(), among.numbers[0].tolist(), among.texts[0].tolist())
    for i, (kind, number, text) in enumerate(zip(*parts, strict=True), start=1):
        if kind in (NUMBER, TEXT):
            keys.setdefault(text.casefold() if kind == TEXT else number, i)
    parts = (value.kinds.ravel().tolist(), value.numbers.ravel().tolist(), value.texts.ravel())
    found = [keys.get(t.casefold() if k == TEXT else n if k != ERROR else None, np.nan)
             for k, n, t in zip(*parts, strict=True)]  # fmt: skip
    return _numbers(np.reshape(found, value.numbers.shape))


def _entry(area: Cells, row: Cells, column: Cells | None = None) -> Cells:
    down, wide = area.size
    (i, bad) = _as_numbers(row)
    j = np.ones_like(i) if column is None else _as_numbers(column)[0]
    if down == 1 and column is None:
        i, j = np.ones_like(i), i
    bad = bad | (i < 1) | (i > down) | (j < 1) | (j > wide)
    flat = np.where(bad, 0, (i - 1) * wide + j - 1).astype(int)
    shape = flat.shape
    if len(area.numbers) > 1:  # a range of its own in each row
        place: Any = (np.arange(len(area.numbers))[:, None], flat)
        numbers, kinds, texts = area.numbers[place], area.kinds[place], area.texts[place]
    else:
        numbers, kinds, texts = area.numbers[0][flat], area.kinds[0][flat], area.texts[0][flat]
    kinds = np.where(bad, ERROR, kinds).astype(np.uint8)
    return Cells(numbers.reshape(shape), kinds.reshape(shape), texts.reshape(shape))


def _inverse(area: Cells) -> Cells:
    down, wide = area.size
    matrix = np.where(area.kinds == NUMBER, area.numbers, np.nan).reshape(down, wide)
    inverse = np.full((down, wide), np.nan)
    if down == wide and np.isfinite(matrix).all() and np.linalg.det(matrix) != 0:
        inverse = np.linalg.inv(matrix)
    cells = _numbers(inverse.reshape(1, -1))
    return Cells(cells.numbers, cells.kinds, cells.texts, area.size)


def _counted_if(area: Cells, wanted: Cells) -> Cells:
    counts = np.zeros(wanted.numbers.shape)
    texts, kinds = wanted.shown(), wanted.kinds
    for at in np.ndindex(counts.shape):
        sign, word = _CRITERION.fullmatch(str(texts[at])).groups()  # type: ignore[union-attr]
        try:
            value, of_kind = _numbers([[float(word)]]), NUMBER
        except ValueError:
            value, of_kind = _texts([[word]]), TEXT
        holds = _compare(sign or "=", area, value).numbers != 0
        counts[at] = (holds & (area.kinds == of_kind)).sum() if kinds[at] != BLANK else 0
    return _numbers(counts)


_CRITERION = re.compile(r"(>=|<=|<>|>|<|=)?(.*)", re.DOTALL)


def _sum_if(area: Cells, wanted: Cells, summed: Cells) -> Cells:
    holds = _compare("=", area, wanted).numbers != 0
    terms = np.where(holds & (summed.kinds == NUMBER), summed.numbers, 0.0)
    return _numbers(terms.sum(axis=1, keepdims=True))


def _worded(function: Callable[..., str]) -> Callable[..., Cells]:
    def apply(text: Cells, *given: Cells) -> Cells:
        text, *more = _spread(text, *given)
        words, bad = text.shown(), reduce(np.logical_or, (c.is_error for c in (text, *more)))
        out = np.full(words.shape, "", dtype=object)
        for at in np.ndindex(words.shape):
            out[at] = function(words[at], *(int(c.numbers[at]) for c in more))
        return _texts(out, bad)

    return apply


def _is(*kinds: int) -> Callable[[Cells], Cells]:
    return lambda value: _numbers(np.isin(value.kinds, kinds), kind=TRUTH)


def _half_up(values: FloatArray, places: FloatArray) -> FloatArray:
    factor = 10.0**places
    # As spreadsheets do: what 15 digits show counts, not the last bit.
    scaled = np.abs(values) * factor
    return np.asarray(np.sign(values) * np.floor(scaled * (1 + 4e-16) + 0.5) / factor)


def _angle(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(np.where((x == 0) & (y == 0), np.nan, np.arctan2(y, x)))


def _special(name: str) -> Callable[..., FloatArray]:
    def apply(*given: FloatArray) -> FloatArray:
        from scipy import special  # late: seldom needed

        return np.asarray(getattr(special, name)(*given))

    return apply


def _average(*given: Cells) -> Cells:
    return _signed("/", FUNCTIONS["SUM"](*given), FUNCTIONS["COUNT"](*given))


FUNCTIONS: dict[str, Callable[..., Cells]] = {
    "IF": _choice, "IFERROR": _or_else, "AND": _logical(True), "OR": _logical(False),
    "NOT": lambda v: _numbers(v.numbers == 0, v.is_error, kind=TRUTH),
    "ISNUMBER": _is(NUMBER), "ISERROR": _is(ERROR), "ISTEXT": _is(TEXT), "ISBLANK": _is(BLANK),
    "NA": lambda: _numbers([[np.nan]]), "PI": lambda: _numbers([[np.pi]]),
    "COUNT": _count(NUMBER), "COUNTA": _count(NUMBER, TEXT, TRUTH, ERROR), "COUNTIF": _counted_if,
    "SUM": _whole(np.nansum), "SUMSQ": _whole(lambda v, **k: np.nansum(v * v, **k)),
    "MAX": _whole(np.nanmax), "MIN": _whole(np.nanmin), "AVERAGE": _average,
    "SUMPRODUCT": _sum_of_products, "SUMIF": _sum_if, "INDEX": _entry, "MATCH": _position,
    "MINVERSE": _inverse, "ROWS": lambda v: _numbers([[v.size[0]]]),
    "N": lambda v: _numbers(np.where(np.isin(v.kinds, (NUMBER, TRUTH)), v.numbers, 0), v.is_error),
    "SQRT": _each(np.sqrt), "ABS": _each(np.abs), "EXP": _each(np.exp), "LOG10": _each(np.log10),
    "LN": _each(np.log), "INT": _each(np.floor), "SIN": _each(np.sin), "COS": _each(np.cos),
    "TAN": _each(np.tan), "ASIN": _each(np.arcsin), "ACOS": _each(np.arccos),
    "ATAN": _each(np.arctan), "ATAN2": _each(_angle), "DEGREES": _each(np.degrees),
    "RADIANS": _each(np.radians), "ROUND": _each(_half_up), "NORMSDIST": _each(_special("ndtr")),
    "MOD": _each(np.mod), "FDIST": _each(lambda x, m, n: _special("fdtrc")(m, n, x)),
    "CHIDIST": _each(lambda x, n: _special("chdtrc")(n, x)),
    "TRIM": _worded(lambda t: " ".join(t.split())), "UPPER": _worded(str.upper),
    "LEFT": _worded(lambda t, n: t[:n]), "MID": _worded(lambda t, i, n: t[i - 1 : i - 1 + n]),
    "CHAR": lambda v: _texts([[chr(int(n)) for n in row] for row in v.numbers]),
}  # fmt: skip


# The workbook.


@dataclass(frozen=True, slots=True)
class _Table:
    """A table: its sheet, the row of its headings, its last row, its columns by heading."""

    sheet: str
    head: int
    last: int
    columns: Mapping[str, int]


@dataclass(slots=True, eq=False)
class Calculation:
    """The values that a workbook's formulas give.

    Parameters
    ----------
    book : Workbook
        As openpyxl reads it, formulas not replaced by stored results.

    Attributes
    ----------
    unknown : dict
        What of formulas is not known here, and the first cell that has it.
    """

    book: Workbook
    unknown: dict[str, str] = field(default_factory=dict)
    _tables: dict[str, _Table] = field(default_factory=dict)
    _inside: dict[tuple[str, int], list[str]] = field(default_factory=dict)
    _known: dict[tuple[Any, ...], Cells | str | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for sheet in self.book.worksheets:
            for table in sheet.tables.values():
                top, left, bottom, _ = split_area(table.ref)
                names = [column.name.casefold() for column in table.tableColumns]
                columns = {name: left + i for i, name in enumerate(names)}
                key = table.name.casefold()
                self._tables[key] = _Table(sheet.title, top, bottom, columns)
                for number in columns.values():
                    self._inside.setdefault((sheet.title, number), []).append(key)

    def value(self, sheet: str, row: int, column: int) -> CellValue:
        """Return what a cell shows.

        Raises
        ------
        Unknown
            If its formula, or one that it follows from, has something that is not known.
        """
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(max(limit, _DEEPEST))  # a cell may follow from a hundred others
        try:
            return self._cell(sheet, row, column).items()[0]
        finally:
            sys.setrecursionlimit(limit)

    def formulas(self) -> list[tuple[str, int, int]]:
        """Return sheet, row and column of all cells that hold a formula."""
        return [
            (sheet.title, int(cell.row), int(cell.column))
            for sheet in self.book.worksheets
            for cells in sheet.iter_rows()
            for cell in cells
            if _formula(cell)
        ]

    def _cell(self, sheet: str, row: int, column: int) -> Cells:
        for key in self._inside.get((sheet, column), ()):
            table = self._tables[key]
            if table.head < row <= table.last:
                return self._column(key, column).at([row - table.head - 1])
        return self._once((sheet, row, column), lambda: self._single(sheet, row, column))

    def _single(self, sheet: str, row: int, column: int) -> Cells:
        cell = self.book[sheet].cell(row, column)
        if text := _formula(cell):
            return _no_blank(self._evaluated(text, (sheet, [row], column)), 1)
        return Cells.of([_typed(cell.value)])

    def _once(self, at: tuple[Any, ...], make: Callable[[], Cells]) -> Cells:
        """Return what was calculated already, or calculate it."""
        if at not in self._known:
            self._known[at] = None  # meanwhile: met again, it follows from itself
            try:
                self._known[at] = make()
            except (Unknown, ValueError, IndexError, OverflowError) as why:
                self._known[at] = str(why)
                self.unknown.setdefault(str(why), f"{at[0]}!{column_letters(at[-1])}{at[1]}")
            except RecursionError:
                self._known[at] = "a chain of formulas that is too long"
        value = self._known[at]
        if not isinstance(value, Cells):
            raise Unknown(value or "a formula that follows from itself")
        return value

    def _column(self, key: str, column: int) -> Cells:
        """Return a column of a table: formulas that are alike are calculated together."""
        table = self._tables[key]
        at = (table.sheet, f":{table.head}", column)
        return self._once(at, lambda: self._calculated(table, column))

    def _calculated(self, table: _Table, column: int) -> Cells:
        sheet, first = self.book[table.sheet], table.head + 1
        stands = [sheet.cell(row, column) for row in range(first, table.last + 1)]
        alike: dict[str, list[int]] = {}
        for i, cell in enumerate(stands):
            if text := _formula(cell):
                alike.setdefault(_of_row(text, first + i), []).append(i)
        cells = Cells.of([None if _formula(cell) else _typed(cell.value) for cell in stands])
        for text, rows in alike.items():
            numbers = [first + i for i in rows]
            result = _no_blank(self._evaluated(text, (table.sheet, numbers, column)), len(rows))
            cells.numbers[rows], cells.kinds[rows] = result.numbers, result.kinds
            cells.texts[rows] = result.texts
        return cells

    def _evaluated(self, text: str, where: tuple[str, list[int], int]) -> Cells:
        return self._value(_read(text), where)

    def _value(self, node: Node, where: tuple[str, list[int], int]) -> Cells:
        """Return the value of a part of a formula that stands in rows of a column of a sheet."""
        kind, *parts = node
        match kind:
            case "value":
                return parts[0]
            case "sign":
                sign, one, other = parts
                return _signed(sign, self._value(one, where), self._value(other, where))
            case "area":
                return self._area(parts[0] or where[0], parts[1], where[1])
            case "table":
                return self._of_table(parts, where[1])
            case "name":
                return self._named(parts[0], where)
            case _:
                return self._call(parts[0], parts[1:], where)

    def _call(self, name: str, given: list[Node], where: tuple[str, list[int], int]) -> Cells:
        if name == "ROW":
            if not given:
                return _numbers(np.array(where[1], dtype=float)[:, None])
            kind, *parts = given[0]
            if kind == "table" and parts[1] == "Headers":
                return _numbers([[self._table(parts[0]).head]])
            if kind == "area" and ":" not in parts[1]:
                return _numbers([[split_cell(parts[1])[0]]])
            raise Unknown("ROW")
        if name not in FUNCTIONS:
            raise Unknown(name)
        values = [self._value(one, where) for one in given]
        try:
            return FUNCTIONS[name](*values)
        except TypeError:
            raise Unknown(f"{name} with {len(given)} arguments") from None

    def _named(self, name: str, where: tuple[str, list[int], int]) -> Cells:
        own = self.book[where[0]].defined_names
        listed = {key.casefold(): value for key, value in self.book.defined_names.items()}
        listed |= {key.casefold(): value for key, value in own.items()}
        defined = listed.get(name.casefold())
        if defined is None or not defined.attr_text:
            raise Unknown(name)
        node = _read(str(defined.attr_text))
        if node[0] != "area":
            raise Unknown(name)
        return self._value(node, where)

    def _table(self, name: str) -> _Table:
        table = self._tables.get(name.casefold())
        if table is None:
            raise Unknown(f"{name}[]")
        return table

    def _of_table(self, parts: list[Any], rows: list[int]) -> Cells:
        name, part, heading = parts
        table = self._table(name)
        column = table.columns.get(heading.casefold())
        if column is None:
            raise Unknown(f"{name}[{heading}]")
        if part == "Headers":
            return Cells.of([_typed(self.book[table.sheet].cell(table.head, column).value)])
        cells = self._column(name.casefold(), column)
        if part == "This Row":
            if not table.head < rows[0] <= rows[-1] <= table.last:
                raise Unknown(f"{name}[{heading}] of another row")
            return cells.at([row - table.head - 1 for row in rows])
        return cells.across()

    def _area(self, title: str, area: str, rows: list[int]) -> Cells:
        title = plain_title(title)
        if title not in self.book.sheetnames:
            raise Unknown(f"{title}!")
        sheet = self.book[title]
        first, _, last = area.partition(":")
        if first.isalpha():
            area = f"{first}1:{last}{LAST_ROW}"
        if ":" not in area:
            letters, number = first.rstrip("0123456789"), first.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ")
            column = column_number(letters)
            if number == "0":  # the row where the formula stands
                own = [self._cell(title, row, column) for row in rows]
                return Cells(
                    np.concatenate([one.numbers for one in own]),
                    np.concatenate([one.kinds for one in own]),
                    np.concatenate([one.texts for one in own]),
                )
            return self._cell(title, int(number), column)
        top, left, bottom, right = split_area(area)
        bottom, right = (
            min(bottom, max(sheet.max_row, top)),
            min(right, max(sheet.max_column, left)),
        )
        cells = [
            self._cell(title, row, column)
            for row in range(top, bottom + 1)
            for column in range(left, right + 1)
        ]
        numbers, kinds, texts = (
            np.concatenate([getattr(cell, part).ravel() for cell in cells])[None]
            for part in ("numbers", "kinds", "texts")
        )
        return Cells(numbers, kinds, texts, (bottom - top + 1, right - left + 1))


def _formula(cell: Any) -> str:
    """Return the text of a cell's formula, empty where there is none."""
    if cell.data_type != "f":
        return ""
    stands = cell.value.text if isinstance(cell.value, ArrayFormula) else cell.value
    return str(stands or "").removeprefix("=")


def _typed(stands: Any) -> CellValue:
    return stands if isinstance(stands, str | bool | int | float) or stands is None else str(stands)


def _of_row(text: str, row: int) -> str:
    """Return a formula with row 0 in place of its own, so that it is the same in all rows."""
    if "[" in text and not _ROW_CELL.search(text):
        return text
    return _ROW_CELL.sub(lambda cell: f"{cell[1]}0" if int(cell[2]) == row else cell[0], text)


#: A cell of any row, not part of a range nor on another sheet.
_ROW_CELL = re.compile(r"(?<![\w$!'.:\"])([A-Z]{1,3})(\d+)(?![\w(:.!\"])")


def _no_blank(cells: Cells, rows: int) -> Cells:
    """Return what formulas show, one a row: 0 for a cell that is blank."""
    shape = (rows, 1)
    kinds = np.broadcast_to(cells.kinds[:, :1], shape)
    return Cells(
        np.broadcast_to(cells.numbers[:, :1], shape).copy(),
        np.where(kinds == BLANK, NUMBER, kinds).astype(np.uint8),
        np.broadcast_to(cells.texts[:, :1], shape).copy(),
    )
