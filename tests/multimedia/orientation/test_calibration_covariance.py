"""Sigmas of intersected points contain what the calibration does not know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    FlatInterface,
    ImagePoints,
    ObjectPoints,
    Project,
    Unknowns,
    bundle_adjust,
    intersect,
    project,
    read_project,
    write_project,
)
from multimedia.orientation.calibration_covariance import KEY, with_calibration
from tests.builders.commands import multimedia_command as main
from tests.multimedia.tank import LAYERS, cameras, control, images

NOISE = 0.003
WALL = FlatInterface(layers=LAYERS)
POINTS = control(12, seed=9)
SOUGHT = Unknowns(interior=("c",), media=("index3",), priors={"index3": 0.005})


def calibrated(seed: int) -> Project:
    """Return the tank as adjusted from 10 noisy points."""
    points, rng = control(10), np.random.default_rng(seed)
    exact = images(cameras(), points)
    ids = tuple(f"c{k}" for k in range(10))
    start = Project(
        cameras=tuple(cameras()), media={"w": WALL}, media_of=("w",) * 4, unit="mm",
        sigma_image=NOISE, object_points=ObjectPoints(ids=ids, xyz=points),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in cameras() for _ in ids), ids=ids * 4,
            image=(exact + NOISE * rng.standard_normal(exact.shape)).reshape(-1, 2),
        ),
    )  # fmt: skip
    return bundle_adjust(start, SOUGHT).project


def measured(seed: int) -> np.ndarray:
    exact = np.stack([project(camera, POINTS, WALL) for camera in cameras()])
    return exact + NOISE * np.random.default_rng(1000 + seed).standard_normal(exact.shape)


def test_errors_of_points_are_as_large_as_their_covariances_say():
    squares: dict[str, list[float]] = {"image noise alone": [], "calibration too": []}
    for seed in range(15):
        tank, image = calibrated(seed), measured(seed)
        sigma = np.full(image.shape, NOISE)
        plain = intersect(tank.cameras, image, tank.interfaces, sigma=sigma)
        whole, odd = with_calibration(tank, plain, sigma)
        assert odd == ()
        for name, got in (("image noise alone", plain), ("calibration too", whole)):
            miss = got.xyz - POINTS
            squares[name] += np.einsum(
                "ni,nij,nj->n", miss, np.linalg.inv(got.covariance), miss
            ).tolist()
    assert np.mean(squares["image noise alone"]) > 5.0
    assert np.mean(squares["calibration too"]) == pytest.approx(3.0, abs=0.35)


def test_the_project_file_carries_it_and_the_command_uses_it(tmp_path: Path):
    tank = calibrated(0)
    write_project(tmp_path / "known.toml", tank)
    back = read_project(tmp_path / "known.toml")
    assert back.extra == tank.extra
    assert list(back.extra[KEY])[:2] == ["cam1:X0", "cam1:Y0"]
    bare = {k: v for k, v in tank.extra.items() if k != KEY}
    write_project(tmp_path / "bare.toml", replace(tank, extra=bare))
    moved = replace(tank.cameras[0], centre=tank.cameras[0].centre + np.array([0, 0, 0.5]))
    write_project(tmp_path / "moved.toml", replace(tank, cameras=(moved, *tank.cameras[1:])))
    sigma, said = {}, {}
    for name in ("known", "bare", "moved"):
        out = tmp_path / f"{name}.csv"
        words = ["intersect", str(tmp_path / f"{name}.toml"), "--out", str(out)]
        got = CliRunner().invoke(main, words)
        assert got.exit_code == 0, got.output
        table = [line.split(",") for line in out.read_text().splitlines()]
        sigma[name] = float(table[1][table[0].index("sigma_Z [mm]")])
        said[name] = got.stderr
    assert sigma["known"] > 1.1 * sigma["bare"]
    assert "belongs to other cameras" in said["moved"]
    assert "belongs" not in said["known"]


def test_a_damaged_section_is_refused(tmp_path: Path):
    tank = calibrated(0)
    section = dict(tank.extra[KEY]) | {"cam1:Y0": "1.0 2.0"}
    write_project(tmp_path / "bad.toml", replace(tank, extra={KEY: section}))
    got = CliRunner().invoke(main, ["intersect", str(tmp_path / "bad.toml")])
    assert got.exit_code == 1
    assert "take the section out, or adjust again" in got.stderr
