"""``bifocal undistort``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from photocore.cli import print_result, progress_bar
from photocore.options import declared


@declared
def command(
    images: tuple[Path, ...], lens: str, out_dir: Path | None, as_json: bool, **options: Any
) -> None:
    """Write each photo without lens distortion as NAME_undistorted, same size and scale."""
    from bifocal.calibration.workflow import undistort_images

    if out_dir is not None and not out_dir.is_dir():
        raise click.UsageError(f"--out-dir: the folder {out_dir} does not exist.")
    with progress_bar("Undistorting", quiet=as_json) as progress:
        written, notes = undistort_images(
            images, lens, folder=out_dir, progress=progress, **options
        )
    data = {"written": written, "remarks": notes}
    print_result(data, map(str, written), as_json=as_json, remarks=notes)
