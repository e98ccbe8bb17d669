"""The numbers that formula cells of check and control points show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement

import numpy as np

from bifocal.survey.georeferencing import residuals
from bifocal.survey.leave_one_out import leave_one_out
from bifocal.survey.other_photos import CHANCE
from bifocal.survey.reference import Georeference
from bifocal.survey.relief_table import entries
from bifocal.survey.weighted_similarity import weights_of
from bifocal.workbook.content import SurveyContent, inputs, named_rows
from bifocal.workbook.formulas.columns import compared
from photocore.workbook.changing.cells import CellValue, name_cell


def check_cells(
    content: SurveyContent, points: Mapping[str, Sequence[CellValue]]
) -> dict[str, list[CellValue]]:
    """Return every column of `Check` by key, from those of `Points`."""
    known, check, table = content.known, content.check, content.table
    cells = named_rows(known.ids, known.used)
    for i, axis in enumerate("XYZ"):
        cells[f"{axis}_ref"] = inputs(known.xyz[:, i])
        if check is not None:
            cells[axis] = inputs(check.solved[:, i])
            cells[f"d{axis}"] = inputs(check.errors[:, i])
            cells[f"t{axis}"] = inputs(check.standardised[:, i])
    if check is not None and table is not None:
        sizes = np.abs(np.nan_to_num(check.standardised)).max(axis=1)
        tested = ~np.isnan(check.standardised).all(axis=1)
        cells["sigmas"] = inputs(np.where(tested, sizes, np.nan))
        cells["out"] = [int(name in check.flagged) for name in known.ids]
        flags = [*points["flag"], None]
        cells["flag"] = [flags[row] for row in known.rows_in(table)]
    return cells


def compare_cells(
    content: SurveyContent, points: Mapping[str, Sequence[CellValue]]
) -> dict[str, list[CellValue]]:
    """Return every column of the table that holds pairs of photos beside each other."""
    known, check, table = content.known, content.check, content.table
    if check is None or table is None:
        return {}
    cells = {"id": [name_cell(name) for name in known.ids]}
    measured = np.where(np.isnan(check.errors[:, 2]), np.nan, known.xyz[:, 2])
    rows = known.rows_in(table)
    # Picks that contradict each other count in no pair.
    chance = np.append(table.columns.get("chance", np.full(len(table), np.nan)), np.nan)[rows]
    measured = np.where(chance < CHANCE, np.nan, measured)
    cells["Z_ref"] = inputs(measured)
    for r, sigma in compared(content.others):
        found, precision = (
            np.array([*(np.nan if v is None else v for v in points[key]), np.nan], float)[rows]
            for key in (r, sigma)
        )
        errors = found - measured
        cells |= {r: inputs(found), f"e_{r}": inputs(errors)}
        cells[sigma] = inputs(np.where(np.isnan(errors), np.nan, precision))
    return cells


def control_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return every column of `Georeference` by key."""
    control, geo = content.control, content.georeference
    cells = named_rows(control.ids, control.used)
    cells |= {axis: inputs(control.xyz[:, i]) for i, axis in enumerate("ENH")}
    if geo is None:
        return cells
    cells["found_bad"] = [0 if name in geo.bad else None for name in geo.ids]
    used, fit = geo.used, geo.world_from_wall
    centred = geo.solved - fit.source_centre
    left = residuals(fit, geo.solved, control.xyz - geo.origin, geo.offset)
    near = geo.near
    for i, (axis, world) in enumerate(zip("XYZ", "ENH", strict=True)):
        cells[axis] = inputs(geo.solved[:, i])
        cells[f"c{axis}"] = inputs(np.where(used, centred[:, i], 0.0))
        cells[f"c{world}"] = inputs(np.where(used, near[:, i], 0.0))
        cells[f"v{world}"] = inputs(left[:, i])
    cells["w"] = [int(value) for value in used]
    return cells | _weight_cells(geo) | _left_out_cells(geo)


def _left_out_cells(geo: Georeference) -> dict[str, list[CellValue]]:
    """Return what each control point costs the fit."""
    found = leave_one_out(geo)
    cells: dict[str, list[CellValue]] = {}
    cells |= {key: inputs(getattr(found, key)) for key in ("own", "gain")}
    cells |= {"v": inputs(found.size), "s0": inputs(found.sigma0)}
    for (i, a), (j, b) in combinations_with_replacement(enumerate("ENH"), 2):
        cells[f"d_{a}{b}"] = inputs(found.covariance[:, i, j])
    fits: list[CellValue] = [
        None if gain != gain else "CHECK" if row == found.worst else "OK"
        for row, gain in enumerate(found.gain)
    ]
    return cells | {"fit": fits}


def _weight_cells(geo: Georeference) -> dict[str, list[CellValue]]:
    """Return covariances of the control points, their weights, and weights times design."""
    if geo.covariance is None:
        return {}
    cells = {key: inputs(values) for key, values in entries(geo.covariance, "q_").items()}
    size, used = len(geo.ids), geo.used
    flat = geo.model == "2D"
    weights = np.zeros((size, 3, 3))
    weights[used] = weights_of(geo.covariance[used], flat=flat)
    centred = np.zeros((size, 3))
    centred[used] = geo.solved[used] - geo.world_from_wall.source_centre
    east, north, height = np.where(used[:, None], geo.near, 0.0).T
    zero, turned = np.zeros(size), 1.0 if flat else 0.0
    design = [(east, turned * north, -north), (north, -turned * east, east), (zero, height, zero)]
    cells |= {key: inputs(values) for key, values in entries(weights, "p_").items()}
    columns = {f"u_{{}}{name}": np.stack(d, axis=-1) for name, d in zip("pqm", design, strict=True)}
    for key, column in {**columns, "h_{}": centred}.items():
        weighted = np.einsum("nij,nj->ni", weights, column)
        cells |= {key.format(axis): inputs(weighted[:, i]) for i, axis in enumerate("XYZ")}
    return cells
