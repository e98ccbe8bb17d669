"""Photos in and out: every path honours the EXIF orientation, pixels are upright as seen.

Decoding is OpenCV's; headers and EXIF are read with Pillow, and with tifffile for TIFF (Pillow
does not know 16-bit colour TIFF). Colours are RGB.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from photocore.arrays import ByteArray
from photocore.colours import in_srgb
from photocore.decoding import decoded, decoders_words, refuse_damaged_jpeg
from photocore.errors import InputError
from photocore.optional_photos import (
    AVIF_ENDINGS,
    HEIF_ENDINGS,
    RAW_ENDINGS,
    open_heif,
    pillow_pixels,
    raw_info,
    raw_pixels,
)
from photocore.output import atomic_path, check_ending
from photocore.png_text import with_provenance
from photocore.provenance import note, note_remark
from photocore.raster import RasterFile
from photocore.remarks import remark
from photocore.textfile import check_file

ImageArray = NDArray[np.uint8] | NDArray[np.uint16]

#: Larger photos are not held in memory: 400 MP is twice the largest camera, and 1.2 GB.
MAX_PIXELS = 400_000_000
#: Larger TIFFs are refused, though windows of them could be read: no stitched photo has as many.
MAX_TIFF_PIXELS = 4_000_000_000
#: Larger photos are decoded some rows at a time, to hold them in memory once only.
_BY_STRIPS = 60_000_000
#: A 16-bit photo of no larger number holds 14 bits or fewer: industrial cameras, developed raw.
_SHALLOW = 1 << 14
#: Endings of the images that are written.
WRITTEN = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
TIFF_ENDINGS = frozenset({".tif", ".tiff"})
#: What Pillow may take a file for (MPO as JPEG), whatever it is called: no other reader of its own.
FORMATS = ("JPEG", "PNG", "TIFF", "BMP", "WEBP", "AVIF")
#: Endings of photos that are read.
READ = frozenset({*WRITTEN, ".webp", *HEIF_ENDINGS, *AVIF_ENDINGS, *RAW_ENDINGS})


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageInfo:
    """What a photo says of itself without being decoded.

    Attributes
    ----------
    path : Path
    size : tuple of int
        Width and height, upright. [px]
    orientation : int
        EXIF orientation 1..8 of the stored pixels.
    bits : int
        8 or 16 per channel.
    make, model, lens : str
        As the camera wrote them; empty if absent.
    focal_length, focal_length_35 : float or None
        True and 35 mm equivalent focal length. [mm]
    focal_plane_pitch : float or None
        Pixel size from the EXIF focal-plane resolution. [mm]
    aperture, subject_distance : float or None
        f-number and distance in metres.
    recorded_size : tuple of int or None
        Width and height that the camera wrote down; the photo was resized or cropped since where
        they are others. [px]
    digital_zoom : float or None
        How many times a part of the sensor was enlarged in the camera.
    """

    path: Path
    size: tuple[int, int]
    orientation: int = 1
    bits: int = 8
    make: str = ""
    model: str = ""
    lens: str = ""
    focal_length: float | None = None
    focal_length_35: float | None = None
    focal_plane_pitch: float | None = None
    aperture: float | None = None
    subject_distance: float | None = None
    recorded_size: tuple[int, int] | None = None
    digital_zoom: float | None = None

    @property
    def focal_pixels(self) -> float | None:
        """Principal distance guessed from EXIF, focused at infinity; None if it cannot be. [px]."""
        if self.focal_length and self.focal_plane_pitch:
            return self.focal_length / self.focal_plane_pitch
        if self.focal_length_35:
            # The 35 mm equivalent refers to the diagonal of 36 x 24 mm.
            return self.focal_length_35 * float(np.hypot(*self.size)) / float(np.hypot(36, 24))
        return None


def image_info(path: Path | str) -> ImageInfo:
    """Return size, orientation and EXIF of a photo.

    Raises
    ------
    InputError
        If it is missing, CMYK, not an image, or larger than `MAX_PIXELS` (TIFF:
        `MAX_TIFF_PIXELS`); of HEIC and camera raw, if their libraries (extra ``photos``) are not
        installed.
    """
    path = Path(path)
    _refuse_early(path)
    note(path)
    if path.suffix.lower() in TIFF_ENDINGS:
        return _tiff_info(path)
    if path.suffix.lower() in RAW_ENDINGS:
        size, exif = raw_info(path)
        return _info_from_exif(path, size, 16, exif)
    formats: tuple[str, ...] = FORMATS
    if path.suffix.lower() in HEIF_ENDINGS:
        open_heif(path)
        formats = (*FORMATS, "HEIF")
    from PIL import Image, UnidentifiedImageError

    try:
        with _pillow_without_size_limit(), Image.open(path, formats=formats) as image:
            _check_mode(path, image.mode)
            bits = 16 if image.mode.startswith("I") else 8
            check_size(path, image.size)  # Pillow decodes a PNG to look for its EXIF data
            return _info_from_exif(path, image.size, bits, image.getexif())
    except UnidentifiedImageError:
        raise InputError(f"{path}: is not an image (JPEG, PNG or TIFF).") from None
    except KeyError as error:  # a reader of Pillow's own that could not be loaded
        raise InputError(
            f"{path}: Pillow cannot read {error.args[0]} here; install it anew."
        ) from None
    except (OSError, SyntaxError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: the image is damaged ({error}).") from error


def read_image(path: Path | str, *, grey: bool = False) -> ImageArray:
    """Return the upright pixels of a photo.

    Parameters
    ----------
    path : path
        JPEG, PNG, TIFF, WebP or AVIF; HEIC and camera raw with the extra ``photos``.
    grey : bool
        Convert colour to grey.

    Returns
    -------
    image : ndarray, shape (h, w, 3) RGB or (h, w), uint8 or uint16
        Alpha is dropped; 16 bit stays 16 bit. Of 10, 12 or 14 bits in 16 the numbers are
        multiplied by a power of two to fill them; 8-bit colours of another space (Display P3,
        Adobe RGB) become those of sRGB.

    Raises
    ------
    InputError
        As `image_info`, and if the pixels cannot be decoded, are cut off, or more than
        `MAX_PIXELS`.
    """
    info = image_info(path)
    check_size(info.path, info.size)
    ending = info.path.suffix.lower()
    if ending in RAW_ENDINGS | HEIF_ENDINGS | AVIF_ENDINGS:
        stored = raw_pixels(info.path) if ending in RAW_ENDINGS else pillow_pixels(info.path)
        stored = in_srgb(info.path, stored)
        image = cv2.cvtColor(stored, cv2.COLOR_RGB2GRAY) if grey and stored.ndim == 3 else stored
        return turn_upright(image, info.orientation)
    tiff = ending in TIFF_ENDINGS
    of_bands = tiff and _is_of_bands(info.path)
    if of_bands or (info.size[0] * info.size[1] > _BY_STRIPS and not grey):
        refuse_damaged_jpeg(info.path)
        whole = _read_by_strips(info)
        if of_bands and whole is None:
            raise InputError(remark("photo.planar", of=path))
        if whole is not None:
            whole = _full_range(info.path, in_srgb(info.path, whole))
            whole = cv2.cvtColor(whole, cv2.COLOR_RGB2GRAY) if grey else whole
            return turn_upright(whole, info.orientation)
    flags = cv2.IMREAD_IGNORE_ORIENTATION | cv2.IMREAD_ANYDEPTH
    flags |= cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_ANYCOLOR
    data = np.fromfile(info.path, dtype=np.uint8)  # imread itself fails on some Windows paths
    if tiff:
        _hide_tiff_orientation(info.path, data)
    image = decoded(path, data, flags)
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: {image.dtype} pixels are not read; save it with 8 or 16 bits.")
    del data
    if image.ndim == 3:
        # Some rows at a time: a second copy of a photo of 100 MP would be 300 MB.
        for top in range(0, len(image), 512):
            part = image[top : top + 512]
            part[:] = cv2.cvtColor(part, cv2.COLOR_BGR2RGB)
    return turn_upright(_full_range(info.path, in_srgb(info.path, image)), info.orientation)


def _full_range(path: Path, image: ImageArray) -> ImageArray:
    """Multiply 10, 12 or 14 bits in 16 by a power of two: eight bits of them would be few greys."""
    if image.dtype == np.uint16 and (unused := unused_bits(path, int(image.max(initial=0)))):
        image <<= np.uint16(unused)
    return image


def unused_bits(path: Path, most: int) -> int:
    """Return how many of 16 bits a photo leaves unused whose largest number is this; noted."""
    if not 0 < most < _SHALLOW:
        return 0
    bits = max(most.bit_length() + most.bit_length() % 2, 10)
    note_remark(remark("photo.stretched", of=path.name, bits=bits, times=1 << (16 - bits)))
    return 16 - bits


def _is_of_bands(path: Path) -> bool:
    """Whether OpenCV mixes the colours of a TIFF: one plane after the other, or times the alpha."""
    import tifffile

    with decoders_words(), tifffile.TiffFile(path) as tiff:
        page: Any = tiff.pages[0]
        planar = int(page.samplesperpixel) > 1 and int(page.planarconfig) == 2
        return planar or (int(page.samplesperpixel) == 4 and int(page.photometric) == 2)


def _read_by_strips(info: ImageInfo) -> ImageArray | None:
    """Return the stored pixels of a large photo in the memory of one copy; None if not plain RGB.

    OpenCV decodes into a buffer and copies it: 600 MB for 100 megapixels.
    """
    try:
        with RasterFile(info.path) as file:
            if file.bands not in (3, 4) or file.dtype not in (np.uint8, np.uint16):
                return None
            image = np.empty((file.height, file.width, 3), file.dtype)
            for top in range(0, file.height, 256):
                height = min(256, file.height - top)
                image[top : top + height] = file.read(0, top, file.width, height, bands=[1, 2, 3])
    except InputError:
        return None  # OpenCV may still read it, or say what is wrong
    return image


def read_grey(path: Path | str) -> ByteArray:
    """Return a photo in grey, 8 bit; see `read_image`."""
    return to_eight_bit(read_image(path, grey=True))


def turn_upright(image: Any, orientation: int) -> ImageArray:
    """Return stored pixels as EXIF orientation 1 to 8 wants them seen."""
    if orientation >= 5:
        image = image.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    upright: ImageArray = np.ascontiguousarray(image)
    return upright


def to_eight_bit(image: ImageArray) -> NDArray[np.uint8]:
    """Return an image with 8 bits per channel; 16-bit values are divided by 257."""
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    return np.asarray(cv2.convertScaleAbs(image, alpha=1 / 257), dtype=np.uint8)


def write_image(path: Path | str, image: ImageArray, *, overwrite: bool = False) -> None:
    """Write RGB, RGBA or grey pixels as the ending says (.png, .jpg, .tif), whole or not at all.

    Parameters
    ----------
    path : path
        Its ending tells the format.
    image : ndarray of uint8 or uint16, shape (h, w), (h, w, 3) or (h, w, 4)
        The pixels.
    overwrite : bool
        Whether an existing file may be replaced.
    """
    path = Path(path)
    ending = path.suffix.lower()
    check_ending(path, "images are written as .png, .jpg or .tif.", *WRITTEN)
    order = {3: cv2.COLOR_RGB2BGR, 4: cv2.COLOR_RGBA2BGRA}
    pixels = image if image.ndim == 2 else cv2.cvtColor(image, order[image.shape[2]])
    options = [cv2.IMWRITE_JPEG_QUALITY, 95] if ending in {".jpg", ".jpeg"} else []
    done, data = cv2.imencode(ending, pixels, options)
    if not done:
        raise InputError(f"{path}: an image of {image.dtype} {image.shape} cannot be written so.")
    with atomic_path(path, overwrite=overwrite) as temporary:
        packed = data.tobytes()
        temporary.write_bytes(with_provenance(packed) if ending == ".png" else packed)


def _refuse_early(path: Path) -> None:
    """Refuse what can be told from the name and the file system."""
    check_file(path, "image", folder=", expected a photo.")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty; save or copy it again.")


def _check_mode(path: Path, mode: str) -> None:
    """Refuse colour spaces that are not a photo's."""
    if mode == "CMYK":
        raise InputError(f"{path}: is CMYK, a printer's colour space; save it as RGB.")
    if mode == "F":
        raise InputError(f"{path}: has floating-point pixels; save it with 8 or 16 bits.")


