"""The cells of the sheet `Setup` for pairs that look through media.

On the measured side every ray is known, so a spreadsheet follows it layer by layer without
iterating: see `bifocal.media`, whose notation this is.
"""

from __future__ import annotations

#: What may be typed as refractive index: vacuum to germanium.
INDEX_LIMITS = (1.0, 4.1)
#: Unit normals of both cameras' interfaces, of which `NORMALS` may be of any length.
UNIT_NORMALS = tuple(tuple(f"axis_{axis}_{image}" for axis in "xyr") for image in "12")


def _used(media: int) -> tuple[str, ...]:
    return tuple(f"n_used_{number}" for number in range(1, media + 1))


def calculated_names(media: int, *, is_pair: bool, leaning: bool) -> tuple[str, ...]:
    """Return the cells of `Setup` that follow from those of the media."""
    if not media:
        return ()
    units = ("n_least", *UNIT_NORMALS[0], *UNIT_NORMALS[1]) if leaning else ()
    rays = () if is_pair else ("c_rays_1", "c_rays_2", "mm_1", "m_seen")
    both = tuple(f"{name}_{image}" for name in ("behind", "seen", "reach") for image in "12")
    return (*_used(media), *units, *both, "r_top", *rays)
