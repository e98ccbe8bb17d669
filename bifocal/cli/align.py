"""``bifocal align``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import click
from click.core import ParameterSource

from bifocal.options import ColumnsOption, SetUpOptions
from photocore.cli import print_result, progress_bar, remark
from photocore.option_types import TABLE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption

if TYPE_CHECKING:
    from bifocal.model import Diagnostics
    from bifocal.orientation import Alignment


@dataclass(frozen=True, kw_only=True)
class AlignCommand:
    """The options of ``bifocal align``, and examples.

    bifocal align far.jpg near.jpg --control points.csv --out wall.pair.json
    bifocal align far.jpg near.jpg --distance1 17.5 --distance2 9.5 --focal1 35 --focal2 19
                 --sensor-width 22.7 --out wall.pair.json
    bifocal align far.jpg near.jpg --as-set-up --distance1 17.5 --distance2 9.5 --focal1 35
                 --focal2 19 --sensor-width 22.7 --out wall.pair.json
    bifocal align far.jpg near.jpg --auto --distance1 17.5 --wall 612,433 --out wall.pair.json
    bifocal align reef_far.jpg reef_near.jpg --control reef.csv --indices 1,1.49,1.337
                 --thicknesses 0.01 --port 0.05 --prior index3=0.003 --out reef.pair.json
    bifocal align survey.xlsx --out wall.pair.json
    bifocal align far.jpg mid.jpg near.jpg --control set.csv --out wall.photos.json

    points.csv, one line per control point; r blank = on the wall; pixels in both photos:
      id,X [m],Y [m],r [m],col1 [px],row1 [px],col2 [px],row2 [px]
      P1,0.000,0.000,,512.3,1700.8,498.1,1741.0
    """

    far: Annotated[Path, Argument()]
    near: Annotated[Path | None, Argument()] = None
    more: Annotated[tuple[Path, ...], Argument()] = ()
    out: Path
    """Pair file to write (*.pair.json), of three photos and more a set (*.photos.json)."""
    control: Annotated[Path | None, Typed(TABLE)] = None
    """Table of control points: id, X, Y, r [m] and pixels."""
    columns: ColumnsOption = None
    set_up: SetUpOptions = field(default_factory=SetUpOptions)
    picture: Path | None = None
    """Picture of the set-up.  [default: beside OUT, .png]"""
    no_picture: bool = False
    """Do not draw the picture."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(AlignCommand)
def command(
    far: Path, near: Path | None, more: tuple[Path, ...], out: Path, overwrite: bool,
    as_json: bool, **given: Any,
) -> None:  # fmt: skip
    """Set up a pair: where both cameras stood, how they looked, at which scale.

    FAR is the photo taken from afar with the long lens, NEAR the other one. Four ways: control
    points measured on the wall (--control), distances measured on site (--distance1, --distance2),
    the same with the cameras square to the wall, taken as they are (--as-set-up), or the photos
    alone (--auto) and one distance or length. Photos taken through glass or water are set up by
    control points or as they are, with --indices and --port or --depth. FAR alone may be a survey
    workbook that states distances, focal lengths and nadirs: they are taken as they are.

    With MORE photos, or --out *.photos.json, all are set up together as a set. Their order is
    free: --distance1 is that of the first photo, --distance2 of the second; --lens and EXIF tell
    the others' lenses; the control table has columns col1, row1 to coln, rown, blank where a photo
    does not show the point.
    """
    from bifocal.workbook import is_workbook

    if is_workbook(far):
        _align_workbook(far, near, out, given["sigma_distance"], overwrite, as_json)
        return
    if near is None:
        raise click.UsageError("Give two photos, FAR and NEAR, or a survey workbook as FAR.")
    from bifocal.orientation import AlignOptions, align_photos, alignment_as_dict

    if more or out.name.lower().endswith(".photos.json"):
        _align_set((far, near, *more), out, given, overwrite, as_json)
        return
    picture = given.pop("picture")
    if given.pop("no_picture"):
        picture = None
    elif picture is None:
        picture = out.with_name(out.name.removesuffix(".json").removesuffix(".pair") + ".pair.png")
    options = AlignOptions.from_given(given)
    alignment = align_photos(far, near, out, options, picture=picture, overwrite=overwrite)
    notes = dict.fromkeys((*alignment.pair.remarks, *alignment.remarks))
    print_result(alignment_as_dict(alignment), _lines(alignment), as_json=as_json, remarks=notes)
    if not as_json:
        remark(f"Pair written to {out}" + (f", picture to {picture}" if picture else ""))


