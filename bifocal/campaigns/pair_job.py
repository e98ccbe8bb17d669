"""One pair of a survey: its options, the steps that follow from them, and running them.

A step imports the workflow it calls when it is made: a run that keeps everything loads none.
"""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bifocal.campaigns.step_store import (
    Step,
    StepRecord,
    is_current,
    read_record,
    run_step,
    step_key,
)
from bifocal.faces.faces_files import faces_path
from bifocal.options import DRAWING, MAP, PICTURE, SET_UP
from photocore.cli import Progress, no_progress, unforeseen_message
from photocore.errors import InputError, PhotogrammetryError
from photocore.provenance import FileHashes, recording
from photocore.raster_places import cloud_optimised
from photocore.textfile import file_name, odd_name

if TYPE_CHECKING:
    from bifocal.orthophotos.ortho_workflow import OrthoTask

#: What may be wanted of a pair, in the order of work.
PRODUCTS = ("relief", "points", "ortho", "drawing", "view", "report")
#: What is made where nothing else is said: the drawing has the orthophoto.
MOST_PRODUCTS = ("relief", "points", "drawing", "view", "report")
#: The first step of every pair.
FIRST_STEP = "align"
#: How the file of a set of photos ends.
SET_ENDING = ".photos.json"
#: How the file is called that a step makes before all others, behind the pair's name.
MADE = {
    "align": ".pair.json",
    "relief": "_relief.tif",
    "ortho": "_ortho.tif",
    "drawing": ".tif",
    "view": "_view.html",
}
#: Share of a pair's time that each step takes, measured on church_2.
WEIGHTS = {
    "align": 0.22, "relief": 0.36, "points": 0.02, "ortho": 0.07, "drawing": 0.15, "view": 0.02,
    "report": 0.16,
}  # fmt: skip
#: Memory of a pair in work: of the program, and for each pixel of its larger photo; 6.3 MP took
#: 1.55 GB on church_2, 2.04 GB on a church with more relief. [bytes]
BASE_MEMORY, MEMORY_PER_PIXEL = 300 << 20, 290


@dataclass(frozen=True, slots=True, kw_only=True)
class PairJob:
    """A pair to be surveyed: plain data that can be sent to another machine.

    Attributes
    ----------
    name : str
        In the survey; its files are called by it.
    folder : Path
        Where the folders of its steps lie.
    far, near : Path
        Photos.
    more : tuple of Path
        The others of a set.
    files : mapping of str to Path
        By the names of `bifocal.options.FILES`, where given.
    options : mapping
        By the names of `bifocal.options.OF_PAIR`; absent: default.
    products : tuple of str
        Of `PRODUCTS`.
    overwrite : bool
        Replace files that were changed after they were made.
    date : str
        That its files bear, wherever and whenever they are made; empty: the day they are made.
    joint : Path or None
        Folder with the pair files of all pairs adjusted in one frame; None: this pair's own.
    """

    name: str
    folder: Path
    far: Path
    near: Path
    more: tuple[Path, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    products: tuple[str, ...] = MOST_PRODUCTS
    overwrite: bool = False
    date: str = ""
    joint: Path | None = None

    def __post_init__(self) -> None:
        """Take the faces kept beside the pair, where none are given and they are not refused."""
        given = self.files.get("faces")
        beside = self.folder / FIRST_STEP / f"{self.title}{MADE[FIRST_STEP]}"
        faces = faces_path(given, beside, self.pair_path)
        if faces != given:
            rest = {role: path for role, path in self.files.items() if role != "faces"}
            object.__setattr__(self, "files", rest | ({"faces": faces} if faces else {}))

    @property
    def photos(self) -> tuple[Path, ...]:
        """All photos, as they were named."""
        return (self.far, self.near, *self.more)

    @property
    def title(self) -> str:
        """The name as file name."""
        return file_name(self.name)

    @property
    def pair_path(self) -> Path:
        """The pair file that relief and drawings are made with."""
        own = self.product("align")
        return own if self.joint is None else self.joint / own.name

    def product(self, step: str) -> Path:
        """Return the file that a step makes before all others."""
        made = SET_ENDING if self.more and step == FIRST_STEP else MADE[step]
        return self.folder / step / f"{self.title}{made}"

    def ortho_path(self, steps: Sequence[str]) -> Path | None:
        """Return the orthophoto that these steps make, that of the drawing first."""
        made = (step for step in ("drawing", "ortho") if step in steps)
        return next(map(self.product, made), None)

    def memory(self) -> int:
        """Return the memory it needs at most; that of small photos where they cannot be read.

        In bytes.
        """
        from photocore.images import image_info

        pixels = 0
        for path in self.photos:
            try:
                width, height = image_info(path).size
            except InputError:
                continue
            pixels = max(pixels, width * height)
        return BASE_MEMORY + MEMORY_PER_PIXEL * pixels


@dataclass(frozen=True, slots=True, kw_only=True)
class PairOutcome:
    """What became of a pair.

    Attributes
    ----------
    name : str
    done, kept : tuple of str
        Steps that ran, and steps whose results were still good.
    failed_step, message : str
        Where it stopped and why; empty if it did not.
    remarks : tuple of str
        What the user should know, each with its step.
    seconds : float
    """

    name: str
    done: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    failed_step: str = ""
    message: str = ""
    remarks: tuple[str, ...] = ()
    seconds: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)


