"""Two photos set up against each other: common points, the dominant plane, both cameras.

Nothing but the photos and what is known of the lenses; the scale is one unit of far distance. What
the photos cannot give is refused with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bifocal.matching import (
    Features,
    alike,
    drop_repeated,
    match_along_lines,
    match_features,
    spread_evenly,
)
from bifocal.model import Cameras, Interiors, apply_homography
from bifocal.orientation.tuning import TIES
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import Pinhole, fundamental, homogeneous, triangulate
from photocore.errors import GeometryError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ties:
    """Common points of two photos.

    Attributes
    ----------
    pixels1, pixels2 : ndarray, shape (m, 2)
        Ideal pixels, freed of the distortion scanned too.
    seen1, seen2 : ndarray, shape (m, 2)
        Pixels freed of the lens file's distortion alone.
    homography : ndarray, shape (3, 3)
        Photo 2 from photo 1 over the dominant plane.
    on_plane : ndarray of bool, shape (m,)
    tolerance : float
        Precision the points were judged with. [px]
    radial : float
        Distortion k1 of the unknown lens, as scanned.
    """

    pixels1: FloatArray
    pixels2: FloatArray
    seen1: FloatArray
    seen2: FloatArray
    homography: FloatArray
    on_plane: BoolArray
    tolerance: float
    radial: float = 0.0

    @property
    def parallax(self) -> FloatArray:
        """How far the points leave the plane in photo 2, shape (m,). [px]"""
        on_plane = apply_homography(self.homography, self.pixels1)
        return np.linalg.norm(self.pixels2 - on_plane, axis=1)

    def fewer(self, most: int) -> Ties:
        """Return no more than so many of the points, spread evenly over their order."""
        count = len(self.seen1)
        some = np.linspace(0, count - 1, min(count, most)).astype(int)
        each = ("pixels1", "pixels2", "seen1", "seen2", "on_plane")
        return replace(self, **{name: getattr(self, name)[some] for name in each})


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surrounding:
    """Where in photo 2 partners are sought, on a wall that repeats itself.

    Attributes
    ----------
    homography : ndarray, shape (3, 3)
        Photo 2 from photo 1 over the wall.
    reach : float
        Farthest from there. [px]
    """

    homography: FloatArray
    reach: float


def find_ties(
    first: Features,
    second: Features,
    interiors: Interiors,
    names: tuple[str, str],
    surrounding: Surrounding | None = None,
) -> Ties:
    """Match features and keep those that obey one epipolar geometry and have support.

    Nearest neighbours give the geometry, a second search along its lines most of the ties; a tie
    stays if its neighbours move like it against the dominant plane (`supported`). Where the lens
    is unknown, its distortion is scanned first. Partners lie within ``surrounding``, if that is
    given.

    Raises
    ------
    GeometryError
        If the photos have too little in common, or no dominant plane.
    """
    rows1, rows2, radial = _neighbours(first, second, interiors, surrounding)
    straight = [
        replace(f, pixels=i.radial(radial).undistort(i.ideal(f.pixels)))
        for f, i in zip((first, second), interiors, strict=True)
    ]
    tolerance = _tolerance(first, second, interiors)
    x1, x2 = straight[0].pixels[rows1], straight[1].pixels[rows2]
    agree, matrix = _one_geometry(x1, x2, tolerance)
    count = int(agree.sum())
    if count < TIES.fewest_matches or count < 0.08 * len(x1):
        raise GeometryError(
            f"{names[0]} and {names[1]} have too little in common ({count} matching details of "
            f"{min(len(first.pixels), len(second.pixels))}): they show different walls, or one is "
            "blurred, or they were taken from very different directions. Check that both show the "
            "same wall."
        )
    homography, _ = _dominant_plane(x1[agree], x2[agree], 1.5 * tolerance, 8000)
    if matrix is not None:
        reach = TIES.along * float(np.ptp(straight[1].pixels[:, 0]))
        reach = reach if surrounding is None else surrounding.reach
        rows1, rows2 = _along_lines(straight[0], straight[1], matrix, homography, tolerance, reach)
    else:
        rows1, rows2 = rows1[agree], rows2[agree]
    x1, x2 = straight[0].pixels[rows1], straight[1].pixels[rows2]
    width = max(interiors[0].image_size)
    kept = np.flatnonzero(drop_repeated(x1, x2))
    kept = kept[supported(x1[kept], x2[kept] - apply_homography(homography, x1[kept]), width)]
    if len(kept) < TIES.fewest_matches:
        kept = np.arange(len(x1))
    # Strongest first: rank serves as precision.
    shape = interiors[0].image_size[::-1]
    kept = kept[spread_evenly(x1[kept], rows1[kept].astype(np.float64), shape, TIES.most)]
    x1, x2, rows1, rows2 = x1[kept], x2[kept], rows1[kept], rows2[kept]
    homography, on_plane = _dominant_plane(x1, x2, 1.5 * tolerance, 8000)
    count = len(x1)
    if on_plane.sum() < max(TIES.fewest_on_plane * count, 20):
        raise GeometryError(remark("align.no_plane", some=int(on_plane.sum()), count=count))
    return Ties(
        pixels1=x1,
        pixels2=x2,
        seen1=interiors[0].ideal(first.pixels[rows1]),
        seen2=interiors[1].ideal(second.pixels[rows2]),
        homography=homography,
        on_plane=on_plane,
        tolerance=tolerance,
        radial=radial,
    )


def _tolerance(first: Features, second: Features, interiors: Interiors) -> float:
    """Return how far from its line a tie may lie. [px]"""
    tolerance = 1.5 * max(first.reduction, second.reduction)
    # An unknown distortion, scanned in steps, leaves some pixels of bend.
    if max(interior.sigma_radial for interior in interiors) > 0:
        tolerance = max(tolerance, 0.001 * max(interiors[0].image_size))
    return tolerance


def _within(
    first: Features, second: Features, interiors: Interiors, surrounding: Surrounding
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return nearest neighbours among the features of a surrounding, square by square."""
    reach = surrounding.reach
    predicted = apply_homography(surrounding.homography, interiors[0].ideal(first.pixels))
    places = interiors[1].ideal(second.pixels)
    squares, of_square = np.unique(np.floor(predicted / reach), axis=0, return_inverse=True)
    pairs = [np.zeros((2, 0), np.intp)]
    for number, corner in enumerate(squares * reach):
        rows1 = np.flatnonzero(of_square.ravel() == number)
        rows2 = np.flatnonzero(((places > corner - reach) & (places < corner + 2 * reach)).all(1))
        one, two = match_features(first.of(rows1), second.of(rows2))
        pairs.append(np.stack([rows1[one], rows2[two]]))
    rows1, rows2 = np.concatenate(pairs, axis=1)
    near = np.linalg.norm(places[rows2] - predicted[rows1], axis=1) < reach
    return rows1[near], rows2[near]


