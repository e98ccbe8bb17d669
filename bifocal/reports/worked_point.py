"""The method with one point's numbers, so that a pocket calculator can check the program."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bifocal.media import media_words
from bifocal.model import Pair, Photo
from bifocal.rays import object_rays
from bifocal.reports.accuracy import millimetres
from bifocal.reports.content import PairContent
from photocore.arrays import FloatArray
from photocore.reports import Block, Heading, Paragraph, Words

_NUMBER = r"(-?\d+\.\d+)"
#: The two pixels of a method page, and what is found of them; the same in every language.
_PIXELS = re.compile(rf"\({_NUMBER}, {_NUMBER}\)_1   \({_NUMBER}, {_NUMBER}\)_2")
_FOUND = re.compile(rf"r = .* = {_NUMBER} m.*?X = {_NUMBER} m    Y = {_NUMBER} m", re.DOTALL)
_PROGRAM = re.compile(rf"r = {_NUMBER} m, X = {_NUMBER} m, Y = {_NUMBER} m")
#: Half of the last digit that is printed of a place, and a little more. [m]
_LAST_PLACE = 0.000051
#: Digits behind the point of a pixel, of a length [m] and of a slope: each line follows from the
#: digits printed above it.
_PIXEL, _LENGTH, _SLOPE = 4, 6, 8


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkedPoint:
    """The worked point of a report, computed anew.

    Attributes
    ----------
    report : str
    printed, computed : tuple of float
        X, Y and r, as the report says and as the pair file gives for the pixels it prints. [m]
    holds : bool
        Whether these agree within the digits printed, and the table of points has such a point.
    """

    report: str
    printed: tuple[float, ...]
    computed: tuple[float, ...]
    holds: bool

    def sentence(self) -> str:
        """Return it in one line."""
        printed, computed = (
            "X = {:.4f} m, Y = {:.4f} m, r = {:.4f} m".format(*place)
            for place in (self.printed, self.computed)
        )
        word = "holds" if self.holds else "DOES NOT HOLD"
        return f"{self.report}: the worked point {word}: {printed}; computed anew {computed}"


def recomputed(
    page: str, pairs: Sequence[Pair], points: Sequence[FloatArray], report: str
) -> WorkedPoint | None:
    """Return the worked point of a report (HTML), computed anew; None where it has none.

    Parameters
    ----------
    page : str
        The report.
    pairs : sequence of Pair
        One of which it speaks.
    points : sequence of ndarray, shape (n, 3)
        Tables of X, Y, r; the point must be in each. [m]
    report : str
        Its name.
    """
    text = html.unescape(page)
    pixels = _PIXELS.search(text)
    by_hand_text = _FOUND.search(text, pixels.end()) if pixels else None
    program_text = _PROGRAM.search(text, by_hand_text.end()) if by_hand_text else None
    if pixels is None or by_hand_text is None or program_text is None:
        return None
    # By hand, both photos alike; by the program, which weights them; each X, Y, r.
    by_hand, by_program = (
        np.roll(np.array(one.groups(), float), -1) for one in (by_hand_text, program_text)
    )
    # The digits printed, then each pixel coordinate moved by what was rounded off.
    picks = np.array([float(number) for number in pixels.groups()])
    digits = min(len(number.partition(".")[2]) for number in pixels.groups())
    picks = picks + 0.51 * 10.0**-digits * np.vstack([np.zeros(4), np.eye(4)])
    holds, nearest = False, np.full(3, np.nan)
    for pair in pairs:
        ideal = replace(
            pair, image1=replace(pair.image1, lens=None), image2=replace(pair.image2, lens=None)
        )
        rays = [picks[:, :2], picks[:, 2:]]
        hand, weighted = _by_hand(ideal, rays), ideal.intersect(*rays).xyz
        same = _agree(by_hand, hand) and _agree(by_program, weighted)
        listed = [(np.abs(table - by_program) <= _LAST_PLACE).all(axis=1).any() for table in points]
        if (same and all(listed)) or not holds:
            holds, nearest = same and all(listed), hand[0]
    return WorkedPoint(
        report=report, printed=tuple(by_hand.tolist()), computed=tuple(nearest.tolist()),
        holds=holds,
    )  # fmt: skip


def _agree(printed: FloatArray, xyz: FloatArray) -> bool:
    """Tell whether the first of some places is the one printed; the others what rounding did."""
    allowed = np.abs(xyz[1:] - xyz[0]).sum(axis=0) + _LAST_PLACE
    return bool((np.abs(xyz[0] - printed) <= allowed).all())


def _by_hand(pair: Pair, pixels: Sequence[FloatArray]) -> FloatArray:
    """Return X, Y, r as the method page finds them, both photos of equal weight, (n, 3). [m]"""
    places, slopes = [], []
    for photo, pixel in zip((pair.image1, pair.image2), pixels, strict=True):
        rays = object_rays(photo.apparent_from_pixels(pixel), photo.foot)
        places.append(rays.position)
        slopes.append(-rays.slope)
    shift, slope = places[0] - places[1], slopes[0] - slopes[1]
    r = (shift * slope).sum(axis=1) / (slope**2).sum(axis=1)
    place = np.mean([q - v * r[:, None] for q, v in zip(places, slopes, strict=True)], axis=0)
    return np.column_stack([place, r])


def method_blocks(content: PairContent, say: Words) -> Iterator[Block]:
    """Yield the method page; nothing of a set, or where no point was measured in both photos."""
    solution = content.solution
    if solution is None or solution.setup is not None or content.of_set is not None:
        return
    points, table = solution.points, solution.table
    good = np.isfinite(np.hstack([points.pixels1, points.pixels2, table.xyz])).all(axis=1)
    if not good.any():
        return
    # A point well off the wall and well measured shows the most.
    worth = np.abs(table["Z"]) / np.maximum(table["sigma_r"], 1e-6)
    row = int(np.argmax(np.where(good, worth, -1.0)))
    yield Heading(text=say("method"))
    yield Paragraph(text=say("method_intro", id=table.ids[row]))
    pair = content.pair
    q, v, s = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2)
    pixel_lines, plane_lines, slope_lines, sigma_lines = [], [], [], []
    picks = (points.pixels1[row], points.pixels2[row])
    relief = float(table["Z"][row])
    for k, (photo, raw) in enumerate(zip((pair.image1, pair.image2), picks, strict=True)):
        ideal = np.round(raw if photo.lens is None else photo.lens.undistort(raw), _PIXEL)
        matrix = photo.plane_from_pixel / photo.plane_from_pixel[2, 2]
        x, y, w = matrix @ [*ideal, 1.0]
        q[k] = np.round([x / w, y / w], _LENGTH)
        pixel_lines.append(f"{_vector(ideal, _PIXEL)}_{k + 1}")
        plane_lines += _matrix_lines(f"H{k + 1}", matrix)
        plane_lines.append(
            f"     x, y, w = {x:.9g}, {y:.9g}, {w:.9g}    q{k + 1} = {_vector(q[k], _LENGTH)} m"
        )
        nadir, distance = np.round(photo.nadir, _LENGTH), round(photo.distance, _LENGTH)
        slope_lines.append(
            f"N{k + 1} = {_vector(nadir, _LENGTH)} m, d{k + 1} = {distance:.{_LENGTH}f} m    "
        )
        pixel = _spacing(photo, raw, relief)
        if photo.refracted:
            tangent = (q[k] - nadir) / distance
            slope_lines[k] += (
                f"z0 = {photo.z0:.{_LENGTH}f} m    t{k + 1} = {_vector(tangent, _SLOPE)}    "
            )
            q[k], slope = object_rays(q[k], photo.foot)
            q[k], v[k] = np.round(q[k], _LENGTH), np.round(-slope, _SLOPE)
            slope_lines[k] += f"a{k + 1} = {_vector(q[k], _LENGTH)} m    "
            sigma_lines.append("")
        else:
            v[k] = np.round((q[k] - nadir) / distance, _SLOPE)
            sigma_lines.append(
                f"|det H{k + 1}| = {abs(np.linalg.det(matrix)):.6e}    "
                f"p{k + 1} = sqrt(|det H{k + 1}| / |w{k + 1}|³) = "
            )
        sigma_px = round(photo.precision(solution.sigma_px), 4)
        s[k] = round(sigma_px * pixel, _LENGTH)
        sigma_lines[k] = sigma_lines[k] or f"p{k + 1} = "
        sigma_lines[k] += (
            f"{1000 * pixel:.4f} mm    s{k + 1} = {sigma_px:.4f} p{k + 1} = {1000 * s[k]:.3f} mm"
        )
        slope_lines[k] += f"v{k + 1} = {_vector(v[k], _SLOPE)}"
    bent = pair.refracted
    if pair.layers:
        slope_lines.insert(0, media_words(pair.layers))
    yield Paragraph(text=say("step_pixels"), lines=("   ".join(pixel_lines),))
    yield Paragraph(text=say("step_plane"), lines=tuple(plane_lines))
    yield Paragraph(text=say("step_bent" if bent else "step_slope"), lines=tuple(slope_lines))
    yield from _solved(content, row, (q, v, s), sigma_lines, say)


def _vector(values: FloatArray, digits: int) -> str:
    return f"({values[0]:.{digits}f}, {values[1]:.{digits}f})"


def _spacing(photo: Photo, raw: FloatArray, relief: float) -> float:
    """Return the pixel on the wall; through media by how much it moves the ray at a relief. [m]"""
    moved = photo.metres_per_pixel(raw[None], relief if photo.refracted else 0.0)
    return float(np.sqrt(abs(np.linalg.det(moved[0]))))


def _solved(
    content: PairContent,
    row: int,
    rays: tuple[FloatArray, FloatArray, FloatArray],
    sigma_lines: Sequence[str],
    say: Words,
) -> Iterator[Block]:
    """Yield relief, place and precision from the rays, and what the program says."""
    assert content.solution is not None
    q, v, s = rays
    table, pair = content.solution.table, content.pair
    bent = pair.refracted
    shift, slope = q[0] - q[1], v[0] - v[1]
    square = float(slope @ slope)
    r = float(shift @ slope) / square

    def named(text: str) -> str:
        """Return text in which places on the wall are called a where the rays are bent."""
        return text.replace("q1", "a1").replace("q2", "a2") if bent else text

    yield Paragraph(
        text=named(say("step_relief")),
        lines=(
            named(f"q1 - q2 = {_vector(shift, _LENGTH)} m")
            + f"    v1 - v2 = {_vector(slope, _SLOPE)}",
            f"r = {float(shift @ slope):.8e} / {square:.8e} = {r:.4f} m",
        ),
    )
    place = (q - v * r).mean(axis=0)
    yield Paragraph(
        text=named(say("step_xy")), lines=(f"X = {place[0]:.4f} m    Y = {place[1]:.4f} m",)
    )
    parts = s if bent else (1 - round(r, 4) / np.array([pair.d1, pair.d2])) * s
    yield Paragraph(
        text=say("step_sigma_bent" if bent else "step_sigma"),
        lines=(
            *sigma_lines,
            f"|v1 - v2| = {np.sqrt(square):.6f}    sigma_r = "
            f"{1000 * np.hypot(*parts) / np.sqrt(square):.2f} mm",
        ),
    )
    x, y, relief = (f"{value:.4f} m" for value in table.xyz[row])
    sigma = millimetres(float(table["sigma_r"][row]))
    yield Paragraph(text=say("step_program", r=relief, x=x, y=y, sigma=sigma))
    yield Paragraph(text=say("method_source_bent" if bent else "method_source"), small=True)


def _matrix_lines(name: str, matrix: FloatArray) -> list[str]:
    return [
        f"{name if i == 0 else '':3}| " + "  ".join(f"{value: .9e}" for value in line) + " |"
        for i, line in enumerate(matrix)
    ]
