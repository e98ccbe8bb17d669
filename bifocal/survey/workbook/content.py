"""What goes into a survey workbook, and the numbers its formula cells show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from bifocal.model.pair import SIGMA_PIXEL, UNCERTAIN_SHARE, Pair
from bifocal.survey.observations import PointObservations
from bifocal.survey.reference import CheckResult, Georeference, KnownPoints
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import OFF_RADIAL_SIGMAS, ON_PLANE_SIGMAS, SurveySetup
from bifocal.survey.tolerances import RULES, SCALES, ToleranceRule
from photocore.arrays import FloatArray
from photocore.workbook.cells import CellValue

#: Rows of the tables of an empty template.
POINT_ROWS, CHECK_ROWS, CONTROL_ROWS, SPARE_ROWS = 300, 25, 12, 10
#: Beyond this many points formulas are written as A1 references, which are shorter.
STRUCTURED_ROWS = 2000
#: The charts show the first points only.
CHART_ROWS = 1000


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
        For points measured in raw pixels.
    pair_file : str
        Its file, as seen from the workbook.
    sigma_px : float or None
        Measuring precision of raw pixels. [px]
    points, table : PointObservations, ReliefTable or None
        What was measured and what came out.
    known, check : KnownPoints, CheckResult or None
        Check points and their errors.
    control, georeference : KnownPoints, Georeference or None
        Control points and the transformation.
    model : str
        The model asked for: ``auto``, ``levelled``, ``3D``, ``2D``.
    rules : tuple of ToleranceRule
        For the verdict.
    sensor : tuple of float or None
        Width and height. [mm]
    flag_sigmas : tuple of float
        Limits of OFF-RADIAL and ON-PLANE. [sigma]
    sigma_r_max : float or None
        Limit of UNCERTAIN for a general pair; default 2 % of d2. [m]
    log : sequence of tuple of str
        Rows of the sheet `Log`: date, program, what, file, SHA-256.
    rows : int
        Rows of `Points` in an empty template.
    """

    language: str = "en"
    setup: SurveySetup | None = None
    pair: Pair | None = None
    pair_file: str = ""
    sigma_px: float | None = None
    points: PointObservations | None = None
    table: ReliefTable | None = None
    known: KnownPoints = field(default_factory=KnownPoints)
    check: CheckResult | None = None
    control: KnownPoints = field(default_factory=KnownPoints)
    georeference: Georeference | None = None
    model: str = "auto"
    rules: tuple[ToleranceRule, ...] = RULES
    sensor: tuple[float, float] | None = None
    flag_sigmas: tuple[float, float] = (OFF_RADIAL_SIGMAS, ON_PLANE_SIGMAS)
    sigma_r_max: float | None = None
    log: Sequence[tuple[str, str, str, str, str]] = ()
    rows: int = POINT_ROWS

    @property
    def is_pair(self) -> bool:
        """Whether the points are raw pixels of a general pair."""
        return self.pair is not None

    @property
    def undistorted(self) -> bool:
        """Whether raw pixels are freed of lens distortion beside the raw ones."""
        return self.pair is not None and any(
            photo.lens is not None for photo in (self.pair.image1, self.pair.image2)
        )

    @property
    def distances(self) -> tuple[float, float] | None:
        """d1 and d2. [m]"""
        if self.pair is not None:
            return self.pair.image1.distance, self.pair.image2.distance
        return None if self.setup is None else (self.setup.d1, self.setup.d2)

    @property
    def point_rows(self) -> int:
        """Rows of `Points`: an empty form, or the points and a few spare rows."""
        return self.rows if self.points is None else len(self.points) + SPARE_ROWS

    @property
    def check_rows(self) -> int:
        """Rows of `Check`."""
        return max(CHECK_ROWS, len(self.known) + SPARE_ROWS)

    @property
    def control_rows(self) -> int:
        """Rows of `Georeference`."""
        return max(CONTROL_ROWS, len(self.control) + 3)


def name_cell(name: str) -> CellValue:
    """Return a point's name as a cell: plain whole numbers as numbers, all else as text.

    Examples
    --------
    >>> name_cell("7"), name_cell("007"), name_cell("=1+1")
    (7, '007', '=1+1')
    """
    return int(name) if name.isdecimal() and len(name) < 10 and str(int(name)) == name else name


def numbers(values: FloatArray, blank: Sequence[bool] | None = None) -> list[CellValue]:
    """Return cell values; blank where asked for, #N/A where NaN otherwise."""
    listed: list[CellValue] = values.tolist()
    if blank is None:
        return listed
    return [None if empty else value for value, empty in zip(listed, blank, strict=True)]


