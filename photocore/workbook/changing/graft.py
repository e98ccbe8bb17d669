"""Sheets and names added to a workbook that exists, from a package made for them."""

from __future__ import annotations

import io
import posixpath
import re
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from photocore.errors import InputError
from photocore.workbook.changing.styles import StyleSheet
from photocore.workbook.reading.grid import plain_title, quoted_title
from photocore.workbook.reading.package import Parts
from photocore.workbook.reading.xlsx import SheetPart, Workbook, read_directory
from photocore.workbook.reading.xmltext import escaped, quoted

_TYPES = "[Content_Types].xml"
_RELATIONS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006/relationships"
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
#: Strict workbooks have other names for the same things.
_STRICT = {
    _MAIN: "http://purl.oclc.org/ooxml/spreadsheetml/main",
    _RELATIONS: "http://purl.oclc.org/ooxml/officeDocument/relationships",
    "http://schemas.openxmlformats.org/drawingml/2006/": "http://purl.oclc.org/ooxml/drawingml/",
}


@dataclass(slots=True)
class Graft:
    """Takes sheets from one package into another.

    Parameters
    ----------
    path : Path
        The workbook that grows.
    package : zipfile.ZipFile
        It, open.
    book : Workbook
        Its directory.
    parts : dict
        Parts of it that change or are new, with their content; takes the further ones.
    styles : StyleSheet
        Its cell formats; takes those of the sheets.
    """

    path: Path
    package: zipfile.ZipFile
    book: Workbook
    parts: Parts
    styles: StyleSheet
    _names: set[str] = field(init=False)

    def __post_init__(self) -> None:
        self._names = {*self.package.namelist(), *self.parts}

    def add_sheets(
        self, content: Mapping[str, bytes], titles: Mapping[str, str], *, local: bool = False
    ) -> None:
        """Add sheets with their tables, charts and formats, and the names that lead to them.

        Parameters
        ----------
        content : mapping
            The parts of the package that holds them, as `making.newbook` makes it.
        titles : mapping
            Which, and their titles here. Formulas find other sheets by names and tables.
        local : bool
            Whether a name that leads elsewhere already is defined anew for the sheet alone.
        """
        source = _directory(self.path, content)
        renumbered, conditional = self.styles.take_in(StyleSheet(content["xl/styles.xml"]))
        count = len(re.findall(rb"<(?:\w+:)?sheet\s", self._book()))
        places: dict[str, int] = {}
        for sheet in source.sheets:
            if sheet.title in titles:
                data = _restyled(content[sheet.part], renumbered, conditional)
                part = self._add_part(sheet.part, {**content, sheet.part: data})
                self._add_sheet(titles[sheet.title], part)
                self._local_names(content[source.part], source, sheet, count, titles[sheet.title])
                places[sheet.title] = count
                count += 1
        for name, reference in source.names.items():
            written, _, place = reference.rpartition("!")
            title = plain_title(written)
            if title in titles:
                own = plain_title(self.book.names.get(name, "").rpartition("!")[0])
                # Where another sheet has the title by now, the name led to what was ours there.
                lost = own == title != titles[title]
                home = places[title] if local else None
                self.define(name, f"{quoted_title(titles[title])}!{place}", anew=lost, home=home)

    def define(
        self, name: str, reference: str, *, anew: bool = False, home: int | None = None
    ) -> None:
        """Define a name; one that leads anywhere already stays, unless it is defined anew.

        ``home`` is the number of the sheet for which it then counts alone.
        """
        data = self._book()
        pattern = re.compile(
            rb"<(?:\w+:)?definedName\s(?![^>]*localSheetId)[^>]*\bname=[\"']%s[\"'][^>]*>([^<]*)</"
            % re.escape(name.encode()),
            re.IGNORECASE,
        )
        match = pattern.search(data)
        if match is None:
            self._add_name(f" name={quoted(name)}", reference)
        elif anew or b"#REF!" in match[1]:
            start, end = match.span(1)
            self._put(self.book.part, data[:start] + escaped(reference).encode() + data[end:])
        elif home is not None:
            self._add_name(f' name={quoted(name)} localSheetId="{home}"', reference)

    def _local_names(
        self, data: bytes, source: Workbook, sheet: SheetPart, index: int, title: str
    ) -> None:
        """Take over the names that belong to a sheet: rows printed on every page, print areas."""
        place = [own.title for own in source.sheets].index(sheet.title)
        for match in re.finditer(rb"<definedName\s([^>]*)>([^<]*)</", data):
            attributes = match[1].decode()
            old, new = f'localSheetId="{place}"', f'localSheetId="{index}"'
            if old in attributes:
                attributes = attributes.replace(old, new)
                before, after = (f"{escaped(quoted_title(name))}!" for name in (sheet.title, title))
                reference = match[2].decode().replace(before, after)
                self._add_name(f" {attributes.strip()}", reference, raw=True)

    def _add_name(self, attributes: str, reference: str, *, raw: bool = False) -> None:
        data = self._book()
        prefix = _prefix_of(data)
        text = reference if raw else escaped(reference)
        entry = f"<{prefix}definedName{attributes}>{text}</{prefix}definedName>".encode()
        if re.search(rb"</(?:\w+:)?definedNames\s*>", data):
            self._append(self.book.part, "definedNames", entry.decode())
            return
        names = f"<{prefix}definedNames>".encode() + entry + f"</{prefix}definedNames>".encode()
        empty = re.search(rb"<(?:\w+:)?definedNames\s*/>", data)
        if empty:
            self._put(self.book.part, data[: empty.start()] + names + data[empty.end() :])
            return
        before = re.search(rb"</(?:\w+:)?externalReferences\s*>", data) or re.search(
            rb"</(?:\w+:)?functionGroups\s*>|<(?:\w+:)?functionGroups\b[^>]*/>", data
        )
        before = before or re.search(rb"</(?:\w+:)?sheets\s*>", data)
        assert before is not None
        self._put(self.book.part, data[: before.end()] + names + data[before.end() :])

    def _add_sheet(self, title: str, part: str) -> None:
        """Name a sheet in the workbook, after all others."""
        key = self._relate(self.book.part, part, "worksheet")
        numbers = [int(n) for n in re.findall(rb"\ssheetId\s*=\s*[\"'](\d+)", self._book())]
        about = f'name={quoted(title)} sheetId="{max(numbers) + 1}" r:id="{key}"'
        self._append(self.book.part, "sheets", f'<:sheet xmlns:r="{_RELATIONS}" {about}/>')

    def _add_part(self, name: str, content: Mapping[str, bytes]) -> str:
        """Add a part and all it refers to; return its new name."""
        folder, file = posixpath.split(name)
        stem, ending = posixpath.splitext(file)
        stem = stem.rstrip("0123456789")
        numbers = (f"{folder}/{stem}{number}{ending}" for number in range(1, 10**6))
        new = next(place for place in numbers if place not in self._names)
        data = content[name]
        if "/tables/" in new:
            data = re.sub(rb'(<table\b[^>]*?\sid=")\d+', rb"\g<1>%d" % self._table_number(), data)
        self._put(new, self._strict(data))
        about = f'PartName="/{new}" ContentType="{_type_of(content[_TYPES], name)}"'
        self._append(_TYPES, "Types", f"<:Override {about}/>")
        relations = f"{folder}/_rels/{file}.rels"
        if relations in content:
            for relation in ElementTree.fromstring(content[relations]):
                target = posixpath.normpath(posixpath.join("/", folder, relation.get("Target", "")))
                kind = relation.get("Type", "").rpartition("/")[2]
                added = self._add_part(target.lstrip("/"), content)
                self._relate(new, added, kind, relation.get("Id", ""))
        return new

    def _table_number(self) -> int:
        tables = [name for name in self._names if "/tables/" in name]
        pattern = re.compile(rb"<(?:\w+:)?table\b[^>]*?\sid\s*=\s*[\"'](\d+)")
        matches = [pattern.search(self._now(name)) for name in tables if name.endswith(".xml")]
        return max([0, *(int(match[1]) for match in matches if match)]) + 1

    def _relate(self, part: str, target: str, kind: str, key: str = "") -> str:
        """Relate two parts; return the relation's id."""
        folder, file = posixpath.split(part)
        name = f"{folder}/_rels/{file}.rels"
        if name not in self._names:
            self._put(name, f'<Relationships xmlns="{_PACKAGE}"></Relationships>'.encode())
        if not key:
            ids = {m.decode() for m in re.findall(rb"\sId\s*=\s*[\"']([^\"']*)", self._now(name))}
            key = next(f"rId{n}" for n in range(1, 10**6) if f"rId{n}" not in ids)
        about = f'Id="{key}" Type="{_RELATIONS}/{kind}" Target="/{target}"'
        self._append(name, "Relationships", f"<:Relationship {about}/>")
        return key

    def _append(self, part: str, parent: str, element: str) -> None:
        """Put an element at the end of another one; a colon before its name stands for the prefix.

        Raises
        ------
        InputError
            If the part has no such end.
        """
        data = self._now(part)
        place = re.search(rb"</(\w+:)?%s\s*>" % parent.encode(), data)
        if place is None:
            raise InputError(f"{self.path}: damaged, the part {part} cannot be understood.")
        prefixed = element.replace("<:", f"<{(place[1] or b'').decode()}", 1)
        content = self._strict(prefixed.encode())
        self._put(part, data[: place.start()] + content + data[place.start() :])

    def _strict(self, data: bytes) -> bytes:
        """Return a part in the words of a strict workbook if this is one."""
        if _STRICT[_MAIN].encode() in self._book()[:2000]:
            for ordinary, strict in _STRICT.items():
                data = data.replace(ordinary.encode(), strict.encode())
        return data

    def _book(self) -> bytes:
        return self._now(self.book.part)

    def _now(self, name: str) -> bytes:
        return self.parts.now(self.path, self.package, name)

    def _put(self, name: str, data: bytes) -> None:
        self.parts[name] = data
        self._names.add(name)


