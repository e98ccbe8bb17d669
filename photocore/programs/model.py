"""What is read of another program's project."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from photocore.arrays import FloatArray
from photocore.camera import LensData, Pinhole
from photocore.errors import InputError
from photocore.remarks import remark


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
    shear : ndarray, shape (2, 2)
        Of the image axes, which a lens's camera matrix does not hold.
    """

    name: str
    lens: LensData
    rotation: FloatArray
    centre: FloatArray
    shear: FloatArray = np.eye(2)

    @property
    def camera(self) -> Pinhole:
        """The camera behind its lens."""
        matrix = self.lens.camera_matrix.copy()
        matrix[:2, :2] = matrix[:2, :2] @ self.shear
        return Pinhole(matrix, self.rotation, self.centre)


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


def chosen_part(
    sizes: Mapping[str, int], part: str | None, project: Path
) -> tuple[str, tuple[str, ...]]:
    """Return which part of a project to take, and what to say of the rest.

    Parts (models, chunks, components) do not share a frame: one is taken, the largest unless the
    user names one.

    Parameters
    ----------
    sizes : mapping of str to int
        How many photos each part holds.
    part : str, optional
        The one that the user wants.
    project : path

    Raises
    ------
    InputError
        If there is no such part.
    """
    listed = ", ".join(f"{name} ({size})" for name, size in sizes.items())
    if part is not None and part not in sizes:
        raise InputError(remark("programs.no_part", of=project, part=part, parts=listed))
    best = part or max(sizes, key=lambda name: sizes[name])
    if part is not None or len(sizes) == 1:
        return best, ()
    rest = ", ".join(f"{name} ({size})" for name, size in sizes.items() if name != best)
    return best, (remark("programs.parts", part=best, count=sizes[best], rest=rest),)
