"""Products of another state of their causes: said, made again, never packed with new ones."""

from __future__ import annotations

import json
import shutil
from pathlib import PurePath

import numpy as np
import pytest

from bifocal import SAMPLE, Pair, ReliefMap
from bifocal.collimation.job_tasks import finish, task_of
from bifocal.collimation.product_graph import out_of_date
from bifocal.collimation.wording import without_options
from bifocal.files.made_from import MadeFrom
from bifocal.remarks import remark
from tests.page_session import client_of, opened, pick_both, sample_folder, sample_picks

DOOR = [[600.0, 400.0, -0.5], [800.0, 400.0, -0.5], [800.0, 700.0, -0.5]]


@pytest.fixture
def survey(tmp_path):
    """An open survey of the sample, its relief and a sheet as if jobs had made them."""
    with opened(sample_folder(tmp_path)) as session:
        make(session, "relief")
        make(session, "deliver")
        yield session


def make(session, kind):
    """Let a job end whose files are written here."""
    task = task_of(session, kind, {})
    folder = session.files.folder
    if kind == "relief":
        relief = np.full((4, 6), len(session.state.shapes) / 10.0, np.float32)
        matrix = [[0.5, 0, -1], [0, -0.5, 1], [0, 0, 1]]
        pair = session.pictures.pair
        ReliefMap.from_relief(relief, plane_from_pixel=matrix).write(
            folder / "facade.relief.tif", overwrite=True,
            tags=MadeFrom.of((pair.image1, pair.image2)).tags(),
        )  # fmt: skip
        finish(session, task, {})
        return task
    (folder / "facade-delivered").mkdir(exist_ok=True)
    (folder / "facade-delivered" / "sheet.pdf").write_bytes(b"%PDF")
    finish(session, task, {"files": ["sheet.pdf"], "made": {}, "remarks": []})
    return task


def names(session):
    from bifocal.collimation.server.product_routes import bundle_of

    return {PurePath(name).name for name in bundle_of(session)}


def test_what_was_just_made_is_up_to_date_also_after_a_new_start(survey, tmp_path):
    assert out_of_date(survey) == {}
    assert {"facade.relief.tif", "sheet.pdf"} <= names(survey)
    causes = client_of(survey).get("/api/state").json()["products"]["made_from"]
    assert causes == {
        "relief": "Made from: orientation.", "deliver": "Made from: orientation, relief.",
    }  # fmt: skip
    survey.journal.close()
    with opened(tmp_path) as again:
        assert out_of_date(again) == {}
        again.command({"op": "shape.set", "kind": "face", "corners": DOOR})
        assert out_of_date(again)["relief"] == ["faces"]


def test_a_face_drawn_since_leaves_relief_and_package_behind_and_out(survey):
    survey.command({"op": "shape.set", "kind": "face", "corners": DOOR})
    assert out_of_date(survey) == {"relief": ["faces"], "deliver": ["faces", "relief"]}
    facts = client_of(survey).get("/api/state").json()["products"]
    assert facts["made_from"] == {}
    stale = facts["stale"]
    assert stale["relief"].startswith("Out of date, changed since: drawn faces.")
    assert not {"facade.relief.tif", "sheet.pdf"} & names(survey)
    assert {"far.jpg", "facade.pair.json"} <= names(survey)
    survey.command({"op": "undo"})
    assert "faces" not in out_of_date(survey).get("relief", ()), "as it was made"


def test_everything_made_again_begins_with_what_is_out_of_date(survey):
    survey.command({"op": "shape.set", "kind": "face", "corners": DOOR})
    task = task_of(survey, "deliver", {})
    assert task.relief_first
    assert task.ortho_first
    make(survey, "relief")
    assert out_of_date(survey) == {"deliver": ["faces", "relief"]}
    make(survey, "deliver")
    assert out_of_date(survey) == {}


def test_an_outline_or_a_point_concerns_the_package_alone(survey):
    survey.command({"op": "shape.set", "kind": "outline", "corners": DOOR})
    assert out_of_date(survey) == {"deliver": ["outlines"]}
    pick_both(survey, "T01", sample_picks()["T01"])
    assert out_of_date(survey) == {"deliver": ["points", "outlines"]}


