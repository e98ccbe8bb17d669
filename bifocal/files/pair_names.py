"""What a pair or set is called: by itself, its file or the folder it lies in."""

from __future__ import annotations

from pathlib import Path

from bifocal.model import Pair, PhotoSet, pair_or_set

#: What is no part of the name of a pair's file.
_ENDINGS = (".pair.json", ".photos.json", ".json", ".xlsx", ".xlsm")
#: Names shorter than this say nothing as a title: the folder's is taken.
_SHORT = 3


def without_ending(name: str) -> str:
    """Return the name of a pair's file without its ending; it may have dots of its own.

    >>> without_ending("S. Maria.pair.json")
    'S. Maria'
    """
    ending = next((end for end in _ENDINGS if name.lower().endswith(end)), "")
    return name[: len(name) - len(ending)]


def default_title(source: Pair | PhotoSet | Path, path: Path | None = None) -> str:
    """Return the name of a pair; of a nameless one that of its file, or of the file's folder.

    The folder's where there is no file, or one called ``w`` or the like.

    Parameters
    ----------
    source : Pair, PhotoSet or Path
    path : Path, optional
        Where a pair was read from.
    """
    path = source if isinstance(source, Path) else path
    pair = pair_or_set(source)
    if pair.extra.get("name"):
        return str(pair.extra["name"])
    stem = without_ending(path.name) if path else ""
    if len(stem) >= _SHORT:
        return stem
    folder = (path.parent if path else pair.folder).resolve().name
    return folder if len(folder) >= _SHORT else "wall"
