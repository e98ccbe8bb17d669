"""Which photo is the far one, on the page: exchanged at any stage, and acceptance taken back."""

from __future__ import annotations

import shutil
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from bifocal import SAMPLE, Pair
from bifocal.collimation.first_orientation import FirstOrientation
from bifocal.collimation.job_tasks import start_job
from bifocal.collimation.product_graph import causes_of
from bifocal.collimation.server.uploads import far_first
from bifocal.collimation.shapes import places_of
from bifocal.collimation.work.tasks import AlignTask
from photocore.images import ImageInfo
from tests.page_session import client_of, opened, pick, pick_both, sample_folder, sample_picks

REPORT = {"remarks": ["found"], "control": []}


@contextmanager
def begun(folder, *photos: str):
    """Yield a survey of both photos; in a folder where one was begun, that one."""
    with opened(*(folder / name for name in photos or ("far.jpg", "near.jpg"))) as session:
        yield session


@pytest.fixture
def folder(tmp_path):
    """Return the sample's photos, not oriented."""
    sample_folder(tmp_path)
    (tmp_path / "facade.pair.json").rename(tmp_path / "kept.json")
    return tmp_path


def test_a_resized_photo_of_the_long_lens_is_still_the_far_one() -> None:
    tags = {"focal_plane_pitch": 22.7 / 3072, "recorded_size": (3072, 2048)}
    far = ImageInfo(path=Path("a.jpg"), size=(1024, 683), focal_length=35, **tags)
    near = ImageInfo(path=Path("b.jpg"), size=(3072, 2048), focal_length=19, **tags)
    assert far_first([near, far]) == [far, near]
    without = replace(near, focal_plane_pitch=None)
    assert far_first([without, far]) == [far, without]


def test_picks_that_came_at_once_are_held_against_the_photos(folder) -> None:
    (folder / "kept.json").rename(folder / "facade.pair.json")
    with begun(folder, "facade.pair.json") as session:
        watch, picks = FirstOrientation(session), list(sample_picks().items())
        for name, (first, second) in picks:
            pick_both(session, name, (second, first))
        watch.hold_picks()
        assert any("PICKS" in text for text in state_of(session)["advice"])
        for name, both in picks:
            pick_both(session, name, both)
        watch.hold_picks()
        assert state_of(session)["advice"] == []


def oriented(session) -> None:
    """Let a job propose the sample's orientation, and accept it."""
    proposed = session.files.folder / "survey.proposed.pair.json"
    shutil.copyfile(SAMPLE / "facade.pair.json", proposed)
    session.propose(proposed, REPORT)
    session.command({"op": "align.accept"})


def state_of(session) -> dict:
    return client_of(session).get("/api/state").json()


def test_accepting_an_orientation_is_undone_and_redone(folder) -> None:
    with begun(folder) as session:
        pick_both(session, "T01", sample_picks()["T01"])
        oriented(session)
        assert state_of(session)["pair"]["accepted"]
        session.command({"op": "undo"})
        taken_back = state_of(session)
        assert taken_back["pair"]["accepted"] is False
        assert taken_back["pair"]["report"] == REPORT
        assert [point["name"] for point in taken_back["points"]] == ["T01"]
    with begun(folder) as session:
        assert state_of(session)["pair"]["accepted"] is False
        session.command({"op": "redo"})
        assert state_of(session)["pair"]["accepted"]
    with begun(folder) as session:
        assert state_of(session)["pair"]["accepted"]
        session.command({"op": "undo"})
        session.command({"op": "align.accept"})
        assert Pair.read(session.files.pair).d1 == pytest.approx(17.5)


def test_photos_are_exchanged_after_they_are_oriented_and_the_picks_go_along(folder) -> None:
    with begun(folder, "near.jpg", "far.jpg") as session:
        for image, focal in ((1, 35), (2, 19)):  # typed by the cards, whatever lies in them
            lens = {"focal_mm": focal, "sensor_width_mm": 22.7}
            session.command({"op": "photo.set", "image": image, **lens})
        first, second = sample_picks()["T01"]
        session.command(
            {"op": "control.pick", "name": "K", "image": 2, "column": 5.0, "row": 6.0}
        )  # fmt: skip
        pair = Pair.read(SAMPLE / "facade.pair.json").to_dict()
        pair["image1"]["file"], pair["image2"]["file"] = "near.jpg", "far.jpg"
        proposed = folder / "survey.proposed.pair.json"
        Pair.from_dict(pair).write(proposed)
        session.propose(proposed, REPORT)
        session.command({"op": "align.accept"})
        pick(session, "T01", 1, second)
        pick(session, "T01", 2, first)
        session.command({"op": "photos.exchange"})
        after = state_of(session)
        assert [photo["name"] for photo in after["photos"]] == ["far.jpg", "near.jpg"]
        assert [photo["focal_mm"] for photo in after["photos"]] == [35, 19]
        assert after["pair"] is None
        assert after["stage"] == "orientation"
        assert session.state.points["T01"].picks == (first, second)
        assert session.state.control["K"].picks == ((5.0, 6.0), None)
        pick(session, "T02", 1, first)
    with begun(folder) as again:
        assert again.pictures.infos[0].path.name == "far.jpg"
        assert (again.pictures.pair, again.proposal) == (None, None)
        assert again.state.points["T01"].picks == (first, second)
        oriented(again)
        assert state_of(again)["pair"]["accepted"]


def everything(session) -> dict:
    """Return what the page shows of a survey, but for the counters of its changes."""
    state = state_of(session)
    for key in ("revision", "serving", "redo", "undo", "stage", "workbook_waiting"):
        state.pop(key)
    files = state["products"]["files"]  # the workbook is written when it suits
    state["products"]["files"] = [one for one in files if not one["name"].endswith(".xlsx")]
    return state


