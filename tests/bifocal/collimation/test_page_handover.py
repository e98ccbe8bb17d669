"""Each job of the page hands on to its workflow all that it is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from bifocal import Pair
from bifocal.collimation import job_process
from bifocal.collimation.work import making, matching
from bifocal.collimation.work.tasks import (
    AlignTask,
    ImageTask,
    MapTask,
    MatchTask,
    SheetTask,
    SuggestTask,
)
from bifocal.model import LengthCheck
from bifocal.orientation import AlignOptions, KnownLens, SiteMeasures
from tests.recorded import Recorded

ROOM = "bifocal.collimation.work"
LENSES = KnownLens(focal=35.1, sensor_width=22.5), KnownLens(focal=19.2, sensor_width=23.6)


def progress(done: float, total: float, what: str = "") -> None:
    """Take what a job tells of how far it is."""


def handed(monkeypatch, room: str, task, function: str, *more: str, answer=None) -> list:
    """Return the values that the workflow of a job is called with, by name."""
    answers = {
        function: answer, "read_pair": Pair.ideal(d1=17.5, d2=9.5, c1=35.0, c2=19.0),
        "faces_path": Path("faces.geojson"),
    }  # fmt: skip
    recorded = Recorded(monkeypatch, **answers)
    recorded.instead_of(*(f"{ROOM}.{room}.{name}" for name in (function, "read_pair", *more)))
    job_process._WORKS[type(task)](task, progress)
    return recorded.calls[function]


def test_a_pair_is_set_up_from_all_that_was_typed(monkeypatch, tmp_path):
    site = SiteMeasures(
        distance1=17.1, distance2=9.2, delta_d=8.3, sigma=0.024, sigma_pick=0.75,
        sigma_control=0.0076,
    )  # fmt: skip
    options = AlignOptions(
        site=site, lenses=LENSES, auto=True, one_lens=True, control=Path("control.csv"),
        lengths=Path("lengths.csv"),
    )  # fmt: skip
    task = AlignTask(
        far=Path("a.jpg"), near=Path("b.jpg"), out=tmp_path / "o.pair.json", options=options,
        free_scale=True,
    )  # fmt: skip
    done = SimpleNamespace(
        pair=SimpleNamespace(photo_file=lambda _: Path("b.jpg")), tie1="far ties",
        tie2="near ties", wall="wall", setup={"planes": 2},
    )  # fmt: skip
    sizes = {"a.jpg": (600, 400), "b.jpg": (500, 300)}
    monkeypatch.setattr(
        f"{ROOM}.orienting.image_info", lambda path: SimpleNamespace(size=sizes[Path(path).name])
    )
    monkeypatch.setattr(f"{ROOM}.orienting.alignment_as_dict", lambda _: {"whole": True})
    sheets = []
    monkeypatch.setattr(f"{ROOM}.orienting.wall_sheet", lambda *of: sheets.append(of))
    calls = handed(monkeypatch, "orienting", task, "align_photos", answer=done)
    values = {repr(value) for _, value in calls}
    for expected in (17.1, 9.2, 8.3, 0.024, 0.75, 0.0076, 35.1, 22.5, 19.2, 23.6, Path("a.jpg"),
                     Path("control.csv"), Path("lengths.csv"), task.out):  # fmt: skip
        assert repr(expected) in values, expected
    options = dict(calls)
    assert [options[name] for name in ("auto", "one_lens", "as_set_up")] == [True, True, False]
    assert options["overwrite"] is True
    # The photos were named in the wrong order: each sheet is as large as its own.
    assert sheets == [("far ties", "wall", (500, 300)), ("near ties", "wall", (600, 400))]


def test_points_are_sought_as_many_and_of_the_kind_that_was_chosen(monkeypatch):
    matches = SimpleNamespace(
        ids=["A"], pixels1=np.array([[1.00004, 2.0]]), pixels2=np.array([[3.0, 4.0]]),
        kinds=["target"], sigma=np.array([0.123]), misfit=np.array([-0.456]),
    )  # fmt: skip
    for count, features in ((71, True), (72, False)):
        task = MatchTask(pair=Path("a"), count=count, features=features)
        calls = handed(monkeypatch, "matching", task, "match_pair_file", answer=(None, matches))
        assert {"count": count, "features": features}.items() <= dict(calls).items()
    (point,) = matching.match(task, progress)["points"]
    assert point["picks"] == [[1.0, 2.0], [3.0, 4.0]]
    assert (point["code"], point["note"]) == ("target", "sigma 0.12 px, misfit 0.46 px")


def test_relief_and_orthophoto_are_made_with_every_option(monkeypatch):
    options = {"gsd": 0.0081, "bounds": (-8.1, -8.2, 8.3, 8.4), "quality": "fast"}
    of_both = {
        "pair": Path("p.pair.json"), "photo_set": None, "out": Path("r.tif"), "overwrite": True,
    }  # fmt: skip
    calls = handed(
        monkeypatch, "making", MapTask(**of_both, settings=options), "relief_of_pair",
        "faces_path", answer=("summary", ("remark",)),
    )  # fmt: skip
    values = [value for _, value in calls]
    assert {"gsd": 0.0081, "quality": "fast", "overwrite": True}.items() <= dict(calls).items()
    assert {Path("r.tif"), Path("p.pair.json"), Path("faces.geojson"), *options["bounds"]} <= {
        value for value in values if isinstance(value, Path | float)
    }
    options = {"scale": 50.0, "feather": 9.1, "image": "2"}
    task = ImageTask(**of_both, settings=options, relief=Path("relief.tif"), dpi=127.0)
    calls = handed(
        monkeypatch, "making", task, "make_ortho", "faces_path",
        answer=SimpleNamespace(remarks=("remark",)),
    )  # fmt: skip
    values = dict(calls)
    # At 1:50 and 127 pixels an inch a pixel is 0.2 mm of paper, 10 mm of the wall.
    assert (values["feather"], values["gsd"], values["overwrite"]) == (9.1, 0.01, True)
    assert {Path("relief.tif"), Path("faces.geojson"), Path("r.tif")} <= {
        value for _, value in calls if isinstance(value, Path)
    }


def test_faces_are_suggested_from_the_photos_of_the_pair_in_their_order(monkeypatch, tmp_path):
    pair = Pair.ideal(d1=17.5, d2=9.5, c1=35.0, c2=19.0)
    monkeypatch.setattr(Pair, "photo_file", lambda _, number: Path(f"{number}.jpg"))
    monkeypatch.setattr(f"{ROOM}.matching.read_grey", lambda path: f"grey {path}")
    monkeypatch.setattr(
        f"{ROOM}.matching.ReliefMap", SimpleNamespace(read=lambda path: f"map {path}")
    )
    monkeypatch.setattr(f"{ROOM}.matching.read_pair", lambda _: pair)
    monkeypatch.setattr(f"{ROOM}.matching.shapes_from", lambda faces, of: (faces, of is pair))
    monkeypatch.setattr(f"{ROOM}.matching.suggest_faces", lambda *values: values)
    task = SuggestTask(pair=tmp_path / "a.pair.json", relief=Path("r.tif"))
    faces, of_pair = matching.suggest(task, progress)["shapes"]
    assert of_pair
    assert faces == ("map r.tif", [pair.image1, pair.image2], ["grey 1.jpg", "grey 2.jpg"])
    parts = []
    part = making._within(lambda *values: parts.append(values), 0.5, 0.7)
    for done, total in ((0, 4), (1, 4), (8, 4), (1, 0)):
        part(done, total, "what")
    assert [round(share, 9) for share, _, _ in parts] == [0.5, 0.55, 0.7, 0.5]


def test_what_is_delivered_with_the_drawings_shows_the_same_products(monkeypatch, tmp_path):
    recorded = Recorded(monkeypatch)
    recorded.instead_of(*(f"{ROOM}.making.{name}" for name in ("write_handover", "view_relief",
                                                               "report_of")))  # fmt: skip
    task = SheetTask(
        out=tmp_path, relief=Path("r.tif"), ortho=Path("o.tif"), stem="wall", title="",
        language="de", sheet={"scale": 93.0}, mark=Path("points.xlsx"), photo_set=None,
        pair=Path("p.pair.json"), overwrite=True, settings={}, dpi=None, relief_first=None,
        ortho_first=None, lengths={"A B": LengthCheck(sigma=0.011, taped=4.12, measured=4.13)},
    )  # fmt: skip
    files = making._documents(task, "Nord", progress)
    assert files == ["wall_report.html", "wall_3d.html", "wall_handover.html"]
    for name in ("write_handover", "view_relief", "report_of"):
        values = {repr(value) for value in recorded.values(name)}
        for expected in (Path("r.tif"), Path("o.tif"), "Nord", "de", True):
            assert repr(expected) in values, (name, expected)
    for expected in (93.0, 0.011, 4.12, 4.13, tmp_path / "wall_3d.html", Path("points.xlsx")):
        assert expected in recorded.values("report_of"), expected
    assert Path("points.xlsx") in recorded.values("write_handover")
    files = making._documents(replace(task, relief=None, mark=None), "Nord", progress)
    assert files == ["wall_report.html", "wall_handover.html"]
    assert Path("p.pair.json") in recorded.values("report_of")
