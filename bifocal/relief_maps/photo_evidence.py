"""What the photos of a set say of a relief: which see a place, and whether they show it alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.photo import Photo
from bifocal.model.ray_field import RayField
from bifocal.rays import straight
from bifocal.relief_maps.forward_projection import hidden_on_map
from bifocal.relief_maps.frame import values_at
from bifocal.relief_maps.registration import least_absolute
from photocore.arrays import BoolArray, ByteArray, Float32Array, FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class WitnessTuning:
    """Photos of a set compared with each other."""

    #: Side of the windows over which photos are compared. [px]
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 3 px 7.72 and 1.57, 5
    #: px 7.80 and 1.53, 7 px 8.00 and 1.54.
    window: int = 5
    #: Photos differ by so many times the usual at most, and where fewer than two see a place.
    #: Evidence: balcony 1203 and façade 311, quarter frames, beyond 3 cm [%]: 2 8.05 and 1.59, 3
    #: 7.80 and 1.53, 5 7.78 and 1.53; 30 grey levels, 30 times the usual, 9.18 and 1.91.
    worst: float = 3.0
    #: Photos are taken to differ by so much at least. [grey levels]
    #: Evidence: chosen: rounding.
    quiet: float = 0.5
    #: A photo so many times finer than the map is reduced first.
    #: Evidence: as the working frame.
    coarser: float = 1.5
    #: Places a side at which exposures are compared.
    exposure_samples: int = 160
    #: With fewer places in common a photo keeps its exposure.
    #: Evidence: as for a pair.
    exposure_least: int = 200


WITNESSES = WitnessTuning()


@dataclass(frozen=True, slots=True, eq=False)
class Witness:
    """A photo that can be asked what it shows of a place.

    Attributes
    ----------
    photo : Photo
    grey : ndarray of uint8 or float32, shape (height, width)
        Its grey values, reduced to about the pixels of the map.
    size : tuple of int
        Width and height of the whole photo. [px]
    """

    photo: Photo
    grey: ByteArray | Float32Array
    size: tuple[int, int]

    @classmethod
    def of(cls, photo: Photo, grey: ByteArray, gsd: float) -> Witness:
        """Return a photo prepared for a map's pixels."""
        size = (grey.shape[1], grey.shape[0])
        scale = min(1.0, photo.gsd(size) / gsd)
        if scale < 1 / WITNESSES.coarser:
            small = (max(16, round(size[0] * scale)), max(16, round(size[1] * scale)))
            grey = np.asarray(cv2.resize(grey, small, interpolation=cv2.INTER_AREA), np.uint8)
        return cls(photo, grey, size)

    def shows(self, xyz: FloatArray) -> Float32Array:
        """Return its grey values at points (X, Y, r), shape (n,); NaN outside the photo."""
        pixels = self.photo.project(xyz)
        factors = np.array([self.grey.shape[1], self.grey.shape[0]]) / self.size
        with np.errstate(invalid="ignore"):
            inside = np.all((pixels >= 0) & (pixels <= np.subtract(self.size, 1)), axis=-1)
        places = np.where(np.asarray(inside)[:, None], (pixels + 0.5) * factors - 0.5, -10.0)
        if not inside.any():
            return np.full(len(xyz), np.nan, np.float32)
        grey = np.asarray(self.grey, np.float32)
        values = values_at(grey, places.astype(np.float32), cv2.INTER_LINEAR)
        return np.where(inside, values, np.float32(np.nan))


def shown_by(
    witnesses: Sequence[Witness], relief: Float32Array, grid: Grid, where: BoolArray
) -> Float32Array:
    """Return what each photo shows of some pixels of a map, (photos, n); NaN where it sees none."""
    row, column = np.nonzero(where & np.isfinite(relief))
    xyz = np.column_stack([grid.columns_x[column], grid.rows_y[row], relief[row, column]])
    values = np.full((len(witnesses), len(row)), np.nan, np.float32)
    for value, witness in zip(values, witnesses, strict=True):
        value[:] = witness.shows(xyz)
        if np.isfinite(value).any():
            foot, rays = witness.photo.foot, None
            if witness.photo.refracted:
                low, high = float(np.nanmin(relief)), float(np.nanmax(relief))
                foot, rays = straight(foot), RayField.over(foot, grid.bounds, (low, high))
            value[hidden_on_map(relief, grid, foot, rays)[row, column]] = np.nan
    return values


