"""Do the two photos fit each other? The flow across the radius and the wall itself tell."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from bifocal.relief_maps.flow import Measurement
from bifocal.relief_maps.frame import Frame
from photocore.errors import GeometryError

#: Pixels that come back to themselves within this are taken for matched. [px]
MATCHED = 1.0
#: With fewer matched pixels the photos do not show the same thing.
LEAST_MATCHED = 0.12
#: Systematic misfit that is worth a remark, and misfit beyond which no relief is made. [px]
REMARK_PX, REFUSE_PX = 0.35, 3.0
#: The nadir zone has no direction across the radius. [share of the frame's half diagonal]
NADIR_ZONE = 0.15


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
    remarks : tuple of str
    """

    matched: float
    across_median: float
    shift: tuple[float, float]
    rotation: float
    systematic: float
    wall: float
    false_relief_per_scale: float
    remarks: tuple[str, ...]

    def to_dict(self) -> dict[str, object]:
        """Return plain values."""
        return asdict(self)


def check_registration(frame: Frame, found: Measurement) -> Registration:
    """Return how well the photos fit each other.

    Raises
    ------
    GeometryError
        If hardly any pixel can be matched, or the photos are systematically off by pixels.
    """
    step = max(1, int(np.sqrt(frame.grid.width * frame.grid.height / 4e4)))
    part = (slice(step // 2, None, step), slice(step // 2, None, step))
    x, y = (np.asarray(axis) for axis in frame.from_centre())
    grid_x, grid_y = np.broadcast_arrays(x, y)
    px, py = grid_x[part].astype(np.float64), grid_y[part].astype(np.float64)
    across, loop, relief = found.across[part], found.loop[part], found.r[part]
    common = (frame.seen1 & frame.seen2)[part]
    matched = common & (loop < MATCHED)
    share = float(matched.sum() / max(common.sum(), 1))
    if share < LEAST_MATCHED:
        raise GeometryError(
            f"only {share:.0%} of the pixels can be matched between the two photos: do both show "
            "the same wall, and does the pair file belong to them? Check the control points."
        )
    radius = np.hypot(px, py)
    zone = NADIR_ZONE * np.hypot(frame.grid.width, frame.grid.height) / 2
    use = matched & (radius > zone) & np.isfinite(relief)
    shift, rotation, systematic, median = _systematic(
        px[use], py[use], across[use].astype(np.float64)
    )
    wall = _mode(relief[use])
    per_scale = 1e-3 * frame.pair.base_factor
    remarks = _remarks(median, systematic, shift, rotation, wall, per_scale, share)
    if median > REFUSE_PX:
        raise GeometryError(
            f"the photos are not registered: matched points miss the radial lines by {median:.1f} "
            f"px (median; {REFUSE_PX:g} px is the limit), as from a shift of "
            f"{shift[0]:+.1f}, {shift[1]:+.1f} px and a rotation of {np.degrees(rotation):+.3f} "
            "deg. Make the pair file with `bifocal align --control` or `--auto`."
        )
    return Registration(
        matched=share,
        across_median=median,
        shift=shift,
        rotation=rotation,
        systematic=systematic,
        wall=wall,
        false_relief_per_scale=per_scale,
        remarks=remarks,
    )


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
    weight: np.ndarray = np.ones(len(x))
    solution = np.zeros(3)
    for _ in range(8):  # iteratively reweighted: least absolute deviations
        scaled = design * weight[:, None]
        solution = np.linalg.lstsq(scaled, across * weight, rcond=None)[0]
        weight = 1 / np.sqrt(np.maximum(np.abs(across - design @ solution), 0.02))
    explained = design @ solution
    return (
        (float(solution[0]), float(solution[1])),
        float(solution[2]),
        float(np.sqrt(np.mean(explained**2))),
        float(np.median(np.abs(across))),
    )


def _mode(relief: np.ndarray) -> float:
    """Return the relief of the most frequent surface: the mode of a histogram of 5 mm. [m]"""
    if not len(relief):
        return float("nan")
    low, high = np.percentile(relief, [1, 99])
    count, edge = np.histogram(relief, bins=np.arange(low, high + 0.011, 0.005))
    peak = int(count.argmax())
    near = relief[np.abs(relief - (edge[peak] + 0.0025)) < 0.01]
    return float(np.median(near)) if len(near) else float(edge[peak])


def _remarks(
    median: float,
    systematic: float,
    shift: tuple[float, float],
    rotation: float,
    wall: float,
    per_scale: float,
    share: float,
) -> tuple[str, ...]:
    """Return what the user should be told."""
    told = []
    if systematic > REMARK_PX:
        told.append(
            f"the photos do not fit exactly: matched points miss the radial lines by "
            f"{median:.2f} px (median), as from a shift of {shift[0]:+.2f}, {shift[1]:+.2f} px and "
            f"a rotation of {np.degrees(rotation):+.4f} deg of photo 2. Relief is off likewise; "
            "improve the pair file with more control points (`bifocal align`)."
        )
    if share < 0.5:
        told.append(f"only {share:.0%} of the pixels could be matched there and back.")
    if abs(wall) > 0.3 * per_scale and abs(wall) < 15 * per_scale:
        told.append(
            f"the largest flat surface lies at r = {1000 * wall:+.0f} mm. If it is your reference "
            f"plane, the scale of the photos differs by {100 * wall / per_scale * 1e-3:+.3f} %."
        )
    told.append(
        f"an error of 0.1 % in the relative scale of the photos shifts all relief by "
        f"{1000 * per_scale:.0f} mm and shows in no residual: what guarantees it are the control "
        "points or distances the pair file was made from. Check one known relief."
    )
    return tuple(told)
