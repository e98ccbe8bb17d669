"""Cameras written for OpenPTV see what ours see: its formulas written out, no code shared."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    Brown,
    Convention,
    FlatInterface,
    ImagePoints,
    InputError,
    Layers,
    ObjectPoints,
    Project,
    intersect,
    project,
    read_experiment,
    read_project,
    write_experiment,
    write_project,
)
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import SENSOR, cameras, control

HALF = np.array([SENSOR.width, SENSOR.height]) / 2
POINTS = control(40)
LENS = Brown(k1=2e-5, k2=-3e-8, p1=1e-5, p2=-2e-5)


def openptv_pixels(folder: Path, number: int, points: np.ndarray) -> np.ndarray:
    """Return the pixels OpenPTV gives in air: collinearity, addpar, pixel (liboptv's trafo.c)."""
    par = (folder / "parameters" / "ptv.par").read_text().split()
    count = int(par[0])
    width, height, pitch_x, pitch_y = (float(v) for v in par[4 + 2 * count : 8 + 2 * count])
    base = folder / par[2 + 2 * number]
    ori = [float(v) for v in Path(f"{base}.ori").read_text().split()]
    k1, k2, k3, p1, p2, scx, she = (float(v) for v in Path(f"{base}.addpar").read_text().split())
    m, (xh, yh, c) = np.reshape(ori[6:15], (3, 3)), ori[15:18]
    u, v, w = ((points - ori[:3]) @ m).T
    x, y = xh - c * u / w, yh - c * v / w
    r2 = x * x + y * y
    radial = k1 * r2 + k2 * r2**2 + k3 * r2**3
    x1 = x + x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    y1 = y + y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    x2, y2 = scx * (x1 - np.sin(she) * y1), scx * np.cos(she) * y1
    return np.column_stack([width / 2 + x2 / pitch_x, height / 2 - y2 / pitch_y])


def written(tmp_path: Path, views, **fields) -> tuple[str, ...]:
    return write_experiment(tmp_path / "exp", Project(cameras=tuple(views), **fields))


def misses(tmp_path: Path, views) -> float:
    return max(
        np.abs(
            openptv_pixels(tmp_path / "exp", k, POINTS)
            - camera.sensor.pixel_from_image(project(camera, POINTS))
        ).max()
        for k, camera in enumerate(views)
    )


def lensed(point=(0.0, 0.0), origin=HALF, **change) -> list:
    return [
        replace(
            camera, distortion=replace(LENS, **change), principal_point=point,
            sensor=replace(SENSOR, origin=origin),
        )
        for camera in cameras()
    ]  # fmt: skip


@pytest.mark.parametrize(
    "views",
    [
        lensed(),
        lensed(scale=1.0007),
        lensed(scale=0.998, shear=3e-4),
        lensed(point=(0.2, -0.1), convention=Convention.OPENPTV, scale=1.002, shear=-1e-4),
        [replace(c, distortion=Brown(scale=1.001)) for c in lensed((0.3, 0.1), (640.0, 500.0))],
    ],
    ids=["brown", "scale", "scale and shear", "openptv", "no distortion, origin elsewhere"],
)
def test_what_openptv_models_alike_is_seen_at_the_same_pixel(tmp_path, views):
    assert written(tmp_path, views, unit="mm") == ()
    assert misses(tmp_path, views) < 1e-9


@pytest.mark.parametrize(
    ("views", "limit"),
    [
        (cameras(), 0.005),
        (lensed((0.4, -0.3)), 0.05),
        (lensed((0.1, 0.1), convention=Convention.PHOTOGRAMMETRIC, scale=1.0003), 0.02),
        ([replace(c, distortion=replace(LENS, scale=1 + 1e-4 * k))
          for k, c in enumerate(lensed())], 0.1),
    ],
    ids=["principal point and scale", "off the centre", "photogrammetric", "scales differ"],
)  # fmt: skip
def test_what_it_does_not_is_met_as_near_as_is_said(tmp_path, views, limit):
    said = written(tmp_path, views, unit="mm")[0]
    stated = [float(part.split()[1]) for part in said.rpartition(": ")[2].rstrip(".").split(", ")]
    assert max(stated) < limit
    assert 1e-9 < misses(tmp_path, views) <= 1.05 * max(stated)


def measured_with_scales() -> Project:
    """Return a project whose cameras have a scale each: OpenPTV has none, points will move."""
    views = [
        replace(c, distortion=replace(LENS, scale=1 + 8e-4 * k)) for k, c in enumerate(lensed())
    ]
    ids = tuple(str(k) for k in range(40))
    images = ImagePoints(
        cameras=tuple(c.name for c in views for _ in ids), ids=ids * 4,
        image=np.concatenate([project(c, POINTS) for c in views]),
    )  # fmt: skip
    body = ObjectPoints(ids=ids, xyz=POINTS)
    return Project(cameras=tuple(views), unit="mm", object_points=body, image_points=images)


def test_what_moving_pixels_costs_in_space_is_said(tmp_path):
    tank = measured_with_scales()
    _, cost, way = write_experiment(tmp_path / "exp", tank)
    back = read_experiment(tmp_path / "exp").project
    images, _ = tank.image_points.grid(tank.camera_names, tank.object_points.ids)
    seen = np.stack([
        there.sensor.image_from_pixel(here.sensor.pixel_from_image(image))
        for here, there, image in zip(tank.cameras, back.cameras, images, strict=True)
    ])  # fmt: skip
    moved = np.linalg.norm(intersect(back.cameras, seen).xyz - POINTS, axis=1)
    rms = float(np.sqrt((moved**2).mean()))
    assert rms > 0.01
    assert f"Points in space move by {rms:.3g} mm (RMS)" in cost
    assert "Here against 40 known points" in cost
    assert "without scale" in way


def test_a_lens_without_terms_keeps_openptvs_convention(tmp_path):
    views = [replace(c, distortion=Brown(convention=Convention.OPENPTV)) for c in lensed()]
    written(tmp_path, views, unit="mm")
    write_project(tmp_path / "back.toml", read_experiment(tmp_path / "exp").project)
    back = read_project(tmp_path / "back.toml")
    assert [c.distortion.convention for c in back.cameras] == [Convention.OPENPTV] * 4


def test_metres_are_written_as_millimetres(tmp_path):
    wall = FlatInterface(
        layers=Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,)), point=(0, 0, 0.1)
    )
    views = [replace(c, centre=c.centre / 1000 + [0, 0, 0.1]) for c in lensed()]
    points = ObjectPoints(ids=("a",), xyz=[(0.01, 0.02, -0.03)])
    written(tmp_path, views, media={"w": wall}, media_of=("w",) * 4, object_points=points)
    back = read_experiment(tmp_path / "exp").project
    assert back.unit == "mm"
    assert back.cameras[0].centre == pytest.approx(views[0].centre * 1000)
    assert back.media["wall1"].layers.thicknesses == (10.0,)
    assert back.media["wall1"].point == pytest.approx([0, 0, 100])
    assert back.object_points.xyz[0] == pytest.approx([10, 20, -30])


