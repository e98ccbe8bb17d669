"""Picks held against the photos: do both photos show the same detail where they were picked.

Exact picks fit cameras whichever photo they are given to. What lies under them fits in one way: off
the plane of the wall the photos show different things at exchanged, mirrored or halved pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from bifocal.model import Images, Picks, PickSlip, apply_homography, picks_meant
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray


@dataclass(frozen=True, slots=True)
class Evidence:
    """When patches decide; fixed by the reference points of church_1, church_2, castle_B, berlin_1.

    Of 960 subsets of 6 to 40 true picks, 0.6 px of noise, none preferred the exchange by more than
    0.03 in sum; exchanged ones of the sample preferred the truth by 0.7 and more.
    """

    half: int = 7  #: Half the side of a patch, in pixels of the coarser photo.
    reach: float = 1.5  #: How far a pick may be off. [px]
    least_contrast: float = 2.0  #: Patches with less tell nothing. [grey levels]
    gain: float = 1.2  #: What another reading of the picks gains at least, sum of correlations.
    sigmas: float = 1.3  #: And over the root of the sum of squares: two points at least.
    fits: float = 0.6  #: Correlation that picks of one detail reach, median of those that decide.
    alien: float = 0.35  #: A median below this: the photos show other things there.
    homography: int = 8  #: From so many picks on they give a homography, else a similarity.
    shift: int = 48  #: How far a photo may have been cropped since. [px]


EVIDENCE = Evidence()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PickVerdict:
    """What the photos say of picks.

    Attributes
    ----------
    likeness : ndarray, shape (n,)
        Correlation of both photos about each pick as typed; NaN where nothing is to be seen.
    slip : PickSlip or None
        What fits the photos clearly better than the picks as typed.
    moved : (int, int) or None
        By how much all picks of photo 2 seem to have moved: it was cropped since. [px]
    """

    likeness: FloatArray
    slip: PickSlip | None = None
    moved: tuple[int, int] | None = None

    @property
    def words(self) -> str:
        """What is to be said of it; empty where the photos agree with the picks."""
        if self.slip is not None:
            return remark(f"picks.{self.slip.key}")
        if self.moved is not None:
            return remark("picks.moved", right=self.moved[0], down=self.moved[1])
        return remark("picks.alien") if self.are_alien else ""

    @property
    def are_alien(self) -> bool:
        """Whether the photos show different things under most of the picks."""
        clear = self.likeness[np.isfinite(self.likeness)]
        return len(clear) >= 4 and float(np.median(clear)) < EVIDENCE.alien


def held_against_photos(
    images: Images, pixels1: FloatArray, pixels2: FloatArray, transfer: FloatArray | None = None
) -> PickVerdict:
    """Return what both photos say of the picks of the same points.

    Parameters
    ----------
    images : pair of ndarray of uint8, shape (h, w)
    pixels1, pixels2 : ndarray, shape (n, 2)
        NaN where not picked. [px]
    transfer : ndarray, shape (3, 3), optional
        Pixels of photo 2 by those of photo 1 on the wall; by default as the picks have it.
    """
    whole = np.isfinite(np.column_stack([pixels1, pixels2])).all(axis=1)
    picks = pixels1[whole], pixels2[whole]
    out = np.full(len(pixels1), np.nan)
    if whole.sum() < (3 if transfer is None else 1):
        return PickVerdict(likeness=out)
    sizes = tuple((image.shape[1], image.shape[0]) for image in images)
    out[whole] = typed = _likeness(images, picks, transfer)
    best, gained = None, EVIDENCE.gain
    for slip, meant in picks_meant(picks, (sizes[0], sizes[1])):
        likeness = _likeness(images, meant, transfer)
        gain = np.where(np.isfinite(typed) & np.isfinite(likeness), likeness - typed, 0.0)
        decides = np.abs(gain) > 0.1
        clear = gain.sum() > EVIDENCE.sigmas * np.sqrt((gain**2).sum())
        if clear and gain.sum() > gained and np.median(likeness[decides]) > EVIDENCE.fits:
            best, gained = slip, float(gain.sum())
    verdict = PickVerdict(likeness=out, slip=best)
    if best is None and verdict.are_alien:
        return PickVerdict(likeness=out, moved=_moved(images, picks, transfer))
    return verdict


def _likeness(images: Images, picks: Picks, transfer: FloatArray | None) -> FloatArray:
    """Return the best correlation of the photos within reach of each pick, shape (n,)."""
    spread = np.arange(-2, 3) / 2 * EVIDENCE.reach
    return np.asarray(_correlations(images, picks, transfer, _square(spread)).max(axis=1))


def _correlations(
    images: Images, picks: Picks, transfer: FloatArray | None, shifts: FloatArray
) -> FloatArray:
    """Return the correlation of the patches with photo 2 shifted, shape (n, shifts); NaN: plain."""
    local = _local(_transfer(*picks) if transfer is None else transfer, picks[0])
    scale = np.sqrt(np.abs(np.linalg.det(local)))
    step = np.maximum(1.0, 1.0 / np.clip(scale, 0.1, 10.0))[:, None, None]
    grid = _square(np.arange(-EVIDENCE.half, EVIDENCE.half + 1.0)) * step
    first = _sampled(images[0], picks[0][:, None] + grid)
    at = picks[1][:, None] + grid @ local.transpose(0, 2, 1)
    first -= first.mean(axis=1, keepdims=True)
    plain = np.sqrt((first**2).mean(axis=1)) < EVIDENCE.least_contrast
    out = np.empty((len(first), len(shifts)))
    for k, shift in enumerate(shifts):
        second = _sampled(images[1], at + shift)
        second -= second.mean(axis=1, keepdims=True)
        size = np.sqrt((first**2).sum(axis=1) * (second**2).sum(axis=1))
        out[:, k] = (first * second).sum(axis=1) / np.maximum(size, 1e-6)
    out[plain] = np.nan
    return out


def _square(axis: FloatArray) -> FloatArray:
    """Return all pairs of values of an axis, shape (n², 2)."""
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def _sampled(image: ByteArray, at: FloatArray) -> FloatArray:
    """Return grey values at pixels, shape (n, m); the photo's edge goes on outside."""
    values = cv2.remap(
        image, at.astype(np.float32), None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(values, dtype=np.float64)


def _local(transfer: FloatArray, pixels: FloatArray) -> FloatArray:
    """Return the derivative of a homography at pixels, shape (n, 2, 2)."""
    weight = pixels @ transfer[2, :2] + transfer[2, 2]
    mapped = apply_homography(transfer, pixels)
    by = transfer[:2, :2] - mapped[:, :, None] * transfer[2, :2]
    return np.asarray(by / weight[:, None, None])


def _transfer(pixels1: FloatArray, pixels2: FloatArray) -> FloatArray:
    """Return the homography that most of the picks agree with; of few, the similarity."""
    if len(pixels1) >= EVIDENCE.homography:
        away = 0.02 * float(np.ptp(pixels2, axis=0).max())
        matrix, agree = cv2.findHomography(pixels1, pixels2, cv2.RANSAC, max(away, 2.0))
        if matrix is not None and agree.sum() >= len(pixels1) / 2:
            return np.asarray(matrix)
    matrix, _ = cv2.estimateAffinePartial2D(pixels1, pixels2, method=cv2.LMEDS)
    return np.eye(3) if matrix is None else np.vstack([matrix, [0.0, 0.0, 1.0]])


def _moved(images: Images, picks: Picks, transfer: FloatArray | None) -> tuple[int, int] | None:
    """Return the one shift of photo 2 with which all picks show the same; None without one."""
    axis = np.arange(-EVIDENCE.shift, EVIDENCE.shift + 1.0, 2.0)
    shifts = _square(axis)
    every = np.nanmedian(_correlations(images, picks, transfer, shifts), axis=0)
    best = int(np.nan_to_num(every, nan=-1.0).argmax())
    if every[best] < EVIDENCE.fits:
        return None
    return int(shifts[best, 0]), int(shifts[best, 1])
