"""What is made of all pairs of a survey together: one frame before, one orthophoto behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from bifocal.campaigns.pair_job import PairOutcome, plan_of_steps, run_steps
from bifocal.campaigns.step_store import Step, clean
from bifocal.campaigns.surveyed_pair import PairJob, tables_of
from bifocal.options import JOINT as JOINT_OPTIONS
from bifocal.remarks import remark
from photocore.cli import Progress, no_progress
from photocore.errors import InputError
from photocore.provenance import FileHashes

#: Names of the steps, and of their folders.
JOINT, MOSAIC = "joint", "mosaic"


def joint_step(jobs: Sequence[PairJob]) -> Step:
    """Return the step that adjusts the pairs in one frame."""
    files: dict[str, Path] = {}
    for job in jobs:
        parts = {"pair": job.product("align"), "far": job.far, "near": job.near}
        parts |= tables_of(job)
        files |= {f"{job.title} {role}": path for role, path in parts.items()}
    # One unit and precision of the tables for all: the survey file holds no two.
    settings = next((job for job in jobs if tables_of(job)), jobs[0]).options
    options = {name: settings[name] for name in JOINT_OPTIONS if name in settings}

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.networks import JointTask, adjust_pairs

        task = JointTask(
            control=tuple(job.files.get("control") for job in jobs),
            check=tuple(job.files.get("check") for job in jobs), **options,
        )  # fmt: skip
        paths = [job.product("align") for job in jobs]
        return tuple(adjust_pairs(paths, place, task, progress=progress).lines())

    return Step(name=JOINT, files=files, options=options, make=make)


def mosaic_step(jobs: Sequence[PairJob], options: Mapping[str, Any]) -> Step:
    """Return the step that joins the orthophotos of the drawings, by options of `mosaic`.

    Raises
    ------
    InputError
        If fewer than two pairs have one.
    """
    drawn = [job for job in jobs if job.product("drawing").is_file()]
    if len(drawn) < 2:
        raise InputError(remark("campaign.no_mosaic"))
    orthos = [job.product("drawing") for job in drawn]
    reliefs = [job.product("relief") for job in drawn if job.product("relief").is_file()]
    files = {f"ortho {k}": path for k, path in enumerate(orthos)}
    files |= {f"relief {k}": path for k, path in enumerate(reliefs)}

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos import make_mosaic

        out = place / "mosaic.tif"
        return tuple(make_mosaic(orthos, out, relief=reliefs, progress=progress, **options).remarks)

    return Step(name=MOSAIC, files=files, options={"cog": True, **options}, make=make)


def plan_of_whole(folder: Path, step: Step) -> str:
    """Return ``keep`` or ``make`` for a step of all pairs, or what stands against it."""
    ((_, what),) = plan_of_steps(folder, [step], _hashes(folder, step))
    return what


def run_whole(
    folder: Path, step: Step, *, overwrite: bool, progress: Progress = no_progress
) -> PairOutcome:
    """Make a step of all pairs, if anything it rests on changed; errors become its outcome."""
    clean(folder)
    outcome = run_steps(
        step.name, folder, [(step, progress)], _hashes(folder, step), overwrite=overwrite
    )
    prefix = f"{step.name}: "
    return replace(outcome, remarks=tuple(one.removeprefix(prefix) for one in outcome.remarks))


def _hashes(folder: Path, step: Step) -> FileHashes:
    return FileHashes(folder / f".{step.name}-hashes.json")
