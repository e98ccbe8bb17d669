"""``bifocal facade``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bifocal.options import ALIGN, CHECK, CONTROL, DRAWING, GSD, LANGUAGE, PICTURE, RELIEF, SCALE
from photocore.cli import print_result, progress_bar
from photocore.options import COG, FILE, Names, as_json, overwrite, takes

if TYPE_CHECKING:
    from bifocal.campaigns.pair_job import PairJob, PairOutcome

EXAMPLE = """\b
Examples:
  bifocal facade far.jpg near.jpg --control points.csv --scale 1:50 --out DIR
  bifocal facade far.jpg near.jpg --control points.csv --check check.csv --scale 1:20 --out wall
  bifocal facade far.jpg near.jpg --auto --distance1 17.5 --scale 1:100 --language de --out wall
  bifocal facade reef_far.jpg reef_near.jpg --control reef.csv --indices 1,1.49,1.337
                 --thicknesses 0.01 --port 0.05 --prior index3=0.003 --out reef
"""

#: What to look at first.
_TO_OPEN = ("report/*.html", "drawing/*.pdf", "points/*.xlsx", "relief/*.png", "ortho/*.tif")
_GSD = GSD.but(help="Pixel of the product ortho [m].  [default: that of the relief map]")
#: Those of its steps; the scale has a value here.
_OF_STEPS = dict.fromkeys((*ALIGN, *RELIEF, *PICTURE, _GSD, *DRAWING[1:]))


@click.command(epilog=EXAMPLE)
@click.argument("far", type=FILE)
@click.argument("near", type=FILE)
@click.option("--out", type=FILE, required=True, metavar="DIR", help="Folder of the results.")
@CONTROL
@CHECK
@SCALE.but(default="1:50", show_default=True)
@click.option("--name", default="", help="Title.  [default: the folder's name]")
@LANGUAGE
@takes(*(option.unset() for option in _OF_STEPS))
@click.option(
    "--products", type=Names(), metavar="NAME,NAME,...",
    help="Of relief, points, ortho, drawing, view, report.  [default: all but ortho, which the "
    "drawing has]",
)  # fmt: skip
@COG
@overwrite
@as_json
def command(
    far: Path, near: Path, out: Path, name: str, products: tuple[str, ...] | None, overwrite: bool,
    as_json: bool, **given: Any,
) -> None:  # fmt: skip
    """Make everything a façade needs from two photos and one table of control points.

    The pair is set up, the relief measured, the points solved, orthophoto and drawings made to
    scale, the relief shown in three dimensions, and a report written; each step into a folder of
    its own within DIR. Run it again, and only what changed is made anew; stopped, it goes on where
    it was.
    """
    from bifocal.campaigns.workflow import facade, facade_job

    job = facade_job(far, near, out, name=name, given=given, products=products, overwrite=overwrite)
    with progress_bar("facade", quiet=as_json) as progress:
        outcome = facade(job, progress=progress)
    print_result(outcome.to_dict(), _lines(job, outcome), as_json=as_json, remarks=outcome.remarks)


def _lines(job: PairJob, outcome: PairOutcome) -> list[str]:
    """Return what was made where, for people."""
    lines = []
    for step in (*outcome.kept, *outcome.done):
        names = sorted(path.name for path in (job.folder / step).iterdir() if path.name[0] != ".")
        kept = " (kept)" if step in outcome.kept else ""
        lines.append(f"{job.folder / step}{kept}: {', '.join(names)}")
    ready = [path for kind in _TO_OPEN for path in sorted(job.folder.glob(kind))]
    opened = f"; open {' and '.join(map(str, ready[:2]))} first" if ready else ""
    return [*lines, f"All of it is in {job.folder.resolve()}{opened}."]
