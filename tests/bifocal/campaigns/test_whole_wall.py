"""A survey whose pairs are adjusted in one frame and joined into one orthophoto."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import rasterio
from click.testing import CliRunner

from bifocal import InputError
from bifocal.campaigns import workflow
from bifocal.campaigns.pair_job import PairOutcome
from bifocal.campaigns.pair_steps import steps_of
from bifocal.campaigns.step_store import Step, run_step, step_key
from bifocal.campaigns.survey_file import mosaic_wanted, read_survey_file
from bifocal.campaigns.whole_wall import joint_step, run_whole
from bifocal.campaigns.workflow import plan_survey
from photocore.cli import no_progress
from photocore.provenance import FileHashes
from tests.bifocal.orientation.street import write_street
from tests.builders.commands import bifocal_command as main


def survey(folder: Path, *above: str) -> Path:
    # 17.5 m at 8.5 mm a pixel and 35 mm: 720 px are 12.24 mm.
    lines = ['scale = "1:100"', 'quality = "fast"', "sensor_width = 12.24", "focal1 = 35",
             "focal2 = 19", 'products = ["relief", "drawing"]', *above]  # fmt: skip
    for name in "abc":
        lines += ["[[pair]]", f'name = "{name}"', f'far = "{name}_far.png"']
        lines += [f'near = "{name}_near.png"', f'control = "{name}_all.csv"']
    path = folder / "street.toml"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.acceptance
@pytest.mark.long
def test_a_street_comes_into_one_frame_and_one_picture_and_stays(tmp_path):
    write_street(tmp_path)
    for name in "abc":
        parts = [(tmp_path / f"{name}_{r}.csv").read_text() for r in ("control", "check")]
        rest = "".join(parts[1].splitlines(keepends=True)[1:])
        (tmp_path / f"{name}_all.csv").write_text(parts[0] + rest)
    path = survey(tmp_path, "joint = true", "mosaic = true")
    first = CliRunner().invoke(main, ["survey", str(path), "--json"])
    assert first.exit_code == 0, first.stderr
    said = json.loads(first.stdout)
    assert (said["joint"]["done"], said["mosaic"]["done"]) == (["joint"], ["mosaic"])
    assert sorted(p.name for p in (tmp_path / "results/joint").glob("*.pair.json")) == [
        "a.pair.json", "b.pair.json", "c.pair.json",
    ]  # fmt: skip
    with rasterio.open(tmp_path / "results/mosaic/mosaic.tif") as file:
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        assert {1, 2, 3} <= set(file.read(4).ravel().tolist())
        assert (file.dataset_mask() > 0).mean() > 0.9
    again = CliRunner().invoke(main, ["survey", str(path), "--json"])
    said = json.loads(again.stdout)
    assert not any(pair["done"] for pair in [*said["pairs"], said["joint"], said["mosaic"]])


def test_what_is_wrong_above_the_pairs_is_said(tmp_path):
    path = survey(tmp_path, 'joint = "yes"')
    with pytest.raises(InputError, match="joint = 'yes': expected true or false"):
        read_survey_file(path)
    text = path.read_text()
    path.write_text(text.replace('"yes"', "false\nmosaic = {gsd = -1, blend = 2, colour = 1}"))
    for said in ("gsd = -1: expected a", "blend = 2: expected true", "colour = 1: .* no such key"):
        with pytest.raises(InputError, match=f"above the pairs: mosaic, {said}"):
            read_survey_file(path)
    path.write_text(text.replace('"yes"', 'false\nmosaic = {gsd = "1cm", gain = false}'))
    assert len(read_survey_file(path)) == 3
    assert mosaic_wanted(path) == {"gsd": 0.01, "gain": False}
    path.write_text(text)
    assert mosaic_wanted(path) is None
    path.write_text(text.replace('name = "b"', 'name = "mosaic"').replace('"yes"', "1"))
    with pytest.raises(InputError, match="folders of the whole survey"):
        read_survey_file(path)
    path.write_text(path.read_text().replace("joint = 1", "joint = false"))
    assert [job.name for job in read_survey_file(path)] == ["a", "mosaic", "c"]


def test_tables_in_several_units_are_not_adjusted_as_one(tmp_path):
    path = survey(tmp_path, "joint = true")
    write_files(tmp_path)
    text = path.read_text()
    assert len(read_survey_file(path)) == 3
    path.write_text(text + 'unit = "mm"\n')  # of the last pair
    with pytest.raises(InputError, match="unit: the pairs say different things"):
        read_survey_file(path)
    path.write_text(text.replace("[[pair]]", 'unit = "mm"\n[[pair]]', 1))
    (job, *_) = jobs = read_survey_file(path)
    assert joint_step([replace(job, files={}, options={}), *jobs[1:]]).options == {"unit": "mm"}


def write_files(folder: Path) -> None:
    for name in "abc":
        for rest in ("far.png", "near.png", "all.csv"):
            (folder / f"{name}_{rest}").write_text(name)


def test_the_plan_tells_of_the_common_frame_that_is_still_to_be_found(tmp_path):
    write_files(tmp_path)
    jobs = read_survey_file(survey(tmp_path, "joint = true"))
    for job in jobs:

        def make(place, progress, title=job.title):  # noqa: ARG001
            (place / f"{title}.pair.json").write_text("{}")
            return ()

        step, hashes = replace(steps_of(job)[0], make=make), FileHashes(tmp_path / "hashes.json")
        key = step_key(step, {}, hashes)
        run_step(job.folder, step, key, hashes, progress=no_progress, overwrite=False)
    each = [("align", "keep"), ("relief", "make"), ("drawing", "make")]
    assert plan_survey(jobs, mosaic={}) == [
        *((name, *row) for name in "abc" for row in each),
        ("all pairs", "joint", "make"), ("all pairs", "mosaic", "make"),
    ]  # fmt: skip


def test_pairs_that_wait_for_a_frame_that_failed_are_not_called_made(tmp_path, monkeypatch):
    jobs = read_survey_file(survey(tmp_path, "joint = true"))
    alone = {job.name: PairOutcome(name=job.name, done=("align",)) for job in jobs}
    alone["b"] = PairOutcome(name="b", failed_step="align", message="no photo.")
    broken = PairOutcome(name="joint", failed_step="joint", message="nothing joins a and c.")
    monkeypatch.setattr(workflow, "_aligned", lambda *_: dict(alone))
    monkeypatch.setattr(workflow, "_one_frame", lambda *_: broken)
    result = workflow.run_survey(jobs)
    assert result.lines()[0].startswith("3 pairs: 0 made, 0 kept as they were, 3 failed;")
    told = {outcome.name: outcome.message for outcome in result.failed}
    assert (told["b"], told["joint"]) == ("no photo.", "nothing joins a and c.")
    assert told["a"] == told["c"]
    assert "see joint" in told["a"]


def test_a_full_disk_at_the_end_costs_no_more_than_the_last_step(tmp_path):
    def make(place, progress):  # noqa: ARG001
        raise OSError(28, "No space left on device")

    step = Step(name="mosaic", files={}, make=make)
    outcome = run_whole(tmp_path, step, overwrite=False)
    assert (outcome.failed_step, outcome.done) == ("mosaic", ())
    assert outcome.message.endswith("No space left on device.")
