"""``bifocal handover``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from bifocal.options import LanguageOption
from photocore.cli import print_result
from photocore.options import Argument, declared
from photocore.shared_options import ChangedPhotosOption, JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class HandoverCommand:
    """The options of ``bifocal handover``, and examples.

    bifocal handover wall.pair.json --ortho ortho.tif --relief relief.tif --out wall.html
    bifocal handover wall.pair.json --ortho ortho.tif --points result.xlsx --title "Via Roma 12"
                     --out wall.html
    """

    pair: Annotated[Path, Argument()]
    ortho: Path | None = None
    """Orthophoto to measure on."""
    relief: Path | None = None
    """Relief map: heights under the pointer, true distances."""
    points: Path | None = None
    """Solved workbook or table of points."""
    title: str = ""
    """Title.  [default: the file's name]"""
    language: LanguageOption = "en"
    """Of the page."""
    out: Path
    """Page to write (.html), 24 MB at most."""
    changed_photos: ChangedPhotosOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(HandoverCommand)
def command(options: HandoverCommand) -> None:
    """Write one file for the client: photos, orthophoto, relief and points, to look at and measure.

    PAIR is a pair file. The page needs neither network nor program; distances and heights are
    measured on orthophoto and relief by two clicks.
    """
    from bifocal.reports import HandoverTask, write_handover

    facts = write_handover(
        options.pair,
        options.out,
        HandoverTask(
            ortho=options.ortho,
            relief=options.relief,
            points=options.points,
            title=options.title,
            language=options.language,
        ),
        overwrite=options.overwrite,
    )
    line = f"{options.out} written, {facts['bytes'] / 1e6:.1f} MB."
    print_result(facts, (line,), as_json=options.as_json, remarks=facts["remarks"])
