"""Array types and shape checks that name the argument."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from photocore.errors import LARGEST, InputError

#: Always float64 at run time; numpy's own stubs type many float64 results as floating[Any].
FloatArray = NDArray[np.floating[Any]]
Float32Array = NDArray[np.float32]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ByteArray = NDArray[np.uint8]


#: Longer lists are not searched for true and false, which takes longer than all the rest.
_LOOKED_AT = 10_000


def as_floats(value: ArrayLike, name: str) -> FloatArray:
    """Return value as a float64 array; what is masked becomes NaN.

    Raises
    ------
    InputError
        If it holds anything that is not a number; the message names the argument.
    """
    try:
        array = np.asarray(value)
        # numpy would take the text "17.5", true for 1, a date for its days, and drop what is
        # imaginary; no file of ours means it.
        if array.dtype.kind in "USbcmM" or (array.size < _LOOKED_AT and _holds_truth(value)):
            raise TypeError
        if isinstance(value, np.ma.MaskedArray):
            plain = np.asarray(value.data, dtype=np.float64)
            return np.where(np.ma.getmaskarray(value), np.nan, plain)
        return np.asarray(array, dtype=np.float64)
    except OverflowError as error:
        largest = sys.float_info.max
        raise InputError(f"{name}: holds a whole number above {largest:.2g}.") from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{name}: expected numbers, found {value!r:.60}.") from error


def _holds_truth(value: Any) -> bool:
    """Tell whether true or false stands among the numbers of a list."""
    return isinstance(value, bool) or (
        isinstance(value, list | tuple) and any(map(_holds_truth, value))
    )


def floats_of_words(words: Sequence[str], path: Path, where: str) -> FloatArray:
    """Return words of a file as numbers; refuse the first that is none, {} being its place."""
    try:
        values = np.fromiter(map(float, words), dtype=np.float64, count=len(words))
        if (np.abs(values) <= LARGEST).all():
            return values
    except ValueError:
        values = np.empty(len(words))
    for k, word in enumerate(words):
        try:
            values[k] = float(word)
            wrong = "" if abs(values[k]) <= LARGEST else f"{word:.40} is no finite number."
        except ValueError:
            wrong = f"expected a number, found {word!r:.40}."
        if wrong:
            raise InputError(f"{path}, {where.replace('{}', str(k + 1))}: {wrong}")
    return values


def is_finite_number(value: object) -> bool:
    """Tell whether value, as read from a file, is a number that float64 can hold; no bool is."""
    # A comparison takes whole numbers of any length, which float() and numpy do not; NaN fails it.
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and abs(value) <= sys.float_info.max
    )


def as_points(value: ArrayLike, name: str, *, dimension: int) -> FloatArray:
    """Return value as float64 points, shape (..., dimension), coordinates on the last axis.

    Raises
    ------
    InputError
        If the last axis has another length.
    """
    points = as_floats(value, name)
    if points.ndim == 0 or points.shape[-1] != dimension:
        raise InputError(
            f"{name}: expected points of shape (..., {dimension}), found shape {points.shape}."
        )
    return points


def read_only(value: ArrayLike, name: str, *, shape: tuple[int, ...] | None = None) -> FloatArray:
    """Return a read-only float64 copy, checked for shape and size (for frozen objects).

    Raises
    ------
    InputError
        If the shape differs or a value is not finite, or beyond `LARGEST`.
    """
    array = np.array(as_floats(value, name))
    if shape is not None and array.shape != shape:
        raise InputError(f"{name}: expected shape {shape}, found {array.shape}.")
    # One pass tells both in the ordinary case: NaN is not below anything.
    if not (np.abs(array) <= LARGEST).all():
        if not np.isfinite(array).all():
            raise InputError(f"{name}: every value must be a finite number.")
        raise InputError(f"{name}: {np.abs(array).max():.3g} is beyond reason; check the unit.")
    array.setflags(write=False)
    return array


def positive(value: float, name: str, *, unit: str = "") -> float:
    """Return value as a float, refusing anything that is not above zero, or beyond `LARGEST`.

    Raises
    ------
    InputError
        Otherwise.
    """
    return _within(value, name, unit, np.nextafter(0.0, 1.0), "above zero")


def not_negative(value: float, name: str, *, unit: str = "") -> float:
    """Return value as a float, refusing anything that is not zero or more, or beyond `LARGEST`.

    Raises
    ------
    InputError
        Otherwise.
    """
    return _within(value, name, unit, 0.0, "zero or more")


def _within(value: float, name: str, unit: str, least: float, words: str) -> float:
    """Return one number from ``least`` to `LARGEST`."""
    array = as_floats(value, name)
    if array.size != 1:
        raise InputError(f"{name}: expected one number, found shape {array.shape}.")
    number = float(array.item())
    if not least <= number <= LARGEST:
        raise InputError(
            f"{name}: must be {words}{unit and f' [{unit}]'} and no more than {LARGEST:g}, "
            f"got {value!s:.40}."
        )
    return number


def all_positive(value: ArrayLike, name: str, *, unit: str = "") -> FloatArray:
    """Return one number or an array of them, refusing what `positive` refuses.

    Raises
    ------
    InputError
        Naming the first entry that is not above zero, or beyond `LARGEST`.
    """
    array = as_floats(value, name)
    if array.size == 1:
        return np.full(array.shape, positive(array, name, unit=unit))  # type: ignore[arg-type]
    wrong = ~((array > 0) & (array <= LARGEST))
    if wrong.any():
        place = tuple(int(i) for i in np.argwhere(wrong)[0])
        shown = ", ".join(map(str, place))
        raise InputError(
            f"{name}[{shown}]: must be above zero{unit and f' [{unit}]'} and no more than "
            f"{LARGEST:g}, got {array[place]!s:.40}."
        )
    return array


def check_shapes(**arrays: FloatArray) -> None:
    """Refuse arrays that do not belong together.

    Raises
    ------
    InputError
        Naming each with its shape, if they do not broadcast.
    """
    try:
        np.broadcast_shapes(*(np.shape(array) for array in arrays.values()))
    except ValueError as error:
        shown = ", ".join(f"{name} {np.shape(array)}" for name, array in arrays.items())
        raise InputError(
            f"{shown}: these shapes do not fit together; give one value for each point, or one for "
            "all."
        ) from error


def contiguous_rows(
    inputs: Sequence[FloatArray], outputs: Sequence[FloatArray], *, size: int
) -> Iterator[tuple[FloatArray, ...]]:
    """Walk through arrays that broadcast together, in contiguous rows of at most ``size`` elements.

    Rows of the inputs come first, then those of the outputs, to be filled with ``row[...] =``. No
    input is ever expanded as a whole, and the scratch of a row stays in the processor's cache.
    """
    operands = [*(np.broadcast_to(a, outputs[0].shape) for a in inputs), *outputs]
    flags = [["readonly"]] * len(inputs) + [["writeonly"]] * len(outputs)
    with np.nditer(
        operands,
        flags=["external_loop", "buffered", "zerosize_ok"],
        op_flags=flags,  # type: ignore[arg-type]  # numpy wants literals
        buffersize=size,
    ) as rows:
        yield from rows


def each_once(numbers: IntArray) -> IntArray:
    """Return the rows, in their order, that share no number with a row taken before.

    Parameters
    ----------
    numbers : ndarray of int, shape (n, k)
        Of each column's things, from 0; -1 for none, which all may share.

    Returns
    -------
    rows : ndarray of int, shape (p,)

    Examples
    --------
    >>> each_once(np.array([[0, 5], [0, 6], [1, 6], [-1, 5], [-1, 7]])).tolist()
    [0, 2, 4]
    """
    offsets = np.cumsum([1, *(numbers.max(axis=0, initial=-1) + 1)])
    keys = np.where(numbers >= 0, numbers + offsets[:-1], 0)
    used = np.zeros(offsets[-1], dtype=bool)
    earliest = np.empty(offsets[-1], dtype=np.int64)
    rest, rows = np.arange(len(numbers)), [np.empty(0, dtype=np.int64)]
    while len(rest):
        # Of rows that share a number the first counts: of all that is assigned, the last remains.
        earliest[np.ravel(keys[::-1])] = np.repeat(rest[::-1], keys.shape[1])
        first = ((earliest[keys] == rest[:, None]) | (keys == 0)).all(axis=1)
        rows.append(rest[first])
        used[keys[first]] = True
        used[0] = False
        free = ~used[keys].any(axis=1)
        rest, keys = rest[free], keys[free]
    return np.sort(np.concatenate(rows))
