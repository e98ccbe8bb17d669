"""The page is sent what changed since the state that it holds, and only that."""

from __future__ import annotations

import json
from typing import Any

import pytest

from bifocal.collimation.server.state_changes import HELD, StateEditions
from tests.page_session import client_of, opened, pick_both, sample_folder, sample_picks


def merged(held: dict[str, Any], sent: dict[str, Any]) -> dict[str, Any]:
    """Return the state that the page makes of what it holds and what it is sent."""
    if "since" not in sent:
        return sent
    assert sent["since"] == held["edition"]
    whole = {**held, **sent["values"], "edition": sent["edition"]}
    for key, change in sent["rows"].items():
        rows = {row["name"]: row for row in (*held[key], *change["rows"])}
        whole[key] = [rows[name] for name in change["order"]]
    return whole


@pytest.fixture
def picked(tmp_path):
    """Yield a survey of the sample whose targets are picked."""
    with opened(sample_folder(tmp_path) / "facade.pair.json") as session:
        for name, both in sample_picks().items():
            pick_both(session, name, both)
        yield session


def test_a_command_is_answered_by_what_it_changed(picked) -> None:
    client = client_of(picked)
    whole = client.get("/api/state", headers={HELD: "none"})
    held = whole.json()
    for op, args in (
        ("point.pick", {"name": "T03", "image": 1, "column": 1052.0, "row": 803.5}),
        ("point.delete", {"name": "T05"}),
        ("point.pick", {"name": "new", "image": 1, "column": 700.0, "row": 500.0}),
        ("undo", {}),
    ):
        body = {"id": op, "op": op, **args}
        answer = client.post("/api/command", json=body, headers={HELD: held["edition"]})
        assert answer.status_code == 200, answer.text
        sent = answer.json()["state"]
        assert len(answer.content) < 0.35 * len(whole.content), (op, sent.keys(), sent["values"])
        held = merged(held, sent)
        now = client.get("/api/state").json()
        assert now | {"edition": held["edition"]} == held


def test_a_page_that_holds_what_is_no_longer_known_is_sent_all() -> None:
    editions, state = StateEditions(), {"points": [{"name": "A"}], "revision": 1, "jobs": []}
    assert editions.next(state, None) == state, "who does not ask is told no edition"
    first = editions.next(state, "none")
    held = first["edition"]
    assert first == state | {"edition": held}
    again = editions.next(state, held)
    assert again | {"edition": ""} == {
        "edition": "", "since": held, "values": {"jobs": []}, "rows": {}
    }  # fmt: skip
    assert "since" not in StateEditions().next(state, held), "another server's"
    for _ in range(9):
        editions.next(state, "none")
    assert "since" not in editions.next(state, held)
    assert "since" not in editions.next(state, "none of these")


def test_what_is_changed_in_place_and_the_order_of_rows_are_noticed() -> None:
    state = {"points": [{"name": "A", "at": [1]}, {"name": "B"}], "jobs": [], "setup": {"d1": 1}}
    editions = StateEditions()
    held = json.loads(json.dumps(editions.next(state, "none")))
    state["setup"]["d1"] = 2
    state["points"][0]["at"][0] = 5
    state["points"].reverse()
    sent = editions.next(state, held["edition"])
    assert merged(held, sent) == state | {"edition": sent["edition"]}
    assert sent["rows"]["points"]["rows"] == [{"name": "A", "at": [5]}]
