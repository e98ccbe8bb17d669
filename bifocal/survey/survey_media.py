"""Media as the cells of a survey workbook state them: blank cells are air."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bifocal.media import MediaOfPhoto
from bifocal.model import Photo
from bifocal.remarks import remark
from multimedia import Layers
from photocore.errors import InputError

#: Media a workbook can be prepared for, from the camera to the object.
FEWEST, MOST = 2, 6
#: Light that is nowhere bent, where the cells of a workbook with media are blank.
AIR = Layers(indices=(1.0, 1.0))


def index_names(media: int) -> tuple[str, ...]:
    """Return the cells of the refractive indices, the camera's medium first."""
    return tuple(f"index_{number}" for number in range(1, media + 1))


def thickness_names(media: int) -> tuple[str, ...]:
    """Return the cells of the thicknesses, of all media but the first and the last."""
    return tuple(f"thick_{number}" for number in range(2, media))


#: Cells of the ways from both cameras to the first interface.
HEIGHTS = ("z0_1", "z0_2")
#: Cells of the normals (X, Y, r) of both cameras' interfaces, in a workbook for ports that lean.
NORMALS = tuple(tuple(f"normal_{axis}_{image}" for axis in "xyr") for image in "12")
Normal = tuple[float | None, float | None, float | None]


def media_names(media: int, *, leaning: bool) -> tuple[str, ...]:
    """Return the cells a user types in a workbook prepared for so many media; none for none."""
    normals = (name for group in NORMALS for name in group if leaning)
    return (*index_names(media), *thickness_names(media), *HEIGHTS, *normals) if media else ()


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyMedia:
    """What the cells of a workbook say of the media between cameras and object.

    Attributes
    ----------
    indices : tuple of float or None
        Of each medium there is a cell for, the camera's first; blank: as the one before it, the
        first 1.
    thicknesses : tuple of float or None
        Of all but the first and the last; blank: 0. [m]
    z0 : tuple of float or None
        Both cameras' centres to the first interface, in the order of the workbook. [m]
    normals : pair of (X, Y, r), or None
        Of both cameras' interfaces, towards the camera, of any length; blank: parallel to the
        reference plane. None in a workbook without cells for ports that lean.
    """

    indices: tuple[float | None, ...]
    thicknesses: tuple[float | None, ...]
    z0: tuple[float | None, float | None]
    normals: tuple[Normal, Normal] | None = None

    @classmethod
    def blank(cls, media: int) -> SurveyMedia:
        """Return the blank cells of a workbook prepared for so many media.

        Raises
        ------
        InputError
            If that is no number of media.
        """
        if not FEWEST <= media <= MOST:
            raise InputError(remark("survey.media_number", fewest=FEWEST, most=MOST, media=media))
        return cls(indices=(None,) * media, thicknesses=(None,) * (media - 2), z0=(None, None))

    @classmethod
    def of_cells(cls, cells: Mapping[str, float | None], media: int) -> SurveyMedia:
        """Return what cells hold, by their names."""
        first, second = (cells.get(name) for name in HEIGHTS)
        leaning = NORMALS[0][0] in cells
        normals: Any = tuple(tuple(map(cells.get, names)) for names in NORMALS)
        return cls(
            indices=tuple(cells.get(name) for name in index_names(media)),
            thicknesses=tuple(cells.get(name) for name in thickness_names(media)),
            z0=(first, second),
            normals=normals if leaning else None,
        )

    @classmethod
    def of_photos(
        cls, photos: tuple[Photo, ...], stands: SurveyMedia | None = None
    ) -> SurveyMedia | None:
        """Return the cells that state a pair's media; None for one in air without such cells.

        Parameters
        ----------
        photos : tuple of Photo
            In the order of the workbook.
        stands : SurveyMedia, optional
            What the workbook has cells for; None for a new one.

        Raises
        ------
        InputError
            If the pair looks through more.
        """
        layers, media = photos[0].layers, stands.media if stands else 0
        leaning = bool(stands and stands.normals) or any(photo.leans for photo in photos)
        both: Any = tuple((None,) * 3 if p.interface_normal is None else
                          tuple(p.interface_normal.tolist()) for p in photos)  # fmt: skip
        normals = both if leaning else None
        if layers is None or layers == AIR:
            return replace(cls.blank(media), normals=normals) if media else None
        count = len(layers.indices)
        if media and count > media:
            raise InputError(remark("survey.media_differ", media=media, count=count))
        more = max(media - count, 0)
        first, second = (photo.z0 for photo in photos)
        inner = (*layers.thicknesses, *(None,) * more)
        return cls(
            indices=(*layers.indices, *(None,) * more), thicknesses=inner, z0=(first, second),
            normals=normals,
        )  # fmt: skip

    @property
    def media(self) -> int:
        """How many media there are cells for."""
        return len(self.indices)

    @property
    def used(self) -> tuple[float, ...]:
        """Indices that count, blanks filled in, one a cell."""
        indices: list[float] = []
        for index in self.indices:
            indices.append(index if index is not None else indices[-1] if indices else 1.0)
        return tuple(indices)

    @property
    def layers(self) -> Layers | None:
        """The media stated; None in air."""
        stated = [n for n, index in enumerate(self.indices) if n == 0 or index is not None]
        if len(stated) < 2:
            return None
        used = self.used
        inner = tuple(self.thicknesses[n - 1] or 0.0 for n in stated[1:-1])
        return Layers(indices=tuple(used[n] for n in stated), thicknesses=inner)

    @property
    def cells(self) -> dict[str, float | None]:
        """What the cells hold, by their names."""
        normals = (part for normal in self.normals or () for part in normal)
        values = (*self.indices, *self.thicknesses, *self.z0, *normals)
        names = media_names(self.media, leaning=self.normals is not None)
        return dict(zip(names, values, strict=True))

    def through(self, number: int) -> MediaOfPhoto:
        """Return `Photo`'s layers, z0 and interface_normal; blank cells bend no light.

        Raises
        ------
        InputError
            If z0 is missing.
        """
        layers, z0 = self.layers, self.z0[number - 1]
        if layers is None:
            layers, z0 = AIR, 0.0
        if z0 is None:
            raise InputError(remark("survey.blank_z0", number=number))
        normal = self.normal(number)
        return {
            "layers": layers, "z0": z0,
            "interface_normal": None if normal is None else np.asarray(normal),
        }  # fmt: skip

    def normal(self, number: int) -> tuple[float, ...] | None:
        """Return the normal of photo 1 or 2 as used, blanks filled in; None without such cells."""
        if self.normals is None:
            return None
        typed = self.normals[number - 1]
        return (0.0, 0.0, 1.0) if typed == (None,) * 3 else tuple(part or 0.0 for part in typed)

    def exchanged(self) -> SurveyMedia:
        """Return the same with the cameras exchanged."""
        normals = None if self.normals is None else (self.normals[1], self.normals[0])
        return replace(self, z0=(self.z0[1], self.z0[0]), normals=normals)
