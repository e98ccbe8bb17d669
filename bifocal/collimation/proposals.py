"""The orientation that the program proposes by itself: its scale, and where its wall is."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict

import cv2
import numpy as np

from bifocal.collimation.records import GIVES_SCALE, SurveyState
from bifocal.model import RIVALS, ControlResidual, Pair, doubts_of
from bifocal.orientation import SiteMeasures, scaled_by_distance, scaled_by_length
from photocore.arrays import BoolArray, Float32Array, FloatArray
from photocore.jsonfile import read_object, write_object

#: Far distance of a pair whose scale is still to be given. [m]
NOMINAL = 10.0
#: Longer side of the picture in which the wall's outline is drawn, and how far a tie speaks. [px]
SHEET, REACH = 256, 7
#: Outlines of less than this share of the sheet are specks.
SPECK = 0.02
#: Where fewer points than this speak, by that picture's cell, nothing is known.
FAINT = 0.004


def measure_of(state: SurveyState) -> list[Any] | None:
    """Return what gives the scale of a pair that has none: a drawn length or one distance."""
    drawn, setup = state.scale.get(GIVES_SCALE), state.setup
    if drawn is not None:
        sigma = drawn.sigma or SiteMeasures().sigma_control
        return ["length", drawn.image, [list(end) for end in drawn.ends], drawn.length, sigma]
    for number in (1, 2):
        if distance := setup.get(f"d{number}"):
            sigma = setup.get(f"sigma_d{number}") or SiteMeasures().sigma
            return ["distance", number, distance, sigma]
    return None


class Report(TypedDict, total=False):
    """What the page shows of an orientation: of `align`, or of cameras at hand without a scale."""

    way: str
    distance1: float
    distance2: float
    standard_deviations: dict[str, float]
    focal_px: list[float]
    planes: list[dict[str, object]]
    control: list[ControlResidual]
    words: Sequence[str]
    remarks: Sequence[str]
    wall: list[list[list[float]]]
    causes: dict[str, str]
    free_scale: bool
    scale: list[Any] | None


class Proposal(TypedDict):
    """An orientation that waits to be accepted: the record that the journal keeps of it."""

    op: str
    pair: str
    report: Report


class ProposalAside(Proposal):
    """One that an exchange put aside, with the digest of its file."""

    sha256: str


def rescale(path: Path, report: Report, measure: list[Any] | None) -> Report:
    """Bring a proposed pair file to the scale of a measure and return the report of it."""
    if measure is None:
        return {**report, "scale": None}
    kind, number, *rest = measure
    pair = Pair.read(path)
    if kind == "length":
        ends, length, sigma = rest
        scaled = scaled_by_length(pair, number, np.array(ends), length, sigma=sigma)
    else:
        scaled = scaled_by_distance(pair, number, rest[0], sigma=rest[1])
    scaled.write(path, overwrite=True)
    setup, remarks = scaled.extra["setup"], report.get("remarks", ())
    stale, rivals = (doubts_of(RIVALS, texts) for texts in (remarks, setup["doubts"]))
    return {
        **report,
        "scale": measure,
        "distance1": scaled.image1.distance,
        "distance2": scaled.image2.distance,
        "standard_deviations": setup["standard_deviations"],
        "words": setup["words"],
        "planes": setup["planes"],
        "remarks": [next(iter(rivals), text) if text in stale else text for text in remarks],
    }


def accept_pair(proposed: Path, target: Path) -> None:
    """Move a proposed pair file, and the lens files it names, to its final name."""
    _write_as(target, proposed, move=True)
    proposed.unlink()


def copy_pair(path: Path, copy: Path) -> None:
    """Copy a pair file, and the lens files it names."""
    _write_as(copy, path, move=False)


def _write_as(target: Path, path: Path, *, move: bool) -> None:
    data = read_object(path, what="pair file")
    stem = target.name.removesuffix(".json").removesuffix(".pair")
    for number in (1, 2):
        photo = data.get(f"image{number}")
        if isinstance(photo, dict) and photo.get("lens"):
            name = f"{stem}.lens{number}.json"
            bring = shutil.move if move else shutil.copyfile
            bring(path.parent / photo["lens"], target.parent / name)
            photo["lens"] = name
    write_object(target, data, overwrite=True, as_is=True)
    Pair.read(target)


def discard_pair(proposed: Path) -> None:
    """Take away a proposed pair file that another one follows, with the lens files it names."""
    data = read_object(proposed, what="pair file")
    for number in (1, 2):
        photo = data.get(f"image{number}")
        if isinstance(photo, dict) and isinstance(photo.get("lens"), str):
            (proposed.parent / photo["lens"]).unlink(missing_ok=True)
    proposed.unlink(missing_ok=True)


def wall_sheet(pixels: FloatArray, wall: BoolArray, size: tuple[int, int]) -> list[Any]:
    """Return outlines of where a photo shows the wall: closed polygons. [px]

    Parameters
    ----------
    pixels : ndarray, shape (n, 2)
        Common points. [px]
    wall : ndarray of bool, shape (n,)
        Which of them lie on the wall.
    size : tuple of int
        Of the photo. [px]
    """
    step = max(size) / SHEET
    shape = (round(size[1] / step), round(size[0] / step))
    for_wall, against = (_votes(pixels[which] / step, shape) for which in (wall, ~wall))
    sheet = (for_wall > against).astype(np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (REACH, REACH))
    sheet = cv2.morphologyEx(sheet, cv2.MORPH_OPEN, kernel)
    outlines, _ = cv2.findContours(sheet, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_TC89_L1)
    return [
        (step * (outline[:, 0] + 0.5) - 0.5).round(1).tolist()
        for outline in outlines
        if cv2.contourArea(outline) > SPECK * sheet.sum()
    ]


def _votes(places: FloatArray, shape: tuple[int, int]) -> Float32Array:
    """Return how much speaks for each cell: every point for its neighbourhood."""
    votes = np.zeros(shape, dtype=np.float32)
    column, row = np.clip(places.astype(int), 0, np.array(shape)[::-1] - 1).T
    np.add.at(votes, (row, column), 1.0)
    around = cv2.GaussianBlur(votes, (0, 0), REACH / 2)
    return np.where(around > FAINT, around, 0.0).astype(np.float32)
