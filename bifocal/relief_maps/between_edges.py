"""Doubtful relief smoothed between the edges of photo 1, where the photos do not object.

What flow could not validate is rarely wrong everywhere: it wanders about the surfaces beside it.
Those run on as far as photo 1 shows no edge. So relief is made as smooth as what is validated
allows, freely across an edge and stiffly within an even surface (Min et al. 2014, "Fast global
image smoothing based on weighted least squares", equations 4 and 11 to 13). What strays from its
surroundings weighs less from turn to turn.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.linalg.lapack import spttrf, spttrs

from bifocal.relief_maps.edges import PhotoFit, textured_share
from bifocal.relief_maps.frame import Frame, parallax_per_metre
from photocore.arrays import BoolArray, Float32Array


@dataclass(frozen=True, slots=True, kw_only=True)
class BetweenEdgesTuning:
    """Relief smoothed between edges. All were varied on street, balconies, arcade, tracery 5001."""

    #: Weight of smoothness against that of one validated pixel: its root is the reach. [px²]
    smoothness: float = 400.0
    #: Sweeps along rows and columns.
    sweeps: int = 2
    #: Difference of neighbours in photo 1 at which smoothness falls to a third. [grey levels]
    contrast: float = 3.0
    #: Blur of photo 1 before that. [px]
    blur: float = 0.7
    #: A step between validated neighbours of more parallax stays a step. [px]
    step: float = 1.0
    #: How often weights are renewed.
    turns: int = 2
    #: A pixel that strays so far from its surroundings weighs half. [px]
    #: Evidence: lines of castle_B bent by a far pixel 4.7 % before, 3.9 with 2 turns of 1 px, 4.1
    #: with 4 of 0.5; tears 174 m before, 184 and 196; street, painted and wrong 9.0, 8.7, 8.5 %.
    stray: float = 1.0
    #: A pixel that nothing validates weighs less by e for each such misfit above that of the
    #: validated ones. [grey levels]
    misfit: float = 2.0
    #: Its weight where the photos fit as well as at those.
    doubtful: float = 0.3
    #: And no less than this.
    least_weight: float = 0.003
    #: By how much worse the photos may fit at lower relief; higher relief hides what is beside it.
    #: [grey levels]
    #: Evidence: painted and wrong by 2 px, both 0.5 / 0.25 for higher / 0: tracery (14.2 before)
    #: 16.1, 15.4, 14.6 %; arcade (4.3) 3.0, 3.2, 3.5; gable (3.8) 2.5, 2.8, 3.7; street (9.0) 8.6,
    #: 8.4, 8.6.
    margin_down: float = 0.5
    #: The same at higher relief, where photo 1 has texture; where it has none, nothing.
    margin_up: float = 0.25
    #: What has less texture than this is plain: there everything fits.
    plain: float = 0.3
    #: Plain parts rise by no more than this share of d2.
    rise: float = 0.01


BETWEEN_EDGES = BetweenEdgesTuning()


def smoothed(
    frame: Frame, relief: Float32Array, support: BoolArray, swept: BoolArray
) -> Float32Array:
    """Return relief whose doubtful pixels run on smoothly from what is validated around them.

    Parameters
    ----------
    frame : Frame
    relief : ndarray of float32, shape (height, width)
        Of the pixels of photo 1. [m]
    support, swept : ndarray of bool
        Pixels to be believed, and those that a sweep found: they are left alone.
    """
    believed = support | swept
    if not believed.any():
        return relief
    per_relief = parallax_per_metre(frame)
    smoother = Smoother(*conductances(frame, relief * per_relief, believed))
    fit = PhotoFit(frame, 0.0)  # as precise photos: imprecise ones have the most to gain
    misfit = fit.smooth(fit.misfit(relief))
    over = np.maximum(misfit - np.median(misfit[believed]), 0)
    doubtful = BETWEEN_EDGES.doubtful * np.exp(-over / np.float32(BETWEEN_EDGES.misfit))
    weight = np.where(believed, 1, doubtful + BETWEEN_EDGES.least_weight).astype(np.float32)
    result = smoother.mean(relief, weight)
    for _ in range(BETWEEN_EDGES.turns):
        stray = (relief - result) * per_relief / np.float32(BETWEEN_EDGES.stray)
        result = smoother.mean(relief, weight / (1 + stray * stray))
    worse = fit.smooth(fit.misfit(result)) - misfit
    textured = textured_share(frame)
    up = result > relief
    raised = np.float32(BETWEEN_EDGES.margin_up) * textured
    fits = worse <= np.where(up, raised, np.float32(BETWEEN_EDGES.margin_down))
    far = result - relief > BETWEEN_EDGES.rise * frame.distances[1]
    anything = far & (textured < BETWEEN_EDGES.plain)
    return np.where(~believed & fits & ~anything, result, relief)


def conductances(
    frame: Frame, parallax: Float32Array, believed: BoolArray
) -> tuple[Float32Array, Float32Array]:
    """Return how stiffly pixels hold to the next one of their row, and of their column, 0 to 1.

    Parameters
    ----------
    frame : Frame
    parallax : ndarray of float32, shape (height, width)
        Of the pixels of photo 1. [px]
    believed : ndarray of bool
        A step between two such pixels stays a step.

    Returns
    -------
    rows, columns : ndarray of float32, shape (height, width)
        The last of a row or column holds to nothing.
    """
    blurred = cv2.GaussianBlur(frame.image1, (0, 0), BETWEEN_EDGES.blur).astype(np.float32)
    results = []
    for here, beyond in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        stiff = np.zeros_like(blurred)
        contrast = np.abs(blurred[beyond] - blurred[here])
        stiff[here] = np.exp(contrast / np.float32(-BETWEEN_EDGES.contrast))
        step = np.abs(parallax[beyond] - parallax[here]) > BETWEEN_EDGES.step
        stiff[here][step & believed[here] & believed[beyond]] = 0
        results.append(stiff)
    return results[0], results[1]


class Smoother:
    """Smooths pictures by rows and columns in turn.

    Parameters
    ----------
    rows, columns : ndarray of float32, shape (height, width)
        How stiffly pixels hold to the next one, 0 to 1 (`conductances`).
    """

    def __init__(self, rows: Float32Array, columns: Float32Array) -> None:
        self.rows, self.columns = rows, np.ascontiguousarray(columns.T)

    def mean(self, values: Float32Array, weight: Float32Array) -> Float32Array:
        """Return the smoothed mean of values with weights."""
        total, share = self.smooth(np.stack([values * weight, weight]))
        return total / np.maximum(share, np.float32(1e-12))

    def smooth(self, pictures: Float32Array) -> Float32Array:
        """Return pictures smoothed, shape (n, height, width)."""
        count, height, width = pictures.shape
        sweeps = BETWEEN_EDGES.sweeps
        for sweep in range(sweeps):
            # Weaker from sweep to sweep, lest stripes remain (Min et al. 2014, equation 13).
            share = 1.5 * BETWEEN_EDGES.smoothness * 4.0 ** (sweeps - 1 - sweep) / (4.0**sweeps - 1)
            # Factored anew each time: kept, the factors of all are the most of a stage's memory.
            flat = spttrs(*_factored(np.float32(share) * self.rows), pictures.reshape(count, -1).T)
            turned = flat[0].T.reshape(count, height, width).transpose(0, 2, 1)
            flat = spttrs(*_factored(np.float32(share) * self.columns), turned.reshape(count, -1).T)
            pictures = flat[0].T.reshape(count, width, height).transpose(0, 2, 1)
        return pictures


def _factored(stiff: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Return the factors of (1 + stiffness of both sides, -stiffness): all rows as one band."""
    hold = stiff.ravel()
    diagonal = 1 + hold
    diagonal[1:] += hold[:-1]
    diagonal, below, _ = spttrf(diagonal, -hold[:-1])
    return diagonal, below
