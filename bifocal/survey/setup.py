"""What the `Setup` sheet holds: two cameras in front of a wall, and how points were measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from bifocal.model import SCALE_TOLERANCE, SIGMA_PIXEL, FlagLimits, Lens, Pair, apply_homography
from bifocal.precision import false_relief_of_scale
from bifocal.remarks import remark
from bifocal.survey.observations import PointObservations
from bifocal.survey.refracted_radii import scale_ratio
from bifocal.survey.survey_lens import SurveyLens, freed_scale
from bifocal.survey.survey_media import SurveyMedia
from photocore.arrays import FloatArray, positive
from photocore.errors import GeometryError, InputError, located

#: Precision of an image coordinate where the pixel size is unknown. [mm]
SIGMA_RADIAL = 0.004
#: The same on a print, read by a ruler: what a line on a drawing is good to. [mm]
SIGMA_PRINT = 0.2
UNITS = ("mm", "px")
Place = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Taking:
    """How both photos were taken, by an ideal pair: distances, lenses, pixels, nadir points.

    Attributes
    ----------
    d1, d2 : float or None
        Distances of the projection centres to the reference plane, d1 > d2. [m]
    c1, c2 : float or None
        Principal distances; both or none. Without them there is relief but no X and Y. [mm]
    enlargement1, enlargement2 : float or None
        How many times larger the image is on the print that was measured; None or 1 = on the
        sensor.
    pitch : float or None
        Size of a pixel; needed when coordinates are in pixels. [mm/px]
    nadir1, nadir2 : tuple of float or None
        (column, row) of the nadir points; needed when coordinates are in pixels. [px]
    """

    d1: float | None = None
    d2: float | None = None
    c1: float | None = None
    c2: float | None = None
    enlargement1: float | None = None
    enlargement2: float | None = None
    pitch: float | None = None
    nadir1: Place | None = None
    nadir2: Place | None = None

    @property
    def enlargements(self) -> tuple[float, float]:
        """Those of both images, 1 for an image on the sensor."""
        return self.enlargement1 or 1.0, self.enlargement2 or 1.0

    @property
    def c_used(self) -> tuple[float | None, ...]:
        """Principal distances of the images as measured: those of prints are enlarged too. [mm]"""
        both = zip((self.c1, self.c2), self.enlargements, strict=True)
        return tuple(c and c * enlargement for c, enlargement in both)

    def exchanged(self) -> Taking:
        """Return the same with the images exchanged."""
        opposite = {"1": "2", "2": "1"}
        swapped: dict[str, Any] = {
            f"{name}{image}": getattr(self, f"{name}{opposite[image]}")
            for name in ("d", "c", "enlargement", "nadir")
            for image in "12"
        }
        return replace(self, **swapped)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measuring:
    """How points were measured: in which unit, how well, and which are flagged.

    Attributes
    ----------
    unit : {"mm", "px"} or None
        ``"mm"``: x, y from the nadir, y up. ``"px"``: (column, row) of the image. None: as
        headings or `Setup` say, else mm.
    sigma_s : float or None
        Precision of a measured image coordinate; default 0.5 px, or 0.004 mm; of prints 0.2 mm,
        there. [mm]
    sigma_px : float or None
        Precision of a raw pixel; default the pair's, else found from the misfits of 20 or more
        points, else 0.5. [px]
    sigma_r_max : float or None
        Points of less precise relief are UNCERTAIN; default 2 % of the shorter distance. [m]
    k_off, k_plane : float or None
        Beyond how many sigma a point is OFF-RADIAL, below how many ON-PLANE; default those of
        `bifocal.model.flags.FlagLimits`.
    """

    unit: str | None = None
    sigma_s: float | None = None
    sigma_px: float | None = None
    sigma_r_max: float | None = None
    k_off: float | None = None
    k_plane: float | None = None

    def __post_init__(self) -> None:
        if self.unit not in (None, *UNITS):
            raise InputError(f"input unit: {self.unit!r} is neither mm nor px.")

    @property
    def limits(self) -> FlagLimits:
        """Where the flags begin."""
        return FlagLimits(
            off_radial=self.k_off or FlagLimits().off_radial,
            on_plane=self.k_plane or FlagLimits().on_plane,
            sigma_r_max=self.sigma_r_max,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherPhoto:
    """How a photo beside an ideal pair was taken; its image coordinates are those of the pair.

    Attributes
    ----------
    d, c : float or None
        Distance to the reference plane [m] and principal distance [mm]; None while not typed.
    enlargement : float or None
        Of the print that was measured; None or 1 = on the sensor.
    nadir : tuple of float or None
        (column, row) of the nadir point, for coordinates in pixels. [px]
    """

    d: float | None = None
    c: float | None = None
    enlargement: float | None = None
    nadir: Place | None = None

    @property
    def scale(self) -> float:
        """Metres on the wall for a millimetre; NaN while a distance is not typed."""
        return (self.d or math.nan) / ((self.c or math.nan) * (self.enlargement or 1.0))


def given_of(value: Taking | Measuring | None) -> dict[str, Any]:
    """Return what is given of a value, by name."""
    named = {} if value is None else {f.name: getattr(value, f.name) for f in fields(value)}
    return {name: number for name, number in named.items() if number is not None}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SurveySetup:
    """Two cameras as the workbook's `Setup` sheet, or options in its place, describe them.

    Attributes
    ----------
    taking : Taking
        Distances, lenses, pixels, nadir points.
    measuring : Measuring
        Unit and precision of what was measured.
    media : SurveyMedia or None
        What the photos look through, where the workbook has cells for it.
    lenses : tuple of SurveyLens or None
        Distortion of both lenses, where the workbook has cells for it.
    others : tuple of OtherPhoto
        The third photo and more, where the workbook has columns for them.
    sensor : tuple of float or None
        Width and height. [mm]
    pair_file : str
        Pair file, as seen from the workbook.
    photo1, photo2 : str
        Photo files, as seen from the workbook; empty where none are named.
    title_block : mapping
        Project, client, surveyor and date as they head the printed results, by name of their cell.
    matrices, nadirs : tuple of ndarray
        Homographies (3, 3) to the wall, None for an ideal pair, and nadir points (2,) on it. [m]
    adjusted : tuple of ndarray or None
        Of each photo the homography (3, 3) that corrects its coordinates in millimetres, found
        from points of the reference plane; None where there is no correction.
    places : mapping
        Where each value was found: key to sheet and cell.
    where : str
        File and sheet, for messages.
    remarks, text_cells : tuple of str
        What the user should know; which numbers were typed as text.
    """

    taking: Taking = field(default_factory=Taking)
    measuring: Measuring = field(default_factory=Measuring)
    media: SurveyMedia | None = None
    lenses: tuple[SurveyLens, SurveyLens] | None = None
    others: tuple[OtherPhoto, ...] = ()
    sensor: Place | None = None
    pair_file: str = ""
    photo1: str = ""
    photo2: str = ""
    title_block: Mapping[str, str] = field(default_factory=dict)
    matrices: tuple[FloatArray, FloatArray] | None = None
    nadirs: tuple[FloatArray, FloatArray] = (np.zeros(2), np.zeros(2))
    adjusted: tuple[FloatArray | None, FloatArray | None] = (None, None)
    places: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    where: str = ""
    remarks: tuple[str, ...] = ()
    text_cells: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """Of the coordinates x1 y1 x2 y2."""
        return self.measuring.unit or "mm"

    @property
    def precision(self) -> float:
        """Precision of an image coordinate. [mm]"""
        if self.measuring.sigma_s is not None:
            return self.measuring.sigma_s
        if max(self.taking.enlargements) > 1.0:
            return SIGMA_PRINT
        pitch = self.taking.pitch
        return SIGMA_RADIAL if pitch is None else SIGMA_PIXEL * pitch

    def but(self, **values: Any) -> SurveySetup:
        """Return the set-up with other values of how photos were taken and points measured."""
        names = values.keys() & {f.name for f in fields(Taking)}
        taking = replace(self.taking, **{name: values.pop(name) for name in names})
        return replace(self, taking=taking, measuring=replace(self.measuring, **values))

    def pair(self) -> Pair:
        """Return the ideal pair, whose image coordinates are millimetres from the nadir, y up.

        Raises
        ------
        InputError, GeometryError
            If a value is missing, or values contradict each other, naming the file.
        """
        with located(self.where):
            return self._pair()

    def _pair(self) -> Pair:
        taking = self.taking
        missing = [
            name for name, value in (("d_1", taking.d1), ("d_2", taking.d2)) if value is None
        ]
        if taking.d1 is None or taking.d2 is None:
            lacking = remark("setup.no_distances", names=", ".join(missing))
            raise InputError(" ".join((lacking, *self.remarks)))
        if self.unit == "px" and taking.enlargements != (1.0, 1.0):
            raise InputError(remark("setup.enlargement_in_pixels"))
        if self.unit == "px" and taking.pitch is None:
            raise InputError(remark("setup.no_pitch"))
        if self.unit == "px" and (taking.nadir1 is None or taking.nadir2 is None):
            raise InputError(remark("setup.no_nadirs"))
        if taking.d1 == taking.d2:
            raise GeometryError(remark("setup.one_distance", d=taking.d1))
        if (taking.c1 is None) != (taking.c2 is None):
            raise InputError("c_1 and c_2: give both principal distances or none.")
        for name, value in (("pitch", taking.pitch), ("sigma_r_max", self.measuring.sigma_r_max)):
            if value is not None:
                positive(value, name)
        c1, c2 = taking.c_used
        pair = Pair.ideal(d1=taking.d1, d2=taking.d2, c1=c1, c2=c2, sigma=self.precision)
        if not self.media:
            return pair
        if self.refracted and taking.c1 is None:
            raise InputError(remark("setup.media_without_c"))
        photos = [replace(p, **self.media.through(k)) for k, p in enumerate(pair.as_given, 1)]
        return Pair(image1=photos[0], image2=photos[1])

    @property
    def refracted(self) -> bool:
        """Whether media are typed in the cells there are for them."""
        return bool(self.media and self.media.layers)

    def lens(self, image: int) -> Lens | None:
        """Return what distorts an image, for millimetres from its nadir; None for nothing.

        Raises
        ------
        InputError
            If its principal distance is missing.
        """
        own, c = self.lenses and self.lenses[image - 1], self.taking.c_used[image - 1]
        if own is None or (c is None and not own.distorts):
            return None
        if c is None:
            raise InputError(remark("setup.lens_without_c", image=image))
        return own.lens(c, *self.typed_frame(image))

    def typed_frame(self, image: int) -> tuple[FloatArray, Place]:
        """Return what brings typed coordinates from the nadir to millimetres, and the nadir."""
        taking = self.taking
        if self.unit != "px" or taking.pitch is None:
            return np.ones(2), (0.0, 0.0)
        nadir = (taking.nadir1, taking.nadir2)[image - 1]
        return np.array([taking.pitch, -taking.pitch]), nadir or (0.0, 0.0)

    def _free(self, image: int, lens: Lens | None, seen: FloatArray) -> FloatArray:
        """Return coordinates free of distortion, refusing a lens that folds the photo over."""
        if lens is None:
            return seen
        free = lens.undistort(seen)
        # The formulas' turns lead there too, and the way back to the pick.
        scale = freed_scale(lens, seen)[:, None]
        ways = lens.principal_point + (seen - lens.principal_point) * scale - free
        missed = np.abs(np.hstack([ways, lens.distort(free) - seen])).max(axis=1)
        allowed = 1e-9 * lens.camera_matrix[0, 0]
        if not (missed <= allowed)[~np.isnan(seen).any(axis=1)].all():
            place = f"{self.where}: " if self.where else ""
            raise InputError(f"{place}{remark('setup.lens_folds', image=image)}")
        return free

    def in_millimetres(self, points: PointObservations) -> PointObservations:
        """Return the points as image coordinates of `pair`, without raw pixels."""
        first, second = self.adjusted
        lenses = self.lens(1), self.lens(2)
        is_plain = all(part is None for part in (first, second, *lenses))
        if self.unit == "mm" and is_plain and not points.has_pixels.any():
            return points
        typed = (points.xy1, points.xy2)
        if self.unit == "px":
            (unit, nadir1), (_, nadir2) = self.typed_frame(1), self.typed_frame(2)
            typed = ((typed[0] - nadir1) * unit, (typed[1] - nadir2) * unit)
        typed = self._free(1, lenses[0], typed[0]), self._free(2, lenses[1], typed[1])
        if first is not None:
            typed = (apply_homography(first, typed[0]), typed[1])
        if second is not None:
            typed = (typed[0], apply_homography(second, typed[1]))
        blank = np.full((len(points), 2), np.nan)
        return replace(points, xy1=typed[0], xy2=typed[1], pixels1=blank, pixels2=blank)

    def exchanged(self) -> SurveySetup:
        """Return the same set-up with the images exchanged."""
        return replace(
            self, taking=self.taking.exchanged(), adjusted=self.adjusted[::-1],
            photo1=self.photo2, photo2=self.photo1,
            media=self.media and self.media.exchanged(),
            lenses=self.lenses and (self.lenses[1], self.lenses[0]),
        )  # fmt: skip

    def check_scales(self, tolerance: float = SCALE_TOLERANCE) -> str:
        """Return a remark on the scales of the photos; empty where they agree.

        Raises
        ------
        GeometryError
            If they differ by more than the tolerance: not a bifocal pair, or a wrong c or d.
        """
        taking = self.taking
        if taking.c1 is None or taking.c2 is None or taking.d1 is None or taking.d2 is None:
            return ""
        # Apart are the prints' scales by it too.
        enlarged = taking.enlargements[1] / taking.enlargements[0]
        share = (1000.0 * taking.d2 / taking.c2) / (1000.0 * taking.d1 / taking.c1) / enlarged - 1.0
        if self.refracted:
            share = scale_ratio(*self.pair().as_given) - 1.0
        apart = abs(share * enlarged + enlarged - 1.0)
        if apart > tolerance:
            place = f"{self.where}: " if self.where else ""
            about = {
                "apart": apart,
                "first": taking.c1 / taking.d1,
                "second": taking.c2 / taking.d2,
            }
            name = "setup.scales_through_media" if self.refracted else "setup.scales"
            exchanged = (taking.d1 / taking.c2) / (taking.d2 / taking.c1) / enlarged
            if not self.refracted and abs(exchanged * enlarged - 1.0) <= tolerance:
                name = "setup.scales_exchanged"
            raise GeometryError(f"{place}{remark(name, tolerance=tolerance, **about)}")
        if abs(share) < 1e-4:
            return ""
        far, near = max(taking.d1, taking.d2), min(taking.d1, taking.d2)
        if self.refracted:
            far, near = self.pair().straight_distances
        relief = float(false_relief_of_scale(abs(share), d1=far, d2=near))
        return remark("survey.scales_differ", share=share, relief=relief)
