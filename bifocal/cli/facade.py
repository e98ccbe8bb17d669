"""``bifocal facade``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from bifocal.options import (
    CheckOption,
    ColumnsOption,
    ControlOption,
    DrawingOptions,
    FacesOption,
    GsdOption,
    LanguageOption,
    MapOptions,
    PictureOptions,
    ScaleOption,
    SetUpOptions,
    SurveyOptions,
)
from photocore.cli import print_result, progress_bar
from photocore.option_types import Names
from photocore.options import UNSET, Argument, Typed, declared
from photocore.shared_options import CogOption, JsonOption, OverwriteOption

if TYPE_CHECKING:
    from bifocal.campaigns import PairJob, PairOutcome

#: What to look at first.
_TO_OPEN = ("report/*.html", "drawing/*.pdf", "points/*.xlsx", "relief/*.png", "ortho/*.tif")


@dataclass(frozen=True, kw_only=True)
class FacadeCommand:
    """The options of ``bifocal facade``, and examples.

    bifocal facade far.jpg near.jpg --control points.csv --scale 1:50 --out DIR
    bifocal facade far.jpg near.jpg --control points.csv --check check.csv --scale 1:20 --out wall
    bifocal facade far.jpg near.jpg --auto --distance1 17.5 --scale 1:100 --language de --out wall
    bifocal facade far.jpg mid.jpg near.jpg --control set.csv --scale 1:50 --out porch
    bifocal facade reef_far.jpg reef_near.jpg --control reef.csv --indices 1,1.49,1.337
                   --thicknesses 0.01 --port 0.05 --prior index3=0.003 --out reef
    """

    far: Annotated[Path, Argument()]
    near: Annotated[Path, Argument()]
    more: Annotated[tuple[Path, ...], Argument()] = ()
    out: Annotated[Path, Typed(unit="DIR")]
    """Folder of the results."""
    control: ControlOption = None
    check: CheckOption = None
    columns: ColumnsOption = None
    scale: ScaleOption = 50.0
    name: str = ""
    """Title.  [default: the folder's name]"""
    language: LanguageOption = "en"
    set_up: Annotated[SetUpOptions, UNSET] = field(default_factory=SetUpOptions)
    faces: FacesOption = None
    map: Annotated[MapOptions, UNSET] = field(default_factory=MapOptions)
    picture: Annotated[PictureOptions, UNSET] = field(default_factory=PictureOptions)
    gsd: GsdOption = None
    """Pixel of the product ortho [m].  [default: that of the relief map]"""
    drawing: Annotated[DrawingOptions, UNSET] = field(default_factory=DrawingOptions)
    project: SurveyOptions = field(default_factory=SurveyOptions)
    products: Annotated[tuple[str, ...] | None, Typed(Names(), "NAME,NAME,...")] = None
    """Of relief, points, ortho, drawing, view, report.  [default: all but ortho, which the drawing
    has]"""
    cog: CogOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(FacadeCommand)
def command(
    far: Path, near: Path, more: tuple[Path, ...], out: Path, as_json: bool, **given: Any
) -> None:
    """Make everything a façade needs from its photos and one table of control points.

    The pair is set up, the relief measured, the points solved, orthophoto and drawings made to
    scale, the relief shown in three dimensions, and a report written; each step into a folder of
    its own within DIR. Run it again, and only what changed is made anew; stopped, it goes on where
    it was. Three photos and more are a set: see `bifocal align`.
    """
    from bifocal.campaigns import facade, facade_job

    naming = {name: given.pop(name) for name in ("name", "products", "overwrite")}
    job = facade_job(far, near, out, more=more, given=given, **naming)
    with progress_bar("facade", quiet=as_json) as progress:
        outcome = facade(job, progress=progress)
    print_result(outcome.to_dict(), _lines(job, outcome), as_json=as_json, remarks=outcome.remarks)


def _lines(job: PairJob, outcome: PairOutcome) -> list[str]:
    """Return what was made where, and how good it proved to be, for people."""
    from bifocal.campaigns import proven

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
