"""What contradicts is named early, and what the model lacks is ranked: planes in a tank."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    Brown,
    Camera,
    ConvergenceError,
    FlatInterface,
    ImagePoints,
    Layers,
    ObjectPoints,
    Project,
    Unknowns,
    bundle_adjust,
    diagnose,
    project,
    write_project,
)
from multimedia.adjustment import report_figures
from multimedia.adjustment.report import adjustment_document
from multimedia.media.camera import EXTERIOR
from tests.builders.commands import multimedia_command

GLASS = FlatInterface(layers=Layers(indices=(1.0, 1.46, 1.33), thicknesses=(6.0,)))
EYES = ((-150, -150, 700), (150, -150, 700), (150, 150, 700), (-150, 150, 700))
FULL = ("c", "xh", "yh", "k1", "p1", "p2", "scale")


def planes(*, interchanged: bool = False, wrong: str = "") -> Project:
    """Return four cameras before four plates. [mm]

    In one image two plates may change places, one plate may lie elsewhere than the file says, and
    one camera may have a distortion of which it says nothing.
    """
    rng = np.random.default_rng(1)
    views = [
        replace(Camera.looking_at(eye, (0, 0, -60), principal_distance=70.0), name=f"cam{k}")
        for k, eye in enumerate(EYES, start=1)
    ]
    x, y = np.meshgrid(np.linspace(-70, 70, 9), np.linspace(-40, 40, 6))
    flat = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    plates = [flat - np.array([0, 0, 30 + 20 * k]) for k in range(4)]
    real = list(plates)
    if wrong == "plate2":
        real[2] = real[2] + np.array([0.1, -0.1, 0.2]) + np.cross([0.001, -0.002, 0.001], real[2])
    lens = Brown(k1=3e-5) if wrong == "k1" else Brown()
    image = np.stack(
        [[project(replace(c, distortion=lens), plate, GLASS) for plate in real] for c in views]
    )
    if interchanged:
        image[1, [0, 2]] = image[1, [2, 0]]
    image = image.reshape(-1, 2) + 0.0012 * rng.standard_normal((4 * 4 * x.size, 2))
    ids = tuple(f"{k}-{n}" for k in range(4) for n in range(x.size))
    off = np.array([5, -4, 6, 0.01, -0.01, 0.01])
    start = [c.stepped(EXTERIOR, off * rng.standard_normal(6)) for c in views]
    xyz = np.concatenate(plates)
    return Project(
        cameras=tuple(start), media={"glass": GLASS}, media_of=("glass",) * 4, unit="mm",
        object_points=ObjectPoints(
            ids=ids, xyz=xyz, sigma=np.zeros_like(xyz), groups=tuple(f"plate{i[0]}" for i in ids)
        ),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in views for _ in ids), ids=ids * 4, image=image
        ),
    )  # fmt: skip


@pytest.mark.parametrize("interior", [(), FULL])
def test_plates_that_change_places_in_one_image_are_named_after_few_steps(interior):
    unknowns = Unknowns(plates=("plate1", "plate2", "plate3"), interior=interior)
    result = bundle_adjust(planes(), unknowns)
    assert result.sigma0 < 0.0015
    with pytest.raises(
        ConvergenceError, match=r"contradict each other.*camera cam2, plate"
    ) as told:
        bundle_adjust(planes(interchanged=True), unknowns)
    assert told.value.iterations <= 30


def test_corners_of_a_plate_that_no_camera_sees_are_left_out_by_name():
    whole = planes()
    seen = whole.image_points
    keep = [k for k, name in enumerate(seen.ids) if name not in ("1-0", "1-7")]
    fewer = ImagePoints(
        cameras=tuple(seen.cameras[k] for k in keep),
        ids=tuple(seen.ids[k] for k in keep),
        image=seen.image[keep],
    )
    unknowns = Unknowns(plates=("plate1", "plate2", "plate3"))
    result = bundle_adjust(replace(whole, image_points=fewer), unknowns)
    assert result.sigma0 < 0.0015
    assert any("1-0, 1-7" in text for text in result.remarks)
    # The plates lie where they were rendered.
    points, truth = result.project.object_points, whole.object_points
    at = [truth.ids.index(name) for name in points.ids]
    assert np.abs(points.xyz - truth.xyz[at]).max() < 0.1


@pytest.mark.parametrize(
    ("wrong", "wider"), [("plate2", {"plates": ("plate2",)}), ("k1", {"interior": ("k1",)})]
)
def test_what_the_model_lacks_comes_first_and_does_what_it_promises(wrong, wider):
    given = planes(wrong=wrong)
    sigma0, extensions = diagnose(given)
    assert sigma0 == pytest.approx(bundle_adjust(given).sigma0, rel=1e-6)
    best = extensions[0]
    assert best.what == ("plate plate2 free" if wrong == "plate2" else "k1")
    assert best.chance < 1e-6
    assert best.sigma0 == pytest.approx(bundle_adjust(given, Unknowns(**wider)).sigma0, rel=0.02)
    assert best.sigma0 < 0.0014 < sigma0


def test_nothing_is_missing_where_the_model_is_right():
    given, unknowns = planes(), Unknowns(interior=("c",))
    sigma0, extensions = diagnose(given, unknowns)
    assert {"index3", "offset", "tilt1,tilt2", "k1", "xh,yh", "plate plate1 free"} <= {
        extension.what for extension in extensions
    }
    assert min(extension.sigma0 for extension in extensions) > 0.995 * sigma0
    assert sum(extension.chance < 0.01 for extension in extensions) <= 1


def test_the_command_ranks_extensions(tmp_path):
    write_project(tmp_path / "tank.toml", planes(wrong="plate2"))
    words = ["adjust", str(tmp_path / "tank.toml"), "--diagnose"]
    done = CliRunner().invoke(multimedia_command, words)
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    table = lines[lines.index("What one step more would bring, each alone (score test):") + 1 :]
    assert table[2].startswith("plate plate2 free")
    assert "--plate plate2" in table[2]
    first = json.loads(CliRunner().invoke(multimedia_command, [*words, "--json"]).stdout)
    assert first["extensions"][0]["option"] == "--plate plate2"


def test_a_report_says_what_was_estimated_and_draws_plates_apart_and_thinned():
    result = bundle_adjust(
        planes(), Unknowns(plates=("plate1", "plate2"), interior=("c",), media=("index3",))
    )
    blocks = adjustment_document(result).blocks
    said = next(b.text for b in blocks if getattr(b, "text", "").startswith("Estimated"))
    assert said == (
        "Estimated: the orientation of 4 cameras, the pose of 2 plates, 108 object points, c, "
        "index3. Taken as the file has them: 108 object points, xh, yh, thickness1, index2."
    )
    place = np.random.default_rng(1).uniform(-8, 8, (1620, 2))
    plate = np.repeat(np.arange(4), 405)
    kept = report_figures._thinned(place, plate, 9.0)
    assert 250 < kept.sum() <= 400
    assert (np.bincount(plate[kept]) > 60).all()
    assert report_figures._thinned(place[:400], plate[:400], 9.0).all()
