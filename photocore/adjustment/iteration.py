"""Levenberg-Marquardt, once for dense equations and for those of many points, and its result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from photocore.adjustment.blocks import BlockEquations
from photocore.adjustment.dense import DenseEquations
from photocore.adjustment.outliers import standardised
from photocore.adjustment.priors import ALIKE
from photocore.arrays import FloatArray
from photocore.errors import ConvergenceError, GeometryError
from photocore.remarks import remark

State = TypeVar("State")
#: Weighted residuals and their derivatives.
Linear = DenseEquations | BlockEquations

#: Steps smaller than this share of what an unknown may vary by one sigma end the iteration.
SETTLE = 1e-10
#: The same where points are eliminated: normal equations see no smaller ones.
SETTLE_BLOCKS = 1e-6
#: Share of the square sum that is its own rounding. A step that drops it by less is taken without
#: seeing it fall: 20 control points need 7 evaluations in place of 14 to 18.
ROUNDED = 1e-13
#: Steps in which a square sum that is hopeless must fall to this share of itself.
_PATIENCE, _FALLS = 10, 0.7
#: Where a step brings this share of the drop foretold, the valley is straight enough.
STRAIGHT = 0.9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit(Generic[State]):
    """An adjusted state with its precision.

    Attributes
    ----------
    state : State
        Where the weighted square sum is smallest.
    linear : DenseEquations or BlockEquations
        Residuals and derivatives there.
    iterations : int
        Steps taken.
    settled : bool
        Whether it ended because nothing changed any more.
    """

    state: State
    linear: Linear
    iterations: int
    settled: bool

    @property
    def residuals(self) -> FloatArray:
        """Weighted residuals (computed minus measured), shape (n,)."""
        return self.linear.residuals

    @property
    def redundancy(self) -> int:
        """Observations beyond the necessary ones."""
        return len(self.residuals) - self.linear.unknowns

    @property
    def sigma0(self) -> float:
        """A-posteriori standard deviation of unit weight; NaN without redundancy."""
        if self.redundancy <= 0:
            return float("nan")
        return float(np.sqrt(self.residuals @ self.residuals / self.redundancy))

    @property
    def standardised(self) -> FloatArray:
        """Residuals over their own standard deviations; NaN where nothing controls them."""
        return standardised(self.residuals, self.linear.redundancy_numbers, self.sigma0)


def correlations(covariance: FloatArray) -> FloatArray:
    """Return the correlation matrix of a covariance matrix; NaN beside a variance of zero.

    Examples
    --------
    >>> correlations(np.array([[4.0, 3.0], [3.0, 9.0]])).tolist()
    [[1.0, 0.5], [0.5, 1.0]]
    """
    sigma = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        return covariance / np.outer(sigma, sigma)


def minimise(
    state: State,
    equations: Callable[[State], Linear | None],
    advance: Callable[[State, FloatArray], State | None],
    *,
    what: str = "adjustment",
    most: int = 200,
    settle: float = SETTLE,
    rounding: float = 0.0,
    hopeless: float = np.inf,
) -> Fit[State]:
    """Go from a start to the least square sum.

    Parameters
    ----------
    state : State
        Start; its equations must be possible.
    equations : callable
        State to weighted residuals (computed minus measured) and their derivatives by the step;
        None where impossible.
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
    hopeless : float
        Root mean square of the weighted residuals above which it gives up once they fall no more.

    Raises
    ------
    GeometryError
        If the start is impossible.

    Notes
    -----
    Levenberg-Marquardt with the columns scaled to length one, so units do not matter (Moré 1978),
    with Nielsen's rule (1999) for the damping, and with the second-order correction of Transtrum
    and Sethna (2012): principal distance, position and distortion trade off along narrow curved
    valleys, in which straight steps crawl. MINPACK and scipy know neither states that are no
    vectors (rotations), nor impossible ones, nor elimination.
    """
    linear = equations(state)
    if linear is None:
        raise GeometryError(f"{what}: the start values are impossible.")
    damping, growth, curved = 1e-4, 2.0, False
    if isinstance(linear, BlockEquations):
        # A block of 50 images (bench_bundle) settles in 4 steps from here, in 5 from 1e-4.
        damping, settle = 1e-6, max(settle, SETTLE_BLOCKS)
    count, cost = len(linear.residuals), float(linear.residuals @ linear.residuals)
    settled, number, last = cost <= count * rounding**2, 0, cost
    for number in range(1, most + 1):
        while True:
            step = linear.step(damping)
            if curved:
                step = _bent(state, equations, advance, linear, step, damping)
            change = linear.change(step)
            small = float(np.linalg.norm(change)) <= settle * np.sqrt(cost) + 10.0 * (
                rounding * np.sqrt(count)
            )
            following = advance(state, step)
            new = None if following is None else equations(following)
            new_cost = np.inf if new is None else float(new.residuals @ new.residuals)
            # A step that moves so little drops the square sum by less than its own rounding:
            # whether it went downhill cannot be seen, that it goes the right way is known.
            slack = ROUNDED * cost + 10.0 * rounding * float(np.sqrt(count * cost))
            unseen = float(change @ change) <= slack
            limit = cost + slack if unseen else cost
            if following is not None and new is not None and new_cost <= limit:
                break
            # At the rounding level no step goes downhill any more.
            if small or damping > 1e8:
                return Fit(state=state, linear=linear, iterations=number, settled=True)
            curved = True
            damping = max(damping * growth, 1e-12)
            growth *= 2.0
        # Nielsen's rule: the damping follows how well the linear model foretold the drop.
        foretold = -float(change @ (2.0 * linear.residuals + change))
        ratio = (cost - new_cost) / foretold if foretold > 0 and not unseen else 1.0
        damping *= max(0.1, 1.0 - (2.0 * min(ratio, 1.0) - 1.0) ** 3)
        growth, curved = 2.0, ratio < STRAIGHT
        settled = small or cost - new_cost <= 1e-14 * cost
        state, linear, cost = following, new, new_cost
        settled = (settled and damping < 1e-3) or cost <= count * rounding**2
        if settled:
            break
        if number % _PATIENCE == 0:
            if cost > count * hopeless**2 and cost > _FALLS * last:
                break
            last = cost
    return Fit(state=state, linear=linear, iterations=number, settled=settled)


def _bent(
    state: State,
    equations: Callable[[State], Linear | None],
    advance: Callable[[State, FloatArray], State | None],
    linear: Linear,
    step: FloatArray,
    damping: float,
    probe: float = 0.1,
) -> FloatArray:
    """Return a step that follows the curvature along it; the step itself where that is no help."""
    ahead = advance(state, probe * step)
    beyond = None if ahead is None else equations(ahead)
    if beyond is None:
        return step
    second = (beyond.residuals - linear.residuals) / probe - linear.change(step)
    correction = 0.5 * linear.step(damping, (2.0 / probe) * second)
    if np.linalg.norm(correction * linear.scale) < 0.75 * np.linalg.norm(step * linear.scale):
        return step + correction
    return step


def fit(
    state: State,
    equations: Callable[[State], Linear | None],
    advance: Callable[[State, FloatArray], State | None],
    *,
    names: Sequence[str],
    what: str,
    most: int = 200,
    rounding: float = 0.0,
    hopeless: float = np.inf,
    blame: Callable[[Fit[State]], str] | None = None,
) -> Fit[State]:
    """Adjust; refuse to return unknowns the data cannot determine.

    Parameters
    ----------
    state, equations, advance, most, rounding, hopeless
        As for `minimise`.
    blame : callable, optional
        Where in a fit the contradictions lie, in words.
    names : sequence of str
        Of the unknowns, for messages; free coordinates of points behind the others.
    what : str
        What is adjusted, for messages.

    Raises
    ------
    GeometryError
        If a combination of unknowns is undetermined; the message names them.
    ConvergenceError
        If ``most`` steps do not settle it.
    """
    result = minimise(
        state, equations, advance, what=what, most=most, rounding=rounding, hopeless=hopeless
    )
    rest = float(np.sqrt(np.mean(result.residuals**2)))
    if not result.settled and rest > hopeless:
        where = f" Most of it lies in {blame(result)}." if blame else ""
        raise ConvergenceError(
            remark("fit.contradict", of=what, rest=rest, where=where),
            iterations=result.iterations,
            residual=rest,
        )
    refuse_undetermined(result, names, what)
    return result


def refuse_undetermined(result: Fit[State], names: Sequence[str], what: str) -> None:
    """Refuse a state that the data do not determine, or that is not settled; see `fit`."""
    open_ = result.linear.undetermined(names)
    if open_:
        raise GeometryError(remark("fit.undetermined", of=what, names=", ".join(open_)))
    if not result.settled:
        alike = np.abs(np.triu(np.nan_to_num(correlations(result.linear.cofactor)), 1))
        one, second = divmod(int(alike.argmax()), len(alike))
        apart = f"{names[one]} and {names[second]}" if alike.max() > ALIKE else "the unknowns"
        raise ConvergenceError(
            remark("fit.unsettled", of=what, apart=apart),
            iterations=result.iterations,
            residual=float(np.sqrt(np.mean(result.residuals**2))),
        )
