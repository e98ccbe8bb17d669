"""A camera plan: the sensor, the stations of each pair of lenses, precision over the frame."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from bifocal.model import Pair, PairMedia, PhotoSet, rests_on, stated_by_photo
from photocore.arrays import FloatArray, positive
from photocore.camera import Pinhole
from photocore.errors import InputError

#: Of the frame of 36 x 24 mm, by which makers state equivalents. [mm]
FILM_DIAGONAL = float(np.hypot(36.0, 24.0))

#: Step aside of a third photo, as a share of the near distance: its rays then meet at 10 degrees.
STEP = 1 / 6


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraSensor:
    """A camera's sensor.

    Attributes
    ----------
    width, height : float
        [mm]
    columns, rows : int
        [px]
    """

    width: float
    height: float
    columns: int
    rows: int

    def __post_init__(self) -> None:
        for name in ("width", "height", "columns", "rows"):
            positive(getattr(self, name), f"sensor {name}")
        across, along = self.width / self.columns, self.height / self.rows
        if abs(across / along - 1) > 0.03:
            raise InputError(
                f"sensor: {self.width:g} x {self.height:g} mm with {self.columns} x {self.rows}"
                f" px makes pixels of {across * 1000:.2f} x {along * 1000:.2f} um: not square; "
                "check both pairs of numbers, and that both are width x height."
            )

    @classmethod
    def of_film(cls, columns: int, rows: int) -> CameraSensor:
        """Return the frame that 35 mm equivalents speak of, in the proportions of a photo.

        Its diagonal is that of 36 x 24 mm, whatever the size of the sensors behind the lenses:
        a phone's two cameras are planned as two lenses before one such frame.
        """
        share = FILM_DIAGONAL / float(np.hypot(columns, rows))
        return cls(width=columns * share, height=rows * share, columns=columns, rows=rows)

    @property
    def pitch(self) -> float:
        """Pixel size. [mm]."""
        return self.width / self.columns


@dataclass(frozen=True, slots=True, kw_only=True)
class Station:
    """Both stations of one pair of lenses and what to expect from them.

    Attributes
    ----------
    c1, c2 : float
        Principal distances of the far and the near camera. [mm]
    d1, d2, delta_d : float
        Distances to the wall and their difference. [m]
    scale_number : float
        1000 d / c, the same in both photos.
    gsd : float
        Pixel on the wall. [m]
    footprint : tuple of float
        Width and height of the wall in one photo. [m]
    photos : tuple of int
        Photos needed across and up, with overlap.
    sigma_r_rms, sigma_r_corner : float
        Expected sigma of the relief at the RMS radius of the frame and in its corner. [m]
    sigma_ortho : float
        Expected sigma of a position on the orthophoto of image 1, anywhere. [m]
    uncertain_radius : float
        Radius of the area of uncertainty for ``sigma_r_max``. [m]
    uncertain_share : float
        That radius over the frame's half diagonal.
    feasible : bool
        Whether both stations fit into the free space.
    note : str
        Why not, or what to mind.
    z0_1, z0_2 : float or None
        Camera centres to the first interface; None in air. [m]
    straight : tuple of float
        Distances of straight cameras that see alike near the axis; in air d1, d2. [m]
    """

    c1: float
    c2: float
    d1: float
    d2: float
    delta_d: float
    scale_number: float
    gsd: float
    footprint: tuple[float, float]
    photos: tuple[int, int]
    sigma_r_rms: float
    sigma_r_corner: float
    sigma_ortho: float
    uncertain_radius: float
    uncertain_share: float
    feasible: bool
    note: str
    z0_1: float | None = None
    z0_2: float | None = None
    straight: tuple[float, float] = (0.0, 0.0)


class ThirdPhoto(NamedTuple):
    """What a third photo adds: as the near one, a step aside along the wall.

    Attributes
    ----------
    c, d, step : float
        Principal distance [mm], distance from the wall and step aside [m].
    at_nadir : float
        Expected sigma of the relief at the nadir of the pair, which alone tells nothing there. [m]
    at_rms : float
        That at the RMS radius of the frame, on all sides. [m]
    """

    c: float
    d: float
    step: float
    at_nadir: float
    at_rms: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plan:
    """Stations for every pair of lenses, best first.

    Attributes
    ----------
    sensor : CameraSensor
    stations : tuple of Station
        Feasible ones first, then by expected precision of the relief.
    sigma_px : float
        Picking precision the figures rest on. [px]
    sigma_r_max : float
        Bound of the area of uncertainty. [m]
    media : PairMedia
        What the photos look through.
    object_size : tuple of float or None
        Width and height of the wall. [m]
    free_space : float or None
        Room in front of the wall. [m]
    """

    sensor: CameraSensor
    stations: tuple[Station, ...]
    sigma_px: float
    sigma_r_max: float
    media: PairMedia = field(default_factory=PairMedia.none)
    object_size: tuple[float, float] | None = None
    free_space: float | None = None

    @property
    def best(self) -> Station:
        """The feasible station of best precision; of equal precision, that of the largest photo."""
        return self.stations[0]

    @property
    def basis(self) -> str:
        """What the sigmas rest on, in one line."""
        pair = Pair.ideal(d1=self.best.straight[0], d2=self.best.straight[1])
        return rests_on(
            pair, setup="stations and focal lengths exactly as planned",
            picks=f"picks of {self.sigma_px:g} px assumed in both photos",
        )  # fmt: skip

    def third_photo(self, station: Station, step: float | None = None) -> ThirdPhoto:
        """Return what a third photo adds to a pair, by default a sixth of its distance aside. [m]

        All rays of a point are intersected (`bifocal.PhotoSet.intersect`); the third camera is
        square to the wall, or turned back by some degrees, which changes next to nothing.
        """
        step = station.d2 * STEP if step is None else step
        d, c = (station.d1, station.d2), (station.c1, station.c2)
        pair = planned_pair(self.media, d, c, pitch=self.sensor.pitch, sigma_px=self.sigma_px)
        along = np.array([[1.0, 0.0, step], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        aside = replace(
            pair.image2, plane_from_pixel=along @ pair.image2.plane_from_pixel,
            nadir=pair.image2.nadir + np.array([step, 0.0]),
        )  # fmt: skip
        named = (replace(p, name=str(k)) for k, p in enumerate((pair.image1, pair.image2, aside)))
        photos = PhotoSet(photos=tuple(named))
        angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
        rms = float(np.hypot(*station.footprint)) / np.sqrt(12.0)
        xyz = rms * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        xyz = np.vstack([np.zeros((1, 3)), xyz])
        sigma = photos.intersect(photos.project(xyz)).sigma[:, 2]
        spread = float(np.sqrt(np.mean(sigma[1:] ** 2)))
        return ThirdPhoto(station.c2, station.d2, step, float(sigma[0]), spread)

    def sigma_grid(
        self, station: Station, *, columns: int = 9, rows: int = 7
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return X, Y from the nadir and sigma of r over the frame. [m].

        Returns
        -------
        x : ndarray, shape (columns,)
        y : ndarray, shape (rows,)
            Downwards from the top of the frame.
        sigma_r : ndarray, shape (rows, columns)
            NaN at the nadir itself, where relief is undefined.
        """
        half_w, half_h = station.footprint[0] / 2, station.footprint[1] / 2
        x = np.linspace(-half_w, half_w, columns)
        y = np.linspace(half_h, -half_h, rows)
        radius = np.hypot(*np.meshgrid(x, y))
        d, c = (station.d1, station.d2), (station.c1, station.c2)
        pair = planned_pair(self.media, d, c, pitch=self.sensor.pitch, sigma_px=self.sigma_px)
        return x, y, sigma_at(pair, np.where(radius < 1e-9, 0.0, radius))


def planned_pair(
    media: PairMedia, d: tuple[float, float], c: tuple[float, float], *, pitch: float,
    sigma_px: float,
) -> Pair:  # fmt: skip
    """Return the planned pair, square to the wall, its pixels counted from the middle."""
    pair = Pair.ideal(d1=d[0], d2=d[1], c1=c[0], c2=c[1], pixel_size=pitch, sigma=sigma_px)
    if not media:
        return pair
    square_on = np.diag([1.0, -1.0, -1.0])
    first, second = (
        replace(
            photo,
            **stated_by_photo(media, k, Pinhole(np.eye(3), square_on, np.array([0, 0, d[k]]))),
        )
        for k, photo in enumerate((pair.image1, pair.image2))
    )
    return Pair(image1=first, image2=second)


def sigma_at(pair: Pair, radius: FloatArray) -> FloatArray:
    """Return the sigma of relief on the plane at radii from the nadir, NaN at the nadir. [m]"""
    flat = radius.reshape(-1)
    xyz = np.column_stack([flat, np.zeros_like(flat), np.zeros_like(flat)])
    sigma = pair.intersect(*pair.project(xyz)).sigma[:, 2]
    return np.where(flat > 0, sigma, np.nan).reshape(radius.shape)
