"""Every command that a page or a help text shows is run, in the page's order, on small inputs."""

from __future__ import annotations

import itertools
import re
import shlex
import shutil
import subprocess
import sys
import threading
import tomllib
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

from bifocal import SAMPLE, PageServer
from tests.bifocal.orientation.test_docs_control import LINES as CONTROL_LINES
from tests.builders.commands import bifocal_command as bifocal
from tests.builders.commands import multimedia_command as multimedia
from tests.docs_desk import make_desk
from tests.docs_tank import make_bed, make_tank
from tests.page_commands import DOCS, IN_PART, ROOT, Shown, shown_commands

RUN = {"bifocal": bifocal, "multimedia": multimedia}
SHOWN = shown_commands()
#: Pages that take a moment: with the default tests.
QUICK = ("choosing.md", "planning.md", "tutorial-excel.md", "tutorial-water.md")

ELSEWHERE = ".ci/run runs it in a fresh clone"
MINUTES = "minutes of processor time"
SERVES = "serves until it is stopped; its options are read below"
#: Commands of the pages that are not run, and why.
NOT_RUN = {
    "python3 -m venv .venv && .venv/bin/pip install -q . && .venv/bin/bifocal demo --overwrite":
        ELSEWHERE,
    'python3 -m venv .venv && .venv/bin/pip install -q ".[test]" && .venv/bin/pytest': ELSEWHERE,
    "python3 -m venv .venv": ELSEWHERE,
    "python benchmarks/bench_bathymetry.py": MINUTES,
    "python benchmarks/bench_cameras.py": MINUTES,
    "python benchmarks/bench_campaign.py": MINUTES,
    "python benchmarks/bench_delivery.py": MINUTES,
    "python benchmarks/bench_intersection.py": MINUTES,
    "python benchmarks/bench_relief.py": MINUTES,
    "python benchmarks/relief_ablation.py": MINUTES,
    "python benchmarks/relief_tuning.py": MINUTES,
    "python benchmarks/bench_shift.py": MINUTES,
    "python benchmarks/bench_targets.py": MINUTES,
    "python benchmarks/bench_tracking.py": MINUTES,
    "python -m benchmarks.bench_page 100": MINUTES,
    "python -m benchmarks.peers": MINUTES,
    "python docs/make_page_pictures.py": "wants a browser, and writes into docs",
    "python docs/make_gallery.py": MINUTES,
    "python docs/make_cli.py": "test_docs.py compares what it writes",
    "python docs/make_wrong_pictures.py": "writes into docs; run below into another folder",
    "dask scheduler": SERVES,
    "dask worker": SERVES,
    'dask worker tcp://192.168.0.10:8786 --nworkers 4 --nthreads 1 --resources "memory=4e9"':
        SERVES,
    "bifocal mosaic /vsis3/bucket/left.tif /vsis3/bucket/right.tif --out /vsis3/bucket/wall.tif "
    "--cog": "wants an account on object storage",
    "bifocal demo": "tutorial-facade.md runs it with --out",
    "bifocal demo --out sample --overwrite": "tutorial-facade.md runs it with another folder",
    "bifocal demo --water": "tests/bifocal/demo runs it with --out",
    "bifocal demo --water --out under-water": "tests/bifocal/demo runs it with another folder",
    "bifocal align far.jpg mid.jpg near.jpg --control set.csv --out wall.photos.json":
        "wants three photos; test_photo_sets.py has them",
    "bifocal facade far.jpg mid.jpg near.jpg --control set.csv --scale 1:50 --out porch":
        "wants three photos; test_photo_sets.py has them",
    "bifocal adjust a.pair.json b.pair.json c.pair.json --control a.csv --control none --control "
    "c.csv --out joint": "wants a street; test_joint_adjustment.py has one",
    "bifocal align far.jpg near.jpg --auto --distance1 3.5 --focal1 35 --focal2 19 --sensor-width "
    "22.7 --indices 1,1.337 --depth 0.6 --wall 1480,910 --out pond.pair.json":
        "wants photos through a surface of water; test_common_points_through_media.py has them",
    **dict.fromkeys(
        (line for _, line in CONTROL_LINES if "points.csv" not in line),
        "wants a program's list; test_docs_control.py has one for each line",
    ),
    **dict.fromkeys(IN_PART, "names options, is no whole line"),
}  # fmt: skip

