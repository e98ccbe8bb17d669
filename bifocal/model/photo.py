"""One photo of a pair: its homography to the wall, nadir, distance and lens."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bifocal import rays
from bifocal.media import MediaPath, interface_axes
from bifocal.model.flags import SIGMA_PIXEL
from bifocal.model.homography import apply_homography, homography_jacobian
from bifocal.model.intersection import PlanePicks
from bifocal.model.lens import Lens
from bifocal.model.orientation_precision import pinhole
from bifocal.remarks import remark
from multimedia import Layers
from photocore.arrays import BoolArray, FloatArray, as_points, not_negative, positive, read_only
from photocore.camera import inverse_2x2
from photocore.errors import GeometryError, InputError, located
from photocore.jsonfile import plain
from photocore.names import on_disk
from photocore.provenance import changes_are_taken, digest_of, known_hash

#: No wall is photographed from further away, nor has coordinates beyond. [m]
FARTHEST, OUTERMOST = 1e5, 1e8
#: What is typed beyond this is in millimetres or centimetres, unless something measured agrees. [m]
FARTHEST_WALL = 500.0
#: Numbers of a photo that the pair file may hold, with their units.
_OPTIONAL = {"sigma_pixel": "px", "principal_distance": "mm", "pixel_size": "mm"}
#: Least cosine between the normal of interfaces and that of the reference plane.
LEAST_COSINE = 0.1
#: The normal of a port that is square to the camera's optical axis.
AXIS = "axis"
#: What else it holds where the pair file has `layers`.
_MEDIA = ("z0", "interface_normal")


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
    name : str
        What it is called in a set of photos.
    lens : Lens or None
        Distortion of the pixels; None if they are free of it.
    sigma_pixel : float or None
        Measuring precision. [px]
    image_size : tuple of int, or None
        Width and height of the photo that the homography belongs to; None where not known. [px]
    principal_distance, pixel_size : float or None
        Of the camera, for lengths in millimetres of the image. [mm]
    sha256 : str
        Of the image file that the photo was oriented with; empty where that is not known.
    layers : Layers or None
        Media between camera and object, the same for both photos of a pair; None in air.
    z0 : float or None
        Centre to the first interface, along its normal. [m]
    interface_normal : ndarray, shape (3,), or None
        Normal of the interfaces, (X, Y, r), towards the camera; None where they are parallel to
        the reference plane. In the pair file ``"axis"`` stands for a port square to the camera's
        optical axis.
    extra : mapping
        Keys of the pair file this class does not use; kept.
    folder : Path
        Of the pair file.
    """

    plane_from_pixel: FloatArray
    nadir: FloatArray
    distance: float
    file: str = ""
    name: str = ""
    lens: Lens | None = None
    sigma_pixel: float | None = None
    image_size: tuple[int, int] | None = None
    principal_distance: float | None = None
    pixel_size: float | None = None
    sha256: str = ""
    layers: Layers | None = None
    z0: float | None = None
    interface_normal: FloatArray | None = None
    extra: Mapping[str, object] = field(default_factory=dict)
    folder: Path = Path()
    #: What the rays cross on their way; follows from the above.
    media: MediaPath | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        matrix = read_only(self.plane_from_pixel, "plane_from_pixel", shape=(3, 3))
        set_(self, "nadir", read_only(self.nadir, "nadir", shape=(2,)))
        # In a national grid, far from 0, 0, what counts is the shape about the nadir.
        near = matrix - np.outer(np.append(self.nadir, 0.0), matrix[2])
        scaled = near / (np.abs(near).max() or 1.0)
        # The image is some 1e4 px across: what matters is rank after bringing it to unit size.
        if abs(np.linalg.det(scaled @ np.diag([1e4, 1e4, 1.0]))) < 1e-12:
            raise GeometryError(remark("photo.singular"))
        set_(self, "plane_from_pixel", matrix)
        set_(self, "distance", positive(self.distance, "distance", unit="m"))
        for name, most in (("nadir", OUTERMOST), ("distance", FARTHEST)):
            if np.max(np.abs(getattr(self, name))) > most:
                raise InputError(
                    f"{name}: {getattr(self, name)} m is beyond reason (more than {most:g} m); "
                    "check the number and its unit, metres."
                )
        if self.image_size is not None:
            set_(self, "image_size", _whole_size(self.image_size))
        for name, unit in _OPTIONAL.items():
            value = getattr(self, name)
            set_(self, name, None if value is None else positive(value, name, unit=unit))
        if self.interface_normal is not None:
            set_(self, "interface_normal", _checked_normal(self.interface_normal))
        if self.z0 is not None:
            set_(self, "z0", not_negative(self.z0, "z0"))
        if self.layers is not None:
            set_(self, "media", self._media_path(self.layers))

    def _media_path(self, layers: Layers) -> MediaPath:
        """Return what the rays cross, refusing interfaces that cannot lie where they are said to.

        Raises
        ------
        InputError, GeometryError
            If z0 is missing, or the object's medium would begin behind the reference plane.
        """
        if self.z0 is None:
            raise InputError(remark("photo.no_z0"))
        turn = None if self.interface_normal is None else interface_axes(self.towards_camera)
        path = MediaPath(layers=layers, z0=self.z0, distance=self.distance, rotation=turn)
        if not path.holds(np.zeros(2), np.zeros(())):
            about = {"depth": path.last_interface, "distance": self.distance}
            raise GeometryError(remark("photo.interface_behind", **about))
        return path

    @property
    def path(self) -> Path:
        """The image file.

        Raises
        ------
        InputError
            If none is named.
        """
        if not self.file:
            raise InputError('the pair file names no photo here: add its "file".')
        return on_disk(self.folder / self.file)

    @property
    def image(self) -> NDArray[Any]:
        """The picture, upright as seen, shape (h, w, 3) or (h, w); read when it is asked for.

        Raises
        ------
        InputError
            If its file is not named, gone, no photo, or of another size than the pair was made
            from.
        """
        from photocore.images import read_image

        image = read_image(self.path)
        self.check_size((image.shape[1], image.shape[0]), self.path)
        self.check_file(self.path)
        return image

    @property
    def foot(self) -> rays.Foot:
        """Nadir, distance and what the rays cross."""
        return rays.Foot(self.nadir, self.distance, self.media)

    @property
    def refracted(self) -> bool:
        """Whether its rays cross other media than air."""
        return self.media is not None

    @property
    def leans(self) -> bool:
        """Whether its interfaces lean against the reference plane."""
        return self.media is not None and self.media.rotation is not None

    @property
    def towards_camera(self) -> FloatArray:
        """Unit normal of its interfaces, or of the reference plane, towards the camera, (3,)."""
        normal = self.interface_normal
        if normal is None:
            return np.array([0.0, 0.0, 1.0])
        return np.asarray(normal / np.linalg.norm(normal))

    @property
    def scale_number(self) -> float | None:
        """Scale number m = 1000 d / c of the photo; None without a principal distance."""
        c = self.principal_distance
        return None if c is None else 1000.0 * self.distance / c

    def plane_from_pixels(self, pixels: ArrayLike) -> FloatArray:
        """Return where the rays of (raw) pixels meet the reference plane, shape (..., 2). [m]

        Bent by the media on their way. NaN where the ray does not meet the plane (at or beyond the
        horizon, or totally reflected).
        """
        return rays.object_rays(self.apparent_from_pixels(pixels), self.foot).position

    def apparent_from_pixels(self, pixels: ArrayLike) -> FloatArray:
        """Return where the rays of (raw) pixels would meet the plane if they went straight on.

        Without media `plane_from_pixels`, shape (..., 2). [m]
        """
        points = as_points(pixels, "pixels", dimension=2)
        if self.lens is not None:
            points = self.lens.undistort(points)
        return apply_homography(self.plane_from_pixel, points)

    def pixels_from_plane(self, positions: ArrayLike) -> FloatArray:
        """Return the (raw) pixels that see plane positions, shape (..., 2). [px]"""
        points = as_points(positions, "positions", dimension=2)
        return self.pixels_from_apparent(rays.apparent_of_plane(points, self.foot))

    def pixels_from_apparent(self, positions: FloatArray) -> FloatArray:
        """Return the (raw) pixels whose rays, going straight on, meet the plane at positions."""
        inverse = np.linalg.inv(self.plane_from_pixel).astype(np.float64)
        ideal = apply_homography(inverse, positions)
        return ideal if self.lens is None else self.lens.distort(ideal)

    def project(self, xyz: ArrayLike) -> FloatArray:
        """Return the (raw) pixels of points (X, Y, r), shape (..., 2).

        NaN for what the camera cannot see: behind it, or on its side of the last interface.
        """
        points = as_points(xyz, "xyz", dimension=3)
        return self.pixels_from_apparent(rays.plane_position(points, self.foot))

    def pixels_by_point(self, xyz: ArrayLike) -> FloatArray:
        """Return the derivatives of the ideal pixels by (X, Y, r), shape (..., 2, 3). [px/m]

        Ideal pixels are those free of lens distortion; equal to `project` without a lens.
        """
        points = as_points(xyz, "xyz", dimension=3)
        flat = points.reshape(-1, 3)
        ideal = apply_homography(
            np.linalg.inv(self.plane_from_pixel), rays.plane_position(flat, self.foot)
        )
        metres = homography_jacobian(self.plane_from_pixel, ideal)
        rows = inverse_2x2(metres) @ rays.design_rows(flat, self.foot)
        return np.asarray(rows.reshape(*points.shape[:-1], 2, 3))

    def precision(self, sigma_px: float | None = None) -> float:
        """Return the measuring precision: as given, else the photo's own, else 0.5. [px]"""
        sigma = self.sigma_pixel if sigma_px is None else sigma_px
        return positive(SIGMA_PIXEL if sigma is None else sigma, "sigma_px", unit="px")

    def picks(self, pixels: FloatArray, sigma_px: float | None = None) -> PlanePicks:
        """Return picks carried to the plane, of the given precision or else the photo's own."""
        return PlanePicks(
            positions=self.apparent_from_pixels(pixels),
            metres_per_pixel=self.apparent_by_pixel(pixels),
            sigma_px=self.precision(sigma_px),
            foot=self.foot,
        )

    def metres_per_pixel(self, pixels: FloatArray, relief: ArrayLike = 0.0) -> FloatArray:
        """Return the derivative of points at a relief by the ideal pixel, (n, 2, 2). [m/px]"""
        apparent, height = self.apparent_by_pixel(pixels), np.asarray(relief)[..., None, None]
        if self.media is None:
            return np.asarray(apparent * rays.reduction(height, self.distance))
        away = self.apparent_from_pixels(pixels) - self.nadir
        _, place, slope = self.media.trace_with_jacobian(away)
        return np.asarray((place + height * slope) @ apparent)

    def apparent_by_pixel(self, pixels: FloatArray) -> FloatArray:
        """Return the derivative of the apparent position by the pixel, shape (n, 2, 2). [m/px]"""
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
        positions = rays.apparent_of_plane(positions, self.foot)
        scale = positions @ inverse[2, :2] + inverse[2, 2]
        # q = H p / w and p = H^-1 q * w: both scales have the same sign where the photo looks.
        reference = self.plane_from_pixel[2] @ [shape[1] / 2, shape[0] / 2, 1.0]
        return np.asarray(scale * reference > 0)

    def check_size(self, size: tuple[int, int], name: Path | str) -> None:
        """Refuse a photo of another size than that the homography belongs to.

        Parameters
        ----------
        size : tuple of int
            Width and height of the photo. [px]
        name : path or str
            What to call it.

        Raises
        ------
        InputError
            With both sizes, and what became of the photo.
        """
        size0 = self.image_size
        if size0 is None or size == size0:
            return
        ratio = size[0] / size0[0], size[1] / size0[1]
        what = "a part of it, or another photo"
        if abs(ratio[0] - ratio[1]) <= max(1 / size0[0], 1 / size0[1]):  # within a rounded pixel
            what = f"a copy {'reduced' if ratio[0] < 1 else 'enlarged'} to {ratio[0]:.3g} of it"
        elif size == size0[::-1]:
            what = "it turned by 90 degrees"
        raise InputError(
            f"{name}: {size[0]} x {size[1]} px, the pair was made from {size0[0]} x {size0[1]} px: "
            f"this is {what}. Use the photo as it was, or align this one anew."
        )

    def check_file(self, path: Path, others: Iterable[Photo] = ()) -> None:
        """Refuse a file that is not the one the photo was oriented with, where that is known.

        Parameters
        ----------
        path : Path
            The image file.
        others : iterable of Photo
            Of which it may be one.

        Raises
        ------
        InputError
            Naming the photo that it is, if it is another of these.
        """
        if not self.sha256 or changes_are_taken() or (digest := known_hash(path)) == self.sha256:
            return
        match = next((one for one in others if one.sha256 == digest), None)
        if match is not None:
            raise InputError(remark("photo.exchanged", of=path, name=Path(match.file).name))
        raise InputError(remark("photo.changed", of=path))

    @property
    def digest(self) -> str:
        """What tells this orientation from another one: 16 letters, whatever file holds it."""
        lens, matrix = self.lens, self.plane_from_pixel
        values = {
            "plane_from_pixel": matrix / matrix.flat[np.abs(matrix).argmax()],
            "station": [*self.nadir, self.distance],
            "lens": lens and [lens.model, *lens.camera_matrix.ravel(), *lens.coefficients],
            "media": self.layers and self.layers.as_dict(),
            "port": [self.z0, self.interface_normal],
        }
        return digest_of(_rounded(plain(values)))[:16]

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
            raise GeometryError(remark("photo.looks_away"))
        return float(np.sqrt(area))

    @classmethod
    def from_dict(
        cls,
        data: Any,
        key: str,
        folder: Path,
        layers: Layers | None = None,
        *,
        lens_of: Callable[[Path], Lens] = Lens.read,
    ) -> Photo:
        """Return a photo from its part of the file of a pair or set.

        Parameters
        ----------
        data : mapping
            What stands in the pair file under ``key``.
        key : str
            ``"image1"``, ``"photos[0]"`` ..., for messages.
        folder : Path
            Where the pair file lies; its lens file is looked for from there.
        layers : Layers, optional
            The media that the file states for all photos.
        lens_of : callable
            What reads a lens file.

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
        file, called, sha256 = (data.pop(part, "") for part in ("file", "name", "sha256"))
        for part, text in (("file", file), ("name", called), ("sha256", sha256)):
            if not isinstance(text, str):
                raise InputError(f'"{key}.{part}" must be text, found {text!r}.')
        lens = data.get("lens")
        if lens is not None and not isinstance(lens, str):
            raise InputError(f'"{key}.lens" must name a lens file, found {lens!r}.')
        with located(f'"{key}"'):
            for name in ("distance", "z0", *_OPTIONAL):
                if isinstance(data.get(name), list):  # an array of one would pass for a number
                    raise InputError(f"{name}: expected one number, found {data[name]!r:.40}.")
            if data.get("interface_normal") == AXIS:
                data["interface_normal"] = _towards_camera(data)
            return cls(
                file=file,
                name=called,
                sha256=sha256,
                lens=lens_of(folder / lens) if lens else None,
                plane_from_pixel=data.pop("plane_from_pixel"),
                nadir=data.pop("nadir"),
                distance=data.pop("distance"),
                **{name: data.pop(name, None) for name in ("image_size", *_OPTIONAL, *_MEDIA)},
                layers=layers,
                extra=data,
                folder=folder,
            )

    def to_dict(self) -> dict[str, object]:
        """Return the photo's part of the pair file."""
        stated = {"name": self.name, "file": self.file, "sha256": self.sha256}
        data: dict[str, object] = {key: text for key, text in stated.items() if text}
        data |= {
            "plane_from_pixel": self.plane_from_pixel,
            "nadir": self.nadir,
            "distance": self.distance,
        }
        for name in ("image_size", *_OPTIONAL, *_MEDIA):
            if (value := getattr(self, name)) is not None:
                data[name] = value
        return data | dict(self.extra)


