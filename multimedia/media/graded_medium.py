r"""Rays where the index changes linearly with depth: salt or warm water that lies in layers.

With the parameter :math:`d\tau = ds / n` a ray obeys :math:`x'' = n \gamma`, :math:`\gamma` being
the gradient of n, and n itself grows along it by :math:`n'' = \gamma^2 n` (Born and Wolf,
*Principles of Optics*, Sect. 3.2). From a place v of index n, in the direction :math:`p = n d`, it
follows that

.. math:: x(\tau) = v + \tau p + \gamma \left[ n \tau^2 C(w) + (\gamma \cdot p) \tau^3 S(w) \right],
          \qquad w = \gamma^2 \tau^2

with :math:`C(w) = (\cosh\sqrt w - 1) / w` and :math:`S(w) = (\sinh\sqrt w - \sqrt w) / w^{3/2}`: a
catenary, and a straight line where the gradient vanishes.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from photocore.arrays import FloatArray

#: Terms of the series in w: exact to the last digit up to w = 2, where the index has doubled.
TERMS = 12
MOST_STEPS = 30
#: Beyond this no medium is meant any more.
LARGEST = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GradedRays:
    """Rays where they enter a medium of linearly changing index.

    Attributes
    ----------
    origins : ndarray, shape (n, 3)
    index : ndarray, shape (n,)
        At the origins.
    momenta : ndarray, shape (n, 3)
        Index times direction there.
    gradient : ndarray, shape (3,)
        Of the index.
    """

    origins: FloatArray
    index: FloatArray
    momenta: FloatArray
    gradient: FloatArray

    def at(self, tau: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return places and derivatives by tau, both (n, 3)."""
        w = (self.gradient @ self.gradient) * tau**2
        rise = self.momenta @ self.gradient
        bow = self.index * tau**2 * _series(w, 2) + rise * tau**3 * _series(w, 3)
        slope = self.index * tau * _series(w, 1) + rise * tau**2 * _series(w, 2)
        place = self.origins + tau[:, None] * self.momenta + bow[:, None] * self.gradient
        return place, self.momenta + slope[:, None] * self.gradient

    def nearest(self, targets: FloatArray) -> FloatArray:
        """Return tau where each ray passes its target; NaN where none."""
        with np.errstate(all="ignore"):
            square = (self.momenta * self.momenta).sum(-1)
            tau = ((targets - self.origins) * self.momenta).sum(-1) / square
            for _ in range(MOST_STEPS):
                place, along = self.at(tau)
                gap = place - targets
                ahead = self.index + (place - self.origins) @ self.gradient
                bend = (along * along).sum(-1) + ahead * (gap @ self.gradient)
                step = (gap * along).sum(-1) / bend
                tau = tau - step
                if not (np.abs(step) > 1e-15 * np.abs(tau)).any():
                    break
            steep = (self.gradient @ self.gradient) * tau**2 > LARGEST
        return np.where(steep, np.nan, tau)

    def drift(
        self, tau: FloatArray, origins: FloatArray, index: FloatArray, momenta: FloatArray,
        gradients: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """Return how places move at a fixed tau, shape (n, k, 3).

        Parameters
        ----------
        tau : ndarray, shape (n,)
        origins, momenta : ndarray, shape (n, k, 3)
            How origins and momenta change, by k parameters.
        index : ndarray, shape (n, k)
        gradients : ndarray, shape (k, 3)
        """
        gamma = self.gradient
        w = (gamma @ gamma) * tau**2
        c, s = tau**2 * _series(w, 2), tau**3 * _series(w, 3)
        rise = self.momenta @ gamma
        bow = self.index * c + rise * s
        by_w = self.index * tau**2 * _slope(w, 2) + rise * tau**3 * _slope(w, 3)
        d_w = 2.0 * tau[:, None] ** 2 * (gradients @ gamma)
        d_rise = self.momenta @ gradients.T + momenta @ gamma
        d_bow = c[:, None] * index + s[:, None] * d_rise + by_w[:, None] * d_w
        return (
            origins + tau[:, None, None] * momenta + bow[:, None, None] * gradients
            + d_bow[..., None] * gamma
        )  # fmt: skip


def _series(w: FloatArray, order: int) -> FloatArray:
    """Return the sum of w^k / (2 k + order)!: sinh, cosh - 1, sinh - x over powers of x."""
    total = np.zeros_like(w)
    for k in reversed(range(TERMS)):
        total = total * w + 1.0 / factorial(2 * k + order)
    return total


def _slope(w: FloatArray, order: int) -> FloatArray:
    """Return the derivative of `_series` by w."""
    total = np.zeros_like(w)
    for k in reversed(range(1, TERMS)):
        total = total * w + k / factorial(2 * k + order)
    return total
