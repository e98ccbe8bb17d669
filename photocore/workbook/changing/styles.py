"""Cell formats added to a workbook that exists: its own stay as they are, with their numbers."""

from __future__ import annotations

import re
from collections.abc import Callable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from photocore.workbook.reading.package import local

#: The parts of a style sheet in the order that the schema fixes.
_ORDER = (
    *("numFmts", "fonts", "fills", "borders", "cellStyleXfs", "cellXfs", "cellStyles", "dxfs"),
    *("tableStyles", "colors", "extLst"),
)
_FIRST_CUSTOM = 164


class StyleSheet:
    """A style sheet that grows.

    Parameters
    ----------
    data : bytes
        The part, of a checked package.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        root = ElementTree.fromstring(data)
        self.namespace = root.tag.rpartition("}")[0].lstrip("{")
        self.sections = {local(section.tag): list(section) for section in root}
        self.added: dict[str, list[Element]] = {}
        self.formats = {
            str(entry.get("formatCode")): int(entry.get("numFmtId", "0"))
            for entry in self.sections.get("numFmts", ())
        }

    def append(self, section: str, element: Element) -> int:
        """Add an element to a section; return its number."""
        added = self.added.setdefault(section, [])
        number = len(self.sections.get(section, ())) + len(added)
        added.append(element)
        return number

    def number_format(self, code: str) -> int:
        """Return the number of a number format, made where it is missing."""
        if code == "General":
            return 0
        if code not in self.formats:
            number = max([_FIRST_CUSTOM - 1, *self.formats.values()]) + 1
            self.append("numFmts", Element("numFmt", numFmtId=str(number), formatCode=code))
            self.formats[code] = number
        return self.formats[code]

    def like(self, style: str, code: str) -> str:
        """Return the style that looks like another one but shows numbers by another format."""
        formats = [*self.sections.get("cellXfs", ()), *self.added.get("cellXfs", ())]
        index = int(style or 0)
        entry = _copied(formats[index]) if index < len(formats) else Element("xf")
        entry.set("numFmtId", str(self.number_format(code)))
        entry.set("applyNumberFormat", "1")
        return str(self.append("cellXfs", entry))

    def take_in(self, source: StyleSheet) -> tuple[Callable[[int], int], int]:
        """Add all formats of another style sheet.

        Returns
        -------
        renumbered : callable
            The number here of a cell format of the other one.
        conditional : int
            What the numbers of its conditional formats (dxf) grow by.
        """
        moved = {
            section: [self.append(section, _copied(e)) for e in source.sections.get(section, ())]
            for section in ("fonts", "fills", "borders")
        }
        codes = {number: code for code, number in source.formats.items()}
        styles = []
        for entry in source.sections.get("cellXfs", ()):
            copy = _copied(entry)
            for key, section in (("fontId", "fonts"), ("fillId", "fills"), ("borderId", "borders")):
                copy.set(key, str(moved[section][int(entry.get(key, "0"))]))
            number = int(entry.get("numFmtId", "0"))
            if number in codes:
                copy.set("numFmtId", str(self.number_format(codes[number])))
            copy.set("xfId", "0")
            styles.append(self.append("cellXfs", copy))
        first = len(self.sections.get("dxfs", ())) + len(self.added.get("dxfs", ()))
        for entry in source.sections.get("dxfs", ()):
            self.append("dxfs", _copied(entry))
        return styles.__getitem__, first

    def written(self) -> bytes:
        """Return the part with all that was added; every other byte as it was."""
        data = self.data
        for section, elements in self.added.items():
            text = "".join(self._text(element) for element in elements).encode()
            total = len(self.sections.get(section, ())) + len(elements)
            data = _inserted(data, section, text, total)
        return data

    def _text(self, element: Element) -> str:
        """Return an element as text that needs no prefix."""
        plain = _copied(element)
        for child in plain.iter():
            child.tag = local(child.tag)
        plain.set("xmlns", self.namespace)
        return ElementTree.tostring(plain, encoding="unicode")


def _copied(element: Element) -> Element:
    copy = Element(element.tag, dict(element.attrib))
    copy.text, copy.tail = element.text, None
    copy.extend(_copied(child) for child in element)
    return copy


def _inserted(data: bytes, section: str, text: bytes, total: int) -> bytes:
    """Return a style sheet with elements put at the end of a section."""
    name = section.encode()
    opening = re.search(rb"<(?P<prefix>\w+:)?" + name + rb"\b[^>]*?(?P<closed>/)?>", data)
    if opening is None:
        root = re.search(rb"<(?P<prefix>\w+:)?styleSheet\b[^>]*>", data)
        later = "|".join(_ORDER[_ORDER.index(section) + 1 :]).encode()
        place = re.search(rb"<(?:\w+:)?(?:" + later + rb")\b|</(?:\w+:)?styleSheet\s*>", data)
        prefix = (root and root["prefix"]) or b""
        start = place.start() if place else len(data)
        element = b'<%s%s count="%d">%s</%s%s>' % (prefix, name, total, text, prefix, name)
        return data[:start] + element + data[start:]
    prefix = opening["prefix"] or b""
    tag = re.sub(rb"""(\scount\s*=\s*["'])\d+""", rb"\g<1>%d" % total, opening[0])
    if opening["closed"]:
        tag = tag[:-2].rstrip() + b">"
        element = tag + text + b"</%s%s>" % (prefix, name)
        return data[: opening.start()] + element + data[opening.end() :]
    end = data.index(b"</%s%s" % (prefix, name), opening.end())
    return data[: opening.start()] + tag + data[opening.end() : end] + text + data[end:]
