"""Photos dropped on the page: checked before anything of them reaches the survey's folder."""

from __future__ import annotations

import shutil
import tempfile
import unicodedata
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from PIL import Image

from bifocal.collimation.project import PHOTOS
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.images import ImageInfo, image_info, read_image
from photocore.output import atomic_path, free_path

#: Photos of more pixels per byte than any camera writes are no photos. [px/byte, px]
EMPTIEST, FROM = 400, 20_000_000


def take_photos(
    folder: Path, sent: Sequence[tuple[str, BinaryIO]], there: Sequence[Path] = ()
) -> tuple[Path, ...]:
    """Put photos into a folder, and return where those of the survey lie, far one first.

    Parameters
    ----------
    folder : Path
    sent : sequence of (name, file)
        One or two, as the browser sent them; of the name all that may stand in a file name is kept.
    there : sequence of Path
        The photo that lay on the table alone: it stays, where one more comes.

    Raises
    ------
    InputError
        If they are no photos, or too many; nothing is written then.
    """
    kept = there if len(there) == 1 and len(sent) == 1 else ()
    if not 1 <= len(sent) <= 2:
        raise InputError(remark("page.two_photos", count=len(sent)))
    if len(there) == 2 and len(sent) == 1:
        raise InputError(remark("page.third_photo"))
    with tempfile.TemporaryDirectory() as place:
        checked = []
        for number, (name, file) in enumerate(sent):
            path = Path(place) / str(number) / safe_name(name)
            path.parent.mkdir()
            with path.open("wb") as target:
                shutil.copyfileobj(file, target)
            checked.append(_checked(path))
        infos = [*map(image_info, kept), *checked]
        if len(infos) == 2:
            if kept and _same(infos[0].path, infos[1].path):
                raise InputError(remark("page.same_photo", name=infos[1].path.name))
            infos = far_first(infos)
        return tuple(i.path if i.path in kept else _kept(folder, i.path) for i in infos)


def safe_name(name: str) -> str:
    r"""Return a file name without anything that a file system may take for more than a name.

    Examples
    --------
    >>> safe_name("../../etc/Façade 1.JPG"), safe_name("C:\\\\x\\\\far?.tif")
    ('Façade 1.jpg', 'far.tif')
    """
    last = name.replace("\\", "/").rpartition("/")[2]
    stem, dot, ending = last.rpartition(".")
    ending = f".{ending.lower()}"
    if not dot or ending not in PHOTOS:
        raise InputError(remark("page.no_photo", name=last[:60]))
    stem = unicodedata.normalize("NFC", stem)
    letters = "".join(c if c.isalnum() or c in " -_.,()+&'" else "_" for c in stem)
    return f"{letters.strip(' _.')[:80].strip() or 'photo'}{ending}"


def far_first(infos: Sequence[ImageInfo]) -> list[ImageInfo]:
    """Return two photos with that of the longer lens first, where they tell their lens."""
    first, second = infos
    focal = [info.focal_pixels or info.focal_length for info in (first, second)]
    if focal[0] and focal[1] and focal[1] > focal[0]:
        return [second, first]
    return [first, second]


def _checked(path: Path) -> ImageInfo:
    """Return the facts of a photo, after a look at every byte of it."""
    try:
        _refuse_bomb(path)
        info = image_info(path)
        read_image(path)
    except InputError as error:
        raise InputError(str(error).replace(f"{path.parent}/", "")) from None
    return info


def _refuse_bomb(path: Path) -> None:
    """Refuse, by its header alone, what would grow beyond all bounds when it is decoded.

    What Pillow cannot open, `image_info` refuses.
    """
    size = path.stat().st_size
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path) as image:
                width, height = image.size
    except Image.DecompressionBombError:
        raise InputError(remark("page.too_large", name=path.name)) from None
    except (OSError, SyntaxError, ValueError):
        return
    if width * height > FROM and width * height > EMPTIEST * size:
        raise InputError(
            remark("page.bomb", name=path.name, width=width, height=height, size=size // 1024)
        )


def _kept(folder: Path, path: Path) -> Path:
    """Copy a photo into the folder; one that lies there already is not copied again."""
    target = folder / path.name
    if target.is_file() and _same(target, path):
        return target
    target = free_path(folder, path.stem, path.suffix)
    with atomic_path(target, overwrite=False) as temporary:
        shutil.copyfile(path, temporary)
    return target


def _same(one: Path, other: Path) -> bool:
    return one.read_bytes() == other.read_bytes()
