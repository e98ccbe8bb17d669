"""What the photos of a pair or set say of themselves."""

from __future__ import annotations

from bifocal.model.pair import Pair
from bifocal.model.photo_set import PhotoSet
from photocore.images import ImageInfo, image_info


def set_photo_info(photos: PhotoSet, number: int) -> ImageInfo:
    """Return what a photo of a set, counted from 0, says of itself; see `photo_info`."""
    photo = photos.photos[number]
    info = image_info(photo.path)
    photo.check_size(info.size, info.path)
    return info


def photo_info(pair: Pair, number: int) -> ImageInfo:
    """Return what photo 1 or 2 of a pair says of itself; see `image_info`.

    Raises
    ------
    InputError
        Also if it is of another size than the pair was made from.
    """
    info = image_info(pair.photo_file(number))
    pair.photo(number).check_size(info.size, info.path)
    return info


def photo_infos(source: Pair | PhotoSet) -> tuple[ImageInfo, ...]:
    """Return what the photos of a pair or a set say of themselves, in order; as `photo_info`."""
    if isinstance(source, Pair):
        return photo_info(source, 1), photo_info(source, 2)
    infos = tuple(image_info(photo.path) for photo in source.photos)
    for photo, info in zip(source.photos, infos, strict=True):
        photo.check_size(info.size, info.path)
    return infos
