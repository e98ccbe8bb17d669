"""``multimedia targets``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from photocore.cli import print_result, progress_bar, text_table
from photocore.option_types import POSITIVE
from photocore.options import Argument, Typed, declared
from photocore.shared_options import JsonOption, OverwriteOption


@dataclass(frozen=True, kw_only=True)
class TargetsCommand:
    """The options of ``multimedia targets``, and examples.

    multimedia targets img/cam1.10001.tif img/cam2.10001.tif --out targets
    multimedia targets img/*.tif --project tank.toml --out targets --overwrite
    multimedia targets img/*.tif --threshold 25 --out targets.csv
    """

    images: Annotated[tuple[Path, ...], Argument()]
    out: Path | None = None
    """Folder for OpenPTV's _targets file of each image, or one table of all (.csv, .xlsx)."""
    threshold: Annotated[float | None, Typed(POSITIVE, "GREY")] = None
    """Least height above the light behind; by default what noise alone does not reach."""
    scale: Annotated[float, Typed(POSITIVE, "PX")] = 12.0
    """Over how many pixels the light behind the particles changes."""
    smallest: Annotated[float, Typed(POSITIVE, "PX")] = 1.0
    """Least diameter of a particle."""
    largest: Annotated[float, Typed(POSITIVE, "PX")] = 12.0
    """Greatest diameter of a particle."""
    project: Path | None = None
    """Count pixels in _targets files as the cameras of this project do (.toml)."""
    dark: bool = False
    """Particles are darker than what is behind them."""
    overwrite: OverwriteOption = False
    as_json: JsonOption = False


@declared(TargetsCommand)
def command(options: TargetsCommand) -> None:
    """Find the images of particles in IMAGES: where, how precisely, how large.

    The uneven light behind is taken off; what stands out of its noise is a particle. Particles
    that overlap are fitted together, and those hidden in the flank of another are looked for.
    Diameters are where the light has fallen to 1 / e^2. Tables count pixels from their centres;
    OpenPTV's files count, as OpenPTV does, from the corner of the image, half a pixel more;
    `--project` has them count as the cameras do that will read them.
    """
    from multimedia.targets import targets_of_images

    with progress_bar("Targets", quiet=options.as_json) as progress:
        images, remarks = targets_of_images(
            options.images,
            out=options.out,
            threshold=options.threshold,
            scale=options.scale,
            smallest=options.smallest,
            largest=options.largest,
            dark=options.dark,
            project=options.project,
            overwrite=options.overwrite,
            progress=progress,
        )
    listed = [
        {
            "image": one.image, "targets": len(one.targets), "file": one.file,
            "median_sigma_px": _median(one.targets.sigma),
            "median_diameter_px": _median(one.targets.diameter),
            "merged": int(one.targets.merged.sum()),
        }
        for one in images
    ]  # fmt: skip
    headings = ("image", "targets", "sigma [px]", "diameter [px]", "perhaps several")
    rows = [
        (
            one.image.name, len(one.targets), _shown(line["median_sigma_px"], 3),
            _shown(line["median_diameter_px"], 1), line["merged"],
        )
        for one, line in zip(images, listed, strict=True)
    ]  # fmt: skip
    lines = [text_table(headings, rows)]
    if options.out is not None:
        lines.append(f"Written: {options.out}")
    data = {"images": listed, "out": options.out}
    print_result(data, lines, as_json=options.as_json, remarks=remarks)


def _median(values: np.ndarray) -> float | None:
    return float(np.median(values)) if values.size else None


def _shown(value: object, digits: int) -> str:
    return f"{value:.{digits}f}" if isinstance(value, float) else "-"