@pytest.mark.parametrize("place", ["water surface", "port", "origin on the glass"])
def test_other_media_that_are_the_same_to_openptv_are_written(tmp_path, place):
    views = lensed()
    if place == "water surface":
        media = FlatInterface(layers=Layers(indices=(1.0, 1.34)), point=(0, 0, 50))
    elif place == "port":
        views = views[:1]
        media = FlatInterface(
            layers=Layers(indices=(1.0, 1.5, 1.34), thicknesses=(8.0,)),
            point=(0, 0, -60), normal=(0.02, 0.01, 1), moves_with_camera=True,
        )  # fmt: skip
    else:
        media = FlatInterface(layers=Layers(indices=(1.0, 1.5, 1.34), thicknesses=(8.0,)))
    written(tmp_path, views, media={"w": media}, media_of=("w",) * len(views), unit="mm")
    back = read_experiment(tmp_path / "exp").project
    deep = POINTS - [0, 0, 200]
    for k, camera in enumerate(views):
        ours = camera.sensor.pixel_from_image(project(camera, deep, media))
        theirs = back.cameras[k]
        seen = theirs.sensor.pixel_from_image(project(theirs, deep, back.interface_of(k)))
        assert np.abs(seen - ours).max() < 1e-8


def test_what_cannot_be_is_refused_with_the_reason(tmp_path):
    four = FlatInterface(layers=Layers(indices=(1, 1.5, 1.4, 1.33), thicknesses=(5.0, 5.0)))
    with pytest.raises(InputError, match="three plane-parallel media"):
        written(tmp_path, lensed(), media={"w": four}, media_of=("w",) * 4)
    small = replace(SENSOR, width=640)
    with pytest.raises(InputError, match="not of the size of the others"):
        written(tmp_path, [*lensed()[:1], replace(lensed()[1], sensor=small)])
    assert not (tmp_path / "exp").exists()


@pytest.mark.acceptance
def test_a_real_calibration_with_scale_goes_to_openptv_and_comes_back(data_dir, tmp_path):
    run, project_file = CliRunner().invoke, str(tmp_path / "c.toml")
    folder, done = str(data_dir / "openptv_cavity"), str(tmp_path / "done.toml")
    assert run(main, ["openptv", folder, "--swap-indices", "--out", project_file]).exit_code == 0
    words = ["resect", project_file, "--estimate", "c,xh,yh,k1,p1,p2,scale", "--out", done]
    assert run(main, words).exit_code == 0
    got = run(main, ["openptv", done, "--export", str(tmp_path / "exp")])
    assert got.exit_code == 0, got.output
    told = got.stderr.partition("at most: ")[2].partition(".\n")[0]
    assert max(float(part.split()[1]) for part in told.split(", ")) < 0.6
    assert "Points in space move by" in got.stderr