def steps_of(job: PairJob) -> list[Step]:
    """Return the steps that make the products of a pair, in order."""
    wanted = set(job.products)
    steps = [_align_step(job)]
    if wanted & {"relief", "ortho", "drawing", "view"}:
        steps.append(_relief_step(job))
    if "points" in wanted and {"control", "check"} & set(job.files):
        steps.append(_points_step(job))
    if "ortho" in wanted:
        steps.append(_ortho_step(job))
    if "drawing" in wanted:
        steps.append(_drawing_step(job))
    if "view" in wanted:
        steps.append(_view_step(job, tuple(step.name for step in steps)))
    if "report" in wanted:
        steps.append(_report_step(job, tuple(step.name for step in steps)))
    return steps


def plan_of(job: PairJob, hashes: FileHashes) -> list[tuple[str, str]]:
    """Return each step of a pair with ``keep``, ``make``, or why it cannot run."""
    return plan_of_steps(job.folder, steps_of(job), hashes)


def plan_of_steps(parent: Path, steps: Sequence[Step], hashes: FileHashes) -> list[tuple[str, str]]:
    """Return steps whose folders lie in ``parent`` with ``keep``, ``make``, or what is wrong."""
    plan: list[tuple[str, str]] = []
    earlier: dict[str, StepRecord] = {}
    stale = False
    for step in steps:
        folder = parent / step.name
        record = read_record(folder)
        try:
            key = "" if stale else step_key(step, earlier, hashes)
            current = not stale and is_current(folder, record, key, hashes)
        except InputError as error:
            return [*plan, (step.name, str(error))]
        if current and record is not None:
            earlier[step.name] = record
        else:
            stale = True
        plan.append((step.name, "keep" if current else "make"))
    return plan


def run_pair(job: PairJob, progress: Progress = no_progress) -> PairOutcome:
    """Run the steps of a pair whose results are not there yet; errors become its outcome.

    The number of threads is fixed while it runs: optical flow shares its rows among threads, and
    its last digits depend on how many there are.
    """
    import cv2

    steps = steps_of(job)
    total = sum(WEIGHTS[step.name] for step in steps)
    parts = []
    behind = 0.0
    for step in steps:
        part = _part_of(progress, behind / total, WEIGHTS[step.name] / total, step.name)
        parts.append((step, part))
        behind += WEIGHTS[step.name]
    hashes = FileHashes(job.folder / ".hashes.json")
    where, day = f"pair {job.name}, ", job.date or None
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        return run_steps(
            job.name, job.folder, parts, hashes, overwrite=job.overwrite, day=day, where=where
        )
    finally:
        cv2.setNumThreads(threads)


