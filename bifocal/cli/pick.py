"""``bifocal pick``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import click

from photocore.cli import print_json, remark
from photocore.options import Argument, Typed, declared
from photocore.shared_options import ChangedPhotosOption, JsonOption


@dataclass(frozen=True, kw_only=True)
class PickCommand:
    """The options of ``bifocal pick``, and examples.

    bifocal pick wall.pair.json
    bifocal pick far.jpg near.jpg --workbook wall.xlsx
    bifocal pick far.jpg near.jpg third.jpg
    bifocal pick survey.xlsx --lang it
    bifocal pick .
    """

    sources: Annotated[
        tuple[Path, ...], Argument(unit="[PAIR|SET|SURVEY.xlsx|FOLDER|FAR NEAR [MORE]...]")
    ] = ()
    workbook: Annotated[Path | None, Typed(unit="SURVEY.xlsx")] = None
    """Survey workbook the points go into.  [default: named after the pair]"""
    port: Annotated[int, Typed(click.IntRange(min=0, max=65535))] = 0
    """Port; 0: one that is free."""
    changed_photos: ChangedPhotosOption = False
    no_browser: bool = False
    """Print the address only."""
    language: Annotated[Literal["en", "it", "de"], Typed(flag="--lang --language")] = "en"
    """Language of the page."""
    as_json: JsonOption = False


@declared(PickCommand)
def command(options: PickCommand) -> None:
    """Open the page: orient two photos, pick points, relief, orthophoto, drawing.

    Starts from the file of a pair or a set, a survey workbook, photos, or the folder of a survey
    (default: the current one). More than two photos are oriented together once the first two are.
    The page runs on this computer alone and works offline; what is picked goes into the workbook
    and a journal beside it at once. Ctrl-C ends it.
    """
    from bifocal.collimation.workflow import page_server

    with page_server(
        *options.sources, workbook=options.workbook, port=options.port, language=options.language
    ) as server:
        files = server.session.files
        if files.photo_set is not None and files.pair is not None:
            remark(f"Of the set its best pair is opened: {files.pair.name}.")
        if options.as_json:
            print_json({"url": server.url, "token": server.token})
        else:
            click.echo(server.url)
            remark("Open this address in a browser on this computer; Ctrl-C ends the page.")
        if not options.no_browser:
            server.open_browser()
        server.serve()
