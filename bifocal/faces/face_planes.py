"""The plane of a face: as given, through points, or through the relief measured within."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.faces.faces import Face, inside
from bifocal.faces.tuning import PLANES
from bifocal.model import Grid, Surface, bounds_of
from bifocal.remarks import remark
from photocore.arrays import Float32Array, FloatArray
from photocore.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedFace:
    """A face and its plane.

    Attributes
    ----------
    face : Face
    plane : ndarray, shape (3,)
        ``r = plane[0] + plane[1] X + plane[2] Y``. [m, -, -]
    covariance : ndarray, shape (3, 3)
        Of the plane.
    by_relief : bool
        Whether the relief measured within told it.
    """

    face: Face
    plane: FloatArray
    covariance: FloatArray
    by_relief: bool = False

    def relief(self, grid: Grid) -> Float32Array:
        """Return its relief at the pixels of a grid. [m]"""
        r0, across, up = self.plane
        r = r0 + across * grid.columns_x[None, :] + up * grid.rows_y[:, None]
        return np.asarray(r, np.float32)

    def sigma(self, grid: Grid) -> Float32Array:
        """Return the standard deviation of that. [m]"""
        x, y = np.meshgrid(grid.columns_x, grid.rows_y)
        terms = np.stack([np.ones_like(x), x, y], axis=-1)
        variance = np.einsum("...i,ij,...j->...", terms, self.covariance, terms)
        return np.sqrt(np.maximum(variance, 0)).astype(np.float32)


def placed(face: Face, surface: Surface, measured: Surface | None) -> PlacedFace | None:
    """Return a face with its plane; None where it lies outside of what is known.

    Parameters
    ----------
    face : Face
    surface, measured : Surface
        All relief that is known, and what of it was measured.

    Raises
    ------
    InputError
        If its points lie on a line.
    """
    if face.plane is not None:
        sigma = PLANES.sigma if face.sigma is None else face.sigma
        return PlacedFace(face=face, plane=face.plane, covariance=np.diag([sigma**2, 0.0, 0.0]))
    if len(face.points):
        plane, covariance = plane_through(face.points)
        if not np.isfinite(plane).all():
            raise InputError(remark("faces.points_on_a_line", name=face.name or "face"))
        return PlacedFace(face=face, plane=plane, covariance=covariance)
    for relief in (measured, surface):
        if relief is None:
            continue
        xyr, step = _within(face, relief)
        if len(xyr) >= PLANES.fewest:
            plane, covariance = robust_plane(xyr, step)
            return PlacedFace(face=face, plane=plane, covariance=covariance, by_relief=True)
    return None


def plane_through(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the plane through points and its covariance; NaN where they lie on a line.

    Parameters
    ----------
    points : ndarray, shape (n, 4)
        X, Y, r, and sigma of r or NaN. [m] More than three tell by how they miss the plane how
        precise they are, if that is worse than what they say.

    Examples
    --------
    >>> corners = np.array([[0, 0, 0.1, 0.01], [1, 0, 0.1, 0.01], [0, 1, 0.2, 0.01]])
    >>> plane, covariance = plane_through(corners)
    >>> plane.round(9).tolist(), round(float(covariance[0, 0]) ** 0.5, 9)
    ([0.1, 0.0, 0.1], 0.01)
    """
    middle = points[:, :2].mean(axis=0)
    near = np.column_stack([np.ones(len(points)), points[:, :2] - middle])
    sigma = np.where(np.isfinite(points[:, 3]), points[:, 3], PLANES.sigma)
    size = np.linalg.svd(near[:, 1:], compute_uv=False)
    if not size[-1] > PLANES.narrowest * size[0]:
        return np.full(3, np.nan), np.full((3, 3), np.nan)
    rows = near / sigma[:, None]
    inverse = np.linalg.inv(rows.T @ rows)
    solution = inverse @ (rows.T @ (points[:, 2] / sigma))
    spare = len(points) - 3
    if spare:
        misfit = (near @ solution - points[:, 2]) / sigma
        inverse = inverse * max(1.0, float(misfit @ misfit) / spare)
    origin = np.array([[1.0, -middle[0], -middle[1]], [0, 1, 0], [0, 0, 1]])
    return origin @ solution, origin @ inverse @ origin.T


def robust_plane(xyr: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return the plane that most of the relief of a face lies on, and its covariance.

    Parameters
    ----------
    xyr : ndarray, shape (n, 3)
    step : float
        Between them: neighbours err alike. [m]

    Notes
    -----
    Least median of squares over planes through three of them and level ones (Rousseeuw 1984), then
    least squares over what lies near; glass is full of what it mirrors.
    """
    rng = np.random.default_rng(0)
    levels = np.quantile(xyr[:, 2], np.linspace(0.02, 0.98, PLANES.levels))
    trials = [np.array([level, 0.0, 0.0]) for level in levels]
    for places in rng.integers(0, len(xyr), (PLANES.trials, 3)):
        rows = np.column_stack([np.ones(3), xyr[places, :2]])
        if abs(np.linalg.det(rows)) > step * step:
            trials.append(np.linalg.solve(rows, xyr[places, 2]))
    some = xyr[rng.permutation(len(xyr))[: PLANES.judged]]
    terms = np.column_stack([np.ones(len(some)), some[:, :2]])
    misses = np.abs(some[:, 2] - np.array(trials) @ terms.T)
    # Where less than half of a face is right, its best third still is alike.
    least = np.quantile(misses, PLANES.share, axis=1)
    plane, spread = trials[int(least.argmin())], float(least.min())
    terms = np.column_stack([np.ones(len(xyr)), xyr[:, :2]])
    for _ in range(PLANES.rounds):
        miss = np.abs(xyr[:, 2] - terms @ plane)
        near = miss <= max(PLANES.near * spread, 1e-6)
        plane = np.linalg.lstsq(terms[near], xyr[near, 2], rcond=None)[0]
        spread = float(np.quantile(np.abs(xyr[near, 2] - terms[near] @ plane), 0.68))
    alike = max(1.0, (PLANES.alike / step) ** 2) if step < PLANES.alike else 1.0
    inverse = np.linalg.pinv(terms[near].T @ terms[near])
    return plane, inverse * alike * spread**2


def _within(face: Face, surface: Surface) -> tuple[FloatArray, float]:
    """Return known relief within a face, off its edges where it is broad enough, and their step."""
    left, bottom, right, top = bounds_of(np.concatenate(face.rings))
    step = max(right - left, top - bottom) / PLANES.places
    surface_grid = getattr(surface, "grid", None)
    step = max(step, surface_grid.gsd if surface_grid is not None else 0.0)
    grid = Grid.from_bounds((left, bottom, right, top), gsd=step)
    mask = inside(face.rings, grid)
    relief = surface.window(grid)
    core = mask.copy()
    reach = round(PLANES.off_edge * (surface_grid.gsd if surface_grid is not None else 0.0) / step)
    for shift in (reach, -reach) if reach else ():
        for axis in (0, 1):
            core &= np.roll(mask, shift, axis)
    for keep in (core, mask):
        row, column = np.nonzero(keep & np.isfinite(relief))
        if len(row) >= PLANES.fewest:
            break
    xyr = np.column_stack([grid.columns_x[column], grid.rows_y[row], relief[row, column]])
    return xyr.astype(float), step
