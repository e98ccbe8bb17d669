"""The shell commands that the pages show, each with the page it stands in, in the page's order."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
#: Written by people; `cli.md` shows the examples of the help, `api.md` no commands.
PAGES = sorted([ROOT / "README.md", *(p for p in DOCS.glob("*.md") if p.name != "api.md")])
PROGRAMS = ("bifocal", "multimedia")
#: What names options of a command, or stands for them, and is no whole line.
IN_PART = (
    "bifocal align --control --lengths",
    "bifocal solve --adjust-setup",
    "bifocal plan --indices ... --port M",
    "bifocal solve POINTS.csv --pair PAIR.pair.json",
)
#: What a command line of a page begins with.
_FIRST = r"(?:\$ )?(?:bifocal|multimedia|python3?|pip|dask|mkdir) [\w.\"-]"


class Shown(NamedTuple):
    """A command as a page shows it, and what the page says that it prints."""

    page: str
    line: str
    prints: str = ""


def command_maker():
    """Return the module that writes the page of commands."""
    spec = importlib.util.spec_from_file_location("make_cli", DOCS / "make_cli.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def shown_commands() -> list[Shown]:
    """Return every command of the pages, and those that the help alone shows."""
    maker = command_maker()
    found = [shown for page in PAGES if page.name != "cli.md" for shown in _of_page(page)]
    for program, group in maker.groups().items():
        for name, command in maker.commands(group).items():
            source = f"help of {program} {name}"
            found += [Shown(source, line) for line in _examples(command.epilog or "")]
    return found


def _examples(epilog: str) -> Iterator[str]:
    """Yield the examples of a command's help."""
    # An example that goes on in the next line is indented there.
    text = re.sub(r"\s*\\\n\s*|\n {6,}", " ", epilog)
    for example in re.findall("^ {2,}(.*)", text, re.M):
        # What it does stands behind some examples.
        line = re.split(" {3,}", example)[0]
        if line.startswith(PROGRAMS):
            yield re.sub(r"\s+", " ", line.strip())


def _of_page(page: Path) -> Iterator[Shown]:
    """Yield the commands of a page: in blocks, indented, and within sentences and tables."""
    text = re.sub(r"\\\n\s*", " ", page.read_text(encoding="utf-8"))
    pieces = re.split(r"^```(\w*)\n(.*?)^```$", text, flags=re.M | re.S)
    for number, prose in enumerate(pieces[::3]):
        for part in re.findall(r"(?:^ {4}.*\n)+|^.*\n", prose, re.M):
            if re.match(f"    {_FIRST}", part):
                yield from _of_block(page.name, part)
            elif not part.startswith("    "):
                for code in re.findall(r"`([^`]+)`", part):
                    enough = 3 if code.startswith(PROGRAMS) else 2
                    if re.match(_FIRST, code) and len(code.split()) >= enough:
                        yield Shown(page.name, code)
        language, block = (*pieces, "", "")[3 * number + 1 : 3 * number + 3]
        if language in ("", "bash", "console"):
            yield from _of_block(page.name, block)


def _of_block(name: str, block: str) -> Iterator[Shown]:
    """Yield the commands of a block; where they stand behind `$`, what follows is printed."""
    lines = [re.sub(r"\s+", " ", line.strip()) for line in block.splitlines() if line.strip()]
    if not lines or not re.match(_FIRST, lines[0]):
        return
    if not lines[0].startswith("$ "):
        yield from (Shown(name, re.sub(r" # .*", "", line)) for line in lines)
        return
    for part in "\n".join(lines).removeprefix("$ ").split("\n$ "):
        line, _, printed = part.partition("\n")
        yield Shown(name, line, printed)
