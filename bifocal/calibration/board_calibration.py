"""Lens calibration from photos of a board: choice of model, outliers, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from scipy.special import fdtri

from bifocal.model import Lens
from bifocal.remarks import remark
from photocore.arrays import FloatArray, IntArray
from photocore.camera import BoardView
from photocore.errors import GeometryError, InputError

#: A photo whose RMS is this many times the median is named; beyond the second it is left out.
SUSPICIOUS, DROPPED = 4.0, 8.0
#: Error probability of the F test that lets another distortion term in.
SIGNIFICANCE = 0.01
COVERAGE_CELLS = (8, 6)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """A calibrated lens and how good it is.

    Attributes
    ----------
    lens : Lens
    standard_deviations : dict of str to float
        Of fx, fy, cx, cy [px] and each distortion coefficient.
    photo_rms : dict of str to float
        RMS residual of each photo used. [px]
    dropped, suspicious : tuple of str
        Photos left out, and photos to look at.
    coverage : ndarray, shape (6, 8)
        Board points per cell of the photo.
    tried : tuple of (model name, rms)
    verdict : str
        In words.
    without_board : tuple of str
        Photos in which the board was not found.
    """

    lens: Lens
    standard_deviations: dict[str, float]
    photo_rms: dict[str, float]
    dropped: tuple[str, ...]
    suspicious: tuple[str, ...]
    coverage: IntArray
    tried: tuple[tuple[str, float], ...]
    verdict: str
    without_board: tuple[str, ...] = ()


def _distortion_terms() -> dict[str, tuple[int, tuple[str, ...]]]:
    """Return models in order of growing freedom: OpenCV's flags and the terms they leave."""
    k2, k3, tangential = cv2.CALIB_FIX_K2, cv2.CALIB_FIX_K3, cv2.CALIB_ZERO_TANGENT_DIST
    return {
        "k1": (k2 | k3 | tangential, ("k1",)),
        "k1k2": (k3 | tangential, ("k1", "k2")),
        "k1k2p": (k3, ("k1", "k2", "p1", "p2")),
        "k1k2pk3": (0, ("k1", "k2", "p1", "p2", "k3")),
    }


