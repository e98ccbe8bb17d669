"""Photos beside far and near: dropped, oriented with the pair, used for what is made; one alone."""

from __future__ import annotations

import json
import pickle
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bifocal import SAMPLE
from bifocal.collimation.first_orientation import FirstOrientation
from bifocal.collimation.job_results import finish
from bifocal.collimation.job_tasks import start_job, task_of
from bifocal.collimation.project import find_files
from bifocal.collimation.work.orienting import rectify
from bifocal.model.geotiff import RasterReader
from bifocal.model.pair import Pair
from bifocal.model.photo_set import PhotoSet
from photocore.errors import InputError
from photocore.jsonfile import plain
from tests.browser import true_pixel
from tests.page_session import client_of, opened, pick_both, sample_folder, sample_picks

FAR, NEAR = ((SAMPLE / name).read_bytes() for name in ("far.jpg", "near.jpg"))
#: Stands for a third photo: what is tested is where it goes, not what it shows.
THIRD = (SAMPLE / "near.jpg").read_bytes() + b" "


def sent(*photos: tuple[str, bytes]) -> dict[str, tuple[str, bytes]]:
    return {f"photo{number}": photo for number, photo in enumerate(photos, start=1)}


def write_set(folder: Path, *, third: str = "third.jpg", moved: float = 0.0) -> Path:
    """Write the set of the sample's pair and a third photo."""
    pair = Pair.read(folder / "facade.pair.json").to_dict()
    photos = [{**pair[key], "name": key} for key in ("image1", "image2")]
    photos[0]["plane_from_pixel"] = np.array(photos[0]["plane_from_pixel"]).tolist()
    photos[0]["plane_from_pixel"][0][2] += moved
    photos.append({**photos[1], "name": "third", "file": third, "distance": 12.0})
    path = folder / "facade-set.photos.json"
    path.write_text(json.dumps(plain({"format": "bifocal-photos/1", "photos": photos})))
    return path


def test_three_photos_dropped_are_a_pair_and_one_more(tmp_path: Path) -> None:
    with opened(tmp_path) as session:
        client = client_of(session)
        photos = sent(("far.jpg", FAR), ("near.jpg", NEAR), ("side.jpg", THIRD))
        state = client.post("/api/photos", files=photos).json()
        assert [photo["name"] for photo in state["photos"]] == ["far.jpg", "near.jpg"]
        assert [(one["name"], one["joined"]) for one in state["others"]] == [("side.jpg", False)]
        assert client.get("/tiles/photo/3/info").json()["width"] == 1536
        session.command({"op": "photos.exchange"})
        assert len(client.get("/api/state").json()["others"]) == 1
    with opened(tmp_path) as session:  # taken up again
        assert [info.path.name for info in session.pictures.others] == ["side.jpg"]
        assert client_of(session).delete("/api/photos/3").json()["others"] == []
    assert (tmp_path / "side.jpg").is_file()
    with opened(tmp_path) as session:
        assert session.pictures.others == []


