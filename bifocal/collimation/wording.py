"""What the server says to the user, in English, Italian and German: read from `words.toml`."""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def _content() -> dict[str, dict[str, dict[str, str]]]:
    return tomllib.loads(files(__package__).joinpath("words.toml").read_text(encoding="utf-8"))


def say(section: str, key: str, language: str, **fields: Any) -> str:
    """Return a sentence in a language, its fields filled in."""
    return _content()[section][key][language].format(**fields)
