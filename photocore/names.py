"""Names as people write them: of photos, points and headings, and those nearest to what is not."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Iterable, Sequence
from difflib import get_close_matches
from pathlib import PurePath

#: The same name, as forgiving as it goes: letter by letter, without folders, without ending.
_FORMS: tuple[Callable[[PurePath], str], ...] = (
    PurePath.as_posix, lambda path: path.name, lambda path: path.stem,
)  # fmt: skip


def plain_name(text: str) -> str:
    """Return a name as it is compared: composed letters, one case, folders with slashes."""
    return unicodedata.normalize("NFC", text).casefold().strip().replace("\\", "/")


def called(name: str, names: Sequence[str | Sequence[str]]) -> list[int]:
    """Return which of the names are meant: whole, else without folders, else without ending.

    One that has several is listed with all of them.

    Examples
    --------
    >>> called("img_1.jpg", ["a/IMG_1.JPG", "IMG_2.JPG"]), called("IMG_3", ["IMG_1.JPG"])
    ([0], [])
    >>> called("2", [("far", "1"), ("near", "2")])
    [1]
    """
    each = [(one,) if isinstance(one, str) else one for one in names]
    wanted = PurePath(plain_name(name))
    for form in _FORMS:
        fits = [
            k
            for k, forms in enumerate(each)
            if any(one and form(PurePath(plain_name(one))) == form(wanted) for one in forms)
        ]
        if fits:
            return fits
    return []


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
