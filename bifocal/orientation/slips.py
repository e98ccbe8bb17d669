"""The few slips people make when typing a set-up: tried where what was typed does not fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.interior_orientation import Cameras, Interior, Interiors
from photocore.arrays import BoolArray

#: What was typed is doubted where it misses by so many times what it may: with clean control
#: church_1, church_2 and semireal_church come to 0.7 to 1.7, with a slip to 4 and more.
DOUBTED = 2.0
#: A slip is believed that fits so many times better, and to this; a mirror image that lays the
#: camera on its side, and a focal length of any size, are believed if nothing fits nearly so well.
BETTER, FITS, CLEARLY = 3.0, 3.0, 1.3
#: A point that misses by more says no more. [sigma]
MOST = 10.0
#: Width of 35-mm film, and of the sensors with crop factors of 1.5 and 1.6. [mm]
FILM, CROPPED = 36.0, (23.5, 22.3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Typed:
    """What a pair is set up from."""

    interiors: Interiors
    control: Control
    site: SiteMeasures


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """How well that fits: the misfit over what it may be, and which control points do not."""

    misfit: float
    cameras: Cameras
    lost: BoolArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Slip:
    """What was meant, and what to say; whether to go on with it, or only a person can mend it."""

    meant: Typed
    words: str
    mended: bool = True
    handicap: float = 1.0


def slip_of(
    typed: Typed, fitted: Callable[[Typed], Fitted | None], *, by_control: bool
) -> Slip | None:
    """Return the slip that explains why something typed does not fit; None where nothing does.

    Parameters
    ----------
    typed : Typed
    fitted : function
        Tells how well something fits; None if not at all.
    by_control : bool
        Whether control points tell; else the common points do.
    """
    now = fitted(typed)
    if now is not None and now.misfit < DOUBTED:
        return None
    most = min(FITS, (MOST if now is None else now.misfit) / BETTER)
    found: list[tuple[float, Slip]] = []
    for slip in _slips(typed, now, by_control=by_control):
        tried = fitted(slip.meant)
        if tried is not None and tried.misfit < most:
            lying = sum(camera.rotation[0, 0] for camera in tried.cameras) < 0.7
            misfit = tried.misfit * slip.handicap * (CLEARLY**2 if lying else 1.0)
            found.append((misfit, replace(slip, words=_filled(slip, tried.cameras))))
    if not found:
        return None
    least, best = min(found, key=lambda one: one[0])
    if best.mended:
        return best
    alike = [s.words for misfit, s in found if misfit < CLEARLY * least and not s.mended]
    return replace(best, words=" Or: ".join(alike))


def _slips(typed: Typed, now: Fitted | None, *, by_control: bool) -> Iterator[Slip]:
    """Yield the slips that are tried."""
    known = [not (i.is_calibrated or i.is_assumed) for i in typed.interiors]
    if all(known):
        for meant, words in _of_lenses(typed.interiors):
            yield Slip(meant=replace(typed, interiors=meant), words=words)
    if by_control:
        yield from _of_control(typed, now)
    elif typed.site.parallel:
        words = (
            "the cameras are not square to the wall, as two distances alone suppose: they look "
            "<tilts> degrees off its normal. Give --auto with the distances, or --control."
        )
        meant = replace(typed, site=replace(typed.site, parallel=False))
        yield Slip(meant=meant, words=words, mended=False)
    if by_control and any(known):
        free = [replace(i, sigma_focal=0.5) if k else i
                for k, i in zip(known, typed.interiors, strict=True)]  # fmt: skip
        given = ", ".join(interior.source for interior in typed.interiors)
        words = f"The focal lengths ({given}) contradict the control points, which say <focals>; "
        yield Slip(
            meant=replace(typed, interiors=(free[0], free[1])), handicap=CLEARLY,
            words=words + "they were left out. Check them, and --sensor-width.",
        )  # fmt: skip


def _of_lenses(interiors: Interiors) -> Iterator[tuple[Interiors, str]]:
    """Yield what lenses may have been meant, and what to say."""
    first, second = interiors
    sizes = [max(interior.image_size) for interior in interiors]
    if first.pixel_size is None or second.pixel_size is None:
        return
    sensor, focals = sizes[0] * first.pixel_size, [i.focal * (i.pixel_size or 0) for i in interiors]
    said = " and ".join(dict.fromkeys(f"{focal:.3g}" for focal in focals))
    longer = sizes[0] / min(first.image_size)
    yield (
        _scaled(interiors, 1 / longer),
        f"A sensor {sensor:.3g} mm wide does not fit; that is probably its height: "
        f"{sensor * longer:.1f} mm was taken. Give --sensor-width, its longer side.",
    )
    if sensor < 0.95 * FILM:
        true = " and ".join(dict.fromkeys(f"{focal * sensor / FILM:.1f}" for focal in focals))
        yield (
            _scaled(interiors, sensor / FILM),
            f"{said} mm is probably the 35-mm equivalent: {true} mm on this sensor, which was "
            "taken.",
        )
    for width in CROPPED if sensor > 1.2 * CROPPED[0] else ():
        yield (
            _scaled(interiors, sensor / width),
            f"A sensor {sensor:.3g} mm wide does not fit; {width:g} mm does and was taken "
            "(--sensor-width).",
        )
    small = int(np.argmin(sizes))
    ratio = max(sizes) / min(sizes)
    if ratio > 1.01 and abs(second.pixel_size / first.pixel_size * sizes[1] / sizes[0] - 1) < 0.01:
        part = interiors[small]
        whole = replace(part, focal=part.focal * ratio, pixel_size=interiors[1 - small].pixel_size,
                        sigma_centre=0.3 * (max(sizes) - min(sizes)))  # fmt: skip
        yield (
            (whole, second) if small == 0 else (first, whole),
            f"Photo {small + 1} is {sizes[small]} px wide, photo {2 - small} {max(sizes)} px: the "
            "former fits only as a part cut out of as large a photo, and was taken so. Better "
            "give the whole.",
        )


def _of_control(typed: Typed, now: Fitted | None) -> Iterator[Slip]:
    """Yield slips of the control table: how its axes count, which pick and which point is which."""
    control = typed.control
    x, y, r = control.xyz.T
    rows = [p * [1.0, -1.0] + [0.0, i.image_size[1] - 1.0] for p, i in
            zip((control.pixels1, control.pixels2), typed.interiors, strict=True)]  # fmt: skip
    for words, meant in (
        ("rows counted from the top: row1, row2 seem to count from the bottom",
         replace(control, pixels1=rows[0], pixels2=rows[1])),
        ("the sign of Y changed: Y counts upwards",
         replace(control, xyz=np.column_stack([x, -y, r]))),
        ("X and Y exchanged: X counts to the right, Y upwards",
         replace(control, xyz=np.column_stack([y, x, r]))),
        ("the sign of r changed: r counts towards the cameras",
         replace(control, xyz=np.column_stack([x, y, -r]))),
    ):  # fmt: skip
        words = f"the control points do not fit as typed; all fit with {words}."
        yield Slip(meant=replace(typed, control=meant), words=words, mended=False)
    words = "col1, row1 and col2, row2 of the control points are exchanged; they were put right."
    yield Slip(meant=replace(typed, control=control.exchanged()), words=words)
    few = np.arange(len(control.ids)) if now is None else np.flatnonzero(now.lost)
    for pair in combinations(few.tolist(), 2) if len(few) <= 7 else ():
        order = np.arange(len(control.ids))
        order[list(pair)] = pair[::-1]
        meant = replace(control, xyz=control.xyz[order], sigma=control.sigma[order])
        names = " and ".join(control.ids[k] for k in pair)
        words = f"The coordinates of the control points {names} are exchanged; they were put right."
        yield Slip(meant=replace(typed, control=meant), words=words)


def _scaled(interiors: Interiors, factor: float) -> Interiors:
    """Return the interior orientations with longer principal distances."""
    first, second = (replace(i, focal=i.focal * factor, source=f"{i.source}, times {factor:.3f}")
                     for i in interiors)  # fmt: skip
    return first, second


def _filled(slip: Slip, cameras: Cameras) -> str:
    """Return the words of a slip with what came out of the cameras."""
    tilts = [np.rad2deg(np.arccos(-camera.rotation[2, 2])) for camera in cameras]
    focals = [_length(i, c.matrix[0, 0])
              for i, c in zip(slip.meant.interiors, cameras, strict=True)]  # fmt: skip
    words = slip.words.replace("<tilts>", " and ".join(f"{tilt:.0f}" for tilt in tilts))
    return words.replace("<focals>", " and ".join(focals))


def _length(interior: Interior, focal: float) -> str:
    """Return a principal distance in words."""
    pixel = interior.pixel_size
    return f"{focal:.0f} px" if pixel is None else f"{focal * pixel:.1f} mm"
