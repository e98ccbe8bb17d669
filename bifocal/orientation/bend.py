"""Whether the wall is bent: what refraction and a wrong lens do, and epipolar lines do not show.

Radial distortion and flat refracting surfaces move the points of coaxial photos along their own
epipolar lines, so every tie fits. But the wall, a plane, is then no plane between the photos.
"""

from __future__ import annotations

import cv2
import numpy as np

from bifocal.model.homography import apply_homography
from photocore.arrays import FloatArray

#: A wall bent by more than this, at 3000 px of width, is not that of an honest pair. Of the ties on
#: the wall, two rendered façades reach 0.03 and 0.10 px, church_1, church_2 and berlin_1 0.04; the
#: rendered ones seen through half a metre of water in 17 m 0.22 and 0.43. Set after they were
#: seen. [px]
MOST_BENT = 0.2
#: The same of all ties: mouldings before the wall bend it too, six real clean pairs by up to 0.19
#: px, five rendered façades, whose ties crowd on mouldings, by 0.02 to 0.46; photos through a port
#: by 6.3 to 23, a water surface 2.9, by a distorting compact camera 0.44. [px]
MOST_BENT_WITH_RELIEF = 0.5
#: Beyond this it is refraction or a strong lens for certain; heights of ties say nothing. [px]
STRONGLY_BENT = 1.0
#: Ties of the wall lie within this share of the far distance from the reference plane; fewer say
#: nothing of its flatness.
BAND, FEWEST = 0.0025, 100
#: Residuals that count less and less, at 3000 px of width [px], and the prior of the bend.
WIDTHS, SIGMA_BEND = (8.0, 5.0, 3.0, 2.0, 1.5), 0.05
#: Ties used.
MOST_POINTS = 2500


def wall_bend(pixels1: FloatArray, pixels2: FloatArray, size: tuple[int, int]) -> float:
    """Return how far the wall between two photos is from a plane. [px, at 3000 px of width]

    Parameters
    ----------
    pixels1, pixels2 : ndarray, shape (n, 2)
        Ties, straightened by the lenses as far as they are known. [px]
    size : tuple of int
        Width and height of photo 1. [px]

    Returns
    -------
    float
        Root mean square distance, over the wall, of ``x2 = H (x1 (1 + k rho²))`` from its best
        homography; NaN with fewer than 30 ties.

    Notes
    -----
    rho is the radius about the photo's middle over half the diagonal. Robust fits (biweight of
    shrinking width) from three homographies and five bends; the one of most support counts.
    """
    unit = max(size) / 3000.0
    if len(pixels1) < 30:
        return float("nan")
    some = np.linspace(0, len(pixels1) - 1, min(len(pixels1), MOST_POINTS)).astype(int)
    middle, half = (np.array(size) - 1) / 2.0, float(np.hypot(*size)) / 2
    x1, x2 = (pixels1[some] - middle) / half, pixels2[some]
    square = (x1**2).sum(axis=1)
    best, answer = -1.0, float("nan")
    for start in (0.0, -0.06, -0.03, 0.03, 0.06):
        bent = x1 * (1.0 + start * square[:, None])
        for width in (1.5, 6.0):
            cv2.setRNGSeed(7)
            matrix, _ = cv2.findHomography(bent, x2, cv2.USAC_MAGSAC, width * unit, maxIters=500)
            if matrix is None:
                continue
            fitted, k, weight = _fitted(x1, x2, matrix, start, unit)
            if weight.sum() <= best:
                continue
            best = float(weight.sum())
            on = weight > 0.2
            seen = apply_homography(fitted, x1[on] * (1.0 + k * square[on, None]))
            flat, _ = cv2.findHomography(x1[on], seen, 0)
            apart = np.linalg.norm(seen - apply_homography(flat, x1[on]), axis=1)
            answer = float(np.sqrt((apart**2).mean())) / unit
    return answer


