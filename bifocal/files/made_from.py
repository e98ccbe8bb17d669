"""What a map of a wall was made from: written into it, read back, held against what is there.

A relief map or an orthophoto carries the digests of its causes: each photo's orientation and file,
the faces that were drawn, the relief map. Who builds on it, shows it or packs it asks `check_maps`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bifocal.model import Photo, RasterReader
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.jsonfile import to_text
from photocore.provenance import changes_are_taken, known_hash

#: Metadata of a raster that hold its causes, and what older versions tell of the cameras.
TAG, DISTANCES = "BIFOCAL_MADE_FROM", ("BIFOCAL_D1", "BIFOCAL_D2")
#: Names the file of the pair or set.
PAIR_TAG = "BIFOCAL_PAIR"
#: Distances were written with six digits.
_ROUNDED = 2e-5
_LETTERS = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeFrom:
    """The causes of a product, by digests.

    Attributes
    ----------
    cameras : mapping of str to str
        Digest of each photo's orientation, and that of its file; empty where it is not known.
    distances : tuple of float
        Of the cameras. [m]
    faces : str or None
        Of what was drawn; empty: nothing was; None: not known.
    relief : str
        Of the relief map's file; empty: there was none, or it is not known.
    """

    cameras: Mapping[str, str] = field(default_factory=dict)
    distances: tuple[float, ...] = ()
    faces: str | None = None
    relief: str = ""

    @classmethod
    def of(
        cls, photos: Sequence[Photo], *, faces: str | None = None, relief: Path | None = None
    ) -> MadeFrom:
        """Return the causes as they are now; those of ``faces`` by their digest."""
        return cls(
            cameras={photo.digest: _of_file(photo) for photo in photos},
            distances=tuple(photo.distance for photo in photos),
            faces=faces,
            relief="" if relief is None else known_hash(relief)[:_LETTERS],
        )

    @classmethod
    def of_tags(cls, tags: Mapping[str, str]) -> MadeFrom:
        """Return what the metadata of a raster tell."""
        with suppress(ValueError, TypeError, KeyError, AttributeError):
            data = json.loads(tags[TAG])
            cameras = {str(key): str(value) for key, value in data["cameras"].items()}
            return cls(cameras=cameras, faces=data["faces"], relief=str(data["relief"]))
        with suppress(ValueError):
            return cls(distances=tuple(float(tags[name]) for name in DISTANCES if name in tags))
        return cls()

    @classmethod
    def read(cls, path: Path) -> MadeFrom:
        """Return what a raster tells; nothing where it is none of ours."""
        with RasterReader(path) as reader:
            return cls.of_tags(reader.tags)

    def tags(self) -> dict[str, str]:
        """Return it as metadata of a raster."""
        causes = {"cameras": dict(self.cameras), "faces": self.faces, "relief": self.relief}
        return {TAG: to_text(causes)}

    def differences(self, now: MadeFrom) -> Iterator[str]:
        """Yield which causes are others now: ``pair``, ``photos``, ``relief``, ``faces``.

        A set and a pair of its photos lie in one frame: the cameras of one are among the other's.
        """
        shared = self.cameras.keys() & now.cameras.keys()
        alike = any(
            math.isclose(before, after, rel_tol=_ROUNDED)
            for before in self.distances
            for after in now.distances
        )
        if (
            self.cameras and now.cameras and len(shared) < min(len(self.cameras), len(now.cameras))
        ) or (self.distances and now.distances and not alike):
            yield "pair"
        files = [(self.cameras[key], now.cameras[key]) for key in shared]
        if any(before and after and before != after for before, after in files):
            yield "photos"
        if self.relief and now.relief and self.relief != now.relief:
            yield "relief"
        if None not in (self.faces, now.faces) and self.faces != now.faces:
            yield "faces"


def check_maps(
    now: MadeFrom, *, relief: Path | None = None, ortho: Path | None = None
) -> tuple[str, ...]:
    """Hold maps against their causes as they are; return what to say of them.

    Parameters
    ----------
    now : MadeFrom
        The cameras and what else the maps should be of; the relief map is taken from ``relief``.
    relief, ortho : Path, optional
        The maps.

    Raises
    ------
    InputError
        If one was made from another pair or other photos, unless changes are taken.
    """
    remarks: list[str] = []
    for path, of_relief in ((relief, None), (ortho, relief)):
        if path is None:
            continue
        causes = MadeFrom(
            cameras=now.cameras, distances=now.distances, faces=now.faces,
            relief="" if of_relief is None else known_hash(of_relief)[:_LETTERS],
        )  # fmt: skip
        for cause in MadeFrom.read(path).differences(causes):
            text = remark(f"made_from.{cause}", of=path)
            if cause in ("pair", "photos") and not changes_are_taken():
                raise InputError(text)
            remarks.append(text)
    return tuple(remarks)


def photos_of(source: Any) -> tuple[Photo, ...]:
    """Return the photos of a pair or a set."""
    photos = getattr(source, "photos", None)
    return tuple(photos) if photos else (source.image1, source.image2)


def _of_file(photo: Photo) -> str:
    """Return the digest of a photo's file: as stated, which is checked, else as it is."""
    if photo.sha256 and not changes_are_taken():
        return photo.sha256[:_LETTERS]
    path = photo.folder / photo.file
    return known_hash(path)[:_LETTERS] if photo.file and path.is_file() else ""
