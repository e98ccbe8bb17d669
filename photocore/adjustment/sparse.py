"""Linear equations of many photos and many points: each photo meets few others, so most is zero.

As in `photocore.adjustment.blocks` the points are eliminated. What remains has a block for every
two photos that share points; ordered so that these lie near the diagonal it is factorised, and its
inverse found, in blocks along the diagonal. A row of a thousand pairs needs memory and time for a
band of a few dozen columns, where the whole matrix has twelve thousand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.sparse import bsr_matrix, csr_matrix, diags
from scipy.sparse.csgraph import reverse_cuthill_mckee

from photocore.adjustment.blocks import BlockEquations, inverse_blocks
from photocore.arrays import FloatArray, IntArray

#: Least size of a block along the diagonal; smaller ones take longer than they save.
_BLOCK = 96
#: Variance, in units of what the unknown alone would have, from which an unknown is undetermined.
_OPEN = 1e12
#: Eigenvalues of the scaled matrix that are no more than rounding. Rounding made of those that are
#: zero up to 1e-15; a row of 200 pairs with six control points has 1e-10 (`many_pairs` of the
#: tests).
_ROUNDING = 1e-14
#: Inverse iterations; each one brings the others down by the ratio of their eigenvalues.
_ITERATIONS = 4
#: Added to a diagonal of ones that rounding has made indefinite, growing until it is not.
_LIFTS = (0.0, 1e-14, 1e-12, 1e-10)
#: Rows whose mixed cofactors are looked up at a time.
_ROWS = 50_000


class _Banded:
    """A symmetric positive matrix, scaled to a diagonal of ones, as a chain of dense blocks.

    Parameters
    ----------
    matrix : csr_matrix, shape (u, u)

    Notes
    -----
    With D_k the blocks of the diagonal and A_k those below them, the pivots are
    ``P_k = D_k - N_{k-1} A_{k-1}ᵀ`` with ``N_k = A_k P_k⁻¹``. From the last block backwards the
    inverse is ``Z_k = P_k⁻¹ + N_kᵀ Z_{k+1} N_k``, beside it ``-Z_{k+1} N_k`` (Takahashi 1973).
    """

    def __init__(self, matrix: csr_matrix) -> None:
        self.matrix = matrix
        self.scale = 1.0 / np.sqrt(np.maximum(matrix.diagonal(), 1e-300))
        scaled = (diags(self.scale) @ matrix @ diags(self.scale)).tocsr()
        self.order = np.asarray(reverse_cuthill_mckee(scaled, symmetric_mode=True), np.int64)
        ordered = scaled[self.order][:, self.order].tocoo()
        size, band = matrix.shape[0], int(np.abs(ordered.row - ordered.col).max(initial=1))
        self.edges = np.r_[np.arange(0, size, max(band, min(_BLOCK, size))), size]
        ordered = ordered.tocsr()
        parts = [slice(a, b) for a, b in zip(self.edges[:-1], self.edges[1:], strict=True)]
        self.parts = parts
        diagonal = [ordered[part, part].toarray() for part in parts]
        self.below = [ordered[b, a].toarray() for a, b in pairwise(parts)]
        for lift in _LIFTS:
            try:
                self.pivots = self._factorised(diagonal, lift)
                break
            except np.linalg.LinAlgError:
                continue
        else:
            raise np.linalg.LinAlgError("indefinite")

    def _factorised(self, diagonal: list[FloatArray], lift: float) -> list[FloatArray]:
        """Return the lower triangles of the pivots."""
        pivots: list[FloatArray] = []
        for number, block in enumerate(diagonal):
            pivot = block + lift * np.eye(len(block))
            if number:
                half = solve_triangular(pivots[-1], self.below[number - 1].T, lower=True)
                pivot = pivot - half.T @ half
            pivots.append(cholesky(pivot, lower=True))
        return pivots

    def solve(self, right: FloatArray) -> FloatArray:
        """Return what the matrix maps to a right side, shape (u,)."""
        values = (right * self.scale)[self.order]
        for number, (part, pivot) in enumerate(zip(self.parts, self.pivots, strict=True)):
            if number:
                values[part] -= self.below[number - 1] @ values[self.parts[number - 1]]
            values[part] = cho_solve((pivot, True), values[part])
        for number in range(len(self.parts) - 2, -1, -1):
            later = values[self.parts[number + 1]]
            values[self.parts[number]] -= cho_solve(
                (self.pivots[number], True), self.below[number].T @ later
            )
        out = np.empty_like(values)
        out[self.order] = values
        return out * self.scale

    def weakest(self) -> tuple[float, FloatArray]:
        """Return the smallest eigenvalue of the scaled matrix and its eigenvector, shape (u,)."""
        vector = np.sin(1.0 + np.arange(len(self.order)) ** 2.0)  # orthogonal to nothing sought
        for _ in range(_ITERATIONS):
            vector = self.solve(vector / self.scale) / self.scale
            vector /= np.linalg.norm(vector)
        combined = vector * self.scale
        return float(combined @ (self.matrix @ combined)), vector

    def inverse_within(self, pattern: csr_matrix) -> csr_matrix:
        """Return the inverse where a symmetric pattern has entries, which the band holds all."""
        inverse = np.empty_like(self.order)
        inverse[self.order] = np.arange(len(self.order))
        entries = pattern.tocoo()
        row, column = inverse[entries.row], inverse[entries.col]
        upper = row < column
        row[upper], column[upper] = column[upper], row[upper]
        at = np.searchsorted(self.edges, row, side="right") - 1
        block = np.searchsorted(self.edges, column, side="right") - 1
        values = np.empty(len(row))
        later = None
        for number in range(len(self.parts) - 1, -1, -1):
            pivot = self.pivots[number]
            own = cho_solve((pivot, True), np.eye(len(pivot)))
            if later is not None:
                weight = cho_solve((pivot, True), self.below[number].T).T
                beside = -later @ weight
                own -= beside.T @ weight
                mine = (block == number) & (at == number + 1)
                values[mine] = beside[
                    row[mine] - self.edges[number + 1], column[mine] - self.edges[number]
                ]
            mine = (block == number) & (at == number)
            start = self.edges[number]
            values[mine] = own[row[mine] - start, column[mine] - start]
            later = own
        values *= self.scale[entries.row] * self.scale[entries.col]
        return csr_matrix((values, (entries.row, entries.col)), shape=pattern.shape)


@dataclass(frozen=True, kw_only=True, eq=False)
class SparseEquations(BlockEquations):
    """`BlockEquations` of which most is zero: the unknowns that remain meet only neighbours."""

    @cached_property
    def _sparse(self) -> tuple[csr_matrix, csr_matrix, FloatArray]:
        """Normal matrix of the unknowns (u, u), with the points (u, 3 p), of them (p, 3, 3)."""
        square = (self.design.T @ self.design).tocsr()
        return square, (self.design.T @ self.eliminated).tocsr(), self._blocks

    @cached_property
    def scale(self) -> FloatArray:
        """Length of every unknown's column, shape (u + f,)."""
        square, _, blocks = self._sparse
        points = np.diagonal(blocks, axis1=1, axis2=2)[self.free]
        return np.sqrt(np.concatenate([square.diagonal(), points]))

    def _eliminated_by(self, damping: float) -> tuple[FloatArray, csr_matrix, csr_matrix]:
        """Return inverse blocks, mixed part times these, and the Schur complement."""
        square, mixed, blocks = self._sparse
        inverse = inverse_blocks(blocks * (1.0 + damping * np.eye(3)))
        solved = (mixed @ _block_diagonal(inverse)).tocsr()
        schur = square + damping * diags(square.diagonal()) - solved @ mixed.T
        return inverse, solved, schur.tocsr()

    def step(self, damping: float, misfit: FloatArray | None = None) -> FloatArray:
        """Return the damped step that takes most of a misfit away, by default the residuals."""
        misfit = self.residuals if misfit is None else misfit
        inverse, solved, schur = self._eliminated_by(damping)
        slope = self.eliminated.T @ misfit
        try:
            step = -_Banded(schur).solve(self.design.T @ misfit - solved @ slope)
        except np.linalg.LinAlgError:  # undetermined: no step at all, and `undetermined` names it
            step = np.zeros(self.design.shape[1])
        slope = (slope + self._sparse[1].T @ step).reshape(-1, 3)
        return np.concatenate([step, -np.einsum("pij,pj->pi", inverse, slope)[self.free]])

    @cached_property
    def _factors(self) -> tuple[FloatArray, csr_matrix, _Banded]:
        """Inverse blocks, mixed part times these, and the factors of the Schur complement."""
        inverse, solved, schur = self._eliminated_by(0.0)
        return inverse, solved, _Banded(schur)

    def undetermined(self, names: Sequence[str]) -> list[str]:
        """Return the unknowns that the equations leave open, at most 20 of them."""
        if points := self._open_points(names):
            return points
        try:
            value, vector = self._factors[2].weakest()
        except np.linalg.LinAlgError:
            return list(names[:20])
        share = np.abs(vector)
        if value > _ROUNDING and share.max() ** 2 < _OPEN * value:
            return []
        return [names[row] for row in np.flatnonzero(share > 0.05 * share.max())[:20].tolist()]

    @cached_property
    def cofactor(self) -> csr_matrix:
        """Cofactors of the remaining unknowns, shape (u, u), where two of them share points."""
        factors = self._factors[2]
        return factors.inverse_within(factors.matrix)

    @cached_property
    def _mixed(self) -> csr_matrix:
        """Cofactors between remaining unknowns and the coordinates they meet, shape (u, 3 p)."""
        pattern = self._sparse[1].copy()
        pattern.data[:] = 1.0
        return -(self.cofactor @ self._factors[1]).multiply(pattern).tocsr()

    @cached_property
    def block_cofactor(self) -> FloatArray:
        """Cofactor matrices of the points, shape (p, 3, 3); 0 where nothing is free."""
        inverse, solved, _ = self._factors
        points = inverse.copy()
        for i in range(3):
            for j in range(3):
                product = solved[:, i::3].multiply(self._mixed[:, j::3])
                points[:, i, j] -= np.asarray(product.sum(axis=0)).ravel()
        return points * self.free[:, :, None] * self.free[:, None, :]

    @cached_property
    def redundancy_numbers(self) -> FloatArray:
        """Share of every observation's error that shows in its own residual, shape (n,)."""
        points = _block_diagonal(self.block_cofactor)
        spread = _quadratic(self.eliminated, points) + _quadratic(self.design, self.cofactor)
        mixed = self._mixed.tocsr()
        mixed.sort_indices()
        for start in range(0, len(self.residuals), _ROWS):
            part = slice(start, start + _ROWS)
            spread[part] += 2.0 * _bilinear(self.design[part], mixed, self.eliminated[part])
        return 1.0 - spread


