"""Projects of other programs that hold what cannot be."""

from __future__ import annotations

import json
from typing import Any

from tests.attack.edits import edited, swapped

INF = float("inf")
#: What other programs' projects cannot hold: file, keys or passage, value, culprit.
_PROJECT_KEYS: list[tuple[str, tuple[object, ...], object, str]] = [
    ("reconstruction.json", (), {}, "no project"),
    ("reconstruction.json", (1, "shots"), ..., "shots"),
    ("reconstruction.json", (1, "shots"), {}, "no reconstruction"),
    ("reconstruction.json", (1, "cameras", "v2 cam 0", "width"), 0, "above zero"),
    ("reconstruction.json", (1, "cameras", "v2 cam 0", "width"), "wide", "width"),
    ("reconstruction.json", (1, "cameras", "v2 cam 0", "width"), 299, "DSC_0.png.*--images"),
    ("reconstruction.json", (1, "cameras", "v2 cam 0", "projection_type"), "dual", "dual"),
    ("reconstruction.json", (1, "cameras", "v2 cam 0", "focal_x"), -1, "above zero"),
    ("reconstruction.json", (1, "cameras", "v2 cam 0", "k1"), INF, "k1"),
    ("reconstruction.json", (1, "shots", "DSC_1.png", "camera"), "x", "DSC_1.png"),
    ("reconstruction.json", (1, "shots", "DSC_1.png", "rotation"), [0, 1], "rotation"),
    ("reconstruction.json", (1, "shots", "DSC_1.png", "translation"), None, "translation"),
    ("cameras.sfm", ("views",), [], "no photo"),
    ("cameras.sfm", ("version",), "new", "version"),
    ("cameras.sfm", ("poses",), "", "no photo"),
    ("cameras.sfm", ("intrinsics", 0, "intrinsicId"), "7", "700"),
    ("cameras.sfm", ("intrinsics", 0, "distortionType"), "3declassicld", "3declassicld"),
    ("cameras.sfm", ("intrinsics", 0, "focalLength"), "0", "above zero"),
    ("cameras.sfm", ("intrinsics", 0, "principalPoint"), ["1"], "principalPoint"),
    ("cameras.sfm", ("poses", 0, "pose", "transform", "rotation", 0), "5", "rotation"),
    ("sfm_data.json", ("views", 0, "value"), 3, "ptr_wrapper"),
    ("sfm_data.json", ("extrinsics", 0, "value", "rotation"), [[1, 0, 0]] * 3, "rotation"),
    ("sfm_data.json", ("structure", 0, "value", "X"), [1, 2], "X"),
]
_PROJECT_TEXT: list[tuple[str, str, str, str]] = [
    ("text/cameras.txt", "FULL_OPENCV", "FOV", "FOV"),
    ("text/images.txt", "DSC_0.png", "", "images.txt, line 2"),
    ("text/images.txt", "DSC_3.png", "DSC_2.png", "two photos|twice|DSC_2"),
    ("cameras.xml", "<chunk>", "<lump>", "XML"),
    ("cameras.xml", 'type="frame"><res', 'type="spherical"><res', "spherical"),
    ("cameras.xml", "<f>", "<f>-", "<f>"),
    ("bundle.out", "5 ", "x ", "numbers of cameras"),
    ("bundle.out", "5 ", "9 ", "bundle.out"),
    ("list.txt", "lost.png 0 400", "", "list.txt"),
    ("list.txt", "DSC_0.png", "nowhere.png", "nowhere.png.*--images"),
]
_PICKS: list[tuple[str, str, str]] = [
    ("A,DSC_0.png", "A,DSC_9.png", "DSC_9"), ("A,DSC_0.png,", "A,DSC_0.png,x", "col"),
    ("photo", "plate", "photo, col, row"), ("A,DSC_0.png", "Q,DSC_0.png", "point Q"),
]  # fmt: skip


def projects() -> list[tuple[str, str, Any, str]]:
    """Return line, file, what it holds then, and what the refusal must name."""
    cases: list[tuple[str, str, Any, str]] = []
    line = "bifocal photos project/{} --points project.csv --wall A,B,C --out o.photos.json"
    for file, keys, value, culprit in _PROJECT_KEYS:
        name = f"project/{file}"
        cases.append((line.format(file), name, edited(name, *keys, value=value)
                      if keys else json.dumps(value), culprit))  # fmt: skip
    for file, old, new, culprit in _PROJECT_TEXT:
        name, read = f"project/{file}", "bundle.out" if file == "list.txt" else file
        cases.append((line.format(read), name, swapped(name, old, new), culprit))
    for old, new, culprit in _PICKS:
        edit = swapped("project.csv", old, new)
        cases.append((line.format("text"), "project.csv", edit, culprit))
    control = "bifocal photos project/text --points project.csv --control corners.csv --out o.json"
    for old, new, culprit in (("A,", "Z,", "2 control"), ("A,-1.5", "A,1.5", "misses|line")):
        cases.append((control, "corners.csv", swapped("corners.csv", old, new), culprit))
    return cases