def run_steps(
    name: str,
    parent: Path,
    steps: Sequence[tuple[Step, Progress]],
    hashes: FileHashes,
    *,
    overwrite: bool,
    day: str | None = None,
    where: str = "",
) -> PairOutcome:
    """Run the steps whose results are not in their folders yet; errors become the outcome.

    Parameters
    ----------
    name : str
        That of the outcome.
    parent : Path
        Where the folders of the steps lie.
    steps : sequence of (Step, Progress)
        Each with what is told how far it is.
    hashes : FileHashes
    overwrite : bool
        Replace files that were changed after they were made.
    day : str, optional
        That the files bear.
    where : str
        What an error belongs to.
    """
    start = time.perf_counter()
    done: list[str] = []
    kept: list[str] = []
    remarks: list[str] = []
    records: dict[str, StepRecord] = {}
    failed = message = ""
    try:
        for step, progress in steps:
            failed, folder = step.name, parent / step.name
            progress(0.0, 1.0)
            key = step_key(step, records, hashes)
            record = read_record(folder)
            if record is not None and is_current(folder, record, key, hashes):
                kept.append(step.name)
            else:
                rasters = cloud_optimised(bool(step.options.get("cog")))
                with recording(step.described(), day=day), rasters:
                    record = run_step(
                        parent, step, key, hashes, progress=progress, overwrite=overwrite
                    )
                done.append(step.name)
            records[step.name] = record
            remarks += [f"{step.name}: {remark}" for remark in record.remarks]
        failed = ""
    except Exception as error:  # one fault, whatever it is, must not stop the other pairs
        message = failure_message(error, f"{where}step {failed}", parent)
    finally:
        with suppress(OSError):
            hashes.save()
    return PairOutcome(
        name=name, done=tuple(done), kept=tuple(kept), failed_step=failed, message=message,
        remarks=tuple(remarks), seconds=time.perf_counter() - start,
    )  # fmt: skip


