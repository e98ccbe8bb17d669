"""What all EXIF data of a photo together say of its principal distance: judged, not believed.

A photo that was resized keeps the focal plane's resolution of the larger one; bodies write wrong
planes; digital zoom enlarges a part of the sensor. Each tag is held against the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.remarks import remark
from photocore.images import ImageInfo

#: Nominal focal lengths are rounded and change with focus: relative standard deviation.
NOMINAL = 0.02
#: 35 mm equivalents are rounder still.
EQUIVALENT = 0.04
#: Two tags that differ by less agree: equivalents are rounded, and by diagonal or longer side.
AGREE = 0.12
#: A principal distance between tags that contradict each other is never given worse than this.
WORST = 0.14
#: Sizes of one photo in two resolutions have the same proportions to this.
SAME_SHAPE = 0.01


#: Sensors of phones are smaller. [mm]
PHONE = 14.0
#: Proportions of what cameras and phones write, and how closely bodies keep to them.
SHAPES, KEPT = (
    1.0, 7 / 6, 1.25, 4 / 3, 1.5, 1.6, 16 / 9, 2.0, 18.5 / 9, 13 / 6, 20 / 9, 21 / 9, 65 / 24,
), 0.01  # fmt: skip
#: A photo of other proportions lost so much of its diagonal on one side, as a standard deviation.
LOST = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedFocal:
    """A principal distance out of EXIF data.

    Attributes
    ----------
    focal : float or None
        None where they do not tell. [px]
    sigma : float
        Relative standard deviation; covers all that contradicts it.
    pitch : float or None
        Pixel size of the photo as it is. [mm]
    source, doubt : str
        Where it comes from; what contradicts it.
    """

    focal: float | None = None
    sigma: float = EQUIVALENT
    pitch: float | None = None
    source: str = ""
    doubt: str = ""


def sensors_apart(first: ImageInfo, second: ImageInfo) -> float:
    """Return by how much (logarithm) two photos of one camera tell of sensors of different size.

    0 where they agree, or do not say.

    Examples
    --------
    One of them was halved since, and nothing else tells so:

    >>> from dataclasses import replace
    >>> from pathlib import Path
    >>> whole = ImageInfo(path=Path("a.jpg"), size=(3072, 2048), model="X", focal_length=35,
    ...                   focal_plane_pitch=22.7 / 3072)
    >>> half = replace(whole, size=(1536, 1024), focal_length=19)
    >>> round(sensors_apart(whole, half), 2), sensors_apart(whole, whole)
    (0.69, 0.0)

    Two lenses of a phone have sensors of their own:

    >>> wide = ImageInfo(path=Path("c.jpg"), size=(4032, 3024), model="P", lens="P 5.7 mm f/1.8",
    ...                  focal_length=5.7, focal_plane_pitch=0.0019)
    >>> tele = replace(wide, lens="P 9 mm f/2.8", focal_length=9, focal_plane_pitch=0.001)
    >>> sensors_apart(wide, tele), round(sensors_apart(wide, replace(tele, lens=wide.lens)), 2)
    (0.0, 0.64)
    """
    pitches = [judged_focal(info).pitch for info in (first, second)]
    if not first.model or first.model != second.model or None in pitches:
        return 0.0
    sizes = [max(i.size) * (p or 1.0) for i, p in zip((first, second), pitches, strict=True)]
    lenses = {first.lens, second.lens} - {""}
    if len(lenses) == 2 and max(sizes) < PHONE:
        return 0.0  # each lens of a phone has its sensor
    apart = abs(float(np.log(sizes[0] / sizes[1])))
    return apart if apart > AGREE else 0.0


def is_odd(size: tuple[int, int]) -> bool:
    """Return whether no camera gives photos of these proportions: they were cut out of one.

    Examples
    --------
    >>> is_odd((3072, 2048)), is_odd((2448, 3264)), is_odd((1920, 1200)), is_odd((700, 800))
    (False, False, False, True)
    """
    shape = max(size) / min(size)
    return all(abs(shape / one - 1) > KEPT for one in SHAPES)


def middle_aside(info: ImageInfo) -> tuple[float, str]:
    """Return how far the middle of a photo may be from the camera's own, and what says so.

    A standard deviation, in pixels; 0 and no word where nothing says that it was cropped.

    Examples
    --------
    >>> from pathlib import Path
    >>> info = ImageInfo(path=Path("a.jpg"), size=(1500, 1400), recorded_size=(3072, 2048))
    >>> middle_aside(info)[1][:50]
    'THE PHOTO WAS CROPPED: a.jpg has 1500 x 1400 px of'
    """
    (small, large), focal = sorted(info.size), judged_focal(info).focal or 1.2 * max(info.size)
    shape, recorded = large / small, sorted(info.recorded_size or ())
    about = {"name": info.path.name, "width": info.size[0], "height": info.size[1]}
    if recorded:
        if abs(recorded[1] / recorded[0] / shape - 1) < SAME_SHAPE:
            return 0.0, ""
        fit = max(1.0, small / recorded[0], large / recorded[1])  # enlarged since
        lost = np.hypot(recorded[0] * fit - small, recorded[1] * fit - large)
        about |= {"wide": recorded[1], "high": recorded[0]}
        key, sigma = "cropped", 0.3 * float(lost)
    elif not (info.model or info.focal_length) or not is_odd(info.size):
        return 0.0, ""
    else:
        key, sigma = "odd_shape", LOST * float(np.hypot(small, large))
    tilt = float(np.rad2deg(np.arctan(sigma / focal)))
    return sigma, remark(f"orientation.exif_{key}", tilt=tilt, shape=shape, **about)


def judged_focal(info: ImageInfo) -> JudgedFocal:
    """Return the principal distance on which a photo's EXIF data agree, or what covers them.

    Examples
    --------
    A photo of 3072 px at half its size; its focal plane is that of the whole:

    >>> from pathlib import Path
    >>> info = ImageInfo(path=Path("a.jpg"), size=(1536, 1024), focal_length=35,
    ...                  focal_plane_pitch=22.7 / 3072, recorded_size=(3072, 2048))
    >>> round(judged_focal(info).focal, 1)
    2368.3
    """
    pitch, focal, zoom = info.focal_plane_pitch, info.focal_length, info.digital_zoom or 1.0
    source = f"EXIF, {focal:g} mm" if focal else ""
    wide, resized = max(info.size), 1.0
    if info.recorded_size is not None and pitch:
        resized = max(info.recorded_size) / wide
        shape = max(info.recorded_size) / min(info.recorded_size) * min(info.size) / wide
        if abs(resized - 1) > SAME_SHAPE > abs(shape - 1):
            pitch *= resized
            about = {"recorded": max(info.recorded_size), "width": wide}
            source = remark("orientation.exif_resized", focal=focal or 0.0, **about)
    plane = focal / pitch * zoom if focal and pitch else None
    equivalent = info.focal_length_35
    if not equivalent:
        if plane is None:
            return JudgedFocal(pitch=pitch)
        return JudgedFocal(focal=plane, sigma=NOMINAL, pitch=pitch and pitch / zoom, source=source)
    # The equivalent refers to the diagonal of 36 x 24 mm, of some makers to the longer side.
    by_size = [np.hypot(*info.size) / np.hypot(36, 24), wide / 36]
    stated = float(equivalent * by_size[0])
    if plane is not None and pitch:
        expected = [equivalent * by * z for by in by_size for z in (1.0, zoom)]
        if min(abs(np.log(plane / one)) for one in expected) < AGREE:
            return JudgedFocal(focal=plane, sigma=NOMINAL, pitch=pitch / zoom, source=source)
    source = remark("orientation.exif_equivalent", focal=equivalent)
    if plane is not None:
        sigma = min(WORST, abs(float(np.log(plane / stated))) / 2)
        shares = {"plane": plane, "equivalent": stated, "share": 100 * sigma}
        doubt = remark("orientation.exif_focal_plane", **shares)
        return JudgedFocal(focal=stated, sigma=sigma, source=source, doubt=doubt)
    if zoom > 1 + AGREE:
        sigma = min(WORST, float(np.log(zoom)) / 2)
        doubt = remark("orientation.exif_zoomed", zoom=zoom, share=100 * sigma)
        return JudgedFocal(focal=stated * np.sqrt(zoom), sigma=sigma, source=source, doubt=doubt)
    return JudgedFocal(focal=stated, source=source)
