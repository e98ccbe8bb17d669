"""Boards in photos: corners of a chessboard or ChArUco board, centres of a grid of circles."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from photocore.arrays import ByteArray, FloatArray
from photocore.camera.charuco import BoardView, detect_charuco
from photocore.errors import InputError
from photocore.remarks import remark

#: Half width of the corner refinement window [px]; smaller where squares are smaller.
CORNER_WINDOW = 11
#: Greys that span less of 255 are stretched where nothing was found.
_DULL = 160
PATTERNS = ("chessboard", "circles", "asymmetric-circles", "charuco")
#: Fewer corners each way are not told from the pattern of a window. OpenCV takes no fewer.
LEAST_CORNERS = 3


def checked_board(pattern: str, board: tuple[int, int] | None) -> tuple[int, int]:
    """Return the size of a board of a known pattern.

    Raises
    ------
    InputError
        If the pattern is none of `PATTERNS`, or the size is missing or too small.
    """
    if pattern not in PATTERNS:
        raise InputError(f"pattern: {pattern!r} is not one of {', '.join(PATTERNS)}.")
    if board is None:
        raise InputError(f"give the size of the {pattern} board, e.g. --board 7x5.")
    if min(board) < LEAST_CORNERS:
        raise InputError(
            f"board: {board[0]}x{board[1]} is too small; at least {LEAST_CORNERS} each way are "
            "needed. Count the inner corners of a chessboard, not its squares."
        )
    return board


def detect_board(
    image: ByteArray, name: str, *, pattern: str, size: tuple[int, int]
) -> BoardView | None:
    """Return the board's points in a grey photo; None when it is not found whole.

    Parameters
    ----------
    image : ndarray, shape (h, w), uint8
    name : str
        Of the photo.
    pattern : str
        One of `PATTERNS`.
    size : tuple of int
        Inner corners (chessboard), circles, or squares (ChArUco) across and up.

    Notes
    -----
    Where nothing is found, the photo is searched once more with its greys stretched: water takes
    the contrast that thresholds ask for.
    """
    view = _detected(image, name, pattern, size)
    if view is None:
        low, high = np.percentile(image, (1, 99))
        if _DULL > high - low > 0:
            scale = 255.0 / float(high - low)
            bright = cv2.convertScaleAbs(cv2.subtract(image, float(low)), alpha=scale)
            view = _detected(np.asarray(bright, dtype=np.uint8), name, pattern, size)
    return view


def _detected(image: ByteArray, name: str, pattern: str, size: tuple[int, int]) -> BoardView | None:
    """Return the board's points; None when it is not found whole."""
    columns, rows = size
    if pattern == "charuco":
        return detect_charuco(image, name, size)
    if pattern == "chessboard":
        flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
        is_found, corners = cv2.findChessboardCorners(_reduced(image)[0], size, flags=flags)
        if not is_found:
            return None
        corners = (corners.reshape(-1, 2) + 0.5) * _reduced(image)[1] - 0.5
        corners = _refined(image, corners.astype(np.float32), size)
        board = np.mgrid[0:columns, 0:rows].T.reshape(-1, 2)
    else:
        asymmetric = pattern == "asymmetric-circles"
        flags = cv2.CALIB_CB_ASYMMETRIC_GRID if asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
        corners = _circles(image, size, flags)
        if corners is None:
            return None
        board = np.mgrid[0:columns, 0:rows].T.reshape(-1, 2)
        if asymmetric:
            board = np.column_stack([2 * board[:, 0] + board[:, 1] % 2, board[:, 1]])
    flat = np.column_stack([board, np.zeros(len(board))]).astype(np.float64)
    return BoardView(name=name, board=flat, pixels=np.asarray(corners, float).reshape(-1, 2))


def _circles(image: ByteArray, size: tuple[int, int], flags: int) -> Any:
    """Return the centres of a grid of circles, None if they are not all found."""
    large = cv2.SimpleBlobDetector.Params()
    # By default blobs of more than 5000 px are none; a circle may fill its share of the photo.
    large.maxArea = image.size / (size[0] * size[1])
    for blobs in (cv2.SimpleBlobDetector.create(), cv2.SimpleBlobDetector.create(large)):
        for more in (0, cv2.CALIB_CB_CLUSTERING):
            is_found, corners = cv2.findCirclesGrid(
                image, size, flags=flags | more, blobDetector=blobs
            )
            if is_found:
                return corners
    return None


def find_board_size(images: Sequence[ByteArray]) -> tuple[int, int]:
    """Return the inner corners of the chessboard that most photos show.

    Raises
    ------
    InputError
        If no two photos agree.
    """
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_EXHAUSTIVE
    flags |= cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
    votes: Counter[tuple[int, int]] = Counter()
    for image in images:
        is_found, _, meta = cv2.findChessboardCornersSBWithMeta(_reduced(image)[0], (3, 3), flags)
        if is_found:
            rows, columns = sorted(meta.shape)
            votes[(int(columns), int(rows))] += 1
    if not votes or votes.most_common(1)[0][1] < min(2, len(images)):
        raise InputError(remark("boards.none"))
    return votes.most_common(1)[0][0]


def _reduced(image: ByteArray) -> tuple[ByteArray, float]:
    """Return a copy of at most 2000 px for the search, and the factor back."""
    factor = max(1.0, max(image.shape[:2]) / 2000)
    if factor == 1.0:
        return image, 1.0
    small = cv2.resize(image, None, fx=1 / factor, fy=1 / factor, interpolation=cv2.INTER_AREA)
    return small, factor


def _refined(image: ByteArray, corners: Any, size: tuple[int, int]) -> FloatArray:
    """Return corners refined in a window that reaches half-way to the usual neighbour."""
    grid = corners.reshape(size[1], size[0], 2)
    gaps = [np.median(np.linalg.norm(np.diff(grid, axis=axis), axis=2)) for axis in (0, 1)]
    window = int(np.clip(min(gaps) / 2 - 1, 2, CORNER_WINDOW))
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-4)
    refined = cv2.cornerSubPix(
        image, np.array(corners[:, None], order="C"), (window, window), (-1, -1), criteria
    )
    return np.asarray(refined, dtype=np.float64).reshape(-1, 2)
