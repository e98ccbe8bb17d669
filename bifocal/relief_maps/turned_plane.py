"""A pair whose base is parallel to the wall, measured over a plane turned by a degree.

Dense relief needs one camera nearer than the other: photo 2 is then a zoom of photo 1 about a point
of the plane. Over a plane turned about the middle of the wall every base has such a point, far
aside. The map of that plane is brought back by the rays of its own normal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from bifocal.model.grid import Bounds, Grid, bounds_of
from bifocal.model.photo import Photo
from bifocal.model.relief_map import Quality, ReliefMap
from bifocal.relief_maps.forward_projection import MapBands
from bifocal.relief_maps.frame import values_at
from photocore.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class TurningTuning:
    """Bases that hardly rise from the wall."""

    #: A base that rises less than this from the wall, per length along it, is measured over a
    #: turned plane: the centre of the zoom must not lie too far away for single precision.
    #: Evidence: chosen: 9.5 m away the centre lies 475 m aside, 0.01 px of single precision.
    least_steepness: float = 0.02
    #: Rounds in which a place of the wall is found on the turned plane.
    #: Evidence: each round leaves a fiftieth of the error before.
    turning_rounds: int = 4
    #: By so much its place may still move in the last round; else nothing leads there. [px]
    settled: float = 0.25


TURNING = TurningTuning()


def steepness(photos: tuple[Photo, Photo]) -> float:
    """Return how much a base rises from the plane per length along it; infinite on one axis."""
    one, second = photos
    aside = float(np.hypot(*(one.nadir - second.nadir)))
    return abs(one.distance - second.distance) / aside if aside > 0 else math.inf


@dataclass(frozen=True, slots=True, eq=False)
class TurnedPlane:
    """A reference plane turned against the wall's.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        Its axes, in rows, in the wall's frame.
    middle : ndarray, shape (3,)
        Its origin there. [m]
    """

    rotation: FloatArray
    middle: FloatArray

    @classmethod
    def for_base(cls, photos: tuple[Photo, Photo], middle: FloatArray) -> TurnedPlane | None:
        """Return the plane over which a base is steep enough; None if it is so over the wall.

        Parameters
        ----------
        photos : tuple of Photo
        middle : ndarray, shape (2,)
            Of what both photos see. [m]
        """
        rise = steepness(photos)
        if rise >= TURNING.least_steepness:
            return None
        one, second = sorted(photos, key=lambda photo: -photo.distance)  # the farther stays so
        away = np.append(one.nadir - second.nadir, 0.0)
        away /= np.linalg.norm(away)
        turn = np.arctan(TURNING.least_steepness) - np.arctan(rise)
        axis = np.array([0.0, 0.0, np.cos(turn)]) + np.sin(turn) * away
        x = np.cross([0.0, 1.0, 0.0], axis)
        x /= np.linalg.norm(x)
        return cls(np.stack([x, np.cross(axis, x), axis]), np.append(middle, 0.0))

    def photo(self, photo: Photo) -> Photo:
        """Return a photo over this plane."""
        centre = self.rotation @ (np.append(photo.nadir, photo.distance) - self.middle)
        (x, y), d = photo.nadir, photo.distance
        # Where the ray to a point meets the wall, times what it is divided by: Eq. (1) in a matrix.
        on_wall = np.array([[d, 0, -x, 0], [0, d, -y, 0], [0, 0, -1, d]])
        from_turned = np.vstack([np.column_stack([self.rotation.T, self.middle]), [0, 0, 0, 1]])
        camera = np.linalg.inv(photo.plane_from_pixel) @ on_wall @ from_turned
        matrix = np.linalg.inv(camera[:, [0, 1, 3]])
        return replace(
            photo, plane_from_pixel=matrix / np.abs(matrix).max(), nadir=centre[:2],
            distance=float(centre[2]),
        )  # fmt: skip

    def bounds(self, box: Bounds, relief: tuple[float, float]) -> Bounds:
        """Return the box on this plane around a box of the wall between two reliefs."""
        x, y, r = np.meshgrid(box[::2], box[1::2], relief)
        return bounds_of(self._turned(np.stack([x, y, r], axis=-1))[..., :2])

    def _turned(self, xyz: FloatArray) -> FloatArray:
        return np.asarray((xyz - self.middle) @ self.rotation.T)

    def brought_back(self, found: ReliefMap, grid: Grid) -> MapBands:
        """Return a map of this plane on a grid of the wall, unknown where no point leads there."""
        x, y = np.meshgrid(grid.columns_x, grid.rows_y)
        relief = np.zeros(grid.shape)
        for _ in range(TURNING.turning_rounds):
            places_back = self._turned(np.stack([x, y, relief], axis=-1))
            places = found.grid.pixel_of(places_back[..., :2]).astype(np.float32)
            height = values_at(found.r, places, cv2.INTER_NEAREST)
            before, relief = relief, np.nan_to_num(self._relief(places_back, height))
        smooth = values_at(found.r, places, cv2.INTER_LINEAR)
        with np.errstate(invalid="ignore"):
            near = np.abs(smooth - height) < grid.gsd
            settled = np.abs(relief - before) < TURNING.settled * grid.gsd / TURNING.least_steepness
        value = self._relief(places_back, np.where(near, smooth, height))
        settled &= np.isfinite(height)
        sigma, quality = (
            values_at(band, places, cv2.INTER_NEAREST) for band in (found.sigma, found.quality)
        )
        nothing = np.float32(np.nan)
        return MapBands(
            np.where(settled, value, nothing).astype(np.float32),
            np.where(settled, sigma, nothing).astype(np.float32),
            np.where(settled, quality, np.uint8(Quality.UNKNOWN)).astype(np.uint8),
        )

    def _relief(self, there: FloatArray, height: FloatArray) -> FloatArray:
        """Return the relief over the wall of points of this plane at other heights over it. [m]"""
        return np.asarray(
            there[..., :2] @ self.rotation[:2, 2] + height * self.rotation[2, 2] + self.middle[2]
        )
