"""What a façade's lines do to an adjusted pair: they turn its reference plane, and nothing else.

Lines that are not quite level or upright would else bend calibrated lenses and the relative
orientation, which the ties know better, until they lie along the wall. Where nobody measured the
lens they do tell where its principal point lies, and are observations like others: on church_2
points are then off by 14 mm after a similarity, instead of 26.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from bifocal.model.orientation_precision import NAMES
from bifocal.orientation.adjustment.pair_observations import (
    Equations,
    PairObservations,
    PairUnknowns,
    at,
)
from bifocal.orientation.facade_lines import FacadeDirection
from photocore.arrays import FloatArray
from photocore.camera.rotation import rotation_from_vector, skew


def line_equations(lines: Sequence[FacadeDirection], state: PairUnknowns) -> Equations:
    """Return how far the façade's lines come out of the wall, in sigma; adjusted: nothing."""
    values, by = np.zeros(len(lines)), np.zeros((len(lines), len(NAMES)))
    for row, line in enumerate(lines):
        seen = line.in_frame(state.cameras[line.camera - 1])
        turn = at("turn X", line.camera)
        values[row] = seen[2] / line.sigma
        by[row, turn : turn + 3] = skew(seen)[2] / line.sigma
    return values, by


def line_test(line: FacadeDirection, state: PairUnknowns, covariance: FloatArray) -> float:
    """Return how far a direction of lines comes out of the wall adjusted without it, in sigma."""
    values, by = line_equations([line], state)
    return float(abs(values[0]) / np.sqrt(1.0 + by[0] @ covariance @ by[0]))


def family_test(
    lines: Sequence[FacadeDirection], observations: PairObservations, state: PairUnknowns,
    equations: Callable[[PairObservations, PairUnknowns], Equations],
) -> float:  # fmt: skip
    """Return how far lines of one direction come out of the wall together, in sigma.

    Against what the wall's own points leave open of its plane, in the model that the ties made.
    """
    moves = _moves(observations, state)
    values, by = line_equations(lines, state)
    own, seen = equations(observations, state)[1][:, : len(NAMES)] @ moves, by @ moves
    open_ = seen @ np.linalg.pinv(own.T @ own, rcond=_LEAST, hermitian=True) @ seen.T
    return float(abs(values.mean()) / np.sqrt(1.0 / len(values) + open_.mean()))


def turned_by_lines(
    observations: PairObservations, state: PairUnknowns, cofactor: FloatArray,
    equations: Callable[[PairObservations, PairUnknowns], Equations],
) -> tuple[PairUnknowns, FloatArray]:  # fmt: skip
    """Return a pair adjusted without lines in a frame turned by them, and its cofactors.

    Notes
    -----
    A similarity g of the frame moves both cameras alike: ties do not notice, the wall, control and
    distances do. With the equations A of all those, B of the lines and M of the moves,

    .. math:: g = -(M^T A^T A M + M^T B^T B M)^{-1} M^T B^T b .
    """
    moves = _moves(observations, state)
    values, by = line_equations(observations.lines, state)
    own, seen = equations(observations, state)[1][:, : len(NAMES)] @ moves, by @ moves
    normal = own.T @ own + seen.T @ seen
    gain = -np.linalg.pinv(normal, rcond=_LEAST, hermitian=True) @ seen.T
    kept = np.eye(len(NAMES)) + moves @ gain @ by
    noise = moves @ gain
    turn, shift, growth = np.split(_free(observations, state) @ gain @ values, [3, 6])
    axes, scale = rotation_from_vector(turn), float(np.exp(growth[0]))
    first, second = (
        camera._replace(
            rotation=camera.rotation @ axes.T, centre=scale * (axes @ camera.centre) + shift
        )
        for camera in state.cameras
    )
    return (
        replace(state, cameras=(first, second)),
        kept @ cofactor @ kept.T + noise @ noise.T,
    )


#: Moves of the frame that change less, as a share of what moves most, are held by nothing.
_LEAST = 1e-12


def _similarities(state: PairUnknowns) -> FloatArray:
    """Return how `NAMES` move by turn, shift and growth of the frame, shape (24, 7)."""
    by = np.zeros((len(NAMES), 7))
    for number, camera in enumerate(state.cameras, start=1):
        turn, place = at("turn X", number), at("X", number)
        by[turn : turn + 3, :3] = -np.eye(3)
        by[place : place + 3, :3] = -skew(camera.centre)
        by[place : place + 3, 3:6] = np.eye(3)
        by[place : place + 3, 6] = camera.centre
    return by


def _free(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return the similarities that move nothing that is held, shape (7, k)."""
    held = _similarities(state)[~observations.estimated[: len(NAMES)]]
    _, size, axes = np.linalg.svd(np.vstack([held, np.zeros((7, 7))]))
    return np.asarray(axes[size <= 1e-9 * max(size[0], 1.0)].T)


def _moves(observations: PairObservations, state: PairUnknowns) -> FloatArray:
    """Return how `NAMES` move by those, shape (24, k)."""
    return _similarities(state) @ _free(observations, state)
