"""Orientation without a click, and what is drawn on the wall: the session, without a browser."""

from __future__ import annotations

import errno
import io
import json
import os
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bifocal import SAMPLE, InputError, Pair, ReliefMap
from bifocal.collimation import first_orientation
from bifocal.collimation.first_orientation import FirstOrientation
from bifocal.collimation.job_results import finish
from bifocal.collimation.job_tasks import task_of
from bifocal.collimation.proposals import wall_sheet
from bifocal.collimation.server.uploads import take_photos
from bifocal.collimation.shapes import met, places_of
from bifocal.collimation.starting import RECENT, recent, remember, reopen
from bifocal.collimation.work.tasks import TargetsTask
from bifocal.faces.faces import Face, Faces
from tests.page_session import client_of, opened, proposed, sample_folder, two_photos

ENDS = [[300.0, 250.0], [1200.0, 700.0]]
#: A face on the sample's wall, in photo 1, half a metre back. [px, m]
DOOR = [[600.0, 400.0, -0.5], [800.0, 400.0, -0.5], [800.0, 700.0, -0.5], [600.0, 700.0, -0.5]]


def test_one_drawn_length_scales_what_the_photos_gave_and_undo_takes_it_back(tmp_path) -> None:
    with opened(two_photos(tmp_path)) as session:
        client = client_of(session)
        proposed(session, tmp_path)
        state = client.get("/api/state").json()
        assert not state["pair"]["scaled"]
        assert not state["good"]
        assert "length" in state["advice"][0]
        with pytest.raises(InputError, match="how large the wall is"):
            session.command({"op": "align.accept"})
        with pytest.raises(InputError, match="one spot"):
            session.command({"op": "length.set", "image": 1, "ends": [ENDS[0]] * 2, "length": 1.0})
        session.command({"op": "length.set", "image": 2, "ends": ENDS, "length": 3.0})
        pair = session.pictures.pair
        assert np.hypot(*np.diff(pair.image2.plane_from_pixels(ENDS), axis=0)[0]) == pytest.approx(
            3
        )
        state = client.get("/api/state").json()
        assert state["pair"]["scaled"]
        assert "1:" in state["good"]
        session.command({"op": "undo"})
        assert not client.get("/api/state").json()["pair"]["scaled"]
        session.command({"op": "setup.set", "d1": 17.5})
        assert session.pictures.pair.d1 == pytest.approx(17.5)
        session.command({"op": "align.accept"})
        assert Pair.read(session.files.pair).d1 == pytest.approx(17.5)


def test_the_scale_is_mended_after_the_orientation_was_accepted(tmp_path) -> None:
    def length_between_the_ends(pair: Pair) -> float:
        return float(np.hypot(*np.diff(pair.image1.plane_from_pixels(ENDS), axis=0)[0]))

    drawn = {"op": "length.set", "image": 1, "ends": ENDS}
    with opened(two_photos(tmp_path)) as session:
        proposed(session, tmp_path)
        session.command({**drawn, "length": 3.0, "sigma": 0.002})
        session.command({"op": "align.accept"})
        accepted = session.files.pair
        session.command({"op": "length.check", "image": 1, "ends": ENDS[::-1], "length": 3.3})
        session.command({**drawn, "length": 3.3, "sigma": 0.001})
        state = client_of(session).get("/api/state").json()
        assert state["steps"]["orientation"]["action"] == "accept"
        assert not state["pair"]["accepted"]
        assert state["pair"]["free_scale"]
        assert length_between_the_ends(Pair.read(accepted)) == pytest.approx(3.0)
    with opened(tmp_path) as session:  # taken up again, the mended one still waits
        assert length_between_the_ends(session.pictures.pair) == pytest.approx(3.3)
        session.command({"op": "align.accept"})
        assert session.files.pair == accepted
        assert length_between_the_ends(Pair.read(accepted)) == pytest.approx(3.3)
        state = client_of(session).get("/api/state").json()
        assert state["check_lengths"][0]["difference"] == pytest.approx(0, abs=1e-9)
        assert state["scale"]["sigma"] == pytest.approx(0.001)
        assert not list(tmp_path.glob("*.proposed*"))


