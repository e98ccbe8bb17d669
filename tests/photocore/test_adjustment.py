"""Least squares against problems with known answers."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from bifocal import ConvergenceError, GeometryError
from photocore.adjustment import BlockEquations, DenseEquations, fit, minimise
from photocore.adjustment.sparse import SparseEquations

X = np.arange(6.0)
Y = np.array([1.1, 2.9, 5.2, 6.8, 9.1, 10.9])


def dense(residuals, jacobian):
    return DenseEquations(residuals=residuals, jacobian=jacobian)


def line(state):
    return dense(state[0] + state[1] * X - Y, np.stack([np.ones_like(X), X], axis=1))


def move(state, step):
    return state + step


def test_a_straight_line_equals_the_textbook_formulas():
    got = fit(np.zeros(2), line, move, names=("a", "b"), what="line")
    # b = Sxy / Sxx with Sxx = 17.5; sigma_b^2 = sigma0^2 / Sxx
    b = ((X - 2.5) * (Y - Y.mean())).sum() / 17.5
    assert got.state == pytest.approx([Y.mean() - 2.5 * b, b], rel=1e-10)
    assert got.linear.cofactor[1, 1] == pytest.approx(1 / 17.5, rel=1e-12)
    assert got.redundancy == 4
    assert got.linear.redundancy_numbers.sum() == pytest.approx(4.0, rel=1e-12)
    v = got.state[0] + got.state[1] * X - Y
    assert got.sigma0 == pytest.approx(np.sqrt(v @ v / 4), rel=1e-12)


def test_rosenbrocks_valley_is_followed_to_its_end():
    def valley(s):
        misses = np.array([10 * (s[1] - s[0] ** 2), 1 - s[0]])
        return dense(misses, np.array([[-20 * s[0], 10], [-1, 0.0]]))

    got = minimise(np.array([-1.2, 1.0]), valley, move)
    assert got.state == pytest.approx([1.0, 1.0], abs=1e-10)
    assert got.iterations < 30


def test_the_unit_of_an_unknown_does_not_matter():
    def scaled(s):
        return dense(s[0] + 1e9 * s[1] * X - Y, np.stack([np.ones_like(X), 1e9 * X], axis=1))

    plain = fit(np.zeros(2), line, move, names=("a", "b"), what="line")
    got = fit(np.zeros(2), scaled, move, names=("a", "b"), what="line")
    assert got.state * (1, 1e9) == pytest.approx(plain.state, rel=1e-11)


def test_unknowns_that_act_only_together_are_named():
    def double(s):
        return dense((s[0] + s[1]) * X - Y, np.stack([X, X], axis=1))

    assert double([0, 0]).undetermined(("a", "b")) == ["a", "b"]
    with pytest.raises(GeometryError, match="cannot determine a, b"):
        fit(np.zeros(2), double, move, names=("a", "b"), what="line")


def test_an_unknown_without_effect_is_named():
    jacobian = np.array([[1.0, 0.0], [2.0, 0.0]])
    equations = DenseEquations(residuals=np.zeros(2), jacobian=jacobian)
    assert equations.undetermined(("a", "b")) == ["b"]


def test_an_impossible_start_is_refused():
    with pytest.raises(GeometryError, match="start values"):
        minimise(np.zeros(2), lambda _: None, move)


def test_an_adjustment_that_does_not_settle_says_so():
    def runaway(s):
        return dense(np.exp(-s * 0.01), -0.01 * np.exp(-s * 0.01)[:, None])

    with pytest.raises(ConvergenceError, match="does not settle"):
        fit(np.zeros(1), runaway, move, names=("a",), what="decay", most=5)


def chain(rng: np.random.Generator, photos: int = 40, points: int = 150) -> dict:
    """Equations of photos in a row, each point seen by four neighbours; one coordinate held."""
    design, eliminated = [], []
    for k in range(points):
        first = rng.integers(0, photos - 3)
        for photo in range(first, first + 4):
            for _ in range(2):
                design.append(np.zeros(6 * photos))
                design[-1][6 * photo : 6 * photo + 6] = rng.normal(size=6)
                eliminated.append(np.zeros(3 * points))
                eliminated[-1][3 * k : 3 * k + 3] = rng.normal(size=3)
    for column in range(6 * photos):
        design.append(np.eye(6 * photos)[column] * 0.3)
        eliminated.append(np.zeros(3 * points))
    free = np.ones((points, 3), dtype=bool)
    free[7, 1] = False
    blanked = np.array(eliminated) * free.ravel()
    return {
        "residuals": rng.normal(size=len(design)), "design": csr_matrix(np.array(design)),
        "eliminated": csr_matrix(blanked), "free": free,
    }  # fmt: skip


def test_three_ways_to_solve_the_same_equations_agree():
    given = chain(np.random.default_rng(1))
    sparse, block = SparseEquations(**given), BlockEquations(**given)
    points = given["eliminated"].toarray()[:, given["free"].ravel()]
    jacobian = np.hstack([given["design"].toarray(), points])
    whole = DenseEquations(residuals=given["residuals"], jacobian=jacobian, free=given["free"])
    assert sparse.undetermined([str(k) for k in range(240)]) == []
    assert sparse.step(0.0) == pytest.approx(whole.step(0.0), abs=1e-11)
    assert sparse.step(1e-3) == pytest.approx(block.step(1e-3), abs=1e-11)
    assert sparse.scale == pytest.approx(block.scale, rel=1e-12)
    assert sparse.cofactor.diagonal() == pytest.approx(np.diag(whole.cofactor), rel=1e-10)
    assert sparse.block_cofactor == pytest.approx(whole.block_cofactor, abs=1e-10)
    assert sparse.redundancy_numbers == pytest.approx(whole.redundancy_numbers, abs=1e-10)


def test_an_open_unknown_of_a_row_of_photos_is_named():
    given = chain(np.random.default_rng(2))
    design = given["design"].toarray()
    design[:, 100] = design[:, 101]
    sparse = SparseEquations(**{**given, "design": csr_matrix(design)})
    assert sparse.undetermined([str(k) for k in range(240)]) == ["100", "101"]


@pytest.mark.parametrize("kind", [BlockEquations, SparseEquations])
@pytest.mark.parametrize("column", ["blank", "doubled"])
def test_a_point_that_its_rays_leave_open_is_named_and_not_the_photos(kind, column):
    given = chain(np.random.default_rng(3))
    rows = given["eliminated"].toarray()
    rows[:, 3 * 11 + 2] = 0.0 if column == "blank" else rows[:, 3 * 11]
    equations = kind(**{**given, "eliminated": csr_matrix(rows)})
    photos = [str(k) for k in range(240)]
    expected = [11 * 3 + 2] if column == "blank" else [11 * 3, 11 * 3 + 2]
    said = [f"{'XYZ'[k % 3]} of point 12" for k in expected]
    assert np.isfinite(equations.step(0.0)).all()
    assert equations.undetermined(photos) == said
    # One coordinate before it is held and has no name.
    coordinates = [f"c{k}" for k in np.flatnonzero(given["free"])]
    assert equations.undetermined(photos + coordinates) == [f"c{k}" for k in expected]


def floating(rng: np.random.Generator, photos: int = 100, points: int = 600) -> dict:
    """Equations of photos in a row that a motion of all photos and points leaves as they are."""
    motion = rng.uniform(0.5, 2, 6 * photos + 3 * points)
    rows = np.zeros((6 * points, len(motion)))
    for row in range(len(rows)):
        k, photo = row // 6, min(row // 36, photos - 3) + row // 2 % 3
        own = np.r_[6 * photo : 6 * photo + 6, 6 * photos + 3 * k : 6 * photos + 3 * k + 3]
        seen = rng.normal(size=9)
        rows[row, own] = seen - (seen @ motion[own]) / (motion[own] @ motion[own]) * motion[own]
    return {
        "residuals": rng.normal(size=len(rows)), "design": csr_matrix(rows[:, : 6 * photos]),
        "eliminated": csr_matrix(rows[:, 6 * photos :]), "free": np.ones((points, 3), dtype=bool),
    }  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_a_row_of_photos_that_floats_as_a_whole_is_undetermined(seed):
    """Rounding makes the matrix positive or not, by chance; each unknown has a small share."""
    sparse = SparseEquations(**floating(np.random.default_rng(seed)))
    assert len(sparse.undetermined([str(k) for k in range(600)])) == 20
