"""A pair of a survey, and the steps that its options ask for.

A step imports the workflow it calls when it is made: a run that keeps everything loads none.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bifocal.campaigns.pair_points import checked_points, points_to_draw, solved_points
from bifocal.campaigns.step_store import Step, read_record
from bifocal.campaigns.surveyed_pair import FIRST_STEP, SCALE, PairJob, tables_of
from bifocal.options import DRAWING, FILES, MAP, OF_PAIR, OF_STEP, PICTURE, PROJECT, SET_UP, typed
from photocore.cli import Progress
from photocore.errors import InputError

if TYPE_CHECKING:
    from bifocal.orthophotos import OrthoTask


def steps_of(job: PairJob) -> list[Step]:
    """Return the steps that make the products of a pair, in order."""
    products = set(job.products)
    steps = [_align_step(job)]
    if products & {"relief", "ortho", "drawing", "view"}:
        steps.append(_relief_step(job))
    if "points" in products and {"control", "check"} & set(job.files):
        steps.append(_points_step(job))
    if "ortho" in products:
        steps.append(_ortho_step(job))
    if "drawing" in products:
        steps.append(_drawing_step(job, tuple(step.name for step in steps)))
    if "view" in products:
        steps.append(_view_step(job, tuple(step.name for step in steps)))
    steps = [replace(step, command=_command(job, step)) for step in steps]
    if "report" in products:
        report = _report_step(job, tuple(steps))
        steps.append(replace(report, command=_command(job, report)))
    return steps


def _command(job: PairJob, step: Step) -> str:
    """Return what the user typed of which a step knows, without where its files lie.

    Not more: a file would else tell of options that were changed after it was made.
    """
    if step.name in job.told:
        return job.told[step.name].command
    photos = _named(job)
    keys_of_step = OF_STEP[step.name]
    everything = {**job.files, **job.options}
    settings = {
        key: everything[key] for key in OF_PAIR if key in keys_of_step and key in everything
    }
    if job.way == "facade":
        return " ".join(["bifocal facade", *(p.name for p in photos.values()), *typed(settings)])
    keys = [f'{role} = "{path.name}"' for role, path in photos.items()]
    if job.more:
        keys = [f"photos = {[path.name for path in job.photos]}"]
    keys += [*typed(settings, in_file=True), *(["joint = true"] if job.joint else [])]
    return f"bifocal survey, pair {job.name}: {', '.join(keys)}"


def refusal(job: PairJob) -> str:
    """Return why a pair cannot be aligned as it is described; empty where nothing is missing."""
    from bifocal.networks import way_of_set
    from bifocal.orientation import AlignOptions, check_way

    step, check = _align_step(job), way_of_set if job.more else check_way
    try:
        check(AlignOptions.from_given({**step.options, **_align_files(job)}))
    except InputError as error:
        return str(error)
    return ""


def _align_files(job: PairJob) -> dict[str, Path]:
    return {role: path for role, path in job.files.items() if role in ("control", *SET_UP)}


def _align_step(job: PairJob) -> Step:
    files = _align_files(job)
    options = job.options_of("columns", *SET_UP)

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orientation import AlignOptions, align_photos

        out = place / job.product("align").name
        align_options = AlignOptions.from_given({**options, **files})
        if job.more:
            from bifocal.networks import align_photo_set

            return align_photo_set(job.photos, out, align_options, progress=progress).remarks
        picture = out.with_suffix("").with_suffix(".pair.png")
        alignment = align_photos(job.far, job.near, out, align_options, picture=picture)
        return tuple(dict.fromkeys((*alignment.pair.remarks, *alignment.remarks)))

    return Step(name=FIRST_STEP, files={**_named(job), **files}, options=options, make=make)


def _named(job: PairJob) -> dict[str, Path]:
    """Return the photos by their part in it."""
    others = {f"photo {number}": path for number, path in enumerate(job.more, start=3)}
    return {"far": job.far, "near": job.near, **others}


def photo_roles(roles: Iterable[str]) -> list[str]:
    """Return those that are photos of the pair or set."""
    return [role for role in roles if role in ("far", "near") or role.startswith("photo ")]


def _photos(job: PairJob) -> dict[str, Path]:
    """Return what a step after the alignment looks at: the photos, the pair file of all pairs."""
    joint = {} if job.joint is None else {"pair": job.pair_path}
    return {**_named(job), **joint}


def _faces(job: PairJob) -> dict[str, Path]:
    return {"faces": job.files["faces"]} if "faces" in job.files else {}


def _relief_step(job: PairJob) -> Step:
    options = job.options_of(*MAP, "cog")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair

        out = place / job.product("relief").name
        cloud = out.with_suffix(f".{options['cloud']}") if "cloud" in options else None
        task = ReliefJob(
            out=out, cloud=cloud, preview=out.with_suffix(".png"), gsd=options.get("relief_gsd"),
            faces=job.files.get("faces"),
            **job.options_of(*(name for name in MAP if name not in ("relief_gsd", "cloud"))),
        )  # fmt: skip
        _, remarks = relief_of_pair(job.pair_path, task, progress=progress)
        return remarks

    files = {**_photos(job), **_faces(job)}
    return Step(name="relief", files=files, after=("align",), options=options, make=make)


def _points_step(job: PairJob) -> Step:
    options = job.options_of("language", "unit", "columns")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:  # noqa: ARG001
        from bifocal.workbook import write_result

        solution = solved_points(job, tables_of(job), options)
        write_result(place / f"{job.title}_points.xlsx", solution)
        return solution.remarks

    joint = {} if job.joint is None else {"pair": job.pair_path}
    return Step(
        name="points",
        files={**tables_of(job), **joint},
        after=("align",),
        options=options,
        make=make,
    )


def _ortho_task(job: PairJob, options: Mapping[str, Any]) -> OrthoTask:
    from bifocal.orthophotos import OrthoTask

    return OrthoTask.from_given(
        {key: options[key] for key in (*PICTURE, "gsd") if key in options},
        relief=job.product("relief"), faces=job.files.get("faces"),
    )  # fmt: skip


def _ortho_step(job: PairJob) -> Step:
    options = job.options_of(*PICTURE, "gsd", "cog")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos import make_ortho

        out = place / job.product("ortho").name
        task = _ortho_task(job, options)
        return make_ortho(job.pair_path, out, task, progress=progress).remarks

    files = {**_photos(job), **_faces(job)}
    return Step(name="ortho", files=files, after=("align", "relief"), options=options, make=make)


def _drawing_step(job: PairJob, earlier: tuple[str, ...]) -> Step:
    options = {"scale": SCALE} | job.options_of("columns", *DRAWING, *PICTURE, "language", "cog")
    tables = {role: job.files[role] for role in ("control", "check", "mark") if role in job.files}

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos import DeliverTask, deliver
        from bifocal.reports import wall_in_words

        drawing = {key: options[key] for key in (*DRAWING, "language") if key in options}
        wish = DeliverTask(
            title=job.name, **drawing, mark=job.files.get("mark"),
            cad=points_to_draw(job, solved="points" in earlier),
            checked=checked_points(job) if "points" in earlier else None,
            expected=partial(wall_in_words, language=drawing.get("language", "en")),
        )  # fmt: skip
        task = _ortho_task(job, options)
        return deliver(job.pair_path, place, task, wish, progress=progress).ortho.remarks

    return Step(
        name="drawing", files={**_photos(job), **_faces(job), **tables},
        after=tuple(name for name in ("align", "relief", "points") if name in earlier),
        options=options, make=make,
    )  # fmt: skip


def _view_step(job: PairJob, earlier: tuple[str, ...]) -> Step:
    options = {"title": job.name} | job.options_of("language")
    ortho = job.ortho_path(earlier)

    def make(place: Path, progress: Progress) -> tuple[str, ...]:  # noqa: ARG001
        from bifocal.reports import view_relief

        view_relief(job.product("relief"), place / job.product("view").name, ortho=ortho, **options)
        return ()

    after = ("relief",) if ortho is None else ("relief", ortho.parent.name)
    return Step(name="view", files={}, after=after, options=options, make=make)


def _report_step(job: PairJob, before: tuple[Step, ...]) -> Step:
    earlier = tuple(step.name for step in before)
    options: dict[str, Any] = {"title": job.name, "times": job.way == "facade"}
    options |= job.options_of("language", "unit", "columns", "scale", *PROJECT)
    if "drawing" in earlier:
        options.setdefault("scale", SCALE)

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.reports import ReportTask, StepTold, write_report

        records = {name: job.told.get(name) or read_record(job.folder / name) for name in earlier}
        if not options["times"]:
            records = {}
        steps = tuple(
            StepTold.of(step.name, {**step.options, **_tables(step)}, records.get(step.name))
            for step in before
        )
        settings = {key: options[key] for key in ReportTask.PLAIN if key in options} | tables_of(
            job
        )
        task = ReportTask(
            **settings, far=job.far, steps=steps,
            project={name: options[name] for name in PROJECT if name in options},
            relief=job.product("relief") if "relief" in earlier else None,
            ortho=job.ortho_path(earlier), view=job.product("view") if "view" in earlier else None,
        )  # fmt: skip
        outs = (place / f"{job.title}_report.html", place / f"{job.title}_report.pdf")
        return write_report([job.pair_path], outs, [task], progress=progress)

    files = {**_photos(job), **tables_of(job)}
    return Step(name="report", files=files, after=earlier, options=options, make=make)


def _tables(step: Step) -> dict[str, Path]:
    """Return the files of a step besides photos and pair files."""
    return {role: path for role, path in step.files.items() if role in FILES}
