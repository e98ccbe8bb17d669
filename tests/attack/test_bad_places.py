"""Full disks, foreign folders, closed pipes, missing homes and terminals: what a process can meet.

And, in acceptance, every writing command killed and interrupted at random moments.
"""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from photocore.interrupts import STOPPED
from tests.attack.lines import OUTPUTS, SOLVE
from tests.attack.test_bad_inputs import state

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="forks processes")
Run = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def run() -> Iterator[Run]:
    """Return a function that runs a line in a folder, under conditions."""
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.attack.forks"], stdin=subprocess.PIPE,
        stdout=subprocess.PIPE, text=True,
    )  # fmt: skip

    def one(line: str, folder: Path, **conditions: Any) -> dict[str, Any]:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps({"line": line, "folder": str(folder), **conditions}) + "\n")
        process.stdin.flush()
        return json.loads(process.stdout.readline())

    yield one
    process.communicate()


@pytest.fixture
def site(whole_site: Path, tmp_path: Path) -> Path:
    shutil.copytree(whole_site, tmp_path / "site", copy_function=os.link)
    return tmp_path / "site"


def one_message(said: dict[str, Any]) -> None:
    assert said["status"] == 1, said
    assert "Traceback" not in said["stderr"], said["stderr"]
    assert "nobody foresaw" not in said["stderr"], said["stderr"]
    assert len(re.findall(r"^Error: ", said["stderr"], re.MULTILINE)) == 1, said["stderr"]


#: Lines that take long; what they do is done by others too.
SLOW = ("align", "--plot", "--picture")
WRITING = [(line, ending) for line, ending, *_ in OUTPUTS if not any(word in line for word in SLOW)]
IDS = [line.replace("{}", "o" + ending) for line, ending in WRITING]


@pytest.mark.parametrize(("line", "ending"), WRITING, ids=IDS)
def test_a_full_disk_leaves_nothing_and_changes_nothing(
    run: Run, site: Path, line: str, ending: str
) -> None:
    (site / f"o{ending}").write_bytes(b"mine")
    before = state(site)
    said = run(f"{line.replace('{}', 'o' + ending)} --overwrite", site, limit=150)
    if said["status"] == 0 and "was replaced" not in said["stderr"]:  # so short a file fits
        assert (site / f"o{ending}").stat().st_size <= 150
        return
    one_message(said)
    assert state(site) == before
    assert (site / f"o{ending}").read_bytes() == b"mine"


@pytest.mark.skipif(
    not hasattr(os, "getuid") or os.getuid() != 0, reason="only root becomes nobody"
)
@pytest.mark.parametrize(("line", "ending"), WRITING[1::4], ids=IDS[1::4])
def test_a_folder_of_somebody_else_is_not_written_to(
    run: Run, site: Path, line: str, ending: str
) -> None:
    for path in (site, *site.parents):
        if path.owner() == "root" and str(path).startswith("/tmp/"):
            path.chmod(0o755)
    before = state(site)
    one_message(run(line.replace("{}", "o" + ending), site, user=True))
    assert state(site) == before


PRINTING = [
    f"bifocal solve survey.csv {SOLVE} --json",
    f"bifocal solve survey.csv {SOLVE}",
    "bifocal plan --focal 35 --focal 19 --sensor 22.7x15.1 --pixels 3072x2048 --scale 500",
    "multimedia index --json",
    "multimedia project tank.toml",
    "multimedia shift shift.csv --z0 1 --indices 1,1.337 --json",
    "multimedia waterlevel cloud.csv",
]


@pytest.mark.parametrize("line", PRINTING)
def test_whatever_stdout_is_no_traceback_comes(run: Run, site: Path, line: str) -> None:
    before = state(site)
    full = run(line, site, stdout="/dev/full")
    assert full["status"] in (1, 120), full
    for conditions in ({"stdout": "pipe"}, {"stdout": "closed"}):
        said = run(line, site, **conditions)
        assert said["status"] in (0, 1), said
        assert "Traceback" not in said["stderr"]
    for conditions in ({"stdin": "closed"}, {"home": False}):
        said = run(line, site, **conditions)
        assert said["status"] == 0, said
    assert state(site) == before


def test_json_is_json_whatever_letters_stdout_lacks(run: Run, site: Path) -> None:
    name = "caffè 東 \U0001f40b"
    text = (site / "survey.csv").read_text().replace("P0", name)
    (site / "survey.csv").unlink()
    (site / "survey.csv").write_text(text, encoding="utf-8")
    for encoding in ("ascii", "latin-1", "cp437", "utf-8"):
        said = run(f"bifocal solve survey.csv {SOLVE} --json", site, encoding=encoding)
        assert said["status"] == 0, said
        if encoding in ("ascii", "utf-8"):
            assert json.loads(said["stdout"])["points"][0]["id"] == name
        said = run(f"bifocal solve survey.csv {SOLVE}", site, encoding=encoding)
        assert said["status"] == 0, said
        assert "caff" in said["stdout"]


@pytest.mark.acceptance
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=["kill", "interrupt"])
@pytest.mark.parametrize(("line", "ending"), WRITING, ids=IDS)
def test_killed_at_any_moment_nothing_is_half_written(
    run: Run, whole_site: Path, tmp_path: Path, line: str, ending: str, number: int
) -> None:
    """Random moments; the output is its old or its whole new self, the rest untouched.

    One in two lies in the last third of the time, when files are written.

    BIFOCAL_SEED=1, 2, 3 ... in the environment makes other moments.
    """
    rng = random.Random(f"{line} {number} {os.environ.get('BIFOCAL_SEED', '')}")
    name = "o" + ending
    words = f"{line.replace('{}', name)} --overwrite"
    site = tmp_path / "site"
    shutil.copytree(whole_site, site, copy_function=os.link)
    start = time.monotonic()
    assert run(words, site)["status"] == 0
    length = time.monotonic() - start
    new = sizes_of(site / name)
    is_folder = (site / name).is_dir()
    inputs = state(whole_site)
    for moment in range(3):
        after = rng.uniform(0 if moment % 2 else 0.7 * length, 1.1 * length)
        if is_folder:
            shutil.rmtree(site / name, ignore_errors=True)
        else:
            (site / name).unlink()
            (site / name).write_bytes(b"mine")
        said = run(words, site, signal=int(number), after=after)
        if number == signal.SIGKILL:
            assert said["status"] in (0, -number), said
            assert "Traceback" not in said["stderr"]
        else:
            assert said["status"] in (0, 1), said
            assert not said["status"] or said["stderr"].splitlines()[-1] == STOPPED, said
            assert said["stderr"].count(STOPPED) == said["status"], said
            assert "Traceback" not in said["stderr"]
            assert "Error" not in said["stderr"], said
            assert not [*site.rglob(".*")], "left something hidden"
        sizes, old = sizes_of(site / name), {} if is_folder else {name: 4}
        assert sizes == old or all(
            abs(sizes.get(one, 0) - size) <= 0.02 * size + 64 for one, size in new.items()
        ), (sizes, new)
    again = run(words, site)
    assert again["status"] == 0, again
    now = state(site)
    assert {path: now[path] for path in inputs} == inputs


def sizes_of(path: Path) -> dict[str, int]:
    """Return the size of a file, or of all files of a folder, by name."""
    files = [path, *path.rglob("*")]
    return {one.name: one.stat().st_size for one in files if one.is_file()}