def _block_diagonal(blocks: FloatArray) -> csr_matrix:
    """Return matrices (p, 3, 3) along the diagonal of one."""
    count = len(blocks)
    return bsr_matrix(
        (blocks, np.arange(count), np.arange(count + 1)), shape=(3 * count, 3 * count)
    ).tocsr()


def _quadratic(rows: csr_matrix, cofactor: csr_matrix) -> FloatArray:
    """Return a Q aᵀ of every row a."""
    return np.asarray((rows @ cofactor).multiply(rows).sum(axis=1)).ravel()


def _bilinear(left: csr_matrix, middle: csr_matrix, right: csr_matrix) -> FloatArray:
    """Return a M bᵀ of rows a and b of two matrices, looking up only what they touch."""
    first, second = np.diff(left.indptr), np.diff(right.indptr)
    pairs = first * second
    row = np.repeat(np.arange(len(pairs)), pairs)
    within = np.arange(pairs.sum()) - np.repeat(np.cumsum(pairs) - pairs, pairs)
    at: IntArray = left.indptr[row] + within // np.maximum(second[row], 1)
    beside: IntArray = right.indptr[row] + within % np.maximum(second[row], 1)
    looked_up = np.asarray(middle[left.indices[at], right.indices[beside]]).ravel()
    values = left.data[at] * looked_up * right.data[beside]
    return np.asarray(np.bincount(row, weights=values, minlength=len(pairs)), float)