def test_the_orientation_is_begun_once_and_makes_way(tmp_path, monkeypatch) -> None:
    begun = []
    monkeypatch.setattr(first_orientation, "start_job", lambda *a, **k: begun.append((a[1:], k)))
    with opened(two_photos(tmp_path)) as session:
        watch = FirstOrientation(session)
        watch.look()
        watch.look()
        assert begun == [(("align", {"way": "auto"}), {"quiet": True})]
        session.command({"op": "photo.set", "image": 1, "focal_mm": 35, "sensor_width_mm": 22.7})
        watch.look()
        session.command({"op": "wall.set", "column": 700, "row": 500})
        watch.look()
        assert len(begun) == 3
        session.command({"op": "control.pick", "name": "C1", "image": 1, "column": 9, "row": 9})
        session.command({"op": "wall.set"})
        watch.look()
        assert len(begun) == 3


def test_a_control_point_that_is_switched_off_takes_no_part(tmp_path) -> None:
    from bifocal.collimation.live_orientation import control_of

    with opened(two_photos(tmp_path)) as session:
        for name in ("A", "B"):
            session.command({"op": "control.pick", "name": name, "image": 1, "column": 9, "row": 9})
        session.command({"op": "control.use", "name": "A", "use": False})
        assert control_of(session.state).ids == ("B",)
        assert [one["use"] for one in client_of(session).get("/api/state").json()["control"]] == [
            False,
            True,
        ]


def test_the_sheet_of_the_wall_leaves_out_what_is_none() -> None:
    pixels = np.stack(np.meshgrid(np.arange(10, 1600, 20), np.arange(10, 1000, 20)), -1)
    pixels = pixels.reshape(-1, 2).astype(float)
    door = (np.abs(pixels - [800, 500]) < 200).all(axis=1)
    outer, *holes = wall_sheet(pixels, ~door, (1600, 1000))
    assert np.ptp(outer, axis=0) == pytest.approx([1600, 1000], abs=60)
    assert np.mean(holes[0], axis=0) == pytest.approx([800, 500], abs=40)


def test_photos_come_one_at_a_time_and_keep_their_names(tmp_path) -> None:
    photos = {"Straße 1 – fern.jpg": "far.jpg", "nah (2).jpg": "near.jpg"}
    there: tuple = ()
    for name, source in photos.items():
        there = take_photos(tmp_path, [(name, io.BytesIO((SAMPLE / source).read_bytes()))], there)
    assert [path.name for path in there] == ["Straße 1 _ fern.jpg", "nah (2).jpg"]
    again = [("x.jpg", io.BytesIO((SAMPLE / "far.jpg").read_bytes()))]
    for kept in (there, there[:1]):
        again[0][1].seek(0)
        with pytest.raises(InputError, match="already"):
            take_photos(tmp_path, again, kept)


def test_where_only_one_photo_has_room_none_stays(tmp_path, monkeypatch) -> None:
    room = [True, False]

    def copied(source, target):
        if not room.pop(0):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        Path(target).write_bytes(Path(source).read_bytes())

    monkeypatch.setattr("bifocal.collimation.server.uploads.shutil.copyfile", copied)
    sent = [(name, io.BytesIO((SAMPLE / name).read_bytes())) for name in ("far.jpg", "near.jpg")]
    with pytest.raises(InputError, match="nothing was left behind"):
        take_photos(tmp_path, sent)
    assert list(tmp_path.iterdir()) == []


def test_what_is_drawn_lies_beside_the_pair_and_comes_back(tmp_path) -> None:
    folder = sample_folder(tmp_path)
    kept = folder / "facade.faces.geojson"
    with opened(folder / "facade.pair.json") as session:
        session.command({"op": "shape.set", "kind": "face", "corners": DOOR})
        outline = {"op": "shape.set", "kind": "outline", "corners": [[c, r, 0] for c, r, _ in DOOR]}
        session.command(outline)
        feature = json.loads(kept.read_text())["features"][0]
        assert feature["properties"] == {"kind": "face", "name": "F1", "relief": -0.5}
        # By Eqs. (1) and (7) on paper: 7.38 mm a pixel on the plane, less by (d - r) / d.
        x, y = feature["geometry"]["coordinates"][0][0]
        assert (x, y) == pytest.approx(
            ((600 - 767.5) * 0.00738 * 18 / 17.5, (511.5 - 400) * 0.00738 * 18 / 17.5), abs=2e-4
        )
        shown = client_of(session).get("/api/state").json()["shapes"]
        assert shown[1]["width"] == pytest.approx(200 * 0.00738, abs=1e-4)
        assert shown[1]["area"] == pytest.approx(200 * 300 * 0.00738**2, rel=1e-4)
        (folder / "d").mkdir()
        task = replace(task_of(session, "deliver", {}), out=folder / "d")
        finish(session, task, {"files": [], "made": {}})
        table = (folder / "d" / "facade_outlines.csv").read_text().splitlines()
        assert table[0].startswith("id,layer,width [m],height [m],area [m2]")
        assert table[1].startswith("O2,outlines,1.47")
        session.command({"op": "undo"})
        session.command({"op": "undo"})
        assert not kept.exists()
        session.command({"op": "redo"})
        assert kept.exists()
        with pytest.raises(InputError, match="corners"):
            session.command({"op": "shape.set", "kind": "face", "corners": DOOR[:2]})
    ring = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 2.0]])
    Faces(faces=(Face(name="door", rings=(ring,), plane=np.array([-0.2, 0, 0])),)).write(
        kept, overwrite=True
    )
    with opened(folder) as session:  # somebody else drew meanwhile
        assert list(session.state.shapes) == ["door"]
        places = places_of(session.pictures.pair, session.state.shapes["door"].corners)
        np.testing.assert_allclose(places, np.insert(ring, 2, -0.2, axis=1), atol=2e-5)


