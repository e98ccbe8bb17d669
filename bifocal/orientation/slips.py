"""The few slips people make when typing a set-up: tried where what was typed does not fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bifocal.files import is_odd
from bifocal.model import COORDINATES, Cameras, Interiors, picks_meant
from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.tuning import SLIPS
from bifocal.remarks import remark
from photocore.arrays import BoolArray

FILM = 36.0  #: Width of 35-mm film. [mm]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TypedOrientation:
    """What a pair is set up from; ``exchanged`` where the photos' names are the other way round."""

    interiors: Interiors
    control: Control
    site: SiteMeasures
    exchanged: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrialOrientation:
    """How well that fits: the misfit over what it may be, and which control points do not."""

    misfit: float
    cameras: Cameras
    lost: BoolArray

    def explains(self, now: TrialOrientation | None) -> bool:
        """Return whether this is what was meant, where what was typed fits so.

        Both fits with all points: then the sum of squares tells, as precise as the points are.
        """
        before, count = SLIPS.most if now is None else now.misfit, 4 * len(self.lost)
        if now is not None and not (self.lost.any() or now.lost.any()):
            surplus = count * (before**2 - self.misfit**2)
            if self.misfit < SLIPS.doubted and surplus > SLIPS.certain**2 * max(
                1.0, self.misfit**2
            ):
                return True
        return self.misfit < min(SLIPS.fits, before / SLIPS.better)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slip:
    """What was meant, and what to say; whether to go on with it, or only a person can mend it."""

    meant: TypedOrientation
    words: str
    mended: bool = True
    handicap: float = 1.0


def slip_of(
    typed: TypedOrientation,
    fitted: Callable[[TypedOrientation], TrialOrientation | None],
    *,
    by_control: bool,
) -> Slip | None:
    """Return the slip that explains why something typed does not fit; None where nothing does.

    Parameters
    ----------
    typed : TypedOrientation
    fitted : function
        Tells how well something fits; None if not at all.
    by_control : bool
        Whether control points tell; else the common points do.
    """
    now = fitted(typed)
    fits = now is not None and now.misfit < SLIPS.doubted
    if fits and not by_control:
        return None
    lenses, tables = [*_of_lenses(typed, free=by_control and not fits)], list[Slip]()
    if not fits:
        tables += _of_control(typed, now) if by_control else _of_site(typed)
    explaining = _explaining([(slip, fitted(slip.meant)) for slip in (*lenses, *tables)], now)
    if not explaining and (not fits or _may_be_parts(typed, now)):
        crops = [(slip, fitted(slip.meant)) for slip in _of_crops(typed, by_control=by_control)]
        explaining = _explaining(crops, now)
        if now is not None and fits:
            explaining = [one for one in explaining if one[0] < now.misfit]
        if not explaining and by_control and now is not None:
            explaining = _perhaps_crops(typed, now, crops)
    if not explaining and tables and by_control and len(typed.control.ids) > 5:
        # Two at once, of a lens and of the table.
        both = (
            replace(two, words=f"{one.words} {two.words}", handicap=one.handicap)
            for one in lenses
            for two in _of_control(one.meant, now or fitted(one.meant))
        )
        explaining = _explaining([(slip, fitted(slip.meant)) for slip in both], now)
    if not explaining:
        return None
    least, best = min(explaining, key=lambda one: one[0])
    alike = [s.words for misfit, s in explaining if misfit < SLIPS.clearly * least and not s.mended]
    return best if best.mended else replace(best, words=remark("slips.or").join(alike))


def _explaining(
    trials: Iterable[tuple[Slip, TrialOrientation | None]], now: TrialOrientation | None
) -> list[tuple[float, Slip]]:
    """Return the slips that explain a misfit, each with what is left of it."""
    explaining: list[tuple[float, Slip]] = []
    for slip, tried in trials:
        if tried is not None and tried.explains(now):
            lying = sum(camera.rotation[0, 0] for camera in tried.cameras) < 0.7
            tilts = [np.rad2deg(np.arccos(-c.rotation[2, 2])) for c in tried.cameras]
            words = slip.words.replace("<tilts>", " and ".join(f"{tilt:.0f}" for tilt in tilts))
            # Photos that are then in their order need no second exchange.
            turned = tried.cameras[0].centre[2] < tried.cameras[1].centre[2]
            misfit = tried.misfit * slip.handicap * (SLIPS.clearly**2 if lying else 1.0)
            misfit *= SLIPS.clearly if turned else 1.0
            explaining.append((misfit, replace(slip, words=words)))
    return explaining


