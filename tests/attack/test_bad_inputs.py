"""What a hostile user tries: every refusal is one message, and nothing is left or changed.

One table over all commands of both programs. `INPUTS` and `OUTPUTS` name every place of a command
line that takes a file, and each meets every kind of bad file; `WORDS` holds options that cannot be
meant, `CONTENTS` files that are what they say but hold what cannot be.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from click.testing import CliRunner

from tests.attack.contents import CONTENTS
from tests.attack.lines import ALIGN, CURVE, INPUTS, OUTPUTS, SOLVE, WATER
from tests.attack.options import WORDS
from tests.attack.site import PROGRAMS
from tests.tables import each

#: A message must say how to mend it: what was expected, what to do, or that a thing is not there.
REMEDY = re.compile(
    r"add |are in |are not|at both ends|at least|below |belong|between|by letter|called|cannot"
    r"|check|choose|close|Convert|copy|create|damaged|decimal comma|did you mean|does not"
    r"|ends before|drawn|expected|fill in|found|free|give|has no |have no |holds|in metres|instead"
    r"|Invalid|is empty|is for|is no |is not|Known|lacks|leave |looks like|make|may not|missing"
    r"|must|name |need|neither|no such|none |not valid|only|outside|remove|requires|run `|save"
    r"|say how|take|to 30|too |twice|two prop|use |would be|write|written",
    re.IGNORECASE,
)


@pytest.fixture
def site(whole_site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder, current; files are links, so that a copy costs nothing."""
    shutil.copytree(whole_site, tmp_path / "site", copy_function=os.link)
    monkeypatch.chdir(tmp_path / "site")
    return tmp_path / "site"


def state(folder: Path) -> dict[str, object]:
    """Return what lies in a folder: kind, target, size, time and mode of each."""
    found: dict[str, object] = {}
    with os.scandir(folder) as entries:
        for entry in entries:
            told = entry.stat(follow_symlinks=False)
            link = Path(entry.path).readlink() if entry.is_symlink() else None
            is_folder = entry.is_dir(follow_symlinks=False)
            size = None if is_folder else (told.st_size, told.st_mtime_ns)
            found[entry.name] = (told.st_mode, link, size)
            if is_folder:
                below = state(Path(entry.path))
                found |= {f"{entry.name}/{name}": told for name, told in below.items()}
    return found


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Fail what works for longer, or waits for as many times fifteen: the machine may be busy."""

    def stop(number: int, frame: object) -> None:  # noqa: ARG001
        pytest.fail(f"still at work after {seconds} s")

    clocks = {signal.SIGPROF: signal.ITIMER_PROF, signal.SIGALRM: signal.ITIMER_REAL}
    earlier = {number: signal.signal(number, stop) for number in clocks}
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, 15 * seconds)
    try:
        yield
    finally:
        for number, clock in clocks.items():
            signal.setitimer(clock, 0)
            signal.signal(number, earlier[number])


def refused(line: str, culprit: str, *, folder: Path) -> str:
    """Run a line that must be refused, and hold the refusal to what is promised of it."""
    before = state(folder)
    program, *words = shlex.split(line)
    with within(20):
        result = CliRunner().invoke(PROGRAMS[program], words)
    said = result.stderr
    assert result.exit_code in (1, 2), f"exit {result.exit_code}: {result.output}"
    assert result.stdout == ""
    assert "Traceback" not in said
    assert len(re.findall(r"^Error: ", said, re.MULTILINE)) == 1, said
    message = said.partition("Error: ")[2]
    assert message.count("\n") == 1 or re.search(r"›|Usage", said), said
    assert re.search(culprit, message), f"{culprit!r} is not named: {said}"
    assert REMEDY.search(message), f"says no way out: {said}"
    assert state(folder) == before, "left or changed something"
    return message


def spoilt(folder: Path, kind: str, ending: str, valid: str) -> str:
    """Make a bad file of one kind, and return its name."""
    name = "bad" + ending
    path = folder / name
    whole = (folder / valid).read_bytes() if valid and (folder / valid).is_file() else b"valid"
    if kind == "long name":
        return 300 * "n" + ending
    if kind == "below a file":
        return f"lens.json/{name}"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path.name)
    elif kind == "dangling":
        path.symlink_to("nowhere")
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind != "missing":
        path.write_bytes({
            "empty": b"", "zeros": bytes(3000), "junk": bytes(range(255, -1, -1)) * 12,
            "prose": b"Dear Sir, find enclosed.\n", "photo": (folder / "far.jpg").read_bytes(),
            "zip": b"PK\x03\x04" + bytes(200), "half": whole[: len(whole) // 2],
            "utf-16": "id,x\nä,1\n".encode("utf-16-le"),
        }[kind])  # fmt: skip
    return name


KINDS = (
    "missing", "folder", "below a file", "long name", "pipe", "loop", "dangling", "device",
    "empty", "zeros", "junk", "prose", "photo", "zip", "half", "utf-16",
)  # fmt: skip


def remove(path: Path) -> None:
    """Remove what a case made, whatever it is: the next case finds the folder as it was."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@pytest.mark.parametrize(("line", "valid", "fine"), [(line, v, f) for line, v, *f in INPUTS])
