"""Zip packages of spreadsheets, opened only when they are harmless."""

from __future__ import annotations

import gc
import lzma
import os
import posixpath
import re
import shutil
import zipfile
import zlib
from collections import UserDict
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager
from functools import lru_cache
from io import BytesIO
from itertools import accumulate
from pathlib import Path
from typing import IO, Any, BinaryIO, Literal
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.textfile import readable

#: Larger only in bombs, and in small parts of honest workbooks: rows of styled empty cells.
LARGEST_RATIO, LARGEST_RATIO_OF_SMALL = 250, 1000
SMALL = 16 * 2**20
LARGEST_PART = 256 * 2**20
LARGEST_TOTAL = 512 * 2**20
MOST_MEMBERS = 10_000
#: Date of parts that are added, so that equal input makes equal files.
NEW_PART_TIME = (1980, 1, 1, 0, 0, 0)
_RATIO_MATTERS_FROM = 2**20
#: Levels of zlib. On 100 MB of sheets level 5 takes three quarters of the time of level 6; level 3
#: takes half of it, and 8 % more space than level 5.
_FAST, _THOROUGH = 5, 6
_OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
#: The namespaces of references to relations, of ordinary and of strict workbooks.
_REFERENCES = re.compile(rb"xmlns:(\w+)=[\"'][^\"']*/officeDocument/(?:2006/)?relationships[\"']")
#: What spreadsheet programs take: characters of a formula, and how deep its brackets are.
_LONGEST, _DEEPEST = 8192, 64
_LONG = re.compile(rb"<(?:\w+:)?f(?:\s[^>]*)?>([^<]{8193,}|(?:[^<(]*\(){65}[^<]*)<")
#: Formulas are looked at so far into a part: rows further down repeat them. It is looked through
#: in pieces of so many bytes.
_FORMS = 2**21
#: Small, since the elements of a chunk are made before the first is looked at.
_CHUNK = 2**15
#: A tag is shorter.
_TAG = 2**12
#: What unpacking a damaged member may raise.
UNPACKING = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    OSError,
    EOFError,
    NotImplementedError,
    RuntimeError,  # zipfile's word for a missing password
)


