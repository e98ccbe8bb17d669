"""Image points that contradict all others: names exchanged, other points taken."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from multimedia.adjustment.bundle_equations import BEFORE, Bundle
from multimedia.adjustment.bundle_start import points_without_start, prepare
from multimedia.adjustment.start_poses import bars_for
from multimedia.adjustment.unknowns import AUTO, Unknowns
from multimedia.orientation import stray_rows, without_rows
from multimedia.projects import Project
from photocore.adjustment import DenseEquations, huber_weights
from photocore.adjustment.iteration import Linear, minimise
from photocore.adjustment.network import Network, NetworkState
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import PhotogrammetryError

#: So many times image points are left out and the rest adjusted; so often, and for so many steps,
#: are weights laid anew until that is done.
_ROUNDS, _WEIGHTINGS, _STEPS = 6, 6, 20
#: Weights that change less are settled.
SETTLED = 1e-3
#: Huber's bound on the way there, in standard deviations.
_BOUND = 2.5
#: Where more than this share contradicts, it is not single image points that are wrong.
_MOST = 0.1
#: Median of weighted residuals, .67 of honest ones, above which cameras and points do not fit.
_FITS = 2.0
#: Of the normal equations, so that directions without information stay where they are.
_LEAST_DAMPING = 1e-10


def contradicting_rows(project: Project, unknowns: Unknowns) -> BoolArray:
    """Return which image points contradict the others by far, shape (n,).

    The others are adjusted with weights that bound what each may do (Huber 1964), all are held
    against the cameras and points that come out, and those that miss by far are left out, until
    they are the same again. None where most of it does not fit: then the model is wrong.

    Parameters
    ----------
    project : Project
        Its cameras have poses.
    unknowns : Unknowns

    Notes
    -----
    At first no point may go before the last face: that holds cameras which gross errors draw
    away. Where it holds up the others, too, it is done again as in an adjustment, and what fits
    better counts.
    """
    if unknowns.interior == AUTO:
        unknowns = replace(unknowns, interior=())
    is_stray, misfit = _strays(project, unknowns, 0.0)
    if misfit > _FITS:
        with suppress(PhotogrammetryError):
            again, fit = _strays(project, unknowns, BEFORE)
            is_stray = again if fit < misfit else is_stray
    return is_stray if is_stray.mean() <= _MOST else np.zeros_like(is_stray)


def _strays(project: Project, unknowns: Unknowns, before: float) -> tuple[BoolArray, float]:
    """Return which image points contradict, and the median of the weighted residuals at last."""
    images, control = project.image_points, project.object_points
    is_free = unknowns.control == "free"
    fixed = {name for name, group in zip(control.ids, control.groups, strict=True)
             if group in unknowns.plates or not is_free}  # fmt: skip
    at_start = {name: xyz for name, xyz, group in
                zip(control.ids, control.xyz, control.groups, strict=True)
                if name in fixed and group not in unknowns.plates}  # fmt: skip
    posed, places = project, at_start
    is_stray = np.zeros(len(images.ids), dtype=bool)
    for _ in range(_ROUNDS):
        bars = bars_for(posed, unknowns)
        distances = [(bar.first, bar.second, bar.length) for bar in bars]
        now = stray_rows(posed, _in_order(places, images.names), distances)
        if (now == is_stray).all() and posed is not project:
            break
        is_stray = now
        bundle, _ = prepare(_startable(without_rows(project, is_stray), fixed), unknowns)
        bundle = replace(bundle, before=before)
        state, _ = with_weights(bundle, bundle.start, _BOUND)
        posed = replace(
            project, cameras=tuple(state.blocks["camera"].values()), media=state.blocks["media"]
        )
        places = {name: xyz for name, xyz in zip(bundle.ids, state.points, strict=True)
                  if name in fixed}  # fmt: skip
    linear = bundle.network.equations(state)
    count = bundle.observations.image.size
    misfit = np.inf if linear is None else float(np.median(np.abs(linear.residuals[:count])))
    return is_stray, misfit


def _startable(project: Project, fixed: set[str]) -> Project:
    """Return a project without points that have no start."""
    lost = points_without_start(project, fixed)
    return without_rows(project, np.array([name in lost for name in project.image_points.ids]))


class _NormalEquations(DenseEquations):
    """Dense equations solved by their normal equations: quick, and exact enough on the way."""

    @cached_property
    def _normal(self) -> FloatArray:
        scaled = self.jacobian / self.scale
        return np.asarray(scaled.T @ scaled)

    def step(self, damping: float, misfit: FloatArray | None = None) -> FloatArray:
        misfit = self.residuals if misfit is None else misfit
        held = max(damping, _LEAST_DAMPING) * np.linalg.norm(self._normal)
        slope = (self.jacobian.T @ misfit) / self.scale
        solved = np.linalg.solve(self._normal + held * np.eye(len(slope)), slope)
        return np.asarray(-solved / self.scale)


def _equations(network: Network, state: NetworkState) -> Linear | None:
    """Return the equations at a state; dense ones are solved by normal equations."""
    linear = network.equations(state)
    if not isinstance(linear, DenseEquations):
        return linear
    return _NormalEquations(residuals=linear.residuals, jacobian=linear.jacobian, free=linear.free)


def with_weights(
    bundle: Bundle, state: NetworkState, bound: float
) -> tuple[NetworkState, FloatArray]:
    """Return where the square sum with Huber's weights is smallest, and these weights, (n, 2)."""
    count, sigma = bundle.observations.image.size, bundle.observations.sigma
    weights = np.zeros_like(sigma)
    for _ in range(_WEIGHTINGS):
        linear = bundle.network.equations(state)
        if linear is None:
            break
        before = weights
        weights = huber_weights(linear.residuals[:count].reshape(sigma.shape), bound)
        if np.abs(weights - before).max() < SETTLED:
            break
        network = bundle.weighted(weights).network
        state = minimise(
            state, partial(_equations, network), network.advance, most=_STEPS, settle=1e-4,
            rounding=network.rounding,
        ).state  # fmt: skip
    return state, weights


def _in_order(places: dict[str, FloatArray], names: tuple[str, ...]) -> FloatArray:
    """Return the places of points by their names; NaN where none is stated."""
    return np.array([places.get(name, np.full(3, np.nan)) for name in names]).reshape(-1, 3)
