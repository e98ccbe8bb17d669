"""Whoever is not the page gets nothing, and leaves nothing."""

from __future__ import annotations

import io
import re
import struct
import zlib

import numpy as np
import pytest
from PIL import Image
from starlette.testclient import TestClient

from bifocal.collimation.server.application import application
from bifocal.collimation.server.assets import WEB
from bifocal.collimation.server.security import place_of
from tests.page_session import BASE, TOKEN, client_of, entries, opened, sample_folder
from tests.tables import each

PATHS = ["/", "/api/state", "/api/events", "/tiles/photo/1/info", "/tiles/photo/1/0/0_0.jpg",
         "/download/facade.xlsx", "/download/all.zip", "/relief/overlay.png", "/uncertainty.png",
         "/web/index.html", "/nowhere"]  # fmt: skip
NAME, PLACE = "bifocal_token", place_of(TOKEN)
POSTS = ["/api/command", "/api/suggest", "/api/photos", "/api/jobs", "/api/measure"]


@pytest.fixture
def session(tmp_path):
    with opened(sample_folder(tmp_path)) as survey:
        yield survey


def stranger(session, **headers: str) -> TestClient:
    return TestClient(application(session, TOKEN), base_url=BASE, headers=headers)


@pytest.mark.parametrize("path", PATHS)
def test_without_the_token_nothing_is_shown(session, path: str) -> None:
    assert stranger(session).get(path).status_code == 403
    assert stranger(session, **{"x-bifocal-token": TOKEN[:-1]}).get(path).status_code == 403
    assert stranger(session).get(path, params={"token": "x"}).status_code == 403


@each("path", POSTS)
@pytest.mark.parametrize(
    "headers",
    [
        {"host": "evil.example:8765"},
        {"host": "127.0.0.1"},
        {"host": "127.0.0.1:8766"},
        {"origin": "http://evil.example"},
        {"origin": "null"},
        {"origin": "http://127.0.0.1:9999"},
        {"origin": "https://127.0.0.1:8765"},
        {"sec-fetch-site": "cross-site"},
        {"sec-fetch-site": "same-site"},
        {"x-bifocal-token": ""},
        {"x-bifocal-token": "ü"},
    ],
    ids=str,
)
def test_foreign_host_origin_or_token_is_refused(session, path: str, headers, tmp_path) -> None:
    before = entries(tmp_path)
    own = {"x-bifocal-token": TOKEN} | headers
    encoded = {key: value.encode("utf-8") for key, value in own.items()}
    body = {"op": "point.pick", "name": "A", "image": 1, "column": 1, "row": 1}
    answer = TestClient(application(session, TOKEN), base_url=BASE).post(
        path, json=body, headers=encoded
    )
    assert answer.status_code == 403
    assert not session.state.points
    assert entries(tmp_path) == before


def test_the_first_visit_sets_a_cookie_that_scripts_cannot_read(session) -> None:
    client = stranger(session)
    answer = client.get("/", params={"token": TOKEN})
    assert answer.status_code == 200
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie
    assert client.get(f"{PLACE}/api/state").status_code == 200
    assert stranger(session, cookie=f"{NAME}=wrong").get(f"{PLACE}/api/state").status_code == 403


def test_the_cookie_goes_to_the_page_alone(session) -> None:
    """A browser sends the cookies of all ports to each, but only under the path they name."""
    client = stranger(session)
    answer = client.get("/", params={"token": TOKEN})
    assert answer.headers["set-cookie"].startswith(f"{NAME}={TOKEN};")
    assert f"Path={PLACE}/;" in answer.headers["set-cookie"]
    assert len(PLACE) > 32
    assert TOKEN not in PLACE
    request = client.build_request("GET", "http://127.0.0.1:9999/")
    assert "cookie" not in request.headers
    assert client.get("/api/state").status_code == 403
    assert stranger(session, cookie=f"{NAME}={TOKEN}").get("/api/state").status_code == 403


def test_a_cookie_that_another_server_set_does_not_lock_the_page(session) -> None:
    both = {"cookie": f"theme=; {NAME}={TOKEN}; {NAME}=planted"}
    assert stranger(session, **both).get(f"{PLACE}/api/state").status_code == 200
    assert stranger(session, cookie=f"{NAME}=planted").get(f"{PLACE}/").status_code == 403


