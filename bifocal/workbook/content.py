"""What goes into a survey workbook: all that is no formula."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bifocal.model import FlagLimits, Pair, Photo
from bifocal.survey import (
    RULES,
    Georeference,
    KnownPoints,
    PointObservations,
    ReliefTable,
    SolvedSurvey,
    SurveyMedia,
    SurveySetup,
    TapedDistance,
    ToleranceRule,
    WorldPoints,
)
from bifocal.survey.image_shift import image_shift
from bifocal.workbook.formulas.columns import (
    adjustment_names,
    ideal_points,
    other_numbers,
    pair_points,
)
from bifocal.workbook.formulas.setup_cells import MATRICES, NADIRS, PHOTOS, other_cells
from photocore.arrays import BoolArray, FloatArray
from photocore.workbook import CellValue, LiveColumn, name_cell

#: Rows of the tables of an empty template.
POINT_ROWS, CHECK_ROWS, CONTROL_ROWS, SPARE_ROWS = 300, 25, 12, 10
#: Rows of an empty form that are printed: one page of `Results`.
FORM_ROWS = 28
#: Beyond this many points formulas are written as A1 references, which are shorter.
STRUCTURED_ROWS = 2000
#: The charts show the first points only.
CHART_ROWS = 1000
#: Arrows of errors at check points that are ready to be drawn: a chart gets none by itself.
ARROWS = 100


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurveyContent:
    """A survey as the workbook holds it.

    Attributes
    ----------
    language : str
        ``en``, ``it`` or ``de``.
    setup : SurveySetup or None
        Of an ideal pair; None in an empty template and for a general pair.
    pair : Pair or None
        The geometry; None in an empty template.
    as_given : bool
        Whether points and set-up stand in the order in which an exchanged pair was given.
    pair_file : str
        Its file, as seen from the workbook.
    photo_files : tuple of str
        Both photos as seen from the workbook, for a general pair without a file.
    sigma_px : float or None
        Measuring precision of raw pixels. [px]
    points, table : PointObservations, ReliefTable or None
        What was measured and what came out.
    known : KnownPoints
        Check points.
    tape : TapedDistance or None
        A distance taped on site.
    control, georeference : KnownPoints, Georeference or None
        Control points and the transformation.
    model : str
        The model asked for: ``auto``, ``levelled``, ``3D``, ``2D``.
    rules : tuple of ToleranceRule
        For the verdict.
    sensor : tuple of float or None
        Width and height. [mm]
    limits : FlagLimits
        Where the flags begin.
    links : mapping
        Values of `Setup` that stand elsewhere in the workbook: name to the cell, as formulas
        write it.
    log : sequence of tuple of str
        Rows of the sheet `Log`: date, program, what, file, SHA-256.
    rows : int
        Rows of `Points` in an empty template.
    functions : bool
        Whether the workbook has functions with names.
    plain : bool
        Whether a new workbook's formulas are plain: A1 references, no tables or cells by name.
    media : SurveyMedia or None
        Cells of media in an empty template, and of a general pair; None for those that follow from
        the pair. An ideal pair's stand in its set-up.
    lens : bool
        Whether an empty template has cells for the distortion of each lens.
    other_photos : int
        How many photos an empty template has columns for beside those of the pair.
    changes : mapping of str to float, or None
        What is added to values of the set-up on the sheet `WhatIf`; None where there is none.
    """

    language: str = "en"
    setup: SurveySetup | None = None
    pair: Pair | None = None
    as_given: bool = False
    pair_file: str = ""
    photo_files: tuple[str, str] = ("", "")
    sigma_px: float | None = None
    points: PointObservations | None = None
    table: ReliefTable | None = None
    known: KnownPoints = field(default_factory=KnownPoints)
    tape: TapedDistance | None = None
    control: KnownPoints = field(default_factory=KnownPoints)
    georeference: Georeference | None = None
    model: str = "auto"
    rules: tuple[ToleranceRule, ...] = RULES
    sensor: tuple[float, float] | None = None
    limits: FlagLimits = field(default_factory=FlagLimits)
    links: Mapping[str, str] = field(default_factory=dict)
    log: Sequence[tuple[str, str, str, str, str]] = ()
    rows: int = POINT_ROWS
    functions: bool = False
    plain: bool = False
    media: SurveyMedia | None = None
    lens: bool = False
    other_photos: int = 0
    changes: Mapping[str, float] | None = None

    @classmethod
    def of(cls, solved: SolvedSurvey) -> SurveyContent:
        """Return what the workbook shows of a solved survey."""
        survey, setup = solved.survey, solved.survey.setup
        # The sheet's formulas place a wall by control points of the sheet alone.
        placed = solved.georeference if survey.control.used.any() else None
        return cls(
            language=survey.language, setup=solved.setup, pair=solved.pair,
            sigma_px=solved.sigma_px, points=solved.points, table=solved.table,
            known=survey.known, control=survey.control, tape=survey.tape,
            georeference=placed, model=survey.model, rules=solved.rules,
            sensor=setup.sensor, limits=setup.measuring.limits, media=solved.media,
        )  # fmt: skip

    @property
    def bent(self) -> SurveyMedia | None:
        """What the cells of media hold; None in a workbook that has none."""
        if self.setup is not None:
            return self.setup.media
        if self.media is not None or self.pair is None:
            return self.media
        return SurveyMedia.of_photos(self.photos)

    @property
    def media_cells(self) -> int:
        """How many media there are cells for; 0 in air."""
        return 0 if self.bent is None else self.bent.media

    @property
    def leaning(self) -> bool:
        """Whether there are cells for ports that lean."""
        return self.bent is not None and self.bent.normals is not None

    @property
    def has_lens(self) -> bool:
        """Whether there are cells for the distortion of each lens."""
        return self.lens if self.setup is None else self.setup.lenses is not None

    @property
    def others(self) -> int:
        """How many photos there are columns for beside those of the pair."""
        return self.other_photos if self.setup is None else len(self.setup.others)

    @property
    def is_pair(self) -> bool:
        """Whether the points are raw pixels of a general pair."""
        return self.pair is not None and self.setup is None

    @property
    def photos(self) -> tuple[Photo, ...]:
        """Both photos in the order of the workbook; none in an empty template."""
        if self.pair is None:
            return ()
        return self.pair.as_given if self.as_given else (self.pair.image1, self.pair.image2)

    @property
    def undistorted(self) -> bool:
        """Whether raw pixels are freed of lens distortion beside the raw ones."""
        return any(photo.lens is not None for photo in self.photos)

    @property
    def corrected(self) -> list[int]:
        """Images whose coordinates are corrected by cells of `Setup`."""
        matrices = self.setup.adjusted if self.setup is not None else ()
        return [image for image, matrix in enumerate(matrices, 1) if matrix is not None]

    def point_columns(self, **facts: bool) -> tuple[LiveColumn, ...]:
        """Return the columns of `Points`; of an ideal pair those of the inputs that are there."""
        if self.is_pair:
            return pair_points(
                undistorted=self.undistorted, media=self.media_cells, leaning=self.leaning
            )
        return ideal_points(
            **facts, adjusted=self.corrected, media=self.media_cells, lens=self.has_lens,
            others=self.others,
        )  # fmt: skip

    @property
    def placed(self) -> WorldPoints:
        """The points in the world."""
        assert self.table is not None
        return WorldPoints(self.table, self.georeference)

    @property
    def point_rows(self) -> int:
        """Rows of `Points`: an empty form, or the points and a few spare rows."""
        return self.rows if self.points is None else len(self.points) + SPARE_ROWS

    @property
    def check_rows(self) -> int:
        """Rows of `Check`: those of one page, or the points and a few spare rows."""
        points = len(self.known)
        return CHECK_ROWS if points < CHECK_ROWS else points + SPARE_ROWS

    @property
    def arrows(self) -> int:
        """How many errors at check points are drawn as arrows."""
        return max(ARROWS, self.check_rows)

    @property
    def control_rows(self) -> int:
        """Rows of `Georeference`."""
        return max(CONTROL_ROWS, len(self.control) + 3)


def printed_rows(content: SurveyContent) -> int:
    """Return how many points are printed: all there are, or one page of an empty form."""
    if content.points is None:
        return min(FORM_ROWS, content.point_rows)
    return max(len(content.points), 1)


def inputs(values: FloatArray) -> list[CellValue]:
    """Return typed numbers; blank where NaN."""
    return [None if value != value else value for value in values.tolist()]


def named_rows(names: Sequence[str], used: BoolArray) -> dict[str, list[CellValue]]:
    """Return the columns that every table of points begins with."""
    return {"id": [name_cell(name) for name in names], "use": [int(value) for value in used]}


def point_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return the columns of `Points` that are no formulas, by key."""
    points, table = content.points, content.table
    if points is None:
        return {}
    cells = named_rows(points.ids, points.use)
    cells |= {"code": list(points.code), "note": list(points.note)}
    groups = [
        (("x1", "y1"), points.xy1),
        (("x2", "y2"), points.xy2),
        (("s1", "s2", "theta"), points.polar),
        (("col1", "row1"), points.pixels1),
        (("col2", "row2"), points.pixels2),
    ]
    groups += [
        ((f"x{k}", f"y{k}"), points.other_xy[:, i])
        for i, k in enumerate(other_numbers(points.other_xy.shape[1]))
    ]
    if content.undistorted:
        for image, photo, raw in zip(
            "12", content.photos, (points.pixels1, points.pixels2), strict=True
        ):
            ideal = raw if photo.lens is None else photo.lens.undistort(raw)
            groups.append(((f"ucol{image}", f"urow{image}"), ideal))
    for keys, array in groups:
        cells |= {key: inputs(array[:, i]) for i, key in enumerate(keys)}
    if table is None or not content.is_pair:
        return cells
    cells |= {key: inputs(values) for key, values in table.of_pixels.items()}
    common = content.placed.common
    cells |= {f"o_{axis}": inputs(np.sqrt(common[:, i, i])) for i, axis in enumerate("ENH")}
    cells["o_EN"] = inputs(common[:, 0, 1])
    if content.undistorted:  # no formula distorts pixels
        shift = image_shift(content.photos[0], None, points, table)
        directed = ~np.isnan(table["s1_used"]) & ~np.isnan(table["theta_used"])
        cells |= {key: inputs(np.where(directed, v, np.nan)) for key, v in shift.items()}
    return cells


