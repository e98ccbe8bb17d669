"""Orientation as it comes, commands, jobs, relief and files of the page."""

from __future__ import annotations

import json
import time
import zipfile
from dataclasses import replace
from io import BytesIO

import ezdxf
import numpy as np
import openpyxl
import pytest
from PIL import Image

from bifocal import SAMPLE, InputError, Pair, Photo, PhotoSet, ReliefMap
from bifocal.campaigns.verification import verify
from bifocal.collimation.job_results import finish
from bifocal.collimation.job_tasks import task_of
from bifocal.collimation.live_orientation import control_of, live_orientation
from bifocal.collimation.orienting_tasks import with_tables
from bifocal.collimation.project import find_files
from bifocal.collimation.records import PickedControl, SurveyState
from bifocal.collimation.work import making
from bifocal.collimation.workbook.profile_book import HEADINGS
from bifocal.orientation.align_workflow import AlignOptions
from bifocal.orientation.control_points import read_lengths
from photocore.images import image_info
from tests.page_session import (
    client_of,
    entries,
    opened,
    pick,
    pick_both,
    sample_folder,
    sample_picks,
)


def control_state(count: int, *, seed: int = 1, blunder: float = 0.0) -> SurveyState:
    """Return control points of the sample's wall, picked to 0.2 px."""
    pair, rng = Pair.read(SAMPLE / "facade.pair.json"), np.random.default_rng(seed)
    places = [(-5, -3, 0), (5, -3, 0), (5, 3, 0), (-5, 3, 0), (0, 0.3, 0.3), (-3, 2, 0), (2, 2, 0)]
    state = SurveyState()
    lens = {"sensor_width_mm": 1536 * 0.01476}
    state.lenses = {1: {"focal_mm": 35.0, **lens}, 2: {"focal_mm": 19.0, **lens}}
    for number, place in enumerate(places[:count]):
        picks = [
            tuple((p + rng.normal(0, 0.2, 2) + (blunder if number == 1 else 0)).tolist())
            for p in pair.project(np.array(place, float))
        ]
        name = f"C{number}"
        state.control[name] = PickedControl(
            name=name, order=number, known=tuple(map(float, place)), picks=(picks[0], picks[1])
        )
    return state


def infos():
    return [image_info(SAMPLE / name) for name in ("far.jpg", "near.jpg")]


def test_control_points_tell_the_cameras_as_they_come() -> None:
    few = live_orientation(control_state(3), infos(), "en")
    assert not few.deviations
    assert "1 more control point" in few.advice[0]
    enough = live_orientation(control_state(5), infos(), "en")
    assert enough.distances == pytest.approx((17.5, 9.5), rel=0.05)
    assert all(abs(value) < 1.5 for row in enough.residuals.values() for value in row)
    assert "would help most" in enough.advice[-1]
    state = control_state(5)
    state.setup = {"d1": 17.5, "d2": 9.5, "sigma_d": 0.005}
    taped = live_orientation(state, infos(), "de")
    assert taped.deviations["distance1"] < 0.1 * enough.deviations["distance1"]
    assert taped.advice[-1] != enough.advice[-1]


@pytest.mark.acceptance
def test_a_wrong_control_point_is_named() -> None:
    wrong = live_orientation(control_state(7, blunder=6.0), infos(), "it")
    assert "C1" in wrong.advice[0]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("A\t1,5\t2\t0,1\nB\t3\t4\t", {"A": (1.5, 2.0, 0.1), "B": (3.0, 4.0, None)}),
        ("name;X [mm];Y [mm]\nA;1500;2000", {"A": (1.5, 2.0, None)}),
        ("id,X,Y,r\nA,1.5,2,0.25\n", {"A": (1.5, 2.0, 0.25)}),
    ],
)
def test_control_points_are_pasted_from_a_spreadsheet(tmp_path, text, expected) -> None:
    with opened(sample_folder(tmp_path)) as session:
        session.command({"op": "control.paste", "text": text})
        assert {n: point.known for n, point in session.state.control.items()} == expected


