"""``multimedia template``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import remark
from photocore.options import declared


@declared
def command(out: Path, **options: Any) -> None:
    """Write a workbook that shifts points and gives the refractive index of water by itself.

    No macros, no circular references: Excel, LibreOffice and others calculate it.
    """
    from multimedia.workbook.workflow import write_template

    write_template(out, **options)
    remark(f"Workbook written to {out}")
