"""Whatever a page that knows the token sends: it is understood, or refused with its field named."""

from __future__ import annotations

import json
import random

import pytest
from starlette.testclient import TestClient

from bifocal.collimation.fields import COMMANDS
from bifocal.collimation.server.application import application
from tests.page_session import (
    BASE,
    TOKEN,
    client_of,
    opened,
    pick_both,
    sample_folder,
    sample_picks,
)

#: What no field, or another one than it is sent in, takes.
VALUES = (
    None, True, 0, 1, 1.0, -1, 1e300, 10**400, -(10**400), "", "99999", "12,5", "T01", "\ud800",
    "a\x00b", "x" * 500, [], [1], {}, {"a": 1}, [[1, 2], [3, 4]], ["T01", "T02"], [["T01"]], "wall",
    "en", [{"name": "q", "picks": [[1, 2], [3, 4]]}], [{"name": "q", "picks": [[1, 2], "x"]}],
    [{"name": "q", "picks": "ab", "code": "\ud800"}], "id,X,Y,col1,row1\nC1,1,2,99999,4", "1e400",
)  # fmt: skip
KEYS = sorted({key.removesuffix("?") for fields in COMMANDS.values() for key in fields} | {"id"})
ROUTES = ("/api/suggest", "/api/line", "/api/snap", "/api/measure", "/api/convert", "/api/jobs",
          "/relief/profile")  # fmt: skip


def inside(session) -> bool:
    sizes = [info.size for info in session.pictures.infos]
    points = [*session.state.points.values(), *session.state.control.values()]
    return all(
        -0.5 <= pick[0] <= size[0] - 0.5 and -0.5 <= pick[1] <= size[1] - 0.5
        for point in points
        for pick, size in zip(point.picks, sizes, strict=True)
        if pick is not None
    )


def test_nothing_that_is_sent_ends_in_an_error_of_the_program(tmp_path) -> None:
    draw = random.Random(24)
    with opened(sample_folder(tmp_path)) as session:
        for name in ("T01", "T02"):
            pick_both(session, name, sample_picks()[name])
        client = TestClient(
            application(session, TOKEN), base_url=BASE, raise_server_exceptions=False,
            headers={"x-bifocal-token": TOKEN, "content-type": "application/json"},
        )  # fmt: skip
        for number in range(400):
            body = {key: draw.choice(VALUES) for key in draw.sample(KEYS, draw.randint(0, 9))}
            route = draw.choice(ROUTES) if number % 4 == 0 else "/api/command"
            if route == "/api/command":
                body["op"] = draw.choice([*COMMANDS, *COMMANDS, draw.choice(VALUES)])
                body |= {"name": "T01", "image": 1} if number % 3 else {}
            elif route == "/api/jobs":
                body["kind"] = draw.choice(VALUES)
            answer = client.post(route, content=json.dumps(body).encode())
            assert answer.status_code in (200, 400, 422), (body, answer.text)
            assert "content-security-policy" in answer.headers
            assert answer.status_code == 200 or answer.json()["error"], body
        assert client.get("/api/state").status_code == 200
        assert inside(session)
        before = session.state.points
    with opened(tmp_path) as again:  # the journal holds nothing that it does not take back
        assert again.state.points == before


@pytest.mark.parametrize(
    ("command", "field"),
    [
        ({"op": ["undo"]}, "op"),
        ({"op": {}}, "op"),
        ({"op": "point.pick", "image": "1", "column": 1, "row": 1}, "image"),
        ({"op": "point.pick", "image": 1, "column": "99999", "row": "5"}, "column, row"),
        ({"op": "point.pick", "image": 1.0, "column": 5, "row": 99999}, "column, row"),
        ({"op": "point.pick", "image": 1, "column": 10**400, "row": 5}, "column"),
        ({"op": "point.pick", "id": "\ud800", "image": 1, "column": 5, "row": 5}, "id"),
        ({"op": "control.paste", "text": "id,X,Y,col1,row1\nC1,1,2,99999,4"}, "column, row"),
        ({"op": "points.add", "points": [{"name": "q", "picks": [[1, 2], [3, 9]]}]}, "op"),
        ({"op": "made", "kind": "ortho", "names": ["far.jpg"]}, "op"),
        ({"op": "line.set", "name": "L", "layer": "x", "points": [["T01"], ["T02"]]}, "points"),
        ({"op": "line.set", "name": "L", "layer": ["x"], "points": ["T01", "T02"]}, "layer"),
        ({"op": "setup.set", "d1": [17.5]}, "d1"),
        ({"op": "photo.set", "image": 1, "focal_mm": {}}, "focal_mm"),
        ({"op": "language.set", "language": ["en"]}, "language"),
    ],
)  # fmt: skip
def test_a_wrong_field_is_named_and_nothing_is_changed(tmp_path, command, field: str) -> None:
    with opened(sample_folder(tmp_path)) as session:
        for name in ("T01", "T02"):
            pick_both(session, name, sample_picks()[name])
        written = session.journal.path.read_bytes()
        answer = client_of(session, content_type="application/json").post(
            "/api/command", content=json.dumps(command).encode()
        )
        assert answer.status_code == 400, answer.text
        assert answer.json()["error"].startswith(f"{field}: ")
        assert session.journal.path.read_bytes() == written


def test_text_with_a_number_is_a_number_and_what_is_no_field_is_not_written(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        command = {"op": "point.pick", "image": 1.0, "column": " 12,5", "row": "7"}
        session.command(command | {"roof": "\ud800"})
        assert session.state.points["P01"].picks == ((12.5, 7.0), None)
        last = json.loads(session.journal.path.read_text().splitlines()[-1])
        assert (last["image"], last["column"], last["row"]) == (1, 12.5, 7.0)
        assert "roof" not in last


@pytest.mark.parametrize(
    ("language", "command", "status", "said"),
    [
        ("it", {"op": "point.pick", "image": 1, "column": 9e4, "row": 5}, 400,
         "colonna, riga: la collimazione di P01 è fuori dalla foto 1 (1536 x 1024 px)."),
        ("de", {"op": "point.delete", "name": "Q9"}, 422, "es gibt keinen Punkt Q9."),
        ("it", {"op": "undo"}, 422, "non c'è nulla da annullare."),
        ("de", {"op": "control.rename", "name": "C1", "new": "C2"}, 422,
         "es gibt keinen Passpunkt C1."),
    ],
)  # fmt: skip
def test_a_refusal_is_told_in_the_language_of_the_page(
    tmp_path, language: str, command, status: int, said: str
) -> None:
    with opened(sample_folder(tmp_path)) as session:
        session.command({"op": "language.set", "language": language})
        answer = client_of(session).post("/api/command", json=command)
        assert (answer.status_code, answer.json()["error"]) == (status, said)