def test_cells_pasted_without_headings_are_x_y_r_and_the_pixels_of_both_photos(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        line = "T01\t-0,83\t-0.43\t0.1\t117.79\t506.89\t91.09\t520.72"
        session.command({"op": "control.paste", "text": line})
        point = session.state.control["T01"]
        assert point.known == (-0.83, -0.43, 0.1)
        assert point.picks == ((117.79, 506.89), (91.09, 520.72))


#: Commands whose fields are well: the survey is not as they suppose.
NO_FIELD = (
    "no point nobody", "no point Z", "pasted|number|heading|table|X", "no control point",
    "before they are oriented", "no orientation",
)  # fmt: skip


@pytest.mark.parametrize(
    ("command", "said"),
    [
        ({"op": "point.pick", "image": 3, "column": 1, "row": 1}, "image"),
        ({"op": "point.pick", "image": 1, "column": 1}, "column, row"),
        ({"op": "point.pick", "image": 1, "column": 1e9, "row": 1}, "outside photo|or less"),
        ({"op": "point.pick", "image": 1, "column": 1536.0, "row": 1}, "outside photo 1"),
        ({"op": "point.pick", "image": 1, "column": True, "row": 1}, "number"),
        ({"op": "point.pick", "name": "x" * 99, "image": 1, "column": 1, "row": 1}, "name"),
        ({"op": "point.pick", "name": 5, "image": 1, "column": 1, "row": 1}, "name"),
        ({"op": "point.rename", "name": "nobody", "new": "x"}, "no point nobody"),
        ({"op": "point.type", "name": "A", "type": "roof"}, "type"),
        ({"op": "line.set", "name": "L", "layer": "x", "points": ["A", "Z"]}, "no point Z"),
        ({"op": "control.paste", "text": "A\tfive\t2"}, "pasted|number|heading|table|X"),
        ({"op": "tape.set", "from": "A", "to": "B", "length": -1}, "above zero"),
        ({"op": "tape.set", "from": "A", "to": "B", "length": 1}, "no control point"),
        ({"op": "setup.set", "d1": 0}, "above zero"),
        ({"op": "setup.set", "d1": "far"}, "expected a number above zero"),
        ({"op": "stage.set", "stage": "roof"}, "stage"),
        ({"op": "language.set", "language": "fr"}, "language"),
        ({"op": "photos.exchange"}, "before they are oriented"),
        ({"op": "align.accept"}, "no orientation"),
        ({"op": "nonsense"}, "no command"),
        ({}, "no command"),
    ],
)
def test_an_impossible_command_changes_nothing(tmp_path, command, said) -> None:
    with opened(sample_folder(tmp_path)) as session:
        pick_both(session, "A", sample_picks()["T01"])
        client = client_of(session)
        before = client.get("/api/state").json()
        written = (tmp_path / "facade.journal.jsonl").read_bytes()
        answer = client.post("/api/command", json=command)
        assert answer.status_code == (422 if said in NO_FIELD else 400)
        import re

        assert re.search(said, answer.json()["error"]), answer.json()["error"]
        assert client.get("/api/state").json() == before
        assert (tmp_path / "facade.journal.jsonl").read_bytes() == written


def test_what_a_command_does_not_name_stays_as_it_was(tmp_path) -> None:
    """Two fields changed one after the other, the second before the page knows of the first."""
    with opened(sample_folder(tmp_path)) as session:
        for name in ("T01", "T16"):
            pick_both(session, name, sample_picks()[name])
        for fields in ({"X": 5.0}, {"Y": 6.5}, {"X": None}):
            session.command({"op": "control.set", "name": "K"} | fields)
            session.command({"op": "point.reference", "name": "T01"} | fields)
        line = {"op": "line.set", "name": "L", "layer": "a", "points": ["T01", "T16"]}
        for fields in (line, {"layer": "doors"}, {"closed": True}):
            session.command({"op": "line.set", "name": "L"} | fields)
        state = session.state
        assert state.control["K"].known == state.points["T01"].reference == (None, 6.5, None)
        drawn = state.lines["L"]
        assert (drawn.layer, drawn.points, drawn.closed) == ("doors", ("T01", "T16"), True)


def test_photos_are_asked_about_and_exchanged_by_their_lenses(tmp_path) -> None:
    from PIL import Image

    far = Image.fromarray(np.random.default_rng(1).integers(0, 255, (64, 96, 3), np.uint8))
    exif = Image.Exif()
    for name, focal in (("long.jpg", 85), ("short.jpg", 50)):
        exif.get_ifd(34665)[41989] = focal
        far.save(tmp_path / name, exif=exif)
    with opened(tmp_path / "short.jpg", tmp_path / "long.jpg") as session:
        state = client_of(session).get("/api/state").json()
        assert [photo["name"] for photo in state["photos"]] == ["short.jpg", "long.jpg"]
        assert state["stage"] == "orientation"
        session.command({"op": "control.pick", "name": "A", "image": 1, "column": 5, "row": 6})
        session.command({"op": "photos.exchange"})
        assert session.state.control["A"].picks == (None, (5.0, 6.0))
    with opened(tmp_path) as again:
        assert again.pictures.infos[0].path.name == "long.jpg"
        assert again.state.control["A"].picks == (None, (5.0, 6.0))


def test_dropped_photos_begin_a_survey_far_one_first(tmp_path) -> None:
    from PIL import Image

    far = Image.fromarray(np.random.default_rng(1).integers(0, 255, (64, 96, 3), np.uint8))
    sent = {}
    for key, focal in (("photo1", 24), ("photo2", 85)):
        exif, buffer = Image.Exif(), BytesIO()
        exif.get_ifd(34665)[41989] = focal
        far.save(buffer, "JPEG", exif=exif)
        sent[key] = (f"img{focal}.jpg", buffer.getvalue())
    with opened(tmp_path) as session:
        client = client_of(session)
        assert client.get("/api/state").json()["stage"] == "photos"
        state = client.post("/api/photos", files=sent).json()
        assert [photo["name"] for photo in state["photos"]] == ["img85.jpg", "img24.jpg"]
        assert not state["photos"][0]["missing"]
        session.command({"op": "control.pick", "name": "A", "image": 1, "column": 5, "row": 6})
        assert client.post("/api/photos", files=sent).status_code == 422


def _wait(client, number: str) -> dict:
    end = time.monotonic() + 120
    while time.monotonic() < end:
        jobs = {job["id"]: job for job in client.get("/api/state").json()["jobs"]}
        if jobs[number]["state"] != "running":
            return jobs[number]
        time.sleep(0.05)
    raise AssertionError("the job did not end")


@pytest.mark.acceptance
def test_an_orthophoto_is_made_shown_and_replaced(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    (folder / "facade.ortho.tif").write_bytes(b"somebody else's")
    with opened(folder) as session:
        client = client_of(session)
        for _ in range(2):
            number = client.post("/api/jobs", json={"kind": "ortho", "gsd": 0.05}).json()["id"]
            job = _wait(client, number)
            assert job["state"] == "done", job
        facts = client.get("/api/state").json()["products"]["ortho"]
        assert facts["gsd"] == pytest.approx(0.05)
        info = client.get("/tiles/ortho/0/info").json()
        assert (info["width"], info["height"]) == (facts["cols"], facts["rows"])
        assert client.get("/tiles/ortho/0/7/0_0.jpg").status_code == 200
        assert client.get(f"/download/{facts['name']}").content[:2] in (b"II", b"MM")
    assert (folder / "facade.ortho.tif").read_bytes() == b"somebody else's"
    assert [name for name in entries(folder) if name.endswith("ortho.tif")] == [
        "facade-page.ortho.tif", "facade.ortho.tif",
    ]  # fmt: skip


@pytest.mark.acceptance
def test_a_job_that_fails_says_why_and_one_that_is_cancelled_leaves_nothing(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        client = client_of(session)
        small = {"kind": "ortho", "bounds": [900, 900, 901, 901], "gsd": 0.01}
        job = _wait(client, client.post("/api/jobs", json=small).json()["id"])
        assert job["state"] == "failed"
        assert job["message"].startswith("the photo shows nothing of the area asked for")
        session.language = "it"
        job = _wait(client, client.post("/api/jobs", json=small).json()["id"])
        assert job["message"].startswith("la foto non mostra nulla dell'area richiesta")
        number = client.post("/api/jobs", json={"kind": "relief"}).json()["id"]
        refused = client.post("/api/jobs", json={"kind": "match"})
        assert refused.status_code == 422
        assert refused.json()["error"].startswith("il lavoro relief è ancora in corso")
        assert client.delete(f"/api/jobs/{number}").status_code == 200
        assert _wait(client, number)["state"] == "cancelled"
        for bad in ({"kind": "roof"}, {"kind": "deliver", "sheet": "../A3"}, {"kind": "relief",
                    "quality": "x"}, {"kind": "ortho", "gsd": -1}, {"kind": "deliver",
                    "scale": "big"}, {"kind": "relief", "bounds": [1]}, {"kind": "ortho",
                    "image": 3}, {"kind": "deliver", "sections": "x=1"}):  # fmt: skip
            assert client.post("/api/jobs", json=bad).status_code == 400
    assert not [name for name in entries(folder) if name.endswith(".tif")]


def test_relief_is_read_on_the_page(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    r = np.tile(np.linspace(0, 1, 41, dtype=np.float32), (21, 1))
    r[:3] = np.nan
    relief = ReliefMap.from_relief(r, plane_from_pixel=[[0.1, 0, -2], [0, -0.1, 1], [0, 0, 1]])
    with opened(folder) as session:
        client = client_of(session)
        assert "run it first" in client.get("/relief/value?X=0&Y=0").json()["error"]
        relief.write(folder / "facade.relief.tif")
        session.note_made("relief", ["facade.relief.tif"])
        # r rises by 1 m over 4 m from X = -2.
        assert client.get("/relief/value?X=0.05&Y=0").json()["r"] == pytest.approx(0.5125, abs=1e-6)
        assert client.get("/relief/value?X=0&Y=1").json() == {"r": None, "sigma": None}
        profile = client.post("/relief/profile", json={"from": [-1, 0], "to": [1, 0]}).json()
        assert profile["distance"][-1] == pytest.approx(2.0)
        slope = np.diff(profile["r"]) / np.diff(profile["distance"])
        np.testing.assert_allclose(slope, 0.25, atol=1e-5)
        book = client.get("/relief/profile.xlsx?x0=-1&y0=0.5&x1=1&y1=0.95").content
        rows = list(openpyxl.load_workbook(BytesIO(book))["Profile"].values)
        profile = client.post("/relief/profile", json={"from": [-1, 0.5], "to": [1, 0.95]}).json()
        assert rows[0] == HEADINGS
        column = np.array([row[3] for row in rows[1:]], dtype=float)
        np.testing.assert_allclose(column, np.array(profile["r"], dtype=float), rtol=1e-12)
        assert np.isnan(column).any()
        assert rows[-1][:3] == pytest.approx((profile["distance"][-1], 1, 0.95))
        addresses = ("profile.txt?x0=0&y0=0&x1=1&y1=1", "profile.xlsx?x0=-1&y0=0")
        assert [client.get(f"/relief/{name}").status_code for name in addresses] == [404, 400]
        assert client.get("/relief/overlay.png").content[:4] == b"\x89PNG"
        assert client.get("/uncertainty.png").content[:4] == b"\x89PNG"
        facts = client.get("/api/state").json()["products"]["relief"]
        np.testing.assert_allclose(facts["bounds"], [-2.05, -1.05, 2.05, 1.05], atol=1e-9)
        known = relief.r[np.isfinite(relief.r)]
        np.testing.assert_allclose(facts["range"], np.quantile(known, [0.005, 0.995]), atol=1e-6)


def test_points_and_lines_become_a_drawing_in_space(tmp_path) -> None:
    folder, picks = sample_folder(tmp_path), sample_picks()
    with opened(folder) as session:
        client = client_of(session)
        assert client.get("/download/points.dxf").status_code == 422
        for name in ("T01", "T16", "T20"):
            pick_both(session, name, picks[name])
        line = {"op": "line.set", "name": "L1", "layer": "win/dow", "points": ["T01", "T16", "T20"]}
        session.command({**line, "closed": True})
        ring = [[600.0, 400.0, 0.0], [800.0, 400.0, 0.0], [800.0, 700.0, 0.0]]
        session.command({"op": "shape.set", "kind": "outline", "corners": ring})
        data = client.get("/download/points.dxf").content
        (tmp_path / "x.dxf").write_bytes(data)
        drawn = ezdxf.readfile(tmp_path / "x.dxf").modelspace().query("POLYLINE").first
        assert (drawn.dxf.layer, drawn.is_closed) == ("win_dow", True)
        outline = ezdxf.readfile(tmp_path / "x.dxf").modelspace().query("POLYLINE").last
        assert (outline.dxf.layer, outline.is_closed, len(outline.vertices)) == (
            "outlines",
            True,
            3,
        )
        found = [tuple(vertex.dxf.location) for vertex in drawn.vertices]
        for name, place in zip(line["points"], found, strict=True):
            row = session.results.row(session.state.points[name])
            np.testing.assert_allclose(place, [row["X"], row["Y"], row["r"]], atol=1e-9)
        session.sync.step()
        archive = zipfile.ZipFile(BytesIO(client.get("/download/all.zip").content))
        survey = [*("facade.pair.json", "facade.xlsx", "far.jpg", "near.jpg")]
        # Photos, pair and workbook in one folder, so that it opens elsewhere.
        whole = [*(f"data/{name}" for name in survey), "facade.xlsx", "SHA256SUMS"]
        assert archive.namelist() == whole
        (tmp_path / "sent.zip").write_bytes(client.get("/download/all.zip").content)
        found = verify(tmp_path / "sent.zip")
        assert [one.file for one in found.files] == sorted(whole)
        assert found.same
        archive.extractall(tmp_path / "sent")
        opened_there = find_files([tmp_path / "sent" / "data"])
        assert opened_there.pair is not None
        assert opened_there.workbook.name == "facade.xlsx"


def test_a_proposed_orientation_is_shown_and_accepted(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    pair = json.loads((folder / "facade.pair.json").read_text())
    (folder / "facade.pair.json").unlink()
    with opened(folder / "far.jpg", folder / "near.jpg") as session:
        assert session.pictures.pair is None
        proposed = folder / "survey.proposed.pair.json"
        pair["image1"]["distance"] = 17.6
        proposed.write_text(json.dumps(pair))
        session.propose(proposed, {"words": ["fine"], "remarks": [], "control": []})
        client = client_of(session)
        shown = client.get("/api/state").json()["pair"]
        assert (shown["accepted"], shown["images"][0]["distance"]) == (False, 17.6)
        pick_both(session, "A", sample_picks()["T01"])
        session.sync.step()
        assert not (folder / "survey.xlsx").exists()
        session.command({"op": "align.accept"})
        assert client.get("/api/state").json()["pair"]["accepted"] is True
        session.sync.step()
        assert (folder / "survey.xlsx").exists()
    assert Pair.read(folder / "survey.pair.json").d1 == 17.6
    assert not proposed.exists()
    with opened(folder) as again:
        assert again.pictures.pair.d1 == 17.6


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["absent.pair.json"], "no such file"),
        (["far.jpg"], "one photo"),
        (["far.jpg", "far.jpg"], "twice"),
        (["far.jpg", "near.jpg", "far.jpg"], "twice"),
        (["facade.journal"], "expected a pair file"),
    ],
)
def test_what_is_no_survey_says_so(tmp_path, names, said) -> None:
    folder = sample_folder(tmp_path)
    (folder / "facade.journal").touch()
    with pytest.raises(InputError, match=said):
        find_files([folder / name for name in names])
    (folder / "other.pair.json").touch()
    with pytest.raises(InputError, match="2 pair files"):
        find_files([folder])


def test_of_a_set_the_best_pair_is_opened_and_kept(tmp_path) -> None:
    metres = [[0.01, 0, -4], [0, -0.01, 3], [0, 0, 1]]
    photos = [
        Photo(name=name, file=f"{name}.jpg", plane_from_pixel=metres, nadir=(0, 0), distance=d)
        for name, d in (("mid", 14.0), ("far", 17.5), ("near", 9.5))
    ]
    PhotoSet(photos=tuple(photos)).write(tmp_path / "wall.photos.json")
    with pytest.raises(InputError, match="no such image"):
        find_files([tmp_path / "wall.photos.json"])
    assert [path.name for path in tmp_path.iterdir()] == ["wall.photos.json"]
    for name in ("far", "near"):
        Image.new("L", (80, 60)).save(tmp_path / f"{name}.jpg")
    files = find_files([tmp_path / "wall.photos.json"])
    assert files.pair == tmp_path / "wall-far-near.pair.json"
    assert Pair.read(files.pair).d1 == 17.5
    assert files.workbook == tmp_path / "wall-far-near.xlsx"
    files.pair.write_text(files.pair.read_text() + "\n")  # what was changed since stays
    assert find_files([tmp_path / "wall.photos.json"]).pair.read_text().endswith("\n\n")


def test_precision_contours_lie_where_picks_are_that_precise(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        client = client_of(session)
        lines = client.get("/uncertainty.json").json()
        assert {line["sigma_mm"] for line in lines} >= {20, 50, 100}
        for number, sigma in enumerate((20, 50, 100)):
            line = next(one["line"] for one in lines if one["sigma_mm"] == sigma)
            place = line[len(line) // 4]
            for image in (1, 2):
                ask = {"image": image, "pixels": [place], "from": "wall"}
                column, row = client.post("/api/convert", json=ask).json()["pixels"][0]
                pick(session, f"Q{number}", image, (column, row))
            point = session.state.points[f"Q{number}"]
            # Between the nodes of the grid the line is straight.
            assert session.results.row(point)["sigma_r"] == pytest.approx(sigma / 1000, rel=0.03)


def test_a_drawing_without_title_is_called_as_its_pair_file(tmp_path, monkeypatch) -> None:
    titles = []

    def noted(*given, **_):
        titles.append(given[3].title)
        raise InputError("enough")

    monkeypatch.setattr(making, "deliver", noted)
    with opened(sample_folder(tmp_path)) as session:
        task = replace(task_of(session, "deliver", {}), relief_first=None, ortho_first=None)
    with pytest.raises(InputError, match="enough"):
        making.make_sheets(task, lambda *_: None)
    assert titles == ["facade"]


def test_a_tape_weighs_as_it_is_said_to_be_good(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        for name, place in (("A", (300.0, 300.0)), ("B", (900.0, 300.0)), ("C", (900.0, 700.0))):
            picked = {"column": place[0], "row": place[1]}
            session.command({"op": "control.pick", "name": name, "image": 1, **picked})
        tape = {"op": "tape.set", "from": "A", "length": 4.4}
        session.command({**tape, "to": "B", "sigma": 0.05})
        session.command({**tape, "to": "C"})
        control = control_of(session.state)
        tables = with_tables(session, control, AlignOptions())
        read = read_lengths(tables.lengths, replace(control, lengths=(), sigma_lengths=()))
    assert read.lengths == control.lengths == ((0, 1, 4.4), (0, 2, 4.4))
    for found in (read, control):
        assert found.sigma_lengths == pytest.approx((0.05, np.nan), nan_ok=True)


def test_remarks_on_an_orientation_name_no_option_of_the_command_line(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        report = {"remarks": ["CHECK THE WALL: +12 mm (--wall 120,130). Give control points."]}
        session.proposal = {"op": "proposed", "pair": "none.pair.json", "report": report}
        state = client_of(session).get("/api/state").json()
        session.proposal = None
    assert state["pair"]["remarks"] == ["CHECK THE WALL: +12 mm. Give control points."]


def test_the_precision_of_a_place_is_that_of_its_pixel_up_to_the_rim(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    sigma = np.arange(1, 13, dtype=np.float32).reshape(3, 4) / 1000
    metres = [[1.0, 0, 0], [0, -1.0, 2], [0, 0, 1]]
    relief = ReliefMap.from_relief(np.zeros((3, 4), np.float32), plane_from_pixel=metres)
    replace(relief, sigma=sigma).write(folder / "facade.relief.tif")
    with opened(folder) as session:
        session.note_made("relief", ["facade.relief.tif"])
        told = session.products
        for row in range(-1, 4):
            for column in range(-1, 5):
                found = told.value(column + 0.3, 2 - row - 0.2)["sigma"]
                there = 0 <= row < 3 and 0 <= column < 4
                assert found == (pytest.approx(sigma[row, column]) if there else None)


def test_sheets_are_delivered_with_a_drawing_of_the_points_that_are_picked(tmp_path) -> None:
    folder, picks = sample_folder(tmp_path), sample_picks()
    (folder / "sheets").mkdir()
    with opened(folder) as session:
        task = replace(task_of(session, "deliver", {}), out=folder / "sheets")
        finish(session, task, {"made": {}, "files": []})
        assert not list((folder / "sheets").iterdir())
        pick_both(session, "T01", picks["T01"])
        finish(session, task, {"made": {}, "files": []})
        (drawing,) = (folder / "sheets").iterdir()
        row = session.results.row(session.state.points["T01"])
    (point,) = ezdxf.readfile(drawing).modelspace().query("POINT")
    np.testing.assert_allclose(tuple(point.dxf.location), [row["X"], row["Y"], row["r"]], atol=1e-9)
