"""``multimedia particles``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import click

from multimedia.cli.tables import ProjectOption
from photocore.cli import print_result, text_table
from photocore.option_types import POSITIVE
from photocore.options import Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class ParticlesCommand:
    r"""The options of ``multimedia particles``, and examples.

    multimedia particles tank.toml --targets img/cam1.10001_targets \
      --targets img/cam2.10001_targets --targets img/cam3.10001_targets \
      --targets img/cam4.10001_targets --out res/rt_is.10001
    """

    project: ProjectOption
    targets: tuple[Path, ...]
    """OpenPTV's _targets file of a camera; once per camera, in the order of PROJECT."""
    tolerance: Annotated[float, Typed(POSITIVE, "PX")] = 2.0
    """Farthest a target may lie from where its particle is seen [px]."""
    fewest: Annotated[int, Typed(click.IntRange(min=2))] = 3
    """Cameras that must have seen a particle; with 2, many are by chance."""
    out: Path | None = None
    """Write rt_is.FRAME as OpenPTV does, or .csv or .xlsx."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(ParticlesCommand)
def command(options: ParticlesCommand) -> None:
    """Find the particles of one frame among the targets of all cameras of PROJECT, a .toml file.

    Targets belong together where their rays through glass and water meet: along each other's
    epipolar curves. Those seen by most cameras are taken first, the best fitting before others,
    each target once. Positions are in the unit of the project, in rt_is in mm.

    How many come by chance is counted on the same targets displaced against each other; what
    cannot be told from that is refused.
    """
    from multimedia.openptv import find_particles

    particles = find_particles(
        options.project,
        options.targets,
        tolerance=options.tolerance,
        fewest=options.fewest,
        out=options.out,
        overwrite=options.overwrite,
    )
    names = particles.project.camera_names
    median = (
        float(sorted(particles.misfit)[len(particles.misfit) // 2])
        if len(particles.misfit)
        else None
    )
    data = {
        "particles": [
            {"X": x, "Y": y, "Z": z, "targets": row, "misfit_px": miss}
            for (x, y, z), row, miss in zip(
                particles.xyz.tolist(), particles.numbers.tolist(), particles.misfit.tolist(),
                strict=True
            )
        ],
        "unit": particles.project.unit, "median_misfit_px": median, "out": options.out,
        "by_chance_at_most": float(particles.chance.sum()),
    }  # fmt: skip
    rows = [
        (f"seen by {k}", int(particles.seen_by[k]), f"{particles.chance[k]:.3g}")
        for k in range(len(names), 1, -1) if particles.seen_by[k]
    ]  # fmt: skip
    lines = [text_table(("particles", "number", "by chance at most"), rows)]
    for k, (name, count) in enumerate(zip(names, particles.targets, strict=True)):
        lines.append(f"{name}: {int((particles.numbers[:, k] >= 0).sum())} of {count} targets used")
    if median is not None:
        lines.append(f"median misfit {median:.2f} px")
    print_result(data, lines, as_json=options.as_json, remarks=particles.remarks)
