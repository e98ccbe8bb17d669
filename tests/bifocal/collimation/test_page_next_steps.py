"""The one next step of each stage, from the survey's state alone."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

import bifocal.collimation
from bifocal.collimation.jobs import PageJob
from bifocal.collimation.next_steps import Action, NextStep, Status, next_steps
from tests.page_session import (
    client_of,
    opened,
    pick_both,
    proposed,
    sample_folder,
    sample_picks,
    two_photos,
)

WEB = Path(bifocal.collimation.__file__).parent / "web" / "js"
PLACES = {"A": (300, 250), "B": (1200, 240), "C": (1210, 700), "D": (310, 690)}


def step_of(session, stage: str) -> tuple[str, str, int, bool]:
    step = next_steps(session)[stage]
    return step.action, step.status, step.count, step.ready


def test_from_two_photos_to_the_package_there_is_one_step_at_a_time(tmp_path) -> None:
    with opened(tmp_path) as session:
        client = client_of(session)
        assert step_of(session, "photos") == ("choose", "drop", 0, True)
        assert step_of(session, "orientation") == ("photos", "photos", 0, True)
        two_photos(tmp_path)
        session.give_photos([tmp_path / "far.jpg", tmp_path / "near.jpg"])
        assert next_steps(session)["photos"] == NextStep("orientation", done=True)
        assert step_of(session, "orientation") == ("control", "control", 0, True)
        assert step_of(session, "points") == ("orientation", "pair", 0, True)
        proposed(session, tmp_path)
        assert step_of(session, "orientation") == ("length", "length", 0, True)
        assert "Draw one length" in client.get("/api/state").json()["steps"]["orientation"]["text"]
        length = {"op": "length.set", "image": 1, "ends": [[300, 250], [1200, 240]]}
        session.command({**length, "length": 8.8})
        assert step_of(session, "orientation") == ("accept", "accept", 0, True)
        session.command({"op": "align.accept"})
        assert next_steps(session)["orientation"] == NextStep("points", done=True)
        assert step_of(session, "points") == ("products", "none", 0, True)
        name, picks = next(iter(sample_picks().items()))
        pick_both(session, name, picks)
        session.command({"op": "point.pick", "name": "half", "image": 1, "column": 9, "row": 9})
        assert step_of(session, "points") == ("products", "half", 1, True)
        session.command({"op": "point.delete", "name": "half"})
        assert next_steps(session)["points"] == NextStep("products", "some", 1, done=True)
        assert step_of(session, "products") == ("make", "make", 0, True)
        session.jobs.jobs["1"] = PageJob("1", "deliver", state="running")
        assert step_of(session, "products") == ("wait", "making", 0, False)


def test_control_points_lead_to_align_and_a_change_leads_there_again(tmp_path) -> None:
    with opened(two_photos(tmp_path)) as session:
        for count, (name, (column, row)) in enumerate(PLACES.items(), start=1):
            for image in (1, 2):
                at = {"image": image, "column": column, "row": row}
                session.command({"op": "control.pick", "name": name, **at})
            wanted = ("align", "align", 0) if count == 4 else ("control", "control", count)
            assert step_of(session, "orientation")[:3] == wanted
        session.jobs.jobs["1"] = PageJob("1", "align", state="running")
        assert step_of(session, "orientation") == ("wait", "looking", 0, False)
        session.jobs.jobs.clear()
        proposed(session, tmp_path, causes={"control": "another digest"})
        assert step_of(session, "orientation") == ("align", "changed", 0, True)


def test_distances_to_the_wall_orient_without_control_points(tmp_path) -> None:
    with opened(two_photos(tmp_path)) as session:
        session.command({"op": "setup.set", "d1": 17.5, "d2": 9.5})
        assert step_of(session, "orientation") == ("align", "align", 0, True)


def test_no_question_is_asked_while_the_program_looks_for_its_answer(tmp_path) -> None:
    with opened(two_photos(tmp_path)) as session:

        def asked() -> list[str]:
            photos = client_of(session).get("/api/state").json()["photos"]
            return [question for photo in photos for question in photo["missing"]]

        assert len(asked()) == 2
        session.jobs.jobs["1"] = PageJob("1", "align", state="running", quiet=True)
        assert asked() == []
        session.jobs.jobs["1"].state = "failed"
        assert len(asked()) == 2
        proposed(session, tmp_path)
        assert asked() == []


def test_an_oriented_pair_has_no_step_but_points(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        assert next_steps(session)["orientation"] == NextStep("points", done=True)
        state = client_of(session).get("/api/state").json()
        assert state["steps"]["products"]["action"] == "make"
        assert state["advice"] == [state["steps"]["orientation"]["text"]]


@pytest.mark.parametrize("language", ["en", "it", "de"])
def test_every_step_has_words_and_its_number(language: str) -> None:
    text = (WEB / "words" / f"{language}.js").read_text(encoding="utf-8")
    words = dict(re.findall(r'"((?:next|status)\.\w+)": "(.*)"', text))
    steps = {f"next.{a}" for a in get_args(Action)} | {f"status.{s}" for s in get_args(Status)}
    assert set(words) == steps
    assert {key for key, shown in words.items() if "{count}" in shown} == {
        "status.control", "status.half", "status.some",
    }  # fmt: skip


def test_every_action_is_a_stage_or_something_that_its_stage_does() -> None:
    stages = {"photos", "orientation", "points", "products"}
    blocks = [
        re.findall(r"this\.actions = \{.*?\};", (WEB / f"{stage}.js").read_text("utf-8"), re.S)
        for stage in stages
    ]
    done = set(re.findall(r"\w+", str(blocks)))
    assert set(get_args(Action)) - stages - {"wait"} <= done
