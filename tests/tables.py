"""Tables of cases in one test: all are tried, and every one that fails is named."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import pytest


def each(
    names: str | Sequence[str],
    cases: Iterable[Any],
    *,
    ids: Callable[[Any], str] | Iterable[str] | None = None,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make one test of a table, in the words of `pytest.mark.parametrize`.

    For tables of many quick cases: a test of its own costs each 2 ms and more, and a fault that
    hits all of them would be told as often. Fixtures are the same for all cases.
    """
    keys = [key.strip() for key in names.split(",")] if isinstance(names, str) else list(names)
    rows = [_row(case, len(keys)) for case in cases]
    labels = [ids(values[0]) for values, _ in rows] if callable(ids) else list(ids or ())
    labels = labels or [label or ", ".join(map(str, values)) for values, label in rows]

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def whole(**fixtures: Any) -> None:
            failures = []
            for label, (values, _) in zip(labels, rows, strict=True):
                try:
                    test(**dict(zip(keys, values, strict=True)), **fixtures)
                except (Exception, pytest.fail.Exception) as error:
                    failures.append(f"{label}: {type(error).__name__}: {error}")
            assert not failures, f"{len(failures)} of {len(rows)}\n" + "\n".join(failures)

        signature = inspect.signature(test)
        fixtures = [p for key, p in signature.parameters.items() if key not in keys]
        whole.__signature__ = signature.replace(parameters=fixtures)  # type: ignore[attr-defined]
        return whole

    return decorate


def _row(case: Any, count: int) -> tuple[tuple[Any, ...], str]:
    """Return the values of a case, and its name if it has one."""
    if isinstance(values := getattr(case, "values", None), tuple):  # pytest.param
        return values, str(case.id or "")
    return (case,) if count == 1 else tuple(case), ""
