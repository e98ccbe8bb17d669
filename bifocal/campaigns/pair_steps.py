"""A pair of a survey, and the steps that its options ask for.

A step imports the workflow it calls when it is made: a run that keeps everything loads none.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bifocal.campaigns.step_store import Step, StepRecord, read_record
from bifocal.faces import faces_path
from bifocal.options import DRAWING, FILES, MAP, OF_PAIR, OF_STEP, PICTURE, PROJECT, SET_UP, typed
from photocore.cli import Progress
from photocore.errors import InputError
from photocore.textfile import file_name

if TYPE_CHECKING:
    from bifocal.model import Points, WorldFrame
    from bifocal.orthophotos import OrthoTask
    from bifocal.survey import SolvedSurvey

#: What may be wanted of a pair, in the order of work.
PRODUCTS = ("relief", "points", "ortho", "drawing", "view", "report")
#: What is made where nothing else is said: the drawing has the orthophoto.
MOST_PRODUCTS = ("relief", "points", "drawing", "view", "report")
#: The first step of every pair.
FIRST_STEP = "align"
#: Of drawings where none is asked for, 1:50.
SCALE = 50.0
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
#: Memory of a pair in work: of the program, and for each pixel of its larger photo. Measured at
#: 6.3 MP: 1.63 GB on church_2, 2.30 GB on church_1, whose map reaches far beyond the photo; at 8 MP
#: 1.20 GB on berlin_1. [bytes]
BASE_MEMORY, MEMORY_PER_PIXEL = 300 << 20, 380


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
    way : str
        What the user began it with: ``facade`` or ``survey``.
    told : mapping of str to StepRecord
        By step, that files state in place of what is typed and timed now.
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
    way: str = "survey"
    told: Mapping[str, StepRecord] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Take the faces kept beside the pair, where none are given and they are not refused."""
        typed_path = self.files.get("faces")
        beside = self.folder / FIRST_STEP / f"{self.title}{MADE[FIRST_STEP]}"
        faces = faces_path(typed_path, beside, self.pair_path)
        if faces != typed_path:
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
        alone = self.product("align")
        return alone if self.joint is None else self.joint / alone.name

    def product(self, step: str) -> Path:
        """Return the file that a step makes before all others."""
        ending = SET_ENDING if self.more and step == FIRST_STEP else MADE[step]
        return self.folder / step / f"{self.title}{ending}"

    def ortho_path(self, steps: Sequence[str]) -> Path | None:
        """Return the orthophoto that these steps make, that of the drawing first."""
        steps_with = (step for step in ("drawing", "ortho") if step in steps)
        return next(map(self.product, steps_with), None)

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


def _some(job: PairJob, *names: str) -> dict[str, Any]:
    return {name: job.options[name] for name in names if name in job.options}


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
    options = _some(job, "columns", *SET_UP)

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
    options = _some(job, *MAP, "cog")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.relief_maps.workflow import ReliefJob, relief_of_pair

        out = place / job.product("relief").name
        cloud = out.with_suffix(f".{options['cloud']}") if "cloud" in options else None
        task = ReliefJob(
            out=out, cloud=cloud, preview=out.with_suffix(".png"), gsd=options.get("relief_gsd"),
            faces=job.files.get("faces"),
            **_some(job, *(name for name in MAP if name not in ("relief_gsd", "cloud"))),
        )  # fmt: skip
        _, remarks = relief_of_pair(job.pair_path, task, progress=progress)
        return remarks

    files = {**_photos(job), **_faces(job)}
    return Step(name="relief", files=files, after=("align",), options=options, make=make)


def tables_of(job: PairJob) -> dict[str, Path]:
    """Return the tables of known points of a pair."""
    return {role: job.files[role] for role in ("control", "check") if role in job.files}


def _points_step(job: PairJob) -> Step:
    options = _some(job, "language", "unit", "columns")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:  # noqa: ARG001
        from bifocal.workbook import write_result

        solution = _solved(job, tables_of(job), options)
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


def _solved(job: PairJob, tables: Mapping[str, Path], options: Mapping[str, Any]) -> SolvedSurvey:
    """Return the points of tables, solved and compared."""
    from bifocal.model import pair_or_set
    from bifocal.reports import is_exchanged, solve_control

    return solve_control(
        job.pair_path, **{"control": None, **tables}, photos=len(job.photos),
        exchanged=is_exchanged(pair_or_set(job.pair_path), job.far),
        language=options.get("language", "en"), unit=options.get("unit", ""),
        columns=options.get("columns"),
    )  # fmt: skip


