"""Each step of a pair hands on to its workflow all that it is told."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

from bifocal.campaigns.pair_points import proven
from bifocal.campaigns.pair_steps import steps_of
from bifocal.campaigns.surveyed_pair import PairJob
from bifocal.options import DRAWING, MAP, OF_PAIR, OF_STEP, PICTURE, PROJECT
from tests.recorded import Recorded, leaves

#: A value for each option that no default has, and no other.
OPTIONS = {
    "distance1": 17.1, "distance2": 9.2, "focal1": 35.3, "focal2": 19.4, "sensor_width1": 22.5,
    "sensor_width2": 23.6, "sigma_pick": 0.71, "sigma_control": 0.0072, "sigma_distance": 0.073,
    "length": ((1.0, 2.0, 3.0, 4.0, 5.5),), "wall": (6.5, 7.5), "unit": "cm", "columns": "id=N",
    "relief_gsd": 0.0081, "bounds": (-8.1, -8.2, 8.3, 8.4), "quality": "fast",
    "relief_range": (-0.85, 0.86), "cloud": "laz", "image": "2", "measured_only": True,
    "interpolation": "linear", "mask": False, "fill": True, "match": False, "vignetting": "cos4",
    "chromatic": True, "feather": 9.1, "overviews": True, "any_size": True, "gsd": 0.0092,
    "scale": 93.0, "dpi": 94.0, "paper": "A3", "hatch": False, "sections": ("x=9.5",),
    "contours": 0.096, "layers": "ncs", "language": "de",
    **{name: f"the {name}" for name in PROJECT if name != "times"},
}  # fmt: skip
FILES = {name: Path(f"{name}.csv") for name in ("control", "check", "mark", "faces", "lengths")}
WORKFLOWS = {
    "align": "bifocal.orientation.align_workflow.align_photos",
    "relief": "bifocal.relief_maps.workflow.relief_of_pair",
    "points": "bifocal.reports.control_survey.solve_control",
    "ortho": "bifocal.orthophotos.ortho_workflow.make_ortho",
    "drawing": "bifocal.orthophotos.deliver_workflow.deliver",
    "view": "bifocal.reports.view_workflow.view_relief",
    "report": "bifocal.reports.workflow.write_report",
}
#: What a step reads besides.
READ = (
    "bifocal.files.point_tables.read_survey_points", "bifocal.model.photo_set.pair_or_set",
    "bifocal.orientation.control_points.known_points", "bifocal.workbook.output.write_result",
    "bifocal.reports.control_survey.is_exchanged",
)  # fmt: skip


def test_every_option_of_a_step_reaches_its_workflow(tmp_path, monkeypatch):
    job = PairJob(
        name="Nord", folder=tmp_path, far=Path("a.jpg"), near=Path("b.jpg"), files=FILES,
        options=OPTIONS, products=tuple(name for name in WORKFLOWS if name != "align"),
    )  # fmt: skip
    axis = SimpleNamespace(n=9, rmse=0.0)
    done = SimpleNamespace(
        remarks=("done",), check=SimpleNamespace(axes=dict.fromkeys("XYZ", axis))
    )
    answers = {
        "align_photos": SimpleNamespace(pair=done, remarks=("done", "aligned")),
        "relief_of_pair": ({}, ("done",)), "solve_control": done, "make_ortho": done,
        "deliver": SimpleNamespace(ortho=done), "write_report": ("done",),
        "read_survey_points": ("solved points", ()),
        "pair_or_set": SimpleNamespace(extra={}), "is_exchanged": "exchanged",
    }  # fmt: skip
    recorded = Recorded(monkeypatch, **answers)
    recorded.instead_of(*WORKFLOWS.values(), *READ)
    (tmp_path / "points").mkdir()
    (tmp_path / "points/Nord_points.csv").touch()
    for step in steps_of(job):
        remarks = step.make(tmp_path, lambda *_: None)
        function = WORKFLOWS[step.name].rpartition(".")[2]
        values = {repr(value) for value in recorded.values(function)}
        if step.name == "drawing":  # its points are read before it is drawn
            values |= {repr(value) for value in recorded.values("known_points")}
            assert {"'solved points'", "0.0", "9"} <= values
        values |= {
            repr(path.suffix[1:]) for path in recorded.values(function) if isinstance(path, Path)
        }
        for key in OF_STEP[step.name]:
            if key in OPTIONS or key in FILES:
                expected = OPTIONS.get(key, FILES.get(key))
                lost = {repr(value) for _, value in leaves(expected)} - values
                assert not lost, (step.name, key, lost)
        assert remarks == {"align": ("done", "aligned"), "view": ()}.get(step.name, ("done",))
    assert {*MAP, *PICTURE, *DRAWING} <= OPTIONS.keys() | FILES.keys() | {"complete"}
    assert OF_PAIR.keys() >= OPTIONS.keys()


def test_what_is_proven_is_read_with_the_options_of_the_pair(tmp_path, monkeypatch):
    recorded = Recorded(monkeypatch)
    recorded.instead_of("bifocal.reports.content.read_content")
    monkeypatch.setattr("bifocal.reports.accuracy.verdict_in_words", lambda _: ["proven"])
    options = {"unit": "cm", "columns": "id=N", "language": "de"}
    job = PairJob(
        name="Nord", folder=tmp_path, far=Path("a.jpg"), near=Path("b.jpg"), files=FILES,
        options=options, products=("drawing",),
    )  # fmt: skip
    assert proven(job) == ["proven"]
    values = dict(recorded.calls["read_content"])
    assert {**values, **options, "scale": 50.0, "far": Path("a.jpg"), "pictures": False} == values
