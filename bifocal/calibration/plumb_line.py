"""Radial distortion from lines that are straight in reality: the plumb-line method.

For those without a board: the edges of a façade, or points picked along them. Only the radial
terms follow; principal distance and principal point must be assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares

from bifocal.model import Lens
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray, as_points
from photocore.camera import camera_matrix
from photocore.errors import GeometryError, InputError

#: A line must be this share of the photo's width to tell anything of distortion.
LEAST_LENGTH = 0.15
#: Edge points more than this far off their line are not of it. [px]
EDGE_LIMIT = 1.5
#: As many of the longest edges are taken.
MOST_LINES = 80
#: A correction that leaves more than this of the lines' bend is none: on undistorted photos of a
#: church it left 80 to 100 %, with k1 up to 0.28 at a stated 0.03: real edges are not straight.
STRAIGHTENS = 0.8
#: Relative standard deviation of a principal distance from EXIF or data sheet, and of a guess.
GIVEN_FOCAL, GUESSED_FOCAL = 0.02, 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlumbLine:
    """Distortion found from straight lines.

    Attributes
    ----------
    lens : Lens
        Model ``opencv`` with k1, k2.
    sigma_k1, sigma_k2 : float
    rms_before, rms_after : float
        Straightness of the lines without and with the correction. [px]
    lines : int
        Lines used.
    """

    lens: Lens
    sigma_k1: float
    sigma_k2: float
    rms_before: float
    rms_after: float
    lines: int

    @property
    def straightens(self) -> bool:
        """Whether the correction makes the lines straighter by more than a fifth."""
        return self.rms_after <= STRAIGHTENS * self.rms_before

    def without_distortion(self) -> PlumbLine:
        """Return the lens as undistorted, for lines that ask for no correction."""
        source = f"plumb line, {self.lines} lines: no distortion shows; "
        source += "principal distance and point assumed"
        lens = replace(self.lens, coefficients=np.zeros(4), sigma0=self.rms_before, source=source)
        return replace(self, lens=lens)


def calibrate_from_lines(
    lines: Sequence[FloatArray], image_size: tuple[int, int], *, focal_px: float
) -> PlumbLine:
    """Return the radial distortion that makes the lines straight.

    Parameters
    ----------
    lines : sequence of ndarray, each of shape (n, 2), n >= 3
        Points along each line. [px]
    image_size : tuple of int
        Width and height. [px]
    focal_px : float
        Principal distance, from EXIF or data sheet; it only scales the coefficients. [px]

    Returns
    -------
    PlumbLine

    Raises
    ------
    InputError
        If fewer than three usable lines are given.
    GeometryError
        If the lines all pass through the middle of the photo: they stay straight whatever the
        distortion.

    Notes
    -----
    Minimised are the distances of the corrected points from the best straight line through them,
    robustly (soft L1), over k1 and k2 of ``x = x_d (1 + ...)``'s forward model; the principal
    point is taken in the middle of the photo.
    """
    width, height = image_size
    usable = [as_points(line, "line", dimension=2) for line in lines]
    usable = [line for line in usable if len(line) >= 3]
    if len(usable) < 3:
        raise InputError(remark("calibration.few_lines", count=len(usable)))
    # Unknowns in units of the half diagonal, so that the steps are of like size.
    share = 2 * focal_px / np.hypot(width, height)
    units = np.array([share**2, share**4])

    def lens_of(terms: FloatArray) -> Lens:
        """Return the lens with radial terms k1, k2."""
        matrix = camera_matrix(focal_px, 1.0, (width - 1) / 2, (height - 1) / 2)
        return Lens(
            camera_matrix=matrix, coefficients=np.array([*terms, 0.0, 0.0]), image_size=image_size
        )

    def straightness(scaled: FloatArray) -> FloatArray:
        """Return distances from the best lines, in undistorted pixels."""
        lens = lens_of(scaled * units)
        return np.concatenate([_off_line(lens.undistort(line)) for line in usable])

    solution = least_squares(straightness, np.zeros(2), loss="soft_l1", f_scale=0.5)
    rest = straightness(solution.x)
    freedom = max(len(rest) - 2 * len(usable) - 2, 1)
    normal = solution.jac.T @ solution.jac
    if np.linalg.cond(normal) > 1e12 or normal[0, 0] < 1e-6:
        raise GeometryError(remark("calibration.central_lines"))
    sigmas = np.sqrt(np.diag(np.linalg.inv(normal)) * (rest**2).sum() / freedom)
    before, after = (float(np.sqrt(np.mean(v**2))) for v in (straightness(np.zeros(2)), rest))
    lens = replace(
        lens_of(solution.x * units),
        sigma0=after,
        source=f"plumb line, {len(usable)} lines; principal distance and point assumed",
    )
    sigma_k1, sigma_k2 = (float(v) for v in sigmas * units)
    return PlumbLine(
        lens=lens, sigma_k1=sigma_k1, sigma_k2=sigma_k2, rms_before=before, rms_after=after,
        lines=len(usable),
    )  # fmt: skip


def find_straight_edges(image: ByteArray) -> list[FloatArray]:
    """Return points along long, nearly straight edges of a grey photo.

    Segments found by OpenCV's detector are joined where they continue each other, and their points
    are refined to the steepest grey-value change across the edge.

    Returns
    -------
    lines : list of ndarray, shape (n, 2)
        Longest first. [px]
    """
    blurred = cv2.GaussianBlur(image, (0, 0), 1.0)
    detected = cv2.createLineSegmentDetector().detect(blurred)[0]
    if detected is None:
        return []
    segments = np.asarray(detected, dtype=np.float64).reshape(-1, 2, 2)
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    least = LEAST_LENGTH * image.shape[1]
    segments = segments[length > least / 12]
    chains = _chains(segments, least)
    gradient_x = cv2.Sobel(blurred, cv2.CV_32F, 1, 0, ksize=3)
    gradient_y = cv2.Sobel(blurred, cv2.CV_32F, 0, 1, ksize=3)
    strength = cv2.magnitude(gradient_x, gradient_y)
    lines = [_refined_line(chain, strength) for chain in chains[:MOST_LINES]]
    return [line for line in lines if len(line) >= 8]


def _off_line(points: FloatArray) -> FloatArray:
    """Return signed distances of points from their best straight line."""
    middle = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(middle, full_matrices=False)
    off: FloatArray = middle @ axes[1]
    return off


def _chains(segments: FloatArray, least: float) -> list[FloatArray]:
    """Join segments that continue each other into chains of end points, longest first."""
    order = np.argsort(-np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1))
    free = np.ones(len(segments), dtype=bool)
    chains: list[tuple[float, FloatArray]] = []
    for index in order:
        if not free[index]:
            continue
        free[index] = False
        members = [index]
        grown = True
        while grown:
            ends = segments[members].reshape(-1, 2)
            middle = ends.mean(axis=0)
            axis = np.linalg.svd(ends - middle, full_matrices=False)[2][0]
            normal = np.array([-axis[1], axis[0]])
            span = (ends - middle) @ axis
            along = (segments - middle) @ axis
            across = np.abs((segments - middle) @ normal).max(axis=1)
            gap = np.maximum(along.min(axis=1) - span.max(), span.min() - along.max(axis=1))
            # A bend of 1 % of the length is strong barrel distortion; more is another edge.
            length = np.ptp(span)
            near = free & (across < 1.0 + 0.006 * length) & (gap > -2) & (gap < 0.15 * length)
            grown = bool(near.any())
            if grown:
                best = int(np.flatnonzero(near)[np.argmin(across[near])])
                free[best] = False
                members.append(best)
        length = float(np.ptp(span))
        if length >= least:
            chains.append((length, segments[members].reshape(-1, 2)))
    chains.sort(key=lambda item: -item[0])
    return [ends for _, ends in chains]


def _refined_line(ends: FloatArray, strength: FloatArray) -> FloatArray:
    """Return sub-pixel edge points along a chain, off-line points removed."""
    from scipy.ndimage import map_coordinates

    middle = ends.mean(axis=0)
    axis = np.linalg.svd(ends - middle, full_matrices=False)[2][0]
    normal = np.array([-axis[1], axis[0]])
    along, across = (ends - middle) @ axis, (ends - middle) @ normal
    bend = np.polyfit(along, across, 2 if len(ends) > 4 else 1)
    # Only where a segment was found: gaps between segments may be another object.
    pairs = np.sort(along.reshape(-1, 2), axis=1)
    stations = np.concatenate([np.arange(a, b, 4.0) for a, b in pairs])
    base = middle + np.outer(stations, axis) + np.outer(np.polyval(bend, stations), normal)
    shifts = np.arange(-3.0, 3.01, 0.5)
    samples = base[:, None, :] + shifts[None, :, None] * normal
    value = map_coordinates(strength, [samples[..., 1], samples[..., 0]], order=1, mode="nearest")
    peak = np.clip(value.argmax(axis=1), 1, len(shifts) - 2)
    rows = np.arange(len(value))
    left, top, right = value[rows, peak - 1], value[rows, peak], value[rows, peak + 1]
    curve = left - 2 * top + right
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(curve < 0, 0.5 * (left - right) / curve, 0.0)
    points = base + np.outer(shifts[peak] + 0.5 * part, normal)
    kept = (curve < 0) & (np.abs(part) <= 1)
    if kept.sum() < 8:
        return np.zeros((0, 2))
    offset = (points - middle) @ normal
    smooth = np.polyval(np.polyfit(stations[kept], offset[kept], 3), stations)
    return points[kept & (np.abs(offset - smooth) < EDGE_LIMIT)]
