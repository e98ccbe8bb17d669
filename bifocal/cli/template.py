"""``bifocal template``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import remark
from photocore.options import FILE, overwrite
from photocore.workbook.making.words import LANGUAGES

EXAMPLE = """\b
Examples:
  bifocal template survey.xlsx
  bifocal template rilievo.xlsx --lang it
  bifocal template large.xlsx --rows 1500
  bifocal template tank.xlsx --media 3
"""


@click.command(epilog=EXAMPLE)
@click.argument("out", type=FILE, metavar="OUT.xlsx")
@click.option(
    "--lang", "language", type=click.Choice(LANGUAGES), default="en", show_default=True,
    help="Language of labels and help.",
)  # fmt: skip
@click.option(
    "--rows", type=int, default=300, show_default=True, metavar="N",
    help="Rows prepared for points.",
)  # fmt: skip
@click.option(
    "--media", type=int, metavar="N",
    help="Media between camera and wall that Setup gets cells for: 2 for a water surface, 3 for "
    "air, glass and water; up to 6. By default none: photos in air.",
)  # fmt: skip
@overwrite
def command(out: Path, language: str, rows: int, media: int | None, overwrite: bool) -> None:
    """Write an empty survey workbook: type what you measured, relief appears beside it.

    Every result is a live formula; the workbook needs neither this program nor macros.
    """
    from bifocal.workbook.template_workflow import write_template

    write_template(out, language=language, rows=rows, media=media, overwrite=overwrite)
    remark(f"{out}: fill in Setup and Points; then: bifocal solve {out} --out result.xlsx")
