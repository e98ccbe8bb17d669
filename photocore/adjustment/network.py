"""An adjustment said once: blocks of unknowns, terms of what is observed, one solution.

A block is whatever has named parameters and can be moved by a step of them: a camera, media, a
plate. Columns belong to labels: parameters of one label are one unknown. Points are the one block
that is eliminated, but for those that a row touches together with others.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_matrix

from photocore.adjustment.blocks import BlockEquations
from photocore.adjustment.iteration import LARGEST, Fit, fit
from photocore.arrays import BoolArray, FloatArray, IntArray
from photocore.errors import GeometryError, InputError


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkState:
    """Blocks by kind and name, points (p, 3), and the sum of all steps of the labels, (u,)."""

    blocks: Mapping[str, Mapping[Any, Any]]
    points: FloatArray
    drift: FloatArray


class Rows:
    """Weighted residuals and derivatives as the terms enter them."""

    def __init__(self, network: Network) -> None:
        self.network, self.count = network, 0
        self.residuals: list[FloatArray] = []
        self.design: list[list[FloatArray]] = [[np.zeros(0)] * 3]
        self.eliminated: list[list[FloatArray]] = [[np.zeros(0)] * 3]

    def add(self, residuals: FloatArray) -> IntArray:
        """Add residuals of any shape; return the numbers of their rows, of the same shape."""
        self.residuals.append(residuals.ravel())
        self.count += residuals.size
        return np.arange(self.count - residuals.size, self.count).reshape(residuals.shape)

    def by_label(self, rows: IntArray, columns: ArrayLike, values: ArrayLike) -> None:
        """Enter derivatives of rows by columns, -1 for none; all broadcast."""
        self._by(self.design, rows, columns, values)

    def by_points(self, rows: IntArray, which: IntArray, values: FloatArray) -> None:
        """Enter derivatives (..., 3) of rows (...) by points (...)."""
        self.by_label(rows[..., None], self.network.kept[which], values)
        self._by(self.eliminated, rows[..., None], self.network.places[which], values)

    @staticmethod
    def _by(parts: list[list[FloatArray]], *places: ArrayLike) -> None:
        own = np.asarray(places[1]) >= 0
        if own.all():
            parts.append([part.ravel() for part in np.broadcast_arrays(*places)])
        elif own.any():
            *entries, own = np.broadcast_arrays(*places, own)
            parts.append([part[own] for part in entries])

    def matrix(self, parts: list[list[FloatArray]], width: int) -> csr_matrix:
        """Return entries as a matrix."""
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
    free : ndarray of bool, shape (p, 3)
        Coordinates of points that are eliminated.
    kept : ndarray of int, shape (p, 3)
        Columns of coordinates that are unknowns like others, else -1.
    terms : sequence of callable
        State and `Rows`, to which they add what they observe; False where it is impossible.
    step : callable
        Block, names and step to the block that is moved so; by default its own ``stepped``.
    moved : callable, optional
        What else follows in a state that was moved.
    names : sequence of str
        Of the free coordinates, for messages.
    what : str
        What is adjusted, for messages.
    rounding : float
    kind : type
        Of the equations.
    """

    labels: Sequence[str]
    columns: Mapping[str, Mapping[Any, Mapping[Any, int]]]
    free: BoolArray
    kept: IntArray
    terms: Sequence[Callable[[Any, Rows], bool]]
    step: Callable[[Any, list[Any], FloatArray], Any] = lambda block, *step: block.stepped(*step)
    moved: Callable[[Any], Any] | None = None
    names: Sequence[str] = ()
    what: str = "adjustment"
    rounding: float = 0.0
    kind: type[BlockEquations] = BlockEquations

    @cached_property
    def places(self) -> IntArray:
        """Columns of the coordinates that are eliminated, else -1, shape (p, 3)."""
        return np.where(self.free, np.arange(self.free.size).reshape(self.free.shape), -1)

    def equations(self, state: NetworkState) -> BlockEquations | None:
        """Return the equations at a state, None where one of the terms is impossible."""
        rows = Rows(self)
        if not all(term(state, rows) for term in self.terms):
            return None
        return self.kind(
            residuals=np.concatenate(rows.residuals),
            design=rows.matrix(rows.design, len(self.labels)),
            eliminated=rows.matrix(rows.eliminated, self.free.size), free=self.free,
        )  # fmt: skip

    def advance(self, state: NetworkState, step: FloatArray) -> NetworkState | None:
        """Return the state after a step, None where it is impossible."""
        own, points = step[: len(self.labels)], state.points.copy()
        blocks = {kind: dict(some) for kind, some in state.blocks.items()}
        points[self.free] += step[len(own) :]
        points[self.kept >= 0] += own[self.kept[self.kept >= 0]]
        try:
            for kind, places in self.columns.items():
                for name, at in places.items():
                    if at:
                        step = own[list(at.values())]
                        blocks[kind][name] = self.step(blocks[kind][name], list(at), step)
        except (InputError, GeometryError):
            return None
        state = replace(state, blocks=blocks, points=points, drift=state.drift + own)
        return state if self.moved is None else self.moved(state)

    def solve(self, start: Any, *, largest: int = LARGEST) -> Fit[Any]:
        """Return the state of the least square sum; see `photocore.adjustment.fit`."""
        return fit(
            start, self.equations, self.advance, names=[*self.labels, *self.names],
            what=self.what, rounding=self.rounding, largest=largest,
        )  # fmt: skip
