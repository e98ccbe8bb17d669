"""Images of particles: Gaussians integrated over pixels, fitted to all that overlap at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
from scipy.special import erf
from skimage.feature import peak_local_max

from multimedia.targets.background import without_background
from photocore.arrays import FloatArray, IntArray, positive
from photocore.errors import InputError

#: Pixels beside the middle of a particle that are fitted; images up to 6 px across end in them.
HALF = 4
#: The image is smoothed by so much before its maxima are taken. [px]
_SMOOTHING = 0.8
#: A maximum stands out of smoothed noise by so many standard deviations: in 10 megapixels of noise
#: alone there is none.
_STANDS_OUT = 5.5
#: What is left beside a fitted particle is another one if it has this share of its height.
_SECOND = 0.12
#: Standard deviations of the Gaussian of anything that is a particle. [px]
_NARROWEST, _WIDEST = 0.22, 3.0
#: Places that move by less are settled. [px]
_SETTLED = 2e-3
#: Turns of the fit, and rounds in which particles hidden beside others are added.
_TURNS, _ROUNDS = 14, 3
#: A width so much larger than that of most is that of several which no fit tells apart.
_MERGED = 1.6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetImages:
    """Images of particles in one image, brightest first.

    Attributes
    ----------
    pixels : ndarray, shape (n, 2)
        Column and row of the middles, integers at pixel centres. [px]
    sigma : ndarray, shape (n, 2)
        Their standard deviations. [px]
    diameter : ndarray, shape (n,)
        Four standard deviations of the Gaussian: where it has fallen to 1 / e^2. [px]
    height : ndarray, shape (n,)
        Grey value above the light of a pixel in its middle.
    counts : ndarray of int, shape (n,)
        Pixels above the threshold that show more of it than of its neighbours.
    extents : ndarray of int, shape (n, 2)
        Columns and rows that they take.
    sums : ndarray, shape (n,)
        Their grey values above the light.
    merged : ndarray of bool, shape (n,)
        Wider than is likely for one: perhaps several that no fit tells apart.
    """

    pixels: FloatArray
    sigma: FloatArray
    diameter: FloatArray
    height: FloatArray
    counts: IntArray
    extents: IntArray
    sums: FloatArray
    merged: NDArray[np.bool_]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.pixels)


def find_targets(
    image: ArrayLike,
    *,
    threshold: float | None = None,
    scale: float = 12.0,
    smallest: float = 1.0,
    largest: float = 12.0,
    dark: bool = False,
) -> TargetImages:
    """Find the images of particles: where they are, how precisely, how large.

    The light behind them is taken off; maxima that stand out of the noise are particles. Each is a
    Gaussian integrated over the pixels, fitted by least squares together with all that overlap it.
    What is left over beside one is another, hidden in its flank.

    Parameters
    ----------
    image : array_like, shape (h, w)
        Grey values.
    threshold : float, optional
        Least height above the light; by default what stands out of its noise by 5.5 standard
        deviations. [grey value]
    scale : float
        Over how many pixels the light behind the particles changes; larger than they are. [px]
    smallest, largest : float
        Diameters of what is a particle. [px]
    dark : bool
        Whether particles are darker than the light, as in front of a lamp.

    Returns
    -------
    targets : TargetImages

    Raises
    ------
    InputError
        If the image is not grey, or smaller than a particle's surroundings.
    """
    grey = np.array(image, dtype=float)
    if grey.ndim != 2 or min(grey.shape, default=0) < 2 * HALF + 1:
        raise InputError(
            f"image: expected grey values of at least {2 * HALF + 1} x {2 * HALF + 1} pixels, "
            f"found an array of shape {grey.shape}."
        )
    if not np.isfinite(grey).all():
        raise InputError("image: every grey value must be a finite number.")
    positive(scale, "scale", unit="px")
    positive(smallest, "smallest", unit="px")
    if threshold is not None:
        positive(threshold, "threshold", unit="grey value")
    if not smallest < largest <= 4 * _WIDEST:
        raise InputError(
            f"smallest, largest: {smallest:g} and {largest:g} px; expected the smaller first and "
            f"no particle larger than {4 * _WIDEST:g} px."
        )
    bright, noise = without_background(-grey if dark else grey, scale)
    fit = _Gaussians.of_maxima(bright, noise, threshold)
    for _ in range(_ROUNDS):
        fit = fit.settled()
        more = fit.hidden(threshold)
        if not len(more):
            break
        fit = fit.joined(more)
    return fit.settled().images(threshold, smallest, largest)


class _Drawn(NamedTuple):
    """Images of n particles in windows of 9 x 9 pixels, and of all of them together.

    ``columns`` and ``rows`` (n, 9) of the windows, ``where`` both as an index of (n, 9, 9) pixels,
    ``inside`` which of these exist; ``shape`` of sum 1, ``slopes`` (n, 9, 9, 5) by the terms,
    ``single`` what each particle shows; ``whole`` the image of all.
    """

    columns: IntArray
    rows: IntArray
    where: tuple[IntArray, IntArray]
    inside: NDArray[np.bool_]
    shape: FloatArray
    slopes: FloatArray
    single: FloatArray
    whole: FloatArray

    @property
    def weight(self) -> FloatArray:
        """Near the middle counts: what is far is another's, or the light's."""
        relative = self.shape / self.shape.max(axis=(1, 2), keepdims=True)
        return np.where(self.inside, relative + 0.02, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Gaussians:
    """Gaussians on an image: per particle column, row, width [px], sum and light left [grey]."""

    bright: FloatArray
    noise: FloatArray
    terms: FloatArray

    @classmethod
    def of_maxima(
        cls, bright: FloatArray, noise: FloatArray, threshold: float | None
    ) -> _Gaussians:
        fit = cls(bright, noise, np.empty((0, 5)))
        return replace(fit, terms=fit.maxima(bright, threshold))

    def maxima(self, image: FloatArray, threshold: float | None) -> FloatArray:
        """Return first terms of what stands out of an image."""
        # Mirrored at the border, noise would stand out there.
        smooth = cv2.GaussianBlur(image, (0, 0), _SMOOTHING, borderType=cv2.BORDER_CONSTANT)
        # White noise smoothed by a Gaussian of s pixels keeps 1 / (2 s sqrt(pi)) of itself.
        least = _STANDS_OUT * self.noise / (2 * _SMOOTHING * np.sqrt(np.pi))
        places = peak_local_max(smooth / least, min_distance=1, threshold_abs=1.0,
                                exclude_border=False)  # fmt: skip
        heights = image[tuple(places.T)]
        if threshold is not None:
            high = heights > 0.5 * threshold  # the fit decides: here noise and pixels do
            places, heights = places[high], heights[high]
        first = np.tile([0.0, 0.0, _SMOOTHING, 0.0, 0.0], (len(places), 1))
        first[:, :2], first[:, 3] = places[:, ::-1], heights / _middle(first[:, 2])
        return first

    def drawn(self, whole: FloatArray | None = None) -> _Drawn:
        """Return the particles' images, each in its window and all together, on an empty image."""
        height, width = self.bright.shape
        beside = np.arange(-HALF, HALF + 1)
        middle = np.clip(np.rint(self.terms[:, :2]), 0, (width - 1, height - 1)).astype(int)
        columns, rows = (middle[:, axis, None] + beside for axis in (0, 1))
        inside = ((rows >= 0) & (rows < height))[:, :, None]
        inside = inside & ((columns >= 0) & (columns < width))[:, None, :]
        columns, rows = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
        shape, slopes = _shapes(self.terms, columns, rows)
        single = np.where(inside, self.terms[:, 3, None, None] * shape, 0.0)
        whole = np.zeros_like(self.bright) if whole is None else whole
        where = rows[:, :, None], columns[:, None, :]
        np.add.at(whole, where, single)
        return _Drawn(columns, rows, where, inside, shape, slopes, single, whole)

    def settled(self) -> _Gaussians:
        """Return the fit that least squares lead to, each beside what the others show."""
        fit, whole = self, np.zeros_like(self.bright)
        for turn in range(_TURNS if len(self.terms) else 0):
            drawn, count = fit.drawn(whole), len(fit.terms)
            miss = (fit.bright - drawn.whole)[drawn.where] - fit.terms[:, 4, None, None]
            whole[drawn.where] = 0.0
            weighed = (drawn.slopes * drawn.weight[..., None]).reshape(count, -1, 5).swapaxes(1, 2)
            normal = weighed @ drawn.slopes.reshape(count, -1, 5)
            right = (weighed @ miss.reshape(count, -1, 1))[..., 0]
            diagonal = np.einsum("nii->ni", normal)
            damp = 1e-6 + (0.1 if turn < 4 else 0.0)
            normal[:, range(5), range(5)] = diagonal * (1 + damp) + 1e-12
            step = np.linalg.solve(normal, right[..., None])[..., 0]
            step[:, :2] = np.clip(step[:, :2], -0.5, 0.5)
            step[:, 2] = np.clip(step[:, 2], -0.3, 0.3)
            terms = fit.terms + step
            terms[:, 2] = np.clip(terms[:, 2], 0.1, _WIDEST)
            terms[:, 3] = np.maximum(terms[:, 3], 1e-9)
            fit = replace(fit, terms=terms)
            if turn >= 4 and np.abs(step[:, :2]).max() < _SETTLED:
                break
        return fit

    def hidden(self, threshold: float | None) -> FloatArray:
        """Return first terms of particles in the flanks of others: what is left beside those."""
        if not len(self.terms):
            return self.terms
        more = self.maxima(self.bright - self.drawn().whole, threshold)
        apart, nearest = cKDTree(self.terms[:, :2]).query(more[:, :2])
        beside = self.terms[nearest]
        high = more[:, 3] * _middle(more[:, 2]) > _SECOND * beside[:, 3] * _middle(beside[:, 2])
        return more[high & (apart > _SMOOTHING)]

    def joined(self, more: FloatArray) -> _Gaussians:
        """Return the fit with more particles."""
        return replace(self, terms=np.vstack([self.terms, more]))

    def images(self, threshold: float | None, smallest: float, largest: float) -> TargetImages:
        """Return what is a particle, brightest first."""
        if not len(self.terms):
            return _NONE
        drawn = self.drawn()
        sigma, bright = self._sigma(drawn), self.bright[drawn.where]
        height = self.terms[:, 3] * _middle(self.terms[:, 2])
        noise = self.noise[drawn.where][:, HALF, HALF]
        least = np.full(len(height), threshold) if threshold is not None else 2.0 * noise
        size = 4 * self.terms[:, 2]
        limits = self.bright.shape[1] - 0.5, self.bright.shape[0] - 0.5
        kept = (height > least) & (size >= max(smallest, 4 * _NARROWEST)) & (size <= largest)
        kept &= np.isfinite(sigma).all(axis=1) & (sigma < 1.0).all(axis=1)
        kept &= ((self.terms[:, :2] > -0.5) & (self.terms[:, :2] < limits)).all(axis=1)
        order = np.flatnonzero(kept)[np.argsort(-height[kept], kind="stable")]
        lit = drawn.inside & (bright > least[:, None, None])
        lit &= 2 * drawn.single > drawn.whole[drawn.where]
        middle = float(np.median(size[kept])) if kept.any() else 0.0
        return TargetImages(
            pixels=self.terms[order, :2],
            sigma=sigma[order],
            diameter=size[order],
            height=height[order],
            counts=lit.sum(axis=(1, 2))[order],
            extents=np.stack([lit.any(axis=axis).sum(axis=1) for axis in (1, 2)], axis=1)[order],
            sums=np.where(lit, bright, 0.0).sum(axis=(1, 2))[order],
            merged=(size > _MERGED * middle)[order],
        )

    def _sigma(self, drawn: _Drawn) -> FloatArray:
        """Return standard deviations of places, shape (n, 2), by what noise does to the fit. [px]

        The noise of a pixel grows with its light: how much, is told by what is left over. What the
        nearest neighbour takes of the same pixels is not known of either.
        """
        whole, noise = drawn.whole[drawn.where], self.noise[drawn.where]
        rest, weight = self.bright[drawn.where] - whole, drawn.weight
        core = weight > 0.1
        # The median of the square of a normal variable is 0.455 of its mean.
        beyond = np.median(rest[core] ** 2) / 0.455 - np.median(noise[core] ** 2)
        gain = max(float(beyond / np.median(whole[core])), 0.0)
        variance = noise**2 + gain * whole
        both = np.concatenate([drawn.slopes, self._beside(drawn)], axis=-1)
        # Terms of one size, whatever the grey values: what no pixel tells is then told apart.
        size = np.sqrt(np.einsum("nyxi,nyx,nyxi->ni", both, weight, both))
        both = both / np.where(size > 0, size, 1.0)[:, None, None, :]
        normal = np.einsum("nyxi,nyx,nyxj->nij", both, weight, both)
        spread = np.einsum("nyxi,nyx,nyxj->nij", both, weight**2 * variance, both)
        inverse = np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
        variances = np.einsum("nij,njk,nki->ni", inverse, spread, inverse)[:, :2] / size[:, :2] ** 2
        misfit = (weight * rest**2).sum(axis=(1, 2)) / (weight * variance).sum(axis=(1, 2))
        return np.sqrt(variances * np.maximum(misfit, 1.0)[:, None])

    def _beside(self, drawn: _Drawn) -> FloatArray:
        """Return derivatives of each window by the terms of its nearest neighbour."""
        if len(self.terms) < 2:
            return np.zeros((*drawn.shape.shape, 4))
        apart, nearest = cKDTree(self.terms[:, :2]).query(self.terms[:, :2], k=2)
        _, slopes = _shapes(self.terms[nearest[:, 1]], drawn.columns, drawn.rows)
        slopes[apart[:, 1] > 2 * HALF] = 0.0
        return slopes[..., :4]


