"""What the page says of the precision of places and of relief, and the drawing scale it chooses."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal import InputError, Pair
from bifocal.collimation.asked import goodness
from bifocal.collimation.job_tasks import task_of
from bifocal.model.length_checks import LengthCheck
from bifocal.orthophotos.deliver_workflow import DeliverTask, deliver
from bifocal.orthophotos.ortho_workflow import OrthoTask
from bifocal.reports.content import ReportTask
from bifocal.reports.workflow import report_of
from bifocal.survey.wall_precision import PRINT, places_sigma
from tests.page_session import client_of, opened, proposed, sample_folder, two_photos


def test_places_are_known_as_well_as_noise_on_the_picks_moves_them(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        pair, sizes = session.pictures.pair, [info.size for info in session.pictures.infos]
        stated = float(np.median(places_sigma(pair, sizes, session.results.solved)))
    rng = np.random.default_rng(5)
    plane = rng.uniform((-4.5, -2.5), (4.5, 2.5), (400, 2))
    picks = [pair.photo(number).pixels_from_plane(plane) for number in (1, 2)]
    moved = [pixels + rng.normal(0.0, 0.5, pixels.shape) for pixels in picks]
    off = pair.intersect(*moved, sigma_px=0.5).xyz[:, :2] - plane
    # 400 draws tell a spread to 4 %, and a quarter of the wall is near the nadir.
    assert np.hypot(*off.std(axis=0)) == pytest.approx(stated, rel=0.15)


def test_the_finest_scale_whose_tolerance_holds_the_places_is_chosen(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        good = goodness(session)
        assert PRINT.tolerance(20) < good.place <= PRINT.tolerance(50)
        state = client_of(session).get("/api/state").json()
        assert state["drawing_scale"] == good.scale == 50
        assert "1:50 holds" in state["good"]


def test_without_a_scale_no_drawing_scale_is_chosen(tmp_path) -> None:
    with opened(two_photos(tmp_path)) as session:
        proposed(session, tmp_path)
        assert client_of(session).get("/api/state").json()["drawing_scale"] is None


def test_every_further_taped_length_checks_the_scale_and_is_told_in_the_package(tmp_path) -> None:
    scale, check = [[300.0, 250.0], [1200.0, 240.0]], [[310.0, 690.0], [1200.0, 260.0]]
    with opened(two_photos(tmp_path)) as session:
        client = client_of(session)
        proposed(session, tmp_path)
        drawn = {"op": "length.check", "image": 1, "ends": check, "length": 7.2}
        assert session.command(drawn)["name"] == "K1"
        (shown,) = client.get("/api/state").json()["check_lengths"]
        assert "measured" not in shown  # there is no scale yet
        session.command({"op": "length.set", "image": 1, "ends": scale, "length": 6.64})
        pair = session.pictures.pair
        truth = np.linalg.norm(np.diff(pair.image1.plane_from_pixels(check), axis=0))
        (shown,) = client.get("/api/state").json()["check_lengths"]
        assert shown["difference"] == pytest.approx(truth - 7.2)
        session.command({**drawn, "name": "K1", "length": float(truth)})
        session.command({**drawn, "length": 5.0})
        assert [one["name"] for one in client.get("/api/state").json()["check_lengths"]] == [
            "K1",
            "K2",
        ]
        for wrong in (drawn | {"name": "length"}, {"op": "length.delete", "name": "K9"}):
            with pytest.raises(InputError, match="length"):
                session.command(wrong)
        session.command({"op": "length.delete", "name": "K2"})
        session.command({"op": "undo"})
        assert session.pictures.pair.d1 == pair.d1  # what checks gives no scale
        session.command({"op": "align.accept"})
        told = task_of(session, "deliver", {}).lengths
        assert told["K1"].measured == pytest.approx(truth)
        assert set(told) == {"K1", "K2"}


def test_sheet_and_report_say_how_many_taped_lengths_agree(tmp_path) -> None:
    checks = {"K1": LengthCheck(taped=3.0, measured=3.004, sigma=0.005),
              "K2": LengthCheck(taped=2.0, measured=2.1, sigma=0.005)}  # fmt: skip
    pair = sample_folder(tmp_path) / "facade.pair.json"
    report_of(pair, tmp_path / "r.html", ReportTask(language="it", lengths=checks))
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "1 di 2 lunghezze misurate sul posto concordano, scarto massimo 100 mm" in text
    assert "+100.0" in text
    wish = DeliverTask(scale=200, lengths=tuple(checks.values()), language="it")
    deliver(Pair.read(pair), tmp_path / "out", OrthoTask(gsd=0.05), wish)
    (drawing,) = (tmp_path / "out").glob("*.dxf")
    assert "1 di 2 lunghezze misurate sul posto concordano" in drawing.read_text(encoding="utf-8")
