"""One photo of a pair: its homography to the wall, nadir, distance and lens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bifocal import rays
from bifocal.model.flags import SIGMA_PIXEL
from bifocal.model.homography import apply_homography, homography_jacobian
from bifocal.model.intersection import PlanePicks
from bifocal.model.lens import Lens
from photocore.arrays import BoolArray, FloatArray, as_points, positive, read_only
from photocore.errors import GeometryError, InputError, located

#: No wall is photographed from further away, nor has coordinates beyond. [m]
FARTHEST, OUTERMOST = 1e5, 1e8
#: Numbers of a photo that the pair file may hold, with their units.
_OPTIONAL = {"sigma_pixel": "px", "principal_distance": "mm", "pixel_size": "mm"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Photo:
    """One photo of a pair: with nadir and distance the homography is the whole pinhole camera.

    Attributes
    ----------
    plane_from_pixel : ndarray, shape (3, 3)
        Homography from (column, row, 1), free of lens distortion, to metres on the plane.
    nadir : ndarray, shape (2,)
        Foot of the projection centre on the reference plane. [m]
    distance : float
        Distance of the projection centre to the reference plane. [m]
    file : str
        Image file, relative to the pair file; empty where no image is needed.
    lens : Lens or None
        Distortion of the pixels; None if they are free of it.
    sigma_pixel : float or None
        Measuring precision. [px]
    principal_distance, pixel_size : float or None
        Of the camera, for lengths in millimetres of the image. [mm]
    extra : mapping
        Keys of the pair file this class does not use; kept.
    """

    plane_from_pixel: FloatArray
    nadir: FloatArray
    distance: float
    file: str = ""
    lens: Lens | None = None
    sigma_pixel: float | None = None
    principal_distance: float | None = None
    pixel_size: float | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        matrix = read_only(self.plane_from_pixel, "plane_from_pixel", shape=(3, 3))
        scaled = matrix / (np.abs(matrix).max() or 1.0)
        # The image is some 1e4 px across: what matters is rank after bringing it to unit size.
        if abs(np.linalg.det(scaled @ np.diag([1e4, 1e4, 1.0]))) < 1e-12:
            raise GeometryError(
                "plane_from_pixel: the homography is singular; it would squeeze the photo onto a "
                "line. Check the nine numbers, or make the pair again with `bifocal align`."
            )
        set_(self, "plane_from_pixel", matrix)
        set_(self, "nadir", read_only(self.nadir, "nadir", shape=(2,)))
        set_(self, "distance", positive(self.distance, "distance", unit="m"))
        for name, most in (("nadir", OUTERMOST), ("distance", FARTHEST)):
            if np.max(np.abs(getattr(self, name))) > most:
                raise InputError(
                    f"{name}: {getattr(self, name)} m is beyond reason (more than {most:g} m); "
                    "check the number and its unit, metres."
                )
        for name, unit in _OPTIONAL.items():
            value = getattr(self, name)
            set_(self, name, None if value is None else positive(value, name, unit=unit))

    @property
    def foot(self) -> rays.Foot:
        """Nadir and distance."""
        return rays.Foot(self.nadir, self.distance)

    @property
    def scale_number(self) -> float | None:
        """Scale number m = 1000 d / c of the photo; None without a principal distance."""
        c = self.principal_distance
        return None if c is None else 1000.0 * self.distance / c

    def plane_from_pixels(self, pixels: ArrayLike) -> FloatArray:
        """Return where the rays of (raw) pixels meet the reference plane, shape (..., 2). [m]

        NaN where the ray does not meet the plane (at or beyond the horizon).
        """
        points = as_points(pixels, "pixels", dimension=2)
        if self.lens is not None:
            points = self.lens.undistort(points)
        return apply_homography(self.plane_from_pixel, points)

    def pixels_from_plane(self, positions: ArrayLike) -> FloatArray:
        """Return the (raw) pixels that see plane positions, shape (..., 2). [px]"""
        points = as_points(positions, "positions", dimension=2)
        ideal = apply_homography(np.linalg.inv(self.plane_from_pixel).astype(np.float64), points)
        return ideal if self.lens is None else self.lens.distort(ideal)

    def project(self, xyz: ArrayLike) -> FloatArray:
        """Return the (raw) pixels of points (X, Y, r), shape (..., 2); NaN behind the camera."""
        points = as_points(xyz, "xyz", dimension=3)
        return self.pixels_from_plane(rays.plane_position(points, self.foot))

    def precision(self, sigma_px: float | None = None) -> float:
        """Return the measuring precision: as given, else the photo's own, else 0.5. [px]"""
        given = self.sigma_pixel if sigma_px is None else sigma_px
        return positive(SIGMA_PIXEL if given is None else given, "sigma_px", unit="px")

    def picks(self, pixels: FloatArray, sigma_px: float | None = None) -> PlanePicks:
        """Return picks carried to the plane, of the given precision or else the photo's own."""
        return PlanePicks(
            positions=self.plane_from_pixels(pixels),
            metres_per_pixel=self.metres_per_pixel(pixels),
            sigma_px=self.precision(sigma_px),
            foot=self.foot,
        )

    def metres_per_pixel(self, pixels: FloatArray) -> FloatArray:
        """Return the derivative of the plane position by the pixel, shape (n, 2, 2). [m/px]"""
        points = pixels if self.lens is None else self.lens.undistort(pixels)
        return homography_jacobian(self.plane_from_pixel, points)

    def sees_ahead(self, positions: FloatArray, shape: tuple[int, ...]) -> BoolArray:
        """Tell which plane positions lie on the photo's side of its horizon.

        Parameters
        ----------
        positions : ndarray, shape (..., 2)
            [m]
        shape : (height, width, ...)
            Of the photo. [px]
        """
        inverse = np.linalg.inv(self.plane_from_pixel)
        scale = positions @ inverse[2, :2] + inverse[2, 2]
        # q = H p / w and p = H^-1 q * w: both scales have the same sign where the photo looks.
        reference = self.plane_from_pixel[2] @ [shape[1] / 2, shape[0] / 2, 1.0]
        return np.asarray(scale * reference > 0)

    def gsd(self, size: tuple[int, int]) -> float:
        """Return the side of a pixel in the middle of a photo of (width, height) px. [m]

        Raises
        ------
        GeometryError
            If its middle does not look at the reference plane.
        """
        middle = np.array([[(size[0] - 1) / 2, (size[1] - 1) / 2]])
        area = abs(float(np.linalg.det(self.metres_per_pixel(middle)[0])))
        if not (np.isfinite(area) and area > 0):
            raise GeometryError(
                "the middle of the photo does not look at the reference plane; check "
                "plane_from_pixel."
            )
        return float(np.sqrt(area))

    @classmethod
    def from_dict(cls, data: Any, key: str, folder: Path) -> Photo:
        """Return a photo from its part of the pair file.

        Parameters
        ----------
        data : mapping
            What stands in the pair file under ``key``.
        key : str
            ``"image1"`` or ``"image2"``, for messages.
        folder : Path
            Where the pair file lies; its lens file is looked for from there.

        Raises
        ------
        InputError, GeometryError
            Naming the key that is wrong.
        """
        if not isinstance(data, dict):
            raise InputError(f'"{key}" is missing or not an object.')
        data = dict(data)
        missing = [name for name in ("plane_from_pixel", "nadir", "distance") if name not in data]
        if missing:
            raise InputError(f'"{key}" lacks {", ".join(missing)}.')
        file = data.pop("file", "")
        if not isinstance(file, str):
            raise InputError(f'"{key}.file" must be text, found {file!r}.')
        lens = data.get("lens")
        if lens is not None and not isinstance(lens, str):
            raise InputError(f'"{key}.lens" must name a lens file, found {lens!r}.')
        with located(f'"{key}"'):
            for name in ("distance", *_OPTIONAL):
                if isinstance(data.get(name), list):  # an array of one would pass for a number
                    raise InputError(f"{name}: expected one number, found {data[name]!r:.40}.")
            return cls(
                file=file,
                lens=Lens.read(folder / lens) if lens else None,
                plane_from_pixel=data.pop("plane_from_pixel"),
                nadir=data.pop("nadir"),
                distance=data.pop("distance"),
                **{name: data.pop(name, None) for name in _OPTIONAL},
                extra=data,
            )

    def to_dict(self) -> dict[str, Any]:
        """Return the photo's part of the pair file."""
        data: dict[str, Any] = {"file": self.file} if self.file else {}
        data |= {
            "plane_from_pixel": self.plane_from_pixel,
            "nadir": self.nadir,
            "distance": self.distance,
        }
        data |= {name: value for name in _OPTIONAL if (value := getattr(self, name)) is not None}
        return data | dict(self.extra)
