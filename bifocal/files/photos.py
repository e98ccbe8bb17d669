"""What the photos of a pair or set say of themselves, held against what it was made from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bifocal.model import Pair, Photo, PhotoSet
from photocore.images import ImageInfo, image_info


def set_photo_info(photos: PhotoSet, number: int) -> ImageInfo:
    """Return what a photo of a set, counted from 0, says of itself; see `photo_info`."""
    photo = photos.photos[number]
    return _checked(photo, photo.path, photos.photos)


def photo_info(pair: Pair, number: int) -> ImageInfo:
    """Return what photo 1 or 2 of a pair says of itself; see `image_info`.

    Raises
    ------
    InputError
        Also if it is of another size than the pair was made from, or another file.
    """
    return _checked(pair.photo(number), pair.photo_file(number), (pair.image1, pair.image2))


def photo_infos(source: Pair | PhotoSet) -> tuple[ImageInfo, ...]:
    """Return what the photos of a pair or a set say of themselves, in order; as `photo_info`."""
    if isinstance(source, Pair):
        return photo_info(source, 1), photo_info(source, 2)
    return tuple(_checked(photo, photo.path, source.photos) for photo in source.photos)


def _checked(photo: Photo, path: Path, photos: Sequence[Photo]) -> ImageInfo:
    """Return what a photo says of itself; refuse one that is not what its pair was made from."""
    info = image_info(path)
    photo.check_size(info.size, info.path)
    photo.check_file(info.path, photos)
    return info
