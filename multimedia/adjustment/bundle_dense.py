"""A bundle adjustment of moderate size: one dense least-squares problem, orthogonal steps.

No normal equations: what the data can hardly tell apart (principal distance, distance to the glass,
index) keeps twice the digits, and what they cannot tell apart at all is named.
"""

from __future__ import annotations

import numpy as np

from multimedia.adjustment.bundle_problem import Linear, Problem, State
from photocore.adjustment import Fit, fit
from photocore.arrays import FloatArray, IntArray

#: Largest number of unknowns for the dense way; beyond it the points are eliminated.
LARGEST = 400
#: A motion of everything is a datum defect if it moves image points by less than this share of
#: what its parts would move them on their own.
_DEFECT = 1e-9


def solve_dense(problem: Problem, *, what: str) -> tuple[Fit[State], FloatArray]:
    """Adjust and return the fit and the directions that only the datum constraint holds.

    Unknowns are ordered: dense ones, then the eliminated coordinates in the order of
    ``np.argwhere(problem.free)``.
    """
    frees = np.argwhere(problem.free)
    count = problem.dense_count + len(frees)
    datum = datum_rows(problem) if problem.unknowns.control == "free" else np.zeros((0, count))

    def equations(state: State) -> tuple[FloatArray, FloatArray] | None:
        linear = problem.linear(state)
        if linear is None:
            return None
        miss, jacobian = stacked(problem, linear, frees)
        if len(datum):
            moved = (state.points - problem.start.points)[frees[:, 0], frees[:, 1]]
            held = datum[:, problem.dense_count :] @ moved
            miss = np.concatenate([miss, held])
            jacobian = np.vstack([jacobian, datum])
        return miss, jacobian

    def advance(state: State, step: FloatArray) -> State | None:
        point_step = np.zeros_like(state.points)
        point_step[frees[:, 0], frees[:, 1]] = step[problem.dense_count :]
        return problem.advance(state, step[: problem.dense_count], point_step)

    names = [*problem.columns.labels]
    names += [f"point {problem.ids[j]}:{'XYZ'[axis]}" for j, axis in frees.tolist()]
    size = float(np.abs(problem.observations.image).max(initial=0.0))
    # Projecting rounds a few times: ten units in the last place of the largest coordinate.
    rounding = 2e-15 * size / float(problem.observations.sigma.min(initial=1.0))
    result = fit(problem.start, equations, advance, names=names, what=what, rounding=rounding)
    return result, datum


def stacked(problem: Problem, linear: Linear, frees: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return all rows as one vector and one matrix; image rows first, in their own order."""
    dense, count = problem.dense_count, len(linear.miss)
    extra = len(linear.extra_miss)
    jacobian = np.zeros((2 * count + extra, dense + len(frees)))
    view = jacobian[: 2 * count].reshape(count, 2, -1)
    for rows, columns, block in zip(
        problem.observations.rows, linear.columns, linear.dense, strict=True
    ):
        # Columns may repeat (a point at both ends of two bars): add, never assign.
        for place, column in enumerate(columns):
            view[rows, :, column] += block[:, :, place]
    column_of = np.full(problem.free.shape, -1, dtype=np.int64)
    column_of[frees[:, 0], frees[:, 1]] = dense + np.arange(len(frees))
    for axis in range(3):
        column = column_of[problem.observations.point, axis]
        row = np.flatnonzero(column >= 0)
        view[row, :, column[row]] = linear.by_point[row, :, axis]
    jacobian[2 * count :, :dense] = linear.extra_dense
    for e in np.flatnonzero(linear.extra_point >= 0):
        for axis in range(3):
            column = column_of[linear.extra_point[e], axis]
            if column >= 0:
                jacobian[2 * count + e, column] = linear.extra_by_point[e, axis]
    return np.concatenate([linear.miss.ravel(), linear.extra_miss]), jacobian


def datum_rows(problem: Problem) -> FloatArray:
    """Return the inner constraints of a free network, shape (defect, unknowns).

    Shift, turn and scale of everything that the observations do not feel must not move the points
    on average: Helmert's inner constraints. Which of the seven motions are not felt is found from
    the equations themselves, since a glass fixed in the world leaves fewer of them.
    """
    frees = np.argwhere(problem.free)
    state, place = problem.start, problem.columns
    points = state.points[np.unique(frees[:, 0])]
    middle = points.mean(axis=0)
    reach = float(np.abs(points - middle).max()) or 1.0
    dense = problem.dense_count
    motion = np.zeros((dense + len(frees), 7))
    for k, camera in enumerate(state.cameras):
        first = place.exterior[k]
        if first is not None:
            motion[first : first + 3] = _moved(camera.centre, middle, reach)
            motion[first + 3 : first + 6, 3:6] = np.eye(3) / reach
    for plate, first in enumerate(place.plates):
        motion[first : first + 3] = _moved(state.poses[plate][1], middle, reach)
        motion[first + 3 : first + 6, 3:6] = np.eye(3) / reach
    for j, axis in np.argwhere(place.points >= 0).tolist():
        motion[place.points[j, axis]] = _moved(state.points[j], middle, reach)[axis]
    for row, (j, axis) in enumerate(frees.tolist()):
        motion[dense + row] = _moved(state.points[j], middle, reach)[axis]
    linear = problem.linear(state)
    if linear is None:
        return np.zeros((0, dense + len(frees)))
    _, jacobian = stacked(problem, linear, frees)
    felt = jacobian @ motion
    scale = np.linalg.norm(np.abs(jacobian) @ np.abs(motion))
    _, values, right = np.linalg.svd(felt)
    unfelt = right[values <= _DEFECT * scale]
    rows = unfelt @ motion.T
    rows[:, :dense] = 0.0
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    # As heavy as the image points, so that no column scaling suffers.
    weight = float(np.linalg.norm(jacobian) / np.sqrt(jacobian.shape[1]))
    normal: FloatArray = rows / np.where(length > 0, length, 1.0) * weight
    return normal


def _moved(place: FloatArray, middle: FloatArray, reach: float) -> FloatArray:
    """Return how the seven motions move one place, shape (3, 7)."""
    x, y, z = (place - middle) / reach
    turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return np.concatenate([np.eye(3), turn, np.array([[x], [y], [z]])], axis=1)
