"""The same details of the wall in all photos of a set: the best pair's, found in the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bifocal.matching.matching import MatchSettings, match_pair, precision, raw_metres
from bifocal.matching.patches import refine, same_scale
from bifocal.matching.tuning import MATCH
from bifocal.model import PhotoSet, SetIntersection
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray
from photocore.errors import GeometryError
from photocore.tables import write_csv

#: Two photos of a set by their numbers to their grey values, shape (h, w), uint8.
Greys = Callable[[int, int], tuple[ByteArray, ByteArray]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SetMatches:
    """Homologous points of a set of m photos.

    Attributes
    ----------
    pixels : ndarray, shape (m, n, 2)
        Raw pixels in each photo, in the order of the set; NaN where a point was not found. [px]
    sigma_px : float
        Precision of a pick. [px]
    ids, kinds : tuple of str, length n
        As of `bifocal.Matches`.
    points : SetIntersection
        Where they are, and how precisely.
    """

    pixels: FloatArray
    sigma_px: float
    ids: tuple[str, ...]
    kinds: tuple[str, ...]
    points: SetIntersection

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write the points as a text table that ``bifocal solve --pair`` takes."""
        numbers = range(1, len(self.pixels) + 1)
        heads = [f"{axis}{number} [px]" for number in numbers for axis in ("col", "row")]
        picks = np.concatenate([pixels.T for pixels in self.pixels])
        columns = {"id": list(self.ids), **dict(zip(heads, picks, strict=True))}
        formats = dict.fromkeys(heads, ".4f")
        write_csv(path, {**columns, "code": list(self.kinds)}, formats=formats, overwrite=overwrite)


def match_set(photos: PhotoSet, greys: Greys, settings: MatchSettings | None = None) -> SetMatches:
    """Return homologous points of the best pair of a set, with their places in the other photos.

    Parameters
    ----------
    photos : PhotoSet
    greys : callable
        Numbers of two photos to their grey values; called for one pair after the other.
    settings : MatchSettings, optional

    Raises
    ------
    GeometryError
        If no two photos promise relief, or hardly anything matches.

    Notes
    -----
    The pair tells where a point is, and so where another photo shows it and how its surroundings
    are seen there; the patch is then fitted in both directions. A pick that the rays of the others
    contradict (`SetIntersection.suspects`) is left out.
    """
    ranked = photos.pairs()
    if not ranked:
        raise GeometryError(remark("photo_set.no_pair"))
    far, near = ranked[0].far, ranked[0].near
    pair = photos.pair(far, near)
    matches = match_pair(pair, greys(far, near), settings)
    sigma = precision(matches)
    xyz = np.array(pair.intersect(matches.pixels1, matches.pixels2, sigma_px=sigma).xyz)
    pixels = np.full((len(photos), len(xyz), 2), np.nan)
    pixels[far], pixels[near] = matches.pixels1, matches.pixels2
    others = [number for number in range(len(photos)) if number not in (far, near)]
    for number in others:
        pixels[number] = _carried(photos, greys(far, number), (far, number), matches.pixels1, xyz)
    for _ in range(len(photos)):
        points = photos.intersect(list(pixels), sigma_px=sigma)
        wrong = points.suspects.T.copy()
        flagged = wrong.any(axis=0)
        if not flagged.any():
            break
        wrong[[far, near]] = False  # those passed the test of their pair
        wrong[others] |= flagged & ~wrong.any(axis=0)
        pixels[wrong] = np.nan
    return SetMatches(
        pixels=pixels, sigma_px=sigma, ids=matches.ids, kinds=matches.kinds, points=points
    )


def _carried(
    photos: PhotoSet,
    images: tuple[ByteArray, ByteArray],
    numbers: tuple[int, int],
    pixels: FloatArray,
    xyz: FloatArray,
) -> FloatArray:
    """Return where the second photo shows points of the first, fitted; NaN where they are not."""
    first, second = (photos.photos[number] for number in numbers)
    start = second.project(xyz)
    finite = np.asarray(np.isfinite(start).all(axis=1))
    place, relief = np.where(finite[:, None], start, 0.0), np.nan_to_num(xyz[:, 2])
    away, here = raw_metres(first, pixels, relief), raw_metres(second, place, relief)
    finite &= np.isfinite(here).all(axis=(1, 2)) & (np.abs(np.linalg.det(here)) > 0)
    local = np.linalg.inv(np.where(finite[:, None, None], here, np.eye(2))) @ away
    both = np.broadcast_to(np.eye(2), local.shape)
    fitted = refine(*same_scale(*images, local[finite]), pixels, start, local, both)
    sigma = np.hypot(MATCH.optimism * fitted.sigma, 0.02)
    good = np.asarray(fitted.converged & photos.sees(xyz)[numbers[1]])
    good &= finite & (sigma < 0.5) & (fitted.zncc > MATCH.least_agreement)
    return np.where(good[:, None], fitted.pixels2, np.nan)