def _of_lenses(typed: TypedOrientation, *, free: bool) -> Iterator[Slip]:
    """Yield slips of the focal lengths, of the sensor's size, and of a photo's."""
    first, second = typed.interiors
    if any(i.is_calibrated or i.is_assumed or i.pixel_size is None for i in typed.interiors):
        return
    pixels = np.array([i.pixel_size for i in typed.interiors], dtype=float)
    sizes = np.array([max(i.image_size) for i in typed.interiors])
    focals, sensor = pixels * [first.focal, second.focal], float(sizes[0] * pixels[0])
    shown, true = (" and ".join(dict.fromkeys(f"{f:.3g}" for f in fs))
                   for fs in (focals, focals * sensor / FILM))  # fmt: skip
    height = min(first.image_size) / sizes[0]
    rows: list[tuple[float, str]] = [
        (height, remark("slips.sensor_height", given=sensor, taken=sensor / height)),
        (sensor / FILM, remark("slips.film_focal", given=shown, taken=true)),
        *((crop, remark("slips.crop", given=sensor, taken=sensor / crop, crop=crop))
          for crop in (1.5, 1.6)),
    ]  # fmt: skip
    for factor, words in rows:
        one, two = (replace(i, focal=i.focal * factor) for i in typed.interiors)
        yield Slip(meant=replace(typed, interiors=(one, two)), words=words)
    if first.is_typed and second.is_typed and np.ptp(focals):
        one, two = (replace(i, focal=f) for i, f in
                    zip(typed.interiors, (focals / pixels[::-1])[::-1], strict=True))  # fmt: skip
        words = remark("slips.focals", first=focals[0], second=focals[1])
        yield Slip(meant=replace(typed, interiors=(one, two)), words=words)
    ratio, small = float(sizes[1] / sizes[0]), int(sizes[1] < sizes[0])
    if abs(ratio - 1) > 0.01 and abs(pixels[1] / pixels[0] * ratio - 1) < 0.01:
        both, part = [first, second], typed.interiors[small]
        both[small] = replace(
            part, focal=part.focal * max(ratio, 1 / ratio), pixel_size=float(pixels[1 - small]),
            sigma_centre=0.3 * float(sizes.max() - sizes.min()),
        )  # fmt: skip
        words = remark(
            "slips.cut_out", small=small + 1, size=sizes[small], large=2 - small, wide=sizes.max()
        )
        yield Slip(meant=replace(typed, interiors=(both[0], both[1])), words=words)
    # A wrong tape is not the lens.
    if free and len(typed.control.ids) > 5 and typed.site.distances == (None, None):
        loose = replace(first, sigma_focal=0.5), replace(second, sigma_focal=0.5)
        words = remark("slips.focals_contradict", first=first.source, second=second.source)
        yield Slip(meant=replace(typed, interiors=loose), words=words, handicap=SLIPS.clearly)


def _may_be_parts(typed: TypedOrientation, now: TrialOrientation | None) -> bool:
    """Whether photos that seem to fit may be cropped: their shapes differ, or points miss a bit."""
    sizes = [i.image_size for i in typed.interiors]
    differ = sorted(sizes[0]) != sorted(sizes[1])
    return differ or any(map(is_odd, sizes)) or (now is not None and now.misfit > 1)


