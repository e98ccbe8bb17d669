"""Nothing picked is lost: the journal, undo, a killed server, a full disk, two tabs."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bifocal import InputError
from bifocal.collimation.journal import Journal
from bifocal.collimation.project import find_files
from bifocal.collimation.server.access import Access
from tests.page_session import client_of, opened, pick, pick_both, sample_folder, sample_picks

JOURNAL = "facade.journal.jsonl"


def state_of_points(session) -> dict:
    return {name: (p.picks, p.code, p.order) for name, p in session.state.points.items()}


def test_the_journal_alone_gives_the_survey_again(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        for name, picks in list(sample_picks().items())[:5]:
            pick_both(session, name, picks)
        session.command({"op": "point.rename", "name": "T02", "new": "window"})
        session.command({"op": "point.type", "name": "T03", "type": "wall"})
        session.command({"op": "point.delete", "name": "T04"})
        session.command({"op": "undo"})
        session.command({"op": "undo"})
        session.command({"op": "redo"})
        session.command({"op": "line.set", "name": "L", "layer": "edge", "points": ["T01", "T03"]})
        session.command({"op": "setup.set", "d1": "17,5", "sigma_d1": 0.01})
        before, lines, setup = state_of_points(session), session.state.lines, session.state.setup
        depth = len(session.state.done)
    with opened(folder) as again:
        assert state_of_points(again) == before
        assert (again.state.lines, again.state.setup) == (lines, setup)
        assert len(again.state.done) == depth
        assert again.state.setup["d1"] == 17.5
        assert set(before) == {"T01", "window", "T03", "T04", "T05"}


def test_a_line_that_a_crash_cut_off_is_left_out(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        pick(session, "A", 1, (10.0, 20.0))
    path = folder / JOURNAL
    whole = path.read_bytes()
    path.write_bytes(whole + b'{"op": "point.pick", "name": "B", "ima')
    with opened(folder) as again:
        assert list(again.state.points) == ["A"]
        pick(again, "C", 1, (10.0, 20.0))
    assert [json.loads(line)["op"] for line in path.read_text().splitlines()][-1] == "point.pick"
    with opened(folder) as third:
        assert list(third.state.points) == ["A", "C"]


def test_a_line_that_is_no_command_is_named(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        pick(session, "A", 1, (10.0, 20.0))
    path = folder / JOURNAL
    lines = path.read_text().splitlines()
    path.write_text("\n".join([lines[0], "nonsense", *lines[1:]]) + "\n")
    with pytest.raises(InputError, match=r"journal\.jsonl, line 2"), opened(folder):
        pass


@pytest.mark.parametrize(
    "line",
    [
        '{"op": "point.pick"}',
        '{"op": "point.rename", "name": "A"}',
        '{"op": ["undo"]}',
        '{"op": {}}',
        '{"op": "point.rename", "name": "nobody", "new": "B"}',
        '{"op": "workbook.read", "rows": {"A": {"picks": 5}}, "gone": []}',
        '{"op": "workbook.read", "rows": {"A": 1}, "gone": []}',
        '{"op": "files", "stem": "facade", "photos": [1]}',
        '{"op": "made", "kind": [], "names": []}',
        '{"op": "proposed", "pair": 7, "report": {}}',
        '{"op": ' + "[" * 100_000 + "]" * 100_000 + "}",
        "[]",
    ],
    ids=lambda line: line[:40],
)
def test_a_damaged_line_is_named_and_the_journal_stays_as_it_is(tmp_path, line: str) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        pick(session, "A", 1, (10.0, 20.0))
    path = folder / JOURNAL
    path.write_text(path.read_text() + f'{line}\n{{"op": "cut o')
    before = path.read_bytes()
    for _ in range(2):
        with pytest.raises(InputError, match=r"journal\.jsonl, line 3: .*delete this line"), \
                opened(folder):  # fmt: skip
            pass
        assert path.read_bytes() == before


def test_a_start_that_fails_leaves_no_journal_that_hides_the_pair(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    pair = folder / "facade.pair.json"
    good = pair.read_text()
    pair.write_text(good.replace("near.jpg", "absent.jpg"))
    with pytest.raises(InputError, match="absent"), opened(pair):
        pass
    assert not (folder / JOURNAL).exists()
    pair.write_text(good)
    for left in ("", '{"op": "files", "st'):  # by an earlier version, or a full disk
        (folder / "other.journal.jsonl").write_text(left)
        with opened(folder) as session:
            assert session.files.pair == pair
        assert (folder / "other.journal.jsonl").read_text() == left


def test_a_workbook_that_is_a_circle_of_links_is_refused(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    (folder / "a.xlsx").symlink_to("b.xlsx")
    (folder / "b.xlsx").symlink_to("a.xlsx")
    with pytest.raises(InputError, match=r"a\.xlsx: cannot be used \(Too many levels"):
        find_files([folder / "facade.pair.json"], folder / "a.xlsx")


@pytest.mark.parametrize(
    "kept",
    ["[" * 100_000, '{"token": "%s", "port": 1e400}' % ("x" * 40),
     json.dumps({"token": "\ud800" * 40, "port": 80}),
     json.dumps({"token": "a\nb: c" * 40, "port": 80})],
    ids=["deep", "infinite port", "no characters", "two lines"],
)  # fmt: skip
def test_a_damaged_address_is_made_anew(tmp_path, kept: str) -> None:
    path = tmp_path / ".facade.page.json"
    path.write_text(kept)
    path.chmod(0o600)
    access = Access.of(path)
    assert access.port == 0
    assert access.token not in kept


def test_a_journal_that_is_cut_off_before_its_first_line_is_not_deleted(tmp_path) -> None:
    path = tmp_path / "a.journal.jsonl"
    path.write_text("mine")
    Journal(path).close()
    assert path.read_text() == "mine"


def test_a_photo_whose_name_is_not_utf_8_is_kept_in_the_journal(tmp_path) -> None:
    journal = Journal(tmp_path / "a.journal.jsonl")
    journal.append({"op": "files", "photos": ["fa\udce7ade é.jpg"]})
    journal.close()
    again = Journal(tmp_path / "a.journal.jsonl")
    assert again.records[0]["photos"] == ["fa\udce7ade é.jpg"]
    again.close()


def test_a_command_sent_twice_is_done_once(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    command = {"id": "u1", "op": "point.pick", "name": None, "image": 1, "column": 5, "row": 6}
    with opened(folder) as session:
        assert session.command(command) == session.command(command) == {"name": "P01"}
        assert list(session.state.points) == ["P01"]
    with opened(folder) as again:  # also over a restart
        assert again.command(command) == {"name": "P01"}
        assert list(again.state.points) == ["P01"]


def test_a_full_disk_costs_the_last_change_only(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        pick(session, "A", 1, (10.0, 20.0))
        before = (folder / JOURNAL).read_bytes()

        class FullDisk:
            def __init__(self, file) -> None:
                self.file = file

            def write(self, data: bytes) -> int:
                if len(data) > 20:
                    return self.file.write(data[:20])  # some of it fits
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

            def __getattr__(self, name: str):
                return getattr(self.file, name)

        file, session.journal._file = session.journal._file, FullDisk(session.journal._file)
        command = {"op": "point.pick", "name": "B", "image": 1, "column": 1, "row": 1}
        answer = client_of(session).post("/api/command", json=command)
        assert answer.status_code == 422
        assert "No space left" in answer.json()["error"]
        assert list(session.state.points) == ["A"]
        assert (folder / JOURNAL).read_bytes() == before
        session.journal._file = file
        pick(session, "B", 1, (1.0, 1.0))
    with opened(folder) as again:
        assert list(again.state.points) == ["A", "B"]


def test_one_survey_has_one_server(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder), pytest.raises(InputError, match="open already"), opened(folder):
        pass


def test_a_journal_in_a_folder_that_is_none_says_so(tmp_path) -> None:
    with pytest.raises(InputError, match="cannot be written"):
        Journal(tmp_path / "absent" / "x.journal.jsonl")


def test_the_last_change_of_a_point_wins_and_others_stay(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        one, two = client_of(session), client_of(session)
        common = {"op": "point.pick", "image": 1, "row": 50}
        one.post("/api/command", json={**common, "name": "A", "column": 100})
        two.post("/api/command", json={**common, "name": "B", "column": 200})
        two.post("/api/command", json={**common, "name": "A", "column": 101.5})
        shown = one.get("/api/state").json()
        assert {p["name"]: p["picks"]["1"][0] for p in shown["points"]} == {"A": 101.5, "B": 200}
        one.post("/api/command", json={"op": "undo"})
        assert two.get("/api/state").json()["points"][0]["picks"]["1"][0] == 100


def test_two_hundred_steps_are_undone_and_redone(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        for step in range(200):
            pick(session, f"P{step % 7}", 1 + step % 2, (step, step))
        end = state_of_points(session)
        for _ in range(200):
            session.command({"op": "undo"})
        assert not session.state.points
        with pytest.raises(InputError, match="nothing to undo"):
            session.command({"op": "undo"})
        for _ in range(200):
            session.command({"op": "redo"})
        assert state_of_points(session) == end


def _ask(url: str, token: str, path: str, body: dict | None = None) -> dict:
    data = None if body is None else json.dumps(body).encode()
    headers = {"x-bifocal-token": token, "content-type": "application/json"}
    request = urllib.request.Request(url.partition("/?")[0] + path, data, headers)
    with urllib.request.urlopen(request, timeout=20) as answer:
        return json.load(answer)


@contextmanager
def _server(folder: Path) -> Iterator[tuple[subprocess.Popen, str, str]]:
    command = [sys.executable, "-m", "bifocal", "pick", str(folder), "--no-browser", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            said = json.loads(process.stdout.readline())
            yield process, said["url"], said["token"]
        finally:
            process.kill()


@pytest.mark.acceptance
@pytest.mark.skipif(os.name == "nt", reason="Windows has no kill -9")
def test_a_killed_server_resumes_with_everything_and_an_open_page_finds_it(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with _server(folder) as (process, url, token):
        for number in range(5):
            command = {"op": "point.pick", "name": f"K{number}", "image": 1, "row": 9,
                       "column": number}  # fmt: skip
            _ask(url, token, "/api/command", command)
        process.kill()
    assert (folder / ".facade.page.json").stat().st_mode & 0o777 == 0o600
    with _server(folder) as (process, url2, token2):
        assert (url2, token2) == (url, token)
        shown = _ask(url, token, "/api/state")
        assert [p["name"] for p in shown["points"]] == ["K0", "K1", "K2", "K3", "K4"]
        process.send_signal(signal.SIGTERM)
        assert process.stdout.read() == ""
        assert process.wait(20) in (0, 1)
    assert not (folder / ".facade.page.json").exists()


def test_the_bare_command_tells_of_the_page() -> None:
    from click.testing import CliRunner

    from tests.builders.commands import bifocal_command as main

    assert "bifocal pick" in CliRunner().invoke(main, []).output
