"""A package's public names, imported on first use from where its stub says they live."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import lazy_loader


def public_names(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package with a stub beside it.

    Parameters
    ----------
    package, file : str
        Its ``__name__`` and ``__file__``.

    Notes
    -----
    A name the stub lacks raises AttributeError with the nearest name there is; ``__version__`` is
    that of the distribution.
    """
    load, names, everything = lazy_loader.attach_stub(package, file)

    def attribute(name: str) -> Any:
        if name in everything:
            return load(name)
        if name == "__version__":
            from importlib.metadata import version

            from photocore.installation import DISTRIBUTION

            return version(DISTRIBUTION)
        from difflib import get_close_matches

        near = get_close_matches(name, everything, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else "."
        raise AttributeError(
            f"{package} has no '{name}'{hint} Public names: help({package})",
            name=name,  # with it, Python adds no second guess of its own
        )

    return attribute, names, everything