def inputs(values: FloatArray) -> list[CellValue]:
    """Return typed numbers; blank where NaN."""
    return [None if value != value else value for value in values.tolist()]


def point_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return every column of `Points` by key."""
    points, table = content.points, content.table
    if points is None:
        return {}
    cells: dict[str, list[CellValue]] = {
        "id": [name_cell(name) for name in points.ids],
        "use": [int(value) for value in points.use],
        "code": list(points.code),
        "note": list(points.note),
    }
    groups = (
        (("x1", "y1"), points.xy1),
        (("x2", "y2"), points.xy2),
        (("s1", "s2", "theta"), points.polar),
        (("col1", "row1"), points.pixels1),
        (("col2", "row2"), points.pixels2),
    )
    for keys, array in groups:
        cells |= {key: inputs(array[:, i]) for i, key in enumerate(keys)}
    if content.undistorted and content.pair is not None:
        both = (
            (content.pair.image1, points.pixels1, "1"),
            (content.pair.image2, points.pixels2, "2"),
        )
        for photo, raw, image in both:
            ideal = raw if photo.lens is None else photo.lens.undistort(raw)
            cells |= {f"ucol{image}": inputs(ideal[:, 0]), f"urow{image}": inputs(ideal[:, 1])}
    if table is None:
        return cells
    incomplete = np.isnan(table["s1_used"]).tolist()
    for key, values in table.columns.items():
        cells[key] = numbers(values, incomplete)
    if table.carried:
        for key, values in table.carried.items():
            cells[key] = inputs(values)
        cells["q"] = inputs(table["q"])
    else:
        cells["q"] = inputs(table["q"])
        no_direction = np.isnan(table["theta_used"])
        cells["theta_used"] = inputs(table["theta_used"])
        lost = no_direction | np.isnan(table["s1_used"]) | (table.image_scale is None)
        cells |= {key: numbers(table[key], lost.tolist()) for key in ("X", "Y")}
    typed = points.has_pixels | points.is_cartesian | ~np.isnan(points.polar[:, :2]).all(axis=1)
    cells["flag"] = [
        flag if given else None for flag, given in zip(table.flags, typed, strict=True)
    ]
    return cells


def result_cells(
    content: SurveyContent, cells: Mapping[str, list[CellValue]]
) -> dict[str, list[CellValue]]:
    """Return every column of `Results` by key."""
    if content.table is None:
        return {}
    xyz = content.table.xyz
    world = np.full_like(xyz, np.nan)
    if content.georeference is not None:
        world = content.georeference.world_from_wall(xyz)
    return {
        "id": cells["id"],
        **{key: inputs(content.table[key]) for key in ("X", "Y", "Z", "sigma_r")},
        **{key: inputs(world[:, i]) for i, key in enumerate("ENH")},
        "flag": cells["flag"],
        "note": cells["note"],
    }


def check_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return every column of `Check` by key."""
    known, check = content.known, content.check
    cells: dict[str, list[CellValue]] = {
        "id": [name_cell(name) for name in known.ids],
        "use": [int(value) for value in known.used],
    }
    for i, axis in enumerate("XYZ"):
        cells[f"{axis}_ref"] = inputs(known.xyz[:, i])
        if check is not None:
            cells[axis] = inputs(check.found[:, i])
            cells[f"d{axis}"] = inputs(check.errors[:, i])
    return cells


def control_cells(content: SurveyContent) -> dict[str, list[CellValue]]:
    """Return every column of `Georeference` by key."""
    control, geo = content.control, content.georeference
    cells: dict[str, list[CellValue]] = {
        "id": [name_cell(name) for name in control.ids],
        "use": [int(value) for value in control.used],
    }
    cells |= {axis: inputs(control.xyz[:, i]) for i, axis in enumerate("ENH")}
    if geo is None:
        return cells
    cells["found_bad"] = [0 if name in geo.bad else None for name in geo.ids]
    used = geo.used
    source = np.where(used[:, None], geo.found - geo.world_from_wall.source_centre, 0.0)
    target = np.where(used[:, None], control.xyz - geo.origin, 0.0)
    if geo.model == "2D":
        target[:, 2] = 0.0
    turned = (geo.found - geo.world_from_wall.source_centre) @ geo.world_from_wall.rotation.T
    residuals = control.xyz - geo.origin - (geo.offset + geo.world_from_wall.scale * turned)
    for i, (axis, world) in enumerate(zip("XYZ", "ENH", strict=True)):
        cells[axis] = inputs(geo.found[:, i])
        cells[f"c{axis}"] = inputs(source[:, i])
        cells[f"c{world}"] = inputs(target[:, i])
        cells[f"v{world}"] = inputs(residuals[:, i])
    cells["w"] = [int(value) for value in used]
    return cells


