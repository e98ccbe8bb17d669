"""A set of photos of one wall: two or more, each with its homography, nadir and distance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bifocal.model import orientation_precision
from bifocal.model.doubts import doubts_in_words
from bifocal.model.flags import UNCERTAIN_SHARE, FlagLimits
from bifocal.model.intersection import intersect
from bifocal.model.pair import Pair
from bifocal.model.photo import Photo
from bifocal.model.photo_entries import (
    PAIR_FORMAT,
    SET_FORMAT,
    file_content,
    photo_entries,
    write_content,
)
from bifocal.model.set_intersection import SetIntersection, intersect_rays
from bifocal.rays import plane_position, straight
from bifocal.remarks import remark
from multimedia import Layers
from photocore.arrays import BoolArray, FloatArray, IntArray, as_points, positive
from photocore.errors import InputError, located
from photocore.jsonfile import read_object
from photocore.series import check_index

#: Places a side at which pairs of a set are judged, over each photo.
_PLACES = 12
#: Rays that meet at a larger angle show too different sides of things to be matched. [rad]
#: Evidence: church portal, four photos: unknown or beyond 3 cm 28.3 % by tangents on the plane,
#: 27.6 at 20 degrees, 26.9 at 30, 30.1 at 38.
WIDEST = np.radians(30.0)
#: What a lens shows as far from where it is has been folded over; a share of the distance.
_FOLDED = 1e-3
#: Cameras whose distances differ by less of them have their zoom centre too far off for a pair.
_ALIKE = 1e-6


class RankedPair(NamedTuple):
    """Two photos of a set, by their numbers, the far one first, and what relief they promise.

    Attributes
    ----------
    far, near : int
        Numbers of the photos in the set, from 0.
    share : float
        Of the wall that any photo shows, how much both do.
    sigma_r : float
        Median precision of relief there, from the picks alone. [m]
    """

    far: int
    near: int
    share: float
    sigma_r: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhotoSet:
    """Two or more photos of one wall; a pair is the set of two.

    Attributes
    ----------
    photos : tuple of Photo
        In the order given, which nothing changes: picks and covariance follow it. Each has a name
        of its own; one without is called as its file is.
    folder : Path
        Folder of the set's file, to which the photos' names are relative.
    extra : mapping
        Other keys of the file; kept.
    orientation : ndarray, shape (k, k), or None
        Covariance of all photos, and of their media where it counts them
        (`bifocal.model.orientation_precision.names_of`), common to all points; None where it is
        not known.
    """

    photos: tuple[Photo, ...]
    folder: Path = Path()
    extra: Mapping[str, Any] = field(default_factory=dict)
    orientation: FloatArray | None = None

    def __post_init__(self) -> None:
        photos = tuple(self.photos)
        if len(photos) < 2:
            raise InputError(remark("photo_set.too_few", count=len(photos)))
        if any(photo.layers != photos[0].layers for photo in photos):
            raise InputError(remark("pair.two_layers"))
        names = _names(photos)
        photos = tuple(
            photo
            if (photo.name, photo.folder) == (name, self.folder)
            else replace(photo, name=name, folder=self.folder)
            for photo, name in zip(photos, names, strict=True)
        )
        object.__setattr__(self, "photos", photos)
        if self.orientation is not None:
            layers = photos[0].layers
            matrix = orientation_precision.checked_of(self.orientation, layers, len(photos))
            object.__setattr__(self, "orientation", matrix)

    def __len__(self) -> int:
        return len(self.photos)

    @classmethod
    def read(cls, path: Path | str) -> PhotoSet:
        """Read the file of a set, or of a pair as a set of two in the order of its file.

        Raises
        ------
        InputError
            If the file or one of its values is unusable; the message names the key.
        GeometryError
            If a homography is singular.
        """
        data = read_object(path, what="file of photos")
        with located(path):
            return cls.from_dict(data, folder=Path(path).parent)

    @classmethod
    def of(cls, source: PhotoSet | Pair | Path | str) -> PhotoSet:
        """Return a set as it is, a pair as a set of two, or read the file of either."""
        if isinstance(source, PhotoSet):
            return source
        return cls.from_pair(source) if isinstance(source, Pair) else cls.read(source)

    @classmethod
    def from_pair(cls, pair: Pair) -> PhotoSet:
        """Return a pair as a set of two, the far photo first."""
        return cls(
            photos=(pair.image1, pair.image2), folder=pair.folder, extra=pair.extra,
            orientation=pair.orientation,
        )  # fmt: skip

    @classmethod
    def from_dict(cls, data: Mapping[str, object], *, folder: Path = Path()) -> PhotoSet:
        """Return the set described by the content of its file, or of a pair file."""
        photos, orientation, extra = photo_entries(data, folder, SET_FORMAT, PAIR_FORMAT)
        return cls(photos=photos, folder=folder, extra=extra, orientation=orientation)

    def to_dict(self) -> dict[str, object]:
        """Return the content of the set's file."""
        head = {"format": SET_FORMAT, "photos": [photo.to_dict() for photo in self.photos]}
        return file_content(head, self.photos, self.extra, self.orientation)

    def write(self, path: Path | str, *, overwrite: bool = False) -> None:
        """Write the set's file, whole or not at all."""
        write_content(path, self.to_dict(), overwrite=overwrite)

    @property
    def names(self) -> tuple[str, ...]:
        """What the photos are called."""
        return tuple(photo.name for photo in self.photos)

    @property
    def layers(self) -> Layers | None:
        """The media between cameras and object; None in air."""
        return self.photos[0].layers

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the file says is wrong with the set."""
        return doubts_in_words(self.extra.get("setup"))

    def number(self, photo: int | str) -> int:
        """Return the number of a photo, from 0, by that or by its name.

        Raises
        ------
        InputError
            If the set has none of that name or number.
        """
        if photo in self.names:
            return self.names.index(str(photo))
        if isinstance(photo, str) or not 0 <= photo < len(self):
            raise InputError(remark("photo_set.no_photo", name=photo, names=", ".join(self.names)))
        return int(photo)

    def only(self, numbers: Sequence[int]) -> PhotoSet:
        """Return some of the photos, two or more, with their part of the covariance."""
        part = self.orientation
        if part is not None:
            part = orientation_precision.of_photos(part, numbers, len(self))
        photos = tuple(self.photos[number] for number in numbers)
        return replace(self, photos=photos, orientation=part)

    def picked_in(self, pixels: Sequence[FloatArray]) -> list[int]:
        """Return the numbers of the photos with a pick, the first two where fewer have any."""
        numbers = [k for k, picks in enumerate(pixels) if not np.isnan(picks).all()]
        return numbers if len(numbers) > 1 else [0, 1]

    def pair(self, first: int | str = 0, second: int | str = 1) -> Pair:
        """Return two of the photos as a pair, the far one first, with their part of the covariance.

        Parameters
        ----------
        first, second : int or str
            Numbers from 0, or names.

        Raises
        ------
        InputError
            If the set has none of that name or number, or both are one.
        GeometryError
            If both cameras stand equally far from the wall.
        """
        chosen = [self.number(first), self.number(second)]
        if chosen[0] == chosen[1]:
            raise InputError(remark("photo_set.same_photo", name=self.names[chosen[0]]))
        far, near = sorted(chosen, key=lambda number: -self.photos[number].distance)
        part = self.orientation
        if part is not None:
            part = orientation_precision.of_photos(part, (far, near), len(self))
        extra = dict(self.extra)
        if len(self) > 2 and "setup" in extra:  # diagnostics of all photos are not those of two
            extra["setup"] = {"doubts": list(self.remarks)}
        return Pair(
            image1=self.photos[far], image2=self.photos[near], folder=self.folder, extra=extra,
            orientation=part,
        )  # fmt: skip

    def pairs(self) -> tuple[RankedPair, ...]:
        """Return the pairs that promise relief, the best first.

        Those that stand equally far from the wall are left out, and those whose relief, where both
        photos see, is less precise than the share of the distance that makes points UNCERTAIN.

        Returns
        -------
        tuple of RankedPair
            By what they tell, the sum of ``1 / sigma_r**2`` over the wall that any photo shows;
            those whose rays mostly part by more than `WIDEST`, and hardly match, after the others.
        """
        xyz = self._places()
        picked = [
            photo.picks(np.where(rows[:, None], pixels, np.nan))
            for photo, pixels, rows in zip(
                self.photos, self.project(xyz), self.sees(xyz), strict=True
            )
        ]
        ranked = []
        for one, second in combinations(range(len(self)), 2):
            far, near = sorted((one, second), key=lambda number: -self.photos[number].distance)
            if self.photos[far].distance == self.photos[near].distance:
                continue
            sigma = intersect(picked[far], picked[near], limits=FlagLimits()).sigma[:, 2]
            both = np.isfinite(sigma)
            information = float(np.sum(1.0 / sigma[both] ** 2))
            if both.any() and (middle := float(np.median(sigma[both]))) <= (
                UNCERTAIN_SHARE * self.photos[near].distance
            ):
                apart = ray_angles(self.photos[far], self.photos[near], xyz[both])
                pair = RankedPair(far, near, float(both.mean()), middle)
                ranked.append((bool(np.median(apart) > WIDEST), -information, pair))
        return tuple(pair for *_, pair in sorted(ranked))

    def best_pair(self) -> Pair:
        """Return the pair that promises most of relief, else the first two photos."""
        ranked = self.pairs()
        return self.pair(ranked[0].far, ranked[0].near) if ranked else self.pair()

    def project(self, xyz: ArrayLike) -> tuple[FloatArray, ...]:
        """Return the pixels of points (X, Y, r) in every photo, each of shape (..., 2)."""
        return tuple(photo.project(xyz) for photo in self.photos)

    def sees(self, xyz: ArrayLike) -> BoolArray:
        """Tell which photos have points (X, Y, r) in their frame, hidden or not.

        Returns
        -------
        ndarray of bool, shape (photos, ...)
            Of a photo whose size is not known, all that lies before its camera.
        """
        points = as_points(xyz, "xyz", dimension=3)
        return np.stack([_in_frame(photo, points) for photo in self.photos])

    def intersect(
        self,
        pixels: Sequence[ArrayLike],
        *,
        sigma_px: float | None = None,
        sigma_r_max: float | None = None,
    ) -> SetIntersection:
        """Intersect all rays of every point by least squares.

        Parameters
        ----------
        pixels : sequence of array_like, shape (..., 2)
            (column, row) of the same points in each photo of the set, in its order; NaN where a
            point was not measured.
        sigma_px : float, optional
            Measuring precision per coordinate; by default each photo's own, else 0.5. [px]
        sigma_r_max : float, optional
            Points of less precise relief are UNCERTAIN; default 2 % of the distance of the nearest
            camera that measured them. [m]

        Returns
        -------
        SetIntersection
            Its arrays begin with the shape of the points; ``flags`` is one row after the other.
            Points of two rays are those of `Pair.intersect`, digit for digit.

        Raises
        ------
        InputError
            If there is not one array for each photo, or they differ in shape.

        Notes
        -----
        Weighted least squares over all rays, with the covariance of the orientation, which all
        points have in common (`bifocal.model.set_intersection.intersect_rays`).

        Examples
        --------
        Three photos of one camera, 4 mm of wall a pixel; the last pick is 8 px across the radius:

        >>> metres = [[0.004, 0, -6], [0, -0.004, 4], [0, 0, 1]]
        >>> stations = {"far": 17.5, "mid": 14.0, "near": 9.5}
        >>> photos = PhotoSet(photos=tuple(
        ...     Photo(name=name, plane_from_pixel=metres, nadir=[0, 0], distance=d)
        ...     for name, d in stations.items()
        ... ))
        >>> picks = photos.project([[2.0, 0.0, 0.5]])
        >>> photos.intersect(picks).xyz.round(9).tolist()
        [[2.0, 0.0, 0.5]]
        >>> wrong = photos.intersect([*picks[:2], picks[2] + [0, 8]])
        >>> wrong.flags, wrong.suspects.tolist(), wrong.slips.round(3).tolist()
        (('OFF-RADIAL',), [[False, False, True]], [[3.97, 4.028, 8.0]])
        """
        check_index("intersect", *pixels)
        if len(pixels) != len(self):
            raise InputError(remark("photo_set.picks", count=len(self), found=len(pixels)))
        arrays = [
            as_points(picks, f"pixels of {photo.name}", dimension=2)
            for photo, picks in zip(self.photos, pixels, strict=True)
        ]
        shape = arrays[0].shape[:-1]
        if any(picks.shape[:-1] != shape for picks in arrays):
            shapes = ", ".join(str(picks.shape) for picks in arrays)
            raise InputError(remark("photo_set.shapes", shapes=shapes))
        if sigma_r_max is not None:
            positive(sigma_r_max, "sigma_r_max", unit="m")
        rows = [picks.reshape(-1, 2) for picks in arrays]
        if len(numbers := self.picked_in(rows)) < len(self):  # the others tell nothing
            part = self.only(numbers).intersect(
                [arrays[number] for number in numbers], sigma_px=sigma_px, sigma_r_max=sigma_r_max
            )
            return part.among(numbers, len(self))
        whole = intersect_rays(
            self.photos, rows, sigma_px=sigma_px, limits=FlagLimits(sigma_r_max=sigma_r_max),
            orientation=self._whole_orientation,
        )  # fmt: skip
        picked = np.stack([~np.isnan(picks).any(axis=1) for picks in rows], axis=1)
        for places, (far, near) in self._seen_by_two(picked):
            picks = self.pair(far, near).intersect(
                rows[far][places], rows[near][places], sigma_px=sigma_px, sigma_r_max=sigma_r_max
            )
            whole = whole.with_pair(places, (far, near), picks)
        return whole.reshaped(shape)

    @property
    def _whole_orientation(self) -> FloatArray | None:
        """``orientation`` where it counts all that places and bends the rays, else None."""
        size = len(orientation_precision.names_of(self.layers, len(self)))
        whole = self.orientation is not None and len(self.orientation) == size
        return self.orientation if whole else None

    def _seen_by_two(self, picked: BoolArray) -> Iterator[tuple[IntArray, tuple[int, int]]]:
        """Yield points measured in two photos alone that are a pair, with its far and near one."""
        alone = picked.sum(axis=1) == 2
        for one, second in combinations(range(len(self)), 2):
            d1, d2 = self.photos[one].distance, self.photos[second].distance
            both = alone & picked[:, one] & picked[:, second]
            places = np.flatnonzero(both | (len(self) == 2))
            if len(places) and abs(d1 - d2) > _ALIKE * d1:
                yield places, (one, second) if d1 > d2 else (second, one)

    def _places(self) -> FloatArray:
        """Return places of the wall all over the photos, shape (n, 3). [m]"""
        steps = (np.arange(_PLACES) + 0.5) / _PLACES
        places: list[FloatArray] = []
        for photo in self.photos:
            grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
            if photo.image_size is None:  # as wide as a usual lens sees
                places.append(photo.nadir + (grid - 0.5) * photo.distance)
            else:
                on_plane = photo.plane_from_pixels(grid * photo.image_size - 0.5)
                ahead = photo.sees_ahead(on_plane, photo.image_size[::-1])
                places.append(on_plane[ahead & np.isfinite(on_plane).all(axis=1)])
        plane = np.concatenate(places)
        return np.column_stack([plane, np.zeros(len(plane))])


def ray_angles(first: Photo, second: Photo, xyz: ArrayLike) -> FloatArray:
    """Return by how much the rays of two photos part at points (X, Y, r), shape (...,). [rad]

    Through media the cameras count that see alike near their axes.
    """
    points = as_points(xyz, "xyz", dimension=3)
    ways = []
    for photo in (first, second):
        foot = straight(photo.foot)
        ways.append(points - [*foot.nadir, foot.distance])
    across = np.linalg.norm(np.cross(*ways), axis=-1)
    return np.asarray(np.arctan2(across, (ways[0] * ways[1]).sum(axis=-1)))


def pair_or_set(source: PhotoSet | Pair | Path | str) -> PhotoSet | Pair:
    """Return a set of three photos and more or a pair, as it is or of its file; two are a pair."""
    if isinstance(source, Path | str):
        is_set = read_object(source, what="pair file").get("format") == SET_FORMAT
        source = PhotoSet.read(source) if is_set else Pair.read(source)
    return source.pair(0, 1) if isinstance(source, PhotoSet) and len(source) == 2 else source


def _names(photos: tuple[Photo, ...]) -> tuple[str, ...]:
    """Return a name for each photo: its own, else that of its file.

    Raises
    ------
    InputError
        If two photos are called alike.
    """
    stems = [Path(photo.file).stem or f"photo {k}" for k, photo in enumerate(photos, start=1)]
    unnamed = [stem for photo, stem in zip(photos, stems, strict=True) if not photo.name]
    if len(set(unnamed)) < len(unnamed):  # as cameras count them, in one folder for each
        stems = [photo.file or stem for photo, stem in zip(photos, stems, strict=True)]
    names = [photo.name or stem for photo, stem in zip(photos, stems, strict=True)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(remark("photo_set.name_twice", name=twice[0]))
    return tuple(names)


def _in_frame(photo: Photo, xyz: FloatArray) -> BoolArray:
    """Tell which points a photo has in its frame."""
    pixels = photo.project(xyz)
    inside = np.isfinite(pixels).all(axis=-1)
    if photo.image_size is not None:
        edge = np.array(photo.image_size) - 0.5
        inside &= ((pixels >= -0.5) & (pixels <= edge)).all(axis=-1)
    if photo.lens is not None:  # beyond its photo a lens may fold what it shows back into it
        away = photo.apparent_from_pixels(pixels) - plane_position(xyz, photo.foot)
        inside &= np.hypot(away[..., 0], away[..., 1]) < _FOLDED * photo.distance
    return np.asarray(inside)