def test_no_bad_file_is_taken(site: Path, line: str, valid: str, fine: list[str]) -> None:
    ending = "." + valid.partition(".")[2] if "." in valid else ""

    @each("kind", [kind for kind in KINDS if kind not in fine])
    def meets(kind: str) -> None:
        name = spoilt(site, kind, ending, valid)
        try:
            said = refused(line.replace("{}", name), re.escape(name[:60]), folder=site)
        finally:
            if kind not in ("long name", "below a file"):
                remove(site / name)
        if kind in ("pipe", "device"):
            assert "no such" not in said

    meets()


PLACES = (
    "exists", "folder", "no folder", "below a file", "long name", "dangling", "device", "pipe",
    "an input",
)  # fmt: skip


@pytest.mark.parametrize(("line", "ending", "fine"), [(line, e, f) for line, e, *f in OUTPUTS])
def test_no_bad_place_is_written_to(site: Path, line: str, ending: str, fine: list[str]) -> None:
    @each("place", [place for place in PLACES if place not in fine])
    def meets(place: str) -> None:
        name, more, made = "o" + ending, "", True
        if place == "exists":
            (site / name).write_bytes(b"mine")
        elif place == "no folder":
            name, made = "nowhere/" + name, False
        elif place == "device":
            (site / name).symlink_to("/dev/null")
            more = " --overwrite"
        elif place == "an input":
            words = line.split()
            name, made = next((w for w in words[2:] if (site / w).is_file()), ""), False
            if not name:
                return
        else:
            name = spoilt(site, place, ending, "")
            made = place not in ("long name", "below a file")
            more = " --overwrite" if place == "pipe" else ""
        try:
            refused(line.replace("{}", name) + more, re.escape(name[:60]), folder=site)
        finally:
            if made:
                remove(site / name)

    meets()


#: Cases of a command, one test each: a command is what one mends.
COMMANDS = sorted({line.split()[1] for line, *_ in (*WORDS, *CONTENTS)})
FINE_GRIDS = [case for case in WORDS if "--gsd 1e-" in case[0]]


@pytest.mark.parametrize("command", COMMANDS)
def test_no_impossible_option_is_taken(site: Path, command: str) -> None:
    @each("line, culprit", [c for c in WORDS if c[0].split()[1] == command and c not in FINE_GRIDS])
    def meets(line: str, culprit: str) -> None:
        refused(line, culprit, folder=site)

    meets()


@pytest.mark.acceptance
@each("line, culprit", FINE_GRIDS)
def test_no_pixel_is_taken_that_fills_the_memory(site: Path, line: str, culprit: str) -> None:
    refused(line, culprit, folder=site)


@pytest.mark.parametrize("command", COMMANDS)
def test_no_impossible_content_is_taken(site: Path, whole_site: Path, command: str) -> None:
    @each("line, name, content, culprit", [c for c in CONTENTS if c[0].split()[1] == command])
    def meets(line: str, name: str, content: object, culprit: str) -> None:
        data = content(site) if callable(content) else content
        (site / name).unlink(missing_ok=True)
        (site / name).write_bytes(data if isinstance(data, bytes) else str(data).encode())
        try:
            refused(line, culprit, folder=site)
        finally:
            remove(site / name)
            if (whole_site / name).exists():
                os.link(whole_site / name, site / name)

    meets()


