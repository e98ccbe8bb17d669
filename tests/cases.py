"""Cases of a dear test: a few that stand for all by default, the others where there is time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def few_by_default(cases: Iterable[Any], *chosen: Any) -> list[Any]:
    """Return the cases of `pytest.mark.parametrize`, all but the chosen ones for acceptance.

    Parameters
    ----------
    cases : iterable
        One value each, or a tuple of them.
    *chosen
        Those that are tried by default.
    """
    listed = list(cases)
    assert all(case in listed for case in chosen), "chosen cases are cases"
    rest = pytest.mark.acceptance
    return [
        case
        if case in chosen
        else pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=rest)
        for case in listed
    ]
