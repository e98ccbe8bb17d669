"""A large bundle adjustment: the points are eliminated, the cameras and media solved for.

Normal equations with the Schur complement: every point touches only the cameras that see it, so
its three unknowns leave the system one by one. Memory grows with points times dense unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from multimedia.adjustment.bundle_problem import Linear, Problem, State
from photocore.arrays import FloatArray
from photocore.errors import ConvergenceError, GeometryError

#: Eigenvalues of the scaled reduced normal matrix below this mark undetermined combinations: the
#: square root of the precision is lost to squaring.
_RANK = 1e-13


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reduced:
    """Normal equations split into dense unknowns and point blocks.

    Attributes
    ----------
    dense : ndarray, shape (u, u)
    mixed : ndarray, shape (u, p, 3)
    blocks : ndarray, shape (p, 3, 3)
        1 on the diagonal where a coordinate is not an unknown.
    dense_right, block_right : ndarray, shape (u,), (p, 3)
        Gradients.
    cost : float
        Weighted square sum.
    """

    dense: FloatArray
    mixed: FloatArray
    blocks: FloatArray
    dense_right: FloatArray
    block_right: FloatArray
    cost: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SparseFit:
    """Outcome of the elimination.

    Attributes
    ----------
    state : State
    linear : Linear
        Equations there.
    cofactor : ndarray, shape (u, u)
        Of the dense unknowns.
    point_cofactor : ndarray, shape (p, 3, 3)
    mixed_cofactor : ndarray, shape (u, p, 3)
        Between dense unknowns and coordinates.
    cost : float
    iterations : int
    """

    state: State
    linear: Linear
    cofactor: FloatArray
    point_cofactor: FloatArray
    mixed_cofactor: FloatArray
    cost: float
    iterations: int


def solve_sparse(problem: Problem, *, what: str, most: int = 100) -> SparseFit:
    """Adjust a large problem.

    Raises
    ------
    GeometryError
        If the start is impossible or a combination of unknowns is undetermined.
    ConvergenceError
        If ``most`` steps do not settle it.
    """
    state = problem.start
    linear = problem.linear(state)
    if linear is None:
        raise GeometryError(f"{what}: the start values are impossible.")
    system = _reduce(problem, linear)
    damping, growth, settled = 1e-6, 2.0, False
    steps = 0
    while steps < most:
        steps += 1
        while True:
            step, point_step = _step(system, damping)
            following = problem.advance(state, step, point_step)
            new = None if following is None else problem.linear(following)
            cost = np.inf if new is None else _cost(new)
            foretold = -float(step @ system.dense_right + (point_step * system.block_right).sum())
            small = foretold <= 1e-12 * max(system.cost, 1e-300)
            if following is not None and new is not None and cost <= system.cost:
                break
            if small or damping > 1e10:
                settled = True
                break
            damping, growth = damping * growth, growth * 2.0
        if settled or following is None or new is None:
            break
        drop = system.cost - cost
        state, linear = following, new
        system = _reduce(problem, linear)
        damping, growth = max(damping * 0.1, 1e-15), 2.0
        if small or drop <= 1e-13 * cost:
            settled = True
            break
    if not settled:
        raise ConvergenceError(
            f"{what}: the adjustment does not settle", iterations=steps,
            residual=float(np.sqrt(system.cost / max(2 * len(linear.miss), 1))),
        )  # fmt: skip
    inverse = np.linalg.inv(system.blocks)
    solved = np.einsum("upi,pij->upj", system.mixed, inverse)
    schur = system.dense - np.tensordot(solved, system.mixed, axes=((1, 2), (1, 2)))
    cofactor = _inverted(schur, problem, what)
    mixed = -np.tensordot(cofactor, solved, axes=(1, 0))
    points = inverse - np.einsum("upi,upj->pij", solved, mixed)
    return SparseFit(
        state=state, linear=linear, cofactor=cofactor,
        point_cofactor=points * problem.free[:, :, None] * problem.free[:, None, :],
        mixed_cofactor=mixed * problem.free[None], cost=system.cost, iterations=steps,
    )  # fmt: skip


def redundancy_numbers(problem: Problem, found: SparseFit) -> FloatArray:
    """Return the redundancy number of every image coordinate, shape (n, 2)."""
    numbers = np.ones((len(problem.observations.point), 2))
    for rows, columns, block in zip(
        problem.observations.rows, found.linear.columns, found.linear.dense, strict=True
    ):
        which = problem.observations.point[rows]
        by_point = found.linear.by_point[rows]
        own = found.cofactor[np.ix_(columns, columns)]
        mixed = found.mixed_cofactor[columns][:, which].transpose(1, 0, 2)
        spread = np.einsum("nic,cd,nid->ni", block, own, block, optimize=True)
        spread += 2.0 * np.einsum("nic,ncj,nij->ni", block, mixed, by_point, optimize=True)
        spread += np.einsum(
            "nij,njk,nik->ni", by_point, found.point_cofactor[which], by_point, optimize=True
        )
        numbers[rows] = 1.0 - spread
    return numbers


def _cost(linear: Linear) -> float:
    """Return the weighted square sum."""
    return float((linear.miss**2).sum() + (linear.extra_miss**2).sum())


def _reduce(problem: Problem, linear: Linear) -> Reduced:
    """Return the normal equations of one state."""
    dense, count = problem.dense_count, len(problem.ids)
    rows_at, columns_at, values = [], [], []
    for rows, columns, block in zip(
        problem.observations.rows, linear.columns, linear.dense, strict=True
    ):
        line = 2 * rows[:, None, None] + np.arange(2)[None, :, None]
        rows_at.append(np.broadcast_to(line, block.shape).ravel())
        columns_at.append(np.broadcast_to(columns[None, None], block.shape).ravel())
        values.append(block.ravel())
    lines = 2 * len(linear.miss)
    design = sparse.csr_matrix(
        (np.concatenate(values), (np.concatenate(rows_at), np.concatenate(columns_at))),
        shape=(lines, dense),
    )
    which = problem.observations.point
    point_columns = 3 * which[:, None, None] + np.arange(3)[None, None]
    shape = linear.by_point.shape
    eliminated = sparse.csr_matrix(
        (
            linear.by_point.ravel(),
            np.broadcast_to(point_columns, shape).ravel(),
            3 * np.arange(lines + 1),
        ),
        shape=(lines, 3 * count),
    )
    miss = linear.miss.ravel()
    normal = (design.T @ design).toarray() + linear.extra_dense.T @ linear.extra_dense
    mixed = (design.T @ eliminated).toarray().reshape(dense, count, 3)
    blocks = np.zeros((count, 3, 3))
    product = linear.by_point.transpose(0, 2, 1) @ linear.by_point
    for i in range(3):
        for j in range(3):
            blocks[:, i, j] = np.bincount(which, product[:, i, j], minlength=count)
    block_right = (eliminated.T @ miss).reshape(count, 3)
    for e in np.flatnonzero(linear.extra_point >= 0):
        j, row = linear.extra_point[e], linear.extra_by_point[e]
        blocks[j] += np.outer(row, row)
        block_right[j] += row * linear.extra_miss[e]
        mixed[:, j] += np.outer(linear.extra_dense[e], row)
    fixed = ~problem.free
    blocks[fixed[:, :, None] & np.eye(3, dtype=bool)] = 1.0
    return Reduced(
        dense=normal, mixed=mixed, blocks=blocks,
        dense_right=design.T @ miss + linear.extra_dense.T @ linear.extra_miss,
        block_right=block_right, cost=_cost(linear),
    )  # fmt: skip


def _step(system: Reduced, damping: float) -> tuple[FloatArray, FloatArray]:
    """Return the damped Gauss-Newton step of dense unknowns and of points."""
    eye = np.eye(3)
    blocks = system.blocks * (1.0 + damping * eye)
    inverse = np.linalg.inv(blocks)
    solved = np.einsum("upi,pij->upj", system.mixed, inverse)
    schur = system.dense - np.tensordot(solved, system.mixed, axes=((1, 2), (1, 2)))
    schur = schur + damping * np.diag(np.diag(system.dense))
    right = system.dense_right - np.einsum("upj,pj->u", solved, system.block_right)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(schur), 1e-300))
    scaled = schur * np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    share = np.where(values > 1e-15, 1.0 / np.maximum(values, 1e-15), 0.0)
    step = -scale * (vectors @ (share * (vectors.T @ (scale * right))))
    back = system.block_right + np.einsum("upj,u->pj", system.mixed, step)
    return step, -np.einsum("pij,pj->pi", inverse, back)


def _inverted(schur: FloatArray, problem: Problem, what: str) -> FloatArray:
    """Return the inverse of the reduced normal matrix, or name what it leaves open."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(schur), 1e-300))
    values, vectors = np.linalg.eigh(schur * np.outer(scale, scale))
    weak = vectors[:, values < _RANK * values.max(initial=0.0)]
    if weak.size:
        share = np.abs(weak).max(axis=1)
        names = [
            label
            for label, part in zip(problem.columns.labels, share, strict=True)
            if part > 0.05 * share.max()
        ]
        raise GeometryError(
            f"{what}: the data cannot determine {', '.join(names[:20])}. Fix some of them, give "
            "control points or scale bars, or measure more points, better spread."
        )
    inverse: FloatArray = (vectors / values) @ vectors.T * np.outer(scale, scale)
    return inverse
