"""``multimedia template``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import remark
from photocore.options import FILE, overwrite
from photocore.workbook.making.words import LANGUAGES

EXAMPLE = """\b
Examples:
  multimedia template tank.xlsx
  multimedia template oblique.xlsx --newton 10 --rows 200
  multimedia template vasca.xlsx --lang it
"""


@click.command(epilog=EXAMPLE)
@click.argument("out", metavar="OUT.xlsx", type=FILE)
@click.option(
    "--rows", type=int, default=50, show_default=True, help="Prepared rows of the table of points."
)
@click.option(
    "--newton", type=int, default=6, show_default=True,
    help="Newton steps: 6 reach 1e-9 up to 75 degrees in the thinnest medium, 10 up to 85.",
)  # fmt: skip
@click.option(
    "--lang", type=click.Choice(LANGUAGES), default="en", show_default=True,
    help="Language of labels and help.",
)  # fmt: skip
@overwrite
def command(out: Path, rows: int, newton: int, lang: str, overwrite: bool) -> None:
    """Write a workbook that shifts points and gives the refractive index of water by itself.

    No macros, no circular references: Excel, LibreOffice and others calculate it.
    """
    from multimedia.workbook.workflow import write_template

    write_template(out, rows=rows, steps=newton, language=lang, overwrite=overwrite)
    remark(f"Workbook written to {out}")
