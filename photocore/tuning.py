"""Tuned numbers of a package: rows of its `tuning.toml`, each with what it is and what fixed it."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from types import SimpleNamespace
from typing import Any


@cache
def read_tuning(package: str) -> Any:
    """Return the tuned numbers of a package.

    Parameters
    ----------
    package : str
        One with a file `tuning.toml` of tables ``[stage.name]``, each with `value` (a number or a
        list of them), `unit`, `words` (what it is) and `fixed_by` (scene and benchmark).

    Returns
    -------
    tuning : namespace
        Values by stage and name; lists are tuples.

    Raises
    ------
    AttributeError
        On a name that has no row, when it is asked for.

    Examples
    --------
    >>> read_tuning("bifocal.relief_maps").edges.reach
    9
    """
    text = files(package).joinpath("tuning.toml").read_text(encoding="utf-8")
    return SimpleNamespace(
        **{
            stage: SimpleNamespace(**{name: _fixed(row["value"]) for name, row in rows.items()})
            for stage, rows in tomllib.loads(text).items()
        }
    )


def _fixed(value: Any) -> Any:
    """Return a value that cannot change: a number, or a tuple of them."""
    return tuple(map(_fixed, value)) if isinstance(value, list) else value
