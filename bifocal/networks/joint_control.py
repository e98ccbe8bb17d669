"""Control and check points of many pairs, joined by name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bifocal.model import Pair, WorldFrame
from bifocal.networks.joint_ties import SharedPoints
from bifocal.orientation import CONTROL, Control, read_control
from bifocal.remarks import remark
from photocore.arrays import BoolArray, FloatArray
from photocore.errors import InputError


def name_of(path: Path) -> str:
    """Return how a pair file is called in messages."""
    return path.name.removesuffix(".json").removesuffix(".pair")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NamedPositions:
    """Picked points of all pairs: names, coordinates, rays; ``check`` are compared only."""

    ids: tuple[str, ...]
    xyz: FloatArray
    sigma: FloatArray
    is_check: BoolArray
    shared: SharedPoints
    remarks: tuple[str, ...] = ()


def named_positions(
    paths: Sequence[Path],
    pairs: Sequence[Pair],
    *,
    control: Sequence[Path | None] = (),
    check: Sequence[Path | None] = (),
    sigma: float = 0.003,
    unit: str = "",
    columns: str | None = None,
) -> NamedPositions:
    """Return the points of all tables, one of each for every pair or none, joined by name.

    Raises
    ------
    InputError
        If tables are missing, or two place a point differently.
    """
    xyz: dict[str, tuple[FloatArray, FloatArray]] = {}
    checks: set[str] = set()
    rays: list[tuple[int, str, FloatArray]] = []
    remarks: list[str] = []
    for role, tables in (("control", control), ("check", check)):
        if tables and len(tables) != len(paths):
            raise InputError(
                f"--{role}: {len(tables)} tables for {len(paths)} pairs; give one for each, in "
                "their order, and none where a pair has no points."
            )
        for index, path in enumerate(tables):
            if path is None:
                continue
            # That a check point without relief is on the wall is nothing to check by.
            part = read_control(
                path, sigma=sigma, unit=unit, columns=columns,
                sigma_plane=None if role == "check" else CONTROL.sigma_on_wall,
                unnamed=f"{name_of(paths[index])}, {role} ",
                names=[photo.file for photo in pairs[index].as_given],
                frame=WorldFrame.of(pairs[index].extra),
            )  # fmt: skip
            if pairs[index].exchanged:
                part = part.exchanged()
            _add(part, path, index, xyz, rays)
            remarks += part.remarks
            checks |= set(part.ids) if role == "check" else set()
    ids = tuple(dict.fromkeys(name for _, name, _ in rays))
    number = {name: k for k, name in enumerate(ids)}
    blank = (np.full(3, np.nan), np.full(3, 1.0))
    return NamedPositions(
        ids=ids,
        xyz=np.array([xyz.get(name, blank)[0] for name in ids]).reshape(-1, 3),
        sigma=np.array([xyz.get(name, blank)[1] for name in ids]).reshape(-1, 3),
        is_check=np.array([name in checks for name in ids], dtype=bool),
        shared=SharedPoints(
            photo=np.array([photo for photo, _, _ in rays], dtype=np.int64),
            point=np.array([number[name] for _, name, _ in rays], dtype=np.int64),
            pixels=np.array([pixel for _, _, pixel in rays], dtype=float).reshape(-1, 2),
            count=len(ids),
        ),
        remarks=tuple(dict.fromkeys(remarks)),
    )


def _add(
    part: Control,
    path: Path,
    pair: int,
    xyz: dict[str, tuple[FloatArray, FloatArray]],
    rays: list[tuple[int, str, FloatArray]],
) -> None:
    """Add a table's points; refuse one that two tables place differently."""
    for k, name in enumerate(part.ids):
        if part.positioned[k]:
            before = xyz.get(name)
            if before is not None and np.nanmax(np.abs(before[0] - part.xyz[k])) > 1e-6:
                raise InputError(remark("joint.other_coordinates", of=path, name=name))
            if before is None or np.isnan(before[0][2]):
                xyz[name] = part.xyz[k], part.sigma[k]
        for side, pixels in enumerate((part.pixels1, part.pixels2)):
            if np.isfinite(pixels[k]).all():
                rays.append((2 * pair + side, name, pixels[k]))
