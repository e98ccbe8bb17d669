"""Least-squares adjustment of the two cameras of a pair from everything that is known of them.

Control points, tie points, wall points, taped distances and what is known of the lenses all enter
one adjustment with their standard deviations; what an observation does not reach is held by the
prior, and the covariance says so.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from bifocal.orientation.alignment import Control, Interior
from bifocal.orientation.pinhole import (
    Pinhole,
    camera_matrix,
    fundamental,
    pinhole_from_plane,
    plane_transfer,
    project,
    projection_rows,
    rotation_matrix,
    tilt,
    triangulate,
)
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import GeometryError

#: Parameters of a camera: ln f, ln aspect, column, row, three rotations, X, Y, Z, radial k.
PER_CAMERA = 11
#: A coordinate that was not measured, as a standard deviation. [m]
UNKNOWN = 1e3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """Everything observed. Pixels are free of the lens file's distortion.

    Attributes
    ----------
    interiors : pair of Interior
    control : Control
    pick_used : ndarray of bool, shape (n,)
        Control points that take part.
    sigma_pick : float
        Precision of control picks. [px]
    tie1, tie2 : ndarray, shape (m, 2)
    sigma_tie : float
        Precision of a tie point's coordinate. [px]
    tie_used, wall : ndarray of bool, shape (m,)
        Ties that take part; ties that lie on the wall plane.
    sigma_wall : ndarray, shape (m,)
        How precisely a tie of the wall lies where the plane puts it: its own precision and the
        wall's roughness, seen in photo 2. [px]
    sigma_body, sigma_zoom : float or None
        Both photos come from one body (same principal point [px], same aspect), or with one
        unchanged lens (same principal distance, relative).
    sigma_plane : float
        How far the ties' wall may lie from the reference plane; zero: they define it. [m]
    sigma_slope : float
        The same for the slope between the two. [m/m]
    measured : mapping of str to (value, sigma)
        ``distance1``, ``distance2``, ``delta_d``. [m]
    sigma_tilt : float or None
        Standard deviation of "image plane parallel to the wall". [rad]
    gauge : bool
        Whether origin and turn of the plane frame are free and must be held.
    """

    interiors: tuple[Interior, Interior]
    control: Control = field(default_factory=Control)
    pick_used: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    sigma_pick: float = 0.5
    tie1: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    tie2: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_tie: float = 0.5
    tie_used: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    wall: BoolArray = field(default_factory=lambda: np.zeros(0, dtype=bool))
    sigma_wall: FloatArray = field(default_factory=lambda: np.zeros(0))
    sigma_body: float | None = None
    sigma_zoom: float | None = None
    sigma_plane: float = 0.0
    sigma_slope: float = 0.0
    measured: dict[str, tuple[float, float]] = field(default_factory=dict)
    sigma_tilt: float | None = None
    gauge: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solution:
    """Adjusted cameras.

    Attributes
    ----------
    cameras : pair of Pinhole
    radial : pair of float
        Radial distortion k of either photo.
    plane : ndarray, shape (3,)
        The ties' wall, z = a + b X + c Y. [m, -, -]
    covariance : ndarray, shape (25, 25)
        Of all parameters (two cameras of `PER_CAMERA`, the plane); zero where held.
    sigma0 : float
        Standard deviation of unit weight.
    control_residuals : ndarray, shape (n, 4)
        [px]
    control_test : ndarray, shape (n,)
        Misfit of a point over its standard deviation, allowing for its leverage.
    tie_misfit : ndarray, shape (m,)
        Epipolar distance of all ties. [px]
    wall_misfit : ndarray, shape (m,)
        Distance of all ties from where the wall plane puts them, along the line. [px]
    start : parameters
        Internal: where the next adjustment may start.
    """

    cameras: tuple[Pinhole, Pinhole]
    radial: tuple[float, float]
    plane: FloatArray
    covariance: FloatArray
    sigma0: float
    control_residuals: FloatArray
    control_test: FloatArray
    tie_misfit: FloatArray
    wall_misfit: FloatArray


def adjust(
    problem: Problem,
    cameras: tuple[Pinhole, Pinhole],
    *,
    radial: tuple[float, float] = (0.0, 0.0),
    plane: FloatArray | None = None,
) -> Solution:
    """Return the adjusted cameras.

    Parameters
    ----------
    problem : Problem
    cameras : pair of Pinhole
        Approximate cameras.
    radial, plane : optional
        Approximate distortion and wall plane.

    Raises
    ------
    GeometryError
        If the observations leave a parameter undetermined.
    """
    model = _Model(problem, cameras)
    theta = model.start(radial, np.zeros(3) if plane is None else plane)
    active = model.active
    steps = model.steps[active]

    def residuals(free: FloatArray) -> FloatArray:
        full = theta.copy()
        full[active] = free * steps + theta[active]
        return model.residuals(full)

    free, fun, jac = _least_squares(residuals, len(steps))
    theta[active] += free * steps
    normal = jac.T @ jac
    scale = np.sqrt(np.diag(normal))
    if not (scale > 0).all() or np.linalg.cond(normal / np.outer(scale, scale)) > 1e15:
        raise GeometryError(
            "the observations do not determine the cameras. Measure more control points, spread "
            "over the photo and off the wall plane, or give the distances."
        )
    inverse = np.linalg.inv(normal / np.outer(scale, scale)) / np.outer(scale, scale)
    redundancy = max(len(fun) - len(steps), 1)
    sigma0 = float(np.sqrt((fun @ fun) / redundancy))
    covariance = np.zeros((len(theta), len(theta)))
    covariance[np.ix_(active, active)] = inverse * np.outer(steps, steps) * max(sigma0, 1.0) ** 2
    final, k, flat = model.unpack(theta)
    problem_control = model.control_picks(theta)
    return Solution(
        cameras=final,
        radial=k,
        plane=flat,
        covariance=covariance,
        sigma0=sigma0,
        control_residuals=problem_control,
        control_test=_control_test(model, theta, jac, inverse),
        tie_misfit=model.epipolar(theta),
        wall_misfit=model.transfer(theta),
    )


def onto_plane(cameras: tuple[Pinhole, Pinhole], plane: FloatArray) -> tuple[Pinhole, Pinhole]:
    """Return cameras in the frame of the plane z = a + b X + c Y, X and Y all but kept."""
    normal = np.array([-plane[1], -plane[2], 1.0])
    normal /= np.linalg.norm(normal)
    # The rotation that takes the normal to the new Z axis, about their common perpendicular.
    turn = rotation_matrix(np.array([normal[1], -normal[0], 0.0]))
    base = np.array([0.0, 0.0, plane[0]])
    moved = [
        camera._replace(rotation=camera.rotation @ turn.T, centre=turn @ (camera.centre - base))
        for camera in cameras
    ]
    return moved[0], moved[1]


def evaluate(problem: Problem, solution: Solution) -> Solution:
    """Return a solution's cameras with the misfits of another problem's ties, not adjusted."""
    model = _Model(problem, solution.cameras)
    theta = model.start(solution.radial, solution.plane)
    return replace(solution, tie_misfit=model.epipolar(theta), wall_misfit=model.transfer(theta))


def _least_squares(
    function: Callable[[FloatArray], FloatArray], count: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the minimum of a sum of squares from zero, its residuals and their Jacobian.

    Levenberg and Marquardt on the normal equations: a few thousand residuals of some twenty
    well-scaled parameters, for which an orthogonal decomposition would cost ten times as much.
    """
    free, damping = np.zeros(count), 1e-5
    value = function(free)
    cost = float(value @ value)
    jacobian = _jacobian(function, free, value)
    for _ in range(60):
        normal, slope = jacobian.T @ jacobian, jacobian.T @ value
        diagonal = np.maximum(np.diag(normal), 1e-12)
        before = cost
        for _ in range(12):
            step = np.linalg.solve(normal + np.diag(damping * diagonal), -slope)
            trial = function(free + step)
            trial_cost = float(trial @ trial)
            if trial_cost <= cost:
                break
            damping *= 10.0
        else:
            return free, value, jacobian
        free, value, cost = free + step, trial, trial_cost
        damping = max(damping / 10.0, 1e-12)
        jacobian = _jacobian(function, free, value)
        # Steps are in typical corrections, themselves far above any standard deviation asked for.
        if before - cost <= 1e-9 * (1.0 + before) or np.abs(step).max() < 1e-9:
            break
    return free, value, jacobian