def _checked(job: PairJob) -> tuple[int, float, float] | None:
    """Return check points, and their RMSE in X, Y and in relief; None if too few prove it. [m]"""
    from bifocal.survey import FEW

    if "check" not in job.files:
        return None
    check = _solved(job, {"check": job.files["check"]}, job.options).check
    x, y, r = (check.axes[axis] for axis in "XYZ")
    count = min(x.n, y.n, r.n)
    return (count, max(x.rmse, y.rmse), r.rmse) if count >= FEW else None


def _ortho_task(job: PairJob, options: Mapping[str, Any]) -> OrthoTask:
    from bifocal.orthophotos import OrthoTask

    return OrthoTask.from_given(
        {key: options[key] for key in (*PICTURE, "gsd") if key in options},
        relief=job.product("relief"), faces=job.files.get("faces"),
    )  # fmt: skip


def _ortho_step(job: PairJob) -> Step:
    options = _some(job, *PICTURE, "gsd", "cog")

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos import make_ortho

        out = place / job.product("ortho").name
        task = _ortho_task(job, options)
        return make_ortho(job.pair_path, out, task, progress=progress).remarks

    files = {**_photos(job), **_faces(job)}
    return Step(name="ortho", files=files, after=("align", "relief"), options=options, make=make)


def _drawing_step(job: PairJob, earlier: tuple[str, ...]) -> Step:
    options = {"scale": SCALE} | _some(job, "columns", *DRAWING, *PICTURE, "language", "cog")
    tables = {role: job.files[role] for role in ("control", "check", "mark") if role in job.files}

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.orthophotos import DeliverTask, deliver
        from bifocal.reports import wall_in_words

        drawing = {key: options[key] for key in (*DRAWING, "language") if key in options}
        wish = DeliverTask(
            title=job.name, **drawing, mark=job.files.get("mark"),
            cad=_points_to_draw(job, solved="points" in earlier),
            checked=_checked(job) if "points" in earlier else None,
            expected=partial(wall_in_words, language=drawing.get("language", "en")),
        )  # fmt: skip
        task = _ortho_task(job, options)
        return deliver(job.pair_path, place, task, wish, progress=progress).ortho.remarks

    return Step(
        name="drawing", files={**_photos(job), **_faces(job), **tables},
        after=tuple(name for name in ("align", "relief", "points") if name in earlier),
        options=options, make=make,
    )  # fmt: skip


def known_of(job: PairJob, frame: WorldFrame | None = None) -> dict[str, Points]:
    """Return the coordinates that the tables of a pair hold; E, N, H in a frame's X, Y, r."""
    from bifocal.orientation import known_points

    reading = _some(job, "unit", "columns") | {"names": [str(path) for path in job.photos]}
    return {
        role: known_points(path, photos=len(job.photos), frame=frame, **reading)
        for role, path in tables_of(job).items()
    }


def _points_to_draw(job: PairJob, *, solved: bool) -> dict[str, Points]:
    """Return what a drawing for CAD holds: known points where they are, and as they were solved."""
    from bifocal.files import read_survey_points
    from bifocal.model import WorldFrame, pair_or_set

    points = known_of(job, WorldFrame.of(pair_or_set(job.pair_path).extra))
    if solved:
        (table,) = (job.folder / "points").glob(f"{escape(job.title)}_points.*")
        points["points"] = read_survey_points(table)[0]
    return points


def _view_step(job: PairJob, earlier: tuple[str, ...]) -> Step:
    options = {"title": job.name} | _some(job, "language")
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
    options |= _some(job, "language", "unit", "columns", "scale", *PROJECT)
    if "drawing" in earlier:
        options.setdefault("scale", SCALE)

    def make(place: Path, progress: Progress) -> tuple[str, ...]:
        from bifocal.reports import StepTold, write_report
        from bifocal.reports.workflow import ReportTask

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


def proven(job: PairJob) -> list[str]:
    """Return what the compared points of a finished pair prove, for the terminal."""
    from bifocal.reports import read_content, verdict_in_words
    from bifocal.reports.content import ReportTask

    settings: dict[str, Any] = {k: job.options[k] for k in ReportTask.PLAIN if k in job.options}
    if "drawing" in job.products:
        settings.setdefault("scale", SCALE)
    task = ReportTask(**(settings | tables_of(job)), far=job.far)
    return verdict_in_words(read_content(job.pair_path, task, pictures=False))


def _tables(step: Step) -> dict[str, Path]:
    """Return the files of a step besides photos and pair files."""
    return {role: path for role, path in step.files.items() if role in FILES}