@pytest.mark.parametrize("recorded", [True, False])
def test_a_pair_that_was_scaled_since_makes_all_of_it_out_of_date(survey, recorded):
    if not recorded:  # by the journal of an older version: the map tells of itself
        survey.products.causes.clear()
    path = survey.files.folder / "facade.pair.json"
    data = json.loads(path.read_text())
    data["image1"]["distance"] *= 1.2
    path.write_text(json.dumps(data))
    survey.use_pair(path)
    assert out_of_date(survey)["relief"] == ["pair"]
    assert not {"facade.relief.tif", "sheet.pdf"} & names(survey)


def control(session, name, x, at):
    session.command({"op": "control.set", "name": name, "X": x, "Y": 0.0, "r": 0.0})
    for image in (1, 2):
        session.command(
            {"op": "control.pick", "name": name, "image": image, "column": at[0], "row": at[1]}
        )  # fmt: skip


def proposed(session, **report):
    """Let *Align* end with the sample's pair, and what it has to report."""
    task = task_of(session, "align", {})
    shutil.copyfile(SAMPLE / "facade.pair.json", task.out)
    finish(session, task, {"remarks": [], "control": [], **report})


def test_the_worst_that_is_known_of_a_pair_stands_first_and_says_how_bad_it_is(tmp_path):
    folder = sample_folder(tmp_path)
    (folder / "facade.pair.json").rename(folder / "kept.json")
    with opened(folder / "far.jpg", folder / "near.jpg") as session:
        alarm = remark("orientation.misses_lines", sigma=3.0, reason="anything")
        proposed(session, remarks=["A tip.", str(remark("rectify.no_picks", path="a")), str(alarm)])
        state = client_of(session).get("/api/state").json()
        words = without_options(alarm)
        assert state["advice"][0] == state["pair"]["remarks"][0] == words
        assert state["pair"]["remarks"][-1] == "A tip."
        assert state["levels"][words] == "alarm"
        assert "A tip." not in state["levels"]
        # Of a tip alone the next step stands first.
        proposed(session, remarks=["A tip."])
        assert "A tip." not in client_of(session).get("/api/state").json()["advice"]


def test_control_changed_after_align_is_said_and_counts_again_when_taken_back(tmp_path):
    folder = sample_folder(tmp_path)
    (folder / "facade.pair.json").rename(folder / "kept.json")
    with opened(folder / "far.jpg", folder / "near.jpg") as session:
        control(session, "K1", 1.0, (300.0, 300.0))
        proposed(session, control=[{"id": "K1", "residual_px": [0.1, 0.1, 0.1, 0.1]}])
        client = client_of(session)

        def shown():
            state = client.get("/api/state").json()
            return state["pair"]["current"], state["control"][0]["residual"], state["advice"][0]

        assert shown()[:2] == (True, {"1": [0.1, 0.1], "2": [0.1, 0.1]})
        session.command({"op": "control.set", "name": "K1", "X": 2.0})
        current, residual, advice = shown()
        assert (current, residual) == (False, None)
        assert "align the photos again" in advice
        session.command({"op": "undo"})
        assert shown()[0]
        session.command({"op": "control.use", "name": "K1", "use": False})
        assert not shown()[0]
        assert Pair.read(session.proposed_path).d1 == pytest.approx(17.5)


def test_a_client_finds_what_to_open_on_top_and_all_else_in_data(tmp_path):
    from bifocal.collimation.server.product_routes import bundle_of

    folder = sample_folder(tmp_path)
    endings = (".pdf", ".dxf", ".png", ".tif", ".tfw", "_relief.pdf", "_relief.dxf", "_report.html")
    with opened(folder) as session:
        for name in (made := [f"facade{ending}" for ending in endings]):
            (folder / name).write_bytes(b"x")
        session.note_made("deliver", made)
        names = set(bundle_of(session))
        # A photo that is called as a sheet stays among the photos.
        photo = {"facade.png": folder / "far.jpg"}
        held = session.products.bundle(session.files.workbook, photo)
        assert held["data/facade.png"] == folder / "far.jpg"
        assert held["facade.png"] == folder / "facade.png"
    top = {"facade.pdf", "facade.dxf", "facade.png", "facade_relief.pdf", "facade_report.html"}
    assert {name for name in names if "/" not in name} - {"facade.xlsx"} == top
    inside = {"data/facade.tif", "data/facade_relief.dxf", "data/facade.pair.json", "data/far.jpg"}
    assert inside <= names
