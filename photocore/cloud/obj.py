"""Triangle meshes in Wavefront OBJ files: vertices and faces; everything else is passed over."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from photocore.arrays import FloatArray, IntArray
from photocore.errors import LARGEST, InputError
from photocore.textfile import read_text


def read_obj_mesh(path: Path) -> tuple[FloatArray, IntArray]:
    """Return vertices (n, 3) and triangles (m, 3), from 0, of an OBJ mesh.

    Faces of more corners are taken as fans of triangles.

    Raises
    ------
    InputError
        Naming the line that is damaged, or if the file has no faces.
    """
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(read_text(path, "mesh", form=" (OBJ)").splitlines(), start=1):
        kind, *words = line.split() or [""]
        try:
            if kind == "v":
                vertices.append([float(word) for word in words[:3]])
                if len(words) < 3 or not all(abs(v) <= LARGEST for v in vertices[-1]):
                    raise ValueError
            elif kind == "f":
                # A corner is vertex/texture/normal; negative numbers count from the last vertex.
                corners = [int(word.split("/")[0]) for word in words]
                corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
                if len(corners) < 3 or not all(0 <= c < len(vertices) for c in corners):
                    raise ValueError
                triangles += [(corners[0], b, c) for b, c in pairwise(corners[1:])]
        except ValueError:
            raise InputError(
                f"{path}, line {number}: {line.strip()!r:.60} is no vertex or face of the mesh."
            ) from None
    if not triangles:
        raise InputError(f"{path}: holds no faces; a water surface needs triangles.")
    return np.array(vertices), np.array(triangles, dtype=np.int64)
