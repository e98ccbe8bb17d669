"""A folder with an earlier delivery: other photos are refused, and nothing stays mixed."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from bifocal.campaigns.leftovers import remove_leftovers
from bifocal.campaigns.pair_job import run_steps
from bifocal.campaigns.step_store import Step
from bifocal.campaigns.verification import verify
from bifocal.campaigns.workflow import facade, facade_job
from photocore.cli import no_progress
from photocore.errors import InputError
from photocore.provenance import FileHashes


def photos(folder: Path, wall: str, shade: int) -> dict[str, Path]:
    paths = {role: folder / f"{wall}_{role}.png" for role in ("far", "near")}
    for number, path in enumerate(paths.values()):
        Image.new("L", (40, 30), shade + number).save(path)
    return paths


def made(out: Path, files: dict[str, Path], steps: dict[str, str]) -> None:
    """Make steps that only write what is said of each; all but the first follow it."""

    def step(name: str, text: str) -> Step:
        def make(place: Path, progress: object) -> tuple[str, ...]:  # noqa: ARG001
            (place / f"{name}.txt").write_text(text)
            return ()

        after = () if name == "align" else ("align",)
        own = files if name == "align" else {}
        return Step(name=name, files=own, after=after, make=make)

    todo = [(step(name, text), no_progress) for name, text in steps.items()]
    hashes = FileHashes(out / ".hashes.json")
    outcome = run_steps("wall", out, todo, hashes, overwrite=True)
    assert not outcome.failed_step, outcome.message


def test_a_delivery_made_from_other_photos_is_refused_before_any_work(tmp_path):
    first, second = photos(tmp_path, "a", 10), photos(tmp_path, "b", 90)
    out = tmp_path / "wall"
    made(out, first, {"align": "a", "points": "a"})
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    job = facade_job(*second.values(), out, given={"as_set_up": True})
    with pytest.raises(InputError, match=r"a_far\.png, a_near\.png.*--overwrite"):
        facade(job)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    # A third photo makes a set of the same two: no other delivery.
    job = facade_job(*first.values(), out, more=(second["far"],), given={"as_set_up": True})
    with pytest.raises(InputError) as caught:
        facade(job)
    assert "other photos" not in str(caught.value)


def test_what_no_longer_follows_is_removed_and_what_was_changed_stays_and_is_named(tmp_path):
    first, second = photos(tmp_path, "a", 10), photos(tmp_path, "b", 90)
    out = tmp_path / "wall"
    made(out, first, {"align": "a", "points": "a", "ortho": "a", "view": "a"})
    job = facade_job(*first.values(), out, products=("report",))
    assert remove_leftovers(job, ["align"]) == ()  # not asked for this time, but of this pair
    made(out, second, {"align": "b"})
    (out / "ortho" / "ortho.txt").write_text("mine")
    assert not verify(out).same
    job = facade_job(*second.values(), out, products=("report",), overwrite=True)
    said = remove_leftovers(job, ["align"])
    assert [text.split(":")[0] for text in said] == ["points", "ortho", "view"]
    assert "removed: points.txt" in said[0]
    assert "ortho.txt" in said[1]
    assert "stays" in said[1]
    assert (out / "ortho" / "ortho.txt").read_text() == "mine"
    assert sorted(path.name for path in out.iterdir() if path.name[0] != ".") == ["align", "ortho"]
    (out / "ortho" / "ortho.txt").unlink()
    assert verify(out).same


def test_a_step_that_was_asked_for_and_has_no_table_now_does_not_stay(tmp_path):
    files = photos(tmp_path, "a", 10)
    out = tmp_path / "wall"
    made(out, files, {"align": "a", "points": "a"})
    (said,) = remove_leftovers(facade_job(*files.values(), out), ["align"])
    assert "removed: points.txt" in said
    assert not (out / "points").exists()
