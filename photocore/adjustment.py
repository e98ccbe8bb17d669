"""Least squares: Levenberg-Marquardt, covariance, redundancy, and what cannot be determined."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from scipy.linalg import svd

from photocore.arrays import FloatArray
from photocore.errors import ConvergenceError, GeometryError

State = TypeVar("State")
#: Weighted residuals and their derivatives, shape (n,) and (n, u); None where impossible.
Equations = tuple[FloatArray, FloatArray] | None

#: A combination of unknowns is undetermined if its singular value, the columns being scaled to
#: length one, is below this share of the largest. Double precision leaves 1e-16 times the condition
#: of the columns; perfect but weak networks reach 1e-8.
RANK_TOLERANCE = 1e-11
#: Steps smaller than this share of what an unknown may vary by one sigma end the iteration.
SETTLE = 1e-10
#: Where a step brings this share of the drop foretold, the valley is straight enough.
STRAIGHT = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit(Generic[State]):
    """An adjusted state with its precision.

    Attributes
    ----------
    state : State
        Where the weighted square sum is smallest.
    residuals : ndarray, shape (n,)
        Weighted residuals there.
    cofactor : ndarray, shape (u, u)
        Inverse of the normal matrix; times sigma0^2 the covariance.
    redundancy_numbers : ndarray, shape (n,)
        Share of an observation's error that shows in its own residual, 0 to 1.
    iterations : int
        Steps taken.
    """

    state: State
    residuals: FloatArray
    cofactor: FloatArray
    redundancy_numbers: FloatArray
    iterations: int

    @property
    def redundancy(self) -> int:
        """Observations beyond the necessary ones."""
        return len(self.residuals) - len(self.cofactor)

    @property
    def sigma0(self) -> float:
        """A-posteriori standard deviation of unit weight; NaN without redundancy."""
        if self.redundancy <= 0:
            return float("nan")
        return float(np.sqrt(self.residuals @ self.residuals / self.redundancy))


def correlations(covariance: FloatArray) -> FloatArray:
    """Return the correlation matrix of a covariance matrix.

    Examples
    --------
    >>> correlations(np.array([[4.0, 3.0], [3.0, 9.0]])).tolist()
    [[1.0, 0.5], [0.5, 1.0]]
    """
    sigma = np.sqrt(np.diag(covariance))
    return covariance / np.outer(sigma, sigma)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Minimum(Generic[State]):
    """Where an iteration ended.

    Attributes
    ----------
    state : State
        The best state found.
    residuals : ndarray, shape (n,)
        Weighted residuals there.
    jacobian : ndarray, shape (n, u)
        Their derivatives.
    iterations : int
        Steps taken.
    settled : bool
        Whether it ended because nothing changed any more.
    """

    state: State
    residuals: FloatArray
    jacobian: FloatArray
    iterations: int
    settled: bool


def minimise(
    state: State,
    equations: Callable[[State], Equations],
    advance: Callable[[State, FloatArray], State | None],
    *,
    what: str = "adjustment",
    most: int = 200,
    settle: float = SETTLE,
    rounding: float = 0.0,
) -> Minimum[State]:
    """Go from a start to the least square sum.

    Parameters
    ----------
    state : State
        Start; its equations must be possible.
    equations : callable
        State to weighted residuals (computed minus measured) and their derivatives by the step.
    advance : callable
        State and step to the next state, None if that is impossible.
    what : str
        What is adjusted, for messages.
    most : int
        Steps after which it gives up.
    settle : float
        Ends when a step moves the residuals by less than this share of their length.
    rounding : float
        Rounding error of a residual: ends when the residuals, or what a step changes of them,
        are nothing else.

    Raises
    ------
    GeometryError
        If the start is impossible.

    Notes
    -----
    Levenberg-Marquardt with the columns scaled to length one, so units do not matter (Moré 1978),
    with Nielsen's rule (1999) for the damping, and with the second-order correction of Transtrum
    and Sethna (2012): principal distance, position and distortion trade off along narrow curved
    valleys, in which straight steps crawl.
    """
    current = equations(state)
    if current is None:
        raise GeometryError(f"{what}: the start values are impossible.")
    residuals, jacobian = current
    damping, growth, cost = 1e-4, 2.0, float(residuals @ residuals)
    curved = False
    settled, step_number = cost <= len(residuals) * rounding**2, 0
    for step_number in range(1, most + 1):
        length = np.sqrt((jacobian * jacobian).sum(axis=0))
        length[length == 0] = 1.0
        left, values, right = svd(jacobian / length, full_matrices=False, check_finite=False)
        target = left.T @ residuals
        largest = values.max(initial=0.0)
        # Never below rounding: directions without information stay where they are.
        floor = (largest * RANK_TOLERANCE) ** 2 + 1e-300
        while True:
            share = values / (values**2 + damping * largest**2 + floor)
            step = -(right.T @ (share * target))
            bend = None
            if curved:
                bend = _bend(state, equations, advance, residuals, jacobian, step / length)
            if bend is not None:
                correction = -0.5 * (right.T @ (share * (left.T @ bend)))
                if np.linalg.norm(correction) < 0.75 * np.linalg.norm(step):
                    step = step + correction
            # How far the step moves the residuals: for each unknown, its share of one sigma.
            moved = float(np.linalg.norm(values * (right @ step)))
            small = moved <= settle * np.sqrt(cost) + 10.0 * rounding * np.sqrt(len(residuals))
            following = advance(state, step / length)
            new = None if following is None else equations(following)
            new_cost = np.inf if new is None else float(new[0] @ new[0])
            if following is not None and new is not None and new_cost <= cost:
                break
            # At the rounding level no step goes downhill any more.
            if small or damping > 1e8:
                return Minimum(
                    state=state,
                    residuals=residuals,
                    jacobian=jacobian,
                    iterations=step_number,
                    settled=True,
                )
            curved = True
            damping = max(damping * growth, 1e-12)
            growth *= 2.0
        # Nielsen's rule: the damping follows how well the linear model foretold the drop.
        foretold = cost - float(((target + values * (right @ step)) ** 2).sum())
        foretold -= float(residuals @ residuals - target @ target)
        ratio = (cost - new_cost) / foretold if foretold > 0 else 1.0
        damping *= max(0.1, 1.0 - (2.0 * min(ratio, 1.0) - 1.0) ** 3)
        growth, curved = 2.0, ratio < STRAIGHT
        settled = small or cost - new_cost <= 1e-14 * cost
        state, (residuals, jacobian), cost = following, new, new_cost
        settled = (settled and damping < 1e-3) or cost <= len(residuals) * rounding**2
        if settled:
            break
    return Minimum(
        state=state,
        residuals=residuals,
        jacobian=jacobian,
        iterations=step_number,
        settled=settled,
    )


def _bend(
    state: State,
    equations: Callable[[State], Equations],
    advance: Callable[[State, FloatArray], State | None],
    residuals: FloatArray,
    jacobian: FloatArray,
    step: FloatArray,
    probe: float = 0.1,
) -> FloatArray | None:
    """Return the second derivative of the residuals along a step, None where it cannot be had."""
    ahead = advance(state, probe * step)
    found = None if ahead is None else equations(ahead)
    if found is None:
        return None
    return (2.0 / probe) * ((found[0] - residuals) / probe - jacobian @ step)


def undetermined(jacobian: FloatArray, names: Sequence[str]) -> list[str]:
    """Return the unknowns that the equations leave open, with those they are mixed with.

    Examples
    --------
    Only the sum of a and b acts:

    >>> undetermined(np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 1.0]]), ["a", "b", "c"])
    ['a', 'b']
    """
    length = np.sqrt((jacobian * jacobian).sum(axis=0))
    silent = [name for name, size in zip(names, length, strict=True) if size == 0]
    scaled = jacobian / np.where(length == 0, 1.0, length)
    # Rows of zeros change nothing, and give every unknown its singular value.
    square = scaled if len(scaled) >= len(names) else np.zeros((len(names), len(names)))
    if square is not scaled:
        square[: len(scaled)] = scaled
    _, full, right = svd(square, full_matrices=False, check_finite=False)
    weak = right[full <= max(full.max(initial=0.0), 1e-300) * RANK_TOLERANCE]
    share = np.abs(weak).max(axis=0, initial=0.0)
    mixed = [name for name, part in zip(names, share, strict=True) if part > 0.05]
    return list(dict.fromkeys(silent + mixed))


def fit(
    state: State,
    equations: Callable[[State], Equations],
    advance: Callable[[State, FloatArray], State | None],
    *,
    names: Sequence[str],
    what: str,
    most: int = 200,
    rounding: float = 0.0,
) -> Fit[State]:
    """Adjust and return precision too; refuse to return unknowns the data cannot determine.

    Parameters
    ----------
    state, equations, advance, most, rounding
        As for `minimise`.
    names : sequence of str
        Of the unknowns, for messages.
    what : str
        What is adjusted, for messages.

    Raises
    ------
    GeometryError
        If a combination of unknowns is undetermined; the message names them.
    ConvergenceError
        If ``most`` steps do not settle it.
    """
    found = minimise(state, equations, advance, what=what, most=most, rounding=rounding)
    jacobian, residuals = found.jacobian, found.residuals
    open_ = undetermined(jacobian, names)
    if open_:
        raise GeometryError(
            f"{what}: the data cannot determine {', '.join(open_)}. Fix some of them, or measure "
            "more points, better spread in the image and in depth."
        )
    if not found.settled:
        raise ConvergenceError(
            f"{what}: the adjustment does not settle. The data can hardly tell the unknowns apart, "
            "or image and object points do not belong together",
            iterations=found.iterations,
            residual=float(np.sqrt(np.mean(residuals**2))),
        )
    length = np.sqrt((jacobian * jacobian).sum(axis=0))
    left, values, right = svd(jacobian / length, full_matrices=False, check_finite=False)
    half = (right.T / values) / length[:, None]
    return Fit(
        state=found.state,
        residuals=residuals,
        cofactor=half @ half.T,
        redundancy_numbers=1.0 - (left * left).sum(axis=1),
        iterations=found.iterations,
    )