def bend_of_wall(
    pixels1: FloatArray, pixels2: FloatArray, size: tuple[int, int], height: FloatArray
) -> float:
    """Return how far the wall is from a plane, as far as its own ties tell.

    Parameters
    ----------
    pixels1, pixels2, size
        As of `wall_bend`.
    height : ndarray, shape (n,)
        Of the ties over the reference plane, as a share of the far distance; NaN where unknown.

    Returns
    -------
    float
        `wall_bend` of the ties near the plane; of all where that is strong, or where hardly any is
        near it and the bend is more than relief explains; else NaN. [px, at 3000 px of width]
    """
    whole = wall_bend(pixels1, pixels2, size)
    near = np.abs(height) < BAND
    if whole > STRONGLY_BENT:
        return whole
    if near.sum() < FEWEST:
        return whole if whole > MOST_BENT_WITH_RELIEF else float("nan")
    return wall_bend(pixels1[near], pixels2[near], size)


def _fitted(
    x1: FloatArray, x2: FloatArray, matrix: FloatArray, k: float, unit: float
) -> tuple[FloatArray, float, FloatArray]:
    """Return homography, bend and weights of the robust fit of x2 = H (x1 (1 + k rho²))."""
    square = (x1**2).sum(axis=1)
    weight = np.zeros(len(x1))
    matrix = matrix / matrix[2, 2]
    for width in np.repeat(WIDTHS, 3) * unit:
        bent = np.column_stack([x1 * (1.0 + k * square[:, None]), np.ones(len(x1))])
        carried = bent @ matrix.T
        seen = carried[:, :2] / carried[:, 2:]
        left = x2 - seen
        distance = (left**2).sum(axis=1) / (3.0 * width) ** 2
        weight = np.where(distance < 1.0, (1.0 - distance) ** 2, 0.0)
        by = np.zeros((len(x1), 2, 9))
        by[:, 0, :3] = by[:, 1, 3:6] = bent / carried[:, 2:]
        by[:, :, 6:8] = -seen[:, :, None] * (bent[:, None, :2] / carried[:, 2:, None])
        by_bent = (matrix[None, :2, :2] - seen[:, :, None] * matrix[2, :2]) / carried[:, 2:, None]
        by[:, :, 8] = (by_bent @ (x1 * square[:, None])[:, :, None])[:, :, 0]
        rows, root = by.reshape(-1, 9), np.repeat(weight, 2)
        normal = (rows * root[:, None]).T @ rows
        right = rows.T @ (root * left.ravel())
        normal[8, 8] += (unit / SIGMA_BEND) ** 2
        right[8] -= k * (unit / SIGMA_BEND) ** 2
        step = np.linalg.lstsq(normal, right, rcond=None)[0]
        matrix = matrix + np.append(step[:8], 0.0).reshape(3, 3)
        k += float(step[8])
    return matrix, k, weight


def bend_in_words(
    bend: float, *, with_lens: bool, through_media: bool = False, left_out: bool = False
) -> str:
    """Return the warning that the model does not fit; empty if the wall is flat enough.

    Parameters
    ----------
    bend : float
        From `wall_bend`. [px]
    with_lens : bool
        Whether the lens was calibrated, or estimated from the photos.
    through_media : bool
        Whether the pair was set up through media, and the ties are freed of their refraction.
    left_out : bool
        Whether control points that no camera fits were left out.
    """
    if not bend > MOST_BENT:
        return ""
    sure = "" if bend > STRONGLY_BENT else " probably"
    reason = (
        "refraction (photos taken through glass or water: give --indices with --port or --depth), "
        "a lens file of another camera or focus, or wrong distances"
        if with_lens
        else "lens distortion (calibrate with `bifocal calibrate`, give --lens), or refraction "
        "(photos taken through glass or water: give --indices with --port or --depth)"
    )
    if through_media:
        reason = (
            "that the media are not as given (--indices in their order from the camera to the "
            "wall, --thicknesses, --port for glass that moves with the camera, --depth for what "
            "stays with the wall), or lens distortion (--lens)"
        )
    return (
        f"THE MODEL DOES NOT FIT: between the photos the wall is bent by {bend:.2f} px (an honest "
        f"pair: at most {MOST_BENT:g}). The likely reason is{sure} {reason}. Relief may be wrong "
        "by many times its stated precision, although every point lies on its line; "
        + (
            "control points that fit no camera were left out, but may be good."
            if left_out
            else "no control point was left out for it."
        )
    )