def test_a_third_photo_comes_when_points_are_picked_already(tmp_path: Path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        pick_both(session, "T01", sample_picks()["T01"])
        answer = client_of(session).post("/api/photos", files=sent(("side.jpg", THIRD)))
        assert [one["name"] for one in answer.json()["others"]] == ["side.jpg"]
        assert session.state.points["T01"].is_complete
        refused = client_of(session).post("/api/photos", files=sent(("again.jpg", NEAR)))
        assert "lies here already" in refused.json()["error"]


def test_further_photos_join_an_accepted_pair_by_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []

    def note(_session: Any, kind: str, *_options: Any, **_more: Any) -> None:
        started.append(kind)

    monkeypatch.setattr("bifocal.collimation.first_orientation.start_job", note)
    with opened(sample_folder(tmp_path)) as session:
        watcher = FirstOrientation(session)
        watcher.look()
        assert started == []
        client_of(session).post("/api/photos", files=sent(("third.jpg", THIRD)))
        for _ in range(2):
            watcher.look()
        assert started == ["join"]


def test_what_joined_is_the_pair_and_what_is_made_is_of_the_set(tmp_path: Path) -> None:
    folder = sample_folder(tmp_path)
    with opened(folder) as session:
        client = client_of(session)
        client.post("/api/photos", files=sent(("third.jpg", THIRD)))
        task = task_of(session, "join", {})
        assert [path.name for path in task.photos] == ["far.jpg", "near.jpg", "third.jpg"]
        made = write_set(folder, moved=0.25)
        said = finish(session, replace(task, out=made), {"lenses": [], "remarks": ["Good."]})
        assert said == "Good."
        shown = client.get("/api/state").json()
        assert shown["others"][0] == {
            "image": 3, "name": "third.jpg", "width": 1536, "height": 1024, "joined": True,
            "distance": 12.0,
        }  # fmt: skip
        own = PhotoSet.read(made).photos[0].plane_from_pixel
        assert session.files.pair is not None
        assert session.files.pair.name == "facade-page.pair.json"  # the user's own stays
        np.testing.assert_array_equal(session.accepted_pair.image1.plane_from_pixel, own)
        for kind in ("relief", "ortho", "deliver"):
            told = task_of(session, kind, {"image": "1"})
            assert told.photo_set == made.resolve()
            assert "image" not in told.settings
        names = client.get("/api/state").json()["products"]["files"]
        assert made.name in [file["name"] for file in names]
        # Another photo, and the set is none of these any more.
        client.post("/api/photos", files=sent(("fourth.jpg", THIRD + b" ")))
        assert session.photo_set is None
    assert find_files([made]).photo_set == made
    with opened(made) as session:
        assert session.photo_set == made


def test_a_job_begins_though_the_workbook_is_being_written(tmp_path: Path) -> None:
    """The writer of the workbook needs the survey's lock: who holds that must not wait for it."""
    with opened(sample_folder(tmp_path)) as session:
        pick_both(session, "T01", sample_picks()["T01"])
        started: list[Any] = []
        with session.sync._busy:
            run = threading.Thread(
                target=lambda: started.append(start_job(session, "deliver", {})), daemon=True
            )
            run.start()
            run.join(timeout=5)
            assert started[0].state == "running"
            assert session.lock.acquire(timeout=5)
            session.lock.release()
            session.jobs.cancel(started[0].number)


def test_one_photo_alone_comes_to_scale_by_a_rectangle(tmp_path: Path) -> None:
    corners = [true_pixel(1, (x, y, 0.0)) for x, y in ((-4, 2), (4, 2), (4, -2), (-4, -2))]
    with opened(tmp_path) as session:
        client = client_of(session)
        client.post("/api/photos", files=sent(("far.jpg", FAR)))
        snapped = client.post("/api/snap", json={"image": 1, "column": 5, "row": 5})
        assert snapped.status_code == 200
        given = {"corners": corners, "width": 8.0, "height": 4.0, "scale": "1:100"}
        for wrong in ({**given, "width": None}, {**given, "corners": corners[:3]}):
            with pytest.raises(InputError, match="rectangle"):
                task_of(session, "rectify", wrong)
        task = pickle.loads(pickle.dumps(task_of(session, "rectify", given)))
        result = json.loads(json.dumps(plain(rectify(task, lambda *_: None))))
        said = finish(session, task, result)
        assert "displaced" in said
        assert np.abs(client.get("/api/state").json()["misfits"]).max() < 0.1
        skew = np.add(corners, [[0, 0], [4, 0], [0, 0], [0, 0]])
        off = rectify(replace(task, corners=skew, overwrite=True), lambda *_: None)
        # One corner moved against a fitting rectangle: all four miss it, by no more than that.
        assert 0.3 < np.linalg.norm(off["misfits"], axis=1).max() < 4
        shown = client.get("/api/state").json()["products"]
        assert shown["rectified"]["name"] == "survey-rectified.tif"
        assert any(file["name"].endswith(".pdf") for file in shown["files"])
        assert client.get("/preview/rectified").status_code == 200
        with RasterReader(tmp_path / "survey-rectified.tif") as file:
            xmin, ymin, xmax, ymax = file.grid.bounds
        # The photo is square to the wall: 1536 x 1024 pixels of 7.38 mm.
        assert (xmax - xmin, ymax - ymin) == pytest.approx((11.34, 7.56), abs=0.05)
        client.post("/api/photos", files=sent(("near.jpg", NEAR)))
        with pytest.raises(InputError, match="one photo"):
            task_of(session, "rectify", given)
