"""Plain walls are plane patches: a plane for each segment of photo 1 between its edges.

Where texture is lost in the noise single pixels tell nothing, and windows tell a mean of what they
hold. A segment of wall between edges of the photo is one surface: the photos are compared over all
of it, at one plane after the other, and segments that no edge parts hold together.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model.image import noise
from bifocal.relief_maps import forward_projection
from bifocal.relief_maps.frame import Frame, offsets, zoom_map
from bifocal.relief_maps.segments import SEGMENTS, Segments
from photocore.arrays import ByteArray, Float32Array, FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanePatchTuning:
    """Plane patches on plain walls."""

    #: The photos are compared blurred by so much at half the resolution: without, reading between
    #: pixels takes out noise and looks like a better fit. [px]
    #: Evidence: façade 84: median 5.1 instead of 4.2 mm.
    blur: float = 0.8
    #: Differences count by the noise and by this share of the gradient: no segment fits to less.
    #: [px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.92 / +0.05.
    misplaced: float = 0.3
    #: Noise of the difference of both photos to that of one, at half the resolution, as variances.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.53 / +0.91.
    difference: float = 0.8
    #: A difference counts this much at most; half the square of a difference in noises.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.14 / -0.80.
    most: float = 1.0
    #: And this much where a nearer surface hides the place in photo 2.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.27 / +0.42.
    hidden: float = 0.3
    #: What a jump across a pixel of border costs without contrast.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.05 / +0.90.
    tie: float = 2.0
    #: What it costs with contrast.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.33 / +1.58.
    free: float = 0.1
    #: The contrast that lets relief jump. [grey levels]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.39 / +1.36.
    contrast: float = 2.5
    #: Jumps beyond this height count alike. [m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.21 / -1.06.
    jump: float = 0.08
    #: What a slope costs against a jump.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.07 / -0.47.
    slope: float = 0.05
    #: The steepest slope tried in fits. [m/px]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.07 / -0.10.
    steepest: float = 0.02
    #: Rounds.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.03 / -0.15.
    rounds: int = 4
    #: Planes of neighbours tried in each round.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.13 / -0.40.
    neighbours: int = 4
    #: Share of segments that may change at a time.
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony +0.74 / -0.71.
    at_a_time: float = 0.6
    #: Weight of no slope in fits to flow. [px²]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.32 / -0.21.
    ridge: float = 40.0
    #: A pixel is hidden in photo 2 by what is so much higher: parallax and relief. [px, m]
    #: Evidence: half / twice, beyond 3 cm [%]: plaster balcony -0.47 / +0.28.
    covers: tuple[float, float] = (1.0, 0.02)


PATCHES = PlanePatchTuning()
#: Derivatives along columns and rows.
_WAYS = ((1, 0), (0, 1))


def on_plain_walls(
    frame: Frame, relief: Float32Array, half: Frame | None
) -> tuple[Float32Array, Float32Array]:
    """Return relief on plane patches where `half` is given, and relief as it was. [m]"""
    return (relief if half is None else fitted(half, frame.image1, relief)), relief


def fitted(half: Frame, image: ByteArray, relief: Float32Array) -> Float32Array:
    """Return relief that is a plane on every segment of photo 1.

    Parameters
    ----------
    half : Frame
        At half the resolution.
    image : ndarray of uint8, shape (height, width)
        Photo 1 at full resolution.
    relief : ndarray of float32, shape (height, width)
        As measured pixel by pixel, to begin with. [m]

    Notes
    -----
    Minimises, over the planes, the truncated squared differences of the photos and, along the
    borders, the truncated difference of the planes that meet there: iterated conditional modes
    (Besag 1986) over proposals of the neighbours, as in PatchMatch stereo (Bleyer et al. 2011).
    """
    if min(image.shape) < 4 * SEGMENTS.spacing:
        return relief
    problem = _Problem.of(half, Segments.of(image))
    height, width = half.grid.shape
    coarse = np.ascontiguousarray(relief[: 2 * height : 2, : 2 * width : 2])
    solved = problem.relief_of(problem.solve(coarse), image.shape)
    return np.clip(solved, relief.min(), relief.max())


def _added(segment: IntArray, values: FloatArray | Float32Array, count: int) -> FloatArray:
    """Return the sums of values by segment."""
    return np.asarray(np.bincount(segment, values, count), dtype=np.float64)


@dataclass(slots=True, eq=False)
class _Problem:
    """Photos, segments and borders at half the resolution; places in its pixels."""

    half: Frame
    segments: Segments
    label: IntArray
    down: Float32Array
    across: Float32Array
    first: Float32Array
    second: Float32Array
    weight: Float32Array
    tie: FloatArray
    covers: Float32Array
    top: Float32Array
    #: From the middles of the owner and of the neighbour to that of their border, (2, n): rows,
    #: columns.
    from_own: FloatArray
    from_other: FloatArray

    @classmethod
    def of(cls, half: Frame, segments: Segments) -> _Problem:
        """Return the problem with nothing hidden."""
        height, width = half.grid.shape
        label = np.ascontiguousarray(segments.label[: 2 * height : 2, : 2 * width : 2])
        middle = np.stack([segments.row, segments.column]) / 2 - 0.25
        row, column = (middle[i].astype(np.float32)[label] for i in (0, 1))
        x, y = offsets((height, width))
        first, second = (
            cv2.GaussianBlur(image.astype(np.float32), (0, 0), PATCHES.blur)
            for image in (half.image1, half.image2)
        )
        gradient = [cv2.Sobel(first, cv2.CV_32F, *way, ksize=3, scale=0.125) for way in _WAYS]
        slack = np.float32(PATCHES.misplaced**2) * (gradient[0] ** 2 + gradient[1] ** 2)
        both = [noise(half.image1, half.seen1), noise(half.image2, half.seen2)]
        variance = np.float32(PATCHES.difference * (both[0] ** 2 + both[1] ** 2) / 2)
        borders = segments.borders
        tie = (
            PATCHES.tie
            * borders.length
            * (PATCHES.free + (1 - PATCHES.free) * np.exp(-borders.contrast / PATCHES.contrast))
        )
        at = np.stack([borders.row, borders.column]) / 2 - 0.25
        x0, y0 = half.from_centre()
        parallax = np.float32(half.pair.base_factor) / np.maximum(np.sqrt(x0 * x0 + y0 * y0), 2)
        covers = PATCHES.covers[0] * parallax + np.float32(PATCHES.covers[1])
        return cls(
            half=half, segments=segments, label=label, down=y - row, across=x - column, first=first,
            second=second, weight=1 / (2 * (variance + slack)), tie=tie,
            covers=covers.astype(np.float32),
            top=np.zeros((height, width), np.float32),
            from_own=at - middle[:, borders.own], from_other=at - middle[:, borders.other],
        )  # fmt: skip

    def solve(self, relief: Float32Array) -> FloatArray:
        """Return the planes: relief at the middle, slopes along rows and columns, (3, segments)."""
        rng = np.random.default_rng(0)
        measured = self._fit(relief)
        planes = np.zeros_like(measured)
        planes[0] = self._median(relief)
        for number in range(PATCHES.rounds):
            self._hide(planes)
            misfit = self._misfit(planes)
            # Neighbours' planes, one neighbour's height, every other time the fit to flow.
            for share in (*(1.0,) * PATCHES.neighbours, 0.0, *(None,) * (1 - number % 2)):
                tried = measured if share is None else self._of_neighbours(planes, share, rng)
                worse = self._misfit(tried)
                better = worse + self._jumps(tried, planes) < misfit + self._jumps(planes, planes)
                better &= rng.random(self.segments.number) < PATCHES.at_a_time
                planes = np.where(better, tried, planes)
                misfit = np.where(better, worse, misfit)
        return planes

    def relief_of(self, planes: FloatArray, shape: tuple[int, ...]) -> Float32Array:
        """Return the relief of planes on every pixel of photo 1, at full resolution. [m]"""
        height, slope, lean = planes
        middle = self.segments.row / 2 - 0.25, self.segments.column / 2 - 0.25
        level = height - slope * middle[0] - lean * middle[1]
        row = (np.arange(shape[0], dtype=np.float32)[:, None]) / 2 - np.float32(0.25)
        column = (np.arange(shape[1], dtype=np.float32)[None, :]) / 2 - np.float32(0.25)
        label = self.segments.label
        level, slope, lean = (x.astype(np.float32) for x in (level, slope, lean))
        return np.asarray(level[label] + slope[label] * row + lean[label] * column)

    def _relief(self, planes: FloatArray) -> Float32Array:
        """Return the relief of planes at half the resolution. [m]"""
        height, slope, lean = planes.astype(np.float32)
        label = self.label
        return np.asarray(height[label] + slope[label] * self.down + lean[label] * self.across)

    def _hide(self, planes: FloatArray) -> None:
        """Note the nearest surface at every pixel of photo 2, and what photo 2 does not show."""
        relief = self._relief(planes)
        columns, rows = zoom_map(self.half, relief)
        height, width = relief.shape
        with np.errstate(invalid="ignore"):
            column, row = np.rint(columns).astype(np.int64), np.rint(rows).astype(np.int64)
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        top = np.full((height, width), np.float32(-1e3))
        index = row[inside] * width + column[inside]
        forward_projection.highest(relief[inside], index, top)
        self.top = cv2.morphologyEx(top, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        self.top[~self.half.seen2] = 1e3

    def _misfit(self, planes: FloatArray) -> FloatArray:
        """Return how badly the photos fit over every segment, and what its slope costs."""
        relief = self._relief(planes)
        columns, rows = zoom_map(self.half, relief)
        off = cv2.remap(
            self.second, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        off -= self.first
        off *= off
        off *= self.weight
        np.minimum(off, np.float32(PATCHES.most), out=off)
        above = cv2.remap(self.top, columns, rows, cv2.INTER_NEAREST, borderValue=1e3)
        off[above > relief + self.covers] = PATCHES.hidden
        total = np.bincount(self.label.ravel(), off.ravel(), self.segments.number)
        steep = (np.abs(planes[1]) + np.abs(planes[2])) * (SEGMENTS.spacing / 2 / PATCHES.jump)
        borders = self.segments.borders
        length = np.bincount(borders.own, borders.length, self.segments.number)
        return np.asarray(total + PATCHES.slope * PATCHES.tie * np.minimum(steep, 1) * length)

    def _at_borders(self, planes: FloatArray, others: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the relief of own planes and of the neighbours' at the borders. [m]"""
        borders = self.segments.borders
        sides = ((planes, borders.own, self.from_own), (others, borders.other, self.from_other))
        inner, outer = (
            each[0][at] + each[1][at] * away[0] + each[2][at] * away[1] for each, at, away in sides
        )
        return inner, outer

    def _jumps(self, planes: FloatArray, others: FloatArray) -> FloatArray:
        """Return what the jumps from own planes to the neighbours' cost every segment."""
        inner, outer = self._at_borders(planes, others)
        cost = self.tie * np.minimum(np.abs(inner - outer) / PATCHES.jump, 1)
        return _added(self.segments.borders.own, cost, self.segments.number)

    def _median(self, relief: Float32Array) -> FloatArray:
        """Return the median relief of every segment, to a tenth of a millimetre. [m]"""
        least = float(relief.min())
        level = np.rint((relief - least) * 1e4).astype(np.int64)
        ordered = np.sort((self.label.astype(np.int64) << 32 | level).ravel())
        count = np.bincount(self.label.ravel(), minlength=self.segments.number)
        middle = np.minimum(np.cumsum(count) - (count + 1) // 2, len(ordered) - 1)
        return np.asarray(least + (ordered[middle] & (2**32 - 1)) * 1e-4)

    def _fit(self, relief: Float32Array) -> FloatArray:
        """Return planes through relief by least squares, (3, segments)."""

        def sums(values: Float32Array) -> FloatArray:
            return _added(self.label.ravel(), values.ravel(), self.segments.number)

        y, x = self.down, self.across
        count, sum_y, sum_x = sums(np.ones_like(y)) + 1e-3, sums(y), sums(x)
        squares = sums(y * y) + PATCHES.ridge, sums(x * y), sums(x * x) + PATCHES.ridge
        rows = [count, sum_y, sum_x, sum_y, *squares[:2], sum_x, *squares[1:]]
        matrix = np.stack(rows, axis=-1).reshape(-1, 3, 3)
        right = np.stack([sums(relief), sums(relief * y), sums(relief * x)], axis=-1)
        planes = np.linalg.solve(matrix, right[..., None])[..., 0].T
        planes[1:] = np.clip(planes[1:], -PATCHES.steepest, PATCHES.steepest)
        return np.asarray(planes)

    def _of_neighbours(
        self, planes: FloatArray, share: float, rng: np.random.Generator
    ) -> FloatArray:
        """Return the planes of a neighbour each, continued with a share of their slopes."""
        count, borders = self.segments.number, self.segments.borders
        several = np.diff(borders.first)
        at = borders.first[:-1] + (rng.random(count) * several).astype(np.int64)
        at = np.minimum(at, len(borders.own) - 1)
        height, slope, lean = planes[:, borders.other[at]]
        away = self.from_other[:, at] - share * self.from_own[:, at]
        at_neighbour = height + slope * away[0] + lean * away[1]
        return np.where(several == 0, planes, np.stack([at_neighbour, share * slope, share * lean]))
