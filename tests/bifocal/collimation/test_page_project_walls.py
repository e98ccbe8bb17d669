"""A project of another program lies in the folder: its walls are shown, and one is begun with."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bifocal import Pair, PhotoSet
from tests.browser import served, tab_of
from tests.builders import foreign_projects
from tests.page_session import client_of, opened, pick


@pytest.fixture(scope="module")
def house(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A COLMAP project of a front and a flank, in no unit."""
    folder = tmp_path_factory.mktemp("house")
    front, flank = foreign_projects.make_shots()[:3], foreign_projects.make_flank_shots()
    foreign_projects.render(front, folder / "images")
    foreign_projects.render(flank, folder / "images", foreign_projects.FLANK)
    xyz = foreign_projects.to_world(
        np.vstack([foreign_projects.wall_points(), foreign_projects.flank_points()])
    )
    foreign_projects.write_colmap_text(folder / "sparse", [*front, *flank], xyz)
    return folder


def copied(house: Path, folder: Path) -> Path:
    return Path(shutil.copytree(house, folder / "house"))


def test_a_wall_of_a_project_is_begun_with_and_waits_for_its_scale(house: Path, tmp_path: Path):
    with opened(copied(house, tmp_path)) as session:
        client = client_of(session)
        walls = client.get("/api/walls").json()["walls"]
        assert [one["words"][:24] for one in walls] == [
            "wall 1 of 2: 2.4 x 1.6, ", "wall 2 of 2: 1.6 x 1.5, "
        ]  # fmt: skip
        assert all(one["picture"].startswith("data:image/jpeg;base64,/9j/") for one in walls)
        assert client.post("/api/walls", json={"number": 9}).status_code == 422
        state = client.post("/api/walls", json={"number": 2}).json()
        names = [one["name"] for one in (*state["photos"], *state["others"])]
        assert sorted(names) == ["SIDE_0.png", "SIDE_1.png", "SIDE_2.png"]
        assert (state["pair"]["accepted"], state["pair"]["scaled"]) == (False, False)
        # 7 m before the flank stands one of them: the whole set gets its scale by that.
        near = session.pictures.pair.image2.distance
        session.command({"op": "setup.set", "d2": near / foreign_projects.UNIT, "sigma_d2": 0.01})
        session.command({"op": "align.accept"})
        pair = Pair.read(session.files.pair)
        assert pair.image2.distance == pytest.approx(near / foreign_projects.UNIT)
        assert "unit" not in pair.extra
        pick(session, "A", 1, (100.0, 100.0))
        assert client.post("/api/walls", json={"number": 1}).status_code == 422
    with opened(tmp_path) as session:
        assert client_of(session).get("/api/walls").json() == {"walls": []}


def test_a_project_in_metres_is_oriented_at_once_with_its_set(tmp_path: Path):
    folder = tmp_path / "metres"
    shots = foreign_projects.make_shots()[:3]
    foreign_projects.render(shots, folder / "images")
    foreign_projects.write_opensfm(
        folder / "reconstruction.json",
        shots,
        foreign_projects.to_world(foreign_projects.wall_points()),
        gps=True,
    )
    with opened(folder) as session:
        state = client_of(session).post("/api/walls", json={"number": 1}).json()
        assert state["pair"]["accepted"]
        assert len(PhotoSet.read(session.photo_set).photos) == 3


@pytest.mark.acceptance
def test_the_wall_is_clicked_on_the_empty_page(browser: Any, house: Path, tmp_path: Path):
    with served(copied(house, tmp_path), ".") as server, tab_of(browser, server) as page:
        page.tab.get_by_test_id("wall-1").wait_for()
        page.click("wall-2")
        page.settled("state.photos.length === 2 && state.pair && !state.pair.scaled")
        assert page.tab.get_by_test_id("wall-1").is_hidden()
        assert page.wait("() => bifocal.state().others.length") == 1
