"""Whether the wall is bent: what refraction and a wrong lens do, and epipolar lines do not show.

Radial distortion and flat refracting surfaces move the points of coaxial photos along their own
epipolar lines, so every tie fits. But the wall, a plane, is then no plane between the photos.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from bifocal.model import MOST_BENT, apply_homography, shape_is_certain
from bifocal.orientation.adjustment.observed_points import views_of
from bifocal.orientation.adjustment.pair_adjustment import AdjustedPair
from bifocal.orientation.adjustment.pair_observations import PairUnknowns
from bifocal.orientation.tuning import BEND, WALLS
from bifocal.orientation.walls.reference_plane import faces
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.camera import project
from photocore.errors import GeometryError


class WallShape(NamedTuple):
    """How far a wall is from a plane between the photos, and its standard deviation.

    Attributes
    ----------
    px, sigma : float
        At 3000 px of width; NaN where too few ties tell. [px]
    """

    px: float = float("nan")
    sigma: float = float("nan")

    @property
    def is_certain(self) -> bool:
        """Whether the model does not fit, beyond what the wall's own unevenness explains."""
        return shape_is_certain(self.px, self.sigma)


def wall_shape(
    pixels1: FloatArray, pixels2: FloatArray, size: tuple[int, int], face: BoolArray | None = None
) -> tuple[WallShape, float]:
    """Return how far the wall between two photos is from a plane, and how many ties say so.

    Parameters
    ----------
    pixels1, pixels2 : ndarray, shape (n, 2)
        Ties, straightened by the lenses as far as they are known. [px]
    size : tuple of int
        Width and height of photo 1. [px]
    face : ndarray of bool, shape (n,), optional
        The ties asked; default all. The bend counts over the area of all.

    Returns
    -------
    bend : WallShape
        Root mean square distance of ``x2 = H (x1 (1 + k rho²))`` from its best homography; NaN with
        fewer than 30 ties.
    held : float
        Ties that lie on that surface.

    Notes
    -----
    rho is the radius about the photo's middle over half the diagonal. Robust fits (biweight of
    shrinking width) from two homographies and five bends, of a face from none; the one of most
    support counts. The
    standard deviation of k takes the ties of a cell as one: a wall's unevenness is common to them.
    """
    unit = max(size) / 3000.0
    rows = np.flatnonzero(np.ones(len(pixels1), dtype=bool) if face is None else face)
    if len(rows) < 30:
        return WallShape(), 0.0
    some = rows[np.linspace(0, len(rows) - 1, min(len(rows), BEND.ties)).astype(int)]
    middle, half = (np.array(size) - 1) / 2.0, float(np.hypot(*size)) / 2
    everywhere = (pixels1 - middle) / half
    x1, x2 = everywhere[some], pixels2[some]
    square = (x1**2).sum(axis=1)
    held, answer = -1.0, WallShape()
    for start in (0.0, -0.06, -0.03, 0.03, 0.06) if face is None else (0.0,):
        bent = x1 * (1.0 + start * square[:, None])
        for width in (1.5, 6.0):
            cv2.setRNGSeed(7)
            matrix, _ = cv2.findHomography(bent, x2, cv2.USAC_MAGSAC, width * unit, maxIters=500)
            if matrix is None:
                continue
            fitted, k, sigma, support = _fitted(x1, x2, matrix, start, unit)
            if support <= held:
                continue
            held = support
            radii = (everywhere**2).sum(axis=1, keepdims=True)
            mapped = apply_homography(fitted, everywhere * (1.0 + BEND.small * radii))
            flat, _ = cv2.findHomography(everywhere, mapped, 0)
            apart = np.linalg.norm(mapped - apply_homography(flat, everywhere), axis=1)
            by_k = float(np.sqrt((apart**2).mean())) / unit / BEND.small
            answer = WallShape(abs(k) * by_k, sigma * by_k)
    return answer, held * len(rows) / len(some)


