"""A network of blocks and terms is the least squares of what its terms say."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from bifocal import GeometryError
from photocore.adjustment.network import Network, NetworkState, Rows


@dataclass(frozen=True)
class Rod:
    """Something with a length and an offset."""

    length: float
    offset: float

    def stepped(self, names, step):
        change = dict(zip(names, step, strict=True))
        return Rod(self.length + change.get("length", 0.0), self.offset + change.get("offset", 0.0))


def network(points, terms, kept=-1):
    """Return two rods of one length, offsets of their own, and points of which X alone is free."""
    free = np.zeros((points, 3), dtype=bool)
    place = np.full((points, 3), -1)
    place[0, 0] = kept
    free[:, 0] = place[:, 0] < 0
    labels = ["length", "a", "b"] + ["X of point 1"] * (kept >= 0)
    columns = {"rod": {"a": {"length": 0, "offset": 1}, "b": {"length": 0, "offset": 2}}}
    start = NetworkState(
        blocks={"rod": {"a": Rod(1.0, 0.0), "b": Rod(1.0, 0.0)}}, points=np.zeros((points, 3)),
        drift=np.zeros(len(labels)),
    )  # fmt: skip
    names = [f"{k}" for k in range(int(free.sum()))]
    return Network(labels=labels, columns=columns, free=free, kept=place, terms=terms,
                   names=names), start  # fmt: skip


def rods(state, rows):
    """Each rod's end is measured twice as well as its offset: 5 and 2, 7 and 3."""
    for name, column, end, offset in (("a", 1, 5.0, 2.0), ("b", 2, 7.0, 3.0)):
        rod = state.blocks["rod"][name]
        misses = np.array([2.0 * (rod.length + rod.offset - end), rod.offset - offset])
        lines = rows.add(misses)
        rows.by_label(lines, [0, -1], [2.0, 9.0])
        rows.by_label(lines, column, [2.0, 1.0])
    return True


def gap(state, rows):
    """Points lie 10 apart along X, the first at 1."""
    away = state.points[1, 0] - state.points[0, 0] - 10.0
    lines = rows.add(np.array([away]))
    rows.by_points(lines, np.array([0, 1]), np.array([[-1.0, 0, 0], [1.0, 0, 0]]))
    first = rows.add(np.array([state.points[0, 0] - 1.0]))
    rows.by_points(first, np.array([0]), np.array([[1.0, 5.0, 5.0]]))
    return True


@pytest.mark.parametrize("largest", [0, 400])
def test_blocks_share_an_unknown_and_points_are_eliminated_or_kept(largest):
    """By hand: lengths 3 and 4 are told apart by noise alone; 3.5 takes 0.2 of it from each."""
    model, start = network(2, [rods, gap], kept=3)
    got = replace(model, largest=largest).solve(start)
    a, b = (got.state.blocks["rod"][name] for name in "ab")
    assert a.length == b.length == pytest.approx(3.5)
    # Minimum of 4 (3.5 + x - 5)² + (x - 2)²: x = (4 * 1.5 + 2) / 5.
    assert a.offset == pytest.approx(1.6)
    assert b.offset == pytest.approx(3.4)
    assert got.state.points.tolist() == [
        [pytest.approx(1.0), 0.0, 0.0], [pytest.approx(11.0), 0.0, 0.0]
    ]  # fmt: skip
    np.testing.assert_allclose(got.state.drift, [2.5, 1.6, 3.4, 1.0], atol=1e-9)
    # X of the second point: that of the first, of variance 1, and the gap's.
    assert got.linear.cofactor[3, 3] == pytest.approx(1.0)
    assert got.linear.block_cofactor[1, 0, 0] == pytest.approx(2.0)


def test_an_open_unknown_is_named_and_an_impossible_term_refused():
    model, start = network(1, [lambda _, rows: rows.add(np.ones(1)).size > 0])
    with pytest.raises(GeometryError, match="length"):
        model.solve(start)
    model, start = network(1, [lambda *_: False])
    with pytest.raises(GeometryError, match="impossible"):
        model.solve(start)


@pytest.mark.parametrize("count", [3, 600])
def test_rows_are_assembled_alike_whether_few_or_many_dense_or_sparse(count):
    values = np.random.default_rng(1).normal(size=(count, 2))

    def many(_, rows):
        rows.by_label(rows.add(np.ones(count))[::-1, None], [1, -1], values[:, :1])
        rows.by_label(np.arange(count)[:, None], [2, 0], values)
        return True

    model, start = network(1, [many])
    wanted = np.column_stack([values[:, 1], values[::-1, 0], values[:, 0], np.zeros(count)])
    assert (model.equations(start).jacobian == wanted).all()
    sparse = replace(model, largest=0).equations(start)
    assert (sparse.design.toarray() == wanted[:, :3]).all()


def test_zeros_are_not_kept_where_points_are_eliminated() -> None:
    # The rows of a datum touch every point, most with zero: kept, they fill the normal equations.
    rows = Rows(np.arange(300).reshape(100, 3))
    values = np.zeros(300)
    values[7] = 2.0
    rows.by_label(rows.add(np.zeros(1))[:, None], np.arange(300), values)
    assert rows.sparse(300).nnz == 1