def lens_of_views(
    views: Sequence[BoardView], image_size: tuple[int, int], *, model: str = "auto"
) -> Calibration:
    """Return the lens that explains the views.

    Parameters
    ----------
    views : sequence of BoardView
        At least three, better ten or more, the board held at different tilts and places.
    image_size : tuple of int
        Width and height of the photos. [px]
    model : str
        ``auto`` takes terms in while an F test at 1 % asks for them; or ``k1``, ``k1k2``,
        ``k1k2p``, ``k1k2pk3``, ``fisheye``.

    Returns
    -------
    Calibration

    Raises
    ------
    InputError
        If fewer than three views are given or the model is unknown.
    GeometryError
        If the views do not determine the lens (all of one tilt).
    """
    models = _distortion_terms()
    if model not in ("auto", "fisheye", *models):
        raise InputError(f"model: {model!r} is not one of auto, {', '.join(models)}, fisheye.")
    kept = list(views)
    dropped: list[str] = []
    while True:
        if len(kept) < 3:
            raise InputError(remark("calibration.few_boards", count=len(kept)))
        best = _solve(kept, image_size, model)
        rms = {view.name: float(v) for view, v in zip(kept, best.per_view, strict=True)}
        worst = max(rms, key=lambda name: rms[name])
        if rms[worst] <= max(DROPPED * float(np.median(list(rms.values()))), 0.5):
            break
        dropped.append(worst)
        kept = [view for view in kept if view.name != worst]
    limit = max(SUSPICIOUS * float(np.median(list(rms.values()))), 0.5)
    suspicious = tuple(name for name, value in rms.items() if value > limit)
    coverage = _coverage(kept, image_size)
    verdict = _verdict(best, coverage, len(kept))
    lens = replace(
        best.lens,
        source=f"board calibration, {len(kept)} photos, model {best.name}",
        extra={
            "standard_deviations": best.deviations,
            "coverage": coverage.tolist(),
            "verdict": verdict,
        },
    )
    return Calibration(
        lens=lens, standard_deviations=best.deviations, photo_rms=rms, dropped=tuple(dropped),
        suspicious=suspicious, coverage=coverage, tried=best.tried, verdict=verdict,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _LensFit:
    """One model adjusted to the views."""

    name: str
    lens: Lens
    deviations: dict[str, float]
    per_view: FloatArray
    tried: tuple[tuple[str, float], ...] = ()

    @property
    def rms(self) -> float:
        """Of all residuals. [px]"""
        return float(self.lens.sigma0 or 0.0)


def _solve(views: Sequence[BoardView], size: tuple[int, int], model: str) -> _LensFit:
    """Return the adjustment with the wanted model, or with the one that the data justify."""
    if model == "fisheye":
        return _solve_fisheye(views, size)
    models = _distortion_terms()
    names = list(models) if model == "auto" else [model]
    fits = {name: _solve_brown(views, size, name, *models[name]) for name in names}
    best = fits[names[0]]
    observations = 2 * sum(len(view.pixels) for view in views)
    for name in names[1:]:
        terms, more = len(models[name][1]), len(models[name][1]) - len(models[best.name][1])
        freedom = observations - 6 * len(views) - 4 - terms
        if freedom < 1:
            break
        gain = (best.rms**2 / fits[name].rms ** 2 - 1.0) * freedom / more
        if gain > fdtri(more, freedom, 1 - SIGNIFICANCE):
            best = fits[name]
    tried = tuple((name, each.rms) for name, each in fits.items())
    if model == "auto" and _field_of_view(best.lens.camera_matrix, size) > 100:
        with suppress(GeometryError):  # then the others stand
            fisheye = _solve_fisheye(views, size)
            tried = (*tried, ("fisheye", fisheye.rms))
            best = fisheye if fisheye.rms < 0.8 * best.rms else best
    return replace(best, tried=tried)


def _solve_brown(
    views: Sequence[BoardView], size: tuple[int, int], name: str, flags: int, names: tuple[str, ...]
) -> _LensFit:
    """Adjust OpenCV's model with the given terms."""
    try:
        rms, matrix, terms, _, _, deviations, _, per_view = cv2.calibrateCameraExtended(
            [v.board.astype(np.float32) for v in views],
            [v.pixels.astype(np.float32) for v in views],
            size, None, None, flags=flags,
        )  # fmt: skip
    except cv2.error as error:
        raise GeometryError(f"the calibration failed: {error.err}") from error
    _refuse_undetermined(matrix)
    order = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    sigmas = dict(zip(order, np.ravel(deviations).tolist(), strict=False))
    sigmas_of = {n: v for n, v in sigmas.items() if n in names or n in order[:4]}
    lens = Lens(
        camera_matrix=matrix, coefficients=np.ravel(terms)[:5], image_size=size, sigma0=float(rms)
    )
    return _LensFit(name=name, lens=lens, deviations=sigmas_of, per_view=np.ravel(per_view))


def _solve_fisheye(views: Sequence[BoardView], size: tuple[int, int]) -> _LensFit:
    """Adjust OpenCV's fisheye model (equidistant with four terms)."""
    # OpenCV 5 moved these two flags out of the fisheye namespace.
    place: Any = cv2 if hasattr(cv2, "CALIB_RECOMPUTE_EXTRINSIC") else cv2.fisheye
    flags = place.CALIB_RECOMPUTE_EXTRINSIC | place.CALIB_FIX_SKEW
    try:
        rms, matrix, terms, turns, shifts = cv2.fisheye.calibrate(
            [v.board[None] for v in views], [v.pixels[None] for v in views],
            size, None, None, flags=flags,
        )  # fmt: skip
    except cv2.error as error:
        raise GeometryError(f"the fisheye calibration failed: {error.err}") from error
    _refuse_undetermined(matrix)
    per_view = []
    normal = np.zeros((8, 8))
    for view, turn, shift in zip(views, turns, shifts, strict=True):
        projected, jacobian = cv2.fisheye.projectPoints(
            view.board[None], turn, shift, matrix, terms
        )
        misses = projected.reshape(-1, 2) - view.pixels
        per_view.append(np.sqrt((misses**2).sum() / len(misses)))
        # Columns of OpenCV's jacobian: f (2), c (2), k (4), rotation (3), shift (3), skew.
        inner, outer = jacobian[:, :8], jacobian[:, 8:14]
        mixed = inner.T @ outer
        normal += inner.T @ inner - mixed @ np.linalg.solve(outer.T @ outer, mixed.T)
    count = sum(len(view.pixels) for view in views)
    freedom = max(2 * count - 8 - 6 * len(views), 1)
    variance = sum(v**2 * len(view.pixels) for v, view in zip(per_view, views, strict=True))
    sigmas = np.sqrt(np.diag(np.linalg.inv(normal)) * variance / freedom)
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4")
    lens = Lens(
        camera_matrix=matrix, coefficients=np.ravel(terms), model="fisheye", image_size=size,
        sigma0=float(rms),
    )  # fmt: skip
    deviations = dict(zip(names, sigmas.tolist(), strict=True))
    return _LensFit(name="fisheye", lens=lens, deviations=deviations, per_view=np.array(per_view))


def _refuse_undetermined(matrix: FloatArray) -> None:
    """Refuse the camera matrix of an adjustment that ran away."""
    if not (np.isfinite(matrix).all() and (np.diag(matrix) > 0).all()):
        raise GeometryError(remark("calibration.undetermined"))


def _field_of_view(matrix: FloatArray, size: tuple[int, int]) -> float:
    """Return the diagonal angle of view. [deg]."""
    return float(2 * np.degrees(np.arctan(np.hypot(*size) / 2 / matrix[0, 0])))


def _coverage(views: Sequence[BoardView], size: tuple[int, int]) -> IntArray:
    """Return the number of board points per cell of the photo, top row first."""
    pixels = np.concatenate([view.pixels for view in views])
    columns, rows = COVERAGE_CELLS
    counts, _, _ = np.histogram2d(
        pixels[:, 1], pixels[:, 0], bins=(rows, columns), range=((0, size[1]), (0, size[0]))
    )
    return counts.astype(np.int64)


def _verdict(best: _LensFit, coverage: IntArray, photos: int) -> str:
    """Return the quality in words, with what would improve it."""
    advice = []
    share = float((coverage > 0).mean())
    corners = [coverage[0, 0], coverage[0, -1], coverage[-1, 0], coverage[-1, -1]]
    if share < 0.6 or sum(c == 0 for c in corners) > 2:
        advice.append(
            f"the board reaches only {share:.0%} of the photo and {sum(c > 0 for c in corners)} of "
            "4 corners: distortion there is extrapolated"
        )
    if photos < 8:
        advice.append(f"only {photos} photos: take ten or more")
    sigma_f = best.deviations.get("fx", 0.0) / best.lens.camera_matrix[0, 0]
    if sigma_f > 2e-3:
        advice.append(f"the principal distance is known to {sigma_f:.1%} only: tilt the board more")
    # A residual of a ten-thousandth of the width is what a rigid, flat board gives.
    coarse = best.rms > max(1.0, best.lens.image_size[0] / 4000)
    if coarse:
        advice.append(f"residuals of {best.rms:.2f} px: is the board flat, are photos sharp?")
    word = "poor" if coarse or share < 0.35 else "usable" if advice else "good"
    return word + (": " + "; ".join(advice) if advice else "")