#: What writes workbooks, here the user's own ones.
BOOKS = [
    *(line for line, ending, *_ in OUTPUTS if ending == ".xlsx"),
    "bifocal solve survey.xlsx --out {}",
    "multimedia particles tank.toml --targets t --targets t --targets t --targets t --out {}",
    "multimedia resect tank.toml --residuals {}",
    "multimedia project tank.toml --out {}",
    CURVE + " --out {}",
]


@each("line", BOOKS)
def test_a_workbook_that_is_open_is_not_written_to(site: Path, line: str) -> None:
    shutil.copyfile(site / "survey.xlsx", site / "open.xlsx")
    for name, lock in (("open.xlsx", "~$open.xlsx"), ("new.xlsx", ".~lock.new.xlsx#")):
        (site / lock).touch()
        said = refused(f"{line.replace('{}', name)} --overwrite", re.escape(name), folder=site)
        (site / lock).unlink()
        assert re.search(r"is open in (Excel|LibreOffice)\. Close it there", said), said
        assert lock in said


@pytest.mark.parametrize("lock", ["~$survey.xlsx", ".~lock.survey.xlsx#"])
def test_a_workbook_that_is_open_is_not_changed_in_place(site: Path, lock: str) -> None:
    (site / lock).touch()
    line = "bifocal solve survey.xlsx --out survey.xlsx --overwrite"
    assert "Close it there" in refused(line, r"survey\.xlsx", folder=site)


#: Lines whose output is one of the files they read; `resect` and `adjust` may renew their project.
IN_PLACE = [
    (f"multimedia bathymetry dem.tif {WATER} --out {{}}", "dem.tif"),
    (f"multimedia bathymetry cloud.las {WATER} --out {{}}", "cloud.las"),
    (f"bifocal solve survey.csv {SOLVE} --out {{}}", "survey.csv"),
    ("bifocal solve survey.xlsx --pair wall.pair.json --out {}", "survey.xlsx"),
    ("bifocal export survey.xlsx --out {}", "survey.xlsx"),
    ("bifocal export result.csv --out {}", "result.csv"),
    ("bifocal mosaic ortho1.tif ortho2.tif --out {}", "ortho2.tif"),
    ("bifocal calibrate far.jpg --lines lines.csv --out {}", "lines.csv"),
    ("bifocal calibrate far.jpg --database --out {}", "far.jpg"),
    ("bifocal ortho wall.pair.json --relief relief.tif --out {}", "relief.tif"),
    (
        "bifocal ortho wall.pair.json --relief relief.tif --deliver d --scale 1:100 --out {}",
        "relief.tif",
    ),
    ("bifocal mosaic ortho1.tif ortho2.tif --relief relief.tif --out {}", "relief.tif"),
    ("multimedia waterlevel cloud.csv --out {}", "cloud.csv"),
    ("multimedia shift shift.csv --z0 1 --indices 1,1.337 --out {}", "shift.csv"),
    (f"{ALIGN} --control control.csv --picture {{}}", "far.jpg"),
    (f"multimedia bathymetry cloud.csv {WATER} --cameras eyes.csv --out {{}}", "eyes.csv"),
    ("multimedia bathymetry dem.tif --index 1.34 --water-level relief.tif --out {}", "relief.tif"),
    ("multimedia project tank.toml --points shift.csv --out {}", "shift.csv"),
    ("multimedia project tank.toml --out {}", "tank_object_points.csv"),
    (
        "multimedia intersect tank.toml --points tank_image_points.csv --out {}",
        "tank_image_points.csv",
    ),
    ("multimedia resect tank.toml --out o.toml --residuals {}", "tank_image_points.csv"),
    (f"{CURVE} --out {{}}", "tank_object_points.csv"),
]


@each("line, name", IN_PLACE)
def test_an_input_is_no_output_and_no_option_is_named_that_would_not_help(
    site: Path, line: str, name: str
) -> None:
    line = line.format(name)
    first = refused(line, re.escape(name), folder=site)
    assert "--overwrite" not in first
    assert refused(f"{line} --overwrite", re.escape(name), folder=site) == first
