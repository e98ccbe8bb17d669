"""Point lists of instruments and programs, rewritten as tables with headings.

A text comes in, and a text comes out: what is no such list is returned as it is. Each row keeps the
number of its line where the list has a line a row.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from typing import Any
from xml.etree import ElementTree

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.tables.axes import NAMES
from photocore.tables.heading_words import bare
from photocore.tables.systems import unit_of_system

#: A word of a Leica instrument: what, about it, sign, data of 8 or 16 signs.
_GSI_WORD = re.compile(r"(\d\d)([\d.]{4})([+-])(\w{16}|\w{8})(?=\s|$)")
_GSI_LINE = re.compile(rf"\s*\*?(?:{_GSI_WORD.pattern}\s*)+")
#: Unit by the sixth sign of a word: its name, and how many make one.
_GSI_UNITS = {"0": ("m", 1e3), "1": ("ft", 1e3), "6": ("m", 1e4), "7": ("ft", 1e4), "8": ("m", 1e5)}
_GSI_AXES = ("81", "82", "83")
#: First line of the ground control points of OpenDroneMap.
_CRS = re.compile(r"\s*(\+proj|epsg:\d+|wgs84\b|\w*(?:proj|geog|local_)c(?:r)?s\[)", re.IGNORECASE)
#: The comment in which Metashape and others name the system, the column in which Emlid does, and
#: headings of its coordinates.
_SYSTEM = re.compile(r"#\s*(?:CoordinateSystem|CRS)\s*:\s*(.+)", re.IGNORECASE)
_IN_COLUMN = "CS name"
_ITS_AXIS = re.compile(
    r"(?<![\w/])([XYZ](?:/\w+)?|Easting|Northing|Elevation)(?=\s*(?:[,;\t]|$))", re.MULTILINE
)
#: Degrees that span less than this are a place and no wall.
_PLACE = 0.05


@dataclass(frozen=True, slots=True)
class ListRows:
    """A list as rows below headings, and what the user should know.

    Attributes
    ----------
    headings : tuple of str
    rows : list of sequences
        Each as long as the headings; an empty one keeps the number of a line.
    program : str
        What writes such lists.
    remarks : tuple of str
    """

    headings: tuple[str, ...]
    rows: list[Sequence[object]]
    program: str
    remarks: tuple[str, ...] = ()

    def as_text(self) -> str:
        """Return the table as text with tabs."""
        lines = StringIO()
        writer = csv.writer(lines, delimiter="\t", lineterminator="\n")
        writer.writerows([self.headings, *self.rows])
        return lines.getvalue()


def as_table(text: str, label: str) -> tuple[str, list[str]]:
    """Return a text table of what may be the list of an instrument or a program, and remarks.

    Parameters
    ----------
    text : str
        What the file holds.
    label : str
        Its name, for messages.

    Raises
    ------
    InputError
        If it is a list of points that no table can be made of, in degrees for example.
    """
    start = text.lstrip()[:2000]
    lists: tuple[tuple[bool, Callable[[str, str], ListRows | None]], ...] = (
        (_GSI_LINE.fullmatch(start.partition("\n")[0].rstrip()) is not None, _of_gsi),
        (_CRS.match(start) is not None, _of_opendronemap),
        ("mapX" in start, _of_qgis),
        (start.startswith("<"), _of_metashape),
        (start.startswith("{"), _of_geojson),
    )
    for fits, read in lists:
        table = read(text, label) if fits else None
        if table is not None:
            notes = remark("table.list_of", program=table.program)
            return table.as_text(), [notes, *table.remarks]
    return _in_its_unit(_with_commas_as_tabs(text), label), []


def _of_gsi(text: str, label: str) -> ListRows | None:
    """Return the coordinates of a Leica instrument's list, GSI-8 or GSI-16."""
    rows: list[Sequence[object]] = []
    units, without = set(), 0
    for line in filter(str.strip, text.splitlines()):
        if not _GSI_LINE.fullmatch(line.rstrip()):
            raise InputError(remark("table.gsi_line", of=label, line=line[:60]))
        words = {what: (about, sign, data) for what, about, sign, data in _GSI_WORD.findall(line)}
        name = words.get("11", ("", "", ""))[2].lstrip("0")
        places = []
        for axis in _GSI_AXES:
            about, sign, data = words.get(axis, ("", "", ""))
            unit, parts = _GSI_UNITS.get(about[-1:], ("", 1.0))
            value = f"{sign}{data}" if data.isdecimal() and unit else ""
            units |= {unit} if value else set()
            places.append(repr(int(value) / parts) if value else "")
        if any(places):
            rows.append((name, *places))
        without += not any(places)
    if not rows:
        raise InputError(remark("table.gsi_angles", of=label))
    if len(units) > 1:
        raise InputError(remark("table.gsi_units", of=label))
    unit = next(iter(units))
    notes = (remark("table.gsi_left_out", count=without),) if without else ()
    return ListRows(("id", *(f"{axis} [{unit}]" for axis in "ENH")), rows, "Leica (GSI)", notes)


