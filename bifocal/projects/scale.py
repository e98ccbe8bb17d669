"""What makes the lengths of another program's project metres, and how well they are known."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bifocal.model import CAMERA
from bifocal.orientation import COLUMNS, in_plane_frame, metres_of
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import Similarity, fit_similarity, project, skew
from photocore.errors import CellError, InputError, WorkbookError
from photocore.names import meant
from photocore.programs import ForeignView
from photocore.provenance import note_remark
from photocore.tables import read_table

#: Control points that miss by more than this share of their extent are not those that were picked.
MOST_MISS = 0.02


def by_control(
    points: dict[str, FloatArray], path: Path, sigma: float, views: Sequence[ForeignView] = ()
) -> tuple[Similarity, FloatArray, str]:
    """Return the frame of control points, its covariance (`of_cameras`), and how well it fits.

    Parameters
    ----------
    points : dict
        Named points in the project's frame.
    path : path
        Table of the same: id, X, Y, r [m], sigma; r blank: on the wall. Or id, E, N, H.
    sigma : float
        Standard deviation of a coordinate, where the table has none. [m]
    views : sequence of ForeignView
        Photos that tell the front of an upright wall in E, N, H.

    Raises
    ------
    InputError, GeometryError
        If fewer than three points are in both, or they do not fit.
    """
    keys = ("id", "X", "Y", "r", "H", "sigma")
    table = read_table(path, [one for one in COLUMNS if one.key in keys])
    errors: list[CellError] = []
    whole = np.column_stack([metres_of(table, key, "") for key in ("X", "Y", "r", "H", "sigma")])
    rows = table.once("id", whole, errors)
    if errors:
        raise WorkbookError(errors)
    xyz, heights, stated = whole[rows, :3], whole[rows, 3], whole[rows, 4]
    blank = np.full(3, np.nan)
    ids = meant([table.texts("id")[row] for row in rows], points)
    places = np.array([points.get(name, blank) for name in ids]).reshape(-1, 3)
    picks = [project(view.camera, places) for view in views]
    xyz, _, notes = in_plane_frame(table, xyz, heights, picks, None)
    for text in notes:
        note_remark(f"{path.name}: {text}")
    xyz[np.isnan(xyz[:, 2]), 2] = 0.0
    rows = [row for row, name in enumerate(ids)
            if name in points and np.isfinite(xyz[row]).all()]  # fmt: skip
    if len(rows) < 3:
        raise InputError(remark("projects.few_control_points", of=path, count=len(rows)))
    names = [ids[row] for row in rows]
    target, stated = xyz[rows], stated[rows]
    frame = fit_similarity([points[name] for name in names], target)
    missed = np.array([frame(points[name]) for name in names]) - target
    miss, extent = np.linalg.norm(missed, axis=1), float(np.ptp(target, axis=0).max())
    if miss.max() > MOST_MISS * extent:
        raise InputError(
            f"{path}: control point {names[int(miss.argmax())]} misses by {miss.max():.3g} m after "
            "the best fit of all; look for an exchanged name or a wrong coordinate or pick."
        )
    free = 3 * len(rows) - 7
    spread = max(
        float(np.nanmean(np.where(np.isnan(stated), sigma, stated))),
        float(np.sqrt((missed**2).sum() / free)),
    )
    design = np.concatenate([_rates(place) for place in target])
    covariance = spread**2 * np.linalg.inv(design.T @ design)
    about = {"count": len(rows), "rms": 1000 * float(np.sqrt((miss**2).mean()))}
    return frame, covariance, remark("projects.control", worst=1000 * miss.max(), **about)


def _rates(place: FloatArray) -> FloatArray:
    """Return how a place moves with shift, turn and scale of its frame, shape (3, 7)."""
    return np.column_stack([np.eye(3), -skew(place), place])


def of_cameras(centres: Sequence[FloatArray], covariance: FloatArray) -> FloatArray:
    """Return what the covariance of a frame makes of all cameras in it, as `names_of` counts them.

    Parameters
    ----------
    centres : sequence of ndarray, shape (3,)
        Projection centres in the frame. [m]
    covariance : ndarray, shape (7, 7)
        Of shift [m], turn [rad] and scale.
    """
    rates = np.zeros((len(centres), len(CAMERA), 7))
    turn, place = CAMERA.index("turn X"), CAMERA.index("X")
    # A camera's turn counts from the frame into it: against the turn of what stands in the frame.
    rates[:, turn : turn + 3, 3:6] = -np.eye(3)
    for row, centre in zip(rates, centres, strict=True):
        row[place : place + 3] = _rates(centre)
    whole = rates.reshape(-1, 7)
    return np.asarray(whole @ covariance @ whole.T)
