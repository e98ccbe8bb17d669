"""Write docs/api.md from the docstrings of the public names: `python docs/make_api.py`."""

from __future__ import annotations

import inspect
import re
import sys
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

HEAD = """# Python: every public name

Written by `python docs/make_api.py` from the docstrings; a test keeps it up to date.
`help(bifocal.NAME)` prints the same.
"""


def entry(package: str, name: str) -> str:
    """Return the part of one name: signature and docstring."""
    value = getattr(import_module(package), name)
    try:
        signature = str(inspect.signature(value)).replace("'", "") if callable(value) else ""
        signature = re.sub(r"<function (\w+) at 0x[0-9a-f]+>", r"\1", signature)
    except ValueError:
        signature = ""
    text = inspect.getdoc(value) or ""
    shown = signature if len(signature) < 300 else "(...)"
    return f"### {package}.{name}\n\n```text\n{name}{shown}\n\n{text}\n```\n"


def page() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for package in ("bifocal", "multimedia"):
        parts.append(f"## {package}\n")
        names = sorted(import_module(package).__all__)
        parts += [entry(package, name) for name in names]
    lines = "\n".join(parts).splitlines()
    return "\n".join(line.rstrip() for line in lines) + "\n"


if __name__ == "__main__":
    (HERE / "api.md").write_text(page(), encoding="utf-8")
