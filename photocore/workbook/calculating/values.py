"""Values of cells as spreadsheets count them: numbers, texts, truths, blanks, errors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from photocore.arrays import BoolArray, FloatArray
from photocore.workbook.changing.cells import CellValue

#: What a cell holds.
NUMBER, TEXT, BLANK, ERROR, TRUTH = range(5)


class Unknown(Exception):
    """A formula has something that is not known here, or refers to itself."""


@dataclass(frozen=True, slots=True, eq=False)
class CellArray:
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
    def of(cls, items: list[CellValue], *, size: tuple[int, int] | None = None) -> CellArray:
        """Return what stands in cells: across in a range of a size, down without one."""
        shape = (len(items), 1) if size is None else (1, len(items))
        if len(items) == 1 and type(items[0]) in (float, int):
            return single(float(items[0]))  # type: ignore[arg-type]
        kinds = [_kind(item) for item in items]
        pairs = list(zip(items, kinds, strict=True))
        numbers = [float(v) if k in (NUMBER, TRUTH) and v is not None else 0.0 for v, k in pairs]
        texts = np.array([v if k == TEXT else "" for v, k in pairs], dtype=object)
        return cls(
            np.array(numbers).reshape(shape), np.array(kinds, dtype=np.uint8).reshape(shape),
            texts.reshape(shape), size or (1, 1),
        )  # fmt: skip

    @property
    def is_number(self) -> bool:
        """Whether it is a single number."""
        return self.numbers.size == 1 and self.kinds.item() == NUMBER

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

    def at(self, rows: Any) -> CellArray:
        """Return some of the rows."""
        return CellArray(self.numbers[rows], self.kinds[rows], self.texts[rows])

    def across(self) -> CellArray:
        """Return a column of a table as a range."""
        return CellArray(self.numbers.T, self.kinds.T, self.texts.T, (len(self.numbers), 1))

    def items(self) -> list[CellValue]:
        """Return what cells show: an empty text for a blank text, NaN for an error."""
        if (self.kinds == NUMBER).all():
            return list[CellValue](self.numbers.ravel().tolist())
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


def number_cells(numbers: ArrayLike, bad: ArrayLike = False, *, kind: int = NUMBER) -> CellArray:
    """Return numbers as cells: an error where they are bad or not finite."""
    values = np.asarray(numbers, dtype=np.float64)
    wrong = ~np.isfinite(values) | bad
    if wrong.shape != values.shape:
        values = np.broadcast_to(values, wrong.shape)
    if wrong.any():
        kinds = np.where(wrong, ERROR, kind).astype(np.uint8)
        values = np.where(wrong, 0.0, values)
    else:
        kinds = np.full(values.shape, kind, dtype=np.uint8)
    return CellArray(values, kinds, _no_texts(values.shape))


@lru_cache(maxsize=256)
def _no_texts(shape: tuple[int, ...]) -> np.ndarray[Any, np.dtype[np.object_]]:
    """Return empty texts, shared by all cells of a shape: nothing writes to them."""
    texts = np.full(shape, "", dtype=object)
    texts.flags.writeable = False
    return texts


def single(value: float, kind: int = NUMBER) -> CellArray:
    """Return one number or truth as a cell: an error where it is not finite."""
    if not math.isfinite(value):
        value, kind = 0.0, ERROR
    return CellArray(np.array([[value]]), _KINDS[kind], _no_texts((1, 1)))


#: Kinds of single cells, shared by all.
_KINDS = [np.array([[kind]], dtype=np.uint8) for kind in range(5)]


def among(kinds: np.ndarray[Any, np.dtype[np.uint8]], listed: Sequence[int]) -> BoolArray:
    """Return where a kind is one of those listed."""
    return np.array([kind in listed for kind in range(5)])[kinds]


def text_cells(texts: ArrayLike, bad: ArrayLike = False) -> CellArray:
    """Return texts as cells."""
    words = np.asarray(texts, dtype=object)
    kinds = np.where(np.broadcast_to(bad, words.shape), ERROR, TEXT).astype(np.uint8)
    return CellArray(np.zeros(words.shape), kinds, words)


def spread(*cells: CellArray) -> list[CellArray]:
    """Return cells in one shape, single ones and rows repeated."""
    shape = np.broadcast_shapes(*(one.numbers.shape for one in cells))
    return [
        one
        if one.numbers.shape == shape
        else CellArray(
            np.broadcast_to(one.numbers, shape), np.broadcast_to(one.kinds, shape),
            np.broadcast_to(one.texts, shape), one.size,
        )
        for one in cells
    ]  # fmt: skip


def as_numbers(cells: CellArray) -> tuple[FloatArray, BoolArray]:
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
