"""A package's public names, imported on first use from where its stub says they live."""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any


class Package(ModuleType):
    """A package whose public names are attributes of its class: completion finds them there.

    ``dir`` and ``help`` look into the package alone, so its help is its table of contents. A name
    it lacks raises AttributeError with the nearest there is; ``__version__`` is the distribution's.
    """

    __all__: list[str]

    def __getattr__(self, name: str) -> str:
        if name == "__version__":
            from importlib.metadata import version

            from photocore.installation import DISTRIBUTION

            return version(DISTRIBUTION)
        from difflib import get_close_matches

        near = get_close_matches(name, self.__all__, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else "."
        raise AttributeError(
            f"{self.__name__} has no '{name}'{hint} Public names: help({self.__name__})",
            name=name,  # with it, Python adds no second guess of its own
        )


class PublicName:
    """A public name: looks its value up where it lives."""

    def __init__(self, package: str, home: str, name: str) -> None:
        self.package, self.home, self.name = package, home, name

    def __get__(self, instance: object, owner: type) -> Any:
        return getattr(import_module(self.home, self.package), self.name)


def public_names(package: str, file: str) -> list[str]:
    """Give a package the names its stub has, and return them for its ``__all__``.

    Parameters
    ----------
    package, file : str
        Its ``__name__`` and ``__file__``.
    """
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text(encoding="utf-8"))
    names = {
        alias.name: PublicName(package, "." * node.level + (node.module or ""), alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    sys.modules[package].__class__ = type("Package", (Package,), dict(names))
    return sorted(names)