def _of_crops(typed: TypedOrientation, *, by_control: bool) -> Iterator[Slip]:
    """Yield that photos are parts of larger ones, where there are points enough to tell."""
    too_few = by_control and typed.control.positioned.sum() < 8
    unknown = not by_control and any(i.is_assumed for i in typed.interiors)
    if any(i.is_calibrated for i in typed.interiors) or too_few or unknown:
        return
    # Cut alike, as a whole folder is, each by itself, or one of them.
    for which, key, alike in (((0, 1), "both", True), ((0, 1), "both", False),
                              ((0,), "first", False), ((1,), "second", False)):  # fmt: skip
        loose = [
            replace(i, sigma_centre=0.15 * float(np.hypot(*i.image_size)), is_part=not alike)
            if k in which
            else i
            for k, i in enumerate(typed.interiors)
        ]
        meant = replace(typed, interiors=(loose[0], loose[1]))
        words = remark(f"slips.{'cropped' if by_control else 'part'}_{key}")
        yield Slip(meant=meant, words=words, handicap=SLIPS.clearly)


def _perhaps_crops(
    typed: TypedOrientation,
    now: TrialOrientation,
    crops: Iterable[tuple[Slip, TrialOrientation | None]],
) -> list[tuple[float, Slip]]:
    """Return the doubt, nothing mended, where points fit as well if photos are parts.

    Control fits uncropped photos less well, or with a point left out, and cameras elsewhere. Lenses
    that are known do not leave that open.
    """
    if not all(i.is_assumed for i in typed.interiors):
        return []
    doubts: list[tuple[float, Slip]] = []
    for _, tried in crops:
        if tried is None or tried.lost.any() or tried.misfit > now.misfit:
            continue
        places = [[float(c.centre[2]) for c in one.cameras] for one in (now, tried)]
        if np.ptp(np.log(places), axis=0).max() > SLIPS.elsewhere:
            words = remark("slips.perhaps_cropped", far=places[1][0], near=places[1][1])
            doubts.append((tried.misfit, Slip(meant=typed, words=words)))
    return doubts


def _of_site(typed: TypedOrientation) -> Iterator[Slip]:
    """Yield that the cameras were not square to the wall, where that was said."""
    if typed.site.parallel:
        words = remark("slips.not_square", tilts="<tilts>")
        meant = replace(typed, site=replace(typed.site, parallel=False))
        yield Slip(meant=meant, words=words, mended=False)


def _of_control(typed: TypedOrientation, now: TrialOrientation | None) -> Iterator[Slip]:
    """Yield slips of the control table: how its axes count, which pick and which point is which."""
    control, count = typed.control, len(typed.control.ids)
    xyz, (first, second) = control.xyz, typed.interiors
    same = first.image_size == second.image_size and typed.site.wall is None
    if same and first.is_typed == second.is_typed:
        # A focal length of the EXIF data goes with its file, one that was typed with its number.
        by_number = first.is_typed or any(i.is_assumed or i.is_calibrated for i in typed.interiors)
        lenses = typed.interiors if by_number else (second, first)
        yield Slip(
            meant=replace(typed, exchanged=True, interiors=lenses), words=remark("slips.photos")
        )
    sizes = first.image_size, second.image_size
    for slip, (pixels1, pixels2) in picks_meant((control.pixels1, control.pixels2), sizes):
        meant = replace(control, pixels1=pixels1, pixels2=pixels2)
        words = remark(f"slips.{slip.key}")
        yield Slip(meant=replace(typed, control=meant), words=words, mended=slip.mended)
    if (frame := control.frame) is not None and frame.is_upright:
        meant = replace(control, xyz=xyz * [1, 1, -1], frame=frame.exchanged())
        yield Slip(meant=replace(typed, control=meant), words=remark("slips.east_north"))
    for key, axes in COORDINATES.items():
        meant = replace(control, xyz=axes(xyz))
        yield Slip(meant=replace(typed, control=meant), words=remark(f"slips.{key}"), mended=False)
    few = list(range(count)) if now is None else np.flatnonzero(now.lost).tolist()
    for a, b in combinations(few, 2) if len(few) <= 7 else ():
        order = np.arange(count)
        order[[a, b]] = b, a
        meant = replace(control, xyz=xyz[order], sigma=control.sigma[order])
        words = remark("slips.coordinates", first=control.ids[a], second=control.ids[b])
        yield Slip(meant=replace(typed, control=meant), words=words)
