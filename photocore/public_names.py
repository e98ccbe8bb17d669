"""A package's public names, imported on first use from where its stub says they live."""

from __future__ import annotations

import ast
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


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
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    homes = {
        alias.name: "." * node.level + (node.module or "")
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    everything = sorted(homes)

    def attribute(name: str) -> Any:
        if name in homes:
            return getattr(import_module(homes[name], package), name)
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

    return attribute, lambda: list(everything), everything
