"""Changed packages of spreadsheets written anew, never one that no program would open."""

from __future__ import annotations

import os
import posixpath
import re
import zipfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO
from xml.parsers import expat

from photocore.errors import InputError
from photocore.workbook.package import SMALL, local, read_part

#: Date of parts that are added, so that equal input makes equal files.
NEW_PART_TIME = (1980, 1, 1, 0, 0, 0)
#: Levels of zlib. On 225 MB of sheets level 2 takes a third of the time of level 6 and a
#: quarter more space.
_FAST, _THOROUGH = 2, 6
#: The namespaces of references to relations, of ordinary and of strict workbooks.
_REFERENCES = re.compile(
    rb"\sxmlns:([\w.-]+)\s*=\s*[\"']http://(?:schemas\.openxmlformats|purl\.oclc)\.org/"
    rb"(?:officeDocument/2006|ooxml/officeDocument)/relationships[\"']"
)


def rewrite_package(
    source: Path | BinaryIO,
    target: Path,
    parts: Mapping[str, bytes | None],
    *,
    date: tuple[int, int, int, int, int, int] | None = None,
) -> None:
    """Copy a zip package with parts replaced, left out (None), or added at its end.

    Order, methods and (without one) dates stay.

    Raises
    ------
    InputError
        If the copy would be damaged where the package was not: see `_refuse_damage`.
    """
    named = source if isinstance(source, Path) else target
    with zipfile.ZipFile(source) as old, target.open("wb") as file:
        _refuse_damage(named, old, parts)
        with zipfile.ZipFile(file, "w") as new:
            new.comment = old.comment
            listed = old.infolist()
            for info in listed:
                data = parts.get(info.filename)
                if data is None and info.filename in parts:
                    continue
                copy = zipfile.ZipInfo(info.filename, date or info.date_time)
                stored = info.compress_type == zipfile.ZIP_STORED
                copy.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
                copy.external_attr, copy.create_system = info.external_attr, info.create_system
                data = read_part(named, old, info.filename) if data is None else data
                new.writestr(copy, data, compresslevel=_level(data))
            known = {info.filename for info in listed}
            for name in [name for name in parts if name not in known]:
                added = zipfile.ZipInfo(name, date or NEW_PART_TIME)
                added.compress_type = zipfile.ZIP_DEFLATED
                added.external_attr = 0o600 << 16
                data = parts[name] or b""
                new.writestr(added, data, compresslevel=_level(data))
        file.flush()
        os.fsync(file.fileno())


def _level(data: bytes) -> int:
    """Return how hard to compress a part: sheets of many MB take most of the time of a change."""
    return _FAST if len(data) > SMALL else _THOROUGH


def _refuse_damage(path: Path, old: zipfile.ZipFile, parts: Mapping[str, bytes | None]) -> None:
    """Refuse parts that are not XML, or refer to what is not there, unless they did so before.

    Raises
    ------
    InputError
        Naming the part; a workbook as it was is better than one that no program opens.
    """
    held = {*old.namelist()}
    names = {name for name in {*held, *parts} if parts.get(name, b"") is not None}
    endings = (".xml", ".rels")
    looked_at = [name for name in parts if name in names and name.endswith(endings)]
    if names < held:
        looked_at += [name for name in names - parts.keys() if name.endswith(".rels")]

    def before(name: str) -> bytes:
        return read_part(path, old, name)

    faults = [*_faults(lambda name: parts.get(name) or before(name), names, looked_at)]
    known = {*_faults(before, held, held.intersection(looked_at))} if faults else ()
    for fault in faults:
        if fault not in known:
            raise InputError(
                f"{path}: nothing was written, since no program would open the changed workbook "
                f"({fault}). Open it in the spreadsheet program, save it there, and try again."
            )


def _faults(
    read: Callable[[str], bytes], names: Collection[str], looked_at: Iterable[str]
) -> Iterator[str]:
    """Yield why a spreadsheet program would not open a package with these parts."""
    for name in looked_at:
        folder, file = posixpath.split(name)
        relations = f"{folder}/_rels/{file}.rels".lstrip("/")
        try:
            targets = _targets(read(name), posixpath.dirname(folder))
            keys = _targets(read(relations)) if relations in names else {}
        except expat.ExpatError as error:
            yield f"{name} is not valid XML: {expat.ErrorString(error.code)}"
            continue
        if name.endswith(".rels"):
            missing = [target for target in targets.values() if target and target not in names]
            yield from (f"{name} leads to {target}, which is missing" for target in missing)
        for prefix in {*_REFERENCES.findall(read(name))}:
            reference = rb"\s%s:(?:id|embed|link|pict)\s*=\s*[\"']([^\"']+)" % re.escape(prefix)
            for key in {*re.findall(reference, read(name))} - keys.keys():
                yield f"{name} has no relation {key.decode(errors='replace')}"


def _targets(data: bytes, folder: str = "") -> dict[bytes, str]:
    """Return the parts that relations lead to, by their ids, empty outside of the package.

    Raises
    ------
    ExpatError
        If the data are not XML whose prefixes are all declared.
    """
    found = {}

    def note(name: str, attributes: dict[str, str]) -> None:
        if local(name) == "Relationship":
            whole = posixpath.normpath(posixpath.join("/", folder, attributes.get("Target", "")))
            inside = attributes.get("TargetMode") != "External"
            found[attributes.get("Id", "").encode()] = whole.lstrip("/") if inside else ""

    parser = expat.ParserCreate(namespace_separator="}")
    if b"Relationship" in data[:2000]:
        parser.StartElementHandler = note
    parser.Parse(data, True)
    return found