def _neighbours(
    first: Features, second: Features, interiors: Interiors, surrounding: Surrounding | None
) -> tuple[NDArray[np.intp], NDArray[np.intp], float]:
    """Return nearest neighbours: of the strongest features, or of all; the distortion scanned."""
    for count in (TIES.first_tried, max(len(first.pixels), len(second.pixels))):
        some = first.strongest(count), second.strongest(count)
        if surrounding is None:
            rows1, rows2 = match_features(*some)
        else:
            rows1, rows2 = _within(*some, interiors, surrounding)
        ideal = interiors[0].ideal(first.pixels[rows1]), interiors[1].ideal(second.pixels[rows2])
        keep = drop_repeated(*ideal)
        rows1, rows2, ideal = rows1[keep], rows2[keep], (ideal[0][keep], ideal[1][keep])
        radial = scanned_radial(*ideal, interiors)
        x1, x2 = (i.radial(radial).undistort(x) for i, x in zip(interiors, ideal, strict=True))
        agree, _ = _one_geometry(x1, x2, _tolerance(first, second, interiors))
        if agree.sum() >= TIES.enough or count >= max(len(first.pixels), len(second.pixels)):
            break
    return rows1, rows2, radial


def scanned_radial(x1: FloatArray, x2: FloatArray, interiors: Interiors) -> float:
    """Return the radial distortion k of one unknown lens that both photos fit best; 0 if known.

    Straightened by the right k, more points lie on epipolar lines; the truncated cost counts them.
    """
    if (
        not all(interior.sigma_radial > 0 for interior in interiors)
        or len(x1) < TIES.fewest_matches
    ):
        return 0.0
    some = np.linspace(0, len(x1) - 1, min(len(x1), 1500)).astype(int)
    x1, x2 = x1[some], x2[some]
    wide = TIES.truncated * max(max(interiors[0].image_size) / 3000, 0.3)
    costs = []
    trials = np.concatenate([[0.0], np.linspace(*TIES.scanned)])
    for k in trials:
        y1, y2 = (i.radial(k).undistort(x) for i, x in zip(interiors, (x1, x2), strict=True))
        cv2.setRNGSeed(7)
        matrix, _ = cv2.findFundamentalMat(y1, y2, cv2.USAC_MAGSAC, wide, 0.999, 2000)
        if matrix is None or matrix.shape != (3, 3):
            costs.append(np.inf)
            continue
        misfit = epipolar_distance(matrix, y1, y2)
        costs.append(float(np.minimum(misfit, 3 * wide).sum()))
    best = int(np.argmin(costs))
    return float(trials[best]) if costs[best] < TIES.believed * costs[0] else 0.0


