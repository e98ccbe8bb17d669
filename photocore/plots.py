"""Axes to draw into, where the user has none."""

from __future__ import annotations

from typing import Any

from photocore.errors import MissingExtraError


def new_axes() -> Any:
    """Return the axes of a new figure.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.
    """
    try:
        from matplotlib import pyplot
    except ImportError:
        raise MissingExtraError("Drawing", "plots") from None
    return pyplot.subplots(layout="constrained")[1]
