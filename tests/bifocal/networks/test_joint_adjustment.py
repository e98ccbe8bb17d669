"""All pairs of a façade in one frame: as precise as said, and gross errors named."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import GeometryError, InputError, Pair, PairMedia, Similarity, read_control
from bifocal.model.orientation_precision import pinhole
from bifocal.networks.joint_adjustment import adjust_jointly
from bifocal.networks.joint_control import named_positions
from bifocal.networks.joint_observations import (
    of_one_camera,
    with_enough_rays,
    with_rays,
)
from bifocal.networks.joint_ties import SharedPoints, into_one_frame, near_each_other
from bifocal.networks.joint_workflow import (
    JointResult,
    _adjusted_photo,
    _write_pair,
    adjust_pairs,
)
from tests.bifocal.orientation.many_pairs import many_pairs
from tests.bifocal.orientation.street import write_street
from tests.builders.commands import bifocal_command as main
from tests.builders.pinholes import rotation_from_vector


@pytest.mark.acceptance
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


@pytest.mark.acceptance
def test_of_many_honest_rays_none_is_called_a_gross_error():
    case = many_pairs(30, np.random.default_rng(3), columns=6, ties=60)
    assert len(case.observations.camera) > 7000  # of which six or seven lie beyond 3.5 sigma
    assert adjust_jointly(case.observations, case.start).blunders == ()


def test_a_photo_that_two_pairs_use_is_one_camera():
    """Taken for two cameras its rays would count twice, and sigmas come out too small."""
    case = many_pairs(3, np.random.default_rng(4), control=8)
    o, far = case.observations, case.observations.camera == 2
    slots = replace(
        o, names=(*o.names, "again, far", "again, near"), sigma_focal=np.zeros(8), pairs=(),
        camera=np.r_[o.camera, np.full(far.sum(), 6), np.full((o.camera == 5).sum(), 7)],
        point=np.r_[o.point, o.point[far], o.point[o.camera == 5]],
        pixels=np.concatenate([o.pixels, o.pixels[far], o.pixels[o.camera == 5]]),
        sigma=np.full(len(o.sigma) + far.sum() + (o.camera == 5).sum(), 0.4),
    )  # fmt: skip
    once = of_one_camera(slots, [0, 1, 2, 3, 4, 5, 2, 5])
    assert once.names == o.names
    assert once.pairs == ((0, 1), (2, 3), (4, 5), (2, 5))
    got, plain = adjust_jointly(once, case.start), adjust_jointly(o, case.start)
    np.testing.assert_array_equal(got.covariance, plain.covariance)
    own, other = got.orientation(3), got.orientation(1)
    np.testing.assert_array_equal(own[:12, :12], other[:12, :12])
    assert own[9, 19] != 0.0  # far and near share points
    start = replace(case.start, cameras=(*case.start.cameras, *case.start.cameras[2::3]))
    twice = adjust_jointly(slots, start)
    variances = [np.diagonal(a.by_camera[2])[1:] for a in (twice, got)]
    assert np.sqrt(variances[0] / variances[1]).mean() < 0.95


def test_a_point_picked_twice_in_one_photo_is_not_seen_by_two_cameras():
    case = many_pairs(2, np.random.default_rng(4), control=6)
    o = case.observations
    alone = int(np.flatnonzero(np.bincount(o.point)[6:] == 1)[0]) + 6
    ray = int(np.flatnonzero(o.point == alone)[0])
    more = np.r_[np.arange(len(o.point)), ray]
    twice = with_rays(o, more)
    twice.pixels[-1] += 0.5
    assert alone not in with_enough_rays(twice).point


@pytest.mark.parametrize(("axis", "size"), [(0, 0.3), (1, 1.0), (2, 0.4)])
def test_a_wrong_control_point_costs_no_good_rays_of_its_neighbours(axis, size):
    case = many_pairs(6, np.random.default_rng(1), control=8)
    known = case.observations.known.copy()
    known[6, axis] += size
    got = adjust_jointly(replace(case.observations, known=known), case.start)
    assert ("P6", "control") in {(b.point, b.where) for b in got.blunders}
    assert len(got.blunders) <= 2
    assert got.control[6, axis] == pytest.approx(-size, abs=0.05)


def test_what_is_known_of_focal_lengths_counts_once_however_many_rounds_there_are():
    case = many_pairs(3, np.random.default_rng(5), control=6)
    o, rng = replace(case.observations, sigma_focal=np.full(6, 0.001)), np.random.default_rng(1)
    pixels = o.pixels.copy()
    for point in range(10, 30):
        rays = np.flatnonzero(o.point == point)[:2]
        pixels[rays] += rng.normal(0, 3, (len(rays), 2))
    o = replace(o, pixels=pixels)
    got = adjust_jointly(o, case.start)
    assert len(got.blunders) > 5
    left = got.observations
    kept = np.isin(o.camera * 10_000 + o.point, left.camera * 10_000 + left.point)
    again = adjust_jointly(with_rays(o, kept), case.start)
    for one, other in zip(got.cameras, again.cameras, strict=True):
        assert one.matrix[0, 0] == pytest.approx(other.matrix[0, 0], rel=1e-7)
    # By their own sigmas: the start, which is true, is one more observation of 0.1 %.
    drift = [np.log(c.matrix[0, 0] / s.matrix[0, 0]) for c, s in
             zip(got.cameras, case.start.cameras, strict=True)]  # fmt: skip
    assert np.abs(drift).max() < 2e-3


def test_features_better_than_believed_make_no_gross_errors_of_honest_picks():
    """Features are good to 0.1 px and believed to be 0.5, picks of 0.4 px are stated as such."""
    case = many_pairs(3, np.random.default_rng(8), control=6, noise=0.1)
    o, rng = case.observations, np.random.default_rng(9)
    picks = o.point < 30
    pixels = o.pixels.copy()
    pixels[picks] += rng.normal(0, np.sqrt(0.4**2 - 0.1**2), (picks.sum(), 2))
    got = adjust_jointly(replace(o, pixels=pixels, sigma=np.where(picks, 0.4, 0.5)), case.start)
    assert got.sigma0 < 0.6
    assert got.blunders == ()


def test_a_control_point_without_a_good_ray_says_nothing_more():
    case = many_pairs(4, np.random.default_rng(6), control=8)
    o = case.observations
    pixels = o.pixels.copy()
    pixels[o.point == 0] += np.random.default_rng(0).normal(0, 300, (2, 2))
    got = adjust_jointly(replace(o, pixels=pixels), case.start)
    assert ("P0", "0, far") in {(b.point, b.where) for b in got.blunders}
    assert "control" not in {b.where for b in got.blunders}
    assert np.isnan(got.control[0]).all()


def test_two_control_points_hold_no_frame_and_bend_nothing():
    case = many_pairs(3, np.random.default_rng(5), control=2)
    o = case.observations
    got = adjust_jointly(replace(o, known=o.known + np.array([5.0, 1.0, 0.0])), case.start)
    assert got.blunders == ()
    assert got.sigma0 == pytest.approx(1.0, abs=0.1)
    assert np.array_equal(got.cameras[0].centre, case.start.cameras[0].centre)
    assert got.control[0, 0] == pytest.approx(-5.0, abs=0.5)


def test_more_gross_errors_than_rounds_are_said_to_be_left_in(monkeypatch):
    monkeypatch.setattr("bifocal.networks.joint_adjustment.ROUNDS", 1)
    case = many_pairs(4, np.random.default_rng(5), control=8)
    known = case.observations.known.copy()
    known[[2, 5], 2] += 0.4
    got = adjust_jointly(replace(case.observations, known=known), case.start)
    assert "control" in {b.where for b in got.left_in}


def test_points_of_far_photos_alone_start_where_their_rays_meet_the_wall():
    case = many_pairs(4, np.random.default_rng(3), control=8, ties=80)
    o = case.observations
    alone = (o.point >= 8) & (o.point % 2 == 0)
    o = with_rays(o, ~(alone & (o.camera % 2 == 1)))
    shared = SharedPoints(photo=o.camera, point=o.point, pixels=o.pixels, count=len(o.ids))
    start = into_one_frame(case.start.cameras, shared, shared.pixels, o.known, tuple("abcd"))
    away = np.abs(start.xyz - case.truth)[:, :2].max(axis=1)
    assert away[np.unique(o.point)].max() < 2.0


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


def test_a_longer_principal_distance_is_stated_in_millimetres_too():
    photo = replace(Pair.ideal(c1=35, d1=17.5, c2=19, d2=9.5).image1, sigma_pixel=0.4)
    camera = pinhole(photo)
    longer = camera._replace(matrix=camera.matrix * [[1.01], [1.01], [1.0]])
    found = _adjusted_photo(photo, longer, PairMedia.none(), 0)
    assert found.principal_distance == pytest.approx(35.35)
    assert found.sigma_pixel == 0.4


def test_an_output_that_cannot_be_is_refused_before_any_work(tmp_path):
    """The photos do not exist: whoever began to work would complain of them."""
    shown = {"plane_from_pixel": [[0.01, 0, -4], [0, -0.01, 3], [0, 0, 1]], "nadir": [0, 0]}
    for name in "ab":
        Pair.from_dict({
            "format": "bifocal-pair/1",
            "image1": shown | {"file": "none1.jpg", "distance": 17.5},
            "image2": shown | {"file": "none2.jpg", "distance": 9.5},
        }).write(tmp_path / f"{name}.pair.json")  # fmt: skip
    paths = [tmp_path / f"{name}.pair.json" for name in "ab"]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "points.csv").write_text("mine")
    with pytest.raises(InputError, match=r"points\.csv: exists already"):
        adjust_pairs(paths, tmp_path / "out")
    with pytest.raises(InputError, match="is one of the files that are read"):
        adjust_pairs(paths, tmp_path, overwrite=True)


@pytest.mark.acceptance
@pytest.mark.long
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
    # The middle pair once more by another name says nothing new.
    Pair.read(paths[1]).write(tmp_path / "z.pair.json")
    for role in ("control", "check"):
        words += [f"--{role}", str(tmp_path / f"{paths[1].name[0]}_{role}.csv")]
    words[words.index("--out") + 1] = str(tmp_path / "more")
    more = CliRunner().invoke(main, [*words, str(tmp_path / "z.pair.json"), "--sigma-pick", "0.2"])
    assert more.exit_code == 0, more.stderr
    for one, other in zip(json.loads(more.stdout)["points"], said["points"], strict=True):
        assert one["rays"] == other["rays"]
        assert one["sigma_r"] == pytest.approx(other["sigma_r"], rel=0.05)
    second = Pair.read(tmp_path / "more" / "z.pair.json")
    assert second.image1.distance == Pair.read(tmp_path / "more" / paths[1].name).image1.distance
    one = CliRunner().invoke(main, ["adjust", str(paths[0]), "--out", str(tmp_path / "x")])
    assert "two pair files" in one.stderr


def test_a_control_point_without_relief_is_on_the_wall_as_for_align(tmp_path):
    (tmp_path / "c.csv").write_text("id,X,Y,r,col1,row1,col2,row2\nA,1,2,,5,6,7,8\n")
    pair = Pair.ideal(d1=17.5, d2=9.5)
    named = named_positions([tmp_path / "a.json"], [pair], control=(tmp_path / "c.csv",))
    np.testing.assert_array_equal(named.xyz, [[1.0, 2.0, 0.0]])
    np.testing.assert_array_equal(named.sigma, [[0.003, 0.003, 0.005]])


def tables_of(folder, **texts):
    """Write tables; the first row of all is the heading."""
    paths = []
    for name, text in texts.items():
        paths.append(folder / f"{name}.csv")
        paths[-1].write_text("id,X,Y,r,col1,row1,col2,row2\n" + text)
    return tuple(paths)


def test_rows_without_names_in_two_tables_are_not_one_point(tmp_path):
    first, second = "A,1,2,0,5,6,7,8\n,,,,1,2,3,4\n", ",,,,9,8,7,6\n,,,,5,5,5,5\n"
    control, pair = tables_of(tmp_path, a=first, b=second), Pair.ideal(d1=17.5, d2=9.5)
    paths = [tmp_path / "a.pair.json", tmp_path / "b.pair.json"]
    named = named_positions(paths, [pair, pair], control=control)
    assert named.ids == ("A", "a, control 2", "b, control 1", "b, control 2")
    assert named.shared.count == 4


def test_a_row_without_a_name_takes_none_that_another_row_has(tmp_path):
    (path,) = tables_of(tmp_path, a="A,1,2,0,5,6,7,8\n,3,2,0,1,2,3,4\n2,4,2,0,1,2,3,4\n")
    assert read_control(path, sigma=0.003, sigma_plane=0.005).ids == ("A", "row 2", "2")


def test_a_table_without_y_is_refused(tmp_path):
    (tmp_path / "c.csv").write_text("id,X,r,col1,row1,col2,row2\nA,1,0,5,6,7,8\n")
    with pytest.raises(InputError, match="the column Y is missing"):
        read_control(tmp_path / "c.csv", sigma=0.003, sigma_plane=0.005)


def test_a_check_point_without_relief_is_compared_in_x_and_y_alone(tmp_path):
    check = tables_of(tmp_path, c="A,1,2,,5,6,7,8\nB,1,3,0.4,5,6,7,8\n")
    pair = Pair.ideal(d1=17.5, d2=9.5)
    named = named_positions([tmp_path / "a.json"], [pair], check=check[:1])
    np.testing.assert_array_equal(named.xyz, [[1.0, 2.0, np.nan], [1.0, 3.0, 0.4]])
    away = ((0.003, 0.0, np.nan), (0.004, 0.0, 0.01))
    points = tuple(
        {"kind": "check", **dict(zip(("dX", "dY", "dr"), row, strict=True))} for row in away
    )
    result = JointResult(pairs=(), names=(), adjustment=None, points=points)
    count, rms = result.check_rms("check")
    assert count == 2
    assert rms == pytest.approx([np.sqrt((0.003**2 + 0.004**2) / 2), 0.0, 0.01])


def test_a_pair_given_near_photo_first_is_written_so_again(tmp_path):
    """Else the columns of its control table belong to the other photos."""
    shown = {"plane_from_pixel": [[0.01, 0, -4], [0, -0.01, 3], [0, 0, 1]], "nadir": [0, 0]}
    pair = Pair.from_dict({
        "format": "bifocal-pair/1",
        "image1": shown | {"file": "near.jpg", "distance": 9.5},
        "image2": shown | {"file": "far.jpg", "distance": 17.5},
    })  # fmt: skip
    covariance = np.diag(np.arange(1.0, 25.0))
    _write_pair(replace(pair, orientation=covariance), tmp_path / "p.pair.json", "p", tmp_path)
    content = json.loads((tmp_path / "p.pair.json").read_text())
    assert [content[f"image{k}"]["distance"] for k in (1, 2)] == [9.5, 17.5]
    again = Pair.read(tmp_path / "p.pair.json")
    assert again.exchanged
    assert again.image1.distance == 17.5
    np.testing.assert_allclose(again.orientation, covariance)