def drawn(session) -> None:
    """Orient, and let a survey have something of each kind."""
    session.command({"op": "wall.set", "column": 700.0, "row": 500.0})
    oriented(session)
    pick_both(session, "T01", sample_picks()["T01"])
    corners = [[600.0, 400.0, -0.5], [800.0, 400.0, -0.5], [800.0, 700.0, -0.5]]
    for kind in ("face", "outline"):
        session.command({"op": "shape.set", "kind": kind, "corners": corners})
    shutil.copyfile(SAMPLE / "truth.tif", session.files.folder / "survey.relief.tif")
    session.note_made("relief", ["survey.relief.tif"], causes_of(session, "relief"))


@pytest.mark.parametrize("way", ["undo", "exchange"])
def test_an_exchange_is_taken_back_exactly_by_undo_and_by_itself(folder, way) -> None:
    back = {"op": "undo"} if way == "undo" else {"op": "photos.exchange"}
    with begun(folder) as session:
        drawn(session)
        before, files = everything(session), sorted(path.name for path in folder.iterdir())
        pair = session.files.pair.read_bytes()
        session.command({"op": "photos.exchange"})
        between = state_of(session)
        assert (between["pair"], between["products"]["relief"]) == (None, None)
        assert [photo["name"] for photo in between["photos"]] == ["near.jpg", "far.jpg"]
        session.command(back)
        assert everything(session) == before
        assert session.files.pair.read_bytes() == pair
        assert sorted(path.name for path in folder.iterdir()) == files
    with begun(folder) as again:
        assert everything(again) == before
        if way == "undo":
            again.command({"op": "redo"})
            assert state_of(again)["pair"] is None
            again.command({"op": "undo"})
            for _ in range(4):
                again.command({"op": "undo"})
            for _ in range(4):
                again.command({"op": "redo"})
        assert everything(again) == before


def found_turned(session, name: str) -> None:
    """Let a job propose the sample's orientation with far and near exchanged."""
    proposed = session.files.folder / name
    data = Pair.read(SAMPLE / "facade.pair.json").to_dict()
    Pair.from_dict(data).write(proposed)
    session.propose(proposed, REPORT | {"remarks": [name]})


@pytest.mark.parametrize("proposed_before", [False, True])
def test_an_exchange_that_a_job_found_is_undone_and_redone_exactly(
    folder, proposed_before: bool
) -> None:
    with begun(folder, "near.jpg", "far.jpg") as session:
        pick_both(session, "T01", sample_picks()["T01"][::-1])
        session.command({"op": "wall.set", "column": 700.0, "row": 500.0})
        if proposed_before:
            first = folder / "survey.proposed.pair.json"
            data = Pair.read(SAMPLE / "facade.pair.json").to_dict()
            data["image1"]["file"], data["image2"]["file"] = "near.jpg", "far.jpg"
            Pair.from_dict(data).write(first)
            session.propose(first, REPORT)
        before = everything(session)
        found_turned(session, "survey.found.pair.json")
        after = everything(session)
        assert [photo["name"] for photo in after["photos"]] == ["far.jpg", "near.jpg"]
        assert after["pair"]["report"]["remarks"] == ["survey.found.pair.json"]
        assert not session.state.ordered
        session.command({"op": "undo"})
        assert everything(session) == before
    with begun(folder, "near.jpg", "far.jpg") as again:
        assert everything(again) == before
        again.command({"op": "redo"})
        assert everything(again) == after
        again.command({"op": "undo"})
        assert everything(again) == before
    with begun(folder, "near.jpg", "far.jpg") as again:
        again.command({"op": "photos.exchange"})
        assert everything(again) == after


@pytest.mark.parametrize("quiet", [False, True])
def test_a_job_writes_over_no_orientation_that_was_proposed_before(
    folder, monkeypatch, quiet: bool
) -> None:
    tasks: list[AlignTask] = []
    with begun(folder) as session:
        monkeypatch.setattr(session.jobs, "start", lambda _, task, *__, **___: tasks.append(task()))
        start_job(session, "align", {"way": "auto"}, quiet=quiet)
        tasks[0].out.write_text("{}")
        start_job(session, "align", {"way": "auto"}, quiet=quiet)
    assert tasks[0].out != tasks[1].out


def test_shapes_go_with_an_exchange_to_the_same_place_of_the_wall(folder) -> None:
    with begun(folder) as session:
        drawn(session)
        pair = session.pictures.pair
        places = places_of(pair, session.state.shapes["F1"].corners)
        session.command({"op": "photos.exchange"})
        corners = [corner[:2] for corner in session.state.shapes["F1"].corners]
        assert corners == pytest.approx(pair.project(places)[1])


def test_a_new_orientation_after_an_exchange_leaves_the_first_one_as_it_was(folder) -> None:
    with begun(folder) as session:
        drawn(session)
        before, pair = everything(session), session.files.pair
        content = pair.read_bytes()
        session.command({"op": "photos.exchange"})
        proposed = folder / "survey.proposed.pair.json"
        data = Pair.read(SAMPLE / "facade.pair.json").to_dict()
        data["image1"]["file"], data["image2"]["file"] = "near.jpg", "far.jpg"
        Pair.from_dict(data).write(proposed)
        session.propose(proposed, REPORT)
        session.command({"op": "align.accept"})
        assert session.files.pair != pair
        session.command({"op": "undo"})
        session.command({"op": "undo"})
        assert everything(session) == before
        assert pair.read_bytes() == content


def test_a_survey_begun_with_a_pair_file_keeps_its_order(tmp_path) -> None:
    with (
        opened(sample_folder(tmp_path)) as session,
        pytest.raises(ValueError, match="begun with it"),
    ):
        session.command({"op": "photos.exchange"})
