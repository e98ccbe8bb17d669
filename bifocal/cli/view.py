"""``bifocal view``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from bifocal.options import LanguageOption
from photocore.cli import tell_written
from photocore.options import Argument, declared
from photocore.shared_options import OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ViewCommand:
    """The options of ``bifocal view``, and examples.

    bifocal view relief.tif --out wall.html
    bifocal view relief.tif --ortho ortho.tif --title "Via Roma 12" --out wall.html
    """

    relief: Annotated[Path, Argument()]
    ortho: Path | None = None
    """Orthophoto that gives the colours."""
    title: str = ""
    """Title.  [default: the file's name]"""
    language: LanguageOption = "en"
    """Of the page."""
    out: Path
    """Page to write (.html)."""
    overwrite: OverwriteOption = False


@declared(ViewCommand)
def command(options: ViewCommand) -> None:
    """Show a relief map in three dimensions, on a page that needs nothing else.

    RELIEF is a map of `bifocal relief`. It is thinned to 65 000 points, so that the page is small
    enough to be sent; drag it to turn it, and make the relief higher where it is flat.
    """
    from bifocal.reports import view_relief

    view_relief(
        options.relief,
        options.out,
        ortho=options.ortho,
        title=options.title,
        language=options.language,
        overwrite=options.overwrite,
    )
    tell_written(options.out)
