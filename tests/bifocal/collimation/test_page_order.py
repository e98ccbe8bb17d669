"""Which photo is the far one, on the page: exchanged at any stage, and acceptance taken back."""

from __future__ import annotations

import shutil
from contextlib import contextmanager

import pytest

from bifocal import SAMPLE, Pair
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
        assert not (folder / "survey.pair.json").exists()
        session.command({"op": "undo"})
        assert session.state.points["T01"].picks == (None, second)
    with begun(folder) as again:
        assert again.pictures.infos[0].path.name == "far.jpg"
        assert (again.pictures.pair, again.proposal) == (None, None)
        assert again.state.points["T01"].picks == (None, second)
        oriented(again)
        assert state_of(again)["pair"]["accepted"]


def test_a_survey_begun_with_a_pair_file_keeps_its_order(tmp_path) -> None:
    with (
        opened(sample_folder(tmp_path)) as session,
        pytest.raises(ValueError, match="begun with it"),
    ):
        session.command({"op": "photos.exchange"})
