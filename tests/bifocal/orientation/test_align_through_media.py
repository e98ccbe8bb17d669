"""Pairs that look through glass and water, set up by control points or as typed.

Pixels come from rays shot by Snell's law (tests/scenes/wet.py, tests/scenes/refracted.py), which
know nothing of the package.
"""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import (
    GeometryError,
    InputError,
    Interior,
    MediaPath,
    Pair,
    PairMedia,
    Pinhole,
    SiteMeasures,
    align,
)
from bifocal.media import interface_axes, view
from bifocal.model.orientation_precision import NAMES, from_dict, names_of
from bifocal.orientation.absolute_orientation import orient_pair
from bifocal.orientation.orientation_stages import PhotoInput, with_refracted_ties
from bifocal.orientation.starts.relative_orientation import Ties
from bifocal.orientation.tuning import CONTROL
from bifocal.orientation.walls.wall_shape import WallShape, shape_in_words
from multimedia import Layers
from tests.bifocal.orientation.pairs_through_media import (
    SIZE,
    cameras,
    control_of,
    lens,
    points,
)
from tests.builders.commands import bifocal_command as main
from tests.builders.pinholes import camera_matrix, project, rotation_from_vector


def aligned(kind, *, xyz=None, off_index=0.0, known=1e-6, pick=0.01, relief=0.3, **media):
    """Return the alignment from exact picks of 12 exact control points."""
    taken, (indices, thicknesses), placed = cameras(kind)
    xyz = points(np.random.default_rng(1), 12, relief) if xyz is None else xyz
    stated = PairMedia.stated(
        (*indices[:-1], indices[-1] + off_index), thicknesses, **placed, **media
    )
    return align(
        None, None, interiors=tuple(lens(c) for c in taken),
        control=control_of(xyz, [c.view_of(xyz) for c in taken], known),
        site=SiteMeasures(sigma_pick=pick), media=stated,
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["port", "tank", "surface"])
def test_exact_control_gives_exact_relief(kind):
    pair, (far, near) = aligned(kind).pair, cameras(kind)[0]
    check = points(np.random.default_rng(5), 30)
    found = pair.intersect(far.view_of(check), near.view_of(check)).xyz
    np.testing.assert_allclose(found, check, atol=1e-9)
    for photo, camera in ((pair.image1, far), (pair.image2, near)):
        assert photo.distance == pytest.approx(camera.centre[2], abs=1e-9)
        assert photo.z0 == pytest.approx(camera.z0, abs=1e-9)
    # The same picks taken in air are wrong by centimetres.
    dry = pair.in_air().intersect(far.view_of(check), near.view_of(check)).xyz
    assert np.abs(dry - check)[:, 2].max() > 0.02


@pytest.mark.parametrize(
    ("kind", "unknown", "limit"),
    [("port", "index3", 1e-4), ("surface", "index2", 4e-4), ("tank", "index3", 4e-4)],
)
def test_an_index_wrong_by_a_hundredth_is_found_where_relief_carries_it(kind, unknown, limit):
    made = aligned(kind, off_index=0.01, priors={unknown: 0.01})
    index, sigma = made.pair.layers.indices[-1], made.deviations[unknown]
    assert abs(index - 1.337) < min(2 * sigma, limit)
    assert sigma < 0.001
    assert any(words.startswith(f"{unknown} came out 1.33") for words in made.words)
    assert not any("hardly carry" in remark for remark in made.remarks)


def test_a_depth_and_a_glass_may_be_unknown_too():
    made = aligned("tank", priors={"depth": 0.01, "thickness1": 0.002})
    assert made.pair.image1.distance - made.pair.image1.z0 == pytest.approx(0.91, abs=1e-4)
    assert set(made.deviations) > {"depth", "thickness1"}


def test_what_a_flat_field_does_not_carry_is_said_to_rest_on_the_prior():
    made = aligned("port", relief=0.02, known=0.003, pick=0.5, estimate=["index3"])
    assert any(r.startswith("index3: the data hardly carry it") for r in made.remarks)
    assert made.deviations["index3"] == pytest.approx(0.005, rel=0.1)


def test_an_impossible_index_is_never_accepted():
    with pytest.raises(GeometryError, match=r"index3 comes out as 1\.3\d+ .*1\.437 was given"):
        aligned("port", off_index=0.1, priors={"index3": 0.005})


