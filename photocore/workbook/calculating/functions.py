"""What signs and functions of formulas do, by the rules of spreadsheets.

A blank counts as 0 or as an empty text, aggregates pass over what is no number, an error spreads.
Arguments lie as rows of a table down, ranges across.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache, partial, reduce
from typing import Any

import numpy as np

from photocore.arrays import FloatArray
from photocore.workbook.calculating.values import (
    BLANK,
    ERROR,
    NUMBER,
    TEXT,
    TRUTH,
    CellArray,
    Unknown,
    among,
    as_numbers,
    number_cells,
    single,
    spread,
    text_cells,
)


def _compare(sign: str, first: CellArray, second: CellArray) -> CellArray:
    first, second = spread(first, second)
    bad = first.is_error | second.is_error
    a, b = first.numbers.copy(), second.numbers.copy()
    words = [(c.kinds == TEXT) | (c.kinds == BLANK) for c in (first, second)]
    textual = words[0] & words[1] & ((first.kinds == TEXT) | (second.kinds == TEXT))
    # A text is above every number.
    a[(first.kinds == TEXT) & ~textual], b[(second.kinds == TEXT) & ~textual] = np.inf, np.inf
    if textual.any():
        firsts, seconds = ([str(t).casefold() for t in c.texts[textual]] for c in (first, second))
        a[textual] = [(x > y) - (x < y) for x, y in zip(firsts, seconds, strict=True)]
        b[textual] = 0.0
    return number_cells(_COMPARISONS[sign](a, b), bad, kind=TRUTH)


_COMPARISONS: Mapping[str, Callable[..., Any]] = {
    "=": np.equal, "<>": np.not_equal, "<": np.less, ">": np.greater, "<=": np.less_equal,
    ">=": np.greater_equal,
}  # fmt: skip
_ARITHMETIC: Mapping[str, Callable[..., Any]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "^": np.power,
}  # fmt: skip


def signed(sign: str, first: CellArray, second: CellArray) -> CellArray:
    """Return what a sign makes of the cells before and behind it."""
    if first.is_number and second.is_number and sign != "&":
        return _of_numbers(sign, first.numbers.item(), second.numbers.item())
    if sign == "&":
        first, second = spread(first, second)
        return text_cells(first.shown() + second.shown(), first.is_error | second.is_error)
    if sign in _COMPARISONS:
        return _compare(sign, first, second)
    (a, bad), (b, worse) = as_numbers(first), as_numbers(second)
    with np.errstate(all="ignore"):
        return number_cells(_ARITHMETIC[sign](a, b), bad | worse)


def _of_numbers(sign: str, a: float, b: float) -> CellArray:
    """Return what a sign makes of two numbers: single cells are many, and arrays slow for them."""
    if sign in _COMPARISONS:
        return single(float(_PLAIN[sign](a, b)), TRUTH)
    try:
        value = _PLAIN[sign](a, b)
    except (ZeroDivisionError, OverflowError):
        value = math.nan
    return single(value if isinstance(value, float) else math.nan)  # roots of less than 0


_PLAIN: Mapping[str, Callable[..., Any]] = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, "/": operator.truediv,
    "^": operator.pow, "=": operator.eq, "<>": operator.ne, "<": operator.lt, ">": operator.gt,
    "<=": operator.le, ">=": operator.ge,
}  # fmt: skip


def chosen(name: str, parts: Sequence[Callable[[], CellArray]]) -> CellArray:
    """Return what IF or IFERROR chooses; what is chosen nowhere is not calculated."""
    no: Callable[[], CellArray]
    if name == "IFERROR":
        value = parts[0]()
        if not value.is_error.any():
            return value
        test, yes, no = number_cells(value.is_error, kind=TRUTH), parts[1], partial(_itself, value)
    else:
        test, yes = parts[0](), parts[1]
        no = parts[2] if len(parts) > 2 else partial(single, 0.0, TRUTH)
    bad = test.is_error | (test.kinds == TEXT)
    holds = test.numbers != 0
    if not bad.any() and holds.all():
        return yes()
    if not bad.any() and not holds.any():
        return no()
    test, first, second = spread(test, yes(), no())
    bad, holds = test.is_error | (test.kinds == TEXT), test.numbers != 0
    pairs = (
        (first.numbers, second.numbers), (first.kinds, second.kinds), (first.texts, second.texts)
    )  # fmt: skip
    numbers, kinds, texts = (np.where(holds, a, b) for a, b in pairs)
    return CellArray(numbers, np.where(bad, ERROR, kinds).astype(np.uint8), texts)


def _each(function: Callable[..., Any]) -> Callable[..., CellArray]:
    def apply(*arguments: CellArray) -> CellArray:
        if len(arguments) == 1 and arguments[0].is_number:
            with np.errstate(all="ignore"):
                return single(float(function(arguments[0].numbers.item())))
        numbers, bad = zip(*map(as_numbers, arguments), strict=True)
        with np.errstate(all="ignore"):
            return number_cells(function(*numbers), reduce(np.logical_or, bad))

    return apply


def _whole(function: Callable[..., Any], *, none: float = 0.0) -> Callable[..., CellArray]:
    """Return an aggregate of what are numbers, for each row; ``none`` where there is not one."""

    def apply(*arguments: CellArray) -> CellArray:
        rows = max(len(one.numbers) for one in arguments)
        values = [np.broadcast_to(np.where(one.kinds == NUMBER, one.numbers, np.nan),
                                  (rows, one.numbers.shape[1])) for one in arguments]  # fmt: skip
        bad = reduce(np.logical_or, (one.is_error.any(axis=1, keepdims=True) for one in arguments))
        table = np.concatenate(values, axis=1)
        has = np.isfinite(table).any(axis=1, keepdims=True)
        table = np.where(has, table, none)
        return number_cells(function(table, axis=1, keepdims=True), bad)

    return apply


def _count(*kinds: int) -> Callable[..., CellArray]:
    def apply(*arguments: CellArray) -> CellArray:
        counts = [among(c.kinds, kinds).sum(axis=1, keepdims=True) for c in arguments]
        return number_cells(reduce(np.add, counts))

    return apply


def _logical(all_of: bool) -> Callable[..., CellArray]:
    def apply(*arguments: CellArray) -> CellArray:
        parts, bad = [], []
        for one in arguments:
            counts = among(one.kinds, (NUMBER, TRUTH))
            holds = np.where(counts, one.numbers != 0, all_of)
            parts.append(holds.all(1, keepdims=True) if all_of else holds.any(1, keepdims=True))
            bad.append(one.is_error.any(axis=1, keepdims=True))
        join = np.logical_and if all_of else np.logical_or
        return number_cells(reduce(join, parts), reduce(np.logical_or, bad), kind=TRUTH)

    return apply


def _sum_of_products(*arguments: CellArray) -> CellArray:
    bad = reduce(np.logical_or, (one.is_error for one in arguments))
    product = reduce(np.multiply, (np.where(c.kinds == NUMBER, c.numbers, 0.0) for c in arguments))
    return number_cells(product.sum(axis=1, keepdims=True), bad.any(axis=1, keepdims=True))


@lru_cache(maxsize=8)
def _places(area: CellArray) -> dict[Any, int]:
    """Return where each number and text of a range stands first."""
    keys: dict[Any, int] = {}
    parts = (area.kinds[0].tolist(), area.numbers[0].tolist(), area.texts[0].tolist())
    for i, (kind, number, text) in enumerate(zip(*parts, strict=True), start=1):
        if kind in (NUMBER, TEXT):
            keys.setdefault(text.casefold() if kind == TEXT else number, i)
    return keys


def _position(value: CellArray, area: CellArray, _: CellArray | None = None) -> CellArray:
    if len(area.numbers) > 1:
        raise Unknown("MATCH in rows")
    keys = _places(area)
    parts = (value.kinds.ravel().tolist(), value.numbers.ravel().tolist(), value.texts.ravel())
    positions = [keys.get(t.casefold() if k == TEXT else n if k != ERROR else None, np.nan)
             for k, n, t in zip(*parts, strict=True)]  # fmt: skip
    return number_cells(np.reshape(positions, value.numbers.shape))


def _entry(area: CellArray, row: CellArray, column: CellArray | None = None) -> CellArray:
    down, wide = area.size
    (i, bad) = as_numbers(row)
    j = np.ones_like(i) if column is None else as_numbers(column)[0]
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
    return CellArray(numbers.reshape(shape), kinds.reshape(shape), texts.reshape(shape))


def _inverse(area: CellArray) -> CellArray:
    down, wide = area.size
    matrix = np.where(area.kinds == NUMBER, area.numbers, np.nan).reshape(down, wide)
    inverse = np.full((down, wide), np.nan)
    if down == wide and np.isfinite(matrix).all() and np.linalg.det(matrix) != 0:
        inverse = np.linalg.inv(matrix)
    cells = number_cells(inverse.reshape(1, -1))
    return CellArray(cells.numbers, cells.kinds, cells.texts, area.size)


def _counted_if(area: CellArray, criterion: CellArray) -> CellArray:
    counts = np.zeros(criterion.numbers.shape)
    texts, kinds = criterion.shown(), criterion.kinds
    for at in np.ndindex(counts.shape):
        sign, word = _CRITERION.fullmatch(str(texts[at])).groups()  # type: ignore[union-attr]
        try:
            value, of_kind = number_cells([[float(word)]]), NUMBER
        except ValueError:
            value, of_kind = text_cells([[word]]), TEXT
        holds = _compare(sign or "=", area, value).numbers != 0
        counts[at] = (holds & (area.kinds == of_kind)).sum() if kinds[at] != BLANK else 0
    return number_cells(counts)


_CRITERION = re.compile(r"(>=|<=|<>|>|<|=)?(.*)", re.DOTALL)


def _sum_if(area: CellArray, criterion: CellArray, summed: CellArray) -> CellArray:
    holds = _compare("=", area, criterion).numbers != 0
    terms = np.where(holds & (summed.kinds == NUMBER), summed.numbers, 0.0)
    return number_cells(terms.sum(axis=1, keepdims=True))


def _worded(function: Callable[..., str]) -> Callable[..., CellArray]:
    def apply(text: CellArray, *arguments: CellArray) -> CellArray:
        text, *more = spread(text, *arguments)
        words, bad = text.shown(), reduce(np.logical_or, (c.is_error for c in (text, *more)))
        out = np.full(words.shape, "", dtype=object)
        for at in np.ndindex(words.shape):
            out[at] = function(words[at], *(int(c.numbers[at]) for c in more))
        return text_cells(out, bad)

    return apply


def _is(*kinds: int) -> Callable[[CellArray], CellArray]:
    return lambda value: number_cells(among(value.kinds, kinds), kind=TRUTH)


def _half_up(values: FloatArray, places: FloatArray) -> FloatArray:
    factor = 10.0**places
    # As spreadsheets do: what 15 digits show counts, not the last bit.
    scaled = np.abs(values) * factor
    return np.asarray(np.sign(values) * np.floor(scaled * (1 + 4e-16) + 0.5) / factor)


def _angle(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.asarray(np.where((x == 0) & (y == 0), np.nan, np.arctan2(y, x)))


def _special(name: str) -> Callable[..., FloatArray]:
    def apply(*arguments: FloatArray) -> FloatArray:
        from scipy import special  # late: seldom needed

        return np.asarray(getattr(special, name)(*arguments))

    return apply


def _as_number(value: CellArray) -> CellArray:
    is_number = among(value.kinds, (NUMBER, TRUTH))
    return number_cells(np.where(is_number, value.numbers, 0), value.is_error)


def _average(*arguments: CellArray) -> CellArray:
    return signed("/", FUNCTIONS["SUM"](*arguments), FUNCTIONS["COUNT"](*arguments))


def _chosen_of(name: str, *values: CellArray) -> CellArray:
    return chosen(name, [partial(_itself, value) for value in values])


def _itself(value: CellArray) -> CellArray:
    return value


FUNCTIONS: dict[str, Callable[..., CellArray]] = {
    "IF": partial(_chosen_of, "IF"), "IFERROR": partial(_chosen_of, "IFERROR"),
    "AND": _logical(True), "OR": _logical(False),
    "NOT": lambda v: number_cells(v.numbers == 0, v.is_error, kind=TRUTH),
    "ISNUMBER": _is(NUMBER), "ISERROR": _is(ERROR), "ISTEXT": _is(TEXT), "ISBLANK": _is(BLANK),
    "NA": lambda: number_cells([[np.nan]]), "PI": lambda: number_cells([[np.pi]]),
    "COUNT": _count(NUMBER), "COUNTA": _count(NUMBER, TEXT, TRUTH, ERROR), "COUNTIF": _counted_if,
    "SUM": _whole(np.nansum), "SUMSQ": _whole(lambda v, **k: np.nansum(v * v, **k)),
    "MAX": _whole(np.nanmax), "MIN": _whole(np.nanmin), "AVERAGE": _average,
    "SUMPRODUCT": _sum_of_products, "SUMIF": _sum_if, "INDEX": _entry, "MATCH": _position,
    "MINVERSE": _inverse, "ROWS": lambda v: number_cells([[v.size[0]]]),
    "N": _as_number,
    "SQRT": _each(np.sqrt), "ABS": _each(np.abs), "EXP": _each(np.exp), "LOG10": _each(np.log10),
    "LN": _each(np.log), "INT": _each(np.floor), "SIN": _each(np.sin), "COS": _each(np.cos),
    "TAN": _each(np.tan), "ASIN": _each(np.arcsin), "ACOS": _each(np.arccos),
    "ATAN": _each(np.arctan), "ATAN2": _each(_angle), "DEGREES": _each(np.degrees),
    "RADIANS": _each(np.radians), "ROUND": _each(_half_up), "NORMSDIST": _each(_special("ndtr")),
    "MOD": _each(np.mod), "FDIST": _each(lambda x, m, n: _special("fdtrc")(m, n, x)),
    "CHIDIST": _each(lambda x, n: _special("chdtrc")(n, x)),
    "TRIM": _worded(lambda t: " ".join(t.split())), "UPPER": _worded(str.upper),
    "LEFT": _worded(lambda t, n: t[:n]), "MID": _worded(lambda t, i, n: t[i - 1 : i - 1 + n]),
    "CHAR": lambda v: text_cells([[chr(int(n)) for n in row] for row in v.numbers]),
}  # fmt: skip
