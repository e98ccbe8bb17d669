"""Do the two photos fit each other? The flow across the radius and the wall itself tell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bifocal.precision import false_relief_of_scale
from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.frame import Frame
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.errors import GeometryError


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationTuning:
    """Whether the photos fit."""

    #: Pixels that come back to themselves within this are taken for matched. [px]
    matched: float = 1.0
    #: With a smaller share of matched pixels the photos do not show the same thing.
    least_matched: float = 0.12
    #: Systematic misfit that is worth a remark. [px]
    remark_px: float = 0.35
    #: Misfit beyond which no relief is made. [px]
    refuse_px: float = 3.0
    #: The nadir zone has no direction across the radius: share of the frame's half diagonal.
    nadir_zone: float = 0.15


REGISTRATION = RegistrationTuning()


@dataclass(frozen=True, slots=True, kw_only=True)
class Registration:
    """How well the photos fit.

    Attributes
    ----------
    matched : float
        Share of pixels matched there and back.
    across_median : float
        Median of the absolute flow across the radius. [px]
    shift : tuple of float
        Shift of photo 2 along columns and rows that the flow across suggests. [px]
    rotation : float
        Rotation of photo 2 that it suggests. [rad]
    systematic : float
        RMS of what shift and rotation explain. [px]
    wall : float
        Relief of the most frequent surface. [m]
    false_relief_per_scale : float
        Constant false relief per 0.1 % of error in the relative scale of the photos. [m]
    base : float
        Distance of the cameras along the wall where it is larger than that across it, else 0. [m]
    false_relief_per_shift : float
        Constant false relief per pixel by which photo 2 is off along that line. [m]
    """

    matched: float
    across_median: float
    shift: tuple[float, float]
    rotation: float
    systematic: float
    wall: float
    false_relief_per_scale: float
    base: float = 0.0
    false_relief_per_shift: float = 0.0

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the user should be told."""
        sentences = []
        per_scale = self.false_relief_per_scale
        if self.systematic > REGISTRATION.remark_px:
            (x, y), turn = self.shift, np.degrees(self.rotation)
            about = {"x": x, "y": y, "turn": turn}
            sentences.append(remark("relief.no_exact_fit", miss=self.across_median, **about))
        if self.matched < 0.5:
            sentences.append(remark("relief.few_matched", share=self.matched))
        if self.base:
            shift = 100 * self.false_relief_per_shift  # of 0.1 px, in mm
            sentences.append(remark("relief.shift_along_base", base=self.base, relief=shift))
            return tuple(sentences)
        if 0.3 * per_scale < abs(self.wall) < 15 * per_scale:
            share = 100 * self.wall / per_scale * 1e-3
            sentences.append(remark("relief.flat_surface", wall=1000 * self.wall, share=share))
        sentences.append(remark("relief.scale_error", relief=1000 * per_scale))
        return tuple(sentences)


def check_registration(frame: Frame, measured: Measurement) -> Registration:
    """Return how well the photos fit each other.

    Raises
    ------
    GeometryError
        If hardly any pixel can be matched, or the photos are systematically off by pixels.
    """
    step = max(1, int(np.sqrt(frame.grid.width * frame.grid.height / 4e4)))
    part = (slice(step // 2, None, step), slice(step // 2, None, step))
    grid_x, grid_y = np.broadcast_arrays(*frame.from_centre())
    px, py = grid_x[part].astype(np.float64), grid_y[part].astype(np.float64)
    across, loop, relief = measured.across[part], measured.loop[part], measured.r[part]
    common = (frame.seen1 & frame.seen2)[part]
    matched = common & (loop < REGISTRATION.matched)
    share = float(matched.sum() / max(common.sum(), 1))
    if share < REGISTRATION.least_matched:
        raise GeometryError(remark("relief.not_matched", share=share))
    radius = np.hypot(px, py)
    zone = REGISTRATION.nadir_zone * np.hypot(frame.grid.width, frame.grid.height) / 2
    use = matched & (radius > zone) & np.isfinite(relief)
    shift, rotation, systematic, median = _systematic(
        px[use], py[use], across[use].astype(np.float64)
    )
    if median > REGISTRATION.refuse_px:
        about = {"miss": median, "most": REGISTRATION.refuse_px, "x": shift[0], "y": shift[1]}
        raise GeometryError(remark("relief.not_registered", turn=np.degrees(rotation), **about))
    d1, d2 = frame.distances
    base, per_shift = _along_wall(frame)
    return Registration(
        matched=share,
        across_median=median,
        shift=shift,
        rotation=rotation,
        systematic=systematic,
        wall=_mode(relief[use]),
        false_relief_per_scale=float(false_relief_of_scale(1e-3, d1=d1, d2=d2)),
        base=base,
        false_relief_per_shift=per_shift,
    )


def _along_wall(frame: Frame) -> tuple[float, float]:
    """Return `Registration.base` and `Registration.false_relief_per_shift`. [m]

    A point at P with relief r is moved by ``(P - N) r / d`` in either photo; Midulla, Eq. (1).
    """
    (first, second), (d1, d2) = (frame.foot(1).nadir, frame.foot(2).nadir), frame.distances
    base = float(np.linalg.norm(np.subtract(first, second)))
    if base <= abs(d1 - d2):
        return 0.0, 0.0
    xmin, ymin, xmax, ymax = frame.grid.bounds
    middle = np.array([xmin + xmax, ymin + ymax]) / 2
    per_relief = np.linalg.norm((middle - second) / d2 - (middle - first) / d1)
    return base, float(frame.grid.gsd / per_relief)


def _systematic(
    x: np.ndarray, y: np.ndarray, across: np.ndarray
) -> tuple[tuple[float, float], float, float, float]:
    """Return shift, rotation, the RMS they explain and the median absolute flow across.

    A shift t of photo 2 adds (x ty - y tx) / s across the radius, a rotation adds s.
    """
    if len(x) < 20:
        return (0.0, 0.0), 0.0, 0.0, 0.0
    radius = np.hypot(x, y)
    design = np.column_stack([-y / radius, x / radius, radius])
    solution = least_absolute(design, across, rounds=8, floor=0.02)
    explained = design @ solution
    return (
        (float(solution[0]), float(solution[1])),
        float(solution[2]),
        float(np.sqrt(np.mean(explained**2))),
        float(np.median(np.abs(across))),
    )


def least_absolute(
    design: FloatArray, values: FloatArray, *, rounds: int, floor: float
) -> FloatArray:
    """Return the solution of least absolute deviations, by reweighted least squares.

    Residuals below ``floor`` count as it: they would be weighted without bound.
    """
    weight: FloatArray = np.ones(len(values))
    solution: FloatArray = np.zeros(design.shape[1])
    for _ in range(rounds):
        solution = np.linalg.lstsq(design * weight[:, None], values * weight, rcond=None)[0]
        weight = 1 / np.sqrt(np.maximum(np.abs(values - design @ solution), floor))
    return solution


def _mode(relief: np.ndarray) -> float:
    """Return the relief of the most frequent surface: the mode of a histogram of 5 mm. [m]"""
    if not len(relief):
        return float("nan")
    low, high = np.percentile(relief, [1, 99])
    count, edge = np.histogram(relief, bins=np.arange(low, high + 0.011, 0.005))
    peak = int(count.argmax())
    near = relief[np.abs(relief - (edge[peak] + 0.0025)) < 0.01]
    return float(np.median(near)) if len(near) else float(edge[peak])
