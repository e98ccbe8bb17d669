"""Cells are calculated from formulas, the library solves by itself: both say the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import KnownPoints
from bifocal.survey.check_points import check_points
from bifocal.survey.image_shift import image_shift
from bifocal.workbook.making.book import build
from multimedia import InputError
from tests.bifocal.workbook.test_left_out_cells import TURNS, surveyed
from tests.bifocal.workbook.test_survey_workbook import ideal_content, pair_content


def assert_equal(cells, expected, *, what):
    """Compare a column with numbers, blank where these are NaN, to 1e-9 of what is above 1."""
    expected = np.asarray(expected, dtype=float)
    numbers = np.array([v if isinstance(v, float) else np.nan for v in cells[: len(expected)]])
    np.testing.assert_allclose(numbers, expected, rtol=1e-9, atol=1e-9, err_msg=what)


@pytest.mark.parametrize("make", [ideal_content, pair_content], ids=["ideal", "pair"])
def test_every_column_of_a_point_is_what_the_library_solves(make):
    content = make()
    table, cells = content.table, build(content).tables["tblPoints"].cells
    for key, solved in table.columns.items():
        assert_equal(cells[key], solved, what=key)
    assert tuple(cells["flag"][: len(table)]) == tuple(
        flag if typed else ""
        for flag, typed in zip(
            table.flags,
            content.points.has_pixels | content.points.is_cartesian | content.points.is_polar,
            strict=True,
        )
    )
    directed = ~np.isnan(table["theta_used"])
    shift = image_shift(content.photos[0], content.setup, content.points, table)
    for key, solved in shift.items():
        assert_equal(cells[key], np.where(directed, solved, np.nan), what=key)


@pytest.mark.parametrize("model", TURNS)
def test_every_number_in_the_world_is_what_the_library_finds(model):
    content = surveyed(model)
    content = replace(content, known=KnownPoints(ids=("P1", "P5"), xyz=[[4, 3, 0.1], [-4, -3, 0]]))
    world, placed, check = (
        content.georeference, content.placed, check_points(content.table, content.known)
    )  # fmt: skip
    built = build(content)
    results, control = built.tables["tblResults"].cells, built.tables["tblGeo"].cells
    for i, axis in enumerate("ENH"):
        assert_equal(results[axis], placed.xyz[:, i], what=axis)
        assert_equal(results[f"sigma_{axis}"], placed.sigma[:, i], what=f"sigma_{axis}")
        assert_equal(control[f"v{axis}"], world.residuals[:, i], what=f"v{axis}")
    for i, axis in enumerate("XYZ"):
        errors = built.tables["tblCheck"].cells
        assert_equal(errors[f"d{axis}"], check.errors[:, i], what=f"d{axis}")
        assert_equal(errors[f"t{axis}"], check.standardised[:, i], what=f"t{axis}")
        assert built.value_of(f"check_rmse_{axis}") == pytest.approx(check.axes[axis].rmse)
    assert built.value_of("check_worst") == pytest.approx(check.accuracy, rel=1e-9)
    assert built.value_of("g_used") == model
    assert built.value_of("g_k") == pytest.approx(world.world_from_wall.scale, rel=1e-12)
    assert built.value_of("g_sigma0") == pytest.approx(world.sigma0, rel=1e-9)
    names = [f"g_{i}{j}" for i in "123" for j in "123"]
    rotation = [built.value_of(name) for name in names]
    np.testing.assert_allclose(rotation, world.world_from_wall.rotation.ravel(), atol=1e-12)
    spread = [built.value_of(f"g_w_{key}") for key in ("EE", "NN", "HH", "KK", "HK")]
    at = ([0, 1, 2, 3, 2], [0, 1, 2, 3, 3])
    np.testing.assert_allclose(spread, world.precision.spread[at], rtol=1e-9, atol=1e-18)


def test_a_workbook_that_contradicts_the_library_is_not_written():
    content = ideal_content()
    wrong = dict(content.table.columns)
    wrong["r"] = wrong["r"] + np.where(np.arange(len(content.table)) == 8, 2e-9, 0.0)
    with pytest.raises(InputError, match=r"gives? r of point P8 as .* the program solved"):
        build(replace(content, table=replace(content.table, columns=wrong)))
