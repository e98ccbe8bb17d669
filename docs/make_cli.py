"""Write docs/cli.md from the commands themselves: `python docs/make_cli.py`."""

from __future__ import annotations

import sys
from copy import copy
from importlib.util import find_spec
from pathlib import Path

import click

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

HEAD = """# Commands and options

Written by `python docs/make_cli.py` from the commands themselves; a test keeps it up to date.
"""


def groups() -> dict[str, click.Group]:
    """Return both commands."""
    from bifocal.cli.main import main as bifocal
    from multimedia.cli.main import main as multimedia

    return {"bifocal": bifocal, "multimedia": multimedia}


def commands(group: click.Group) -> dict[str, click.Command]:
    """Return the sub-commands by name."""
    context = click.Context(group)
    found = {name: group.get_command(context, name) for name in group.list_commands(context)}
    return {name: command for name, command in found.items() if command is not None}


def page() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for program, group in groups().items():
        parts.append(f"## {program}\n\n{group.help}\n")
        for name, own in commands(group).items():
            # Click keeps the help option of the first context a command met, in a test perhaps.
            command = copy(own)
            command._help_option = None
            context = click.Context(
                command, info_name=f"{program} {name}", max_content_width=100,
                help_option_names=["-h", "--help"],
            )  # fmt: skip
            context.terminal_width = 100
            text = "\n".join(line.rstrip() for line in command.get_help(context).splitlines())
            parts.append(f"### {program} {name}\n\n```text\n{text}\n```\n")
    return "\n".join(parts)


if __name__ == "__main__":
    assert find_spec("bifocal")
    (HERE / "cli.md").write_text(page(), encoding="utf-8")
