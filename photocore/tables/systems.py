"""The unit of the coordinate system that a list of points names; degrees are refused."""

from __future__ import annotations

import re
from contextlib import suppress

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.tables.numbers import FEET, METRES

_DEGREES = re.compile(r"longlat|latlong|epsg:+4326|crs84|^\s*GEOG|^\s*WGS84\s*$", re.IGNORECASE)
#: The usual systems in metres, for which no library is loaded.
_METRIC = re.compile(
    r"WGS84 UTM|.*epsg:+(32[67]|258)\d\d\b|\s*\+proj=utm(?!.*\+(units|to_meter)=(?!m\b))",
    re.IGNORECASE,
)
#: A unit of length in the text of a system.
_UNIT = re.compile(r'UNIT\["(?!deg)([^"]*)",\s*([\d.eE+-]+)', re.IGNORECASE)
#: The name of a system that is in feet ends with its foot.
_IN_NAME = re.compile(r"\((ftUS|ft)\)\s*$")
_EPSG = re.compile(r"urn:ogc:def:crs:EPSG::\d+|epsg:+\d+", re.IGNORECASE)
#: Two units of length are one below this; feet and US survey feet are 2e-6 apart.
_SAME = 2e-7


def unit_of_system(text: str, label: str) -> str:
    """Return the unit of a coordinate system, empty where it is metres, or nobody says.

    Parameters
    ----------
    text : str
        As EPSG code, PROJ string or WKT.
    label : str
        The list's name, for messages.

    Raises
    ------
    InputError
        If it is in degrees, or in a unit that nothing here reads.

    Examples
    --------
    >>> unit_of_system("EPSG:3436", ""), unit_of_system("EPSG:25832", "")
    ('ftUS', '')
    """
    if not text.strip() or _METRIC.match(text):
        return ""
    name, metres = _linear_unit(text, label)
    unit = next((unit for unit in METRES if abs(METRES[unit] / metres - 1) < _SAME), None)
    if unit is None:
        raise InputError(remark("table.system_unit", of=label, unit=name))
    return "" if unit == "m" else unit


def _linear_unit(text: str, label: str) -> tuple[str, float]:
    import rasterio
    from rasterio.errors import CRSError

    code = _EPSG.search(text)
    with rasterio.Env():
        try:
            system = rasterio.CRS.from_user_input(code[0] if code and "[" not in text else text)
            if not system.is_geographic:
                name, metres = system.linear_units_factor
                return str(name), float(metres)
            is_place = True
        except (CRSError, ValueError):
            is_place = _DEGREES.search(text) is not None
    if is_place:
        raise InputError(remark("table.in_degrees", of=label))
    if in_name := _IN_NAME.search(text):
        return in_name[1], FEET[in_name[1]]
    for name, metres in _UNIT.findall(text):
        with suppress(ValueError):
            return name, float(metres) or 1.0
    return "m", 1.0