def test_a_person_without_the_token_gets_a_page_in_his_language(session) -> None:
    asked = {"accept": "text/html,*/*", "accept-language": "de-AT,en;q=0.5"}
    answer = stranger(session, **asked).get("/")
    assert answer.status_code == 403
    assert answer.headers["content-type"].startswith("text/html")
    assert '<html lang="de">' in answer.text
    assert "bifocal pick</code> beim Start genannt" in answer.text
    assert TOKEN not in answer.text


def test_a_file_that_knows_the_token_opens_the_page_and_nothing_else(session) -> None:
    """The browser counts the file that `bifocal pick` opens as a foreign page."""
    foreign = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    client = stranger(session, **foreign)
    assert client.get("/", params={"token": TOKEN}).status_code == 200
    assert client.get("/", params={"token": TOKEN[:-1]}).status_code == 403
    # The cookie alone is what a foreign page would use.
    assert client.get(f"{PLACE}/").status_code == 403
    assert client.get("/api/state", params={"token": TOKEN}).status_code == 403
    assert stranger(session, **{"sec-fetch-site": "cross-site"}).get(
        "/", params={"token": TOKEN}
    ).status_code == 403  # fmt: skip


def test_what_fails_is_answered_under_the_same_rules(session, monkeypatch) -> None:
    monkeypatch.setattr(session, "command", lambda _: 1 / 0)
    app = application(session, TOKEN)
    client = TestClient(app, base_url=BASE, raise_server_exceptions=False)
    answer = client.post("/api/command", json={"op": "undo"}, headers={"x-bifocal-token": TOKEN})
    assert answer.status_code == 500
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    assert answer.json()["error"] == "an error of the program (ZeroDivisionError)."
    long = client.get("/tiles/photo/1/0/" + 5000 * "9" + "_1.jpg")
    assert long.status_code == 403  # unknown to the server without the token, as everything
    assert client_of(session).get("/tiles/photo/1/0/" + 5000 * "9" + "_1.jpg").status_code == 414


def test_every_answer_carries_the_rules_and_none_invites_others(session) -> None:
    client = client_of(session)
    for answer in (client.get("/"), client.get("/api/state"), stranger(session).get("/")):
        assert "default-src 'self'" in answer.headers["content-security-policy"]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["referrer-policy"] == "no-referrer"
        assert not [name for name in answer.headers if name.startswith("access-control")]
    assert client.get("/api/state").headers["cache-control"] == "no-store"


@each("dots", ["../", "..%2f", "%2e%2e/", "..\\", "....//", "%252e%252e%252f"])
@pytest.mark.parametrize(
    "path",
    ["/{}far.jpg", "/web/{}server.py", "/download/{}far.jpg", "/download/x/{}{}far.jpg",
     "/tiles/{}photo/1/info", "/tiles/photo/1/0/{}0_0.jpg", "/tiles/photo/1/{}/0_0.jpg",
     "/api/jobs/{}1", "/relief/{}overlay.png"],
)  # fmt: skip
def test_no_path_leads_out(session, path: str, dots: str) -> None:
    where = path.replace("{}", dots)
    client = client_of(session)
    answer = client.delete(where) if "jobs" in path else client.get(where)
    assert answer.status_code in (404, 405, 422), answer.text
    assert b"\xff\xd8\xff" not in answer.content
    assert b"import" not in answer.content


def test_the_page_names_all_its_modules_and_they_are_known_by_their_content(session) -> None:
    client = client_of(session)
    page = client.get("/").text
    modules = [path.relative_to(WEB).as_posix() for path in (WEB / "js").glob("*.js")]
    for name in (*modules, "js/words/en.js"):
        assert f'href="{name}"' in page
        answer = client.get(f"/{name}")
        assert answer.headers["content-type"].startswith("text/javascript")
        assert answer.content == (WEB / name).read_bytes()
        same = client.get(f"/{name}", headers={"if-none-match": answer.headers["etag"]})
        assert (same.status_code, same.content) == (304, b"")
    assert "js/words/it.js" not in page