def test_a_ray_meets_the_relief_where_the_photo_shows_it(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        pair = session.pictures.pair
        relief = ReliefMap.from_relief(
            np.full((200, 300), 0.8), plane_from_pixel=[[0.05, 0, -7.5], [0, -0.05, 5], [0, 0, 1]]
        )
        pixels = np.array([[300.0, 250.0], [1200.0, 700.0]])
        places = met(pair, relief, pixels)
        np.testing.assert_allclose(pair.project(places)[0], pixels, atol=1e-6)
        np.testing.assert_allclose(places[:, 2], 0.8, atol=1e-6)
        relief.write(tmp_path / "facade.relief.tif")
        session.note_made("relief", ["facade.relief.tif"])
        client = client_of(session)
        found = client.post(
            "/relief/met", json={"pixels": [[600, 400], [800, 400], [800, 700]]}
        ).json()
        assert found["within"] == pytest.approx(0.8, abs=1e-6)
        value = client.get("/relief/value?X=0.5&Y=0.5").json()
        np.testing.assert_allclose(
            value["picks"], np.ravel(pair.project(np.array([[0.5, 0.5, 0.8]]))).reshape(2, 2)
        )
        assert client.get("/preview/relief").content[:4] == b"\x89PNG"
        assert client.get("/relief/overlay.png?low=-1&high=1&hatched").status_code == 200
        facts = client.get("/api/state").json()["products"]["relief"]
        assert sum(facts["histogram"]["counts"]) == 60_000
        answer = client.get("/download/all.zip")
        assert int(answer.headers["x-bytes"]) > 0
        names = zipfile.ZipFile(io.BytesIO(answer.content)).namelist()
        inside = {"far.jpg", "near.jpg", "facade.pair.json", "facade.relief.tif"}
        assert {f"data/{name}" for name in inside} <= set(names)


def test_the_sample_opens_oriented_and_surveys_are_remembered(tmp_path) -> None:
    with opened(tmp_path) as session:
        client = client_of(session)
        state = client.post("/api/sample", json={}).json()
        assert [photo["name"] for photo in state["photos"]] == ["far.jpg", "near.jpg"]
        assert state["pair"]["accepted"]
        session.command({"op": "point.pick", "image": 1, "column": 9.0, "row": 9.0})
        assert client.post("/api/sample", json={}).status_code == 422
        remember(session.files, tmp_path)
        remember(session.files, tmp_path)
    assert recent(tmp_path) == [str(tmp_path / "survey.xlsx")]
    with opened(tmp_path) as session:  # it is there again
        assert session.pictures.pair is not None
    (tmp_path / RECENT).write_text("no list")
    assert recent(tmp_path) == []
    with pytest.raises(InputError, match="not there"):
        reopen(0, tmp_path)


def test_targets_that_were_found_become_control_points_once(tmp_path) -> None:
    found = {"name": "T001", "picks": [[9.0, 8.0], [7.0, 6.0]], "code": "disc", "note": ""}
    with opened(sample_folder(tmp_path)) as session:
        session.command({"op": "control.pick", "name": "T001", "image": 1, "column": 1, "row": 1})
        for count in ("1", "No targets"):
            assert count in finish(
                session, TargetsTask(pair=Path("wall.pair.json")), {"points": [found]}
            )
        assert sorted(session.state.control) == ["T001", "T001b"]
        session.command({"op": "undo"})
        assert sorted(session.state.control) == ["T001"]
