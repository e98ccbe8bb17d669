"""What each tuned number of dense relief does: errors with half of it and twice it, one at a time.

    python benchmarks/relief_tuning.py [STAGE ...]

Rendered scenes of `relief_ablation` that nothing was tuned on, small enough for some hundred runs
each: half an hour for all numbers on one core. A dot is no change, neither is a line left out.
"""

from __future__ import annotations

import importlib
import pkgutil
import sys
from contextlib import ExitStack
from dataclasses import fields, is_dataclass, replace
from unittest.mock import patch

import cv2

from benchmarks.relief_ablation import FIGURES, figures, shots
from bifocal import relief_maps
from bifocal.relief_maps import flow

#: Size of the photos, and how much coarser their pixels are than those of the ablation.
SCENES = {
    "facade": ((768, 512), 2),
    "plaster facade": ((768, 512), 2),
    "church": ((768, 512), 2),
    "plaster balcony": ((900, 600), 1),
}
#: Stages whose numbers change what is matched, or the frame it is matched in.
UPSTREAM = {"COARSE", "EXPOSURE", "FLOW", "FRAME", "LIMITS", "REFINEMENT", "SEED"}
MODULES = [
    importlib.import_module(f"bifocal.relief_maps.{module.name}")
    for module in pkgutil.iter_modules(relief_maps.__path__)
]
#: All tuned numbers, a stage each.
STAGES = {
    stage: numbers
    for module in MODULES
    for stage, numbers in vars(module).items()
    if stage.isupper() and is_dataclass(numbers) and type(numbers).__name__.endswith("Tuning")
}


def put(stage: str, numbers: object) -> ExitStack:
    """Give a stage other numbers in all modules, for a while."""
    stack = ExitStack()
    for module in MODULES:
        if hasattr(module, stage):
            stack.enter_context(patch.object(module, stage, numbers))
    return stack


def scaled(value, factor):
    """Return a number, or numbers, times a factor; integers stay so, odd ones odd."""
    if isinstance(value, tuple):
        return tuple(scaled(part, factor) for part in value)
    if isinstance(value, int):
        return max(1, round(value * factor)) | (value % 2 if value > 1 else 0)
    return value * factor


def sweep(name: str, stages: list[str]) -> None:
    """Print how the figures of a scene change with each number of the stages."""
    shot, measure, kept = shots(name, *SCENES[name]), flow.measure, {}

    def once(frame, coarse, **options):
        key = frame.grid.shape
        if key not in kept:
            kept[key] = measure(frame, coarse, **options)
        return kept[key]

    with patch.object(flow, "measure", once):
        base = figures(shot)
    print(f"\n{name:34s}" + " ".join(f"{heading:>11s}" for heading in FIGURES))
    print(" " * 34 + " ".join(f"{value:11.3f}" for value in base.values()))
    for stage in stages or STAGES:
        numbers = STAGES[stage]
        for number in (field.name for field in fields(numbers)):
            for factor in (0.5, 2.0):
                measured = measure if stage in UPSTREAM else once
                label = f"  {stage}.{number} x {factor:g}"
                changed = replace(numbers, **{number: scaled(getattr(numbers, number), factor)})
                with put(stage, changed), patch.object(flow, "measure", measured):
                    try:
                        found = figures(shot)
                    except (ValueError, cv2.error) as error:
                        print(f"{label:34s}cannot be: {str(error).splitlines()[0]}")
                        continue
                changes = [found[heading] - base[heading] for heading in FIGURES]
                if any(changes):
                    cells = (f"{c:+11.3f}" if abs(c) >= 5e-4 else f"{'.':>11s}" for c in changes)
                    print(f"{label:34s}" + " ".join(cells), flush=True)


if __name__ == "__main__":
    cv2.setNumThreads(1)
    for scene in SCENES:
        sweep(scene, sys.argv[1:])