def _tiff_info(path: Path) -> ImageInfo:
    """Return the facts of a TIFF, from its own tags."""
    import tifffile

    try:
        with decoders_words(), tifffile.TiffFile(path) as tiff:
            page: Any = tiff.pages[0]
            if page.photometric == tifffile.PHOTOMETRIC.SEPARATED:
                _check_mode(path, "CMYK")
            if np.dtype(page.dtype).kind == "f":
                _check_mode(path, "F")
            tags = {code: page.tags[code].value for code in (271, 272, 274) if code in page.tags}
            size = (int(page.imagewidth), int(page.imagelength))
            exif = {**tags, **_named_exif(page.tags.get(34665))}
            return _info_from_exif(path, size, int(np.dtype(page.dtype).itemsize * 8), exif)
    except (tifffile.TiffFileError, IndexError, TypeError, KeyError) as error:
        raise InputError(f"{path}: is not a readable TIFF ({error}).") from error


def _named_exif(tag: Any) -> dict[int, object]:
    """Return a TIFF's EXIF values under their numbers."""
    if tag is None or not isinstance(tag.value, dict):
        return {}
    from PIL.ExifTags import Base

    numbers = Base.__members__
    return {int(numbers[key]): value for key, value in tag.value.items() if key in numbers}


def _info_from_exif(path: Path, size: tuple[int, int], bits: int, exif: Any) -> ImageInfo:
    """Return the facts given the stored size and a mapping of EXIF tags."""
    width, height = size
    tiff = path.suffix.lower() in TIFF_ENDINGS
    check_size(path, size, MAX_TIFF_PIXELS if tiff else MAX_PIXELS)
    tags = dict(exif)
    if hasattr(exif, "get_ifd"):
        tags |= dict(exif.get_ifd(34665))
    orientation = tags.get(274, 1)
    orientation = int(orientation) if orientation in range(1, 9) else 1
    return ImageInfo(
        path=path,
        size=(height, width) if orientation >= 5 else (width, height),
        orientation=orientation,
        bits=bits,
        make=_text(tags.get(271)),
        model=_text(tags.get(272)),
        lens=_text(tags.get(42036)),
        focal_length=_number(tags.get(37386)),
        focal_length_35=_number(tags.get(41989)),
        focal_plane_pitch=_pitch(tags),
        aperture=_number(tags.get(33437)),
        subject_distance=_number(tags.get(37382)),
        recorded_size=_recorded(tags),
        digital_zoom=_number(tags.get(41988)),
    )


