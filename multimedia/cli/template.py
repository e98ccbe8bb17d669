"""``multimedia template``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from photocore.cli import remark
from photocore.options import Argument, Typed, declared
from photocore.shared_options import OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ShiftTemplateCommand:
    """The options of ``multimedia template``, and examples.

    multimedia template tank.xlsx
    multimedia template oblique.xlsx --newton 10 --rows 200
    multimedia template vasca.xlsx --lang it
    """

    out: Annotated[Path, Argument(unit="OUT.xlsx")]
    rows: int = 50
    """Prepared rows of the table of points."""
    steps: Annotated[int, Typed(flag="--newton")] = 6
    """Newton steps: 6 reach 1e-9 up to 75 degrees in the thinnest medium, 10 up to 85."""
    language: Annotated[Literal["en", "it", "de"], Typed(flag="--lang --language")] = "en"
    """Language of labels and help."""
    overwrite: OverwriteOption = False


@declared(ShiftTemplateCommand)
def command(options: ShiftTemplateCommand) -> None:
    """Write a workbook that shifts points and gives the refractive index of water by itself.

    No macros, no circular references: Excel, LibreOffice and others calculate it.
    """
    from multimedia.workbook import write_template

    write_template(
        options.out,
        rows=options.rows,
        steps=options.steps,
        language=options.language,
        overwrite=options.overwrite,
    )
    remark(f"Workbook written to {options.out}")
