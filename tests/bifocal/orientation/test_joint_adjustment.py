"""All pairs of a façade in one frame: as precise as said, and gross errors named."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from bifocal.cli.main import main
from bifocal.model.pair import Pair
from bifocal.orientation.joint_adjustment import adjust_jointly
from bifocal.orientation.joint_ties import SharedPoints, into_one_frame, near_each_other
from photocore.errors import GeometryError
from photocore.rotation import rotation_from_vector
from photocore.similarity import Similarity
from tests.bifocal.orientation.many_pairs import many_pairs
from tests.bifocal.orientation.street import write_street


def test_twelve_pairs_are_as_precise_as_their_sigmas_say():
    """0.4 px, 6 control points of 2 mm; errors of one run are common, so several are averaged."""
    ratios, units = [], []
    for seed in range(12):
        case = many_pairs(12, np.random.default_rng(seed))
        got = adjust_jointly(case.observations, case.start)
        error = (got.xyz - case.truth)[case.control :]
        variance = np.diagonal(got.covariance, axis1=1, axis2=2)[case.control :]
        there = np.isfinite(error).all(axis=1)
        assert there.mean() > 0.9
        ratios.append((error[there] ** 2 / variance[there]).mean(axis=0))
        units.append(got.sigma0)
    assert np.mean(units) == pytest.approx(1.0, abs=0.02)
    # X, Y, r each, then all of them; 60 runs gave 0.996, 1.038 and 1.010.
    assert (np.sqrt(np.mean(ratios, axis=0)) < 1.2).all()
    assert 0.9 < np.sqrt(np.mean(ratios)) < 1.1


def test_gross_errors_of_rays_and_of_control_are_named_and_do_no_harm():
    case = many_pairs(6, np.random.default_rng(5), control=8)
    o = case.observations
    pixels, known = o.pixels.copy(), o.known.copy()
    ray = int(np.flatnonzero((o.point > 20) & (np.bincount(o.point)[o.point] >= 4))[0])
    pixels[ray] += (25.0, -18.0)
    bad = int(np.argmax(np.bincount(o.point)[: case.control]))
    known[bad, 2] += 0.4
    got = adjust_jointly(replace(o, pixels=pixels, known=known), case.start)
    named = {(b.point, b.where) for b in got.blunders}
    assert (o.ids[o.point[ray]], o.names[o.camera[ray]]) in named
    assert (f"P{bad}", "control") in named
    assert len(named) < 12
    assert got.control[bad, 2] == pytest.approx(-0.4, abs=0.05)
    error = np.abs(got.xyz - case.truth)[:, 2]
    assert np.nanmedian(error) < 0.02


def test_without_control_the_first_pair_is_held_and_without_overlap_the_pair_is_named():
    case = many_pairs(3, np.random.default_rng(2))
    o = replace(case.observations, known=np.full_like(case.observations.known, np.nan))
    got = adjust_jointly(o, case.start)
    assert np.array_equal(got.cameras[0].centre, case.start.cameras[0].centre)
    assert got.cameras[1].centre[2] == case.start.cameras[1].centre[2]
    assert not got.by_camera[0].any()
    alone = o.camera // 2 != 2
    shared = SharedPoints(
        photo=o.camera[alone], point=o.point[alone], pixels=o.pixels[alone], count=len(o.ids)
    )
    with pytest.raises(GeometryError, match=r"right: fewer than 6 points"):
        into_one_frame(
            case.start.cameras, shared, shared.pixels, o.known, ("left", "middle", "right")
        )


def test_pairs_in_frames_of_their_own_come_roughly_into_one():
    case = many_pairs(4, np.random.default_rng(3), control=8)
    o, rng = case.observations, np.random.default_rng(4)
    turned = Similarity(
        scale=1.3, rotation=rotation_from_vector(np.array([0.0, 0, 0.2])),
        source_centre=np.zeros(3), target_centre=np.array([5.0, 2, 0.1]),
    )  # fmt: skip
    cameras = [
        camera if k // 2 == 1 else camera._replace(
            rotation=camera.rotation @ turned.rotation.T, centre=turned(camera.centre)
        )
        for k, camera in enumerate(case.start.cameras)
    ]  # fmt: skip
    # A sixth of the rays belong to a window two metres away.
    pixels = o.pixels.copy()
    wrong = (o.point >= case.control) & (rng.random(len(pixels)) < 0.15)
    pixels[wrong] += 1000.0
    shared = SharedPoints(photo=o.camera, point=o.point, pixels=pixels, count=len(o.ids))
    start = into_one_frame(cameras, shared, pixels, o.known, tuple("abcd"))
    away = [a.centre - b.centre for a, b in zip(start.cameras, case.start.cameras, strict=True)]
    assert np.abs(away).max() < 1.0
    near = near_each_other(start.cameras, shared, pixels)
    assert near[~wrong].mean() > 0.8
    assert near[wrong].mean() < 0.2


@pytest.mark.acceptance
def test_a_rendered_street_is_adjusted_by_the_command(tmp_path):
    paths = write_street(tmp_path)
    words = ["adjust", *map(str, paths), "--out", str(tmp_path / "joint"), "--json"]
    for path in paths:
        name = path.name[0]
        words += ["--control", str(tmp_path / f"{name}_control.csv")]
        words += ["--check", str(tmp_path / f"{name}_check.csv")]
    result = CliRunner().invoke(main, [*words, "--sigma-pick", "0.2"])
    assert result.exit_code == 0, result.stderr
    said = json.loads(result.stdout)
    assert max(said["rms_px"]) < 0.2
    checks = [p for p in said["points"] if p["kind"] == "check"]
    assert len(checks) >= 15
    # 8.5 mm pixels, picks of 0.15 px.
    assert np.sqrt(np.mean([p["dX"] ** 2 + p["dY"] ** 2 for p in checks])) < 0.004
    assert np.median([abs(p["dr"]) for p in checks]) < 0.02
    for path in paths:
        pair = Pair.read(tmp_path / "joint" / path.name)
        assert pair.photo_file(1).is_file()
        assert pair.orientation is not None
    again = CliRunner().invoke(main, words)
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr
    one = CliRunner().invoke(main, ["adjust", str(paths[0]), "--out", str(tmp_path / "x")])
    assert "two pair files" in one.stderr
