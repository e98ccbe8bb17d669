"""What half the resolution knows: relief of plain walls whose texture is lost in the noise.

Averaged over 2 x 2 px the noise is halved and slow shades of the plaster stay. Matching from coarse
to fine forgets what the coarse level knew where the fine one finds only noise; so that level is
matched by itself, there and back, and asked where the fine one is not sure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from bifocal.relief_maps import evidence, flow
from bifocal.relief_maps.evidence import EVIDENCE
from bifocal.relief_maps.frame import Frame
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseTuning:
    """Half the resolution, where the whole one is not sure."""

    #: The coarse level is asked where less than this share of the frame is matched there and back.
    #: Evidence: plaster has 0.3 to 0.6, textured façades 0.95.
    unsure: float = 0.75
    #: Where neither level is sure, the coarse one is believed from this difference: noise throws
    #: the fine one farther. [m]
    #: Evidence: church_2, beyond 10 cm: 1.13 to 1.00 %; on plaster it pays nothing.
    gross: float = 0.3


COARSE = CoarseTuning()


def is_unsure(matched: flow.Measurement) -> bool:
    """Return whether so little of a frame is matched that half the resolution may know more."""
    across, loop = matched.across[::4, ::4], matched.loop[::4, ::4]
    sure = (np.abs(across) < EVIDENCE.across_limit) & (loop < EVIDENCE.loop_limit)
    return bool(sure.mean() < COARSE.unsure)


def halved(frame: Frame) -> Frame:
    """Return a frame at half the resolution; an odd last row or column is dropped."""
    height, width = (length // 2 for length in frame.grid.shape)
    gsd = frame.grid.gsd
    grid = replace(
        frame.grid, x0=frame.grid.x0 + gsd / 2, y0=frame.grid.y0 - gsd / 2, gsd=2 * gsd,
        width=width, height=height,
    )  # fmt: skip

    def small(image: np.ndarray) -> np.ndarray:
        whole = np.ascontiguousarray(image[: 2 * height, : 2 * width])
        return cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA)

    seen1, seen2 = (
        small(255 * mask.astype(np.uint8)) == 255 for mask in (frame.seen1, frame.seen2)
    )
    return replace(
        frame, grid=grid, image1=small(frame.image1), image2=small(frame.image2), seen1=seen1,
        seen2=seen2,
    )  # fmt: skip


def backed(
    frame: Frame, fine: flow.Measurement, first: Float32Array
) -> tuple[flow.Measurement, BoolArray, Frame]:
    """Return a measurement with the coarse level's relief where it knows better.

    Parameters
    ----------
    frame : Frame
    fine : Measurement
        At full resolution.
    first : ndarray of float32
        First relief, of any size. [m]

    Returns
    -------
    matched : Measurement
        At full resolution, with the coarse level's relief where that knows better.
    known : ndarray of bool, shape (height, width)
        Pixels that the coarse level validates and the fine one does not.
    half : Frame
        At half the resolution.
    """
    half = halved(frame)
    half_flow = flow.measure(half, first)
    d2 = frame.distances[1]
    sure = evidence.validated(
        2 * half_flow.across,
        2 * half_flow.loop,
        flow.sigma_of_relief(half, half_flow.r, half_flow.sigma_px),
        d2,
    )
    coarse, coarse_sure = _enlarged(half_flow.r, frame), _enlarged(sure.astype(np.float32), frame)
    sigma = flow.sigma_of_relief(frame, fine.r, fine.sigma_px)
    unsure = ~evidence.validated(fine.across, fine.loop, sigma, d2)
    coarse_only = unsure & (coarse_sure > 0.99)
    better = coarse_only | (unsure & (np.abs(coarse - fine.r) > COARSE.gross))
    return replace(fine, r=np.where(better, coarse, fine.r)), coarse_only, half


def _enlarged(values: Float32Array, frame: Frame) -> Float32Array:
    """Return values of the halved frame at full resolution."""
    height, width = values.shape
    large = cv2.resize(values, (2 * width, 2 * height), interpolation=cv2.INTER_LINEAR)
    rows, columns = (
        whole - size for whole, size in zip(frame.grid.shape, large.shape, strict=True)
    )
    return cv2.copyMakeBorder(large, 0, rows, 0, columns, cv2.BORDER_REPLICATE)