def test_a_surface_behind_the_cameras_is_said_to_be_there():
    taken, (indices, thicknesses), _ = cameras("surface")
    xyz = points(np.random.default_rng(1), 12)
    with pytest.raises(GeometryError, match=r"behind the media as they are given. Check --depth"):
        align(
            None, None, interiors=tuple(lens(c) for c in taken),
            control=control_of(xyz, [c.view_of(xyz) for c in taken], 0.001),
            media=PairMedia.stated(indices, thicknesses, depth=50.0),
        )  # fmt: skip


def test_without_enough_control_it_says_how_to_go_on():
    taken, (indices, thicknesses), placed = cameras("port")
    xyz = points(np.random.default_rng(1), 3)
    with pytest.raises(GeometryError, match=r"at least four .*--as-set-up"):
        align(
            None, None, interiors=tuple(lens(c) for c in taken),
            control=control_of(xyz, [c.view_of(xyz) for c in taken], 0.001),
            media=PairMedia.stated(indices, thicknesses, **placed),
        )  # fmt: skip


def test_photos_given_the_other_way_round_take_their_ports_along():
    taken, (indices, thicknesses), _ = cameras("port")
    xyz = points(np.random.default_rng(1), 12)
    made = align(
        None, None, interiors=(lens(taken[1]), lens(taken[0])),
        control=control_of(xyz, [taken[1].view_of(xyz), taken[0].view_of(xyz)], 1e-6),
        site=SiteMeasures(sigma_pick=0.01),
        media=PairMedia.stated(indices, thicknesses, ports=(0.06, 0.05), priors={"port2": 0.01}),
    )  # fmt: skip
    assert made.pair.image1.distance == pytest.approx(taken[0].centre[2], abs=1e-6)
    assert made.pair.image2.z0 == pytest.approx(0.06, abs=1e-12)
    assert "port1" in made.deviations


def test_common_points_say_that_their_bent_rays_meet():
    """Wrong ones are left out, right ones make the cameras' tilts more certain and move nothing."""
    taken, (indices, thicknesses), placed = cameras("surface")
    xyz = points(np.random.default_rng(1), 12)
    lenses = [lens(c) for c in taken]
    photos = [PhotoInput(grey=None, interior=i, name=n) for i, n in zip(lenses, "ab", strict=True)]
    alone = orient_pair(
        (photos[0], photos[1]), site=SiteMeasures(sigma_pick=0.3),
        control=control_of(xyz, [c.view_of(xyz) for c in taken], 0.0005),
        media=PairMedia.stated(indices, thicknesses, **placed),
    )  # fmt: skip
    assert not alone.observations.tie_used.any()
    rng = np.random.default_rng(8)
    seen = [c.view_of(points(rng, 160)) for c in taken[:1]]
    rng = np.random.default_rng(8)
    seen.append(taken[1].view_of(points(rng, 160)))
    seen[1][:12] += rng.normal(0, 40, (12, 2))
    ties = Ties(
        pixels1=seen[0], pixels2=seen[1], seen1=seen[0], seen2=seen[1], homography=np.eye(3),
        on_plane=np.zeros(160, dtype=bool), tolerance=0.3,
    )  # fmt: skip
    pair = with_refracted_ties(alone, ties)
    used = pair.observations.tie_used
    assert used[12:].all()
    assert used[:12].sum() <= 2  # some lie on their line by chance
    assert np.abs(pair.adjusted.tie_misfit[12:]).max() < 1e-3
    for number, camera in enumerate(taken, start=1):
        found = pair.adjusted.cameras[number - 1].centre
        np.testing.assert_allclose(found, camera.centre, atol=1e-4)
        assert pair.adjusted.sigma("turn X", number) < 0.9 * alone.adjusted.sigma("turn X", number)


def noisy(kind, draw, name, sigma):
    """Return errors over sigmas (X, Y, r) of 40 check points, all inputs as uncertain as stated."""
    rng = np.random.default_rng(500 + draw)
    taken, (indices, thicknesses), placed = cameras(kind, draw)
    xyz, check = points(rng, 14), points(rng, 40)
    picks = [[c.view_of(p) + rng.normal(0, 0.35, (len(p), 2)) for c in taken] for p in (xyz, check)]
    lenses = [lens(c, factor=np.exp(rng.normal(0, 5e-4)), away=rng.normal(0, 5, 2)) for c in taken]
    stated = (*indices[:-1], indices[-1] + rng.normal(0, sigma))
    made = align(
        None, None, interiors=tuple(lenses), site=SiteMeasures(sigma_pick=0.35),
        control=control_of(xyz + rng.normal(0, 5e-4, xyz.shape), picks[0], 5e-4),
        media=PairMedia.stated(stated, thicknesses, **placed, priors={name: sigma}),
    )  # fmt: skip
    found = made.pair.intersect(*picks[1], sigma_px=0.35)
    return (found.xyz - check) / found.sigma