def _of_opendronemap(text: str, label: str) -> ListRows | None:
    """Return OpenDroneMap's ground control points: a row a photo."""
    lines = text.lstrip("\ufeff").splitlines()
    system = next(line for line in lines if line.strip())
    rows: list[Sequence[object]] = []
    names: dict[tuple[str, ...], str] = {}
    for line in lines[lines.index(system) + 1 :]:
        fields = line.split("\t") if line.count("\t") >= 5 else line.split()
        fields = [field.strip() for field in fields]
        if not fields or fields[0].startswith(("#", "//")):
            rows.append(())
        elif len(fields) < 6 or not all(map(_is_number, fields[:5])):
            return None
        else:
            place = tuple(fields[:3])
            name = fields[6] if len(fields) > 6 else names.get(place, f"gcp {len(names) + 1}")
            names[place] = name
            height = "" if fields[2].lower() == "nan" else fields[2]
            rows.append((name, *fields[:2], height, fields[5], *fields[3:5]))
    axes = _headed("ENH", unit_of_system(system, label))
    return ListRows(("id", *axes, "photo", "col", "row"), rows, "OpenDroneMap")


def _of_qgis(text: str, label: str) -> ListRows | None:
    """Return points of the georeferencer of QGIS; it counts from the corner, rows down negative."""
    try:
        table = [*csv.reader(StringIO(text))]
    except csv.Error:
        return None
    head = next((k for k, fields in enumerate(table) if "mapX" in fields), None)
    if head is None:
        return None
    kind = "pixel" if "pixelX" in table[head] else "source"
    headings = ("mapX", "mapY", f"{kind}X", f"{kind}Y")
    if not {*headings} <= {*table[head]}:
        return None
    system = _SYSTEM.match(text)
    axes = _headed("XY", unit_of_system(system[1] if head and system else "", label))
    rows: list[Sequence[object]] = [()] * head
    for fields in table[head + 1 :]:
        held = dict(zip(table[head], fields, strict=False))
        numbers = [held.get(key, "").strip() for key in headings]
        if not all(map(_is_number, numbers)):
            rows.append(())
            continue
        column, row = float(numbers[2]) - 0.5, -float(numbers[3]) - 0.5
        if row < -1:
            raise InputError(remark("table.qgis_placed", of=label))
        rows.append((*numbers[:2], f"{column:.10g}", f"{row:.10g}", held.get("enable", "") or "1"))
    records: list[Sequence[object]] = [
        () if not row else (f"{k}", *row) for k, row in enumerate(rows, start=1 - head)
    ]
    return ListRows(("id", *axes, "col", "row", "use"), records, "QGIS")


def _of_metashape(text: str, label: str) -> ListRows | None:
    """Return Metashape's markers: where they lie, and a row for each photo that shows them."""
    if "<!DOCTYPE" in text[:5000] or "<!ENTITY" in text[:5000]:
        raise InputError(remark("table.no_markers", of=label))
    try:
        root = ElementTree.fromstring(text.lstrip("\ufeff \r\n\t"))
    except ElementTree.ParseError as error:
        raise InputError(f"{label}: is not valid XML ({error}).") from None
    chunks = [root] if root.tag == "chunk" else root.findall(".//chunk")
    chunks = [chunk for chunk in chunks if chunk.find(".//marker[@label]") is not None]
    if len(chunks) != 1:
        raise InputError(remark(f"table.{'many_chunks' if chunks else 'no_markers'}", of=label))
    chunk = chunks[0]
    photos = {n.get("id"): n.get("label", "") for n in chunk.findall("./cameras//camera")}
    places: dict[str, list[Sequence[str]]] = {}
    for node in chunk.findall(".//marker[@marker_id]"):
        for at in node.findall("location"):
            # Metashape counts from the corner of the first pixel.
            texts = [at.get(axis, "") for axis in "xy"]
            pixel = [f"{float(t) - 0.5:.10g}" if _is_number(t) else t for t in texts]
            photo = photos.get(at.get("camera_id"), "")
            places.setdefault(node.get("marker_id", ""), []).append((photo, *pixel))
    rows: list[Sequence[object]] = []
    for marker in chunk.findall(".//marker[@label]"):
        place = marker.find("reference")
        xyz = ["" if place is None else place.get(axis, "") for axis in "xyz"]
        off = place is not None and place.get("enabled", "true").lower() in ("false", "0")
        use = "0" if off else "1"
        first = (marker.get("label", ""), *xyz, use)
        shown = places.get(marker.get("id", ""), [("", "", "")])
        rows += [(*first, *one) for one in shown]
    system = chunk.findtext("./reference") or root.findtext("./reference") or ""
    has_places = any(any(row[1:3]) for row in rows)
    axes = _headed("ENH", unit_of_system(system if has_places else "", label))
    headings = ("id", *axes, "use", "photo", "col", "row")
    if not places:
        return ListRows(headings[:5], [row[:5] for row in rows], "Metashape")
    return ListRows(headings, rows, "Metashape")