def _directory(path: Path, content: Mapping[str, bytes]) -> Workbook:
    """Return the directory of a package given by its parts."""
    with zipfile.ZipFile(io.BytesIO(), "w") as package:
        for name, data in content.items():
            package.writestr(name, data)
        return read_directory(path, package)


def _restyled(data: bytes, renumbered: Callable[[int], int], conditional: int) -> bytes:
    """Return a sheet whose formats have other numbers."""

    def number(match: re.Match[bytes]) -> bytes:
        return match[1] + str(renumbered(int(match[2]))).encode()

    data = re.sub(rb'(<(?:c|row)\s[^>]*?\bs=")(\d+)', number, data)
    data = re.sub(rb'(<col\s[^>]*?\bstyle=")(\d+)', number, data)

    def moved(match: re.Match[bytes]) -> bytes:
        return match[1] + str(int(match[2]) + conditional).encode()

    data = re.sub(rb'(\sdxfId=")(\d+)', moved, data)
    return data.replace(b' tabSelected="1"', b"")


def _type_of(types: bytes, part: str) -> str:
    match = re.search(rb'<Override\s[^>]*PartName="/%s"[^>]*>' % re.escape(part.encode()), types)
    kind = re.search(rb'ContentType="([^"]*)"', match[0]) if match else None
    assert kind is not None, part
    return kind[1].decode()


def _prefix_of(data: bytes) -> str:
    root = re.search(rb"<(\w+:)?workbook\s", data)
    return ((root[1] or b"") if root else b"").decode()
