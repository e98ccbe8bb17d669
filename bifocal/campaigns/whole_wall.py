"""What is made of all pairs of a survey together: one frame before, one orthophoto behind."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from bifocal.campaigns.pair_job import (
    PairJob,
    PairOutcome,
    failure_message,
    tables_of,
)
from bifocal.campaigns.step_store import (
    Step,
    clean,
    is_current,
    read_record,
    run_step,
    step_key,
)
from bifocal.options import JOINT as JOINT_OPTIONS
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.provenance import FileHashes, recording
from photocore.raster_places import cloud_optimised

#: Names of the steps, and of their folders.
JOINT, MOSAIC = "joint", "mosaic"


def joint_step(jobs: Sequence[PairJob]) -> Step:
    """Return the step that adjusts the pairs in one frame."""
    files: dict[str, Path] = {}
    for job in jobs:
        parts = {"pair": job.own_pair_path, "far": job.far, "near": job.near}
        parts |= tables_of(job)
        files |= {f"{job.title} {role}": path for role, path in parts.items()}
    # One unit and precision of the tables for all: the survey file holds no two.
    said = next((job for job in jobs if tables_of(job)), jobs[0]).options
    options = {name: said[name] for name in JOINT_OPTIONS if name in said}

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.networks.joint_workflow import JointTask, adjust_pairs

        task = JointTask(
            control=tuple(job.files.get("control") for job in jobs),
            check=tuple(job.files.get("check") for job in jobs), **options,
        )  # fmt: skip
        paths = [job.own_pair_path for job in jobs]
        return tuple(adjust_pairs(paths, place, task, progress=progress).lines())

    return Step(name=JOINT, files=files, options=options, make=make)


def mosaic_step(jobs: Sequence[PairJob]) -> Step:
    """Return the step that joins the orthophotos of the drawings.

    Raises
    ------
    InputError
        If fewer than two pairs have one.
    """
    drawn = [job for job in jobs if job.drawing_path.is_file()]
    if len(drawn) < 2:
        raise InputError(
            "mosaic: fewer than two pairs have a drawing; add drawing to their products."
        )
    orthos = [job.drawing_path for job in drawn]
    reliefs = [job.relief_path for job in drawn if job.relief_path.is_file()]
    files = {f"ortho {k}": path for k, path in enumerate(orthos)}
    files |= {f"relief {k}": path for k, path in enumerate(reliefs)}

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos.mosaic_workflow import make_mosaic

        out = place / "mosaic.tif"
        with cloud_optimised():
            result = make_mosaic(orthos, out, relief=reliefs, progress=progress)
        return tuple(result.remarks)

    return Step(name=MOSAIC, files=files, options={"cog": True}, make=make)


def plan_of_whole(folder: Path, step: Step) -> str:
    """Return ``keep`` or ``make`` for a step of all pairs, or what stands against it."""
    hashes = FileHashes(folder / f".{step.name}-hashes.json")
    try:
        key = step_key(step, {}, hashes)
        current = is_current(folder / step.name, read_record(folder / step.name), key, hashes)
    except InputError as error:
        return str(error)
    return "keep" if current else "make"


def run_whole(
    folder: Path, step: Step, *, overwrite: bool, progress: Progress = no_progress
) -> PairOutcome:
    """Make a step of all pairs, if anything it rests on changed; errors become its outcome."""
    start = time.perf_counter()
    hashes = FileHashes(folder / f".{step.name}-hashes.json")
    done: tuple[str, ...] = (step.name,)
    failed = message = ""
    remarks: tuple[str, ...] = ()
    clean(folder)
    try:
        key = step_key(step, {}, hashes)
        record = read_record(folder / step.name)
        if record is not None and is_current(folder / step.name, record, key, hashes):
            done = ()
        else:
            with recording(step.described()):
                record = run_step(folder, step, key, hashes, progress=progress, overwrite=overwrite)
        remarks = record.remarks
    except Exception as error:  # the pairs are made, whatever this fault is
        done, failed = (), step.name
        message = failure_message(error, f"step {step.name}", folder)
    finally:
        with suppress(OSError):
            hashes.save()
    kept = () if done or failed else (step.name,)
    return PairOutcome(
        name=step.name, done=done, kept=kept, failed_step=failed, message=message,
        remarks=remarks, seconds=time.perf_counter() - start,
    )  # fmt: skip
