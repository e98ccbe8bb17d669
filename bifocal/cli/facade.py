"""``bifocal facade``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from photocore.cli import print_result, progress_bar
from photocore.options import declared

if TYPE_CHECKING:
    from bifocal.campaigns.pair_job import PairOutcome
    from bifocal.campaigns.pair_steps import PairJob

#: What to look at first.
_TO_OPEN = ("report/*.html", "drawing/*.pdf", "points/*.xlsx", "relief/*.png", "ortho/*.tif")


@declared
def command(
    far: Path, near: Path, more: tuple[Path, ...], out: Path, as_json: bool, **given: Any
) -> None:
    """Make everything a façade needs from its photos and one table of control points.

    The pair is set up, the relief measured, the points solved, orthophoto and drawings made to
    scale, the relief shown in three dimensions, and a report written; each step into a folder of
    its own within DIR. Run it again, and only what changed is made anew; stopped, it goes on where
    it was. Three photos and more are a set: see `bifocal align`.
    """
    from bifocal.campaigns.workflow import facade, facade_job

    own = {name: given.pop(name) for name in ("name", "products", "overwrite")}
    job = facade_job(far, near, out, more=more, given=given, **own)
    with progress_bar("facade", quiet=as_json) as progress:
        outcome = facade(job, progress=progress)
    print_result(outcome.to_dict(), _lines(job, outcome), as_json=as_json, remarks=outcome.remarks)


def _lines(job: PairJob, outcome: PairOutcome) -> list[str]:
    """Return what was made where, and how good it proved to be, for people."""
    from bifocal.campaigns.pair_steps import proven

    lines = []
    for step in (*outcome.kept, *outcome.done):
        names = sorted(path.name for path in (job.folder / step).iterdir() if path.name[0] != ".")
        kept = " (kept)" if step in outcome.kept else ""
        lines.append(f"{job.folder / step}{kept}: {', '.join(names)}")
    if {"points", "report"} & {*outcome.kept, *outcome.done}:
        lines += proven(job)
    ready = [path for kind in _TO_OPEN for path in sorted(job.folder.glob(kind))]
    opened = f"; open {' and '.join(map(str, ready[:2]))} first" if ready else ""
    return [*lines, f"All of it is in {job.folder.resolve()}{opened}."]
