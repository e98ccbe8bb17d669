"""pyptv's parameters in one YAML file: what ptv.par and the files beside it say, by their names."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np

from multimedia.media import Sensor
from multimedia.openptv.openptv_files import ControlParameters
from multimedia.remarks import remark
from photocore.errors import InputError
from photocore.sections import FileSection
from photocore.textfile import read_text

#: What pyptv calls its files; a folder holds one for each run.
PATTERN = "parameters*.y*ml"
ENDINGS = (".yaml", ".yml")
#: The number of cameras, as older and newer versions call it.
_COUNTS = ("num_cams", "n_cam")
#: Of a sequence, the place of the frame's number; what stands for no file of its own.
_FRAME, _NO_FILE = re.compile(r"%0?\d*d.*"), re.compile(r"-*")


def read_yaml_parameters(path: Path) -> ControlParameters:
    """Read the parameters of a run of pyptv.

    Raises
    ------
    InputError
        Naming section and key of what is missing or not what it should be.
    """
    import yaml

    try:
        data = yaml.safe_load(read_text(path, "YAML file of pyptv"))
    except yaml.YAMLError as error:
        shown = " ".join(str(error).split())
        raise InputError(remark("openptv.bad_yaml", of=path, error=shown)) from None
    run = FileSection(data, str(path))
    key = next((key for key in _COUNTS if key in run), _COUNTS[0])
    count = run.number(key)
    if count not in range(1, 65):
        raise run.wrong(key, "1 to 64")
    control, body = run.section("ptv"), FileSection(run.get("cal_ori", {}), f"{path}, cal_ori")
    key = "img_cal_name" if "img_cal_name" in body else "img_cal"
    calibration = _names(body if key in body else control, key, int(count))
    sequence = FileSection(run.get("sequence", {}), f"{path}, sequence")
    named = "base_name" in sequence
    images = _names(
        sequence if named else control, "base_name" if named else "img_name", int(count)
    )
    orientations = _names(body, "img_ori", int(count)) if "img_ori" in body else ()
    if orientations:  # cameras behind a beam splitter have one image together
        calibration = tuple(
            name.removesuffix(".ori") if _NO_FILE.fullmatch(image) else image
            for image, name in zip(calibration, orientations, strict=True)
        )
    planes = FileSection(run.get("multi_planes", {}), f"{path}, multi_planes")
    sides = np.array([control.number("pix_x"), control.number("pix_y")])
    if not (sides > 0).all() or max(sides) > 0.2:
        raise control.wrong("pix_x", "the side of a pixel in mm, some 0.002 to 0.03")
    size = np.array([control.number("imx"), control.number("imy")])
    if not (size >= 1).all():
        raise control.wrong("imx" if size[0] < 1 else "imy", "the pixels of a side of the image")
    return ControlParameters(
        images=_bases(images),
        calibration_images=calibration,
        sensor=Sensor(
            width=int(size[0]), height=int(size[1]), pixel_size=sides, origin=size / 2,
        ),
        field=int(control.number("chfield")) if "chfield" in control else 0,
        indices=tuple(control.number(f"mmp_n{k}") for k in (1, 2, 3)),
        thickness=control.number("mmp_d"),
        orientations=orientations,
        body=str(body.get("fixp_name", "")),
        stems=_names(planes, "plane_name", 0) if "plane_name" in planes else (),
        manual=_manual(run, int(count)),
    )  # fmt: skip


def _names(section: FileSection, key: str, count: int) -> tuple[str, ...]:
    """Return names of files, one of each camera (pyptv keeps four, whatever the number), or all."""
    names: Any = section[key]
    if not isinstance(names, list) or len(names) < count:
        raise section.wrong(key, f"a list of {count} names of files, one of each camera")
    return tuple(map(str, names[: count or None]))


def _bases(images: tuple[str, ...]) -> tuple[str, ...]:
    """Return what the target files of each camera begin with: cam and its number, by pyptv's rule.

    The number is that of those in the names which differs most between the cameras.
    """
    bases = [_FRAME.sub("", name.replace("\\", "/")) for name in images]
    numbers = [re.findall(r"\d+", base) for base in bases]
    columns = list(zip(*numbers, strict=False))
    best = max(columns, key=lambda column: len(set(column)), default=())
    if len(set(best)) < len(bases):
        best = tuple(str(k) for k in range(1, len(bases) + 1))
    folder = Path(bases[0]).parent  # that of the image, where cameras share one
    return tuple(
        str((folder if _NO_FILE.fullmatch(base) else Path(base).parent) / f"cam{number}")
        for base, number in zip(bases, best, strict=True)
    )


def _manual(run: FileSection, count: int) -> tuple[tuple[list[str], Any], ...]:
    """Return ids and places of the points clicked by hand in each calibration image, if kept."""
    listed = FileSection(run.get("man_ori", {}), f"{run.where}, man_ori")
    numbers = _names(listed, "nr", 0) if "nr" in listed else ()
    clicked = FileSection(run.get("man_ori_coordinates") or {}, f"{run.where}, man_ori_coordinates")
    each = len(numbers) // count
    if not each or any(f"camera_{k}" not in clicked for k in range(count)):
        return ()
    parts = []
    for k in range(count):
        camera = clicked.section(f"camera_{k}")
        points = [camera.section(f"point_{j + 1}") for j in range(each)]
        places = np.array([[point.number("x"), point.number("y")] for point in points])
        parts.append((list(numbers[k * each : (k + 1) * each]), places))
    return tuple(parts)