def shape_of_wall(
    pixels1: FloatArray, pixels2: FloatArray, size: tuple[int, int], height: FloatArray
) -> WallShape:
    """Return how far the wall is from a plane, as far as the ties of one face tell.

    Parameters
    ----------
    pixels1, pixels2, size
        As of `wall_shape`.
    height : ndarray, shape (n,)
        Of the ties over the reference plane, as a share of the far distance; NaN where unknown.

    Returns
    -------
    WallShape
        That of the fullest face parallel to the reference plane, if it holds as many ties as a
        bent surface through all of them: two faces look like one bent wall. Else of all ties.
    """
    whole, held = wall_shape(pixels1, pixels2, size)
    finite = np.flatnonzero(np.isfinite(height))
    finite = finite[:: len(finite) // BEND.ties + 1]
    further = faces(height[finite], pixels1[finite], band=WALLS.face_band)[: BEND.most_faces]
    near = [
        np.abs(height - offset) < BEND.band for offset in (0.0, *(face.offset for face in further))
    ]
    shapes = [
        wall_shape(pixels1, pixels2, size, face)
        for face in near
        if face.sum() >= BEND.fewest_on_face
    ]
    bend, most = max(shapes, key=lambda one: one[1], default=(whole, 0.0))
    return bend if most >= BEND.face_holds * held else whole


def shape_between(
    state: PairUnknowns, pixels1: FloatArray, pixels2: FloatArray, used: BoolArray,
    size: tuple[int, int],
) -> WallShape:  # fmt: skip
    """Return how far the wall is from a plane between photos, freed of refraction where it is.

    Parameters
    ----------
    state : PairUnknowns
        Cameras and media; through media an `AdjustedPair`.
    pixels1, pixels2 : ndarray, shape (n, 2)
        Ties, free of the lenses' distortion. [px]
    used : ndarray of bool, shape (n,)
        Those that are asked.
    size : tuple of int
        Width and height of photo 1. [px]

    Returns
    -------
    WallShape
        As of `shape_of_wall`; NaN too where it is no more than cameras and media, as uncertain as
        they are, leave open. [px, at 3000 px of width]
    """
    height = state.media.meeting(state.cameras, pixels1, pixels2)[:, 2] / state.cameras[0].centre[2]
    flat1, flat2 = straightened(state, pixels1, pixels2)
    if state.media:
        used = used & np.isfinite(np.hstack([flat1, flat2])).all(axis=1)
    if used.sum() < 30:
        return WallShape()
    bend = shape_of_wall(flat1[used], flat2[used], size, height[used])
    if isinstance(state, AdjustedPair) and state.media:
        return bend if bend.px > BEND.beyond * _open(state, size) else WallShape()
    return bend


def straightened(
    state: PairUnknowns, pixels1: FloatArray, pixels2: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where ideal pixels would lie if the media did not bend what lies on the plane, (n, 2).

    Between photos of a wall freed of refraction the wall is a plane again.
    """
    if not state.media:
        return pixels1, pixels2
    first, second = (
        project(camera, state.media.on_plane(number, camera, pixels))
        for number, (camera, pixels) in enumerate(
            zip(state.cameras, (pixels1, pixels2), strict=True)
        )
    )
    return first, second


def _open(adjusted: AdjustedPair, size: tuple[int, int]) -> float:
    """Return how much the uncertainty of cameras and media bends a flat wall, root mean square."""
    columns, rows = np.meshgrid(np.linspace(0, size[0], 12), np.linspace(0, size[1], 8))
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    flat = adjusted.media.on_plane(0, adjusted.cameras[0], pixels)
    seen1, seen2 = (view.pixels for view in views_of(adjusted, flat))
    values, vectors = np.linalg.eigh(adjusted.of_unknowns)
    factor = vectors * np.sqrt(np.maximum(values, 0.0))
    squares = []
    for draw in np.random.default_rng(7).normal(size=(BEND.draws, len(values))):
        try:
            state = adjusted.stepped(factor @ draw)
        except GeometryError:
            continue
        flat1, flat2 = straightened(state, seen1, seen2)
        finite = np.isfinite(np.hstack([flat1, flat2])).all(axis=1)
        if finite.sum() < 12:
            continue
        matrix, _ = cv2.findHomography(flat1[finite], flat2[finite], 0)
        apart = flat2[finite] - apply_homography(matrix, flat1[finite])
        squares.append(float((apart**2).sum(axis=1).mean()))
    return float(np.sqrt(np.mean(squares))) / (max(size) / 3000.0) if squares else 0.0


def _fitted(
    x1: FloatArray, x2: FloatArray, matrix: FloatArray, k: float, unit: float
) -> tuple[FloatArray, float, float, float]:
    """Return homography, k, its sigma and the support of the robust x2 = H (x1 (1 + k rho²))."""
    square = (x1**2).sum(axis=1)
    cell = np.unique(np.floor(x1 / BEND.cell), axis=0, return_inverse=True)[1].ravel()
    matrix = matrix / matrix[2, 2]
    for width in np.repeat(BEND.widths, 2) * unit:
        bent = np.column_stack([x1 * (1.0 + k * square[:, None]), np.ones(len(x1))])
        carried = bent @ matrix.T
        mapped = carried[:, :2] / carried[:, 2:]
        rest = x2 - mapped
        distance = (rest**2).sum(axis=1) / (3.0 * width) ** 2
        weight = np.where(distance < 1.0, (1.0 - distance) ** 2, 0.0)
        by = np.zeros((len(x1), 2, 9))
        by[:, 0, :3] = by[:, 1, 3:6] = bent / carried[:, 2:]
        by[:, :, 6:8] = -mapped[:, :, None] * (bent[:, None, :2] / carried[:, 2:, None])
        by_bent = (matrix[None, :2, :2] - mapped[:, :, None] * matrix[2, :2]) / carried[:, 2:, None]
        by[:, :, 8] = (by_bent @ (x1 * square[:, None])[:, :, None])[:, :, 0]
        rows, root = by.reshape(-1, 9), np.repeat(weight, 2)
        normal = (rows * root[:, None]).T @ rows
        pulls = (rows * (root * rest.ravel())[:, None]).reshape(-1, 2, 9).sum(axis=1)
        right = pulls.sum(axis=0)
        normal[8, 8] += (unit / BEND.sigma) ** 2
        right[8] -= k * (unit / BEND.sigma) ** 2
        step = np.linalg.lstsq(normal, right, rcond=None)[0]
        matrix = matrix + np.append(step[:8], 0.0).reshape(3, 3)
        k += float(step[8])
    apart = np.zeros((cell.max() + 1, 9))
    np.add.at(apart, cell, pulls)
    of_k = np.linalg.pinv(normal)[8]
    return matrix, k, float(np.linalg.norm(apart @ of_k)), float(weight.sum())


def shape_in_words(
    bend: WallShape, *, with_lens: bool, through_media: bool = False, left_out: bool = False,
    tape: bool = False,
) -> str:  # fmt: skip
    """Return the warning that the model does not fit; empty if the wall is flat enough.

    Parameters
    ----------
    bend : WallShape
    with_lens : bool
        Whether the lens was calibrated, or estimated from the photos.
    through_media : bool
        Whether the pair was set up through media, and the ties are freed of their refraction.
    left_out : bool
        Whether control points that no camera fits were left out.
    tape : bool
        Whether a distance measured on site is contradicted.
    """
    if not bend.is_certain:
        return ""
    lens = "lens_known" if with_lens else "certain_lens"
    cause = "tape" if tape else "media" if through_media else lens
    reason = remark(f"orientation.reason_{cause}")
    return remark(
        "orientation.bent", px=bend.px, sigma=bend.sigma, most=MOST_BENT, reason=reason,
        control=remark(f"orientation.control_{'left_out' if left_out else 'kept'}"),
    )  # fmt: skip