@pytest.mark.acceptance
@pytest.mark.parametrize(("kind", "name"), [("port", "index3"), ("surface", "index2")])
def test_errors_are_as_large_as_their_sigmas_say(kind, name):
    """Here 0.98 and 0.99, 96 % below two: 40 points of a draw share its orientation."""
    ratios = np.concatenate([noisy(kind, draw, name, 0.005) for draw in range(1, 61)])
    spread = np.sqrt((ratios**2).mean())
    assert 0.95 < spread < 1.05
    assert 0.93 < (np.abs(ratios) < 2).mean() < 0.97


def test_the_covariance_through_media_goes_into_the_pair_file_and_to_every_point(tmp_path):
    made = aligned("tank", known=0.001, pick=0.3, priors={"index3": 0.005, "depth": 0.01})
    made.pair.write(tmp_path / "tank.pair.json")
    pair = Pair.read(tmp_path / "tank.pair.json")
    assert not pair.remarks
    stated = json.loads((tmp_path / "tank.pair.json").read_text())["orientation"]["parameters"]
    assert tuple(stated) == names_of(pair.layers)
    assert stated[24:28] == ["index1", "index2", "index3", "thickness1"]
    xyz = points(np.random.default_rng(5), 20)
    with_it = pair.intersect(*pair.project(xyz), sigma_px=0.3).covariance
    alone = replace(pair, orientation=None).intersect(*pair.project(xyz), sigma_px=0.3).covariance
    np.testing.assert_allclose(
        with_it - alone, pair.covariance_of_orientation(xyz), rtol=1e-9, atol=1e-15
    )
    effect = pair.effect_of_orientation(xyz)
    np.testing.assert_allclose(
        effect @ effect.transpose(0, 2, 1), pair.covariance_of_orientation(xyz), rtol=1e-6
    )
    assert (with_it[:, 2, 2] > 1.05 * alone[:, 2, 2]).mean() > 0.9
    turned = Pair(image1=pair.image2, image2=pair.image1, orientation=exchanged_by_name(pair))
    np.testing.assert_allclose(
        turned.covariance_of_orientation(xyz), pair.covariance_of_orientation(xyz), rtol=1e-12
    )
    assert pair.in_air().orientation.shape == (len(NAMES), len(NAMES))


def exchanged_by_name(pair):
    names = names_of(pair.layers)
    other = {" 1": " 2", " 2": " 1"}
    order = [names.index(n[:-2] + other[n[-2:]] if n[-2:] in other else n) for n in names]
    return pair.orientation[np.ix_(order, order)]


@pytest.mark.parametrize("leans", [False, True])
def test_the_derivatives_through_media_are_those_of_the_view(leans):
    layers = Layers(indices=(1.01, 1.49, 1.337), thicknesses=(0.01,))
    normal = np.array([0.1, -0.15, 1.0])
    turn = interface_axes(normal / np.linalg.norm(normal)) if leans else None
    look = np.diag([1.0, -1.0, -1.0]) @ rotation_from_vector([0.03, -0.02, 0.01])
    camera = Pinhole(camera_matrix(2400, 1.001, 700, 510), look, np.array([0.1, -0.05, 3.5]))
    xyz = points(np.random.default_rng(1), 6)

    def path(moved, change=None):
        change = np.zeros(8) if change is None else change
        index, glass, z0 = change[:3], change[3], change[4]
        return MediaPath(
            layers=Layers(indices=tuple(np.array(layers.indices) + index),
                          thicknesses=(0.01 + glass,)),
            z0=0.05 + z0, distance=float(moved.centre[2]),
            rotation=turn if turn is None and not change[5:].any()
            else (np.eye(3) if turn is None else turn) @ rotation_from_vector(change[5:]),
        )  # fmt: skip

    def by(count, view, step=1e-6):
        ways = step * np.eye(count)
        return np.stack([(view(way) - view(-way)) / (2 * step) for way in ways], axis=-1)

    def shown(moved, placed, places):
        """Return pixels by the radial shift (Maas 2015, Eqs. 1 and 2), not by the view."""
        away = placed.apparent(places[:, :2] - moved.centre[:2], places[:, 2])
        on_plane = np.column_stack([moved.centre[:2] + away, np.zeros(len(places))])
        return project(moved, on_plane)

    def turned(way):
        return shown(camera.stepped(way), path(camera.stepped(way)), xyz)

    found = view(camera, path(camera), xyz)
    np.testing.assert_allclose(found.pixels, shown(camera, path(camera), xyz), atol=1e-10)
    for stated, numeric in (
        (found.by_point, by(3, lambda way: shown(camera, path(camera), xyz + way))),
        (found.by_camera, by(10, turned)),
        (found.by_media, by(8, lambda way: shown(camera, path(camera, way), xyz))),
    ):
        scale = np.abs(numeric).max(axis=(0, 1)) + 1.0
        assert (np.abs(stated - numeric).max(axis=(0, 1)) / scale).max() < 1e-6


