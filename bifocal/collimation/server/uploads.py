"""Photos dropped on the page: checked before anything of them reaches the survey's folder."""

from __future__ import annotations

import re
import shutil
import tempfile
import unicodedata
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from PIL import Image

from bifocal.collimation.project import PHOTOS
from bifocal.files import judged_focal
from bifocal.remarks import remark
from photocore.errors import InputError
from photocore.images import FORMATS, ImageInfo, image_info, read_image
from photocore.output import atomic_path, free_path

#: A survey of more photos is one of pairs.
MOST = 12
#: Photos of more pixels per byte than any camera writes are no photos. [px/byte, px]
EMPTIEST, FROM = 400, 20_000_000
#: Names that Windows keeps for devices.
_DEVICE = re.compile(r"con|prn|aux|nul|(com|lpt)\d", re.IGNORECASE)


def take_photos(
    folder: Path, sent: Sequence[tuple[str, BinaryIO]], there: Sequence[Path] = ()
) -> tuple[Path, ...]:
    """Put photos into a folder, and return where those of the survey lie, far one first.

    Parameters
    ----------
    folder : Path
    sent : sequence of (name, file)
        As the browser sent them; of the name all that may stand in a file name is kept.
    there : sequence of Path
        Photos that lie on the table: they stay, where fewer than two come, or lay there.

    Raises
    ------
    InputError
        If they are no photos, or too many; nothing is written then.
    """
    kept = there if len(there) == 1 or len(sent) == 1 else ()
    if not 1 <= len(sent) <= MOST - len(kept):
        raise InputError(remark("page.many_photos", most=MOST))
    with tempfile.TemporaryDirectory() as place:
        checked = []
        for number, (name, file) in enumerate(sent):
            path = Path(place) / str(number) / safe_name(name)
            path.parent.mkdir()
            with path.open("wb") as target:
                shutil.copyfileobj(file, target)
            checked.append(_checked(path))
        infos = [*map(image_info, kept), *checked]
        for info in checked:
            if any(_same(info.path, path) for path in kept):
                raise InputError(remark("page.same_photo", name=info.path.name))
        if len(kept) < 2:  # else far and near are known
            infos = far_first(infos)
        copies: list[Path] = []
        try:
            return tuple(i.path if i.path in kept else _kept(folder, i.path, copies) for i in infos)
        except BaseException:  # all of them, or none
            for path in copies:
                path.unlink(missing_ok=True)
            raise


def safe_name(name: str) -> str:
    r"""Return a file name without anything that a file system may take for more than a name.

    Examples
    --------
    >>> safe_name("../../etc/Façade 1.JPG"), safe_name("C:\\\\x\\\\far?.tif"), safe_name("CON.jpg")
    ('Façade 1.jpg', 'far.tif', 'CON_.jpg')
    """
    last = name.replace("\\", "/").rpartition("/")[2]
    stem, dot, ending = last.rpartition(".")
    ending = f".{ending.lower()}"
    if not dot or ending not in PHOTOS:
        raise InputError(remark("page.no_photo", name=last[:60]))
    stem = unicodedata.normalize("NFC", stem)
    letters = "".join(c if c.isalnum() or c in " -_.,()+&'" else "_" for c in stem)
    tidy = letters.strip(" _.")[:80].strip() or "photo"
    return f"{tidy}{'_' * (_DEVICE.fullmatch(tidy) is not None)}{ending}"


def far_first(infos: Sequence[ImageInfo]) -> list[ImageInfo]:
    """Return photos with that of the longest lens first, then that of the shortest.

    Lengths count in widths of the picture, which resizing keeps. As they are where one does not
    tell its lens, or all have the same.
    """
    judged = [judged_focal(info).focal for info in infos]
    angles = [f and f / max(info.size) for f, info in zip(judged, infos, strict=True)]
    lengths = angles if all(angles) else [info.focal_length for info in infos]
    focal = {info.path: f or 0.0 for info, f in zip(infos, lengths, strict=True)}
    if not all(focal.values()) or len(infos) < 2:
        return list(infos)
    far, *others = sorted(infos, key=lambda info: -focal[info.path])
    near = others[-1] if focal[others[-1].path] < focal[far.path] else others[0]
    return [far, near, *(info for info in infos if info not in (far, near))]


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
            with Image.open(path, formats=FORMATS) as image:
                width, height = image.size
    except Image.DecompressionBombError:
        raise InputError(remark("page.too_large", name=path.name)) from None
    except (OSError, SyntaxError, ValueError):
        return
    if width * height > FROM and width * height > EMPTIEST * size:
        raise InputError(
            remark("page.bomb", name=path.name, width=width, height=height, size=size // 1024)
        )


def _kept(folder: Path, path: Path, copies: list[Path]) -> Path:
    """Copy a photo into the folder and list it; one that lies there already is not copied again."""
    target = folder / path.name
    if target.is_file() and _same(target, path):
        return target
    target = free_path(folder, path.stem, path.suffix)
    with atomic_path(target, overwrite=False) as temporary:
        shutil.copyfile(path, temporary)
    copies.append(target)
    return target


def _same(one: Path, other: Path) -> bool:
    return one.read_bytes() == other.read_bytes()
