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
        if any(not first.index.equals(other.index) for other in columns[1:]):
            raise InputError(
                f"{function.__name__}: the columns have different indices; bring them into one "
                "order (reindex), or give plain arrays."
            )
        plain = [np.asarray(a) if _is_column(a) else a for a in args]
        named = {k: np.asarray(v) if _is_column(v) else v for k, v in kwargs.items()}
        result: Any = function(*plain, **named)  # type: ignore[arg-type]
        if isinstance(result, tuple):
            return tuple(_with_index(part, first) for part in result)  # type: ignore[return-value]
        return _with_index(result, first)

    return wrapped


def _is_column(value: Any) -> bool:
    """Tell a pandas column by its class; nothing is imported for it."""
    if not type(value).__module__.startswith("pandas."):
        return False
    if getattr(value, "ndim", 0) != 1 or not hasattr(value, "index"):
        raise InputError("expected columns or arrays, found a whole data frame; give one column.")
    return True


def _with_index(result: Any, column: Any) -> Any:
    return type(column)(result, index=column.index) if np.shape(result) == column.shape else result
