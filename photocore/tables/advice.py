"""What to do about a table: by an option, where the running command has it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import click

from photocore.remarks import remark


def advice(key: str, /, *options: str, **about: str) -> str:
    """Return what to do about columns; by one of some options where the running command has it."""
    options = options or ("--columns",)
    context = click.get_current_context(silent=True)
    held = [name for param in context.command.params for name in param.opts] if context else options
    offered = " / ".join(option for option in options if option in held)
    return remark(f"table.{key}_by" if offered else f"table.{key}", options=offered, **about)


@contextmanager
def without_options() -> Iterator[None]:
    """Let `advice` name no options: for a page, where nobody can type them."""
    with click.Context(click.Command("page")):
        yield
