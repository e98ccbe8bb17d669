"""``bifocal handover``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import print_result
from photocore.options import declared


@declared
def command(pair: Path, out: Path, overwrite: bool, as_json: bool, **given: Any) -> None:
    """Write one file for the client: photos, orthophoto, relief and points, to look at and measure.

    PAIR is a pair file. The page needs neither network nor program; distances and heights are
    measured on orthophoto and relief by two clicks.
    """
    from bifocal.reports.handover import HandoverTask, write_handover

    told = write_handover(pair, out, HandoverTask(**given), overwrite=overwrite)
    line = f"{out} written, {told['bytes'] / 1e6:.1f} MB."
    print_result(told, (line,), as_json=as_json, remarks=told["remarks"])
