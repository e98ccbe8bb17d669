"""Stations of pairs that look through glass and water: the scale agrees, as shot rays show it."""

import json

import numpy as np
import openpyxl
import pytest
from click.testing import CliRunner

from bifocal import GeometryError, InputError, PairMedia
from bifocal.planning.camera_plan import CameraSensor, planned_pair
from bifocal.planning.stations import plan_stations
from multimedia import Layers
from tests.builders.commands import bifocal_command as main
from tests.scenes.refracted import seen_at
from tests.workbook_lint import lint

CANON = CameraSensor(width=22.7, height=15.1, columns=3072, rows=2048)
LAYERS = Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.01,))
MEDIA = {
    "port": PairMedia(layers=LAYERS, port=(0.05, 0.05)),
    "tank": PairMedia(layers=LAYERS, depth=0.9),
}


@pytest.mark.parametrize("name", MEDIA)
def test_both_photos_show_the_middle_at_the_wanted_scale(name):
    best = plan_stations([35, 19], CANON, scale_number=100, media=MEDIA[name]).best
    for c, d, z0 in ((35, best.d1, best.z0_1), (19, best.d2, best.z0_2)):
        shown = seen_at(
            (0.001, 0.0, 0.0), nadir=(0, 0), distance=d, z0=z0, indices=LAYERS.indices,
            thicknesses=LAYERS.thicknesses,
        )[0]  # fmt: skip
        assert shown * c / d == pytest.approx(0.001 * 1000 / 100, rel=1e-5)  # [mm]
    assert abs(best.d1 / best.d2 - 35 / 19) > 0.005


@pytest.mark.parametrize("name", MEDIA)
def test_the_sigma_is_that_of_noisy_picks(name):
    plan = plan_stations([35, 19], CANON, scale_number=100, sigma_px=0.3, media=MEDIA[name])
    best, rng = plan.best, np.random.default_rng(3)
    d = (best.d1, best.d2)
    pair = planned_pair(plan.media, d, (35, 19), pitch=CANON.pitch, sigma_px=0.3)
    radius = np.hypot(*best.footprint) / np.sqrt(12)
    seen = pair.project(np.broadcast_to([radius, 0.0, 0.0], (4000, 3)))
    found = pair.intersect(*(side + rng.normal(0, 0.3, side.shape) for side in seen))
    assert found.xyz[:, 2].std() == pytest.approx(best.sigma_r_rms, rel=0.05)
    sigma = plan.sigma_grid(best)[2]
    assert np.isnan(sigma[3, 4])
    assert sigma[0, 0] == pytest.approx(best.sigma_r_corner, rel=1e-9)


def test_media_of_one_index_change_no_plan():
    layers = Layers(indices=(1.0, 1.0))
    air = plan_stations([35, 19], CANON, scale_number=100).best
    same = plan_stations(
        [35, 19], CANON, scale_number=100, media=PairMedia(layers=layers, depth=0.9)
    ).best
    for name in ("d1", "d2", "gsd", "sigma_r_rms", "sigma_r_corner", "sigma_ortho"):
        assert getattr(same, name) == pytest.approx(getattr(air, name), rel=1e-9)


@pytest.mark.parametrize(
    ("media", "error", "message"),
    [
        ({"port": (0.05, 0.05), "depth": 0.9}, InputError, "one of the two"),
        ({}, InputError, "one of the two"),
        ({"depth": 9.0}, GeometryError, "inside the glass or the water"),
        ({"port": (3.0, 3.0)}, GeometryError, "inside the glass or the water"),
    ],
)
def test_media_that_leave_no_room_are_refused(media, error, message):
    with pytest.raises(error, match=message):
        plan_stations([35, 19], CANON, scale_number=100, media=PairMedia(layers=LAYERS, **media))


def test_a_lens_whose_edges_are_totally_reflected_is_refused():
    """From water into air: 18 mm aside by 10 mm is 61 degrees, beyond asin(1 / 1.337)."""
    diver = PairMedia(layers=Layers(indices=(1.337, 1.0)), depth=0.3)
    full = CameraSensor(width=36, height=24, columns=6000, rows=4000)
    with pytest.raises(GeometryError, match=r"10 mm lens.*reflect"):
        plan_stations([35, 10], full, scale_number=100, object_size=(3, 2), media=diver)


def test_the_command_plans_a_tank(tmp_path):
    lenses = ["--focal", "35", "--focal", "19", "--sensor", "22.7x15.1"]
    words = ["plan", *lenses, "--pixels", "3072x2048", "--scale", "1:100"]
    wet = ["--indices", "1,1.49,1.337", "--thicknesses", "0.01", "--depth", "0.9"]
    done = CliRunner().invoke(main, [*words, *wet, "--json"])
    assert done.exit_code == 0, done.output
    best = json.loads(done.stdout)["stations"][0]
    assert best["d1"] - best["z0_1"] == pytest.approx(0.91)
    text = CliRunner().invoke(main, [*words, *wet])
    assert "first interface" in text.stdout
    out = CliRunner().invoke(main, [*words, *wet, "--out", str(tmp_path / "plan.xlsx")])
    assert out.exit_code == 0, out.output
    sheet = openpyxl.load_workbook(tmp_path / "plan.xlsx")["Planning"]
    row = dict(zip((c.value for c in sheet[4]), (c.value for c in sheet[5]), strict=True))
    for key in ("d1", "d2", "z0_1", "z0_2"):
        assert row[key] == pytest.approx(best[key], rel=1e-12)
    # Glass and water alike behind both: 0.91 m.
    assert row["d2"] - row["z0_2"] == pytest.approx(0.91)
    assert row["sigma_rms"] == pytest.approx(1000 * best["sigma_r_rms"], rel=1e-12)
    assert "1.49 (10 mm)" in sheet["A2"].value
    bars = sheet._charts[0].series
    names = [sheet[bar.tx.strRef.f.split("!")[1].replace("$", "")].value for bar in bars]
    assert names == ["sigma_rms", "sigma_corner", "sigma_ortho"]
    assert lint(tmp_path / "plan.xlsx") == []
    assert CliRunner().invoke(main, [*words, "--depth", "0.9"]).exit_code == 2
