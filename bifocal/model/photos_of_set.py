"""A set where a pair is taken: an orthophoto asks for its photos, not what is between two."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from bifocal.model.pair import Pair
from bifocal.model.photo import Photo
from bifocal.model.photo_set import PhotoSet, pair_or_set


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PhotosOfSet(Pair):
    """All photos of a set by their numbers; its images are the farthest and the nearest.

    Attributes
    ----------
    photos : tuple of Photo
        In the order of the set, numbered from 1.
    """

    photos: tuple[Photo, ...] = ()

    def __post_init__(self) -> None:
        """Check nothing between its photos; none are intersected."""
        for name in ("image1", "image2"):
            object.__setattr__(self, name, replace(getattr(self, name), folder=self.folder))

    @classmethod
    def of_set(cls, photos: PhotoSet) -> PhotosOfSet:
        """Return the photos of a set."""
        by_distance = sorted(photos.photos, key=lambda photo: -photo.distance)
        return cls(
            image1=by_distance[0], image2=by_distance[-1], folder=photos.folder,
            extra=photos.extra, remarks=photos.remarks, photos=photos.photos,
        )  # fmt: skip

    @classmethod
    def of(cls, source: PhotoSet | Pair | Path | str) -> Pair:
        """Return all photos of a set of three and more, else a pair; as it is or of its file."""
        photos = pair_or_set(source)
        return cls.of_set(photos) if isinstance(photos, PhotoSet) else photos

    def photo(self, number: int) -> Photo:
        """Return a photo by its number, from 1."""
        return self.photos[number - 1]

    @property
    def photo_files(self) -> tuple[Path, ...]:
        """The image files that are named."""
        return tuple(photo.path for photo in self.photos if photo.file)
