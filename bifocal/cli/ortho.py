"""``bifocal ortho``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bifocal.options import DRAWING, OF_PAIR
from photocore.cli import print_result, progress_bar, remark
from photocore.options import declared

if TYPE_CHECKING:
    from bifocal.model.points import SurveyPoints


@declared
def command(
    pair: Path, out: Path | None, relief: Path | None, points: Path | None, plane: float | None,
    folder: Path | None, title: str, tfw: bool, overwrite: bool, as_json: bool, **given: Any,
) -> None:  # fmt: skip
    """Make the orthophoto of a wall from the photos of a PAIR file, set or survey workbook.

    Every pixel is taken from the original photo, moved by its own relief. Relief comes from a
    map, from measured points, or is none (--plane); by default from the points of the workbook,
    if PAIR is one: its set-up is then taken as typed. What the camera cannot see stays empty; the
    last band says where each pixel comes from (0 nothing, 1 and 2 the photos, 3 both, 4 filled,
    5 a photo on interpolated relief, 6 a photo on the plane, 7 seen by no photo). Of a set each
    pixel is taken from the photo that sees it best: 11 is its first photo, 12 the second, 3 a
    transition.
    """
    from bifocal.faces.faces_files import faces_path, keep_faces
    from bifocal.orthophotos.deliver_workflow import DeliverTask, default_title, deliver
    from bifocal.orthophotos.ortho_workflow import OrthoTask, basis_in_words, make_ortho
    from bifocal.workbook.pair_workflow import is_workbook, points_of, read_photos

    if out is None and folder is None:
        raise click.UsageError("Give --out FILE, --deliver DIR or both.")
    drawing = {name: given.pop(name) for name in (*DRAWING, "control", "language")}
    scale = drawing["scale"]
    if folder is not None and scale is None:
        raise click.UsageError("--deliver needs the scale of the drawing, e.g. --scale 1:50.")
    if sum(choice is not None for choice in (relief, points, plane)) > 1:
        raise click.UsageError("Give one of --relief, --points and --plane.")
    source = read_photos(pair)
    drawn = given["faces"]
    given["faces"] = faces_path(drawn, pair)
    own: Path | SurveyPoints | None = points
    if relief is None and points is None and plane is None and is_workbook(pair):
        own = points_of(pair)
    breaklines = [line.split(",") for line in given.pop("breaklines")]
    if breaklines and own is None:
        raise click.UsageError("--breakline joins measured points; give their table by --points.")
    for name in (*DRAWING[4:], "control"):
        by_default = drawing[name] == OF_PAIR[name].attributes.get("default")
        if drawing[name] and not by_default and folder is None:
            flag = OF_PAIR[name].flag
            raise click.UsageError(f"{flag} is drawn into a folder; give --deliver DIR.")
    if relief is None and own is None and plane is None:
        remark("No relief given: the wall is taken as flat (as with --plane).")
    task = OrthoTask.from_given(
        given, relief=relief, points=own, breaklines=breaklines, plane=plane or 0.0, scale=scale
    )
    files: dict[str, object] = {}
    with progress_bar("orthophoto", quiet=as_json) as progress:
        if folder is not None and scale is not None:
            wish = DeliverTask(title=title or default_title(source, pair), **drawing)
            done = deliver(
                source, folder, task, wish, out=out, overwrite=overwrite, progress=progress
            )
            result = done.ortho
            files = {"folder": str(folder), "files": list(done.files), "sheet": done.sheet}
        else:
            result = make_ortho(
                source, out or Path("ortho.tif"), task, overwrite=overwrite, world_file=tfw,
                progress=progress,
            )  # fmt: skip
    grid, shares = result.grid, result.shares
    remarks = (*result.remarks, *keep_faces(drawn, pair))
    lines = [
        f"{result.path}: {grid.width} x {grid.height} px of {grid.gsd * 1000:g} mm; "
        f"{100 * (1 - shares['none']):.1f} % covered, {100 * shares['hidden']:.1f} % hidden"
    ]
    if told := basis_in_words(result.basis):
        lines.append(f"Of the picture {told}")
    if files:
        lines.append(f"{folder}: {', '.join(done.files)} (sheet {done.sheet})")
    print_result(result.to_dict() | files, lines, as_json=as_json, remarks=remarks)
