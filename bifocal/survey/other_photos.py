"""A third photo and more beside an ideal pair: relief of every pair, and of all photos together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bifocal.equations import relief
from bifocal.model import FlagLimits
from bifocal.precision import sigma_relief
from bifocal.survey.observations import PointObservations
from bifocal.survey.setup import OtherPhoto, SurveySetup
from photocore.arrays import FloatArray

#: Most photos of one workbook.
MOST_PHOTOS = 6
#: Turns of Gauss-Newton, as `bifocal.model.set_intersection` makes.
TURNS = 4
#: Columns that all photos together give.
OF_ALL = ("r_all", "sigma_all", "X_all", "Y_all", "chance")
#: Misfits that fewer honest points in all have, both sides, are a wrong pick.
CHANCE = math.erfc(FlagLimits().redundant / math.sqrt(2.0))


def is_of_others(key: str) -> bool:
    """Tell whether a column is one that `of_all_photos` returns."""
    return key in OF_ALL or key.startswith(("r_1_", "sigma_1_"))


class _PlanePositions(NamedTuple):
    """Where photos see points on the wall [m], what each place weighs; shape (n, photos)."""

    x: FloatArray
    y: FloatArray
    weight: FloatArray
    distances: FloatArray
    scales: FloatArray


def of_all_photos(setup: SurveySetup, points: PointObservations) -> dict[str, FloatArray]:
    """Solve points that were measured in the pair of a set-up and in other photos.

    Parameters
    ----------
    setup : SurveySetup
    points : PointObservations
        As typed, ``other_xy`` in the photos of ``setup.others``.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        ``r_1_3 sigma_1_3`` ... of photo 1 with each other one, ``r_all sigma_all X_all Y_all`` of
        three rays and more [m], and ``chance``: the share of honest points that miss as much.

    Notes
    -----
    Of photos 1 and k relief is that of Eq. (6), of the radii on the wall. Of all, the point
    ``(X, Y, r)`` is that of `bifocal.PhotoSet.intersect`: least squares of where the rays meet the
    wall, ``(X, Y) t`` with ``t = d / (d - r)``, weighted by the precision of the picks there. A
    photo counts once, in however many pairs. With X, Y eliminated a turn of Gauss-Newton is a
    quotient of sums over the photos, which a cell can hold.
    """
    positions = _on_wall(setup, points)
    columns: dict[str, FloatArray] = {}
    for k in range(3, positions.x.shape[1] + 1):
        relief_and_sigma = _of_pair(positions, k - 1, setup.precision)
        columns |= dict(zip((f"r_1_{k}", f"sigma_1_{k}"), relief_and_sigma, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        return columns | _together(positions, setup.precision)


def _on_wall(setup: SurveySetup, points: PointObservations) -> _PlanePositions:
    """Return where all photos see the points on the wall."""
    taking, measured = setup.taking, setup.in_millimetres(points)
    unit, _ = setup.typed_frame(1)
    enlargement1, enlargement2 = taking.enlargements
    pair = (
        OtherPhoto(d=taking.d1, c=taking.c1, enlargement=enlargement1),
        OtherPhoto(d=taking.d2, c=taking.c2, enlargement=enlargement2),
    )
    photos = (*pair, *setup.others)
    picks = [measured.xy1, measured.xy2]
    for photo, typed in zip(setup.others, points.other_xy.transpose(1, 0, 2), strict=True):
        nadir = photo.nadir if setup.unit == "px" else None
        picks.append((typed - (nadir or (0.0, 0.0))) * unit)
    scales = np.array([photo.scale for photo in photos])
    wall = np.stack(picks, axis=1) * scales[:, None]
    wall[np.isnan(wall).any(axis=2)] = np.nan
    weight = np.where(np.isnan(wall[..., 0]), np.nan, scales**-2.0)
    distances = np.array([photo.d or np.nan for photo in photos])
    return _PlanePositions(wall[..., 0], wall[..., 1], weight, distances, scales)


def _of_pair(
    positions: _PlanePositions, photo: int, precision: float
) -> tuple[FloatArray, FloatArray]:
    """Return relief by the first photo and another, and its sigma."""
    d, radii = positions.distances, np.hypot(positions.x, positions.y)
    far, near = (0, photo) if d[0] > d[photo] else (photo, 0)
    if not d[far] > d[near]:
        blank = np.full(len(radii), np.nan)
        return blank, blank
    s1, s2, d1, d2 = radii[:, far], radii[:, near], d[far], d[near]
    sigma_1, sigma_2 = precision * positions.scales[far], precision * positions.scales[near]
    sigma = sigma_relief(s1, s2, d1=d1, d2=d2, sigma_1=sigma_1, sigma_2=sigma_2)
    return relief(s1, s2, d1=d1, d2=d2), sigma


def _together(positions: _PlanePositions, precision: float) -> dict[str, FloatArray]:
    """Return the points by all rays."""
    x, y, w, d, _ = positions

    def total(values: FloatArray) -> FloatArray:
        return np.asarray(np.nansum(w * values, axis=1))

    count = (~np.isnan(w)).sum(axis=1)
    squares, weight = x**2 + y**2, total(np.ones_like(x))
    lean_x, lean_y = total(x / d), total(y / d)
    r = (total(squares / d) - (total(x) * lean_x + total(y) * lean_y) / weight) / (
        total(squares / d**2) - (lean_x**2 + lean_y**2) / weight
    )
    r = np.where((count > 2) & np.isfinite(r), r, np.nan)
    for turn in range(TURNS + 1):
        t = d / (d - r[:, None])
        rate, across = t**2 / d, total(t**2)
        at_x, at_y = total(t * x) / across, total(t * y) / across
        lever = (at_x**2 + at_y**2) * (total(rate**2) - total(t * rate) ** 2 / across)
        miss_x, miss_y = x - at_x[:, None] * t, y - at_y[:, None] * t
        if turn < TURNS:
            r = r + (at_x * total(rate * miss_x) + at_y * total(rate * miss_y)) / lever
    # NaN of distances, of photos that did not see the point, tells nothing.
    behind = ~np.isnan(w) & ~(r[:, None] < d)
    kept = np.isfinite(r) & ~behind.any(axis=1)
    chance = _chance(total(miss_x**2 + miss_y**2) / precision**2, 2 * count - 3)
    columns = (r, precision / np.sqrt(lever), at_x, at_y, chance)
    return {
        key: np.where(kept, values, np.nan) for key, values in zip(OF_ALL, columns, strict=True)
    }


def _chance(squares: FloatArray, redundant: FloatArray) -> FloatArray:
    """Return how likely such misfits are by chance alone."""
    from scipy.stats import chi2  # late: a survey of pairs does without scipy

    return np.asarray(chi2.sf(squares, np.maximum(redundant, 1)))


def contradictions(ids: Sequence[str], chance: FloatArray) -> list[str]:
    """Return the points whose picks contradict each other, least likely first."""
    return [ids[i] for i in np.argsort(chance) if chance[i] < CHANCE]