def check_size(path: Path, size: tuple[int, int], most: int = MAX_PIXELS) -> None:
    """Refuse photos of more pixels than these."""
    width, height = size
    if width * height > most:
        raise InputError(
            remark(
                "photo.too_large", of=path, width=width, height=height, most=most // 10**6,
                name=path.name,
            )
        )  # fmt: skip


def _text(value: Any) -> str:
    """Return an EXIF text without padding."""
    return str(value).replace("\x00", "").strip() if value is not None else ""


def _number(value: Any) -> float | None:
    """Return an EXIF rational as a float; None when absent, zero or broken."""
    try:
        number = value[0] / value[1] if isinstance(value, tuple) else float(value)
    except (TypeError, ValueError, ZeroDivisionError, IndexError):
        return None
    return float(number) if np.isfinite(number) and number > 0 else None


def _recorded(tags: dict[int, object]) -> tuple[int, int] | None:
    """Return the size in pixels that the EXIF data state; None where they state none."""
    width, height = _number(tags.get(40962)), _number(tags.get(40963))
    return (round(width), round(height)) if width and height else None


def _pitch(tags: dict[int, object]) -> float | None:
    """Return the pixel size in mm from the focal-plane resolution."""
    resolution = _number(tags.get(41486))
    unit = {2: 25.4, 3: 10.0, 4: 1.0}.get(int(_number(tags.get(41488, 2)) or 0))
    return unit / resolution if resolution and unit else None


def _hide_tiff_orientation(path: Path, data: NDArray[np.uint8]) -> None:
    """Set the orientation tag in memory to 1: OpenCV turns TIFFs whatever its flags say."""
    import tifffile

    with tifffile.TiffFile(path) as tiff:
        page: Any = tiff.pages[0]
        tag = page.tags.get(274)
        if tag is not None:
            order = "<u2" if tiff.byteorder == "<" else ">u2"
            data[tag.valueoffset : tag.valueoffset + 2] = np.array([1], order).view(np.uint8)


@contextmanager
def _pillow_without_size_limit() -> Iterator[None]:
    """Let Pillow read headers of large photos; our own limit is checked instead."""
    from PIL import Image

    before = Image.MAX_IMAGE_PIXELS
    Image.MAX_IMAGE_PIXELS = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        Image.MAX_IMAGE_PIXELS = before