def _of_geojson(text: str, label: str) -> ListRows | None:
    """Return the points of GeoJSON with their properties; WebODM's cameras in metres."""
    try:
        held = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{label}: is not valid JSON ({error}).") from None
    features = held.get("features") if isinstance(held, dict) else None
    if not isinstance(features, list):
        raise InputError(remark("table.no_points", of=label))
    kept: list[dict[str, object]] = []
    is_local = False
    for feature in features:
        geometry = feature.get("geometry") if isinstance(feature, dict) else None
        if not isinstance(geometry, dict) or geometry.get("type") != "Point":
            continue
        about = feature.get("properties")
        about = about if isinstance(about, dict) else {}
        is_local |= "translation" in about
        place: Any = about.get("translation") or geometry.get("coordinates")
        if not _are_numbers(place):
            raise InputError(remark("table.no_points", of=label))
        about = {k: v for k, v in about.items() if isinstance(v, str | float | int)}
        named = next((about[k] for k in about if bare(k) in _NAMES), None)
        name = feature.get("id", len(kept) + 1) if named is None else named
        axes = {} if {"X", "Y"} <= {*about} else dict(zip("XYZ", place, strict=False))
        rest = {k: v for k, v in about.items() if bare(k) not in _NAMES}
        kept.append({"id": name, **rest, **axes})
    if not kept:
        raise InputError(remark("table.no_points", of=label))
    unit = "" if is_local else _unit_of_points(held.get("crs"), label, kept)
    headings = tuple(dict.fromkeys(key for row in kept for key in row))
    rows: list[Sequence[object]] = [[row.get(key, "") for key in headings] for row in kept]
    axes = dict(zip("XYZ", _headed("XYZ", unit), strict=True))
    headings = tuple(axes.get(key, key) for key in headings)
    return ListRows(headings, rows, "WebODM" if is_local else "GeoJSON")


_NAMES = frozenset(map(bare, ("id", "filename", *NAMES)))


def drawing_as_table(points: Iterable[tuple[str, tuple[float, ...]]], label: str) -> str:
    """Return a text table of the named points of a drawing."""
    rows: list[Sequence[object]] = [(name, *map(repr, place)) for name, place in points]
    if not rows:
        raise InputError(remark("table.no_points", of=label))
    return ListRows(("id", "X", "Y", "Z"), rows, "DXF").as_text()


def _with_commas_as_tabs(text: str) -> str:
    """Return a text whose commented headings are divided as its rows are.

    Metashape writes ``# PhotoID, X, Y, Z`` above rows with tabs.
    """
    head = next(
        (
            line
            for line in text[:8000].splitlines()
            if line.startswith("#") and line.count(",") > 2 and not _SYSTEM.match(line)
        ),
        "",
    )
    after = text[text.find(head) + len(head) :].lstrip("\r\n").partition("\n")[0] if head else ""
    if "\t" in head or after.count("\t") < 2 or "," in after:
        return text
    return text.replace(head, re.sub(r"\s*,\s*", "\t", head), 1)


def _headed(axes: str, unit: str) -> tuple[str, ...]:
    """Return headings of coordinates in a unit; an empty one is metres."""
    return tuple(f"{axis} [{unit}]" if unit else axis for axis in axes)


def unit_of_comment(line: str, label: str) -> str:
    """Return the unit of the coordinate system that a comment names; empty for metres or none."""
    system = _SYSTEM.match(line)
    return unit_of_system(system[1], label) if system else ""


def _in_its_unit(text: str, label: str) -> str:
    """Return a text whose headings X/Easting and so on say the unit of the system it names."""
    system, (first, _, rest) = _SYSTEM.match(text), text.partition("\n")
    name, start, head = "", "", first
    if system:
        name, start, head = system[1], first + "\n", rest.partition("\n")[0]
    elif _IN_COLUMN in first:
        names, *rows = csv.reader([first, rest.partition("\n")[0]])
        name = dict(zip(names, *rows[:1], strict=False)).get(_IN_COLUMN, "") if rows else ""
    unit = unit_of_system(name, label) if _ITS_AXIS.search(head) else ""
    rest = text[len(start) + len(head) :]
    return start + _ITS_AXIS.sub(rf"\1 [{unit}]", head, count=3) + rest if unit else text


def _unit_of_points(system: object, label: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the unit of points of GeoJSON; refuse longitude and latitude, named or not.

    Raises
    ------
    InputError
        Naming what to export instead.
    """
    if system is None and all(_is_number(str(row.get(axis))) for row in rows for axis in "XY"):
        spans = [[float(row[axis]) for row in rows] for axis in "XY"]
        within = all(max(map(abs, s)) <= most for s, most in zip(spans, (180, 90), strict=True))
        if within and max(max(s) - min(s) for s in spans) < _PLACE:
            raise InputError(remark("table.in_degrees", of=label))
    about = system.get("properties") if isinstance(system, dict) else None
    name = about.get("name", "") if isinstance(about, dict) else system or ""
    return unit_of_system(str(name), label)


def _are_numbers(place: object) -> bool:
    return (
        isinstance(place, list)
        and len(place) >= 2
        and all(isinstance(v, int | float) and math.isfinite(v) for v in place)
    )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