def epipolar_distance(matrix: FloatArray, x1: FloatArray, x2: FloatArray) -> FloatArray:
    """Return the Sampson distance of matches from a fundamental matrix, shape (n,). [px]"""
    y1, y2 = homogeneous(x1), homogeneous(x2)
    line2, line1 = y1 @ matrix.T, y2 @ matrix
    length = np.sqrt((line2[:, :2] ** 2).sum(1) + (line1[:, :2] ** 2).sum(1))
    return np.abs((y2 * line2).sum(1)) / np.maximum(length, 1e-300)


def _along_lines(
    first: Features,
    second: Features,
    matrix: FloatArray,
    homography: FloatArray,
    tolerance: float,
    reach: float,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return features matched along the lines of a fundamental matrix, around the plane."""
    line = homogeneous(first.pixels) @ matrix.T
    length = np.hypot(line[:, 0], line[:, 1])[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = line[:, :2] / length
        predicted = apply_homography(homography, first.pixels)
        foot = (
            predicted
            - normal * ((predicted * normal).sum(axis=1) + line[:, 2] / length[:, 0])[:, None]
        )
    along = reach * np.column_stack([-normal[:, 1], normal[:, 0]])
    epipole = np.linalg.svd(matrix)[0][:, 2]
    scale = epipole[2] if abs(epipole[2]) > 1e-9 * np.abs(epipole[:2]).max() else 1e-9
    rows1, rows2 = match_along_lines(
        first, second, epipole[:2] / scale, (foot - along, foot + along), across=tolerance
    )
    same = alike(first, second, rows1, rows2)
    return rows1[same], rows2[same]


def supported(pixels: FloatArray, parallax: FloatArray, width: int) -> BoolArray:
    """Return which points move against the plane as at least two of their neighbours do.

    Parameters
    ----------
    pixels : ndarray, shape (n, 2)
        In photo 1. [px]
    parallax : ndarray, shape (n, 2)
        How far each is from where the plane puts it in photo 2. [px]
    width : int
        Of photo 1. [px]

    Notes
    -----
    A wrong tie may satisfy its epipolar line by chance, a surface is smooth: fifty wrong ties of
    2200 turned a relative orientation by 0.5 to 1.4 degrees, and its covariance did not show it.
    """
    count = min(TIES.neighbours + 1, len(pixels))
    if count < 2:
        return np.zeros(len(pixels), dtype=bool)
    near = cKDTree(pixels).query(pixels, count)[1][:, 1:]
    apart = np.linalg.norm(parallax[near] - parallax[:, None], axis=2)
    return np.asarray((apart < TIES.alike * width / 3000).sum(axis=1) >= TIES.supporters)


def _one_geometry(
    x1: FloatArray, x2: FloatArray, tolerance: float
) -> tuple[BoolArray, FloatArray | None]:
    """Return which matches obey one fundamental matrix or one homography, and the former."""
    if len(x1) < 8:
        return np.zeros(len(x1), dtype=bool), None
    cv2.setRNGSeed(7)
    _, on_plane = _dominant_plane(x1, x2, tolerance, 4000)
    matrix, mask = cv2.findFundamentalMat(x1, x2, cv2.USAC_MAGSAC, tolerance, 0.9999, 4000)
    if matrix is None or matrix.shape != (3, 3):
        return on_plane, None
    agree = mask.ravel().astype(bool)
    # A flat scene leaves F free: there the homography is the better witness.
    return (agree if agree.sum() > 1.1 * on_plane.sum() else agree | on_plane), matrix


def _dominant_plane(
    x1: FloatArray, x2: FloatArray, tolerance: float, iterations: int
) -> tuple[FloatArray, BoolArray]:
    """Return the dominant homography and its points."""
    matrix, mask = cv2.findHomography(
        x1, x2, cv2.USAC_MAGSAC, tolerance, maxIters=iterations, confidence=0.9999
    )
    if matrix is None:
        return np.eye(3), np.zeros(len(x1), dtype=bool)
    return np.asarray(matrix, dtype=np.float64), mask.ravel().astype(bool)


def plane_scale(ties: Ties, image_size: tuple[int, int]) -> float:
    """Return the scale of photo 2 against photo 1 on the plane, at its points' middle."""
    middle = np.median(ties.pixels1[ties.on_plane], axis=0)
    step = 0.01 * max(image_size)
    corners = middle + step * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
    moved = apply_homography(ties.homography, corners)
    area = abs(np.linalg.det(np.stack([moved[0] - moved[1], moved[2] - moved[3]])))
    return float(np.sqrt(area) / (2 * step))


def first_cameras(ties: Ties, interiors: Interiors) -> Cameras:
    """Return approximate cameras in the frame of the dominant plane, far distance 1.

    Notes
    -----
    The homography between calibrated photos is ``R + t nᵀ / d``: up to four decompositions. The one
    in which the common points lie in front of both cameras and on their epipolar lines is it.
    """
    matrices = [interior.matrix for interior in interiors]
    _, turns, shifts, normals = cv2.decomposeHomographyMat(
        np.linalg.inv(matrices[1]) @ ties.homography @ matrices[0], np.eye(3)
    )
    cameras = [
        _in_plane_frame(matrices, turn, sign * shift.ravel(), sign * normal.ravel())
        for turn, shift, normal in zip(turns, shifts, normals, strict=True)
        for sign in (1.0, -1.0)
    ]
    possible = [pair for pair in cameras if pair is not None]
    if not possible:
        raise GeometryError(remark("align.no_camera_in_front"))
    return min(possible, key=lambda pair: _cost(ties, pair))


def sought_focal(ties: Ties, interiors: Interiors) -> Interiors:
    """Return interiors with the one principal distance that the common points fit best.

    Notes
    -----
    What the homography of the wall says of the cameras' movement, points off the wall confirm at
    the right principal distance alone; the adjustment that follows refines it.
    """
    costs: list[tuple[float, Interiors]] = []
    for factor in TIES.focals:
        focal = factor * max(interiors[0].image_size)
        tried = replace(interiors[0], focal=focal), replace(interiors[1], focal=focal)
        try:
            costs.append((_cost(ties, first_cameras(ties, tried)), tried))
        except GeometryError:
            continue
    return min(costs, key=lambda one: one[0])[1] if costs else interiors


def _in_plane_frame(
    matrices: list[FloatArray], turn: FloatArray, shift: FloatArray, normal: FloatArray
) -> Cameras | None:
    """Return both cameras in a frame on the plane, Y as upright as photo 1 is."""
    if normal[2] <= 0.05:  # the plane must be in front of camera 1
        return None
    z_axis = -normal / np.linalg.norm(normal)
    up = np.array([0.0, -1.0, 0.0])
    y_axis = up - (up @ z_axis) * z_axis
    if np.linalg.norm(y_axis) < 0.1:
        return None
    y_axis /= np.linalg.norm(y_axis)
    rotation1 = np.stack([np.cross(y_axis, z_axis), y_axis, z_axis], axis=1)
    centre1 = np.array([0.0, 0.0, 1.0])
    centre2 = centre1 + rotation1.T @ (-turn.T @ shift)
    if centre2[2] <= 0.02:
        return None
    return (
        Pinhole(matrices[0], rotation1, centre1),
        Pinhole(matrices[1], turn @ rotation1, centre2),
    )


def _cost(ties: Ties, cameras: Cameras) -> float:
    """Return a robust cost: epipolar misfit, and points behind a camera."""
    line = homogeneous(ties.pixels1) @ fundamental(*cameras).T
    misfit = np.abs((homogeneous(ties.pixels2) * line).sum(1)) / np.maximum(
        np.hypot(line[:, 0], line[:, 1]), 1e-300
    )
    xyz = triangulate(*cameras, ties.pixels1, ties.pixels2)
    lowest = min(camera.centre[2] for camera in cameras)
    behind = ~(xyz[:, 2] < lowest) & ~ties.on_plane
    wide = 4 * ties.tolerance
    return float(np.minimum(np.nan_to_num(misfit, nan=wide), wide).sum() + wide * behind.sum())


def rotation_only(ties: Ties, interiors: Interiors) -> bool:
    """Return whether the photos differ only by turning and zooming the camera (no movement).

    The homography between calibrated photos taken from one place is a rotation, whatever they show.
    """
    matrices = [interior.matrix for interior in interiors]
    joined = np.linalg.inv(matrices[1]) @ ties.homography @ matrices[0]
    values = np.linalg.svd(joined, compute_uv=False)
    slack = 0.02 + 2 * float(np.hypot(interiors[0].sigma_focal, interiors[1].sigma_focal))
    return bool(values[0] / values[2] - 1 < slack)
