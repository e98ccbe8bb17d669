"""A survey killed at random moments, or on a cluster that loses a worker, gives the same files."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from bifocal.campaigns.survey_file import read_survey_file
from bifocal.campaigns.workflow import Machines, run_survey
from tests.bifocal.campaigns.rendered_survey import BROKEN, write_rendered_survey

pytestmark = pytest.mark.acceptance


def digests(folder: Path) -> dict[str, str]:
    """Return the hashes of all products; records bear times and are none."""
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.name.startswith(".")
    }


@pytest.fixture(scope="module")
def survey(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("street") / "survey"
    # Photos so small that a drawing is the longest step; benchmarks/bench_campaign.py takes forty.
    return write_rendered_survey(
        folder, pairs=5, width=240, products=("relief", "points", "drawing")
    )


@pytest.fixture(scope="module")
def undisturbed(survey) -> dict[str, str]:
    out = survey.parent / "undisturbed"
    result = run_survey(read_survey_file(survey, out=out), machines=Machines(jobs=1))
    assert [outcome.name for outcome in result.failed] == list(BROKEN)
    for outcome in result.failed:
        assert BROKEN[outcome.name] in outcome.message
    return digests(out)


def whole_pairs(out: Path) -> list[str]:
    """Return the pairs whose last step is made."""
    return sorted(path.parent.name for path in out.glob("*/drawing"))


def marks(folder: Path) -> dict[str, tuple[int, int]]:
    """Return what tells a file that was left alone from one that was made again."""
    files = [path for path in folder.rglob("*") if path.is_file() and path.name[0] != "."]
    return {str(path): (path.stat().st_ino, path.stat().st_mtime_ns) for path in files}


def run(survey: Path, out: Path) -> subprocess.Popen:
    words = [sys.executable, "-m", "bifocal", "survey", str(survey), "--out", str(out)]
    return subprocess.Popen(
        [*words, "--jobs", "2"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def test_killed_again_and_again_it_ends_with_the_same_files(survey, undisturbed):
    out = survey.parent / "killed"
    rng = np.random.default_rng(16)
    # First as soon as a pair is whole, then at any moment.
    process = run(survey, out)
    while not whole_pairs(out):
        assert process.poll() is None
        time.sleep(0.05)
    process.kill()
    process.wait(60)
    whole = whole_pairs(out)
    assert 0 < len(whole) < 3  # of those that can be made
    left_alone = {name: marks(out / name) for name in whole}
    for number, pause in enumerate(rng.uniform(2, 6, 2)):
        process = run(survey, out)
        time.sleep(pause)
        # Once as Ctrl-C does it, else as the system does without memory.
        process.send_signal(signal.SIGINT if number % 2 else signal.SIGKILL)
        process.wait(60)
    result = run_survey(read_survey_file(survey, out=out), machines=Machines(jobs=2))
    assert len(result.failed) == 2
    assert digests(out) == undisturbed
    assert {name: marks(out / name) for name in whole} == left_alone
    assert not [p for p in out.rglob(".*-writing-*")]
    again = run_survey(read_survey_file(survey, out=out))
    assert not any(outcome.done for outcome in again.outcomes)


@pytest.mark.long
@pytest.mark.parametrize("ship", [False, True])
def test_a_cluster_that_loses_a_worker_gives_the_same_files(survey, undisturbed, ship):
    distributed = pytest.importorskip("distributed")
    out = survey.parent / f"cluster{ship}"
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, resources={"memory": 4e9}
    ) as cluster:
        jobs = read_survey_file(survey, out=out)
        victim = next(iter(cluster.workers.values())).pid
        killed = []

        def kill(done: float, total: float, what: str = "") -> None:  # noqa: ARG001
            if not killed and done > 0:
                killed.append(victim)
                os.kill(victim, signal.SIGKILL)

        machines = Machines(scheduler=cluster.scheduler_address, ship=ship)
        result = run_survey(jobs, machines=machines, progress=kill)
    assert killed
    assert len(result.failed) == 2
    assert digests(out) == undisturbed
