"""``bifocal view``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import tell_written
from photocore.options import declared


@declared
def command(relief: Path, out: Path, **options: Any) -> None:
    """Show a relief map in three dimensions, on a page that needs nothing else.

    RELIEF is a map of `bifocal relief`. It is thinned to 65 000 points, so that the page is small
    enough to be sent; drag it to turn it, and make the relief higher where it is flat.
    """
    from bifocal.reports.view_workflow import view_relief

    view_relief(relief, out, **options)
    tell_written(out)
