"""Photos of a board in, the calibrated lens out: in memory, no files."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np
from numpy.typing import NDArray

from bifocal.calibration.board_calibration import Calibration, lens_of_views
from bifocal.model import as_grey
from photocore.arrays import ByteArray
from photocore.camera import BoardView, checked_board, detect_board, find_board_size
from photocore.cli import Progress, no_progress
from photocore.errors import InputError

#: Photos in which the size of the chessboard is sought.
_SAMPLE = 8


def calibrate(
    images: Iterable[NDArray[np.generic]],
    *,
    pattern: str = "chessboard",
    board: tuple[int, int] | None = None,
    model: str = "auto",
    names: Sequence[str] = (),
    progress: Progress = no_progress,
) -> Calibration:
    """Calibrate a lens from photos of a flat board.

    Parameters
    ----------
    images : iterable of ndarray of uint8 or uint16, shape (height, width[, 3])
        At least three photos of one size, better ten, of one lens at one focus and zoom mark; the
        board tilted differently and in every corner. Taken one at a time.
    pattern : str
        ``chessboard``, ``circles``, ``asymmetric-circles`` or ``charuco``.
    board : (int, int), optional
        Inner corners of a chessboard, circles of a grid, squares of a ChArUco board, across and
        up; a chessboard is recognised by itself.
    model : str
        ``auto`` takes distortion terms in while an F test at 1 % asks for them; or ``k1``,
        ``k1k2``, ``k1k2p``, ``k1k2pk3``, ``fisheye``.
    names : sequence of str, optional
        What to call the photos, one for each; by default ``photo 1`` ...
    progress : callable
        Told how far the work is.

    Returns
    -------
    Calibration
        ``.lens``, a `Lens`, with standard deviations, RMS of each photo [px], coverage, verdict,
        and the photos that were left out.

    Raises
    ------
    InputError
        If a photo or an option is unusable, the photos differ in size, or the board is found in
        fewer than three.
    GeometryError
        If the photos do not determine the lens (all of one tilt).

    Notes
    -----
    Principal distance, principal point, distortion and the pose of every photo are adjusted
    together so that the squared residuals of the board's points, in pixels, are least.

    Examples
    --------
    Three photos of a board, drawn with a principal distance of 400 px:

    >>> import cv2
    >>> black = np.kron(np.indices((7, 8)).sum(axis=0) % 2, np.ones((20, 20))) * 255
    >>> paper = np.pad(255 - black, 20, constant_values=255).astype(np.uint8)
    >>> camera = np.array([[400.0, 0, 159.5], [0, 400.0, 119.5], [0, 0, 1]])
    >>> def photo(tilt):
    ...     turn, _ = cv2.Rodrigues(np.array(tilt))
    ...     pose = np.column_stack([turn[:, :2], -turn @ [99.5, 89.5, 0] + [0, 0, 450.0]])
    ...     return cv2.warpPerspective(paper, camera @ pose, (320, 240), borderValue=255)
    >>> photos = [photo(tilt) for tilt in ([0.5, 0, 0], [0, 0.5, 0.1], [-0.4, -0.4, 0])]
    >>> lens = calibrate(photos, board=(7, 6), model="k1").lens
    >>> bool(abs(lens.camera_matrix[0, 0] - 400) < 4)
    True
    """
    if board is not None or pattern != "chessboard":
        checked_board(pattern, board)
    photos = _named_photos(images, names)
    if board is None:
        sample = list(islice(photos, _SAMPLE))
        board = find_board_size([grey for _, grey in sample])
        photos = chain(sample, photos)
    views: list[BoardView] = []
    without: list[str] = []
    sizes: set[tuple[int, int]] = set()
    for number, (name, grey) in enumerate(photos):
        progress(number, max(len(names), number + 1), f"searching {name}")
        sizes.add((grey.shape[1], grey.shape[0]))
        if len(sizes) > 1:
            raise InputError(f"{name}: is of another size than the photos before it.")
        view = detect_board(grey, name, pattern=pattern, size=board)
        if view is None:
            without.append(name)
        else:
            views.append(view)
    if without and not views:
        raise InputError(
            f"{', '.join(without[:3])}{', ...' if without[3:] else ''}: the board was not found in "
            "any photo. Check --pattern and --board; the whole board must be seen, sharp and lit "
            "evenly."
        )
    progress(1, 1, "adjusting")
    calibration = lens_of_views(views, next(iter(sizes), (0, 0)), model=model)
    return replace(calibration, without_board=tuple(without))


def _named_photos(
    images: Iterable[NDArray[np.generic]], names: Sequence[str]
) -> Iterator[tuple[str, ByteArray]]:
    """Yield name and grey values of every photo."""
    for number, image in enumerate(images, start=1):
        if names and number > len(names):
            raise InputError(f"names: {len(names)} names for {number} or more photos.")
        name = names[number - 1] if names else f"photo {number}"
        yield name, as_grey(image, name)