def setup_cells(content: SurveyContent) -> dict[str, CellValue]:
    """Return what is typed into named cells of `Setup`; what is absent is blank."""
    limits, setup = content.limits, content.setup
    cells: dict[str, CellValue] = {
        "input_unit": "mm", "k_off": limits.off_radial, "k_plane": limits.on_plane,
        "enlargement_1": 1, "enlargement_2": 1,
        **{f"enlargement_{k}": 1 for k in other_numbers(content.others)},
        **({} if content.bent is None else content.bent.cells),
    }  # fmt: skip
    if content.pair is None:
        return cells
    for image, photo in enumerate(content.photos, start=1):
        cells |= {f"d_{image}": photo.distance, f"c_{image}": photo.principal_distance}
    first, second = content.photos
    cells["sigma_r_max"] = limits.relief_limit(content.pair.d2)
    if setup is None:
        return cells | _pair_cells(content, first, second)
    for k, third in enumerate(setup.others, start=3):
        typed = (third.c, third.d, third.enlargement or 1, *(third.nadir or (None, None)))
        cells |= dict(zip(other_cells(k), typed, strict=True))
    cells |= {"photo_1": setup.photo1 or None, "photo_2": setup.photo2 or None}
    enlargement1, enlargement2 = setup.taking.enlargements
    cells |= {"c_1": setup.taking.c1, "enlargement_1": enlargement1}
    cells |= {"c_2": setup.taking.c2, "enlargement_2": enlargement2}
    cells |= setup.title_block
    cells |= {"pitch": setup.taking.pitch, "input_unit": setup.unit, "sigma_s": setup.precision}
    for image, lens in enumerate(setup.lenses or (), start=1):
        cells |= {f"lens_{image}_{name}": getattr(lens, name) for name in ("k1", "k2", "x", "y")}
    for image, matrix in enumerate(setup.adjusted, start=1):
        if matrix is not None:
            cells |= dict(zip(adjustment_names(image), matrix.ravel().tolist(), strict=True))
    for image, nadir in ((1, setup.taking.nadir1), (2, setup.taking.nadir2)):
        column, row = nadir or (0.0, 0.0)
        cells |= {f"nadir_{image}_col": column, f"nadir_{image}_row": row}
    return cells


