"""What is to be solved: measured points, the set-up they were measured with, what is known."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bifocal.survey.observations import PointObservations
from bifocal.survey.reference import KnownPoints
from bifocal.survey.setup import SurveySetup
from bifocal.survey.taped import TapedDistance
from photocore.tables import Table
from photocore.workbook import SheetFile


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurveyInput:
    """What a survey file holds, checked cell by cell.

    Attributes
    ----------
    points : PointObservations
        Measured points.
    setup : SurveySetup
        The cells of `Setup` that were found.
    unit : str
        Unit of x1..y2 that the headings say; empty where they say none.
    known, control : KnownPoints
        Check points and control points.
    tape : TapedDistance or None
        A distance between two points that was taped on site.
    model : str
        Georeference model asked for.
    language : str
        Of the workbook; ``en`` for other files.
    is_ours : bool
        Whether it is a survey workbook with live formulas.
    table : Table
        The table of points, with the way back to its cells.
    book : SheetFile or None
        The workbook as read; None for a text table.
    titles : tuple of str
        The sheets of the file; empty for a text table.
    known_rows, control_rows : tuple of int
        Rows of the sheets `Check` and `Georeference`; check points given beside the points follow
        after these.
    remarks : tuple of str
        What the user should know.
    """

    points: PointObservations
    setup: SurveySetup
    unit: str = ""
    known: KnownPoints
    control: KnownPoints = field(default_factory=KnownPoints)
    tape: TapedDistance | None = None
    model: str = "auto"
    language: str = "en"
    is_ours: bool = False
    table: Table
    book: SheetFile | None = None
    titles: tuple[str, ...] = ()
    known_rows: tuple[int, ...] = ()
    control_rows: tuple[int, ...] = ()
    remarks: tuple[str, ...] = ()

    @classmethod
    def of_points(cls, points: PointObservations) -> SurveyInput:
        """Return a survey that holds nothing but measured points."""
        table = Table(file="points", sheet="", values={}, present=frozenset(), rows=[], columns={})
        return cls(
            points=points,
            setup=SurveySetup(where="points"),
            known=with_measured(KnownPoints(), points),
            table=table,
        )

    @property
    def where(self) -> str:
        """File and sheet of the points, for messages."""
        return where_of(self.table)


def where_of(table: Table) -> str:
    """Return file and sheet of a table, for messages."""
    return f"{table.file} › {table.sheet}" if table.sheet else table.file


def with_measured(reference: KnownPoints, points: PointObservations) -> KnownPoints:
    """Add relief measured on site, given beside the points, to the check points."""
    rows = [
        i
        for i in np.flatnonzero(~np.isnan(points.r_measured) & points.use)
        if points.ids[i] not in reference.ids
    ]
    if not rows:
        return reference
    nothing = np.full(len(rows), np.nan)
    more = np.stack([nothing, nothing, points.r_measured[rows]], axis=-1)
    return KnownPoints(
        ids=(*reference.ids, *(points.ids[i] for i in rows)),
        xyz=np.vstack([reference.xyz, more]),
        use=np.concatenate([reference.used, np.ones(len(rows), dtype=bool)]),
    )