DRAWN = "bifocal ortho wall.pair.json --relief relief.tif --deliver drawing --scale 1:50"
#: Lines that another page runs on the same files: page -> its lines, and that page.
RUN_BY = {
    "README.md": {
        "bifocal facade far.jpg near.jpg --control points.csv --scale 1:50 --out DIR": "index.md",
    },
    "index.md": {
        "bifocal survey --init photos street.toml": "tutorial-many-pairs.md",
        "bifocal survey street.toml": "tutorial-many-pairs.md",
        "bifocal align far.jpg near.jpg --control points.csv --out wall.pair.json": "align.md",
        "bifocal match wall.pair.json --out survey.xlsx": "align.md",
        DRAWN: "other-programs.md",
    },
    "surveys.md": {
        "bifocal survey --init photos street.toml": "tutorial-many-pairs.md",
        "bifocal survey street.toml": "tutorial-many-pairs.md",
    },
    "dense-relief.md": {
        "bifocal relief wall.pair.json --out relief.tif --preview relief.png": "index.md",
    },
}
#: What a page takes for granted, where it is not the façade's or the tank's folder.
ONLY = {
    "picking.md": ("far.jpg", "near.jpg", "third.jpg", "wall.pair.json", "survey.xlsx"),
    "choosing.md": (),
    "planning.md": (),
    "tutorial-excel.md": (),
    "help of bifocal pick": ("far.jpg", "near.jpg", "wall.pair.json", "survey.xlsx"),
}
#: Files of the tank that a page about façades takes for granted too.
ALSO = {"index.md": ("experiment", "myptv", "bed.tif")}
#: What is taken under another name.
UNDER = {
    "underwater-adjustment.md": {"test_cavity": "experiment"},
    "photo-sets.md": {"set_picks.csv": "picks.csv"},
    "help of bifocal solve": {"set_picks.csv": "picks.csv"},
}
#: A folder as it is delivered.
DELIVER = (
    "bifocal facade far.jpg near.jpg --control points.csv --scale 1:50 --out DIR --quality fast "
    "--products relief"
)
#: Lines of other pages that come first.
FIRST = {
    "help of multimedia bathymetry": "multimedia waterlevel high_tiepoints.csv --out water.json",
    "help of bifocal undistort": "mkdir corrected",
    "help of bifocal facade": DELIVER, "surveys.md": DELIVER,
}  # fmt: skip
#: Help that goes on where that of another command ends: what it reports on is made there.
GOES_ON = {f"help of bifocal {name}": "help of bifocal facade" for name in ("report", "verify")}
GOES_ON |= dict.fromkeys(("reports.md", "verify.md"), "facade.md")
#: Lines that want the sample at its full size.
WHOLE = "--what targets"
#: Options added so that the line costs seconds: the page's own products are made by other lines.
CHEAPER = {
    "bifocal facade far.jpg near.jpg --control points.csv --check check.csv --scale 1:50 --out "
    "wall": "--quality fast --products relief,points",
    "bifocal facade far.jpg near.jpg --control points.csv --scale 1:50 --out DIR":
        "--quality fast --products relief",
    "bifocal facade far.jpg near.jpg --control points.csv --check check.csv --scale 1:20 --out "
    "wall":
        "--quality fast --products relief,points",
    "bifocal facade far.jpg near.jpg --control points.csv --check check.csv --scale 1:100 --focal1 "
    "35 --focal2 19 --sensor-width 22.67 --out wall":
        "--quality fast --products relief",
    "bifocal facade far.jpg near.jpg --auto --distance1 17.5 --scale 1:100 --language de --out "
    "wall":
        "--quality fast --products relief",
    "bifocal facade reef_far.jpg reef_near.jpg --control reef.csv --indices 1,1.49,1.337 "
    "--thicknesses 0.01 --port 0.05 --prior index3=0.003 --out reef":
        "--quality fast --products relief",
    "bifocal facade reef_far.jpg reef_near.jpg --control reef.csv --indices 1,1.49,1.337 "
    "--thicknesses 0.01 --port 0.05 --scale 1:20 --out reef":
        "--quality fast --products relief",
}  # fmt: skip
#: What a reader of the page types into the survey file that `--init` wrote.
TYPED = 'products = ["drawing"]\ndpi = 60\nquality = "fast"\n'
#: What a page says that a line of it gives: (page, part of the line, words of the page, printed).
SAYS = (
    ("tutorial-water.md", "index", "says 1.33575", "1.33575"),
    ("refraction.md", "--from-index", "with a standard deviation of 0.075 %", "deviation 0.075 %"),
    ("planning.md", "60x40", "flying heights of 83 and 42 m, 15 mm pixels", "83.21  41.60"),
    ("planning.md", "60x40", "15 mm pixels, B = 83 m", "1 % of scale is 0.83 m"),
    ("through-water.md", "multimedia index", "says 1.34284", "1.34284"),
    ("through-water.md", "targets.csv", "says RMSE 0.0040 m", "RMSE 0.0040 m"),
    ("through-water.md", "--depth 0.9", "gives 3.73 and 2.13 m", "3.73  2.13"),
    ("through-water.md", "--depth 0.9", "the glass 2.82 and 1.22 m", "2.820 and 1.220 m before"),
    ("tutorial-excel.md", "solve", "P1 has r = 1.000 m", "1.0000"),
    ("underwater-cameras.md", "resect tank.toml --camera left", "sigma0 = 0.9 um", "sigma0 0.88"),
)
#: What must be there at the end of a page.
MADE = {
    "tutorial-facade.md": ("wall/report/wall_report.html", "wall/drawing/wall.pdf"),
    "tutorial-many-pairs.md": ("results/joint/points.csv", "results/mosaic/mosaic.tif"),
}
#: Options that name what is written.
WRITES = ("--out", "--preview", "--cloud", "--report", "--plot", "--picture", "--residuals")