@pytest.mark.parametrize("placed", [{"ports": (0.05, 0.05)}, {"depth": 0.6}])
def test_a_set_up_as_typed_goes_through_media_with_what_is_uncertain_of_it(placed):
    d1, d2, lenses = 3.5, 1.9, []
    for focal in (3400.0, 1800.0):
        lenses.append(Interior.from_focal(focal, image_size=SIZE, sigma=0.02, source="mark"))

    def made(depth=0.0, moved=0.0, factor=1.0, index=1.337):
        media = {k: v + depth if k == "depth" else v for k, v in placed.items()}
        known = (replace(lenses[0], focal=3400.0 * factor), lenses[1])
        site = SiteMeasures(distance1=d1 + moved, distance2=d2, sigma=0.02)
        stated = PairMedia.stated((1.0, index), **media, priors={"index2": 0.004})
        return align(None, None, interiors=known, site=site, as_set_up=True, media=stated).pair

    pair = made()
    assert pair.image1.z0 == pytest.approx(2.9 if "depth" in placed else 0.05)
    xyz = points(np.random.default_rng(4), 8)
    pixels = pair.project(xyz)
    # By hand: what each uncertain number does alone, the scale on the wall near the axis kept.
    apparent = pair.image1.media.near_axis
    later = made(moved=1e-5)
    factor = later.image1.media.near_axis / apparent
    first = (made(moved=1e-5, factor=factor).intersect(*pixels).xyz - xyz) / 1e-5 * 0.02
    third = (made(index=1.337 + 1e-5).intersect(*pixels).xyz - xyz) / 1e-5 * 0.004
    whole = pair.covariance_of_orientation(xyz)[:, 2, 2]
    assert (whole >= 0.999 * (first[:, 2] ** 2 + third[:, 2] ** 2)).all()
    fixed = replace(pair, orientation=None)
    one = align(
        None, None, interiors=tuple(lenses), as_set_up=True,
        site=SiteMeasures(distance1=d1, distance2=d2, sigma=1e-9),
        media=PairMedia.stated((1.0, 1.337), **placed, priors={"index2": 0.004}),
    ).pair.covariance_of_orientation(xyz)[:, 2, 2]  # fmt: skip
    np.testing.assert_allclose(one, third[:, 2] ** 2, rtol=1e-3, atol=1e-14)
    assert not fixed.covariance_of_orientation(xyz).any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--indices", "1,1.337", "--depth", "0.6", "--auto"], "blurred"),
        (
            ["--indices", "1,1.3", "--port", "0.05", "--auto", "--estimate", "lean1"],
            "normal axis",
        ),
        (["--indices", "1,1.337", "--depth", "0.6", "--port", "0.05"], "one of the two"),
        (["--indices", "1,1.337"], "one of the two"),
        (["--depth", "0.6"], "--depth goes with --indices"),
        (["--indices", "1,1.337", "--depth", "2.5"], "behind camera 2"),
        (["--indices", "1,1.337", "--port", "2"], "--port: the last interface would lie"),
        (["--indices", "1,1.337", "--port", "0.05", "--prior", "index9=1"], "possible are index1"),
        (["--indices", "1,1.337", "--depth", "0.6", "--port-normal", "axis"], "goes with --port"),
        (["--indices", "1,1.337", "--port", "0.05", "--port-normal", "0,0,-1"], "expected X,Y,r"),
        (["--indices", "1,1.337", "--port", "0.05", "--prior", "index2"], "label=sigma"),
        (["--indices", "1,1.337", "--port", "0.05", "--prior", "index2=0"], "above zero"),
        (["--indices", "1,1.337", "--depth", "0.6", "--estimate", "lean1"], "possible are index1"),
        (["--indices", "1,1.337", "--port", "0.05", "--prior", "lean1=-1"], "above zero"),
    ],
)
def test_options_that_do_not_describe_media_are_refused(desk, options, message):
    result = run(desk, *options)
    assert result.exit_code == 1
    assert message in result.output


