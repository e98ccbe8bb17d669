"""``bifocal template``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from bifocal.options import LanguageOption
from photocore.cli import remark
from photocore.options import Argument, Typed, declared
from photocore.shared_options import OverwriteOption


@dataclass(frozen=True, kw_only=True)
class TemplateCommand:
    """The options of ``bifocal template``, and examples.

    bifocal template survey.xlsx
    bifocal template rilievo.xlsx --lang it
    bifocal template large.xlsx --rows 1500
    bifocal template tank.xlsx --media 3
    bifocal template raw.xlsx --lens
    bifocal template functions.xlsx --functions
    bifocal template numbers.xlsx --plain
    bifocal template two-pairs.xlsx --photos 3
    bifocal template trial.xlsx --what-if
    """

    out: Annotated[Path, Argument(unit="OUT.xlsx")]
    language: Annotated[LanguageOption, Typed(flag="--lang --language")] = "en"
    """Language of labels and help."""
    rows: Annotated[int, Typed(unit="N")] = 300
    """Rows prepared for points."""
    media: Annotated[int | None, Typed(unit="N")] = None
    """Media between camera and wall that Setup gets cells for: 2 for a water surface, 3 for air,
    glass and water; up to 6. By default none: photos in air."""
    lens: bool = False
    """Cells in Setup for the distortion of each lens (k1, k2, principal point), which the formulas
    take out of raw x1 y1 x2 y2."""
    photos: Annotated[int, Typed(unit="N")] = 2
    """Photos of which Points has columns: with 3 to 6, x3 y3 ... stand beside those of the pair,
    and the sheet Compare has relief by photos 1 and 2, 1 and 3 ... and by all together."""
    what_if: bool = False
    """Add the sheet WhatIf: type changes of d_1, d_2, c_1, c_2 and pitch, and see what becomes of
    every relief and which of them matters most."""
    functions: bool = False
    """Add the formulas as functions with names, =RELIEF(s_far, s_near, d_far, d_near) and seven
    more, and a sheet that explains each. For Excel 365 or 2024; the columns work everywhere."""
    plain: bool = False
    """Formulas with A1 references only, no tables and cells by name: for Google Sheets and
    Numbers."""
    overwrite: OverwriteOption = False


@declared(TemplateCommand)
def command(options: TemplateCommand) -> None:
    """Write an empty survey workbook: type what you measured, relief appears beside it.

    Every result is a live formula; the workbook needs neither this program nor macros.
    """
    from bifocal.workbook import write_template

    write_template(
        options.out,
        language=options.language,
        rows=options.rows,
        media=options.media,
        lens=options.lens,
        photos=options.photos,
        what_if=options.what_if,
        functions=options.functions,
        plain=options.plain,
        overwrite=options.overwrite,
    )
    remark(
        f"{options.out}: fill in Setup and Points; then: bifocal solve {options.out} "
        "--out result.xlsx"
    )