def _pair_cells(content: SurveyContent, first: Photo, second: Photo) -> dict[str, CellValue]:
    """Return the cells of `Setup` that only a general pair has."""
    cells: dict[str, CellValue] = {
        "pair_file": content.pair_file,
        **{key: name or None for key, name in zip(PHOTOS, content.photo_files, strict=True)},
        "input_unit": "px",
        "pitch": first.pixel_size,
        "sigma_px": first.precision(content.sigma_px or first.sigma_pixel or second.sigma_pixel),
    }
    spacing = []
    for image, photo in enumerate((first, second)):
        cells |= dict(zip(NADIRS[image], photo.nadir.tolist(), strict=True))
        cells |= dict(zip(MATRICES[image], photo.plane_from_pixel.ravel().tolist(), strict=True))
        if content.points is not None and len(content.points):
            pixels = content.points.pixels2 if image else content.points.pixels1
            jacobian = photo.metres_per_pixel(pixels[~np.isnan(pixels).any(axis=1)])
            if len(jacobian):
                spacing.append(float(np.median(np.sqrt((jacobian**2).sum(axis=(1, 2)) / 2))))
    # What one pixel is on the wall, typically: whatever image scale is typed later.
    return cells | {"pixel_wall": 1000.0 * sum(spacing) / len(spacing) if spacing else 0.0}


def check_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return the columns of `Check` that are typed, by key."""
    reference = content.known
    cells = named_rows(reference.ids, reference.used)
    return cells | {f"{axis}_ref": inputs(reference.xyz[:, i]) for i, axis in enumerate("XYZ")}


def control_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return the columns of `Georeference` that are no formulas, by key."""
    control, geo = content.control, content.georeference
    cells = named_rows(control.ids, control.used)
    cells |= {axis: inputs(control.xyz[:, i]) for i, axis in enumerate("ENH")}
    if geo is not None:
        cells["found_bad"] = [0 if name in geo.bad else None for name in geo.ids]
    return cells
