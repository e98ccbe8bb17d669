"""``bifocal view``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import tell_written
from photocore.options import FILE, choice, overwrite

EXAMPLE = """\b
Examples:
  bifocal view relief.tif --out wall.html
  bifocal view relief.tif --ortho ortho.tif --title "Via Roma 12" --out wall.html
"""


@click.command(epilog=EXAMPLE)
@click.argument("relief", type=FILE)
@click.option("--ortho", type=FILE, help="Orthophoto that gives the colours.")
@click.option("--title", default="", help="Title.  [default: the file's name]")
@choice("--language", "en|it|de", "Of the page.", default="en")
@click.option("--out", type=FILE, required=True, help="Page to write (.html).")
@overwrite
def command(
    relief: Path, ortho: Path | None, title: str, language: str, out: Path, overwrite: bool
) -> None:
    """Show a relief map in three dimensions, on a page that needs nothing else.

    RELIEF is a map of `bifocal relief`. It is thinned to 65 000 points, so that the page is small
    enough to be sent; drag it to turn it, and make the relief higher where it is flat.
    """
    from bifocal.reports.view_workflow import view_relief

    view_relief(relief, out, ortho=ortho, title=title, language=language, overwrite=overwrite)
    tell_written(out)
