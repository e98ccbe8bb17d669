"""Pairs travel with their files and come back as if they had been made here."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from bifocal import InputError
from bifocal.campaigns.dask_cluster import _Crew, _look
from bifocal.campaigns.pair_job import run_pair
from bifocal.campaigns.shipping import packed, run_parcel, unpacked
from bifocal.campaigns.step_store import Step
from bifocal.campaigns.surveyed_pair import PairJob
from photocore.provenance import program


@pytest.fixture
def job(tmp_path, monkeypatch) -> PairJob:
    """A pair whose steps write down what they read; the second wants a table."""

    def steps_of(job: PairJob) -> list[Step]:
        def align(place: Path, progress: object) -> tuple[str, ...]:  # noqa: ARG001
            (place / "a.txt").write_bytes(job.far.read_bytes() + job.near.read_bytes())
            return (f"looked at {job.far}",)

        def points(place: Path, progress: object) -> tuple[str, ...]:  # noqa: ARG001
            table = job.files["control"].read_text()
            if table == "wrong":
                raise InputError(f"{job.files['control']}: is wrong.")
            (place / "deep").mkdir()
            (place / "deep/p.txt").write_text(table + (job.folder / "align/a.txt").read_text())
            return ()

        photos = {"far": job.far, "near": job.near}
        table = {"control": job.files["control"]}
        return [
            Step(name="align", files=photos, make=align),
            Step(name="points", files=table, after=("align",), make=points),
        ]

    monkeypatch.setattr("bifocal.campaigns.pair_job.steps_of", steps_of)
    (tmp_path / "photos").mkdir()
    for name in ("photos/far.jpg", "photos/near.jpg", "control.csv"):
        (tmp_path / name).write_text(name)
    return PairJob(
        name="a", folder=tmp_path / "results/a", far=tmp_path / "photos/far.jpg",
        near=tmp_path / "photos/near.jpg", files={"control": tmp_path / "control.csv"},
        date="2026-11-22",
    )  # fmt: skip


def made(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*") if path.is_file() and path.name[0] != "."
    }  # fmt: skip


def test_what_comes_back_is_what_would_have_been_made_here(job):
    delivery = run_parcel(packed(job))
    assert not job.folder.exists()
    outcome = unpacked(job, delivery)
    assert outcome.done == ("align", "points")
    assert outcome.remarks == (f"align: looked at {job.far}",)
    there = made(job.folder)
    assert there["points/deep/p.txt"] == b"control.csvphotos/far.jpgphotos/near.jpg"
    # Here nothing is left to do, and there neither.
    assert run_pair(job).kept == ("align", "points")
    again = run_parcel(packed(job))
    assert (again.outcome.kept, dict(again.steps)) == (("align", "points"), {})


def test_steps_before_a_failure_come_back_and_the_message_speaks_of_here(job):
    job.files["control"].write_text("wrong")
    outcome = unpacked(job, run_parcel(packed(job)))
    assert (outcome.done, outcome.failed_step) == (("align",), "points")
    assert outcome.message == f"{job.files['control']}: is wrong."
    assert set(made(job.folder)) == {"align/a.txt"}


def test_a_file_changed_here_meanwhile_is_not_replaced(job):
    unpacked(job, run_parcel(packed(job)))
    job.files["control"].write_text("new")
    delivery = run_parcel(packed(job))
    (job.folder / "points/deep/p.txt").write_text("mine")
    outcome = unpacked(job, delivery)
    assert outcome.failed_step == "deliver"
    assert "was changed after it was made" in outcome.message
    assert made(job.folder)["points/deep/p.txt"] == b"mine"


def test_an_absent_photo_is_named_before_anything_is_sent(job):
    job.near.unlink()
    with pytest.raises(InputError, match=r"near\.jpg: cannot be read"):
        packed(job)


def test_a_machine_that_does_not_see_a_folder_says_so(tmp_path):
    assert _look(str(tmp_path / "absent")) == (program(), "")


@pytest.mark.parametrize("first_sees", [True, False])
def test_photos_are_sent_as_soon_as_one_worker_does_not_see_the_folder(
    tmp_path, monkeypatch, first_sees
):
    """And on, although one that comes later sees it."""
    workers, lines = {"a": {"nthreads": 2}}, []
    client = SimpleNamespace(scheduler_info=lambda **_: {"workers": dict(workers)})
    sees = {"a": first_sees, "b": not first_sees}
    monkeypatch.setattr(
        "bifocal.campaigns.dask_cluster._see_folder", lambda *of: all(sees[w] for w in of[3])
    )
    crew = _Crew(client, "tcp://x", tmp_path, SimpleNamespace(heard=lines.append), ship=False)
    assert crew.ship is not first_sees
    workers["b"] = {"nthreads": 3}
    crew.look()
    assert (crew.ship, crew.threads) == (True, 5)
    crew.look()  # nobody new: nothing to tell
    assert [line.count("photos are sent") for line in lines] == [int(not first_sees), 1]
    assert "workers 2, pairs at once 5" in lines[1]
