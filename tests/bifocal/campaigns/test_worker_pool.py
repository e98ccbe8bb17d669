"""Pairs share cores and memory; a worker that dies loses its attempt, not the survey."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from bifocal.campaigns import worker_pool
from bifocal.campaigns.shipping import found_anywhere
from bifocal.campaigns.surveyed_pair import BASE_MEMORY, MEMORY_PER_PIXEL, PairJob
from bifocal.campaigns.worker_pool import Listener, run_here


@dataclass(frozen=True, slots=True, kw_only=True)
class SizedJob(PairJob):
    """A job of a known need that finds no photos."""

    need: int = 1

    def memory(self) -> int:
        return self.need


def jobs(tmp_path: Path, *needs: int) -> list[SizedJob]:
    absent = tmp_path / "absent.jpg"
    return [
        SizedJob(name=f"p{i}", folder=tmp_path / f"p{i}", far=absent, near=absent, need=need)
        for i, need in enumerate(needs)
    ]


def test_pairs_wait_for_memory_and_a_large_one_runs_alone(tmp_path):
    waiting = [(job, job.memory(), 1) for job in jobs(tmp_path, 6, 4, 6, 20)]
    running, workers = {}, []

    def start() -> worker_pool._Worker:
        class Silent:
            def send(self, job: object) -> None: ...

        return worker_pool._Worker(None, Silent())

    original, worker_pool._started = worker_pool._started, start
    try:
        worker_pool._share_out(waiting, running, workers, 10, 4)
        assert set(running) == {"p0", "p1"}  # 6 + 4 fill the 10; 6 more would be too much
        running.clear()
        for worker in workers:
            worker.job = None
        worker_pool._share_out(waiting, running, workers, 10, 4)
        assert set(running) == {"p2"}
        running.clear()
        workers[0].job = workers[1].job = None
        worker_pool._share_out(waiting, running, workers, 10, 4)
        assert set(running) == {"p3"}
    finally:
        worker_pool._started = original


def test_a_pair_needs_memory_for_the_larger_of_its_photos(tmp_path):
    far, near = tmp_path / "far.png", tmp_path / "near.png"
    for path, size in ((far, (20, 10)), (near, (40, 30))):
        Image.new("L", size).save(path)
    job = PairJob(name="p", folder=tmp_path, far=far, near=near)
    assert job.memory() == BASE_MEMORY + MEMORY_PER_PIXEL * 40 * 30
    near.unlink()
    assert job.memory() == BASE_MEMORY + MEMORY_PER_PIXEL * 20 * 10


def test_a_cluster_is_sent_paths_that_hold_in_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = [Path(name) for name in ("out/p", "far.jpg", "near.jpg", "points.csv", "out/joint")]
    folder, far, near, control, joint = names
    job = PairJob(
        name="p", folder=folder, far=far, near=near, files={"control": control}, joint=joint
    )
    sent = found_anywhere(job)
    found = [sent.folder, sent.far, sent.near, sent.files["control"], sent.joint]
    assert found == [tmp_path / name for name in names]
    assert found_anywhere(sent) == sent


def test_a_pair_that_fails_says_why_and_the_next_runs(tmp_path):
    outcomes = list(run_here(jobs(tmp_path, 1, 1), Listener(), most=1))
    assert [outcome.name for outcome in outcomes] == ["p0", "p1"]
    for outcome in outcomes:
        assert outcome.failed_step == "align"
        assert "absent.jpg" in outcome.message


class Suicidal(Path().__class__):
    """A path whose arrival in a worker ends its process, as the system does without memory."""

    def __reduce__(self):
        import os

        return os._exit, (9,)


def test_a_worker_that_dies_is_replaced_and_its_pair_tried_twice(tmp_path):
    good, bad = jobs(tmp_path, 1, 1)
    from dataclasses import replace

    bad = replace(bad, far=Suicidal(tmp_path / "x.jpg"))
    outcomes = {o.name: o for o in run_here([bad, good], Listener(), most=1)}
    assert "ended by itself twice" in outcomes["p1"].message
    assert outcomes["p0"].failed_step == "align"
