"""`bifocal verify`: what was changed in a delivery is named, and nothing is written into it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import shutil
import zipfile
import zlib
from pathlib import Path

import pytest
from click.testing import CliRunner

from bifocal.campaigns.verification import verify as verified
from tests.bifocal.campaigns.sample_tables import write_small_photos, write_tables
from tests.builders.commands import bifocal_command as main
from tests.test_provenance import told
from tests.web_page import Page


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """A folder with photos, tables, and a delivery without relief beside them."""
    place = tmp_path_factory.mktemp("made")
    control, check = write_tables(place, small=True)
    words = ["facade", *write_small_photos(place), "--control", control, "--check",
             check, "--products", "points,report", "--language", "de", "--out", place / "wall",
             "--date", "2026-11-22", "--client", "Bauamt", "--scale", "1:20",
             "--survey-date", "3. Mai"]  # fmt: skip
    result = CliRunner().invoke(main, [*map(str, words)])
    assert result.exit_code == 0, result.stderr
    return place


@pytest.fixture(scope="module")
def typed(tmp_path_factory) -> Path:
    """A delivery of the set-up as typed, which takes half as long: `verify` reads it alike."""
    place = tmp_path_factory.mktemp("typed")
    _, check = write_tables(place, small=True)
    words = ["facade", *write_small_photos(place), "--as-set-up", "--distance1", 17.5,
             "--distance2", 9.5, "--focal1", 35, "--focal2", 19, "--sensor-width", 22.7, "--check",
             check, "--products", "points,report", "--language", "de", "--out", place / "wall",
             "--date", "2026-11-22", "--scale", "1:20"]  # fmt: skip
    result = CliRunner().invoke(main, [*map(str, words)])
    assert result.exit_code == 0, result.stderr
    pdf = told(place / "wall/report/wall_report.pdf")
    for words in ("bifocal facade ", "2026-11-22", "far.jpg", "check.csv"):
        assert words in pdf
    return place


@pytest.fixture
def wall(typed: Path, tmp_path: Path) -> Path:
    """A copy of the delivery, of which its photos are not where they were."""
    return Path(shutil.copytree(typed / "wall", tmp_path / "wall"))


def verify(*words: object, status: int = 0) -> tuple[dict, str]:
    result = CliRunner().invoke(main, ["verify", *map(str, words), "--json"])
    assert result.exit_code == status, result.stderr
    return json.loads(result.stdout) if result.stdout else {}, result.stderr


def states(found: dict) -> dict[str, str]:
    return {one["file"]: one["state"] for one in found["files"] if one["state"] != "unchanged"}


@pytest.mark.acceptance
def test_the_report_tells_project_lenses_ties_and_how_it_was_made_and_is_told_again(made):
    out = made / "again.html"
    done = CliRunner().invoke(main, ["report", str(made / "wall"), "--out", str(out)])
    assert done.exit_code == 0, done.stderr
    for path in (made / "wall/report/wall_report.html", out):
        text = Page(path.read_text("utf-8")).text
        for words in ("Auftraggeber Bauamt", "Gemessen am 3. Mai", "Der verlangte Maßstab 1:20",
                      "Innere Orientierung", "Ihre Strahlen verfehlen einander", "cores, Python",
                      'sigma_pick = 0.5', "Gesamtfehler (RMSE)"):  # fmt: skip
            assert words in " ".join(text.split()), words
        assert re.search(r'Orientierung\s+control = "\w+.csv"\s+.*?\d\.\d s', text, re.DOTALL)
    record = json.loads((made / "wall/report/.made.json").read_text("utf-8"))
    assert record["command"] == (
        "bifocal facade far.jpg near.jpg --control control.csv --check check.csv --scale 1:20 "
        '--language de --client Bauamt --survey-date "3. Mai"'
    )


@pytest.mark.acceptance
def test_the_pdf_of_a_report_says_what_its_parts_are(made):
    data = (made / "wall/report/wall_report.pdf").read_bytes()
    for part in (b"/StructTreeRoot", b"/Marked true", b"/Lang (de)", b"/S /H1", b"/S /TH",
                 b"/S /Figure", b"/Alt"):  # fmt: skip
        assert part in data, part
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, re.DOTALL)
    pages = []
    for stream in streams:
        with contextlib.suppress(zlib.error):
            text = zlib.decompress(stream)
            if b" BDC" in text:
                pages.append(text)
    numbers = [[int(n) for n in re.findall(rb"/MCID (\d+)", page)] for page in pages]
    assert len(pages) == data.count(b"/Type /Page ")
    for page, marked in zip(pages, numbers, strict=True):
        assert sorted(marked) == list(range(len(marked)))
        assert page.count(b" BDC") + page.count(b" BMC") == page.count(b"EMC")
    assert data.count(b"/Type /MCR") == sum(map(len, numbers))


def zipped(folder: Path, path: Path) -> Path:
    return Path(shutil.make_archive(str(path), "zip", folder.parent, folder.name))


def state_of(folder: Path) -> dict[Path, tuple[int, bytes]]:
    return {
        path: (path.stat().st_mtime_ns, path.read_bytes())
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_delivery_is_whole_as_folder_and_as_archive_and_stays_untouched(wall, tmp_path):
    before = state_of(wall)
    found, _ = verify(wall)
    assert found["same"]
    assert {one["state"] for one in found["files"]} == {"unchanged"}
    assert len(found["files"]) == len(before) - 1  # all but the memory of hashes
    (point,) = found["worked"]
    assert point["holds"]
    assert point["printed"] == pytest.approx(point["computed"], abs=5e-4)
    assert found["digest"] == verify(zipped(wall, tmp_path / "sent"))[0]["digest"]
    assert state_of(wall) == before
    lines = CliRunner().invoke(main, ["verify", str(wall)]).stdout.splitlines()
    assert lines[0] == "unchanged   align/.made.json"
    assert lines[-1] == f"Digest of the delivery: {verified(wall).digest}"


def test_what_is_changed_missing_or_not_listed_is_named(wall):
    book = wall / "points/wall_points.xlsx"
    book.write_bytes(book.read_bytes()[:-1] + b"x")
    (wall / "report/wall_report.pdf").unlink()
    (wall / "letter.txt").write_text("Dear client")
    found, told = verify(wall, status=1)
    assert states(found) == {
        "points/wall_points.xlsx": "changed", "report/wall_report.pdf": "missing",
        "letter.txt": "not listed",
    }  # fmt: skip
    assert told.startswith(f"Error: {wall}: is not what was made: ")
    assert all(f"1 {word}" in told for word in ("changed", "missing", "not listed"))


def test_a_step_or_a_record_that_was_exchanged_is_noticed(wall):
    """Whoever writes a new hash into a record breaks the chain to the steps after it."""
    pair = wall / "align/wall.pair.json"
    pair.write_text(pair.read_text().replace('"distance": 1', '"distance": 2', 1))
    record = wall / "align/.made.json"
    data = json.loads(record.read_text())
    data["outputs"]["wall.pair.json"] = hashlib.sha256(pair.read_bytes()).hexdigest()
    record.write_text(json.dumps(data))
    found, told = verify(wall, status=1)
    assert states(found) == {"points/.made.json": "changed", "report/.made.json": "changed"}
    assert not found["worked"][0]["holds"]
    assert "1 worked point wrong" in told
    shutil.rmtree(wall / "align")
    record = wall / "points/.made.json"
    record.write_text("[]")
    found, _ = verify(wall, status=1)
    assert states(found)["align/.made.json"] == "missing"
    assert states(found)["points/.made.json"] == "changed"
    assert states(found)["points/wall_points.xlsx"] == "not listed"


def test_a_report_whose_worked_point_was_written_anew_is_noticed(wall):
    page = wall / "report/wall_report.html"
    text = page.read_text("utf-8")
    x = text.index("\nX = ") if "\nX = " in text else text.index("<pre>X = ")
    digit = text.index(".", x) + 2
    page.write_text(text[:digit] + str((int(text[digit]) + 5) % 10) + text[digit + 1 :], "utf-8")
    found, _ = verify(wall, status=1)
    assert states(found) == {"report/wall_report.html": "changed"}
    assert not found["worked"][0]["holds"]


@pytest.mark.acceptance
@pytest.mark.long
def test_products_made_anew_have_the_same_bytes_and_sources_are_known_by_their_hash(made, tmp_path):
    wall = Path(shutil.copytree(made / "wall", tmp_path / "wall"))
    before = state_of(wall)
    (wall / ".hashes.json").unlink()
    _, told = verify(wall, "--remake", status=1)
    assert "is not found" in told
    assert "--sources" in told
    found, _ = verify(wall, "--remake", "--sources", made)
    assert {one["state"] for one in found["remade"]} == {"unchanged"}
    assert "report/wall_report.pdf" in {one["file"] for one in found["remade"]}
    assert {path for path in before if path.name != ".hashes.json"} == set(state_of(wall))


def archive(path: Path, members: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as package:
        for name, content in members.items():
            package.writestr(name, content)
    return path


def test_what_is_no_delivery_is_refused_in_one_message(tmp_path):
    (tmp_path / "empty").mkdir()
    record = {"format": "bifocal-step/1", "step": "a", "program": "p", "date": "d",
              "key": "k", "inputs": {}, "after": [], "options": {}, "remarks": [], "seconds": 0,
              "outputs": {"../../secret": "0"}}  # fmt: skip
    (tmp_path / "text.zip").write_text("not an archive")
    half = archive(tmp_path / "half.zip", {"a/b.txt": bytes(range(256)) * 99})
    half.write_bytes(half.read_bytes()[:-40])
    deep = '{"a":' * 50_000
    for path, words in (
        (tmp_path / "nothing", "no such folder or archive"),
        (tmp_path / "empty", "holds no record of a delivery"),
        (tmp_path / "text.zip", "is no zip archive"),
        (half, "is no zip archive"),
        (archive(tmp_path / "bomb.zip", {"a": bytes(80 << 20)}), "too large"),
        (archive(tmp_path / "out.zip", {"../a": b""}), "lies outside"),
        (archive(tmp_path / "record.zip", {"a/.made.json": json.dumps(record).encode()}),
         "outside its folder"),
    ):  # fmt: skip
        found, told = verify(path, status=1)
        assert not found
        assert words in told
        assert str(path) in told or ".made.json" in told
        assert told.count("\n") == 1
    assert sorted(path.name for path in tmp_path.rglob("a")) == []
    for text in ("[]", deep, json.dumps(record | {"inputs": {"far": ["a", []]}, "outputs": {}})):
        sent = archive(tmp_path / "sent.zip", {"a/.made.json": text.encode()})
        assert states(verify(sent, status=1)[0]) == {".made.json": "changed"}


def test_a_list_of_hashes_as_other_programs_write_it_is_read(tmp_path):
    (tmp_path / "a b.txt").write_text("x")
    digest = hashlib.sha256(b"x").hexdigest().upper()
    (tmp_path / "SHA256SUMS").write_text(f"{digest} *a b.txt\n{digest}  gone.txt\n\n")
    assert states(verify(tmp_path, status=1)[0]) == {"gone.txt": "missing"}


def test_a_report_without_its_pair_is_not_called_wrong(wall):
    _, said = verify(wall / "report", status=1)
    assert "Name the folder of the whole delivery" in said
    assert "nan" not in said


def test_links_and_pipes_in_a_delivery_are_named(wall):
    (wall / "secret").symlink_to("/etc")
    os.mkfifo(wall / "align" / "pipe")
    found, _ = verify(wall, status=1)
    assert states(found) == {"secret": "not listed", "align/pipe": "not listed"}
