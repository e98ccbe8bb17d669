"""``bifocal survey``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.cli import print_json, print_result, progress_bar, remark, tell_written, text_table
from photocore.options import declared


@declared
def command(
    survey: Path | None, folder: Path | None, dry_run: bool, as_json: bool, **machines: Any
) -> None:
    """Survey many pairs: alignment, relief, points, drawings and report of each.

    SURVEY is a TOML file that names the pairs, their control and what is wanted of them. Only
    what changed is made anew; stopped or killed at any moment, it goes on where it was. A pair
    that fails stops no other; a table at the end says what failed and how to mend it.
    """
    from bifocal.campaigns.survey_file import in_survey_words, mosaic_wanted, read_survey_file
    from bifocal.campaigns.workflow import (
        Machines,
        begin_survey,
        pairs_in_words,
        plan_survey,
        run_survey,
    )

    out, overwrite = machines.pop("out"), machines.pop("overwrite")
    if folder is not None:
        survey = survey or folder / "survey.toml"
        with progress_bar("photos", quiet=as_json) as progress:
            found, left = begin_survey(survey, folder, overwrite=overwrite, progress=progress)
        tell_written(survey)
        lines = [
            f"{pairs_in_words(found)}; {left} of the photos in none.",
            f"Say in {survey} how each is controlled, then: bifocal survey {survey} --dry-run",
        ]
        data = {"survey": str(survey), "pairs": found, "left": left}
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
    given: dict[str, Any] = {"machines": Machines(**machines), "mosaic": mosaic_wanted(survey)}
    with progress_bar("survey", quiet=as_json) as progress:
        result = run_survey(pairs, progress=progress, tell=remark, **given)
    result = result.in_words(in_survey_words)
    print_result(result.to_dict(), result.lines(), as_json=as_json)
    if result.failed:
        raise click.exceptions.Exit(1)
