"""What chance can do over a whole wall: errors that hang together along the surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.comparison.tuning import CHANCE
from photocore.arrays import BoolArray, FloatArray

#: A hundred drawn walls tell no smaller probability.
LEAST = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chance:
    """What averages over patches of a wall become where nothing has changed.

    Attributes
    ----------
    covariance : ndarray, shape (rows, columns)
        Of the normalised difference of two cells, by their distance; wrapped around.
    sigmas : ndarray, shape (n, height, width)
        Standard deviation of the averages over patches of each size, larger beside holes.
    place, scale : float
        Of the distribution of the largest average of the wall, in those deviations and squared
        (Gumbel's).
    """

    covariance: FloatArray
    sigmas: FloatArray
    place: float
    scale: float

    def limit(self, level: float) -> float:
        """Return what the largest average exceeds with a probability, by chance."""
        return float(np.sqrt(self.place - self.scale * np.log(-np.log1p(-level))))

    def probability(self, largest: float) -> float:
        """Return how probable so large an average is anywhere by chance, `LEAST` or more."""
        by_chance = float(-np.expm1(-np.exp((self.place - largest**2) / self.scale)))
        return max(by_chance, LEAST)

    def variance_of_sum(self, weights: FloatArray) -> float:
        """Return the variance of a weighted sum of normalised differences, shape as the wall's."""
        spectrum = np.abs(np.fft.rfft2(weights, self.covariance.shape)) ** 2
        pairs = np.fft.irfft2(spectrum, self.covariance.shape)
        return max(float((pairs * self.covariance).sum()), 0.0)

    @property
    def cells(self) -> float:
        """Cells that err as one: the sum of the correlation over all distances."""
        return max(float(self.covariance.sum() / self.covariance[0, 0]), 1.0)

    @property
    def length(self) -> float:
        """Distance at which the correlation has fallen to 1/e. [cells]"""
        side = min(self.covariance.shape) // 2
        across = (self.covariance[0, :side] + self.covariance[:side, 0]) / 2
        fallen = across < across[0] / np.e
        return float(np.argmax(fallen)) if fallen.any() else float(side)


class Patches:
    """Averages over Gaussian patches of a wall; NaN where less than half of one is known.

    Parameters
    ----------
    known : ndarray of bool, shape (height, width)
        Cells that are known.
    radii : sequence of float
        Standard deviations of the patches. [cells]
    """

    def __init__(self, valid: BoolArray, radii: Sequence[float]) -> None:
        self.known, self.radii = valid, tuple(radii)
        weights = [self._smooth(valid.astype(float), radius) for radius in radii]
        self.shares = [np.where(valid & (w > CHANCE.covered), w, np.nan) for w in weights]

    def averages(self, field: FloatArray) -> list[FloatArray]:
        """Return the averages of a field over the patches of each radius."""
        kept = np.where(self.known, field, 0.0)
        pairs = zip(self.radii, self.shares, strict=True)
        return [self._smooth(kept, radius) / share for radius, share in pairs]

    @staticmethod
    def _smooth(field: FloatArray, radius: float) -> FloatArray:
        smooth = cv2.GaussianBlur(field, (0, 0), radius, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(smooth)


def chance(
    z: FloatArray, unchanged: BoolArray, patches: Patches, least: float, rng: np.random.Generator
) -> Chance:
    """Return what chance can do, learned from the differences themselves.

    Parameters
    ----------
    z : ndarray, shape (height, width)
        Difference over its standard deviation, cell by cell.
    unchanged : ndarray of bool, shape (height, width)
        Cells to learn from.
    patches : Patches
        What is averaged.
    least : float
        Factor of the variance, 1 or more: where pixels differ by less than their standard
        deviations say, these are believed.
    rng : Generator

    Notes
    -----
    The autocovariance is taken from the cells that are known, up to a part of the wall's shorter
    side, and brought to zero there. Fields with that covariance (Gaussian, by their spectrum) are
    averaged as the differences are; the largest average of each is one draw of what the largest
    of the wall does by chance. So the number of places and sizes looked at, the holes of the map
    and the correlation all count, without a formula for any of them. Each field is averaged again
    with the values that the wall itself shows in place of Gaussian ones, rank by rank: where a few
    places err by far more than most, the largest average is theirs. The larger of both counts.
    """
    from scipy.fft import irfft2, next_fast_len, rfft2
    from scipy.special import ndtr
    from scipy.stats import gumbel_r

    reach = max(2, round(min(z.shape) * CHANCE.reach))
    shape = tuple(next_fast_len(side + reach, real=True) for side in z.shape)
    kept = np.where(unchanged, z, 0.0)
    products, pairs = (
        np.fft.irfft2(np.abs(np.fft.rfft2(part, shape)) ** 2, shape)
        for part in (kept, unchanged.astype(float))
    )
    lags = np.hypot(*np.meshgrid(*(_wrapped(side) for side in shape), indexing="ij"))
    taper = 0.5 * (1 + np.cos(np.pi * np.minimum(lags / reach, 1.0)))
    covariance = products / np.maximum(pairs, 1.0) * taper
    covariance *= least
    covariance[0, 0] += 1e-6  # two maps that are the same
    amplitude = np.sqrt(np.maximum(np.fft.rfft2(covariance).real, 0.0))
    amplitude *= np.sqrt(covariance[0, 0] / np.fft.irfft2(amplitude**2, shape)[0, 0])
    # Seven digits are enough for what is drawn, and three times as quick as sixteen.
    amplitude = amplitude.astype(np.float32)
    steps = np.linspace(-CHANCE.widest, CHANCE.widest, CHANCE.steps)
    values = np.quantile(np.abs(z[unchanged]), np.abs(2 * ndtr(steps) - 1)) * np.sign(steps)
    values = values.astype(np.float32)
    per_unit = np.float32((CHANCE.steps - 1) / 2 / CHANCE.widest / np.sqrt(covariance[0, 0]))
    means = np.empty((2, CHANCE.draws, len(patches.radii), *z.shape), np.float32)
    for draw in range(CHANCE.draws):
        white = rfft2(rng.standard_normal(shape).astype(np.float32))
        field = irfft2(white * amplitude, shape)[: z.shape[0], : z.shape[1]]
        means[0, draw] = patches.averages(field)
        rank = (field * per_unit + np.float32(CHANCE.steps / 2)).astype(np.int32)
        means[1, draw] = patches.averages(values.take(rank, mode="clip"))
    squares = np.square(means[0]).mean(axis=0)
    sigmas = np.stack([_fitted(*pair) for pair in zip(squares, patches.shares, strict=True)])
    means /= sigmas
    largest = np.nanmax(np.square(means, out=means), axis=(0, 2, 3, 4)).astype(float)
    place, scale = gumbel_r.fit(largest)
    return Chance(covariance=covariance, sigmas=sigmas, place=float(place), scale=float(scale))


def _wrapped(side: int) -> FloatArray:
    """Return the distances of a wrapped axis from its first cell. [cells]"""
    steps = np.arange(side)
    return np.minimum(steps, side - steps).astype(float)


def _fitted(squares: FloatArray, share: FloatArray) -> FloatArray:
    """Return the sigma of averages as a function of the share of their patch that is known."""
    finite = np.isfinite(share)
    if not finite.any():
        return share
    terms = np.stack([np.ones(int(finite.sum())), 1 / share[finite]], axis=-1)
    terms_fitted = np.linalg.lstsq(terms, squares[finite], rcond=None)[0]
    variance = terms_fitted[0] + terms_fitted[1] / share
    return np.sqrt(np.maximum(variance, 0.25 * float(squares[finite].mean())))