def failure_message(error: Exception, what: str, folder: Path) -> str:
    """Return what to say of the error that ended a step, while it is handled."""
    if isinstance(error, PhotogrammetryError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory; give it fewer neighbours (--jobs) or a coarser gsd."
    if isinstance(error, UnicodeEncodeError):
        return odd_name(error)
    if isinstance(error, OSError):
        return f"{error.filename or folder}: {error.strerror or error}."
    if os.environ.get("BIFOCAL_DEBUG"):
        traceback.print_exc()
    return unforeseen_message(what, error)


def _part_of(progress: Progress, start: float, share: float, step: str) -> Progress:
    """Return a reporter for a part of a whole."""

    def report(done: float, total: float, what: str = "") -> None:  # noqa: ARG001
        progress(start + share * (done / total if total > 0 else 0.0), 1.0, step)

    return report


def _some(job: PairJob, *names: str) -> dict[str, Any]:
    return {name: job.options[name] for name in names if name in job.options}


def refusal(job: PairJob) -> str:
    """Return why a pair cannot be aligned as it is described; empty where nothing is missing."""
    from bifocal.networks.set_workflow import way_of_set
    from bifocal.orientation.align_workflow import AlignOptions, check_way

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
    options = _some(job, *SET_UP)

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orientation.align_workflow import AlignOptions, align_photos

        out = place / job.product("align").name
        told = AlignOptions.from_given({**options, **files})
        if job.more:
            from bifocal.networks.set_workflow import align_photo_set

            return align_photo_set(job.photos, out, told, progress=progress).remarks
        picture = out.with_suffix("").with_suffix(".pair.png")
        made = align_photos(job.far, job.near, out, told, picture=picture)
        return tuple(dict.fromkeys((*made.pair.remarks, *made.remarks)))

    return Step(name=FIRST_STEP, files={**_named(job), **files}, options=options, make=make)


def _named(job: PairJob) -> dict[str, Path]:
    """Return the photos by their part in it."""
    others = {f"photo {number}": path for number, path in enumerate(job.more, start=3)}
    return {"far": job.far, "near": job.near, **others}


def _photos(job: PairJob) -> dict[str, Path]:
    """Return what a step after the alignment looks at: the photos, the pair file of all pairs."""
    joint = {} if job.joint is None else {"pair": job.pair_path}
    return {**_named(job), **joint}


def _faces(job: PairJob) -> dict[str, Path]:
    return {"faces": job.files["faces"]} if "faces" in job.files else {}


def _relief_step(job: PairJob) -> Step:
    options = _some(job, *MAP, "cog")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair

        out = place / job.product("relief").name
        task = ReliefJob(
            out=out, preview=out.with_suffix(".png"), gsd=options.get("relief_gsd"),
            faces=job.files.get("faces"),
            **_some(job, *MAP[1:]),
        )  # fmt: skip
        _, remarks = relief_of_pair(job.pair_path, task, progress=progress)
        return remarks

    files = {**_photos(job), **_faces(job)}
    return Step(name="relief", files=files, after=("align",), options=options, make=make)


def tables_of(job: PairJob) -> dict[str, Path]:
    """Return the tables of known points of a pair."""
    return {role: job.files[role] for role in ("control", "check") if role in job.files}


def _points_step(job: PairJob) -> Step:
    options = _some(job, "language", "unit")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:  # noqa: ARG001
        from bifocal.model.photo_set import pair_or_set
        from bifocal.reports.control_survey import is_exchanged, solve_control
        from bifocal.workbook.output import write_result

        pair = pair_or_set(job.pair_path)
        tables = {"control": None, **tables_of(job)}
        solution = solve_control(
            job.pair_path, **tables, exchanged=is_exchanged(pair, job.far), photos=len(job.photos),
            language=options.get("language", "en"), unit=options.get("unit", ""),
        )  # fmt: skip
        if solution.pair.leans:
            write_result(place / f"{job.title}_points.csv", solution)
            told = (
                "ports that lean have no formulas in a survey workbook: the points are a text "
                "table (.csv)."
            )
            return (*solution.remarks, told)
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
    from bifocal.orthophotos.ortho_workflow import OrthoTask

    return OrthoTask.from_given(
        {key: options[key] for key in (*PICTURE, "gsd") if key in options},
        relief=job.product("relief"), faces=job.files.get("faces"),
    )  # fmt: skip


def _ortho_step(job: PairJob) -> Step:
    options = _some(job, *PICTURE, "gsd", "cog")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos.ortho_workflow import make_ortho

        out = place / job.product("ortho").name
        task = _ortho_task(job, options)
        return make_ortho(job.pair_path, out, task, progress=progress).remarks

    files = {**_photos(job), **_faces(job)}
    return Step(name="ortho", files=files, after=("align", "relief"), options=options, make=make)


def _drawing_step(job: PairJob) -> Step:
    options = _some(job, *DRAWING, *PICTURE, "language", "cog")
    tables = {role: job.files[role] for role in ("control", "mark") if role in job.files}

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos.deliver_workflow import DeliverTask, deliver

        drawing = {"scale": 50.0} | _some(job, *DRAWING, "language")
        wish = DeliverTask(title=job.name, **drawing, mark=job.files.get("mark"))
        task = _ortho_task(job, options)
        return deliver(job.pair_path, place, task, wish, progress=progress).ortho.remarks

    return Step(
        name="drawing", files={**_photos(job), **_faces(job), **tables}, after=("align", "relief"),
        options=options, make=make,
    )  # fmt: skip


def _view_step(job: PairJob, earlier: tuple[str, ...]) -> Step:
    options = {"title": job.name} | _some(job, "language")
    ortho = job.ortho_path(earlier)

    def make(place: Path, progress: Progress) -> tuple[str, ...]:  # noqa: ARG001
        from bifocal.reports.view_workflow import view_relief

        view_relief(job.product("relief"), place / job.product("view").name, ortho=ortho, **options)
        return ()

    after = ("relief",) if ortho is None else ("relief", ortho.parent.name)
    return Step(name="view", files={}, after=after, options=options, make=make)


def _report_step(job: PairJob, earlier: tuple[str, ...]) -> Step:
    options = {"title": job.name} | _some(job, "language", "unit", "scale")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.reports.workflow import ReportTask, write_report

        task = ReportTask(
            title=job.name, language=options.get("language", "en"), unit=options.get("unit", ""),
            scale=options.get("scale"), far=job.far,
            relief=job.product("relief") if "relief" in earlier else None,
            ortho=job.ortho_path(earlier), view=job.product("view") if "view" in earlier else None,
            **tables_of(job),
        )  # fmt: skip
        outs = (place / f"{job.title}_report.html", place / f"{job.title}_report.pdf")
        return write_report([job.pair_path], outs, [task], progress=progress)

    files = {**_photos(job), **tables_of(job)}
    return Step(name="report", files=files, after=earlier, options=options, make=make)