def setup_cells(content: SurveyContent) -> dict[str, CellValue]:
    """Return the value of every named cell of `Setup`; what is absent is blank."""
    setup, pair = content.setup, content.pair
    off, near = content.flag_sigmas
    cells: dict[str, CellValue] = {"input_unit": "mm", "k_off": off, "k_plane": near}
    ratio = 1.0
    if setup is not None:
        cells |= {
            "c_1": setup.c1,
            "c_2": setup.c2,
            "pitch": setup.pitch,
            "input_unit": setup.unit,
            "sigma_s": setup.precision,
            "sigma_r_max": setup.relief_limit,
            "m_1": setup.scale_number,
        }
        for image, nadir in ((1, setup.nadir1), (2, setup.nadir2)):
            cells |= {f"nadir_{image}_col": nadir[0], f"nadir_{image}_row": nadir[1]}
        if setup.c2 is not None:
            cells["m_2"] = 1000.0 * setup.d2 / setup.c2
        ratio = setup.scale_ratio
    if pair is not None:
        cells |= _pair_cells(content, pair)
    pixels = cells["input_unit"] == "px" and setup is not None
    pitch = setup.pitch if setup is not None and setup.pitch is not None else 0.0
    cells |= {"unit_x": pitch if pixels else 1, "unit_y": -pitch if pixels else 1, "k_12": ratio}
    for image in (1, 2):
        for axis, part in (("x", "col"), ("y", "row")):
            value = cells.get(f"nadir_{image}_{part}")
            cells[f"off_{axis}{image}"] = (value or 0) if pixels else 0
    if content.distances is not None:
        d1, d2 = content.distances
        cells |= {"d_1": d1, "d_2": d2, "b_lever": d1 * d2 / (d1 - d2)}
    return cells


def _pair_cells(content: SurveyContent, pair: Pair) -> dict[str, CellValue]:
    """Return the cells of `Setup` that only a general pair has."""
    far, near = pair.image1, pair.image2
    scale = content.table.image_scale if content.table is not None else None
    own = far.extra.get("principal_distance")
    if scale is None and own:
        scale = 1000.0 * far.distance / float(own)
    sigma = content.sigma_px or far.sigma_pixel or near.sigma_pixel or SIGMA_PIXEL
    centre = pair.zoom_centre.tolist()
    cells: dict[str, CellValue] = {
        "pair_file": content.pair_file,
        "input_unit": "px",
        "c_1": None if scale is None else 1000.0 * far.distance / scale,
        "c_2": near.extra.get("principal_distance"),
        "pitch": far.extra.get("pixel_size"),
        "sigma_px": sigma,
        "sigma_r_max": content.sigma_r_max or UNCERTAIN_SHARE * near.distance,
        "m_1": 1000.0 if scale is None else scale,
        "e_x": centre[0],
        "e_y": centre[1],
    }
    spacing = []
    for image, photo in ((1, far), (2, near)):
        cells |= {f"n{image}_{axis}": float(photo.nadir[i]) for i, axis in enumerate("xy")}
        for i in range(3):
            for j in range(3):
                cells[f"h{image}_{i + 1}{j + 1}"] = float(photo.plane_from_pixel[i, j])
        if content.points is not None and len(content.points):
            pixels = content.points.pixels1 if image == 1 else content.points.pixels2
            jacobian = photo.metres_per_pixel(pixels[~np.isnan(pixels).any(axis=1)])
            if len(jacobian):
                spacing.append(float(np.median(np.sqrt((jacobian**2).sum(axis=(1, 2)) / 2))))
    # What one pixel is on the wall, typically, in millimetres of the image scale.
    typical = sum(spacing) / len(spacing) if spacing else 0.0
    cells["pixel_mm"] = typical * 1000.0 / float(cells["m_1"] or 1000.0)
    cells["sigma_s"] = sigma * float(cells["pixel_mm"] or 0.0)
    return cells


def verdict_rows(content: SurveyContent) -> list[tuple[ToleranceRule, int, float]]:
    """Return rule, scale and tolerance [m] of every row of the verdict."""
    return [
        (rule, scale, limit)
        for rule in content.rules
        for scale in SCALES
        if (limit := rule.tolerance(scale)) is not None
    ]