def test_what_the_page_loads_first_is_light(session) -> None:
    client = client_of(session)
    page = client.get("/").text
    names = [*re.findall(r'(?:href|src)="([^"]+)"', page), "style.css"]
    bytes_sent = len(page) + sum(
        int(client.get(f"/{name}").headers["content-length"]) for name in sorted(set(names))
    )
    assert len(names) > 30
    assert bytes_sent < 150_000
    plain = client.get("/style.css", headers={"accept-encoding": "identity"})
    assert "content-encoding" not in plain.headers


def test_the_photos_themselves_are_not_served(session) -> None:
    for name in ("far.jpg", "facade.pair.json", "facade.journal.jsonl", ".facade.page.json"):
        assert client_of(session).get(f"/download/{name}").status_code == 404


def test_an_oversized_body_is_refused(session, tmp_path) -> None:
    before = entries(tmp_path)
    client = client_of(session, content_type="application/json")
    assert client.post("/api/command", content=b" " * (1 << 20) + b"{}").status_code == 413

    def pieces():
        for _ in range(40):
            yield b" " * (1 << 16)

    assert client.post("/api/command", content=pieces()).status_code == 413
    large = {"content-length": str(1 << 31), "content-type": "multipart/form-data; boundary=x"}
    assert client.post("/api/photos", content=b"x", headers=large).status_code == 413
    assert entries(tmp_path) == before


@pytest.mark.parametrize(
    ("kind", "body", "status"),
    [
        ("text/plain", b"{}", 415),
        ("application/json", b"{", 400),
        ("application/json", b"[]", 400),
        ("application/json", b'{"op": "point.pick", "column": NaN}', 400),
        ("application/json", b"[" * 100_000, 400),
        ("application/json", b"\xff\xfe", 400),
        ("application/x-www-form-urlencoded", b"op=undo", 415),
    ],
)
def test_what_is_no_command_is_refused(session, kind: str, body: bytes, status: int) -> None:
    answer = client_of(session, content_type=kind).post("/api/command", content=body)
    assert answer.status_code == status
    assert answer.json()["error"]


def _png(width: int, height: int) -> bytes:
    """Return a PNG of few bytes that claims a size."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    pixels = zlib.compress(bytes(1000), 9)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def _jpeg() -> bytes:
    buffer = io.BytesIO()
    noise = np.random.default_rng(1).integers(0, 255, (64, 96, 3), np.uint8)
    Image.fromarray(noise).save(buffer, "JPEG")
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("name", "data", "said"),
    [
        ("near.jpg", b"<script>alert(1)</script>", "not an image"),
        ("near.jpg", b"", "empty"),
        ("near.exe", _jpeg(), "no photo"),
        ("near.svg", b"<svg/>", "no photo"),
        ("near", _jpeg(), "no photo"),
        ("near.png", _png(60_000, 60_000), "larger than the page"),
        ("near.png", _png(12_000, 12_000), "no photo"),
        ("near.jpg", _jpeg()[:900], "damaged|cut off"),
        ("near.tif", b"II*\x00" + bytes(100), "TIFF"),
    ],
    ids=["script", "empty", "program", "svg", "no ending", "3600 MP", "bomb", "cut", "tiff"],
)
def test_what_is_no_photo_is_refused_and_nothing_written(tmp_path, name, data, said) -> None:
    with opened(tmp_path) as session:
        before = entries(tmp_path)
        files = {"photo1": ("far.jpg", _jpeg()), "photo2": (name, data)}
        answer = client_of(session).post("/api/photos", files=files)
        assert answer.status_code == 422, answer.text
        assert re.search(said, answer.json()["error"])
        assert "/tmp" not in answer.json()["error"]
        assert entries(tmp_path) == before
        assert not session.pictures.infos


def test_names_of_dropped_photos_cannot_leave_the_folder(tmp_path) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    with opened(inner) as session:
        files = {
            "photo1": ("../../far.jpg", _jpeg()),
            "photo2": ("..\\C:\\near<>.JPG", _jpeg()[:-2] + b"\xff\xd9"),
        }
        assert client_of(session).post("/api/photos", files=files).status_code == 200
    assert [name for name in entries(tmp_path) if name.endswith(".jpg")] == [
        "inner/far.jpg", "inner/near.jpg",
    ]  # fmt: skip
