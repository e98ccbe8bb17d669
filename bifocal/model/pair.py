"""A bifocal pair: two photos, their homographies to the wall, nadirs and distances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bifocal import rays
from bifocal.model.intersection import Intersection
from bifocal.model.lens import Lens
from photocore.arrays import FloatArray, as_points, positive, read_only
from photocore.errors import GeometryError, InputError
from photocore.jsonfile import read_object, write_object

FORMAT = "bifocal-pair/1"
#: Default measuring precision of a careful pick. [px]
SIGMA_PIXEL = 0.5
#: A cross-radial misfit beyond this many sigma is a blunder (one honest pick in 2000).
BLUNDER_LIMIT = 3.5
#: Beyond this share of d2 the standard deviation of r makes a point UNCERTAIN, beyond half WEAK.
UNCERTAIN_SHARE = 0.02


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
    extra : mapping
        Keys of the pair file this class does not use; kept.
    """

    plane_from_pixel: FloatArray
    nadir: FloatArray
    distance: float
    file: str = ""
    lens: Lens | None = None
    sigma_pixel: float | None = None
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
        if self.sigma_pixel is not None:
            set_(self, "sigma_pixel", positive(self.sigma_pixel, "sigma_pixel", unit="px"))

    @property
    def foot(self) -> rays.Foot:
        """Nadir and distance."""
        return rays.Foot(self.nadir, self.distance)

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

    def metres_per_pixel(self, pixels: FloatArray) -> FloatArray:
        """Return the derivative of the plane position by the pixel, shape (n, 2, 2). [m/px]"""
        points = pixels if self.lens is None else self.lens.undistort(pixels)
        return homography_jacobian(self.plane_from_pixel, points)

    def to_dict(self) -> dict[str, Any]:
        """Return the photo's part of the pair file."""
        data: dict[str, Any] = {"file": self.file} if self.file else {}
        data |= {
            "plane_from_pixel": self.plane_from_pixel,
            "nadir": self.nadir,
            "distance": self.distance,
        }
        if self.sigma_pixel is not None:
            data["sigma_pixel"] = self.sigma_pixel
        return data | dict(self.extra)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """A bifocal pair; image 1 is the far camera with the long lens.

    Attributes
    ----------
    image1, image2 : Photo
        Far and near photo, d1 > d2; given the other way round they are exchanged.
    folder : Path
        Folder of the pair file, to which the photos' names are relative.
    extra : mapping
        Other keys of the pair file; kept.
    remarks : tuple of str
        What the user should be told, e.g. that the images were exchanged.
    exchanged : bool
        Whether the images stand the other way round than they were given: measurements in the
        order given have to be exchanged too.
    """

    image1: Photo
    image2: Photo
    folder: Path = Path()
    extra: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    exchanged: bool = False

    def __post_init__(self) -> None:
        d1, d2 = self.image1.distance, self.image2.distance
        if d1 == d2:
            raise GeometryError(
                f"both cameras stand {d1:g} m from the plane: relief cannot be told from two "
                "photos taken at the same distance. Check `distance` of image1 and image2."
            )
        if d1 < d2:
            far, near = self.image2, self.image1
            object.__setattr__(self, "image1", far)
            object.__setattr__(self, "image2", near)
            object.__setattr__(self, "exchanged", not self.exchanged)
            note = f"image1 was the near camera ({d1:g} m < {d2:g} m); the two were exchanged."
            object.__setattr__(self, "remarks", (*self.remarks, note))

    @classmethod
    def read(cls, path: Path | str) -> Pair:
        """Read a pair file.

        Raises
        ------
        InputError
            If the file or one of its values is unusable; the message names the key.
        GeometryError
            If a homography is singular or both distances are equal.
        """
        data = read_object(path, what="pair file")
        try:
            return cls.from_dict(data, folder=Path(path).parent)
        except GeometryError as error:
            raise GeometryError(f"{path}: {error}") from None
        except InputError as error:
            raise InputError(f"{path}: {error}") from None

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], *, folder: Path = Path()) -> Pair:
        """Return the pair described by a pair file's content."""
        data = dict(data)
        found = data.pop("format", None)
        if found != FORMAT:
            raise InputError(f'"format" must be "{FORMAT}", found {found!r}.')
        if data.get("layers"):
            raise InputError(
                '"layers": pairs seen through other media are not supported by this version.'
            )
        far, near = (_photo_from_dict(data.pop(k, None), k, folder) for k in ("image1", "image2"))
        return cls(image1=far, image2=near, folder=folder, extra=data)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a pair file."""
        return {
            "format": FORMAT,
            "image1": self.image1.to_dict(),
            "image2": self.image2.to_dict(),
            **self.extra,
        }

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write a pair file, whole or not at all."""
        write_object(path, self.to_dict(), overwrite=overwrite)

    @property
    def zoom_centre(self) -> FloatArray:
        """The point e about which image 2 is a zoom of image 1, shape (2,). [m]"""
        return rays.zoom_centre(self.image1.foot, self.image2.foot)

    @property
    def base_factor(self) -> float:
        """B = d1 d2 / (d1 - d2): metres of relief per unit of relative radial shift. [m]"""
        d1, d2 = self.image1.distance, self.image2.distance
        return d1 * d2 / (d1 - d2)

    def project(self, xyz: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the pixels of points (X, Y, r) in both photos, each of shape (..., 2)."""
        return self.image1.project(xyz), self.image2.project(xyz)

    def intersect(
        self,
        pixels1: ArrayLike,
        pixels2: ArrayLike,
        *,
        sigma_px: float | None = None,
        sigma_d1: float = 0.0,
        sigma_d2: float = 0.0,
        sigma_scale: float = 0.0,
        sigma_nadir: float = 0.0,
        sigma_r_max: float | None = None,
    ) -> Intersection:
        """Intersect the two rays of every point by least squares.

        Parameters
        ----------
        pixels1, pixels2 : array_like, shape (n, 2)
            (column, row) of the same points in both photos; NaN where a point was not measured.
        sigma_px : float, optional
            Measuring precision per coordinate; by default the pair's own, else 0.5. [px]
        sigma_d1, sigma_d2 : float
            Standard deviation of the distances. [m]
        sigma_scale : float
            Standard deviation of the scale of image 2 against image 1, relative.
        sigma_nadir : float
            Standard deviation of each coordinate of each nadir. [m]
        sigma_r_max : float, optional
            Points of less precise relief are UNCERTAIN; default 2 % of d2. [m]

        Returns
        -------
        Intersection

        Raises
        ------
        InputError
            If the two arrays differ in shape.

        Notes
        -----
        The weighted sum of squared pixel corrections is minimised under the condition that both
        rays meet (`bifocal.rays.adjust_onto_epipolar_line`). On consistent data the relief is
        Midulla's Eq. (6). The distances', scale's and nadirs' uncertainty is common to all points:
        it is in every point's covariance, but not independent from point to point.
        """
        from bifocal.model.intersect import intersect_pair

        first = as_points(pixels1, "pixels1", dimension=2)
        second = as_points(pixels2, "pixels2", dimension=2)
        if first.shape != second.shape or first.ndim != 2:
            raise InputError(
                f"pixels1 {first.shape} and pixels2 {second.shape} must both have shape (n, 2)."
            )
        return intersect_pair(
            self,
            first,
            second,
            sigma_px=sigma_px,
            sigma_r_max=sigma_r_max,
            sigma_setup=(sigma_d1, sigma_d2, sigma_scale, sigma_nadir),
        )


def apply_homography(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Return points mapped by a 3x3 homography, shape (..., 2); NaN at the horizon."""
    scale = points[..., 0] * matrix[2, 0] + points[..., 1] * matrix[2, 1] + matrix[2, 2]
    x = points[..., 0] * matrix[0, 0] + points[..., 1] * matrix[0, 1] + matrix[0, 2]
    y = points[..., 0] * matrix[1, 0] + points[..., 1] * matrix[1, 1] + matrix[1, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(
            (scale == 0)[..., None], np.nan, np.stack([x, y], axis=-1) / scale[..., None]
        )


def homography_jacobian(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Return the derivative of a homography at points, shape (n, 2, 2)."""
    scale = points @ matrix[2, :2] + matrix[2, 2]
    mapped = apply_homography(matrix, points)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (matrix[None, :2, :2] - mapped[:, :, None] * matrix[None, None, 2, :2]) / (
            scale[:, None, None]
        )


def _photo_from_dict(data: Any, key: str, folder: Path) -> Photo:
    """Return one photo of a pair file, naming the key that is wrong."""
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
    try:
        return Photo(
            file=file,
            lens=Lens.read(folder / lens) if lens else None,
            plane_from_pixel=data.pop("plane_from_pixel"),
            nadir=data.pop("nadir"),
            distance=data.pop("distance"),
            sigma_pixel=data.pop("sigma_pixel", None),
            extra=data,
        )
    except GeometryError as error:
        raise GeometryError(f'"{key}": {error}') from None
    except InputError as error:
        raise InputError(f'"{key}": {error}') from None
