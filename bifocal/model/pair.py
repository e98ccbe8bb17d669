"""A bifocal pair: two photos, their homographies to the wall, nadirs and distances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bifocal import rays
from bifocal.model import orientation_precision
from bifocal.model.flags import SIGMA_PIXEL, FlagLimits
from bifocal.model.intersection import Intersection, PlanePicks, intersect
from bifocal.model.lens import Lens
from bifocal.precision import base_factor
from photocore.arrays import (
    BoolArray,
    FloatArray,
    as_points,
    not_negative,
    positive,
    read_only,
)
from photocore.errors import GeometryError, InputError, located
from photocore.jsonfile import read_object, write_object

FORMAT = "bifocal-pair/1"


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
    orientation : ndarray, shape (24, 24), or None
        Covariance of both cameras (`bifocal.model.orientation_precision.NAMES`), common to all
        points; None where it is not known.
    """

    image1: Photo
    image2: Photo
    folder: Path = Path()
    extra: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    exchanged: bool = False
    orientation: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.orientation is not None:
            object.__setattr__(self, "orientation", orientation_precision.checked(self.orientation))
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
            if self.orientation is not None:
                turned = orientation_precision.exchanged(self.orientation)
                object.__setattr__(self, "orientation", turned)
            note = f"image1 was the near camera ({d1:g} m < {d2:g} m); the two were exchanged."
            object.__setattr__(self, "remarks", (*self.remarks, note))

    @classmethod
    def ideal(
        cls,
        *,
        d1: float,
        d2: float,
        c1: float | None = None,
        c2: float | None = None,
        pitch: float | None = None,
        nadir1: ArrayLike = (0.0, 0.0),
        nadir2: ArrayLike = (0.0, 0.0),
        sigma: float | None = None,
    ) -> Pair:
        """Return the pair of two photos taken square to the plane from one nadir point.

        Parameters
        ----------
        d1, d2 : float
            Distances of the projection centres to the reference plane. [m]
        c1, c2 : float, optional
            Principal distances; without both, image millimetres count as metres on the wall. [mm]
        pitch : float, optional
            Size of a pixel. Without it, image coordinates are millimetres from the nadir point,
            y up; with it they are pixels (column, row). [mm/px]
        nadir1, nadir2 : array_like, shape (2,)
            (column, row) of the nadir points; used with ``pitch``. [px]
        sigma : float, optional
            Measuring precision of an image coordinate. [px, or mm without ``pitch``]

        Raises
        ------
        InputError
            If a value is not a number above zero, or only one principal distance is given.
        GeometryError
            If both distances are equal.

        Notes
        -----
        For picks on one radius `intersect` is Midulla's closed form, Eqs. (5) to (7); a misfit
        across the radius changes relief in second order only.

        Examples
        --------
        A point 2 m right of the nadir, 1 m before the wall, measured in millimetres:

        >>> pair = Pair.ideal(d1=17.5, d2=9.5, c1=35, c2=19)
        >>> pair.intersect([[35 * 2 / 16.5, 0]], [[19 * 2 / 8.5, 0]]).xyz.round(9).tolist()
        [[2.0, 0.0, 1.0]]
        """
        if (c1 is None) != (c2 is None):
            raise InputError("c1, c2: give both principal distances or none.")
        photos = []
        for d, c, nadir in ((d1, c1, nadir1), (d2, c2, nadir2)):
            metres = 1.0 if c is None else positive(d, "d", unit="m") / positive(c, "c", unit="mm")
            matrix = np.diag([metres, metres, 1.0])
            if pitch is not None:
                scale = metres * positive(pitch, "pitch", unit="mm")
                column, row = as_points(nadir, "nadir", dimension=2)
                matrix = np.array(
                    [[scale, 0, -scale * column], [0, -scale, scale * row], [0, 0, 1]]
                )
            photos.append(
                Photo(
                    plane_from_pixel=matrix,
                    nadir=np.zeros(2),
                    distance=d,
                    sigma_pixel=sigma,
                    principal_distance=c,
                    pixel_size=pitch,
                )
            )
        return cls(image1=photos[0], image2=photos[1])

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
        with located(path):
            return cls.from_dict(data, folder=Path(path).parent)

    @classmethod
    def of(cls, source: Pair | Path | str) -> Pair:
        """Return a pair as it is, or read its file."""
        return source if isinstance(source, Pair) else cls.read(source)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], *, folder: Path = Path()) -> Pair:
        """Return the pair described by a pair file's content."""
        data = dict(data)
        stated = data.pop("format", None)
        if stated != FORMAT:
            raise InputError(f'"format" must be "{FORMAT}", found {stated!r}.')
        if data.get("layers"):
            raise InputError(
                '"layers": pairs seen through other media are not supported by this version.'
            )
        far, near = (_photo_from_dict(data.pop(k, None), k, folder) for k in ("image1", "image2"))
        stated = data.pop("orientation", None)
        precision = None if stated is None else orientation_precision.from_dict(stated)
        return cls(image1=far, image2=near, folder=folder, extra=data, orientation=precision)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of a pair file."""
        data = {
            "format": FORMAT,
            "image1": self.image1.to_dict(),
            "image2": self.image2.to_dict(),
            **self.extra,
        }
        if self.orientation is not None:
            data["orientation"] = orientation_precision.as_dict(self.orientation)
        return data

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write a pair file, whole or not at all."""
        write_object(path, self.to_dict(), overwrite=overwrite)

    @property
    def zoom_centre(self) -> FloatArray:
        """The point e about which image 2 is a zoom of image 1, shape (2,). [m]"""
        return rays.zoom_centre(self.image1.foot, self.image2.foot)

    @property
    def d1(self) -> float:
        """Distance of the far camera to the reference plane. [m]"""
        return self.image1.distance

    @property
    def d2(self) -> float:
        """Distance of the near camera to the reference plane. [m]"""
        return self.image2.distance

    @property
    def base_factor(self) -> float:
        """B = d1 d2 / (d1 - d2): metres of relief per unit of relative radial shift. [m]"""
        return base_factor(d1=self.d1, d2=self.d2)

    def photo(self, number: int) -> Photo:
        """Return image 1 or 2."""
        return self.image1 if number == 1 else self.image2

    def photo_file(self, number: int) -> Path:
        """Return the image file of photo 1 or 2.

        Raises
        ------
        InputError
            If the pair file names none.
        """
        file = self.photo(number).file
        if not file:
            raise InputError(f'the pair file names no photo for "image{number}": add its "file".')
        return self.folder / file

    @property
    def as_given(self) -> tuple[Photo, Photo]:
        """The photos in the order they were given, not far before near."""
        return (self.image2, self.image1) if self.exchanged else (self.image1, self.image2)

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
        pixels1, pixels2 : array_like, shape (..., 2)
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
            Its arrays begin with the shape of the points; ``flags`` is one row after the other.

        Raises
        ------
        InputError
            If the two arrays differ in shape, or a precision is impossible.

        Notes
        -----
        The weighted sum of squared pixel corrections is minimised under the condition that both
        rays meet (`bifocal.rays.adjust_onto_epipolar_line`). On consistent data the relief is
        Midulla's Eq. (6). The uncertainty of the orientation (the pair's own, and what is given
        here) is common to all points: it is in every point's covariance, but not independent from
        point to point.
        """
        first = as_points(pixels1, "pixels1", dimension=2)
        second = as_points(pixels2, "pixels2", dimension=2)
        if first.shape != second.shape:
            raise InputError(
                f"pixels1 {first.shape} and pixels2 {second.shape} must both have shape (..., 2), "
                "the same."
            )
        shape = first.shape[:-1]
        first, second = first.reshape(-1, 2), second.reshape(-1, 2)
        if sigma_r_max is not None:
            positive(sigma_r_max, "sigma_r_max", unit="m")
        common = {"d1": sigma_d1, "d2": sigma_d2, "scale": sigma_scale, "nadir": sigma_nadir}
        d1, d2, scale, nadir = (not_negative(v, f"sigma_{k}") for k, v in common.items())
        return intersect(
            self.image1.picks(first, sigma_px),
            self.image2.picks(second, sigma_px),
            limits=FlagLimits(sigma_r_max=sigma_r_max),
            sigma_orientation=(d1, d2, scale, nadir),
            of_orientation=self.covariance_of_orientation,
        ).reshaped(shape)

    def covariance_of_orientation(self, xyz: FloatArray) -> FloatArray:
        """Return what the pair's own covariance adds to that of points, shape (n, 3, 3). [m²]

        Parameters
        ----------
        xyz : ndarray, shape (n, 3)
            Points. [m]

        Returns
        -------
        ndarray, shape (n, 3, 3)
            Zero where the pair does not state it. Common to all points: neighbours share it.
        """
        if self.orientation is None:
            return np.zeros((len(xyz), 3, 3))
        photos = (self.image1, self.image2)
        return orientation_precision.orientation_covariance(photos, self.orientation, xyz)


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
    with located(f'"{key}"'):
        for name in ("distance", *_OPTIONAL):
            if isinstance(data.get(name), list):  # an array of one would pass for a number
                raise InputError(f"{name}: expected one number, found {data[name]!r:.40}.")
        return Photo(
            file=file,
            lens=Lens.read(folder / lens) if lens else None,
            plane_from_pixel=data.pop("plane_from_pixel"),
            nadir=data.pop("nadir"),
            distance=data.pop("distance"),
            **{name: data.pop(name, None) for name in _OPTIONAL},
            extra=data,
        )
