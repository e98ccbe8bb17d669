"""A bifocal pair: two photos, their homographies to the wall, nadirs and distances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bifocal import rays
from bifocal.model import orientation_precision
from bifocal.model.doubts import covariance_of_doubts, doubts_in_words
from bifocal.model.flags import FlagLimits
from bifocal.model.intersection import Intersection, intersect
from bifocal.model.photo import Photo
from bifocal.model.photo_entries import (
    PAIR_FORMAT,
    SET_FORMAT,
    file_content,
    photo_entries,
    write_content,
)
from bifocal.precision import base_factor
from bifocal.remarks import remark
from multimedia import Layers
from photocore.arrays import FloatArray, as_points, not_negative, positive
from photocore.errors import GeometryError, InputError, located
from photocore.jsonfile import read_object
from photocore.series import check_index

#: Parameters of two cameras in air.
_IN_AIR = len(orientation_precision.NAMES)


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
    orientation : ndarray, shape (k, k), or None
        Covariance of both cameras, and of the media where it counts them
        (`bifocal.model.orientation_precision.names_of`), common to all points; None where it is
        not known. That of cameras alone (24 parameters) says nothing of a pair through media.
    """

    image1: Photo
    image2: Photo
    folder: Path = Path()
    extra: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    exchanged: bool = False
    orientation: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.image1.layers != self.image2.layers:
            raise InputError(remark("pair.two_layers"))
        if self.orientation is not None:
            matrix = orientation_precision.checked_of(self.orientation, self.layers)
            object.__setattr__(self, "orientation", matrix)
        for name in ("image1", "image2"):
            photo = getattr(self, name)
            if photo.folder != self.folder:
                object.__setattr__(self, name, replace(photo, folder=self.folder))
        d1, d2 = self.image1.distance, self.image2.distance
        if d1 == d2:
            raise GeometryError(remark("pair.one_distance", d=d1))
        if d1 < d2:
            far, near = self.image2, self.image1
            object.__setattr__(self, "image1", far)
            object.__setattr__(self, "image2", near)
            object.__setattr__(self, "exchanged", not self.exchanged)
            if self.orientation is not None:
                turned = orientation_precision.exchanged(self.orientation)
                object.__setattr__(self, "orientation", turned)
            note = remark("pair.exchanged", d1=d1, d2=d2)
            object.__setattr__(self, "remarks", (*self.remarks, note))
        first, last = doubts_in_words(self.extra.get("setup")), self._doubts_about_media()
        if first or last:
            remarks = tuple(dict.fromkeys((*first, *self.remarks, *last)))
            object.__setattr__(self, "remarks", remarks)

    def _doubts_about_media(self) -> tuple[str, ...]:
        """Return what looks like a slip in what lies between cameras and object."""
        photos = (self.image1, self.image2)
        if self.layers is None:
            if all(photo.z0 is None for photo in photos):
                return ()
            return (remark("pair.no_layers"),)
        z0 = [photo.z0 or 0.0 for photo in photos]
        beyond = [
            photo.distance - z - self.layers.thickness for photo, z in zip(photos, z0, strict=True)
        ]
        doubts = tuple(f"layers: {doubt}" for doubt in self.layers.remarks_about(z0=z0, zp=beyond))
        if self.orientation is not None and not self._knows_its_precision:
            doubts += (remark("pair.no_covariance"),)
        return doubts

    @classmethod
    def ideal(
        cls,
        *,
        d1: float,
        d2: float,
        c1: float | None = None,
        c2: float | None = None,
        pixel_size: float | None = None,
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
        pixel_size : float, optional
            Size of a pixel. Without it, image coordinates are millimetres from the nadir point,
            y up; with it they are pixels (column, row). [mm/px]
        nadir1, nadir2 : array_like, shape (2,)
            (column, row) of the nadir points; used with ``pixel_size``. [px]
        sigma : float, optional
            Measuring precision of an image coordinate. [px, or mm without ``pixel_size``]

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
        for image, d, c, nadir in ((1, d1, c1, nadir1), (2, d2, c2, nadir2)):
            positive(d, f"d{image}", unit="m")
            metres = 1.0 if c is None else d / positive(c, f"c{image}", unit="mm")
            matrix = np.diag([metres, metres, 1.0])
            if pixel_size is not None:
                scale = metres * positive(pixel_size, "pixel_size", unit="mm")
                column, row = as_points(nadir, f"nadir{image}", dimension=2)
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
                    pixel_size=pixel_size,
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
    def from_dict(cls, data: Mapping[str, object], *, folder: Path = Path()) -> Pair:
        """Return the pair described by the content of a pair file, or of a set of two photos."""
        photos, precision, extra = photo_entries(data, folder, PAIR_FORMAT, SET_FORMAT)
        if len(photos) > 2:
            names = ", ".join(photo.name or Path(photo.file).name for photo in photos)
            raise InputError(remark("pair.set_of_more", count=len(photos), names=names))
        far, near = photos
        return cls(image1=far, image2=near, folder=folder, extra=extra, orientation=precision)

    def to_dict(self) -> dict[str, object]:
        """Return the content of a pair file."""
        photos = (self.image1, self.image2)
        head = {"image1": self.image1.to_dict(), "image2": self.image2.to_dict()}
        return file_content({"format": PAIR_FORMAT, **head}, photos, self.extra, self.orientation)

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write a pair file, whole or not at all."""
        write_content(path, self.to_dict(), overwrite=overwrite)

    @property
    def _knows_its_precision(self) -> bool:
        """Whether the covariance is that of all that places and bends the pair's rays."""
        whole = len(orientation_precision.names_of(self.layers))
        return self.orientation is not None and len(self.orientation) == whole

    @property
    def whole_orientation(self) -> FloatArray | None:
        """``orientation`` and what is known to be wrong; None where the pair states neither."""
        whole = self.orientation if self._knows_its_precision else None
        doubted = covariance_of_doubts(self.extra.get("setup"))
        if doubted is not None:
            size = len(orientation_precision.names_of(self.layers))
            whole = np.zeros((size, size)) if whole is None else whole.copy()
            whole[:_IN_AIR, :_IN_AIR] += doubted
        return whole

    @property
    def zoom_centre(self) -> FloatArray:
        """The point e about which image 2 is a zoom of image 1, shape (2,). [m]"""
        return rays.zoom_centre(self.image1.foot, self.image2.foot)

    @property
    def layers(self) -> Layers | None:
        """The media between cameras and object; None in air."""
        return self.image1.layers

    @property
    def refracted(self) -> bool:
        """Whether its photos look through other media than air."""
        return self.image1.refracted

    def in_air(self) -> Pair:
        """Return the pair with its media left out: what neglecting refraction makes of it."""
        photos = [replace(photo, layers=None, z0=None) for photo in (self.image1, self.image2)]
        of_cameras = None if self.orientation is None else self.orientation[:_IN_AIR, :_IN_AIR]
        return replace(self, image1=photos[0], image2=photos[1], remarks=(), orientation=of_cameras)

    @property
    def leans(self) -> bool:
        """Whether interfaces lean against the reference plane."""
        return self.image1.leans or self.image2.leans

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
        """B = d1 d2 / (d1 - d2): metres of relief per unit of relative radial shift. [m]

        Through media near the axis, with the distances of straight cameras that see alike.
        """
        d1, d2 = self.straight_distances
        return base_factor(d1=d1, d2=d2)

    @property
    def straight_distances(self) -> tuple[float, float]:
        """Distances of straight cameras that see as these near the axis; in air d1, d2. [m]"""
        return rays.straight(self.image1.foot).distance, rays.straight(self.image2.foot).distance

    @property
    def highest_relief(self) -> float:
        """Relief at which the last interface lies over a nadir, the lower one's; in air d2. [m]"""
        if not self.refracted:
            return self.d2
        photos = (self.image1, self.image2)
        return min(photo.media.highest for photo in photos if photo.media)

    @property
    def photo1(self) -> Photo:
        """The far photo; its `Photo.image` is the picture itself."""
        return self.image1

    @property
    def photo2(self) -> Photo:
        """The near photo; its `Photo.image` is the picture itself."""
        return self.image2

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
        if not self.photo(number).file:
            raise InputError(f'the pair file names no photo for "image{number}": add its "file".')
        return self.photo(number).path

    @property
    def photo_files(self) -> tuple[Path, ...]:
        """The image files that are named, of none to both photos."""
        return tuple(self.photo_file(k) for k in (1, 2) if self.photo(k).file)

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
        check_index("intersect", pixels1, pixels2)
        first = as_points(pixels1, "pixels1", dimension=2)
        second = as_points(pixels2, "pixels2", dimension=2)
        if first.shape != second.shape:
            raise InputError(remark("pair.pixel_shapes", shape=first.shape, other=second.shape))
        shape = first.shape[:-1]
        first, second = first.reshape(-1, 2), second.reshape(-1, 2)
        if sigma_r_max is not None:
            positive(sigma_r_max, "sigma_r_max", unit="m")
        shared = {"d1": sigma_d1, "d2": sigma_d2, "scale": sigma_scale, "nadir": sigma_nadir}
        d1, d2, scale, nadir = (not_negative(v, f"sigma_{k}") for k, v in shared.items())
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
            Zero where the pair does not state it, or through media only that of its cameras; with
            what its file says is wrong with it, as a bent wall.
            Common to all points: neighbours share it.
        """
        if (whole := self.whole_orientation) is None:
            return np.zeros((len(xyz), 3, 3))
        photos = (self.image1, self.image2)
        return orientation_precision.orientation_covariance(photos, whole, xyz)

    def effect_of_orientation(self, xyz: FloatArray) -> FloatArray | None:
        """Return what independent errors of the pair's own orientation, of sigma 1, move points by.

        Parameters
        ----------
        xyz : ndarray, shape (n, 3)
            Points. [m]

        Returns
        -------
        ndarray, shape (n, 3, k), or None
            Errors in X, Y, r [m], the same k errors for all points; None where the pair does not
            state its covariance, or through media only that of its cameras.
        """
        if (whole := self.whole_orientation) is None:
            return None
        photos = (self.image1, self.image2)
        return orientation_precision.orientation_effect(photos, whole, xyz)
