"""What the fit would be without each control point, against fits that leave it out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import KnownPoints, georeference
from bifocal.survey import georeferencing
from bifocal.survey.leave_one_out import leave_one_out

COUNT = 8


def placed(model, *, off=0.0, rows=COUNT, seed=3):
    """Return a wall of eight points, the fifth ``off`` metres wrong, none judged bad."""
    rng = np.random.default_rng(seed)
    xyz = np.column_stack([rng.uniform(-s, s, rows) for s in (6, 4, 0.5)])
    sigma = rng.uniform(0.002, 0.01, (rows, 3))
    covariance = np.einsum("ni,ij->nij", sigma**2, np.eye(3))
    covariance[:, 0, 2] = covariance[:, 2, 0] = 0.6 * sigma[:, 0] * sigma[:, 2]
    turns = {
        "levelled": [[np.cos(0.3), 0, np.sin(0.3)], [np.sin(0.3), 0, -np.cos(0.3)], [0, 1, 0]],
        "3D": [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]],
        "2D": [[np.cos(0.3), -np.sin(0.3), 0], [np.sin(0.3), np.cos(0.3), 0], [0, 0, 1]],
    }
    world = xyz @ np.array(turns[model]).T + [351234.0, 4123456.0, 33.0]
    world[4, 0] += off
    if model == "2D":
        world[:, 2] = np.nan
    noisy = xyz + np.einsum(
        "nij,nj->ni", np.linalg.cholesky(covariance), rng.normal(size=xyz.shape)
    )
    ids = tuple(f"P{i}" for i in range(rows))
    return KnownPoints(ids=ids, xyz=noisy), KnownPoints(ids=ids, xyz=world), covariance


@pytest.fixture(autouse=True)
def _unjudged(monkeypatch):
    """Let the fit keep every point, as a workbook's formulas do by themselves."""
    monkeypatch.setattr(georeferencing, "ALPHA_POINT", 1e-300)


def refitted(model, points, control, covariance, row):
    """Return weighted squares and sigma0 of the fit without a point."""
    kept = replace(control, use=np.arange(len(control)) != row)
    world = georeference(points, kept, model=model, covariance=covariance)
    return float(np.nansum(leave_one_out(world).own)), world.sigma0


@pytest.mark.parametrize(("model", "worth"), [("2D", 1e-6), ("levelled", 0.01), ("3D", 0.01)])
def test_squares_without_a_point_are_those_of_a_fit_without_it(model, worth):
    points, control, covariance = placed(model)
    found = leave_one_out(georeference(points, control, model=model, covariance=covariance))
    squares = np.nansum(found.own)
    for row in range(COUNT):
        rest, sigma0 = refitted(model, points, control, covariance, row)
        assert squares - found.gain[row] == pytest.approx(rest, rel=worth)
        assert found.sigma0[row] == pytest.approx(sigma0, rel=0.5)
    assert found.worst == -1


@pytest.mark.parametrize("model", ["2D", "levelled", "3D"])
def test_the_point_that_is_a_metre_off_is_found(model):
    points, control, covariance = placed(model, off=1.0)
    world = georeference(points, control, model=model, covariance=covariance)
    found = leave_one_out(world)
    assert found.worst == 4
    fits = [refitted(model, points, control, covariance, row) for row in range(COUNT)]
    assert int(np.argmin([squares for squares, _ in fits])) == 4
    assert np.nanargmin(found.sigma0) == 4
    assert found.sigma0[4] < world.sigma0 / 3


def test_four_coordinates_to_spare_are_needed_to_tell_which_point_is_wrong():
    points, control, covariance = placed("levelled", off=1.0, rows=5)
    kept = replace(control, use=np.array([True, False, False, False, True]))
    found = leave_one_out(georeference(points, kept, model="levelled", covariance=covariance))
    assert found.spare < 1
    assert np.isnan(found.gain).all()
    assert found.worst == -1
    assert np.isfinite(found.size[[0, 4]]).all()


def test_exact_coordinates_contradict_nothing():
    points, control, covariance = placed("levelled")
    exact = KnownPoints(ids=points.ids, xyz=control.xyz - [351234.0, 4123456.0, 33.0])
    world = KnownPoints(ids=control.ids, xyz=exact.xyz[:, [0, 2, 1]] * [1, -1, 1] + 4e6)
    found = leave_one_out(georeference(exact, world, model="levelled", covariance=covariance))
    assert found.worst == -1
