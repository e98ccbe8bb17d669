"""Where a project's photos lie on this disk."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePath

from photocore.errors import InputError
from photocore.images import image_info
from photocore.names import on_disk
from photocore.remarks import remark

_ENDINGS = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
#: Folders beside a project in which programs keep its photos.
_USUAL = ("", "images", "photos", "opensfm/images")


class PhotoFinder:
    """Finds photos by the names that a project has for them.

    Parameters
    ----------
    project : path
        File or folder of the project.
    images : path, optional
        Folder of its photos; without it folders about the project are searched.
    """

    def __init__(self, project: Path, images: Path | None = None) -> None:
        if images is not None and not images.is_dir():
            raise InputError(f"{images}: is no folder; name the one that holds the photos.")
        about = (project.absolute(), *project.absolute().parents)[:4]
        usual = (folder / name for folder in about for name in _USUAL)
        self.folders = [images] if images else [one for one in usual if one.is_dir()]
        self.images = images

    def find(self, name: str) -> Path | None:
        """Return the file of a photo; None where there is none."""
        places = [place for place in self._candidates(name)]
        exact = (path for path in places if path.is_file())
        return next(exact, None) or next((p for p in map(on_disk, places) if p.is_file()), None)

    def _candidates(self, name: str) -> Iterator[Path]:
        plain = PurePath(name)
        if self.images is None and plain.is_absolute():
            yield Path(name)
        for folder in self.folders:
            for part in dict.fromkeys((plain.as_posix(), plain.name)):
                if Path(part).is_absolute():
                    continue
                yield folder / part
                if plain.suffix.lower() not in _ENDINGS:  # Metashape's labels have no ending
                    for ending in (*_ENDINGS, *map(str.upper, _ENDINGS)):
                        yield folder / f"{part}{ending}"

    def size(self, name: str) -> tuple[int, int]:
        """Return width and height of a photo [px]; its project does not tell them.

        Raises
        ------
        InputError
            If the photo is not there.
        """
        if (path := self.find(name)) is None:
            raise InputError(remark("programs.no_size", of=name))
        return image_info(path).size
