"""Named points of a DXF drawing: a POINT with its name as the nearest TEXT, or TEXT alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from photocore.errors import InputError
from photocore.remarks import remark
from photocore.textfile import check_file

#: A text further from a point than this share of the drawing is not its name.
_NEAR = 0.05

NamedPlace = tuple[str, tuple[float, ...]]


def model_space(path: Path) -> Any:
    """Return the model space of a drawing.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    import ezdxf

    check_file(path, folder=", expected a drawing.")
    try:
        return ezdxf.readfile(path).modelspace()
    except (ezdxf.DXFError, OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: is no DXF drawing that can be read ({error}).") from error


def drawing_unit(model: Any) -> str:
    """Return the unit a drawing says it is in; empty where that is metres, or none."""
    from ezdxf.units import unit_name

    code = model.doc.units
    return "" if code in (0, 6) else unit_name(code).lower()


def named_points(model: Any, path: Path) -> list[NamedPlace]:
    """Return name and X, Y, Z of each point.

    Raises
    ------
    InputError
        If a point has no name beside it.
    """
    texts = [
        (entity.plain_text() if entity.dxftype() == "MTEXT" else entity.dxf.text, _insert(entity))
        for entity in model.query("TEXT MTEXT")
    ]
    texts = [(text.strip(), place) for text, place in texts if text.strip()]
    points = [tuple(entity.dxf.location) for entity in model.query("POINT")]
    return _named(path, points, texts) if points else texts


def _insert(entity: Any) -> tuple[float, ...]:
    """Return the place of a text: its alignment point where it has one."""
    dxf = entity.dxf
    moved = entity.dxftype() == "TEXT" and (dxf.halign or dxf.valign)
    place = dxf.align_point if moved and dxf.hasattr("align_point") else dxf.insert
    return tuple(map(float, place))


def _named(
    path: Path, points: Sequence[tuple[float, ...]], texts: Sequence[NamedPlace]
) -> list[NamedPlace]:
    """Return each point with the nearest text, nearest couples first, each text once."""
    if len(texts) < len(points):
        raise InputError(
            remark("table.texts_beside", of=path, points=len(points), texts=len(texts))
        )
    size = max(np.ptp(np.array(points)[:, :2], axis=0).max(), 1e-9)
    couples = sorted(
        (math.dist(point[:2], place[:2]), i, j)
        for i, point in enumerate(points)
        for j, (_, place) in enumerate(texts)
    )
    names: dict[int, int] = {}
    used: set[int] = set()
    for distance, i, j in couples:
        if i not in names and j not in used:
            if len(points) > 1 and distance > _NEAR * size:
                x, y = points[i][:2]
                raise InputError(f"{path}: the point at {x:g}, {y:g} has no name beside it.")
            names[i] = j
            used.add(j)
    return [(texts[names[i]][0], point) for i, point in enumerate(points)]
