"""Columns of data frames in, columns with the same index out."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np

from photocore.errors import InputError

P = ParamSpec("P")
R = TypeVar("R")


def keeps_index(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function of arrays take pandas columns: its results get their index.

    Raises
    ------
    InputError
        By the function returned, if columns have different indices, which arrays would silently
        take for the same rows, or a whole data frame is given.
    """

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        given = [*args, *kwargs.values()]
        columns: list[Any] = [value for value in given if _is_column(value)]
        if not columns:
            return function(*args, **kwargs)
        first = columns[0]
        check_index(function.__name__, *columns)
        plain = [np.asarray(a) if _is_column(a) else a for a in args]
        named = {k: np.asarray(v) if _is_column(v) else v for k, v in kwargs.items()}
        result: Any = function(*plain, **named)  # type: ignore[arg-type]
        if isinstance(result, tuple):
            return tuple(_with_index(part, first) for part in result)  # type: ignore[return-value]
        return _with_index(result, first)

    return wrapped


def check_index(name: str, *values: Any) -> None:
    """Refuse columns of data frames, or whole frames, that count their rows differently.

    Raises
    ------
    InputError
        If two of them have different indices, which arrays would silently take for the same rows.
    """
    frames = [value for value in values if _is_of_pandas(value)]
    if any(not frames[0].index.equals(other.index) for other in frames[1:]):
        raise InputError(
            f"{name}: the columns have different indices; bring them into one "
            "order (reindex), or give plain arrays."
        )


def _is_of_pandas(value: Any) -> bool:
    # pandas 3 calls the module of its classes "pandas" alone.
    return type(value).__module__.partition(".")[0] == "pandas" and hasattr(value, "index")


def _is_column(value: Any) -> bool:
    """Tell a pandas column by its class; nothing is imported for it."""
    if not _is_of_pandas(value):
        return False
    if getattr(value, "ndim", 0) != 1:
        raise InputError("expected columns or arrays, found a whole data frame; give one column.")
    return True


def _with_index(result: Any, column: Any) -> Any:
    return type(column)(result, index=column.index) if np.shape(result) == column.shape else result
