"""The smallest workbook around the XML of one sheet, for sheets that no program would write."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path

from photocore.workbook.reading.xmltext import escaped


def parts(path: Path) -> dict[str, bytes]:
    """Return the parts of a package."""
    with zipfile.ZipFile(path) as package:
        return {name: package.read(name) for name in package.namelist()}


def with_parts(path: Path, more: dict[str, bytes], target: Path | None = None) -> Path:
    """Write a package with parts replaced or added as they are, sound or not."""
    whole = parts(path) | more
    with zipfile.ZipFile(target or path, "w") as package:
        for name, data in whole.items():
            package.writestr(name, data)
    return target or path


def relations(*items: tuple[str, str]) -> str:
    """Return a relations part of kinds and targets."""
    inside = "".join(
        f'<Relationship Id="r{i}" Type="urn/{kind}" Target="{target}"/>'
        for i, (kind, target) in enumerate(items)
    )
    return f"<Relationships>{inside}</Relationships>"


def write(path: Path, text: str, *, strings: Sequence[str] = ()) -> Path:
    """Write a workbook of one sheet S, shared strings, and formats, the third one a date."""
    items = "".join(f"<si><t>{escaped(own)}</t></si>" for own in strings)
    parts = {
        "[Content_Types].xml": "<Types/>",
        "_rels/.rels": relations(("officeDocument", "xl/workbook.xml")),
        "xl/workbook.xml": '<workbook><sheets><sheet name="S" id="r0"/></sheets></workbook>',
        "xl/_rels/workbook.xml.rels": relations(
            ("worksheet", "s.xml"), ("sharedStrings", "sharedStrings.xml"), ("styles", "styles.xml")
        ),
        "xl/s.xml": text,
        "xl/sharedStrings.xml": f"<sst>{items}</sst>",
        "xl/styles.xml": '<a><cellXfs><xf/><xf/><xf numFmtId="14"/></cellXfs></a>',
    }
    with zipfile.ZipFile(path, "w") as package:
        for name, data in parts.items():
            package.writestr(name, data)
    return path
