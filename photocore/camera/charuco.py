"""ChArUco boards of any dictionary and layout, by the markers that a photo shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import cv2
import numpy as np

from photocore.arrays import ByteArray, FloatArray, IntArray

#: Dictionaries, those of which random patterns hold markers at last; smaller ones of their kind
#: are their beginnings.
DICTIONARIES = (
    "4X4_250", "5X5_250", "6X6_250", "7X7_250", "ARUCO_ORIGINAL", "APRILTAG_36h11",
    "APRILTAG_25h9", "APRILTAG_36h10", "ARUCO_MIP_36h12", "APRILTAG_16h5",
)  # fmt: skip
#: Corners and markers of a board that tell it.
LEAST_CORNERS, LEAST_MARKERS = 6, 4
#: Distance of markers from their places on a board [squares] beyond which it is another: lenses
#: and windows bend a board by a few hundredths, of a wrong layout half the markers are one off.
_ASTRAY = 0.25
#: Share of a square that a marker's side may be, and is usually.
_SIDES, _USUAL = (0.3, 0.95), 0.7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BoardView:
    """The board as one photo shows it.

    Attributes
    ----------
    name : str
        Of the photo.
    board : ndarray, shape (n, 3)
        Points on the board, z = 0. [squares]
    pixels : ndarray, shape (n, 2)
        Where they are seen. [px]
    layout : str
        Dictionary and layout of a ChArUco board.
    """

    name: str
    board: FloatArray
    pixels: FloatArray
    layout: str = ""


class Markers(NamedTuple):
    """Markers of one dictionary in a photo: corners (n, 4, 2) [px] and numbers (n,)."""

    dictionary: str
    corners: FloatArray
    numbers: IntArray


def seen_markers(image: ByteArray, squares: int) -> Iterator[Markers]:
    """Yield the markers of each dictionary that a photo shows, for boards of so many squares."""
    for name in DICTIONARIES:
        large = name.replace("_250", "_1000") if squares > 500 else name
        corners, numbers, _ = cv2.aruco.ArucoDetector(_dictionary(large)).detectMarkers(image)
        if numbers is not None and len(numbers) >= LEAST_MARKERS:
            places = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)
            yield Markers(large, places, np.ravel(numbers).astype(np.int64))


def detect_charuco(image: ByteArray, name: str, size: tuple[int, int]) -> BoardView | None:
    """Return the ChArUco corners seen, of the dictionary and layout that fit; at least six.

    Parameters
    ----------
    image : ndarray, shape (h, w), uint8
    name : str
        Of the photo.
    size : tuple of int
        Squares across and up.

    Notes
    -----
    With an even number of rows, boards of OpenCV before 4.6 and of other generators begin with a
    white square where newer ones begin with a black one: all markers are one square off, to the
    right and to the left in turn. Which it is, the markers' places tell.
    """
    best: BoardView | None = None
    for markers in seen_markers(image, size[0] * size[1]):
        for legacy in (False, True)[: 2 - size[1] % 2]:
            side = _marker_side(markers, _board(markers.dictionary, size, _USUAL, legacy))
            if side is None:
                continue
            board = _board(markers.dictionary, size, side, legacy)
            corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(image)
            if ids is None or len(ids) < max(LEAST_CORNERS, 0 if best is None else len(best.board)):
                continue
            points = np.asarray(board.getChessboardCorners(), dtype=np.float64)[np.ravel(ids)]
            pixels = np.asarray(corners, float).reshape(-1, 2)
            layout = markers.dictionary + (", legacy layout" if legacy else "")
            best = BoardView(name=name, board=points, pixels=pixels, layout=layout)
        if best is not None and len(best.board) > 0.5 * (size[0] - 1) * (size[1] - 1):
            break
    return best


def _dictionary(name: str) -> Any:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))


def _board(dictionary: str, size: tuple[int, int], side: float, legacy: bool) -> Any:
    board = cv2.aruco.CharucoBoard(size, 1.0, side, _dictionary(dictionary))
    board.setLegacyPattern(legacy)
    return board


def _marker_side(markers: Markers, board: Any) -> float | None:
    """Return the side of the markers [squares]; None where they do not lie as on the board."""
    centres = {
        int(number): np.mean(corners, axis=0)[:2]
        for number, corners in zip(np.ravel(board.getIds()), board.getObjPoints(), strict=True)
    }
    some = [k for k, number in enumerate(markers.numbers.tolist()) if number in centres]
    if len(some) < LEAST_MARKERS:
        return None
    places = np.array([centres[int(n)] for n in markers.numbers[some]], dtype=np.float64)
    seen = markers.corners[some]
    change, inside = cv2.findHomography(seen.mean(axis=1), places, cv2.RANSAC, _ASTRAY)
    if change is None or int(inside.sum()) < max(LEAST_MARKERS, 0.75 * len(some)):
        return None
    mapped = cv2.perspectiveTransform(seen.reshape(1, -1, 2), change).reshape(-1, 4, 2)
    side = float(np.median(np.linalg.norm(mapped - np.roll(mapped, 1, axis=1), axis=2)))
    return side if _SIDES[0] < side < _SIDES[1] else None