def test_a_normal_that_is_neither_numbers_nor_the_axis_is_wrong_usage(desk):
    result = run(desk, "--indices", "1,1.337", "--port", "0.05", "--port-normal", "up")
    assert result.exit_code == 2
    assert "'up' is not axis or 3 numbers" in result.output


@pytest.fixture
def desk(tmp_path):
    for name in ("far.png", "near.png"):
        cv2.imwrite(str(tmp_path / name), np.full((40, 60), 90, np.uint8))
    return tmp_path


def run(folder, *options):
    typed = () if "--auto" in options else ("--as-set-up", "--distance1", "3.5")
    typed += ("--distance2", "1.9", "--focal1", "35", "--focal2", "19", "--pixel-size", "0.5")
    photos = [str(folder / name) for name in ("far.png", "near.png")]
    out = ["--out", str(folder / "w.pair.json"), "--no-picture"]
    return CliRunner().invoke(main, ["align", *photos, *typed, *options, *out])


def test_the_command_writes_media_as_the_pair_file_has_them(desk):
    result = run(
        desk, "--indices", "1,1.49,1.337", "--thicknesses", "0.01", "--port1", "0.05", "--port2",
        "0.06", "--port-normal2", "0.1,0,1", "--prior", "index3=0.003",
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "Through media of index 1, 1.49, 1.337 (10 mm between)" in result.output
    data = json.loads((desk / "w.pair.json").read_text())
    assert data["layers"] == {"indices": [1.0, 1.49, 1.337], "thicknesses": [0.01]}
    assert (data["image1"]["z0"], data["image2"]["z0"]) == (0.05, 0.06)
    assert "interface_normal" not in data["image1"]
    np.testing.assert_allclose(
        data["image2"]["interface_normal"], np.array([0.1, 0, 1]) / np.sqrt(1.01)
    )
    covariance = np.array(data["orientation"]["covariance"])
    place = data["orientation"]["parameters"].index("index3")
    assert covariance[place, place] == pytest.approx(0.003**2)


@pytest.mark.parametrize("stated", [5, None, "ln", [1, 2], {"index1": 1}])
def test_parameters_of_a_covariance_that_are_no_list_are_refused(stated):
    with pytest.raises(InputError, match=r'"orientation": expected .* 24 parameters'):
        from_dict({"parameters": stated, "covariance": [[1.0]]})


def test_a_bent_wall_proposes_the_options_for_media():
    assert "--indices with --port or --depth" in shape_in_words(
        WallShape(3.0, 0.1), with_lens=False
    )
    assert "media are not as given" in shape_in_words(
        WallShape(3.0, 0.1), with_lens=True, through_media=True
    )
    assert "may be good" in shape_in_words(WallShape(3.0, 0.1), with_lens=True, left_out=True)


def test_ports_and_depth_exclude_each_other():
    with pytest.raises(InputError, match="one of the two"):
        PairMedia.stated((1.0, 1.337), ports=(0.1, None), depth=0.5)


@pytest.mark.parametrize(
    ("kind", "seed", "count", "relief", "said"),
    [("port", 3, 8, 0.05, "The likely reason"), ("surface", 2, 8, 0.02, "do not tell")],
)
def test_unknown_lenses_are_named_where_control_does_not_make_up_for_them(
    monkeypatch, kind, seed, count, relief, said
):
    """Before photos are matched: control off the wall by 2 to 5 cm, picked to 0.3 px."""
    room = "bifocal.orientation.absolute_orientation"
    monkeypatch.setattr(f"{room}.CONTROL", replace(CONTROL, hopeless=0.3))
    monkeypatch.setattr(f"{room}.ties_of", lambda *_, **__: pytest.fail("matched"))
    rng = np.random.default_rng(seed)
    taken, media, placed = cameras(kind)
    xyz = points(rng, count, relief)
    seen = [camera.view_of(xyz) + rng.normal(0, 0.3, (count, 2)) for camera in taken]
    with pytest.raises(
        GeometryError, match=f"{said}.*focal lengths are unknown.*image1 and image2"
    ):
        align(
            None, None, interiors=(Interior.unknown(SIZE),) * 2,
            control=control_of(xyz, seen, 0.003), media=PairMedia.stated(*media, **placed),
        )  # fmt: skip
