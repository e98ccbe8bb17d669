"""``bifocal adjust``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from photocore.cli import print_result, progress_bar, tell_written
from photocore.options import declared


@declared
def command(
    pairs: tuple[Path, ...], out: Path, overwrite: bool, as_json: bool, **options: Any
) -> None:
    """Adjust all pairs of one facade in one frame.

    Points that the photos share are found by themselves; with the control points of all pairs
    they give one least-squares adjustment of all cameras. DIR gets a pair file of the same name
    for each PAIR, and points.csv with coordinates, precision and misfits. What contradicts the
    rest takes no part and is named. Fewer than three control points: the first pair is held.
    """
    from bifocal.networks.joint_workflow import JointTask, adjust_pairs

    tables = {role: _tables(options[role]) for role in ("control", "check")}
    task = JointTask(**{**options, **tables, "unit": options["unit"] or ""})
    with progress_bar("adjust", quiet=as_json) as progress:
        result = adjust_pairs(pairs, out, task, overwrite=overwrite, progress=progress)
    print_result(result.to_dict(), result.lines(), as_json=as_json)
    tell_written(*(out / path.name for path in pairs), out / "points.csv")


def _tables(paths: tuple[Path, ...]) -> tuple[Path | None, ...]:
    """Return tables, None for ``none``."""
    return tuple(None if str(path).lower() == "none" else path for path in paths)
