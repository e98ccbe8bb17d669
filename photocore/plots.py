"""What draws itself into axes, new ones where the user has none."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from photocore.errors import MissingExtraError


def _new_axes() -> Any:
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


class Drawable(ABC):
    """Something on the wall that draws itself."""

    __slots__ = ()

    def plot(self, axes: Any = None) -> Any:
        """Draw it over the wall, X to the right and Y up [m], and return the axes.

        Parameters
        ----------
        axes : matplotlib.axes.Axes, optional
            Where to draw; by default a new figure.

        Raises
        ------
        InputError
            If matplotlib is not installed.
        """
        axes = _new_axes() if axes is None else axes
        self._draw(axes)
        return axes

    @abstractmethod
    def _draw(self, axes: Any) -> None:
        """Draw into axes."""
