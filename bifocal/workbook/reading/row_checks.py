"""Rows of measured points that lack something, each complaint with its cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bifocal.remarks import remark
from bifocal.survey import PointObservations, pixel_keys
from photocore.errors import CellError
from photocore.tables import Table
from photocore.workbook import TEXT_KEYS

XY, POLAR = ("x1", "y1", "x2", "y2"), ("s1", "s2", "theta")
PIXELS = ("col1", "row1", "col2", "row2")


def check_rows(
    table: Table,
    points: PointObservations,
    faulty: set[tuple[str, str]],
    errors: list[CellError],
) -> None:
    """Complain about points without a name, measured on one photo only, or with s <= 0."""
    ids, used, polar = points.ids, points.use, points.polar
    # What is wrong with a whole column is said once, not of every point.
    failed = {key for _, key in faulty if key in table.values and key not in TEXT_KEYS}
    failed = {key for key in failed if np.isnan(table.numbers(key)).all()}
    for row in range(len(table)):
        if used[row] and not ids[row] and (table.cell(row, "id"), "id") not in faulty:
            errors.append(table.error(row, "id", "the point has no name; give it one."))
    xy, pixels = np.hstack([points.xy1, points.xy2]), np.hstack([points.pixels1, points.pixels2])
    if points.others.size:
        _check_photos(table, points, errors)
        return
    others = points.other_xy.transpose(1, 0, 2)
    groups = [
        (XY, xy), (PIXELS, pixels), (("s1", "s2"), polar[:, :2]),
        *(((f"x{k}", f"y{k}"), further) for k, further in enumerate(others, start=3)),
    ]  # fmt: skip
    for keys, values in groups:
        filled = ~np.isnan(values)
        partly = used & filled.any(axis=1) & ~filled.all(axis=1)
        if keys == ("s1", "s2"):
            # Image coordinates, where both photos have them, make the radial distances idle.
            partly &= np.isnan(xy).all(axis=1)
        for row in np.flatnonzero(partly).tolist():
            lacking = [key for i, key in enumerate(keys) if not filled[row, i]]
            if any(key in failed or (table.cell(row, key), key) in faulty for key in lacking):
                continue  # its own complaint stands already
            errors.append(table.error(row, lacking[0], _incomplete(ids[row], keys, lacking)))
    for i, key in enumerate(("s1", "s2")):
        for row in np.flatnonzero(used & (polar[:, i] <= 0)).tolist():
            message = remark("survey.radius_of_zero", size=polar[row, i], name=ids[row])
            errors.append(table.error(row, key, message))


def _check_photos(table: Table, points: PointObservations, errors: list[CellError]) -> None:
    """Complain about used points with half a pick, or picks in fewer than two photos of a set."""
    filled = ~np.isnan(np.stack(points.pixels, axis=1))
    for row in np.flatnonzero(points.use).tolist():
        halves = np.argwhere(filled[row].any(axis=1)[:, None] & ~filled[row])
        photos = filled[row].all(axis=1)
        if len(halves):
            photo, axis = halves[0].tolist()
            keys = pixel_keys(photo + 1)
            message = _incomplete(points.ids[row], keys, [keys[axis]])
            errors.append(table.error(row, keys[axis], message))
        elif photos.sum() < 2:
            key = pixel_keys(int(np.flatnonzero(~photos)[0]) + 1)[0]
            where = (
                f"only on image {int(np.flatnonzero(photos)[0]) + 1}" if photos.any() else "on none"
            )
            message = remark("survey.seen_once", name=points.ids[row], seen=where)
            errors.append(table.error(row, key, message))


def _incomplete(name: str, keys: Sequence[str], lacking: Sequence[str]) -> str:
    images = {key[-1] for key in lacking}
    here = {key[-1] for key in keys if key not in lacking}
    if len(images) == 1 and images.isdisjoint(here):
        partner = "2" if images == {"1"} else "1"
        return remark("survey.one_image", name=name, image=partner, other=images.pop())
    return f"point {name} lacks {', '.join(lacking)}; complete it, or set use = 0."