def _jacobian(
    function: Callable[[FloatArray], FloatArray], free: FloatArray, here: FloatArray
) -> FloatArray:
    """Return forward differences; parameters are scaled so that 1e-5 is a tiny step of each."""
    columns = []
    for index in range(len(free)):
        step = np.zeros(len(free))
        step[index] = 1e-5
        columns.append((function(free + step) - here) / 1e-5)
    return np.stack(columns, axis=1)


class _Model:
    """Residuals of a `Problem` as a function of the parameter vector."""

    def __init__(self, problem: Problem, cameras: tuple[Pinhole, Pinhole]) -> None:
        self.problem, self.cameras = problem, cameras
        first, second = problem.interiors
        self.steps = np.concatenate(
            [self._steps(c, i) for c, i in zip(cameras, (first, second), strict=True)]
        )
        depth = cameras[0].centre[2]
        self.steps = np.append(self.steps, [1e-3 * depth, 1e-3, 1e-3])
        self.active = np.ones(2 * PER_CAMERA + 3, dtype=bool)
        for number, interior in enumerate((first, second)):
            self.active[PER_CAMERA * number + 10] = interior.sigma_radial > 0
            self.active[PER_CAMERA * number + 1] = interior.sigma_aspect > 0
        if problem.gauge:
            self.active[[6, 7, 8]] = False
        on_wall = bool((problem.wall & problem.tie_used).any())
        self.active[-3:] = on_wall and problem.sigma_plane > 0

    @staticmethod
    def _steps(camera: Pinhole, interior: Interior) -> FloatArray:
        """Return a typical size of each parameter's correction."""
        depth = camera.centre[2]
        centre = max(interior.sigma_centre, 0.1)
        return np.array([1e-3, 1e-3, centre, centre, *[1e-3] * 3, *[1e-3 * depth] * 3, 1e-2])

    def start(self, radial: tuple[float, float], plane: FloatArray) -> FloatArray:
        """Return the parameter vector of the approximate cameras; rotations are increments."""
        parts = []
        for camera, k in zip(self.cameras, radial, strict=True):
            focal = camera.matrix[0, 0]
            aspect = camera.matrix[1, 1] / focal
            parts += [np.log(focal), np.log(aspect), *camera.matrix[:2, 2], 0.0, 0.0, 0.0]
            parts += [*camera.centre, k]
        return np.array([*parts, *plane])

    def unpack(
        self, theta: FloatArray
    ) -> tuple[tuple[Pinhole, Pinhole], tuple[float, float], FloatArray]:
        """Return cameras, radial distortions and wall plane."""
        made = []
        for number, start in enumerate(self.cameras):
            p = theta[PER_CAMERA * number : PER_CAMERA * (number + 1)]
            matrix = camera_matrix(float(np.exp(p[0])), float(np.exp(p[1])), p[2], p[3])
            made.append(Pinhole(matrix, start.rotation @ rotation_matrix(p[4:7]), p[7:10]))
        radial = (float(theta[PER_CAMERA - 1]), float(theta[2 * PER_CAMERA - 1]))
        return (made[0], made[1]), radial, theta[-3:]

    def straight(self, pixels: FloatArray, number: int, theta: FloatArray) -> FloatArray:
        """Return pixels freed of the radial distortion under estimation."""
        k = theta[PER_CAMERA * number + 10]
        return pixels if k == 0 else radial_shift(pixels, self.problem.interiors[number], k)

    def residuals(self, theta: FloatArray) -> FloatArray:
        """Return everything observed minus computed, in standard deviations."""
        problem = self.problem
        parts = [self._priors(theta)]
        if problem.tie_used.any():
            parts.append(self.epipolar(theta, problem.tie_used) / problem.sigma_tie)
            on = problem.tie_used & problem.wall
            if on.any():
                parts.append(self.transfer(theta, on) / problem.sigma_wall[on])
        white, _ = self.control_white(theta)
        parts += [white.ravel(), self._lengths(theta)]
        return np.nan_to_num(np.concatenate(parts), nan=1e3, posinf=1e3, neginf=-1e3)

    def _priors(self, theta: FloatArray) -> FloatArray:
        """Return the lens's, the tape's and the plane's observations."""
        problem = self.problem
        cameras, _, plane = self.unpack(theta)
        out = []
        for number, interior in enumerate(problem.interiors):
            p = theta[PER_CAMERA * number : PER_CAMERA * (number + 1)]
            out.append((p[0] - np.log(interior.focal)) / interior.sigma_focal)
            if interior.sigma_aspect > 0:
                out.append((p[1] - np.log(interior.aspect)) / interior.sigma_aspect)
            out += list((p[2:4] - interior.centre) / interior.sigma_centre)
            if interior.sigma_radial > 0:
                out.append(p[10] / interior.sigma_radial)
            if problem.sigma_tilt is not None:
                out += list(tilt(cameras[number]) / problem.sigma_tilt)
        a, b = theta[:PER_CAMERA], theta[PER_CAMERA : 2 * PER_CAMERA]
        if problem.sigma_body is not None:
            out.append((a[1] - b[1]) / 2e-4)
            out += list((a[2:4] - b[2:4]) / problem.sigma_body)
        if problem.sigma_zoom is not None:
            out.append((a[0] - b[0]) / problem.sigma_zoom)
        d1, d2 = cameras[0].centre[2], cameras[1].centre[2]
        values = {"distance1": d1, "distance2": d2, "delta_d": d1 - d2}
        for name, (value, sigma) in problem.measured.items():
            out.append((values[name] - value) / sigma)
        if self.active[-1]:
            slope = problem.sigma_slope
            out += list(plane / np.array([problem.sigma_plane, slope, slope]))
        return np.array(out)

    def epipolar(self, theta: FloatArray, which: BoolArray | None = None) -> FloatArray:
        """Return the signed (Sampson) distance of ties from their epipolar lines. [px]"""
        chosen = slice(None) if which is None else which
        cameras, _, _ = self.unpack(theta)
        x1 = _homogeneous(self.straight(self.problem.tie1[chosen], 0, theta))
        x2 = _homogeneous(self.straight(self.problem.tie2[chosen], 1, theta))
        matrix = fundamental(*cameras)
        line2, line1 = x1 @ matrix.T, x2 @ matrix
        size = (line2[:, :2] ** 2).sum(1) + (line1[:, :2] ** 2).sum(1)
        return (x2 * line2).sum(1) / np.sqrt(np.maximum(size, 1e-300))

    def transfer(self, theta: FloatArray, which: BoolArray | None = None) -> FloatArray:
        """Return how far ties lie from the wall plane's transfer, along the epipolar line. [px]"""
        chosen = slice(None) if which is None else which
        cameras, _, plane = self.unpack(theta)
        x1 = _homogeneous(self.straight(self.problem.tie1[chosen], 0, theta))
        x2 = self.straight(self.problem.tie2[chosen], 1, theta)
        mapped = x1 @ plane_transfer(*cameras, plane).T
        line = x1 @ fundamental(*cameras).T
        with np.errstate(divide="ignore", invalid="ignore"):
            shift = x2 - mapped[:, :2] / mapped[:, 2:]
            return (shift[:, 1] * line[:, 0] - shift[:, 0] * line[:, 1]) / np.hypot(
                line[:, 0], line[:, 1]
            )

    def control_white(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return whitened pick residuals (n, 4) and the adjusted points (n, 3).

        The points' own uncertainty is eliminated: it widens the picks' covariance by
        J Σ Jᵀ, so a metre known to 3 mm pulls less than a pick known to half a pixel.
        """
        problem, control = self.problem, self.problem.control
        if not control.ids:
            return np.zeros((0, 4)), np.zeros((0, 3))
        cameras, _, _ = self.unpack(theta)
        picks = np.concatenate(
            [self.straight(control.pixels1, 0, theta), self.straight(control.pixels2, 1, theta)],
            axis=1,
        )
        xyz, sigma, known = self._points(cameras, picks)
        seen = np.isfinite(picks) & problem.pick_used[:, None]
        for _ in range(3):
            rows = np.concatenate([projection_rows(c, xyz) for c in cameras], axis=1)
            misfit = picks - np.concatenate([project(c, xyz) for c in cameras], axis=1)
            rows = np.where(seen[:, :, None], np.nan_to_num(rows), 0.0)
            misfit = np.where(seen, np.nan_to_num(misfit, nan=1e4), 0.0)
            misfit = misfit - np.einsum("nij,nj->ni", rows, known - xyz)
            spread = rows * sigma[:, None, :] ** 2
            covariance = spread @ rows.transpose(0, 2, 1)
            covariance += problem.sigma_pick**2 * np.eye(4)
            gain = np.linalg.solve(covariance, misfit[..., None])
            xyz = known + np.einsum("nij,nik->nj", spread, gain)
        lower = np.linalg.cholesky(covariance)
        white = np.linalg.solve(lower, misfit[..., None])[..., 0]
        return np.where(seen, white, 0.0), xyz

    def _points(
        self, cameras: tuple[Pinhole, Pinhole], picks: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return approximate points, their standard deviations and their known coordinates."""
        control = self.problem.control
        both = triangulate(*cameras, picks[:, :2], picks[:, 2:])
        on_plane = [
            ray_on_plane(c, p) for c, p in zip(cameras, (picks[:, :2], picks[:, 2:]), strict=True)
        ]
        single = np.where(np.isfinite(on_plane[0]), on_plane[0], on_plane[1])
        guess = np.where(np.isfinite(both), both, single)
        flat = control.sigma[:, 2:] < UNKNOWN  # relief known: the plane fixes X and Y better
        guess = np.where(flat & np.isfinite(single) & (control.xyz[:, 2:] == 0), single, guess)
        known = np.where(np.isfinite(control.xyz), control.xyz, np.nan_to_num(guess))
        sigma = np.where(np.isfinite(control.xyz), control.sigma, UNKNOWN)
        return known.copy(), sigma, known

    def control_picks(self, theta: FloatArray) -> FloatArray:
        """Return picks minus the projection of the control points as given, shape (n, 4). [px]"""
        control = self.problem.control
        if not control.ids:
            return np.zeros((0, 4))
        cameras, _, _ = self.unpack(theta)
        _, adjusted = self.control_white(theta)
        xyz = np.where(np.isfinite(control.xyz), control.xyz, adjusted)
        parts = []
        for number, pixels in enumerate((control.pixels1, control.pixels2)):
            parts.append(self.straight(pixels, number, theta) - project(cameras[number], xyz))
        return np.concatenate(parts, axis=1)

    def _lengths(self, theta: FloatArray) -> FloatArray:
        """Return the taped distances' residuals; the picks' own noise is part of their weight."""
        problem, control = self.problem, self.problem.control
        if not control.lengths:
            return np.zeros(0)
        cameras, _, _ = self.unpack(theta)
        _, xyz = self.control_white(theta)
        out = []
        for a, b, length in control.lengths:
            if not (problem.pick_used[a] and problem.pick_used[b]):
                continue
            ground = cameras[0].centre[2] / cameras[0].matrix[0, 0] * problem.sigma_pick
            sigma = np.hypot(problem.control.sigma.min(initial=0.003), 1.41 * ground)
            out.append((np.linalg.norm(xyz[a] - xyz[b]) - length) / sigma)
        return np.array(out)


def radial_shift(pixels: FloatArray, interior: Interior, k: float) -> FloatArray:
    """Return pixels moved to where they would be without distortion: c + (x - c) / (1 + k ρ²).

    ρ is the distorted radius over the principal distance.
    """
    away = pixels - interior.centre
    square = (away**2).sum(-1, keepdims=True) / interior.focal**2
    return interior.centre + away / (1.0 + k * square)


def _homogeneous(pixels: FloatArray) -> FloatArray:
    return np.concatenate([pixels, np.ones((len(pixels), 1))], axis=1)


def ray_on_plane(camera: Pinhole, pixels: FloatArray) -> FloatArray:
    """Return where rays meet the reference plane, as points of relief zero, shape (n, 3)."""
    ideal = _homogeneous(pixels) @ np.linalg.inv(camera.matrix).T
    ray = ideal @ camera.rotation
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(ray[:, 2] < 0, -camera.centre[2] / ray[:, 2], np.nan)
    points = camera.centre + reach[:, None] * ray
    points[:, 2] = np.where(np.isfinite(points[:, 0]), 0.0, np.nan)
    return points


def _control_test(
    model: _Model, theta: FloatArray, jacobian: FloatArray, inverse: FloatArray
) -> FloatArray:
    """Return each control point's misfit in standard deviations, as if it had been left out.

    With residual block w, its Jacobian A and the cofactor Q of the parameters,
    ``T² = wᵀ (I - A Q Aᵀ)⁻¹ w`` per coordinate; unused points are tested against the others.
    """
    control, problem = model.problem.control, model.problem
    count = len(control.ids)
    if not count:
        return np.zeros(0)
    tail = len([1 for a, b, _ in control.lengths if problem.pick_used[a] and problem.pick_used[b]])
    end = len(jacobian) - tail
    rows = jacobian[end - 4 * count : end].reshape(count, 4, -1)
    white, _ = model.control_white(theta)
    everyone = replace(problem, pick_used=np.ones(count, dtype=bool))
    unused, _ = _Model(everyone, model.cameras).control_white(theta)
    out = np.zeros(count)
    for index in range(count):
        seen = np.isfinite(np.concatenate([control.pixels1[index], control.pixels2[index]]))
        if not seen.any():
            continue
        if not problem.pick_used[index]:
            out[index] = np.linalg.norm(unused[index][seen]) / np.sqrt(seen.sum())
            continue
        block = rows[index][seen]
        freedom = np.eye(int(seen.sum())) - block @ inverse @ block.T
        # A point that alone determines something has no redundancy: its test says nothing.
        values, vectors = np.linalg.eigh(freedom)
        parts = (vectors.T @ white[index][seen]) ** 2
        usable = values > 0.02
        if usable.any():
            out[index] = np.sqrt((parts[usable] / values[usable]).sum() / usable.sum())
    return out


def photo_camera(matrix: FloatArray, nadir: FloatArray, distance: float) -> Pinhole:
    """Return the camera of a photo of a pair, skew dropped."""
    camera = pinhole_from_plane(matrix, nadir, distance)
    return camera._replace(
        matrix=camera_matrix(
            camera.matrix[0, 0],
            camera.matrix[1, 1] / camera.matrix[0, 0],
            camera.matrix[0, 2],
            camera.matrix[1, 2],
        )
    )
