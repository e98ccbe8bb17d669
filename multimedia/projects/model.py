"""A photogrammetric project: cameras, media, object points and image points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from multimedia.media import Camera, FlatInterface, Interfaces
from photocore.arrays import FloatArray, read_only
from photocore.errors import InputError
from photocore.names import did_you_mean, meant

#: Measuring precision of an image coordinate where nobody says otherwise. [px] and [mm]
SIGMA_PIXEL, SIGMA_IMAGE = 0.5, 0.005
#: How many names a message lists.
SHOWN = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObjectPoints:
    """Points in the object frame.

    Attributes
    ----------
    ids : tuple of str
        Each once.
    xyz : ndarray, shape (n, 3)
        [object unit]
    sigma : ndarray, shape (n, 3)
        Standard deviations; 0 for an error-free point, NaN where unknown. [object unit]
    groups : tuple of str
        Plate, set or role of each point; may be empty texts.
    """

    ids: tuple[str, ...] = ()
    xyz: FloatArray = field(default_factory=lambda: np.empty((0, 3)))
    sigma: FloatArray = None  # type: ignore[assignment]
    groups: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        set_, count = object.__setattr__, len(self.ids)
        refuse_repeated(self.ids, "object points")
        set_(self, "xyz", read_only(np.reshape(self.xyz, (-1, 3)), "xyz", shape=(count, 3)))
        _set_sigma_and_groups(self, (count, 3), least=0.0, words="no negative values")

    def rows(self, ids: Sequence[str]) -> list[int]:
        """Return the row of each id, -1 where there is none."""
        place = {name: row for row, name in enumerate(self.ids)}
        return [place.get(name, -1) for name in ids]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ImagePoints:
    """Measured image points, one row per camera and point.

    Attributes
    ----------
    cameras, ids : tuple of str
        Camera and point of each row; each pair once.
    image : ndarray, shape (n, 2)
        Measured coordinates, distortion included. [mm]
    sigma : ndarray, shape (n, 2)
        Standard deviations, NaN where unknown. [mm]
    groups : tuple of str
        Set (frame, plate) of each row.
    """

    cameras: tuple[str, ...] = ()
    ids: tuple[str, ...] = ()
    image: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    sigma: FloatArray = None  # type: ignore[assignment]
    groups: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        set_, count = object.__setattr__, len(self.ids)
        pairs = [f"{p} in {c}" for c, p in zip(self.cameras, self.ids, strict=True)]
        refuse_repeated(pairs, "image points")
        set_(self, "image", read_only(np.reshape(self.image, (-1, 2)), "image", shape=(count, 2)))
        above_zero = float(np.nextafter(0.0, 1.0))
        _set_sigma_and_groups(self, (count, 2), least=above_zero, words="positive values")

    @property
    def names(self) -> tuple[str, ...]:
        """Every point once, in the order of first appearance."""
        return tuple(dict.fromkeys(self.ids))

    def of_camera(self, name: str) -> list[int]:
        """Return the rows of one camera."""
        return [row for row, camera in enumerate(self.cameras) if camera == name]

    def grid(self, cameras: Sequence[str], ids: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Return image points and sigmas by camera and point, shape (m, n, 2); NaN if not seen."""
        column = {name: k for k, name in enumerate(ids)}
        line = {name: k for k, name in enumerate(cameras)}
        image = np.full((len(cameras), len(ids), 2), np.nan)
        sigma = np.full((len(cameras), len(ids), 2), np.nan)
        rows = [
            (row, line[c], column[p])
            for row, (c, p) in enumerate(zip(self.cameras, self.ids, strict=True))
            if c in line and p in column
        ]
        if rows:
            row, at, point = np.array(rows).T
            image[at, point] = self.image[row]
            sigma[at, point] = self.sigma[row]
        return image, sigma


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Project:
    """Everything a project file describes.

    Attributes
    ----------
    cameras : tuple of Camera
        With different names.
    media : mapping of str to FlatInterface or Interfaces
        What lies between cameras and object, by name; cameras may share one.
    media_of : tuple of str
        Name of each camera's media; empty for straight rays.
    object_points, image_points
        Tables; may be empty.
    sigma_image : float
        Precision of image coordinates that have none of their own. [mm]
    unit : str
        Unit of all object lengths, thicknesses included: for headings.
    name : str
        For reports.
    extra : mapping
        Keys of the project file that this class does not use; kept.
    remarks : tuple of str
        What the user should be told.
    without_pose : tuple of str
        Cameras whose centre and rotation mean nothing yet: no file states them.
    """

    cameras: tuple[Camera, ...]
    media: Mapping[str, FlatInterface | Interfaces] = field(default_factory=dict)
    media_of: tuple[str, ...] = ()
    object_points: ObjectPoints = field(default_factory=ObjectPoints)
    image_points: ImagePoints = field(default_factory=ImagePoints)
    sigma_image: float = SIGMA_IMAGE
    unit: str = "m"
    name: str = ""
    extra: Mapping[str, object] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    without_pose: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.cameras:
            raise InputError("project: there is no camera; add at least one [[camera]].")
        refuse_repeated([camera.name for camera in self.cameras], "cameras")
        object.__setattr__(self, "media_of", tuple(self.media_of) or ("",) * len(self.cameras))
        for camera, name in zip(self.cameras, self.media_of, strict=True):
            if name and name not in self.media:
                names = ", ".join(self.media) or "none"
                raise InputError(
                    f"camera {camera.name}: its media {name!r} are not described; known: {names}."
                )
        strange = sorted(set(self.image_points.cameras) - set(self.camera_names))
        if strange:
            raise InputError(
                f"image points: no camera is called {', '.join(strange[:SHOWN])}; the project has "
                f"{', '.join(self.camera_names)}."
            )

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Names in the order of the cameras."""
        return tuple(camera.name for camera in self.cameras)

    def interface_of(self, camera: int) -> FlatInterface | Interfaces | None:
        """Return what camera number ``camera`` looks through, None for nothing."""
        name = self.media_of[camera]
        return self.media[name] if name else None

    @property
    def interfaces(self) -> tuple[FlatInterface | Interfaces | None, ...]:
        """What each camera looks through."""
        return tuple(self.interface_of(k) for k in range(len(self.cameras)))

    def camera_index(self, name: str) -> int:
        """Return the number of the camera called ``name``.

        Raises
        ------
        InputError
            If there is none.
        """
        (name,) = meant([name], self.camera_names)
        if name not in self.camera_names:
            raise InputError(
                f"no camera is called {name!r}{did_you_mean(name, self.camera_names)}; "
                f"the project has {', '.join(self.camera_names)}."
            )
        return self.camera_names.index(name)


def _set_sigma_and_groups(
    points: ObjectPoints | ImagePoints, shape: tuple[int, int], *, least: float, words: str
) -> None:
    """Fill in and check what points may leave out."""
    sigma = np.full(shape, np.nan) if points.sigma is None else np.array(points.sigma, float)
    if sigma.shape != shape or (sigma < least).any():
        raise InputError(f"sigma: expected shape {shape} and {words}.")
    sigma.setflags(write=False)
    object.__setattr__(points, "sigma", sigma)
    object.__setattr__(points, "groups", tuple(points.groups) or ("",) * shape[0])


def refuse_repeated(names: Sequence[str], what: str) -> None:
    """Refuse names that occur twice.

    Raises
    ------
    InputError
        Naming them.
    """
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        shown = ", ".join(twice[:SHOWN])
        raise InputError(f"{what}: {shown} occurs more than once; give each its own name.")


def place_name(place: FloatArray) -> str:
    """Return the name of a point after its place: the same for all cameras, whatever their numbers.

    What numbers a list counts from 0 what one camera saw: it means another point in each of them.

    >>> place_name(np.array([5.0, -7.5, -0.0]))
    'X5Y-7.5Z0'
    """
    rounded = np.round(place, 6) + 0.0
    return "".join(f"{axis}{v:.10g}" for axis, v in zip("XYZ", rounded.tolist(), strict=True))