def _rounded(value: Any) -> Any:
    """Return plain data with its numbers as text of ten digits."""
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, list):
        return [_rounded(part) for part in value]
    return f"{value:.9e}" if isinstance(value, float | int) else value


def _whole_size(size: Any) -> tuple[int, int]:
    width, height = read_only(size, "image_size", shape=(2,)).tolist()
    if min(width, height) < 1 or width % 1 or height % 1:
        raise InputError(f"image_size: expected [columns, rows] in whole pixels, found {size}.")
    return int(width), int(height)


def _towards_camera(data: Mapping[str, Any]) -> FloatArray:
    """Return the direction from the object back along the optical axis of a photo as stated."""
    stated = {name: data[name] for name in ("plane_from_pixel", "nadir", "distance")}
    forwards = pinhole(Photo(**stated)).rotation[2]
    return np.asarray(-forwards * np.sign(-forwards[2]))


def _checked_normal(value: FloatArray) -> FloatArray:
    """Return the normal of the interfaces, read-only.

    Raises
    ------
    GeometryError
        If it does not point from the object to the cameras.
    """
    normal = read_only(value, "interface_normal", shape=(3,))
    if not normal[2] > LEAST_COSINE * float(np.linalg.norm(normal)):
        raise GeometryError(remark("photo.interface_normal", normal=normal.tolist()))
    return normal