def misfit(
    witnesses: Sequence[Witness], relief: Float32Array, grid: Grid, where: BoolArray, usual: float
) -> Float32Array:
    """Return how differently the photos show a relief, over how differently they show any.

    Parameters
    ----------
    witnesses : sequence of Witness
        Exposed alike.
    relief : ndarray of float32, shape (height, width)
    grid : Grid
    where : ndarray of bool
        Pixels that matter; those around them are looked at, too.
    usual : float
        `exposed_alike`. [grey levels]

    Returns
    -------
    ndarray of float32
        Mean of what all that see a place and of what the two most alike say of it, averaged over
        the best of the windows that contain it; ``WITNESSES.worst`` where fewer than two photos see
        it, and elsewhere.

    Notes
    -----
    What differs by a few times the usual is wrong, and no more wrong if it differs by all: cut off
    at 30 grey levels one strong edge decided for its whole window. A window about the pixel mixes
    both sides of a step; of those that contain it one lies on its own side.
    """
    worst, side = float(WITNESSES.worst), int(WITNESSES.window)
    square, reach = (np.ones((n, n), np.uint8) for n in (side, 2 * side - 1))
    around = cv2.dilate(where.astype(np.uint8), reach) > 0
    around &= np.isfinite(relief)
    grey = np.sort(shown_by(witnesses, relief, grid, around), axis=0)
    every = _differing(grey, worst * usual)
    with np.errstate(invalid="ignore"):
        alike = np.minimum(np.diff(grey, axis=0), worst * usual)
    two = np.nan_to_num(alike, nan=worst * usual).min(axis=0)
    result = np.full(grid.shape, worst, np.float32)
    result[around] = (every + two) / np.float32(2 * usual)
    return np.asarray(cv2.erode(cv2.blur(result, (side, side)), square))


def _differing(grey: Float32Array, worst: float) -> Float32Array:
    """Return how differently photos show places, (photos, n) to (n,); worst where one or none."""
    count = np.isfinite(grey).sum(axis=0)
    mean = np.nansum(grey, axis=0) / np.maximum(count, 1)
    apart = np.nansum(np.minimum(np.abs(grey - mean), worst), axis=0)
    # The mean of two lies amidst them: they are twice as far from each other.
    apart = apart / np.maximum(count - 1, 1) * 2 / np.maximum(np.minimum(count, 2), 1)
    return np.where(count >= 2, np.minimum(apart, worst), worst).astype(np.float32)


def exposed_alike(
    witnesses: Sequence[Witness], relief: Float32Array, grid: Grid
) -> tuple[list[Witness], float]:
    """Return the photos exposed like the first that they share a part of the wall with.

    ``I1 = a + b I2 + c x + d y``, robustly, over a few thousand places of the map; and by how many
    grey levels they then differ in the median.
    """
    step = max(1, max(grid.shape) // WITNESSES.exposure_samples)
    part = np.zeros(grid.shape, bool)
    part[step // 2 :: step, step // 2 :: step] = True
    part &= np.isfinite(relief)
    row, column = np.nonzero(part)
    xyz = np.column_stack([grid.columns_x[column], grid.rows_y[row], relief[row, column]])
    shown = shown_by(witnesses, relief, grid, part)
    done = list(witnesses)
    for number, witness in enumerate(witnesses):
        for reference in shown[:number]:
            use = np.isfinite(shown[number]) & np.isfinite(reference)
            if use.sum() < WITNESSES.exposure_least:
                continue
            place = witness.photo.project(xyz) / witness.size * 2 - 1
            terms = np.column_stack([np.ones(len(xyz)), shown[number], place])
            a, b, c, d = least_absolute(terms[use], reference[use], rounds=8, floor=0.5)
            height, width = witness.grey.shape
            across = np.linspace(c, -c, width, dtype=np.float32)[None, :]
            down = np.linspace(d, -d, height, dtype=np.float32)[:, None]
            grey = np.float32(a) + np.float32(b) * witness.grey - across - down
            done[number] = Witness(witness.photo, grey, witness.size)
            shown[number] = terms @ [a, b, c, d]
            break
    shown = shown[:, np.isfinite(shown).sum(axis=0) >= 2]
    typical = float(np.median(_differing(shown, np.inf))) if shown.size else 0.0
    return done, max(typical, WITNESSES.quiet)
