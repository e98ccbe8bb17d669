"""What the photos of a pair say of themselves."""

from __future__ import annotations

from bifocal.model.pair import Pair
from photocore.images import ImageInfo, image_info


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
