"""What the sheet says the fit would be without each control point, against fits without it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import KnownPoints, PointObservations, SurveySetup, Taking, georeference
from bifocal.survey import georeferencing
from bifocal.survey.point_survey import solve_points
from bifocal.workbook.content import SurveyContent
from bifocal.workbook.making.book import build

COUNT = 8
TAKING = Taking(d1=17.5, d2=9.5, c1=35.0, c2=19.0)
TURNS = {
    "levelled": [[np.cos(0.3), 0, np.sin(0.3)], [np.sin(0.3), 0, -np.cos(0.3)], [0, 1, 0]],
    "3D": [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]],
    "2D": [[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]],
}


def surveyed(model, *, off=0.0, use=None, noise=0.004):
    """Return a wall of eight points, the fifth ``off`` metres wrong, and what is known of it."""
    rng = np.random.default_rng(3)
    # Around the nadir, where relief is equally good.
    angle = 2 * np.pi * np.arange(COUNT) / COUNT
    xyz = np.column_stack([6 * np.cos(angle), 4 * np.sin(angle), rng.uniform(-0.5, 0.5, COUNT)])
    setup = SurveySetup(taking=TAKING)
    xy1, xy2 = (c * xyz[:, :2] / (d - xyz[:, 2:]) for c, d in ((35.0, 17.5), (19.0, 9.5)))
    ids = tuple(f"P{i}" for i in range(COUNT))
    noisy = [xy + rng.normal(0, noise, xy.shape) for xy in (xy1, xy2)]
    points = PointObservations(ids=ids, xy1=noisy[0], xy2=noisy[1])
    world = xyz @ np.array(TURNS[model]).T + [351234.0, 4123456.0, 33.0]
    world[4, 0] += off
    if model == "2D":
        world[:, 2] = np.nan
    table = solve_points(setup.pair(), points)
    control = KnownPoints(ids=ids, xyz=world, use=use)
    return SurveyContent(
        setup=setup, pair=setup.pair(), points=points, table=table, control=control, model=model,
        georeference=georeference(table, control, model=model),
    )  # fmt: skip


@pytest.fixture(autouse=True)
def _unjudged(monkeypatch):
    """Let the fit keep every point, as a workbook's formulas do by themselves."""
    monkeypatch.setattr(georeferencing, "ALPHA_POINT", 1e-300)


def refitted(content, row):
    """Return weighted squares and sigma0 of the fit without a point."""
    kept = replace(content.control, use=np.arange(COUNT) != row)
    world = georeference(content.table, kept, model=content.model)
    return world.error_ratio**2 * world.redundancy, world.sigma0


@pytest.mark.parametrize(("model", "worth"), [("2D", 1e-6), ("levelled", 0.01), ("3D", 0.01)])
def test_squares_without_a_point_are_those_of_a_fit_without_it(model, worth):
    content = surveyed(model)
    built = build(content)
    cells, squares = built.tables["tblGeo"].cells, built.value_of("g_squares")
    for row in range(COUNT):
        rest, sigma0 = refitted(content, row)
        assert squares - cells["gain"][row] == pytest.approx(rest, rel=worth)
        assert cells["s0"][row] == pytest.approx(sigma0, rel=0.5)
    assert cells["fit"][:COUNT] == ["OK"] * COUNT


@pytest.mark.parametrize("model", ["2D", "levelled", "3D"])
def test_the_point_that_is_a_metre_off_is_found(model):
    content = surveyed(model, off=1.0)
    built = build(content)
    cells = built.tables["tblGeo"].cells
    assert [fit == "CHECK" for fit in cells["fit"][:COUNT]] == [row == 4 for row in range(COUNT)]
    assert int(np.argmin([refitted(content, row)[0] for row in range(COUNT)])) == 4
    assert int(np.argmin(cells["s0"][:COUNT])) == 4
    assert cells["s0"][4] < content.georeference.sigma0 / 3
    assert "P4" in built.value_of("world_state")


def test_four_coordinates_to_spare_are_needed_to_tell_which_point_is_wrong():
    use = np.isin(np.arange(COUNT), [0, 4])
    built = build(surveyed("levelled", off=1.0, use=use))
    cells = built.tables["tblGeo"].cells
    assert built.value_of("g_spare") < 1
    assert cells["gain"][:COUNT] == [""] * COUNT
    assert "CHECK" not in cells["fit"]
    assert all(isinstance(cells["v"][row], float) for row in (0, 4))


def test_exact_coordinates_contradict_nothing():
    built = build(surveyed("levelled", noise=0.0))
    assert "CHECK" not in built.tables["tblGeo"].cells["fit"]
