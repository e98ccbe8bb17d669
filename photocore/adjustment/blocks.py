"""Linear equations of many points: the points are eliminated, the other unknowns solved for.

Normal equations with the Schur complement: every point touches only the rows that see it, so its
three unknowns leave the system one by one. Memory grows with points times remaining unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, hstack

from photocore.arrays import BoolArray, FloatArray

#: Eigenvalues of the scaled reduced normal matrix below this share of the largest mark undetermined
#: combinations. They are squares: singular values below 3e-7, where the dense road sees 1e-11.
_RANK = 1e-13
#: No step is taken along eigenvectors whose eigenvalue is no more than rounding.
_ROUNDING = 1e-15


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockEquations:
    """Weighted residuals and their derivatives by a few unknowns and by many points.

    Attributes
    ----------
    residuals : ndarray, shape (n,)
        Computed minus measured.
    design : csr_matrix, shape (n, u)
        Derivatives by the unknowns that remain.
    eliminated : csr_matrix, shape (n, 3 p)
        Derivatives by the coordinates of the points; 0 where a coordinate is not free. For the
        elimination no row may touch two points.
    free : ndarray of bool, shape (p, 3)
        Coordinates that are unknowns.
    """

    residuals: FloatArray
    design: csr_matrix
    eliminated: csr_matrix
    free: BoolArray

    @property
    def unknowns(self) -> int:
        """Number of unknowns, free coordinates included."""
        return int(self.design.shape[1]) + int(self.free.sum())

    @cached_property
    def _normal(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Normal matrix of the unknowns (u, u), with the points (u, p, 3), of them (p, 3, 3)."""
        count = len(self.free)
        square = (self.design.T @ self.design).toarray()
        mixed = (self.design.T @ self.eliminated).toarray().reshape(square.shape[0], count, 3)
        return square, mixed, self._blocks

    @cached_property
    def _blocks(self) -> FloatArray:
        """Normal matrices of the points, shape (p, 3, 3)."""
        square = (self.eliminated.T @ self.eliminated).tobsr((3, 3))
        blocks = np.zeros((len(self.free), 3, 3))
        blocks[square.indices] = square.data
        # 1 on the diagonal where a coordinate is not an unknown.
        return blocks + np.eye(3) * ~self.free[:, :, None]

    def _open_points(self, names: Sequence[str]) -> list[str]:
        """Return the points' coordinates that their own rows leave open, at most 20 of them."""
        length = np.sqrt(np.maximum(np.diagonal(self._blocks, axis1=1, axis2=2), 1e-300))
        scaled = self._blocks / (length[:, :, None] * length[:, None, :])
        values, vectors = np.linalg.eigh(scaled)
        share = np.abs(np.where((values <= _ROUNDING)[:, None, :], vectors, 0.0)).max(axis=2)
        rows = np.flatnonzero((share > 0.05)[self.free])[:20].tolist()
        point_names = names[int(self.design.shape[1]) :]
        places = np.argwhere(self.free)[rows]
        return [
            point_names[k] if k < len(point_names) else f"{'XYZ'[axis]} of point {point + 1}"
            for k, (point, axis) in zip(rows, places.tolist(), strict=True)
        ]

    @cached_property
    def scale(self) -> FloatArray:
        """Length of every unknown's column, shape (u + f,)."""
        square, _, blocks = self._normal
        points = np.diagonal(blocks, axis1=1, axis2=2)[self.free]
        return np.sqrt(np.concatenate([np.diag(square), points]))

    def _reduced(self, damping: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return inverse blocks, mixed part times these, and the Schur complement."""
        square, mixed, blocks = self._normal
        inverse = inverse_blocks(blocks * (1.0 + damping * np.eye(3)))
        # As einsum("upi,pij->upj") digit for digit, in less than half its time.
        solved = mixed[:, :, :1] * inverse[:, 0]
        for axis in (1, 2):
            solved += mixed[:, :, axis, None] * inverse[:, axis]
        schur = square + damping * np.diag(np.diag(square))
        shape = (len(square), self.free.size)
        schur -= solved.reshape(shape) @ mixed.reshape(shape).T
        return inverse, solved, schur

    def step(self, damping: float, misfit: FloatArray | None = None) -> FloatArray:
        """Return the damped step that takes most of a misfit away, by default the residuals."""
        misfit = self.residuals if misfit is None else misfit
        inverse, solved, schur = self._reduced(damping)
        slope = (self.eliminated.T @ misfit).reshape(-1, 3)
        values, vectors = _scaled_eigen(schur)
        right = vectors.T @ (self.design.T @ misfit - np.einsum("upj,pj->u", solved, slope))
        step = -vectors @ np.where(values > _ROUNDING, right / np.maximum(values, _ROUNDING), 0.0)
        slope += np.einsum("upj,u->pj", self._normal[1], step)
        return np.concatenate([step, -np.einsum("pij,pj->pi", inverse, slope)[self.free]])

    def change(self, step: FloatArray) -> FloatArray:
        """Return how a step moves the residuals, were the equations linear."""
        stay = self.design.shape[1]
        points = np.zeros(self.free.shape)
        points[self.free] = step[stay:]
        moved: FloatArray = self.design @ step[:stay] + self.eliminated @ points.ravel()
        return moved

    @cached_property
    def _solved(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Inverse blocks, mixed part times these, Schur complement; undamped."""
        solved = self._reduced(0.0)
        self.__dict__.pop("_normal")  # with many points its mixed part is as large as the solved
        return solved

    def undetermined(self, names: Sequence[str]) -> list[str]:
        """Return the unknowns that the equations leave open, at most 20 of them.

        Parameters
        ----------
        names : sequence of str
            Of the remaining unknowns; those of the free coordinates may follow.
        """
        if points := self._open_points(names):
            return points
        schur = self._solved[2]
        values, vectors = _scaled_eigen(schur)
        weak = vectors[:, values < _RANK * values.max(initial=0.0)]
        if not weak.size:
            return []
        share = np.abs(weak * np.sqrt(np.maximum(np.diag(schur), 1e-300))[:, None]).max(axis=1)
        return [names[row] for row in np.flatnonzero(share > 0.05 * share.max())[:20].tolist()]

    @cached_property
    def cofactor(self) -> FloatArray:
        """Cofactor matrix of the remaining unknowns, shape (u, u)."""
        values, vectors = _scaled_eigen(self._solved[2])
        inverse: FloatArray = (vectors / values) @ vectors.T
        return inverse

    @cached_property
    def _mixed_cofactor(self) -> FloatArray:
        """Cofactors between remaining unknowns and coordinates, shape (u, p, 3)."""
        mixed = np.tensordot(-self.cofactor, self._solved[1], axes=(1, 0))
        mixed *= self.free  # in place: with many points this is the largest array of all
        return mixed

    @cached_property
    def block_cofactor(self) -> FloatArray:
        """Cofactor matrices of the points, shape (p, 3, 3); 0 where nothing is free."""
        inverse, solved, _ = self._solved
        points = inverse - np.einsum("upi,upj->pij", solved, self._mixed_cofactor)
        return points * self.free[:, :, None] * self.free[:, None, :]

    @cached_property
    def redundancy_numbers(self) -> FloatArray:
        """Share of every observation's error that shows in its own residual, shape (n,)."""
        count = self.design.shape[1]
        rows, columns = hstack([self.design, self.eliminated], "csr"), self.design.tocsc()
        spread = _own_spread(self.eliminated, self.block_cofactor)
        mixed = self._mixed_cofactor.reshape(count, self.free.size)
        for column in range(count):
            part = slice(*columns.indptr[column : column + 2])
            row = columns.indices[part]
            both = np.concatenate([self.cofactor[column], 2.0 * mixed[column]])
            spread[row] += columns.data[part] * (rows[row] @ both)
        return 1.0 - spread


def inverse_blocks(blocks: FloatArray) -> FloatArray:
    """Return the inverse of matrices (p, 3, 3); 0 along what one of them leaves open."""
    try:
        return np.linalg.inv(blocks)
    except np.linalg.LinAlgError:  # `undetermined` names it
        return np.linalg.pinv(blocks, hermitian=True)


def _own_spread(eliminated: csr_matrix, blocks: FloatArray) -> FloatArray:
    """Return what the points' own cofactors (p, 3, 3) give every row."""
    total = np.zeros(eliminated.shape[0])
    for i in range(3):
        for j in range(3):
            by_i, by_j = eliminated[:, i::3], eliminated[:, j::3]
            total += by_i.multiply(by_j) @ blocks[:, i, j]
    return total


def _scaled_eigen(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the eigenvalues of a matrix scaled to a diagonal of 1, vectors scaled alike.

    Then ``(vectors / values) @ vectors.T`` is the inverse of the matrix itself.
    """
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    return values, vectors * scale[:, None]
