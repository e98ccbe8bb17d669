"""Changed packages of spreadsheets written anew, never one that no program would open."""

from __future__ import annotations

import os
import re
import zipfile
from collections.abc import Container, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO
from xml.parsers import expat

from photocore.errors import InputError
from photocore.workbook.package import SMALL, read_part
from photocore.workbook.xlsx import read_relations

#: Date of parts that are added, so that equal input makes equal files.
NEW_PART_TIME = (1980, 1, 1, 0, 0, 0)
#: Levels of zlib. On 225 MB of sheets level 2 takes a third of the time of level 6 and a
#: quarter more space.
_FAST, _THOROUGH = 2, 6
#: The namespaces of references to relations, of ordinary and of strict workbooks.
_REFERENCES = re.compile(rb"xmlns:(\w+)=[\"'][^\"']*/officeDocument/(?:2006/)?relationships[\"']")


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
        _refuse_damage(named, old, target, parts)


def _level(data: bytes) -> int:
    """Return how hard to compress a part: sheets of many MB take most of the time of a change."""
    return _FAST if len(data) > SMALL else _THOROUGH


def _refuse_damage(path: Path, old: zipfile.ZipFile, target: Path, changed: Container[str]) -> None:
    """Refuse changed parts that are no XML or refer to what is not there, unless they did so."""
    with zipfile.ZipFile(target) as new:
        found = (f for f in _faults(path, new, changed) if f not in {*_faults(path, old, changed)})
        fault = next(found, "")
    if fault:
        raise InputError(
            f"{path}: nothing was written, since no program would open the changed workbook "
            f"({fault}). Open it in the spreadsheet program, save it there, and try again."
        )


def _faults(path: Path, package: zipfile.ZipFile, changed: Container[str]) -> Iterator[str]:
    """Yield why a spreadsheet program would not open a package."""
    names = {*package.namelist()}
    for name in ("", *package.namelist()):
        try:
            relations = read_relations(path, package, name)
            data = package.read(name) if name in changed and name.endswith(".xml") else b"<x/>"
            expat.ParserCreate(namespace_separator=" ").Parse(data, True)
        except (InputError, expat.ExpatError) as error:
            yield f"{name} is not valid XML: {str(error).partition(': line')[0]}"
            continue
        for _, place in relations.values():
            if place and place not in names:
                yield f"{name} leads to {place}, which is missing"
        for prefix in {*_REFERENCES.findall(data)}:
            for key in re.findall(rb"\s%s:(?:id|embed|link)=[\"']([^\"']+)" % prefix, data):
                if key.decode() not in relations:
                    yield f"{name} has no relation {key.decode()}"
