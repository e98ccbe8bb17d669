"""Print the README's command that contains a word, so that CI runs what the README says."""

from __future__ import annotations

import re
import sys
from pathlib import Path

MARKS = {"demo": "bifocal demo", "test": "bin/pytest"}

text = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
blocks = re.findall(r"```(?:bash|sh)\n(.*?)```", text, flags=re.DOTALL)
found = [block for block in blocks if MARKS[sys.argv[1]] in block]
if not found:
    sys.exit(f"README.md has no command with {MARKS[sys.argv[1]]!r}")
sys.stdout.write(found[0])
