"""``bifocal survey``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import click

from photocore.cli import print_json, print_result, progress_bar, remark, tell_written, text_table
from photocore.option_types import POSITIVE, Number
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class SurveyCommand:
    """The options of ``bifocal survey``, and examples.

    bifocal survey --init photos street.toml
    bifocal survey street.toml --dry-run
    bifocal survey street.toml --jobs 4 --memory 12
    bifocal survey street.toml --scheduler tcp://192.168.0.10:8786
    """

    survey: Annotated[Path | None, Argument()] = None
    folder: Annotated[Path | None, Typed(unit="DIR", flag="--init")] = None
    """Write SURVEY from a folder of photos.  [default: survey.toml in it]"""
    dry_run: bool = False
    """Show what would be made and what is kept."""
    out: Annotated[Path | None, Typed(unit="DIR")] = None
    """Folder of the results.  [default: the file's]"""
    jobs: Annotated[int | None, Typed(Number(least=1, whole=True), "N")] = None
    """Pairs at once.  [default: cores]"""
    memory: Annotated[float | None, Typed(POSITIVE, "GIB")] = None
    """For all pairs at work.  [default: 80 % of what is free]"""
    scheduler: Annotated[str, Typed(unit="tcp://...")] = ""
    """Address of a Dask scheduler."""
    ship: bool = False
    """Send photos to its workers and products back.  [default: only where a worker does not see the
    folders]"""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(SurveyCommand)
def command(
    survey: Path | None, folder: Path | None, dry_run: bool, as_json: bool, **machines: Any
) -> None:
    """Survey many pairs: alignment, relief, points, drawings and report of each.

    SURVEY is a TOML file that names the pairs, their control and what is wanted of them. Only
    what changed is made anew; stopped or killed at any moment, it goes on where it was. A pair
    that fails stops no other; a table at the end says what failed and how to mend it.
    """
    from bifocal.campaigns import (
        Machines,
        begin_survey,
        in_survey_words,
        mosaic_wanted,
        pairs_in_words,
        plan_survey,
        read_survey_file,
        run_survey,
    )

    out, overwrite = machines.pop("out"), machines.pop("overwrite")
    if folder is not None:
        survey = survey or folder / "survey.toml"
        with progress_bar("photos", quiet=as_json) as progress:
            count, photos_left = begin_survey(
                survey, folder, overwrite=overwrite, progress=progress
            )
        tell_written(survey)
        lines = [
            f"{pairs_in_words(count)}; {photos_left} of the photos in none.",
            f"Say in {survey} how each is controlled, then: bifocal survey {survey} --dry-run",
        ]
        data = {"survey": str(survey), "pairs": count, "left": photos_left}
        print_result(data, lines, as_json=as_json)
        return
    if survey is None:
        raise click.UsageError("name the survey file, or --init DIR with a folder of photos.")
    pairs = read_survey_file(survey, out=out, overwrite=overwrite)
    if dry_run:
        plan = [
            (pair, step, in_survey_words(what))
            for pair, step, what in plan_survey(pairs, mosaic=mosaic_wanted(survey))
        ]
        if as_json:
            print_json(
                {"plan": [dict(zip(("pair", "step", "what"), row, strict=True)) for row in plan]}
            )
        else:
            short = [(*row[:2], row[2] if row[2] in ("keep", "make") else "cannot") for row in plan]
            click.echo(text_table(["pair", "step", "what"], short))
            for (pair, step, why), (*_, what) in zip(plan, short, strict=True):
                if what == "cannot":
                    click.echo(f"\n{pair}, {step}:\n  {why}")
        if any(what not in ("keep", "make") for *_, what in plan):
            raise click.exceptions.Exit(1)  # as the work would end
        return
    if machines["ship"] and not machines["scheduler"]:
        raise click.UsageError("--ship goes with --scheduler.")
    with progress_bar("survey", quiet=as_json) as progress:
        result = run_survey(
            pairs, progress=progress, tell=remark, machines=Machines(**machines),
            mosaic=mosaic_wanted(survey),
        )  # fmt: skip
    result = result.in_words(in_survey_words)
    print_result(result.to_dict(), result.lines(), as_json=as_json)
    if result.failed:
        raise click.exceptions.Exit(1)
