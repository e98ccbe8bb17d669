"""``bifocal adjust``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from bifocal.options import JointOptions
from photocore.cli import print_result, progress_bar, tell_written
from photocore.options import Argument, Typed, declared
from photocore.shared_options import ChangedPhotosOption, JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class AdjustCommand:
    """The options of ``bifocal adjust``, and examples.

    bifocal adjust left.pair.json right.pair.json --control left.csv --control right.csv --out joint
    bifocal adjust a.pair.json b.pair.json c.pair.json --control a.csv --control none
                   --control c.csv --out joint
    """

    pairs: Annotated[tuple[Path, ...], Argument(unit="PAIR.pair.json...")]
    out: Annotated[Path, Typed(unit="DIR")]
    """Folder of the adjusted pairs."""
    control: tuple[Path, ...] = ()
    """Table of control points of a pair, as for `bifocal align`, or none; repeat it, one for each
    PAIR. Points of one name are one point."""
    check: tuple[Path, ...] = ()
    """The same for independent check points: they are compared, and hold nothing."""
    joint: JointOptions = field(default_factory=JointOptions)
    changed_photos: ChangedPhotosOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(AdjustCommand)
def command(
    pairs: tuple[Path, ...], out: Path, overwrite: bool, as_json: bool, **options: Any
) -> None:
    """Adjust all pairs of one facade in one frame.

    Points that the photos share are found by themselves; with the control points of all pairs
    they give one least-squares adjustment of all cameras. DIR gets a pair file of the same name
    for each PAIR, and points.csv with coordinates, precision and misfits. What contradicts the
    rest takes no part and is named. Fewer than three control points: the first pair is held.
    """
    from bifocal.networks import JointTask, adjust_pairs

    tables = {role: _tables(options[role]) for role in ("control", "check")}
    task = JointTask(**{**options, **tables, "unit": options["unit"] or ""})
    with progress_bar("adjust", quiet=as_json) as progress:
        result = adjust_pairs(pairs, out, task, overwrite=overwrite, progress=progress)
    print_result(result.to_dict(), result.lines(), as_json=as_json)
    tell_written(*(out / path.name for path in pairs), out / "points.csv")


def _tables(paths: tuple[Path, ...]) -> tuple[Path | None, ...]:
    """Return tables, None for ``none``."""
    return tuple(None if str(path).lower() == "none" else path for path in paths)
