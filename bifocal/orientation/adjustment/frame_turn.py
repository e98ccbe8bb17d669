"""What a façade's lines do to an adjusted pair: they turn its reference plane, and nothing else.

Lines that are not quite level or upright would else bend calibrated lenses and the relative
orientation, which the ties know better, until they lie along the wall. Where nobody measured the
lens they do tell where its principal point lies, and are observations like others: on church_2
points are then off by 14 mm after a similarity, instead of 26.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from bifocal.model import CAMERA, NAMES
from bifocal.orientation.adjustment.pair_observations import (
    Equations,
    PairObservations,
    PairUnknowns,
)
from bifocal.orientation.facade_lines import FacadeDirection
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, Similarity, rotation_from_vector, skew

#: Moves of the frame that change less, as a share of what moves most, are held by nothing.
_LEAST = 1e-12
_TURN, _PLACE = CAMERA.index("turn X"), CAMERA.index("X")


def line_equations(lines: Sequence[FacadeDirection], cameras: Sequence[Pinhole]) -> Equations:
    """Return how far the façade's lines come out of the wall, in sigma; adjusted: nothing.

    Derivatives are by `CAMERA` of all cameras, one after the other.
    """
    values, by = np.zeros(len(lines)), np.zeros((len(lines), len(cameras), len(CAMERA)))
    for row, line in enumerate(lines):
        direction = line.in_frame(cameras[line.camera - 1])
        values[row] = direction[2] / line.sigma
        by[row, line.camera - 1, _TURN : _TURN + 3] = skew(direction)[2] / line.sigma
    return values, by.reshape(len(lines), -1)


def line_test(line: FacadeDirection, state: PairUnknowns, covariance: FloatArray) -> float:
    """Return how far a direction of lines comes out of the wall adjusted without it, in sigma."""
    values, by = line_equations([line], state.cameras)
    return float(abs(values[0]) / np.sqrt(1.0 + by[0] @ covariance @ by[0]))


def family_test(
    lines: Sequence[FacadeDirection], observations: PairObservations, state: PairUnknowns,
    equations: Callable[[PairObservations, PairUnknowns], Equations],
) -> float:  # fmt: skip
    """Return how far lines of one direction come out of the wall together, in sigma.

    Against what the wall's own points leave open of its plane, in the model that the ties made.
    """
    estimated = observations.estimated[: len(NAMES)]
    moves = _similarities(state.cameras) @ _free(state.cameras, estimated)
    values, by = line_equations(lines, state.cameras)
    measured, of_lines = equations(observations, state)[1][:, : len(NAMES)] @ moves, by @ moves
    open_ = (
        of_lines @ np.linalg.pinv(measured.T @ measured, rcond=_LEAST, hermitian=True) @ of_lines.T
    )
    return float(abs(values.mean()) / np.sqrt(1.0 / len(values) + open_.mean()))


def turned_by_lines(
    lines: Sequence[FacadeDirection],
    cameras: Sequence[Pinhole],
    estimated: BoolArray,
    cofactor: FloatArray,
    known_of: Callable[[FloatArray], FloatArray],
) -> tuple[Similarity, FloatArray]:
    """Return the turn of the frame of cameras adjusted without lines, and their cofactors in it.

    Parameters
    ----------
    lines : sequence of FacadeDirection
    cameras : sequence of Pinhole
        All m of them.
    estimated : ndarray of bool, shape (12 m,)
        Which of `CAMERA` of each is not held.
    cofactor : ndarray, shape (12 m, 12 m)
    known_of : callable
        Of moves M, shape (12 m, k), the normal matrix (k, k) of all else that is known.

    Notes
    -----
    A similarity g of the frame moves all cameras alike: ties do not notice, the wall, control and
    distances do. With the equations A of all those, B of the lines and M of the moves,

    .. math:: g = -(M^T A^T A M + M^T B^T B M)^{-1} M^T B^T b .
    """
    free = _free(cameras, estimated)
    moves = _similarities(cameras) @ free
    values, by = line_equations(lines, cameras)
    of_lines = by @ moves
    normal = known_of(moves) + of_lines.T @ of_lines
    gain = -np.linalg.pinv(normal, rcond=_LEAST, hermitian=True) @ of_lines.T
    kept = np.eye(len(cofactor)) + moves @ gain @ by
    noise = moves @ gain
    turn, shift, growth = np.split(free @ gain @ values, [3, 6])
    frame = Similarity(
        scale=float(np.exp(growth[0])), rotation=rotation_from_vector(turn),
        source_centre=np.zeros(3), target_centre=shift,
    )  # fmt: skip
    return frame, kept @ cofactor @ kept.T + noise @ noise.T


def _similarities(cameras: Sequence[Pinhole]) -> FloatArray:
    """Return how `CAMERA` of all move by turn, shift and growth of the frame, shape (12 m, 7)."""
    by = np.zeros((len(cameras), len(CAMERA), 7))
    for rates, camera in zip(by, cameras, strict=True):
        rates[_TURN : _TURN + 3, :3] = -np.eye(3)
        rates[_PLACE : _PLACE + 3, :3] = -skew(camera.centre)
        rates[_PLACE : _PLACE + 3, 3:6] = np.eye(3)
        rates[_PLACE : _PLACE + 3, 6] = camera.centre
    return by.reshape(-1, 7)


def _free(cameras: Sequence[Pinhole], estimated: BoolArray) -> FloatArray:
    """Return the similarities that move nothing that is held, shape (7, k)."""
    held = _similarities(cameras)[~estimated]
    _, size, axes = np.linalg.svd(np.vstack([held, np.zeros((7, 7))]))
    return np.asarray(axes[size <= 1e-9 * max(size[0], 1.0)].T)
