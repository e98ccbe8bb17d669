"""Whatever the page is started with: a workbook that is the pair, a folder, photos, a pair file."""

from __future__ import annotations

import os
import queue
import shutil
import socket
import threading
import time

import openpyxl
import pytest
from click.testing import CliRunner

import bifocal
from bifocal import InputError, page_server
from bifocal.collimation import workflow
from tests.builders.commands import bifocal_command as main
from tests.page_session import (
    client_of,
    entries,
    opened,
    pick,
    pick_both,
    sample_folder,
    sample_picks,
)

#: A pixel of the sample's wall is 7.38 mm seen from 17.5 m by 35 mm. (tests/scenes/make_sample)
PITCH = 0.00738 * 35 / 17.5
SETUP = {
    "d_2": 9.5, "delta_d": 8.0, "c_1": 35, "c_2": 19, "pitch": PITCH, "input_unit": "px",
    "nadir_1_col": 767.5, "nadir_1_row": 511.5, "nadir_2_col": 767.5, "nadir_2_row": 511.5,
    "photo_1": "photos/far.jpg", "photo_2": "photos/near.jpg",
}  # fmt: skip


def typed(path, cells, points=()) -> None:
    """Type into named cells of the sheet Setup and rows of Points, as a person does."""
    book = openpyxl.load_workbook(path)
    for name, value in cells.items():
        place = book.defined_names[name].attr_text.split("!")[1].replace("$", "")
        book["Setup"][place] = value
    for row, values in enumerate(points, start=5):
        for column, value in zip("ABCDEFGH", values, strict=False):
            book["Points"][f"{column}{row}"] = value
    book.save(path)


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A workbook as a surveyor fills it."""
    path = tmp_path_factory.mktemp("filled") / "wall.xlsx"
    assert CliRunner().invoke(main, ["template", str(path), "--rows", "12"]).exit_code == 0
    typed(path, SETUP)
    return path


@pytest.fixture
def survey(tmp_path, filled):
    """The same with its photos in a folder beside it."""
    photos = tmp_path / "photos"
    photos.mkdir()
    sample_folder(photos)
    (photos / "facade.pair.json").unlink()
    shutil.copyfile(filled, tmp_path / "wall.xlsx")
    return tmp_path / "wall.xlsx"


def reliefs(path) -> dict[str, float]:
    """Return what `bifocal solve` finds."""
    table = bifocal.solve(path).table
    return dict(zip(table.ids, table["r"].tolist(), strict=True))


@pytest.mark.acceptance
def test_a_workbook_that_names_its_photos_is_picked_in(survey) -> None:
    """The ideal set-up: Points of the template, x1 to y2 in pixels, a relief by hand."""
    typed(survey, {}, [("own", *(None,) * 4, 40.0, 42.0, 30.0)])  # s1, s2, theta: not picked
    with opened(survey) as session:
        assert session.sync.waiting is None
        assert [point.name for point in session.state.sorted_points()] == []
        for name, picks in list(sample_picks().items())[:5]:
            pick_both(session, name, picks)
        pick(session, "half", 1, (100.0, 100.0))
        session.sync.step()
        assert session.sync.waiting is None
        state = client_of(session).get("/api/state").json()
        live = {p["name"]: p["result"]["r"] for p in state["points"] if p["result"]}
        solved = reliefs(survey)
        own = solved.pop("own")
        # Eq. (5) by hand: (42 - 40) / (42 / 9.5 - 40 / 17.5) m, s2 once at the scale of image 1.
        assert own == pytest.approx((42 * (35 * 9.5) / (19 * 17.5) - 40)
                                    / (42 / 9.5 - 40 / 17.5), abs=1e-9)  # fmt: skip
        assert live == pytest.approx({name: solved[name] for name in live}, rel=1e-9, abs=1e-9)
        assert len(live) == 5
        session.command({"op": "point.delete", "name": "half"})
        session.sync.step()
        # The set-up typed anew, in Excel: the page follows.
        typed(survey, {"d_2": 9.6, "delta_d": 7.9})
        before = live
        session.sync.step()
        assert session.sync.waiting is None
        state = client_of(session).get("/api/state").json()
        live = {p["name"]: p["result"]["r"] for p in state["points"] if p["result"]}
        assert live != pytest.approx(before, abs=1e-4)
    assert reliefs(survey) | live == pytest.approx(reliefs(survey), rel=1e-9, abs=1e-9)


@pytest.mark.acceptance
def test_the_page_types_pixels_where_nothing_is_measured_yet(survey) -> None:
    """And what of the set-up it assumed: the middle of the photo."""
    blank = [f"nadir_{number}_{axis}" for number in (1, 2) for axis in ("col", "row")]
    typed(survey, {"input_unit": "mm", **dict.fromkeys(blank)})
    picks = sample_picks()
    with opened(survey) as session:
        pick_both(session, "T01", picks["T01"])
        session.sync.step()
        assert session.sync.waiting is None
        row = session.results.row(session.state.points["T01"])
    assert reliefs(survey) == pytest.approx({"T01": row["r"]}, rel=1e-9, abs=1e-9)
    with opened(survey) as session:  # and finds them again
        assert session.state.points["T01"].picks == picks["T01"]


def test_points_in_millimetres_are_the_users_own(survey) -> None:
    typed(survey, {"input_unit": "mm"}, [("own", 1.0, 2.0, 1.1, 2.2)])
    before = survey.read_bytes()
    with opened(survey) as session:
        pick_both(session, "T01", sample_picks()["T01"])
        session.sync.step()
        assert "image coordinates of an ideal pair" in session.sync.waiting
    assert survey.read_bytes() == before


@pytest.mark.parametrize("form", ["workbook", "folder", "photos", "here", "with pair"])
def test_every_way_to_start_finds_the_workbooks_pair(survey, form, monkeypatch) -> None:
    folder = survey.parent
    far, near = folder / "photos" / "far.jpg", folder / "photos" / "near.jpg"
    monkeypatch.chdir(folder if form == "here" else "/")
    sources, workbook = {
        "workbook": ([survey], None),
        "folder": ([folder], None),
        "photos": ([far, near], survey),
        "here": ([], survey.relative_to(folder)),
        "with pair": ([survey], survey),
    }[form]
    with opened(*sources, workbook=workbook) as session:
        assert session.files.pair_is_workbook
        state = client_of(session).get("/api/state").json()
    assert [photo["name"] for photo in state["photos"]] == ["far.jpg", "near.jpg"]
    assert state["pair"]["images"][0]["distance"] == 17.5
    assert state["pair"]["images"][1]["distance"] == 9.5
    assert state["stage"] == "points"


@pytest.mark.acceptance
def test_homographies_in_a_workbook_are_a_pair_too(tmp_path) -> None:
    """What `solve` wrote for a pair file, taken elsewhere with its photos only."""
    folder = sample_folder(tmp_path)
    picks = sample_picks()["T01"]
    with opened(folder) as session:
        pick_both(session, "T01", picks)
        session.sync.step()
        first = session.results.row(session.state.points["T01"])
    for name in ("facade.pair.json", "facade.journal.jsonl"):
        (folder / name).unlink()
    typed(folder / "facade.xlsx", {"photo_1": "far.jpg", "photo_2": "near.jpg"})
    with opened(folder) as session:
        assert session.state.points["T01"].picks == picks
        assert session.results.row(session.state.points["T01"]) == pytest.approx(first)
        pick_both(session, "again", picks)
        session.sync.step()
        assert session.sync.waiting is None
    assert reliefs(folder / "facade.xlsx") == pytest.approx(
        {"T01": first["r"], "again": first["r"]}, rel=1e-9, abs=1e-9
    )
    # Beside photos it does not name, also where those it names are not there.
    (folder / "facade.journal.jsonl").unlink()
    typed(folder / "facade.xlsx", {"photo_1": "gone.jpg"})
    given = (folder / "far.jpg", folder / "near.jpg")
    with (
        pytest.raises(ValueError, match=r"gone\.jpg"),
        opened(*given, workbook=folder / "facade.xlsx"),
    ):
        pass


def test_a_survey_is_taken_up_from_its_folder(survey) -> None:
    """Second start: the journal names the workbook; photos beside it are no second survey."""
    for name in ("far.jpg", "near.jpg"):
        shutil.copyfile(survey.parent / "photos" / name, survey.parent / name)
    for _ in range(2):
        with opened(survey.parent) as session:
            assert session.files.pair_is_workbook


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ({"photo_1": None, "photo_2": None}, "names neither photos"),
        ({"photo_2": "photos/none.jpg"}, "none.jpg"),
        ({"d_1": 9.5, "d_2": 17.5, "delta_d": None, "c_1": 19, "c_2": 35}, "far photo"),
        ({"c_1": None}, "c_1"),
    ],
)
def test_a_set_up_that_is_no_pair_is_refused_in_words(survey, cells, words) -> None:
    typed(survey, cells)
    before = sorted(path.name for path in survey.parent.iterdir())
    with pytest.raises(ValueError, match=words), opened(survey):
        pass
    after = [n for n in sorted(p.name for p in survey.parent.iterdir()) if "journal" not in n]
    assert after == before


def test_other_photos_than_the_workbooks_are_refused(survey) -> None:
    photos = survey.parent / "photos"
    shutil.copyfile(photos / "far.jpg", photos / "other.jpg")
    with (
        pytest.raises(ValueError, match="other"),
        opened(photos / "other.jpg", photos / "near.jpg", workbook=survey),
    ):
        pass


def test_a_workbook_that_is_none_is_refused_before_the_page_is_there(survey) -> None:
    photos, junk = survey.parent / "photos", survey.parent / "junk.xlsx"
    junk.write_text("no workbook")
    words = ["pick", str(photos / "far.jpg"), str(photos / "near.jpg"), "--workbook", str(junk)]
    done = CliRunner().invoke(main, [*words, "--no-browser"])
    assert done.exit_code == 1
    assert "junk.xlsx: is not a workbook" in done.stderr
    assert junk.read_text() == "no workbook"


def test_the_command_alone_says_that_the_page_is_there() -> None:
    assert "bifocal pick    " in CliRunner().invoke(main, []).output


def test_what_the_lenses_say_of_far_and_near_is_asked(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder / "near.jpg", folder / "far.jpg") as session:
        client = client_of(session)

        def questions() -> str:
            return " ".join(client.get("/api/state").json()["photos"][0]["missing"])

        session.command({"op": "setup.set", "d1": 17.5, "d2": 9.5})
        for image, focal in ((1, 19), (2, 35)):
            lens = {"focal_mm": focal, "sensor_width_mm": 22.7}
            session.command({"op": "photo.set", "image": image, **lens})
        assert "exchange far and near?" in questions()
        session.command({"op": "photos.exchange"})
        assert "exchange" not in questions()


def test_the_browser_is_given_a_file_of_the_user_alone_not_the_token(tmp_path, monkeypatch) -> None:
    """What stands in a command line is read by all users of the computer."""
    opened_with = queue.SimpleQueue()
    monkeypatch.setattr("webbrowser.open", opened_with.put)
    with page_server(sample_folder(tmp_path)) as server:
        server.open_browser()
        address = opened_with.get(timeout=10)
        page = tmp_path / ".facade.page.html"
        assert address == page.as_uri()
        assert server.token not in address
        assert os.name == "nt" or page.stat().st_mode & 0o777 == 0o600
        assert f'content="0; url={server.url}"' in page.read_text()
    assert not page.exists()


def test_a_port_that_is_taken_is_said_before_anything_is_written(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with (
            pytest.raises(InputError, match="leave --port out"),
            page_server(folder, port=other.getsockname()[1]),
        ):
            pass
    assert entries(folder) == ["facade.pair.json", "far.jpg", "near.jpg"]


def test_the_end_waits_for_the_photos_that_are_being_read(tmp_path, monkeypatch) -> None:
    """A thread within OpenCV when Python ends aborts the whole process."""
    began, done = threading.Event(), []

    def read(_session) -> None:
        began.set()
        time.sleep(0.2)
        done.append("read")

    monkeypatch.setattr(workflow, "WARM_UP", 0.0)
    monkeypatch.setattr(workflow, "_warm_up", read)
    with page_server(sample_folder(tmp_path)):
        assert began.wait(10)
    assert done == ["read"]
