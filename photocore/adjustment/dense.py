"""Linear equations solved as they are, by orthogonal steps.

No normal equations: what the data can hardly tell apart (principal distance, distance to the glass,
index) keeps twice the digits, and what they cannot tell apart at all is named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.linalg.lapack import dgeqrf

from photocore.arrays import BoolArray, FloatArray

#: A combination of unknowns is undetermined if its singular value, the columns being scaled to
#: length one, is below this share of the largest. Double precision leaves 1e-16 times the condition
#: of the columns; perfect but weak networks reach 1e-8.
RANK_TOLERANCE = 1e-11
#: Rows decomposed at a time.
BLOCK = 250


@dataclass(frozen=True, kw_only=True, eq=False)
class DenseEquations:
    """Weighted residuals and all their derivatives.

    Attributes
    ----------
    residuals : ndarray, shape (n,)
        Computed minus measured.
    jacobian : ndarray, shape (n, u + f)
        Derivatives by u unknowns and, behind them, the coordinates marked in ``free``.
    free : ndarray of bool, shape (p, 3)
        Coordinates of points that are unknowns.
    """

    residuals: FloatArray
    jacobian: FloatArray
    free: BoolArray = field(default_factory=lambda: np.zeros((0, 3), dtype=bool))

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return int(self.jacobian.shape[1])

    @cached_property
    def scale(self) -> FloatArray:
        """Length of every column, 1 for columns of zeros, shape (u + f,)."""
        length = np.sqrt(np.einsum("ij,ij->j", self.jacobian, self.jacobian))
        length[length == 0] = 1.0
        return length

    @cached_property
    def factors(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Singular values of the scaled matrix, their rows, the residuals' share in each."""
        count = self.unknowns
        # The triangle of matrix and residuals holds all a step needs: no large factor is formed.
        table = np.empty((len(self.residuals), count + 1), order="F")
        np.divide(self.jacobian, self.scale, out=table[:, :count])
        table[:, count] = self.residuals
        triangle = _triangle(table)[:count]
        left, some, right = np.linalg.svd(triangle[:, :count])
        values, target = np.zeros(count), np.zeros(count)
        values[: len(some)] = some
        target[: len(some)] = (left.T @ triangle[:, count])[: len(some)]
        return values, right, target

    def step(self, damping: float, misfit: FloatArray | None = None) -> FloatArray:
        """Return the damped step that takes most of a misfit away, by default the residuals."""
        values, right, target = self.factors
        if misfit is None:
            slope = values * target
        else:
            slope = right @ ((self.jacobian.T @ misfit) / self.scale)
        largest = values.max(initial=0.0)
        # Never along rounding: directions without information stay where they are.
        slope[values <= largest * RANK_TOLERANCE] = 0.0
        return -(right.T @ (slope / (values**2 + damping * largest**2 + 1e-300))) / self.scale

    def change(self, step: FloatArray) -> FloatArray:
        """Return how a step moves the residuals, were the equations linear."""
        moved: FloatArray = self.jacobian @ step
        return moved

    def undetermined(self, names: Sequence[str]) -> list[str]:
        """Return the unknowns that the equations leave open, with those they are mixed with.

        Examples
        --------
        Only the sum of a and b acts:

        >>> jacobian = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 1.0]])
        >>> equations = DenseEquations(residuals=np.zeros(2), jacobian=jacobian)
        >>> equations.undetermined(["a", "b", "c"])
        ['a', 'b']
        """
        values, right, _ = self.factors
        columns = zip(names, self.jacobian.T, strict=True)
        silent = [name for name, column in columns if not column.any()]
        weak = right[values <= max(values.max(initial=0.0), 1e-300) * RANK_TOLERANCE]
        share = np.abs(weak).max(axis=0, initial=0.0)
        mixed = [name for name, part in zip(names, share, strict=True) if part > 0.05]
        return list(dict.fromkeys(silent + mixed))

    @cached_property
    def _half_inverse(self) -> FloatArray:
        values, right, _ = self.factors
        half: FloatArray = (right.T / values) / self.scale[:, None]
        return half

    @cached_property
    def _inverse(self) -> FloatArray:
        inverse: FloatArray = self._half_inverse @ self._half_inverse.T
        return inverse

    @property
    def cofactor(self) -> FloatArray:
        """Cofactor matrix of the unknowns before the coordinates, shape (u, u)."""
        stay = self.unknowns - int(self.free.sum())
        return self._inverse[:stay, :stay]

    @property
    def block_cofactor(self) -> FloatArray:
        """Cofactor matrices of the points, shape (p, 3, 3); 0 where nothing is free."""
        column = np.zeros(self.free.shape, dtype=np.int64)
        column[self.free] = np.arange(self.unknowns - self.free.sum(), self.unknowns)
        both = self.free[:, :, None] & self.free[:, None, :]
        return np.where(both, self._inverse[column[:, :, None], column[:, None, :]], 0.0)

    @cached_property
    def redundancy_numbers(self) -> FloatArray:
        """Share of every observation's error that shows in its own residual, shape (n,)."""
        base = self.jacobian @ self._half_inverse
        return 1.0 - np.einsum("ij,ij->i", base, base)


def _triangle(table: FloatArray) -> FloatArray:
    """Return the triangle R of a QR decomposition, that of tall tables from those of its blocks.

    6000 rows of 25: 5 ms by blocks that stay in the cache, 24 ms whole (2 cores, OpenBLAS, idle;
    220 ms where other programs hold the cores, because its threads wait for each other).
    """
    columns = table.shape[1]
    block = max(BLOCK, 4 * columns)
    while len(table) >= 2 * block:
        whole = len(table) - len(table) % block
        parts = np.ascontiguousarray(table[:whole]).reshape(-1, block, columns)
        triangles = np.asarray(np.linalg.qr(parts, mode="r"))
        table = np.concatenate([triangles.reshape(-1, columns), table[whole:]])
    # LAPACK itself: for 400 residuals scipy's checks take as long as the work.
    return np.asarray(np.triu(dgeqrf(np.asfortranarray(table), overwrite_a=True)[0][:columns]))
