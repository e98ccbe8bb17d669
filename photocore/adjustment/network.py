"""An adjustment said once: blocks of unknowns, terms of what is observed, one solution.

A block is whatever has named parameters and can be moved by a step of them: a camera, media, a
plate. Columns belong to labels: parameters of one label are one unknown. Points are the one block
that is eliminated, but for those that a row touches together with others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix

from photocore.adjustment.blocks import BlockEquations
from photocore.adjustment.dense import DenseEquations
from photocore.adjustment.iteration import SETTLE, Fit, Linear, fit, minimise
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.errors import GeometryError, InputError

#: Largest number of unknowns solved as they are; beyond it the points are eliminated.
LARGEST = 400


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkState:
    """Blocks by kind and name, points (p, 3), and the sum of all steps of the labels, (u,)."""

    blocks: Mapping[str, Mapping[Any, Any]]
    points: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    drift: FloatArray = field(default_factory=lambda: np.zeros(1))


class Rows:
    """Weighted residuals and derivatives as the terms enter them."""

    def __init__(self, places: IntArray) -> None:
        self.places, self.count = places, 0
        self.residuals: list[FloatArray] = []
        self.entries: list[tuple[IntArray, ArrayLike, ArrayLike]] = []

    def add(self, residuals: FloatArray) -> IntArray:
        """Add residuals of any shape; return the numbers of their rows, of the same shape."""
        self.residuals.append(residuals.ravel())
        self.count += residuals.size
        return np.arange(self.count - residuals.size, self.count).reshape(residuals.shape)

    def by_label(self, rows: IntArray, columns: ArrayLike, values: ArrayLike) -> None:
        """Enter derivatives of rows by columns, -1 for none: each once; all broadcast."""
        self.entries.append((rows, columns, values))

    def by_points(self, rows: IntArray, which: IntArray, values: FloatArray) -> None:
        """Enter derivatives (..., 3) of rows (...) by points (...)."""
        self.by_label(rows[..., None], self.places[which], values)

    def known(self, columns: ArrayLike, misses: FloatArray, sigma: FloatArray | float) -> None:
        """Add what is known of unknowns themselves: how far each is off it, over its sigma."""
        self.by_label(self.add(misses / sigma), columns, 1.0 / sigma)

    def dense(self, width: int) -> FloatArray:
        """Return the entries as a matrix, shape (n, width)."""
        matrix = np.zeros((width + 1, self.count)).T  # what has no column goes to the last
        for rows, to, values in self.entries:
            columns, flat = np.asarray(to, np.int64), rows.ravel()
            # Many rows that follow each other, all of the same columns: three times as quick.
            follow = len(flat) > 500 and rows.shape[-1] == 1 and columns.ndim == 1
            if follow and (np.diff(flat) == 1).all():
                whole = np.broadcast_to(values, (*rows.shape[:-1], len(columns)))
                matrix[flat[0] : flat[-1] + 1, columns] = whole.reshape(len(flat), -1)
            else:
                matrix[rows, columns] = np.asarray(values)
        return matrix[:, :-1]

    def sparse(self, width: int) -> csr_matrix:
        """Return the entries as a matrix of which most is zero, shape (n, width)."""
        parts = [[np.zeros(0)] * 3]
        for entry in self.entries:
            some = [part.ravel() for part in np.broadcast_arrays(*entry)]
            # What stands there as zero would fill whole blocks of the normal equations.
            parts.append([part[(some[1] >= 0) & (some[2] != 0)] for part in some])
        rows, columns, values = (np.concatenate(part) for part in zip(*parts, strict=True))
        return csr_matrix((values, (rows, columns)), shape=(self.count, width))


@dataclass(frozen=True, kw_only=True, eq=False)
class Network:
    """Blocks, their unknowns, and the terms that observe them.

    Attributes
    ----------
    labels : sequence of str
        Of the unknowns that are not eliminated.
    columns : mapping of str to mapping
        By kind and name, of each block's unknown parameters, by their own names; blocks may
        share some. What is not named is held.
    terms : sequence of callable
        State and `Rows`, to which they add what they observe; False where it is impossible.
    free : ndarray of bool, shape (p, 3)
        Coordinates of points that may be eliminated.
    kept : ndarray of int, shape (p, 3)
        Columns of coordinates that are unknowns like others, else -1.
    step : callable
        Block, names and step to the block that is moved so; by default its own ``stepped``.
    moved : callable, optional
        What else follows in a state that was moved.
    names : sequence of str
        Of the free coordinates, for messages.
    what : str
        What is adjusted, for messages.
    rounding : float
    hopeless : float
    blame : callable, optional
        As for `photocore.adjustment.fit`.
    kind : type
        Of the equations, where points are eliminated.
    largest : int
        Unknowns beyond which they are; so many are solved as they are.
    """

    labels: Sequence[str]
    columns: Mapping[str, Mapping[Any, Mapping[Any, int]]]
    terms: Sequence[Callable[[Any, Rows], bool]]
    free: BoolArray = field(default_factory=lambda: np.zeros((0, 3), dtype=bool))
    kept: IntArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    step: Callable[[Any, list[Any], FloatArray], Any] = lambda block, *step: block.stepped(*step)
    moved: Callable[[Any], Any] | None = None
    names: Sequence[str] = ()
    what: str = "adjustment"
    rounding: float = 0.0
    hopeless: float = np.inf
    blame: Callable[[Fit[Any]], str] | None = None
    kind: type[BlockEquations] = BlockEquations
    largest: int = LARGEST

    @cached_property
    def is_small(self) -> bool:
        """Whether nothing is eliminated."""
        return len(self.labels) + int(self.free.sum()) <= self.largest

    @cached_property
    def places(self) -> IntArray:
        """Columns of the coordinates, behind those of the labels if free, -1 for none, (p, 3)."""
        number = np.cumsum(self.free) - 1 if self.is_small else np.arange(self.free.size)
        return np.where(self.free, len(self.labels) + number.reshape(self.free.shape), self.kept)

    def equations(self, state: NetworkState) -> Linear | None:
        """Return the equations at a state, None where one of the terms is impossible."""
        rows, stay = Rows(self.places), len(self.labels)
        if not all(term(state, rows) for term in self.terms):
            return None
        residuals = np.concatenate(rows.residuals)
        if self.is_small:
            jacobian = rows.dense(stay + int(self.free.sum()))
            return DenseEquations(residuals=residuals, jacobian=jacobian, free=self.free)
        design = rows.sparse(stay + self.free.size)
        return self.kind(
            residuals=residuals, design=design[:, :stay], eliminated=design[:, stay:],
            free=self.free,
        )  # fmt: skip

    def advance(self, state: NetworkState, step: FloatArray) -> NetworkState | None:
        """Return the state after a step, None where it is impossible."""
        step_kept, points = step[: len(self.labels)], state.points.copy()
        blocks = {kind: dict(some) for kind, some in state.blocks.items()}
        points[self.free] += step[len(step_kept) :]
        points[self.kept >= 0] += step_kept[self.kept[self.kept >= 0]]
        try:
            for kind, places in self.columns.items():
                for name, at in places.items():
                    if at:
                        step = step_kept[list(at.values())]
                        blocks[kind][name] = self.step(blocks[kind][name], list(at), step)
        except (InputError, GeometryError):
            return None
        state = replace(state, blocks=blocks, points=points, drift=state.drift + step_kept)
        return state if self.moved is None else self.moved(state)

    def minimise(self, start: Any, *, most: int, settle: float = SETTLE) -> Fit[Any]:
        """Return the state of the least square sum; see `photocore.adjustment.minimise`."""
        road = (start, self.equations, self.advance)
        return minimise(*road, what=self.what, most=most, settle=settle, rounding=self.rounding)

    def solve(self, start: Any) -> Fit[Any]:
        """Return the state of the least square sum; see `photocore.adjustment.fit`."""
        names = [*self.labels, *self.names]
        return fit(
            start, self.equations, self.advance, names=names, what=self.what,
            rounding=self.rounding, hopeless=self.hopeless, blame=self.blame,
        )  # fmt: skip
