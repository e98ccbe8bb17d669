"""``multimedia openptv``."""

from __future__ import annotations

from pathlib import Path

import click

from photocore.cli import print_json, remark, text_table

EXAMPLE = """\b
Examples:
  multimedia openptv test_cavity --out cavity.toml
  multimedia openptv test_cavity --swap-indices --out cavity.toml
  multimedia openptv cavity.toml --export folder_for_openptv
"""


@click.command(short_help="Project file from an OpenPTV experiment folder.", epilog=EXAMPLE)
@click.argument("source", metavar="DIR", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path),
    help="Project file to write (.toml), tables beside it.  [default: name of the folder + .toml, "
    "here]",
)  # fmt: skip
@click.option("--swap-indices", is_flag=True, help="Exchange the indices of glass and water.")
@click.option(
    "--min-pixels", type=click.IntRange(min=1), default=15, show_default=True,
    help="Smaller targets are no dots of the calibration body [px].",
)  # fmt: skip
@click.option(
    "--radius", type=click.FloatRange(min=0, min_open=True), default=25.0, show_default=True,
    help="Farthest a target may lie from where the stored orientation expects it [px].",
)  # fmt: skip
@click.option(
    "--export", type=click.Path(path_type=Path),
    help="The other way: DIR is a project file; write it as an OpenPTV folder.",
)  # fmt: skip
@click.option("--overwrite", is_flag=True, help="Replace existing files.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def command(
    source: Path,
    out: Path | None,
    swap_indices: bool,
    min_pixels: int,
    radius: float,
    export: Path | None,
    overwrite: bool,
    as_json: bool,
) -> None:
    """Read an OpenPTV experiment folder DIR into a project file.

    Reads ptv.par, .ori, .addpar, _targets, the calibration body and the first rt_is frame; finds
    the control points among the targets of the calibration images, starting from the stored
    orientation; and says what looks wrong, such as interchanged indices of glass and water.
    """
    from multimedia.openptv.workflow import export_openptv, import_openptv

    if export is not None:
        written = export_openptv(source, export, overwrite=overwrite)
        remark(f"OpenPTV folder written to {export}")
        if as_json:
            print_json({"folder": export, "cameras": list(written.camera_names)})
        return
    target = out if out is not None else Path(f"{source.resolve().name}.toml")
    imported = import_openptv(
        source, out=target, overwrite=overwrite, swap_indices=swap_indices,
        least_pixels=min_pixels, radius=radius,
    )  # fmt: skip
    for line in imported.project.remarks:
        remark(f"Note: {line}")
    cameras = imported.project.cameras
    if as_json:
        print_json(
            {
                "project": target,
                "files": list(imported.files),
                "unit": imported.project.unit,
                "cameras": [
                    {"name": camera.name, "control_points": count, "media": media}
                    for camera, count, media in zip(
                        cameras, imported.matched, imported.project.media_of, strict=True
                    )
                ],
                "object_points": len(imported.project.object_points.ids),
                "particles": imported.particles,
                "remarks": list(imported.project.remarks),
            }
        )
        return
    total = len(imported.project.object_points.ids)
    rows = [
        (camera.name, media or "none", f"{count} of {total}")
        for camera, count, media in zip(
            cameras, imported.matched, imported.project.media_of, strict=True
        )
    ]
    click.echo(text_table(("camera", "looks through", "control points"), rows))
    if imported.particles:
        click.echo(f"{imported.particles} particles of the stored frame")
    for file in imported.files:
        click.echo(f"Written: {file}")