def _align_set(
    photos: tuple[Path, ...], out: Path, given: dict[str, Any], overwrite: bool, as_json: bool
) -> None:
    """Set photos up together."""
    from bifocal.networks import align_photo_set, set_as_dict
    from bifocal.orientation import AlignOptions

    if given["picture"] is not None:
        raise click.UsageError("--picture: is drawn of pairs; leave it out with a set of photos.")
    options = AlignOptions.from_given(given)
    with progress_bar("align", quiet=as_json) as progress:
        alignment = align_photo_set(photos, out, options, overwrite=overwrite, progress=progress)
    lines = (
        *alignment.words,
        *_taped(alignment.setup),
        *(f"Assumed: {text}." for text in alignment.setup["assumed"]),
    )
    print_result(set_as_dict(alignment), lines, as_json=as_json, remarks=alignment.remarks)
    if not as_json:
        remark(f"Set of {len(photos)} photos written to {out}")


#: Options that a workbook leaves room for.
WITH_WORKBOOK = ("far", "out", "as_set_up", "sigma_distance", "overwrite", "as_json")


def _align_workbook(
    book: Path, near: Path | None, out: Path, sigma: float, overwrite: bool, as_json: bool
) -> None:
    """Write the pair of a workbook's set-up as it is typed."""
    from bifocal.workbook import write_pair

    context = click.get_current_context()
    typed = [
        parameter.opts[0] if parameter.name != "near" else str(near)
        for parameter in context.command.params
        if parameter.name not in WITH_WORKBOOK
        and context.get_parameter_source(parameter.name or "") is ParameterSource.COMMANDLINE
    ]
    if typed:
        raise click.UsageError(
            f"{typed[0]}: {book.name} states the set-up, which is taken as it is typed. Leave "
            f"{typed[0]} out, or give both photos to register them."
        )
    pair = write_pair(book, out, sigma_distance=sigma, overwrite=overwrite)
    data = {
        "way": "as set up",
        "distance1": pair.d1,
        "distance2": pair.d2,
        "nadir1": pair.image1.nadir,
        "nadir2": pair.image2.nadir,
        "zoom_centre": pair.zoom_centre,
        "sigma_distance": sigma,
    }
    lines = (
        f"Set up exactly as {book.name} says, nothing registered: far camera {pair.d1:g} m, near "
        f"camera {pair.d2:g} m from the wall, both within {1000 * sigma:.0f} mm.",
    )
    print_result(data, lines, as_json=as_json, remarks=pair.remarks)
    if not as_json:
        remark(f"Pair written to {out}")


def _lines(alignment: Alignment) -> Iterator[str]:
    """Yield the set-up for people."""
    from bifocal.orientation import basis
    from bifocal.reports import wall_in_words

    yield from alignment.words
    ties = alignment.setup["common_points"]
    if ties["count"]:
        yield (
            f"{ties['count']} common points, {ties['on_wall']} of them on the wall, precise to "
            f"{ties['sigma_px']:.2f} px."
        )
    yield from _found(alignment)
    yield from _taped(alignment.setup)
    if alignment.control_ids:
        yield "Control point residuals [px]: far column, row; near column, row; test"
        for index, name in enumerate(alignment.control_ids):
            values = "  ".join(f"{value:7.2f}" for value in alignment.control_residuals[index])
            mark = "" if alignment.control_used[index] else "   LEFT OUT"
            yield f"  {name:>12}  {values}  {alignment.control_test[index]:6.1f}{mark}"
    yield basis(alignment)
    yield from wall_in_words(alignment.pair, language="en")
    for text in alignment.setup["assumed"]:
        yield f"Assumed: {text}."


def _taped(setup: Diagnostics) -> Iterator[str]:
    """Yield how the lengths that check agree, each in a line."""
    checks = setup.get("length_checks", ())
    if not checks:
        return
    off = [1000 * (one["measured"] - one["taped"]) for one in checks]
    within, agreeing = max(map(abs, off)), sum(one["agrees"] for one in checks)
    yield (
        f"{agreeing} of {len(checks)} taped lengths agree, the largest difference is "
        f"{within:.0f} mm."
    )
    yield "Length: taped, measured [m]; difference and its sigma [mm]"
    for one, difference in zip(checks, off, strict=True):
        mark = "" if one["agrees"] else "   DISAGREES"
        yield (
            f"  {one['name']:>6}  {one['taped']:8.3f}  {one['measured']:8.3f}  {difference:+7.1f}  "
            f"{1000 * one['sigma']:6.1f}{mark}"
        )


def _found(alignment: Alignment) -> Iterator[str]:
    """Yield the focal lengths found beside those given, and the wall's own relief by zone."""
    setup = alignment.setup
    if "focal_given_px" in setup:
        pairs = zip(setup["focal_px"], setup["focal_given_px"], strict=True)
        focals = ", ".join(
            f"{f:.1f} px (given {g:.1f}, {100 * (f / g - 1):+.2f} %)" for f, g in pairs
        )
        yield f"Focal lengths found: {focals}."
    zones = setup.get("wall_relief_mm") or []
    if zones:
        parts = "; ".join(f"{z['zone']} {z['median']:+.1f} ± {z['spread']:.1f}" for z in zones)
        yield f"Relief of the wall's own points by zone of the far photo [mm]: {parts}."