@contextmanager
def open_package(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open a spreadsheet's zip package after checking that it is safe to unpack.

    Raises
    ------
    InputError
        If the file is missing, empty, encrypted, of the old binary format, damaged, not a zip
        package, or would unpack to more than the limits of this module.
    """
    check_header(path)
    try:
        package = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError):
        raise InputError(remark("book.damaged", of=path)) from None
    with package:
        check_members(path, package.infolist())
        yield package


def check_header(path: Path) -> None:
    """Refuse by its first bytes what is not a zip package, saying what it is instead.

    Raises
    ------
    InputError
        Always, unless the file begins like a zip package.
    """
    with readable(path, "table file"), path.open("rb") as file:
        start = file.read(8)
    if not start:
        raise InputError(f"{path}: the file is empty (0 bytes); save or copy it again.")
    if start == _OLE:
        raise InputError(remark("book.protected", of=path))
    if not start.startswith(b"PK"):
        raise InputError(remark("book.no_workbook", of=path))


def check_members(path: Path, members: list[zipfile.ZipInfo]) -> None:
    """Refuse packages that would unpack to absurd sizes or outside their place.

    Raises
    ------
    InputError
        Naming the first limit that is exceeded.
    """
    refuse = f"{path}: refused, this is not an ordinary workbook: "
    if len(members) > MOST_MEMBERS:
        raise InputError(f"{refuse}it has {len(members)} parts, more than {MOST_MEMBERS}.")
    check_names(refuse, members)
    total = 0
    for member in members:
        if member.flag_bits & 1:
            raise InputError(remark("book.password", of=path))
        total += member.file_size
        ratio = member.file_size / max(member.compress_size, 1)
        if member.file_size > LARGEST_PART or total > LARGEST_TOTAL:
            limits = {"total": LARGEST_TOTAL // 2**20, "part": LARGEST_PART // 2**20}
            raise InputError(remark("book.too_large", of=path, **limits))
        largest = LARGEST_RATIO if member.file_size > SMALL else LARGEST_RATIO_OF_SMALL
        if member.file_size > _RATIO_MATTERS_FROM and ratio > largest:
            raise InputError(
                f"{refuse}the part {member.filename!r:.80} grows {ratio:.0f}-fold when unpacked."
            )


def check_names(refuse: str, members: list[zipfile.ZipInfo]) -> None:
    """Refuse, in words that begin so, members that lie outside their package or are there twice."""
    names = set()
    for member in members:
        name = member.filename
        if name.startswith(("/", "\\")) or ".." in name.replace("\\", "/").split("/"):
            raise InputError(f"{refuse}the part {name!r:.80} lies outside the package.")
        if name in names:
            raise InputError(f"{refuse}it holds the part {name!r:.80} twice.")
        names.add(name)


def read_part(path: Path, package: zipfile.ZipFile, name: str) -> bytes:
    """Return the bytes of one part.

    Raises
    ------
    InputError
        If the part is missing or damaged.
    """
    whole = BytesIO()  # unpacked at once a large sheet is held twice for a moment
    with _unpacking(path, name), package.open(name) as member:
        shutil.copyfileobj(member, whole, _FORMS)
    return whole.getvalue()


class Parts(UserDict[str, bytes | None]):
    """Parts of a package by name, None for one to be left out; large ones lie in files."""

    data: dict[str, bytes | IO[bytes] | None]  # type: ignore[assignment]

    def __getitem__(self, name: str) -> bytes | None:
        """Return a part; its bytes are read anew."""
        part = self.data[name]
        return part if part is None or isinstance(part, bytes) else opened(part).read()

    def __setitem__(self, name: str, part: bytes | IO[bytes] | None) -> None:
        """Take a part, or a file that holds it."""
        self.data[name] = part

    def held(self, name: str) -> bytes | IO[bytes] | None:
        """Return a part as it lies here."""
        return self.data.get(name)

    def now(self, path: Path, package: zipfile.ZipFile, name: str) -> bytes:
        """Return a part of a package that these change, as it is by now."""
        part = self.get(name)
        return read_part(path, package, name) if part is None else part


def opened(part: bytes | IO[bytes]) -> IO[bytes]:
    """Return a part as a file to be read from its beginning."""
    if isinstance(part, bytes):
        return BytesIO(part)
    part.seek(0)
    return part


def windows(part: IO[bytes]) -> Iterator[tuple[bytes, bytes]]:
    """Yield a part piece by piece, each also with the end of the one before."""
    before = b""
    while piece := part.read(_FORMS):
        text = before + piece
        before = text[-_TAG:]
        yield piece, text


def rewrite_package(
    source: Path | BinaryIO,
    target: Path,
    parts: Parts,
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
                data = parts.held(info.filename)
                if data is None and info.filename in parts:
                    continue
                copy = zipfile.ZipInfo(info.filename, date or info.date_time)
                stored = info.compress_type == zipfile.ZIP_STORED
                copy.compress_type = zipfile.ZIP_STORED if stored else zipfile.ZIP_DEFLATED
                copy.external_attr, copy.create_system = info.external_attr, info.create_system
                data = read_part(named, old, info.filename) if data is None else data
                _write(new, copy, data)
            names = {info.filename for info in listed}
            for name in [name for name in parts if name not in names]:
                added = zipfile.ZipInfo(name, date or NEW_PART_TIME)
                added.compress_type = zipfile.ZIP_DEFLATED
                added.external_attr = 0o600 << 16
                _write(new, added, parts.held(name) or b"")
        file.flush()
        os.fsync(file.fileno())
        _refuse_damage(named, old, target, parts)


def _write(package: zipfile.ZipFile, info: zipfile.ZipInfo, part: bytes | IO[bytes]) -> None:
    """Write a part; to compress sheets of many MB takes most of the time of a change."""
    size = len(part) if isinstance(part, bytes) else part.seek(0, os.SEEK_END)
    info._compresslevel = _FAST if size > SMALL else _THOROUGH  # type: ignore[attr-defined]
    with package.open(info, "w") as member:
        shutil.copyfileobj(opened(part), member, SMALL)


def _refuse_damage(path: Path, old: zipfile.ZipFile, target: Path, changed: Parts) -> None:
    """Refuse changed parts that are no XML or refer to what is not there, unless they did so."""
    with zipfile.ZipFile(target) as new:
        faults = _faults(path, new, changed, changed)
        fault = next((f for f in faults if f not in {*_faults(path, old, changed, Parts())}), "")
    if fault:
        raise InputError(remark("book.would_not_open", of=path, fault=fault))


def _faults(
    path: Path, package: zipfile.ZipFile, changed: Container[str], parts: Parts
) -> Iterator[str]:
    """Yield why a spreadsheet program would not open a package; parts at hand are not unpacked."""
    names = {*package.namelist()}
    for name in ("", *package.namelist()):
        keys, start = set[bytes](), b""
        try:
            relations = read_relations(path, package, name)
            if name in changed and name.endswith(".xml"):
                part = parts.held(name)
                keys, start = _looked_through(opened(part) if part else package.open(name))
        except (InputError, expat.ExpatError) as error:
            yield f"{name} is not valid XML: {str(error).partition(': line')[0]}"
            continue
        for _, place in relations.values():
            if place and place not in names:
                yield f"{name} leads to {place}, which is missing"
        for key in sorted(keys):
            if key.decode() not in relations:
                yield f"{name} has no relation {key.decode()}"
        for text in _LONG.findall(start):
            steps = ((letter == 40) - (letter == 41) for letter in re.sub(rb'"[^"]*"', b"", text))
            size, depth = len(re.sub(rb"&\w+;", b" ", text)), max(accumulate(steps))
            if size > _LONGEST or depth > _DEEPEST:
                yield f"{name} has a formula of {size} characters, {depth} brackets deep"


def _looked_through(part: IO[bytes]) -> tuple[set[bytes], bytes]:
    """Return the relations that a part refers to, and its start; raises where it is no XML."""
    parser = expat.ParserCreate(namespace_separator=" ")
    prefixes, keys, start = set[bytes](), set[bytes](), b""
    for piece, text in windows(part):
        start = start or piece
        parser.Parse(piece, False)
        prefixes.update(_REFERENCES.findall(text))
        for prefix in prefixes:
            # What begins with plain letters is found ten times as quickly.
            pattern = rb"%s:(?<=\s%s:)(?:id|embed|link)=[\"']([^\"']+)[\"']" % (prefix, prefix)
            keys.update(re.findall(pattern, text))
    parser.Parse(b"", True)
    return keys, start


def package_faults(path: Path) -> list[str]:
    """Return why a spreadsheet program would not open a workbook, or ask to repair it."""
    with open_package(path) as package:
        return list(_faults(path, package, set(package.namelist()), Parts()))


def read_relations(path: Path, package: zipfile.ZipFile, part: str) -> dict[str, tuple[str, str]]:
    """Return id -> (kind, target part) of a part's relations; external targets are empty."""
    folder, name = posixpath.split(part)
    rels = posixpath.join(folder, "_rels", f"{name}.rels")
    relations: dict[str, tuple[str, str]] = {}
    if rels in package.namelist():
        for element in xml_root(path, package, rels).iter():
            if local(element.tag) == "Relationship":
                # An absolute target replaces the folder.
                whole = posixpath.join("/", folder, element.get("Target", ""))
                kind = element.get("Type", "").rpartition("/")[2]
                relation = kind, posixpath.normpath(whole).lstrip("/")
                external = element.get("TargetMode") == "External"
                relations[element.get("Id", "")] = ("", "") if external else relation
    return relations


def xml_events(
    path: Path, package: zipfile.ZipFile, name: str, *events: Literal["start", "end"]
) -> Iterator[tuple[str, Element]]:
    """Yield the events ("start", "end") of one XML part without ever holding its text whole.

    Raises
    ------
    InputError
        If the part is missing, damaged, not XML, or declares a document type (the door of entity
        bombs; no spreadsheet program writes one).
    """
    parser: Any = ElementTree.XMLPullParser(events)
    for _ in _fed(path, package, name, parser):
        try:
            yield from parser.read_events()
        except ElementTree.ParseError as error:  # found while feeding, raised here
            raise InputError(f"{path}: {name} is damaged ({error}); save the file again.") from None


def xml_elements(path: Path, package: zipfile.ZipFile, name: str, *kinds: str) -> Iterator[Element]:
    """Yield the elements of some kinds of one XML part, those inside of which are not looked for.

    As `xml_events`, several times as fast: the tree grows chunk by chunk without a word to Python,
    and is emptied of what is complete.
    """
    builder = ElementTree.TreeBuilder()
    tree = builder.start("", {})
    for _ in _fed(path, package, name, ElementTree.XMLParser(target=builder)):
        yield from _taken(tree, kinds, whole=False)
    yield from _taken(tree, kinds, whole=True)


def _taken(tree: Element, kinds: tuple[str, ...], *, whole: bool) -> Iterator[Element]:
    """Take the parts of an element out, unless ``whole`` all but the last, which may still grow."""
    parts = tree[:] if whole else tree[:-1]
    del tree[: len(parts)]
    for part in parts:
        if local(part.tag) in kinds:
            yield part
        else:
            yield from _taken(part, kinds, whole=True)
    for part in tree:
        if local(part.tag) not in kinds:
            yield from _taken(part, kinds, whole=False)


def _fed(path: Path, package: zipfile.ZipFile, name: str, parser: Any) -> Iterator[None]:
    """Feed one XML part to a parser, with a pause after each chunk."""
    rooted: list[str] = []
    guard = new_parser(path, name, start=lambda root, _: rooted.append(root))
    try:
        with _unpacking(path, name), package.open(name) as part:
            while chunk := part.read(_CHUNK):
                if not rooted:  # a document type can only stand before the root
                    guard.Parse(chunk, False)
                parser.feed(chunk)
                yield
            parser.close()
            yield
    except (expat.ExpatError, ElementTree.ParseError, LookupError) as error:
        raise InputError(remark("book.not_xml", of=path, part=name, error=error)) from None


def xml_root(path: Path, package: zipfile.ZipFile, name: str) -> Element:
    """Return the root of one small XML part."""
    *_, (_, root) = xml_events(path, package, name, "end")
    return root


def new_parser(
    path: Path,
    name: str,
    *,
    start: Callable[[str, dict[str, str]], object],
    end: Callable[[str], object] | None = None,
) -> Any:
    """Return an expat parser that refuses document types."""
    parser = expat.ParserCreate()

    def refuse(*_: object) -> None:
        raise InputError(remark("book.document_type", of=path, part=name))

    parser.StartDoctypeDeclHandler = refuse
    parser.buffer_text = True
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    return parser


@lru_cache(maxsize=4096)
def local(name: str) -> str:
    """Return an element's or attribute's name without its namespace or prefix."""
    return name.rpartition("}")[2].rpartition(":")[2]


@contextmanager
def understood(complaint: Callable[[], str]) -> Iterator[None]:
    """Turn what unforeseen content raises into one complaint."""
    try:
        yield
    except InputError:
        raise
    except (KeyError, ValueError, IndexError, OverflowError, RecursionError) as error:
        raise InputError(complaint()) from error


@contextmanager
def uncollected() -> Iterator[None]:
    """Hold the search for circles of dead objects off, where a million live ones are made.

    It looks at all of them again and again, and finds none: a tenth of the time of a change.
    """
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was:
            gc.enable()


@contextmanager
def _unpacking(path: Path, name: str) -> Iterator[None]:
    """Turn what unpacking a missing or damaged part raises into an InputError."""
    try:
        yield
    except KeyError:
        raise InputError(f"{path}: is not a workbook, the part {name} is missing.") from None
    except UNPACKING as error:
        raise InputError(remark("book.not_unpacked", of=path, part=name)) from error