@pytest.fixture(scope="session")
def facade(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the façade."""
    folder = tmp_path_factory.mktemp("facade")
    make_desk(folder)
    return folder


@pytest.fixture(scope="session")
def tank(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the tank and the bed."""
    folder = tmp_path_factory.mktemp("tank")
    make_tank(folder)
    make_bed(folder)
    return folder


def is_wet(source: str) -> bool:
    """Whether a page's files are those of the tank."""
    return source.startswith(
        ("help of multimedia", "underwater", "tutorial-water", "tutorial-ptv", "bathym", "refrac")
    )


def written(words: list[str]) -> list[str]:
    """Return the names that a command makes, which it does not read as well."""
    pairs = itertools.pairwise(words)
    names = [b for a, b in pairs if a in WRITES and b != "-" and words.count(b) == 1]
    if words[1:3] == ["survey", "--init"]:
        names.append(words[4] if len(words) > 4 else f"{words[3]}/survey.toml")
    if words[1] == "template":
        names.append(words[2])
    if words[1] == "convert":
        names.append(words[3])
    return names


def lay_out(source: str, lines: list[str], desk: Callable[[str], Path]) -> None:
    """Copy what the page takes for granted into this folder, without what the page makes."""
    kind = "tank" if is_wet(source) else "facade"
    for name in ONLY[source] if source in ONLY else [path.name for path in desk(kind).iterdir()]:
        copied(desk(kind) / name)
    for name in ALSO.get(source, ()):
        copied(desk("tank") / name)
    for name, taken in UNDER.get(source, {}).items():
        shutil.rmtree(taken, ignore_errors=True)
        Path(name).rename(taken)
    if is_wet(source):
        Path("water_points.csv").rename("points.csv")
    known: set[str] = set()
    for line in lines:
        words = shlex.split(line)
        for name in set(written(words)) - known:
            removed(name)
        known |= set(words)
    page = DOCS / source
    if page.is_file():
        for name, text in tables_of(page.read_text(encoding="utf-8")):
            Path(name).write_text(text, encoding="utf-8")


def copied(path: Path) -> None:
    """Copy a file or folder here."""
    if path.is_dir():
        shutil.copytree(path, path.name)
    else:
        shutil.copyfile(path, path.name)


def removed(name: str) -> None:
    """Take a file away with its tables, or a folder that is no result of steps."""
    stem, _, kind = name.partition(".")
    beside = {"toml": f"{stem}_*_points.csv", "pair.json": f"{stem}.pair.png"}.get(kind)
    for path in list(Path().glob(beside)) if beside else ():
        path.unlink()
    if Path(name).is_file():
        Path(name).unlink()
    elif Path(name).is_dir() and not Path(name, ".hashes.json").exists():
        shutil.rmtree(name)


def tables_of(text: str) -> list[tuple[str, str]]:
    """Return the files that a page shows: the name stands first in the paragraph before."""
    found = []
    for before, block in re.findall(
        r"([^\n].*?)\n\n```(?:text|csv|toml)\n(.*?)^```", text, re.S | re.M
    ):
        name = re.search(r"`(\w+\.(?:csv|toml))`", before.rsplit("\n\n", 1)[-1])
        if name and not name[1].startswith("street"):
            found.append((name[1], block))
    return found


def invoke(line: str, entered: bytes | None = None) -> tuple[str, str]:
    """Run a line as a shell does; return what is said on stdout, and on stdout and stderr."""
    first, _, rest = line.partition(" | ")
    command, _, source = first.partition(" < ")
    if source:
        entered = Path(source.strip()).read_bytes()
    program, *words = shlex.split(command)
    if program == "mkdir":
        Path(words[0]).mkdir()
        return "", ""
    there = {word: sorted(map(str, Path().glob(word))) for word in words if "*" in word}
    words = [name for word in words for name in there.get(word, [word])]
    result = CliRunner().invoke(RUN[program], words, input=entered)
    assert result.exit_code == 0, f"{line}\n{result.output}"
    if rest:
        return invoke(rest, result.stdout_bytes)
    return result.stdout, result.output


def filled_in(source: str, words: list[str], desk: Callable[[str], Path]) -> None:
    """Fill in what a line has made for the reader to fill in."""
    if words[1:] == ["template", "survey.xlsx"]:
        shutil.copyfile(desk("facade") / "survey.xlsx", "survey.xlsx")
    if words[1:3] == ["survey", "--init"]:
        path, page = Path(words[4]), (DOCS / source).read_text(encoding="utf-8")
        typed = TYPED + re.search(r"```toml\n(.*?)```", page, re.S)[1]
        text = path.read_text(encoding="utf-8").replace("1:50", "1:200")
        path.write_text(re.sub(r"products = .*", typed, text), encoding="utf-8")


@pytest.fixture
def ends_at_once(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """Have the page's server end when its page was fetched once; return what was fetched."""
    fetched: list[bytes] = []
    serve = PageServer.serve

    def visited(server: PageServer) -> None:
        def visit() -> None:
            try:
                with urllib.request.urlopen(server.url, timeout=60) as answer:
                    fetched.append(answer.read())
            finally:
                server.stop()

        visitor = threading.Thread(target=visit)
        visitor.start()
        serve(server)
        visitor.join()

    monkeypatch.setattr(PageServer, "serve", visited)
    monkeypatch.setattr("webbrowser.open", lambda _: True)
    return fetched


@contextmanager
def scheduler_of(line: str) -> Iterator[str]:
    """Yield the line, with the address of a scheduler on this computer where it names one."""
    address = re.search(r"tcp://[\d.:]+", line)
    if not address:
        yield line
        return
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, resources={"memory": 4e9}
    ) as cluster:
        yield line.replace(address[0], cluster.scheduler_address)


def lines_of(source: str) -> list[Shown]:
    """Return what is run of a page; of the help, what no page shows."""
    pages = {shown.line for shown in SHOWN if not shown.page.startswith("help of")}
    return [
        shown for shown in SHOWN
        if GOES_ON.get(shown.page, shown.page) == source and shown.line not in NOT_RUN
        and shown.line not in RUN_BY.get(source, {})
        and not shown.line.startswith("pip install")
        and not (source.startswith("help of") and shown.line in pages)
    ]  # fmt: skip


def marked(source: str):
    """Return a page as a parameter, slow ones marked."""
    marks = () if source in QUICK else pytest.mark.acceptance
    return pytest.param(source, id=source, marks=marks)


@pytest.mark.usefixtures("ends_at_once")
@pytest.mark.parametrize(
    "source",
    [marked(source) for source in dict.fromkeys(shown.page for shown in SHOWN) if lines_of(source)],
)
def test_the_commands_of_a_page_run(source, request, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    desk = request.getfixturevalue
    shown = lines_of(source)
    lay_out(source, [one.line for one in shown], desk)
    if source in FIRST:
        invoke(FIRST[source])
    for one in shown:
        words = shlex.split(one.line)
        for name in written(words):
            removed(name)
        line = f"{one.line} {CHEAPER.get(one.line, '')}".strip()
        if WHOLE in line:
            line = line.replace("wall.pair.json", str(SAMPLE / "facade.pair.json"))
        with scheduler_of(line) as here:
            stdout, output = invoke(here)
        if one.prints:
            assert stdout.strip() == one.prints, one.line
        for name in written(words):
            assert Path(name).exists(), f"{one.line}: {name}"
        filled_in(source, words, desk)
        for page, part, _, printed in SAYS:
            if page == source and part in one.line:
                assert printed in output, f"{one.line}: no {printed} in\n{output}"
    for name in MADE.get(source, ()):
        assert Path(name).stat().st_size > 1000


def test_what_is_not_run_still_stands_in_a_page() -> None:
    lines = {shown.line for shown in SHOWN}
    assert sorted(set(NOT_RUN) - lines) == []
    assert sorted(set(CHEAPER) - lines) == []
    for source, known in RUN_BY.items():
        for line, other in known.items():
            assert Shown(source, line) in SHOWN
            assert line in [shown.line for shown in lines_of(other)]
    for source, part, words, _ in SAYS:
        assert words in re.sub(r"\s+", " ", (DOCS / source).read_text(encoding="utf-8"))
        assert any(part in one.line for one in lines_of(source)), f"{source}: {part}"


@pytest.mark.acceptance
def test_the_pictures_of_what_goes_wrong_are_made(tmp_path) -> None:
    line = "python docs/make_wrong_pictures.py"
    words = [sys.executable, str(ROOT / line.split()[1]), str(tmp_path)]
    assert any(shown.line == line for shown in SHOWN)
    subprocess.run(words, check=True)
    page = (DOCS / "what-goes-wrong.md").read_text(encoding="utf-8")
    made = sorted(path.name for path in tmp_path.iterdir())
    assert len(made) == 2
    assert [name for name in made if f"images/{name}" not in page] == []


def test_scripts_and_extras_that_pages_name_exist() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
        "optional-dependencies"
    ]
    for shown in SHOWN:
        if listed := re.match(r"pip install -r (\S+)", shown.line):
            assert (ROOT / listed[1]).is_file(), shown
        elif shown.line.startswith("pip install"):
            assert re.search(r"\[(\w+)\]", shown.line)[1] in extras
        if script := re.match(r"python (?:-m )?([\w./]+)", shown.line):
            module = ROOT / script[1].replace(".", "/")
            ways = (ROOT / script[1], module.with_suffix(".py"), module / "__main__.py")
            assert any(way.is_file() for way in ways), shown


@pytest.mark.acceptance
def test_options_of_dask_in_the_pages_are_its_own() -> None:
    worker = pytest.importorskip("distributed.cli.dask_worker").main
    scheduler = pytest.importorskip("distributed.cli.dask_scheduler").main
    lines = [shlex.split(shown.line) for shown in SHOWN if shown.line.startswith("dask ")]
    assert len(lines) >= 2
    for _, name, *words in lines:
        command = {"worker": worker, "scheduler": scheduler}[name]
        assert command.make_context(name, words).params
