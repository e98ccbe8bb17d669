"""Solved points: every column of the workbook's `Points` table that is computed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bifocal.model import Pair
from photocore.arrays import FloatArray, IntArray

#: Entries of a symmetric matrix of X, Y, Z, and where they stand.
ENTRIES = {"XX": (0, 0), "XY": (0, 1), "YY": (1, 1), "XZ": (0, 2), "YZ": (1, 2), "ZZ": (2, 2)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReliefTable:
    """Relief, coordinates and precision of points.

    Attributes
    ----------
    ids : tuple of str, length n
        Names of the points.
    columns : mapping of str to ndarray, shape (n,)
        The workbook's computed columns by key: ``s1_used s2_used ds e1 e2 s_c q`` [mm],
        ``theta_used`` [deg], ``den`` [mm/m], ``r X Y Z sigma_X sigma_Y sigma_r`` [m]. NaN where
        undefined. Covariances that follow from the picks: ``cov_XX cov_XY cov_YY cov_XZ cov_YZ``,
        ``cov_ZZ`` [m²].
    flags : tuple of str, length n
        One of `bifocal.model.flags.FLAGS` per point.
    standardised : ndarray, shape (n,)
        Misfit across the radius over its standard deviation; NaN where it cannot be tested.
    of_pixels : mapping of str to ndarray, shape (n,)
        Of points measured in raw pixels of a general pair, what no formula of a spreadsheet gives:
        least-squares gains ``g1x g1y g2x g2y`` [mm per mm of q], through media those of the rays'
        slopes ``u1x u1y u2x u2y``; ``k_q`` [mm/px], ``k_w`` (the same on the wall), ``k_r`` and
        the covariance ``k_XX ...`` of a pick of 1 px, what the orientation adds to them, ``o_r``
        and ``o_XX ...`` [m]; and ``misfit_px``, the miss across the radius in pixels of image 2.
    image_scale : float or None
        Scale number of image 1; None where no principal distance is known.
    sigma_px : float or None
        Precision of a pick, where the covariances are kept for one pixel (``k_XX`` ...). [px]
    pair : Pair or None
        The geometry, where its own precision is in the covariances.
    effect : ndarray, shape (n, 3, k), or None
        The same of points of a set of photos: what errors common to all points move each by. [m]
    """

    ids: tuple[str, ...]
    columns: Mapping[str, FloatArray]
    flags: tuple[str, ...]
    standardised: FloatArray
    of_pixels: Mapping[str, FloatArray]
    image_scale: float | None
    sigma_px: float | None = None
    pair: Pair | None = None
    effect: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.ids)

    def __getitem__(self, key: str) -> FloatArray:
        return self.columns[key]

    @property
    def xyz(self) -> FloatArray:
        """X, Y and relief, shape (n, 3). [m]"""
        return np.stack([self.columns[key] for key in ("X", "Y", "Z")], axis=-1)

    @property
    def covariance(self) -> FloatArray | None:
        """Covariance of X, Y and relief, shape (n, 3, 3); None if unknown. [m²]"""
        if "cov_XX" not in self.columns:
            return None
        return symmetric(self.columns)

    @property
    def own_covariance(self) -> FloatArray | None:
        """Its part that is each point's own, from the picks, shape (n, 3, 3). [m²]"""
        if self.sigma_px is None or "k_XX" not in self.of_pixels:
            return self.covariance
        return np.asarray(self.sigma_px**2 * symmetric(self.of_pixels, "k_"))

    def effect_of_orientation(self, rows: IntArray | None = None) -> FloatArray | None:
        """Return what errors common to all points move them by, shape (n, 3, k) [m]; None if none.

        Of all points, or of some rows, NaN for -1; see `bifocal.model.pair.Pair.
        effect_of_orientation`.
        """
        if self.effect is None and self.pair is None:
            return None
        values = self.xyz if self.effect is None else self.effect
        if rows is not None:
            values = np.concatenate([values, np.full((1, *values.shape[1:]), np.nan)])[rows]
        return self.pair.effect_of_orientation(values) if self.pair is not None else values

    def joint_covariance(self, rows: Sequence[int]) -> FloatArray | None:
        """Covariance of X, Y, r of some rows together, shape (3 n, 3 n); None if unknown. [m²]

        The orientation moves neighbours alike: what is between them is known better than they are.
        """
        if (of_picks := self.own_covariance) is None:
            return None
        count = len(rows)
        blocks = np.zeros((count, 3, count, 3))
        blocks[range(count), :, range(count)] = of_picks[list(rows)]
        joint: FloatArray = blocks.reshape(3 * count, 3 * count)
        if (effect := self.effect_of_orientation(np.array(rows))) is not None:
            common = effect.reshape(3 * count, -1)
            joint += common @ common.T
        return joint


def symmetric(columns: Mapping[str, FloatArray], prefix: str = "cov_") -> FloatArray:
    """Return symmetric matrices of the columns that hold their entries, shape (n, 3, 3)."""
    order = ("XX", "XY", "XZ", "XY", "YY", "YZ", "XZ", "YZ", "ZZ")
    return np.stack([columns[prefix + key] for key in order], axis=-1).reshape(-1, 3, 3)


def entries(matrices: FloatArray, prefix: str = "cov_") -> dict[str, FloatArray]:
    """Return the entries of symmetric matrices of shape (n, 3, 3) as columns."""
    return {prefix + key: matrices[:, i, j] for key, (i, j) in ENTRIES.items()}
