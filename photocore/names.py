"""Names as people write them: of photos, points and headings, and those nearest to what is not."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from difflib import get_close_matches
from itertools import takewhile
from pathlib import Path, PurePath

#: The same name, as forgiving as it goes: letter by letter, without folders, without ending.
_FORMS: tuple[Callable[[PurePath], str], ...] = (
    PurePath.as_posix, lambda path: path.name, lambda path: path.stem,
)  # fmt: skip
_LEADING_ZEROS = re.compile(r"(?<![\d.,])0+(?=\d)")


def plain_name(text: str) -> str:
    """Return a name as it is compared: composed letters, one case, folders with slashes."""
    return unicodedata.normalize("NFC", text).casefold().strip().replace("\\", "/")


def called(name: str, names: Sequence[str | Sequence[str]]) -> list[int]:
    """Return which of the names are meant: whole, else without folders, else without ending.

    One that has several is listed with all of them. Of files called alike the one in the folder of
    this name is meant.

    Examples
    --------
    >>> called("img_1.jpg", ["a/IMG_1.JPG", "IMG_2.JPG"]), called("IMG_3", ["IMG_1.JPG"])
    ([0], [])
    >>> called("2", [("far", "1"), ("near", "2")]), called("b/1.jpg", ["/x/a/1.jpg", "/x/b/1.JPG"])
    ([1], [1])
    """
    each = [(one,) if isinstance(one, str) else one for one in names]
    wanted = PurePath(plain_name(name))
    for form in _FORMS:
        fits = [
            k
            for k, forms in enumerate(each)
            if any(one and form(PurePath(plain_name(one))) == form(wanted) for one in forms)
        ]
        if len(fits) > 1:
            tails = [max(_shared_tail(wanted, one) for one in each[k]) for k in fits]
            fits = [k for k, tail in zip(fits, tails, strict=True) if tail == max(tails)]
        if fits:
            return fits
    return []


def _shared_tail(wanted: PurePath, name: str) -> int:
    """Return how many of the last folders two names share."""
    folders = zip(wanted.parts[-2::-1], PurePath(plain_name(name)).parts[-2::-1], strict=False)
    return sum(1 for _ in takewhile(lambda both: both[0] == both[1], folders))


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the name that is most like one that is none of them; empty where none is.

    Examples
    --------
    >>> nearest("Coloumn 1", ["column1", "row1"])
    'column1'
    """
    plain = {plain_name(one): one for one in names}
    near = get_close_matches(plain_name(name), plain, n=1, cutoff=0.7)
    return plain[near[0]] if near else ""


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Return, in brackets, the nearest of names to one that is none of them; empty without one.

    Examples
    --------
    >>> did_you_mean("left", ["lefty", "right"]), did_you_mean("a", ["right"])
    (' (did you mean lefty?)', '')
    """
    near = nearest(name, names)
    return f" (did you mean {near}?)" if near else ""


def meant(names: Iterable[str], among: Collection[str]) -> list[str]:
    """Return names of points as they are called among others.

    Capitals and leading zeros may differ; of several called so the one that none of the names is
    already. What none is called, or still several are, stays as it is.

    Examples
    --------
    >>> meant(["t1", "7", "P2", "Q"], ["T01", "007", "p2", "P02"])
    ['T01', '007', 'P2', 'Q']
    >>> meant(["7", "007"], ["7", "07"])
    ['7', '07']
    """
    alike: dict[str, list[str]] = {}
    among = dict.fromkeys(among)
    for name in among:
        alike.setdefault(_of_point(name), []).append(name)
    names = list(names)
    whole = {name for name in names if name in among}
    found = []
    for name in names:
        fits = alike.get(_of_point(name), [])
        fits = [one for one in fits if one not in whole] or fits
        found.append(fits[0] if name not in whole and len(fits) == 1 else name)
    return found


def on_disk(path: Path, *, any_case: bool = True) -> Path:
    """Return the file or folder that a path means: its letters may be composed or not.

    Parameters
    ----------
    path : Path
    any_case : bool
        Also in upper or lower case, where only one is called so, as on Windows and macOS.

    Returns
    -------
    path : Path
        As it was where nothing is called so.
    """
    with suppress(OSError, ValueError):
        if path.name in ("", "..") or path.exists():
            return path
        folder = on_disk(path.parent, any_case=any_case)
        kept = plain_name if any_case else _composed
        fits = [one for one in folder.iterdir() if kept(one.name) == kept(path.name)]
        return fits[0] if len(fits) == 1 else path
    return path


def near_file(path: Path) -> str:
    """Return the name in a folder that is most like one that is missing, of the same numbers."""
    with suppress(OSError):
        numbers = _numbers(path.stem)
        beside = path.parent.iterdir()
        stems = {one.stem: one.name for one in beside if _numbers(one.stem) == numbers}
        return stems.get(nearest(path.stem, stems), "")
    return ""


def _of_point(name: str) -> str:
    return _LEADING_ZEROS.sub("", plain_name(name))


def _composed(text: str) -> str:
    return unicodedata.normalize("NFC", text)


def _numbers(stem: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d{1,18}", stem)]