def _shapes(terms: FloatArray, columns: IntArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return Gaussians of sum 1 in windows (n, 9, 9), and derivatives by their terms."""
    across, by_x, by_wide = _integrated(columns - terms[:, :1], terms[:, 2:3])
    down, by_y, by_high = _integrated(rows - terms[:, 1:2], terms[:, 2:3])
    shape = down[:, :, None] * across[:, None, :]
    total = terms[:, 3, None, None]
    by_width = by_high[:, :, None] * across[:, None, :] + down[:, :, None] * by_wide[:, None, :]
    slopes = [
        -total * down[:, :, None] * by_x[:, None, :],
        -total * by_y[:, :, None] * across[:, None, :],
        total * by_width,
        shape,
        np.ones_like(shape),
    ]
    return shape, np.stack(slopes, axis=-1)


def _integrated(
    beside: NDArray[np.floating], width: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a Gaussian of integral 1 over pixels, its slope along the image, and by its width."""
    right, left = (beside + 0.5) / width, (beside - 0.5) / width
    value = 0.5 * (erf(right / np.sqrt(2)) - erf(left / np.sqrt(2)))
    at_right, at_left = (np.exp(-0.5 * u**2) / np.sqrt(2 * np.pi) / width for u in (right, left))
    return value, at_right - at_left, left * at_left - right * at_right


def _middle(width: FloatArray) -> FloatArray:
    """Return what a pixel in the middle of a Gaussian of sum 1 shows."""
    share: FloatArray = erf(0.5 / (np.sqrt(2) * width)) ** 2
    return share


_NO_NUMBERS = np.empty(0)
_NONE = TargetImages(
    pixels=np.empty((0, 2)), sigma=np.empty((0, 2)), diameter=_NO_NUMBERS, height=_NO_NUMBERS,
    counts=np.empty(0, dtype=int), extents=np.empty((0, 2), dtype=int), sums=_NO_NUMBERS,
    merged=np.empty(0, dtype=bool),
)  # fmt: skip
