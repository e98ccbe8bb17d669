"""What is read of another program's project."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from photocore.arrays import FloatArray
from photocore.camera.lensformats import LensData


class ForeignView(NamedTuple):
    """A photo with its place, in OpenCV's conventions: x right, y down, z forwards.

    Attributes
    ----------
    name : str
        The photo as its project names it, with or without folders.
    lens : LensData
    rotation : ndarray, shape (3, 3)
        Camera from the project's frame.
    centre : ndarray, shape (3,)
        Projection centre. [unit of the project]
    """

    name: str
    lens: LensData
    rotation: FloatArray
    centre: FloatArray


class ForeignProject(NamedTuple):
    """Photos and sparse points of a project, in its own frame and unit.

    Attributes
    ----------
    program : str
        Whose it is.
    views : tuple of ForeignView
    points : ndarray, shape (n, 3)
        None where the file holds no points.
    metres : str
        What makes its lengths metres, and its Z upright; empty where nothing does.
    remarks : tuple of str
        What was left out.
    """

    program: str
    views: tuple[ForeignView, ...]
    points: FloatArray = np.empty((0, 3))
    metres: str = ""
    remarks: tuple[str, ...] = ()
