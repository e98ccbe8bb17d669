"""The points and lines of a survey as a drawing in space."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from bifocal.collimation.live_results import LiveResults
from bifocal.collimation.records import SurveyState
from bifocal.collimation.shapes import OUTLINES, places_of
from bifocal.files import export_points
from bifocal.model import Pair, PointLine, Points
from bifocal.remarks import remark
from photocore.errors import InputError


def drawn_points(
    state: SurveyState, results: LiveResults | None, pair: Pair | None = None
) -> tuple[Points, tuple[PointLine, ...]]:
    """Return the solved points and the lines of a survey.

    Raises
    ------
    InputError
        If no point is picked in both photos yet.
    """
    lines = tuple(
        PointLine(line.name, line.layer, line.points, line.closed) for line in state.lines.values()
    )
    if pair is not None:
        lines += tuple(
            PointLine(
                shape.name, shape.layer or OUTLINES, (), closed=True,
                places=tuple(map(tuple, places_of(pair, shape.corners).tolist())),
            )
            for shape in state.shapes.values()
            if shape.kind == "outline"
        )  # fmt: skip
    points = [point for point in state.sorted_points() if point.use]
    rows = [] if results is None else [(point, results.row(point)) for point in points]
    solved = [(point, row) for point, row in rows if row is not None]
    if not solved:
        raise InputError(remark("page.nothing_to_draw"))
    nan = float("nan")

    def number(value: float | None) -> float:
        return nan if value is None else value

    return Points(
        ids=tuple(point.name for point, _ in solved),
        xyz=np.array([[number(row[key]) for key in ("X", "Y", "r")] for _, row in solved]),
        sigma_r=np.array([number(row["sigma_r"]) for _, row in solved]),
        flags=tuple(row["flag"] for _, row in solved),
        notes=tuple(point.note for point, _ in solved),
    ), lines


def write_points_drawing(state: SurveyState, results: LiveResults | None, path: Path) -> None:
    """Write the drawing over what may stand there."""
    points, lines = drawn_points(state, results, None if results is None else results.pair)
    export_points(path, points, lines=lines, overwrite=True)


def points_drawing(state: SurveyState, results: LiveResults | None) -> bytes:
    """Return the drawing as the content of a DXF file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "points.dxf"
        write_points_drawing(state, results, path)
        return path.read_bytes()
