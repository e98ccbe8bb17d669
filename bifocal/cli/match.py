"""``bifocal match``."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import click

from photocore.cli import print_result, remark
from photocore.option_types import NEW_TABLE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import ChangedPhotosOption, JsonOption, OverwriteOption

if TYPE_CHECKING:
    from bifocal.workbook import MatchSummary, SetSummary


@dataclass(frozen=True, kw_only=True)
class MatchCommand:
    """The options of ``bifocal match``, and examples.

    bifocal match wall.pair.json --out survey.xlsx
    bifocal match survey.xlsx --out matched.xlsx
    bifocal match wall.pair.json --count 2000 --out points.csv
    bifocal match wall.pair.json --what targets --out targets.xlsx
    bifocal match porch.photos.json --out porch.csv

    Then:
      bifocal solve survey.xlsx --out result.xlsx
      bifocal solve points.csv --pair wall.pair.json --json
    """

    pair: Annotated[Path, Argument()]
    out: Annotated[Path, Typed(NEW_TABLE)]
    """Survey workbook (.xlsx) or table (.csv) to write; - is a table on stdout."""
    count: Annotated[int, Typed(click.IntRange(min=1, max=100000))] = 4000
    """About so many feature points, spread evenly."""
    what: Literal["all", "features", "targets"] = "all"
    """Natural detail, survey targets, or both."""
    relief_min: Annotated[float | None, Typed(unit="M")] = None
    """Lowest relief looked for [m].  [default: -0.5 x near distance]"""
    relief_max: Annotated[float | None, Typed(unit="M")] = None
    """Highest relief looked for [m].  [default: 0.4 x near distance]"""
    language: Annotated[Literal["en", "it", "de"], Typed(flag="--lang --language")] = "en"
    """Language of the workbook."""
    changed_photos: ChangedPhotosOption = False
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(MatchCommand)
def command(options: MatchCommand) -> None:
    """Find the same details of the wall in both photos of PAIR, a pair file or survey workbook.

    Of a set of photos (.photos.json) those of its best pair are found in all others too.

    Discs, chequers and coded markers are found and measured by their centres; natural detail is
    matched along the radial lines. Every point is checked by how far off its line it fits.
    """
    from bifocal.matching import MatchSettings
    from bifocal.workbook import (
        is_workbook,
        match_photos,
        match_set_file,
        match_summary,
        read_pair,
        set_or_pair,
    )

    low, high = options.relief_min, options.relief_max
    if low is not None and high is not None and low >= high:
        raise click.UsageError("--relief-min must be below --relief-max.")
    photos, _ = set_or_pair(options.pair)
    source = read_pair(options.pair) if photos is None else photos.best_pair()
    reliefs = None
    if low is not None or high is not None:
        near = source.image2.distance
        reliefs = (-0.5 * near if low is None else low, 0.4 * near if high is None else high)
    settings = MatchSettings(
        count=options.count,
        relief_range=reliefs,
        features=options.what != "targets",
        targets=options.what != "features",
    )
    if photos is not None:
        facts = match_set_file(photos, options.out, settings, overwrite=options.overwrite)
        shown = _set_lines(facts)
        print_result(
            {**facts, "out": options.out}, shown, as_json=options.as_json, remarks=photos.remarks
        )
        return
    matches = match_photos(
        source if is_workbook(options.pair) else options.pair,
        options.out,
        settings,
        language=options.language,
        overwrite=options.overwrite,
    )
    summary = match_summary(*matches)
    notes = (*matches[0].remarks, *_remarks(summary["kinds"], options.what))
    print_result(
        {**summary, "out": options.out}, _lines(summary), as_json=options.as_json, remarks=notes
    )
    if not options.as_json:
        remark(f"Points written to {options.out}")


def _remarks(kinds: dict[str, int], what: str) -> Iterator[str]:
    """Yield what the user should look at."""
    if kinds.get("chequer"):
        yield (
            f"{kinds['chequer']} chequers: crossing joints and corners of stones can look like "
            "them; check those of code chequer, or leave them out."
        )
    if what == "targets":
        yield (
            "Only targets found in both photos are listed: discs 5 to 120 px across on a plate of "
            "one grey, two-by-two chequers, coded markers. Pick the others by hand."
        )


def _set_lines(summary: SetSummary) -> Iterator[str]:
    """Yield what was found in a set."""
    picks = ", ".join(f"{name} {number}" for name, number in summary["photos"].items())
    low, high = summary["relief_range"]
    yield f"{summary['count']} points, {summary['in_three']} in three photos or more ({picks})."
    yield (
        f"Relief from {low:.2f} to {high:.2f} m, sigma of r {1000 * summary['sigma_r_median']:.1f} "
        f"mm at the median; picks of {summary['sigma_px']:.2f} px."
    )


def _lines(summary: MatchSummary) -> Iterator[str]:
    """Yield what was found."""
    kinds = ", ".join(f"{number} {kind}" for kind, number in summary["kinds"].items())
    low, high = summary["relief_range"]
    yield f"{summary['count']} points ({kinds})."
    yield (
        f"Precision {summary['sigma_px']:.2f} px along the radial lines, misfit across them "
        f"{summary['misfit_px']:.2f} px."
    )
    yield (
        f"Relief from {low:.2f} to {high:.2f} m, sigma of r {1000 * summary['sigma_r_median']:.1f} "
        "mm at the median."
    )
    yield summary["rests_on"]
    if summary["empty"]:
        yield _empty_in_words(summary)


def _empty_in_words(summary: MatchSummary) -> str:
    """Return in which parts of the far photo there are no points, or hardly any."""
    parts, least = summary["empty"], summary["fewest_in_part"]
    named = "; ".join(
        f"columns {c[0]}-{c[1]}, rows {r[0]}-{r[1]}"
        for c, r in ((part["columns"], part["rows"]) for part in parts[:8])
    )
    more = f" and {len(parts) - 8} more" if len(parts) > 8 else ""
    where = f"{len(parts)} of 24 parts of the far photo, seen by both: {named}{more}"
    if "feature" not in summary["kinds"]:
        return f"No target in {where}."
    what = "NOTHING FOUND" if least == 1 else f"FEWER THAN {least} POINTS"
    return f"{what} in {where} (no texture, or hidden)."
