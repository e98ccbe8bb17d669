"""``bifocal template``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import remark
from photocore.options import declared


@declared
def command(out: Path, **options: Any) -> None:
    """Write an empty survey workbook: type what you measured, relief appears beside it.

    Every result is a live formula; the workbook needs neither this program nor macros.
    """
    from bifocal.workbook.template_workflow import write_template

    write_template(out, **options)
    remark(f"{out}: fill in Setup and Points; then: bifocal solve {out} --out result.xlsx")
