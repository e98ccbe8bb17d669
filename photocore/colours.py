"""Colours of another space than sRGB, as their profile says: Display P3 of phones, Adobe RGB."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from photocore.decoding import decoders_words
from photocore.provenance import note_remark
from photocore.remarks import remark

#: Farthest that a primary of a profile may lie from that of sRGB, as CIE XYZ of the profile's
#: white, and be the same: profiles called sRGB differ by 0.002; Display P3 by 0.08, Adobe RGB 0.17.
_SAME = 0.01
#: Primaries of sRGB under the white of profiles, D50 (IEC 61966-2-1).
_SRGB = ((0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141))
#: Rows that are converted at once.
_ROWS = 512


def in_srgb(path: Path, image: Any) -> Any:
    """Return RGB pixels of a photo in sRGB; unchanged without a profile, in grey, or in 16 bit.

    What 16 bits leave in another space is noted.
    """
    from PIL import Image, ImageCms

    if image.ndim != 3:
        return image
    try:
        if (
            not (data := _profile_of(path))
            or (profile := ImageCms.ImageCmsProfile(io.BytesIO(data))) is None
        ):
            return image
        if not _is_other(profile):
            return image
        if image.dtype != np.uint8:
            name = ImageCms.getProfileDescription(profile).strip()
            note_remark(remark("photo.other_colours", of=path.name, name=name))
            return image
        change = ImageCms.buildTransform(profile, ImageCms.createProfile("sRGB"), "RGB", "RGB")
    except (OSError, SyntaxError, ValueError, ImageCms.PyCMSError):
        return image  # a damaged profile says nothing
    for top in range(0, len(image), _ROWS):
        part = Image.fromarray(np.ascontiguousarray(image[top : top + _ROWS]))
        image[top : top + _ROWS] = np.asarray(ImageCms.applyTransform(part, change))
    return image


def _profile_of(path: Path) -> bytes | None:
    """Return the colour profile of a photo; of a TIFF by tifffile: Pillow knows no deep colours."""
    if path.suffix.lower() in {".tif", ".tiff"}:
        import tifffile

        with decoders_words(), tifffile.TiffFile(path) as tiff:
            page: Any = tiff.pages[0]
            return bytes(page.tags[34675].value) if 34675 in page.tags else None
    from PIL import Image

    with Image.open(path) as file:
        return file.info.get("icc_profile")


def _is_other(profile: Any) -> bool:
    """Whether a profile of RGB has other primaries than sRGB."""
    of = profile.profile
    primaries = (of.red_colorant, of.green_colorant, of.blue_colorant)
    if of.xcolor_space.strip() != "RGB" or None in primaries:
        return False
    away = np.array([xyz for xyz, _ in primaries]) - _SRGB
    return bool(np.abs(away).max() > _SAME)
