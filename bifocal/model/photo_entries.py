"""What the files of pairs and of sets of photos hold: photo entries, media and their covariance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from bifocal.model import orientation_precision
from bifocal.model.lens import Lens
from bifocal.model.photo import Photo
from multimedia import Layers
from photocore.arrays import FloatArray
from photocore.errors import InputError
from photocore.jsonfile import write_object
from photocore.provenance import known_hash

#: Format of a pair file and of a file of two photos or more.
PAIR_FORMAT, SET_FORMAT = "bifocal-pair/1", "bifocal-photos/1"


class PhotoEntries(NamedTuple):
    """Photos in the order of their file, the covariance of all, and the keys not known.

    A lens file that several photos name is one `Lens`.
    """

    photos: tuple[Photo, ...]
    orientation: FloatArray | None
    extra: dict[str, object]


def photo_entries(data: Mapping[str, Any], folder: Path, *formats: str) -> PhotoEntries:
    """Return what the file of a pair or of a set holds.

    Parameters
    ----------
    data : mapping
        Its content.
    folder : Path
        Where it lies; lens files are looked for from there.
    *formats : str
        Those that are taken, the one to name first.

    Raises
    ------
    InputError, GeometryError
        Naming the key that is wrong.
    """
    data = dict(data)
    stated = data.pop("format", None)
    if stated not in formats:
        raise InputError(f'"format" must be "{formats[0]}", found {stated!r}.')
    media = data.pop("layers", None)
    layers = None if media is None else Layers.from_dict(media, where='"layers"')
    if stated == PAIR_FORMAT:
        entries = {key: data.pop(key, None) for key in ("image1", "image2")}
    else:
        listed = data.pop("photos", None)
        if not isinstance(listed, list) or len(listed) < 2:
            raise InputError('"photos" must list two photos or more.')
        entries = {f"photos[{number}]": entry for number, entry in enumerate(listed)}
    lens_of = cache(Lens.read)
    digests = _recorded_digests(data.get("provenance"))
    photos = [
        Photo.from_dict(_with_digest(entry, digests), key, folder, layers, lens_of=lens_of)
        for key, entry in entries.items()
    ]
    stated = data.pop("orientation", None)
    if stated is not None:
        stated = orientation_precision.from_dict(stated, layers, len(photos))
    return PhotoEntries(tuple(photos), stated, data)


def file_content(
    head: Mapping[str, object],
    photos: Sequence[Photo],
    extra: Mapping[str, object],
    orientation: FloatArray | None,
) -> dict[str, object]:
    """Return the content of a file: format and photos, media, other keys, covariance."""
    layers = photos[0].layers
    data = {**head, **({"layers": layers.as_dict()} if layers else {}), **extra}
    if orientation is not None:
        data["orientation"] = orientation_precision.as_dict(orientation, layers, len(photos))
    return data


def write_content(path: Path | str, content: dict[str, Any], *, overwrite: bool) -> None:
    """Write the file of a pair or set, each photo that is there with the SHA-256 of its file."""
    entries = content.get("photos") or [content["image1"], content["image2"]]
    for entry in entries:
        photo = Path(path).parent / entry.get("file", "")
        if not entry.get("sha256") and photo.is_file():
            entry["sha256"] = known_hash(photo)
    write_object(path, content, overwrite=overwrite)


def _recorded_digests(provenance: Any) -> dict[str, str]:
    """Return SHA-256 by file name as a file says where it comes from; of names of one file."""
    inputs = provenance.get("inputs") if isinstance(provenance, dict) else None
    digests: dict[str, set[str]] = {}
    for item in inputs if isinstance(inputs, list) else ():
        with suppress(LookupError, TypeError):
            digests.setdefault(str(item["file"]), set()).add(str(item["sha256"]))
    return {name: one.pop() for name, one in digests.items() if len(one) == 1}


def _with_digest(entry: Any, digests: Mapping[str, str]) -> Any:
    """Return the entry of a photo with the SHA-256 of its file, where it was recorded elsewhere."""
    if not isinstance(entry, dict) or "sha256" in entry or not isinstance(entry.get("file"), str):
        return entry
    digest = digests.get(PurePath(entry["file"]).name)
    return entry if digest is None else {**entry, "sha256": digest}
