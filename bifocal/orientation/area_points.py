"""Which face is the wall: the relief that most of the area has, not most of the details.

Features crowd on mouldings and joints; smooth plaster has few. A quick dense flow between both
photos, carried to the present plane, counts area instead.
"""

from __future__ import annotations

import cv2
import numpy as np

from bifocal import rays
from bifocal.orientation.bundle import Problem, Solution, radial_shift, ray_on_plane
from bifocal.orientation.pinhole import project
from bifocal.orientation.tie_points import raw_pixels
from photocore.arrays import ByteArray, FloatArray

#: Pixels of the rectified photos.
AREA = 1.0e6
#: Points asked of the whole area.
POINTS = 3000
#: Half the thickness of a face, as a share of the far distance.
BAND = 0.0012
#: The present plane is a face of the same wall: others slope less than this against it. [m/m]
STEEPEST = 0.02


def even_points(
    problem: Problem, solution: Solution, images: tuple[ByteArray, ByteArray]
) -> tuple[FloatArray, FloatArray]:
    """Return points spread evenly over the wall's area, where either photo sees them.

    Parameters
    ----------
    problem, solution : Problem, Solution
        Cameras in the frame of any face of the wall.
    images : two ndarrays, shape (h, w), uint8

    Returns
    -------
    pixels1, pixels2 : ndarray, shape (n, 2)
        Raw pixels, to a pixel or so: to be refined.
    """
    far, near = solution.cameras
    grid, gsd = _grid(problem, solution)
    first, second = (_rectified(problem, solution, images[n], grid, n) for n in (0, 1))
    flow = _flow(first, second)
    # Rows run down, Y up.
    q2 = grid + flow * np.array([gsd, -gsd])
    feet = [rays.Foot(c.centre[:2], float(c.centre[2])) for c in (far, near)]
    trusted = _trusted(first, second, flow, grid, rays.zoom_centre(feet[0], feet[1]))
    step = max(2, round(np.sqrt(grid.shape[0] * grid.shape[1] / POINTS)))
    chosen = np.zeros_like(trusted)
    chosen[step // 2 :: step, step // 2 :: step] = True
    chosen &= trusted
    flat = np.zeros((int(chosen.sum()), 1))
    pixels1 = _pixels(problem, solution, np.concatenate([grid[chosen], flat], axis=1), 0)
    pixels2 = _pixels(problem, solution, np.concatenate([q2[chosen], flat], axis=1), 1)
    fine = np.isfinite(pixels1).all(axis=1) & np.isfinite(pixels2).all(axis=1)
    return pixels1[fine], pixels2[fine]


def largest_plane(xyz: FloatArray, *, band: float, seed: int = 7) -> FloatArray:
    """Return the plane z = a + b X + c Y, nearly parallel to Z = 0, that holds most points.

    Parameters
    ----------
    xyz : ndarray, shape (n, 3)
    band : float
        Points this near count fully less their distance (a narrow face beats a vague heap).
    seed : int
        Of the random triples.
    """
    generator = np.random.default_rng(seed)
    sample = xyz[generator.choice(len(xyz), min(len(xyz), 6000), replace=False)]
    triples = generator.integers(0, len(sample), (3000, 3))
    corners = sample[triples]
    ones = np.ones((*corners.shape[:2], 1))
    design = np.concatenate([ones, corners[..., :2]], axis=2)
    area = np.linalg.det(design)
    extent = np.ptp(sample[:, :2], axis=0).prod()
    wide = np.abs(area) > 0.02 * extent
    planes = np.linalg.solve(design[wide], corners[wide][..., 2:])[..., 0]
    planes = planes[np.abs(planes[:, 1:]).max(axis=1) < STEEPEST]
    planes = np.concatenate([np.zeros((1, 3)), planes])
    lifted = np.column_stack([np.ones(len(sample)), sample[:, :2]])
    scores = [
        np.maximum(1 - np.abs(sample[:, 2] - lifted @ plane) / band, 0).sum() for plane in planes
    ]
    return refitted(sample, planes[int(np.argmax(scores))], band=band)


def refitted(xyz: FloatArray, plane: FloatArray, *, band: float) -> FloatArray:
    """Return the plane fitted to the points within a band of an approximate one."""
    lifted = np.column_stack([np.ones(len(xyz)), xyz[:, :2]])
    for _ in range(3):
        near = np.abs(xyz[:, 2] - lifted @ plane) < band
        if near.sum() < 3:
            break
        plane = np.linalg.lstsq(lifted[near], xyz[near, 2], rcond=None)[0]
    return np.asarray(plane)


def _grid(problem: Problem, solution: Solution) -> tuple[FloatArray, float]:
    """Return plane positions over what both photos show, and their spacing. [m]"""
    ties = problem.tie1[problem.tie_used]
    ties = radial_shift(ties, problem.interiors[0], solution.radial[0])
    seen = ray_on_plane(solution.cameras[0], ties)[:, :2]
    low, high = np.nanpercentile(seen, [1, 99], axis=0)
    gsd = float(np.sqrt(np.prod(high - low) / AREA))
    x = np.arange(low[0], high[0], gsd)
    y = np.arange(high[1], low[1], -gsd)
    return np.stack(np.meshgrid(x, y), axis=-1), gsd


def _pixels(problem: Problem, solution: Solution, xyz: FloatArray, number: int) -> FloatArray:
    """Return raw pixels of points, the estimated distortion undone by iteration."""
    ideal = project(solution.cameras[number], xyz)
    k = solution.radial[number]
    seen = ideal.copy()
    for _ in range(4 if k else 0):
        seen = seen + ideal - radial_shift(seen, problem.interiors[number], k)
    return raw_pixels(problem.interiors[number], seen)


def _rectified(
    problem: Problem, solution: Solution, image: ByteArray, grid: FloatArray, number: int
) -> ByteArray:
    """Return a photo on the plane, reduced without aliasing."""
    xyz = np.concatenate([grid, np.zeros((*grid.shape[:2], 1))], axis=-1)
    pixels = _pixels(problem, solution, xyz.reshape(-1, 3), number).reshape(grid.shape)
    steps = np.linalg.norm(np.diff(pixels, axis=1), axis=-1)
    reduction = max(1, round(float(np.nanmedian(steps))))
    if reduction > 1:
        image = cv2.blur(image, (reduction, reduction)).astype(np.uint8)
    maps = np.nan_to_num(pixels, nan=-10.0).astype(np.float32)
    return np.asarray(
        cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderValue=0),
        dtype=np.uint8,
    )


def _flow(first: ByteArray, second: ByteArray) -> FloatArray:
    """Return the flow from the far to the near rectified photo. [px]"""
    equal = cv2.createCLAHE(2.0, (8, 8))
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    return np.asarray(flow.calc(equal.apply(first), equal.apply(second), None), dtype=np.float64)


def _trusted(
    first: ByteArray, second: ByteArray, flow: FloatArray, grid: FloatArray, centre: FloatArray
) -> np.ndarray:
    """Return where the flow is along the radius, far from the centre, on something visible."""
    away = grid - centre
    # Picture rows run against Y.
    away = away * np.array([1.0, -1.0])
    radius = np.linalg.norm(away, axis=-1)
    across = np.abs(flow[..., 0] * away[..., 1] - flow[..., 1] * away[..., 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        straight = across / radius < 0.5
    size = np.linalg.norm(grid[0, 0] - grid[-1, -1])
    shown = cv2.erode(np.minimum(first, second), np.ones((9, 9), np.uint8)) > 0
    return straight & (radius > 0.12 * size) & shown
