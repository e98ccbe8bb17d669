"""Cameras from control points, lengths and common points."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from bifocal import Control, GeometryError, InputError, Interior, SiteMeasures
from bifocal.orientation.adjustment.frame_turn import family_test, line_test
from bifocal.orientation.adjustment.pair_adjustment import adjust, pair_equations
from bifocal.orientation.adjustment.pair_observations import (
    NAMES,
    PairObservations,
    PairUnknowns,
    at,
)
from bifocal.orientation.approximate_orientation import plausible_focals
from bifocal.orientation.facade_lines import FacadeDirection, contradiction_in_words
from bifocal.orientation.starts.relative_orientation import Ties
from bifocal.orientation.starts.space_resection import resect
from bifocal.orientation.tie_points import with_wall
from bifocal.orientation.walls.reference_plane import NarrowFace
from photocore.camera.pinhole import Pinhole
from tests.bifocal.orientation.layered_wall import SIZE, camera
from tests.builders.orientation import PhotoInput, orient_pair
from tests.builders.pinholes import project

FAR = camera(16.0, offset=(0.4, -0.2), turn_deg=(8.0, -20.0, 1.0), shift=(4.0, -3.0))
NEAR = camera(9.0, offset=(-0.3, 0.1), turn_deg=(-6.0, 15.0, -2.0), shift=(-3.0, 5.0))
WALL = np.array(
    [[-3, -2, 0], [3, -2, 0], [3, 2, 0], [-3, 2, 0], [0, -2, 0], [0.2, 1.9, 0], [-2.9, 0, 0],
     [3, 0.1, 0]], dtype=float,
)  # fmt: skip
OFF = np.array([[-2, 1, 0.5], [2, -1, -0.5], [1.5, 1.5, 0.6], [-1.5, -1.5, -0.4]])
POINTS = np.concatenate([WALL, OFF])


def interior(*, focal: float | None = None) -> Interior:
    if focal is None:
        return Interior.unknown(SIZE)
    return Interior.from_focal(focal, image_size=SIZE, sigma=0.02, source="test")


def control(xyz: np.ndarray = POINTS, *, sigma_px: float = 0.0, seed: int = 0) -> Control:
    noise = np.random.default_rng(seed).normal(0, 1, (2, len(xyz), 2)) * sigma_px
    return Control(
        ids=tuple(f"P{i}" for i in range(len(xyz))),
        xyz=xyz.copy(),
        sigma=np.full((len(xyz), 3), 0.001),
        pixels1=project(FAR, xyz) + noise[0],
        pixels2=project(NEAR, xyz) + noise[1],
    )


def photos(**focal: float) -> tuple[PhotoInput, PhotoInput]:
    return (
        PhotoInput(grey=None, interior=interior(focal=focal.get("far")), name="far.jpg"),
        PhotoInput(grey=None, interior=interior(focal=focal.get("near")), name="near.jpg"),
    )


def misplaced(made, truth) -> list[float]:
    return [
        float(np.linalg.norm(found.centre - true.centre))
        for found, true in zip(made.adjusted.cameras, truth, strict=True)
    ]


@pytest.mark.parametrize("photo", [FAR, NEAR])
def test_resection_finds_the_camera_without_knowing_the_lens(photo) -> None:
    found, agree = resect(POINTS, project(photo, POINTS), interior())
    assert agree.all()
    assert np.linalg.norm(found.centre - photo.centre) < 0.05 * photo.centre[2]


def left_out(made) -> tuple[str, ...]:
    """Return the control points left out as gross errors."""
    ids, used = made.observations.control.ids, made.observations.pick_used
    return tuple(name for name, good in zip(ids, used, strict=True) if not good)


def test_control_points_determine_both_cameras_and_lenses() -> None:
    made = orient_pair(photos(), control=control(), site=SiteMeasures(sigma_pick=0.1))
    # The lens is free within its prior: what is left is the pull of the principal point.
    assert max(misplaced(made, (FAR, NEAR))) < 0.05
    assert left_out(made) == ()


def test_known_lenses_leave_nothing_to_the_prior() -> None:
    exact = tuple(
        PhotoInput(
            grey=None,
            interior=replace(
                interior(focal=cam.matrix[0, 0]),
                sigma_focal=1e-5,
                centre=cam.matrix[:2, 2],
                sigma_centre=0.01,
                sigma_aspect=1e-5,
            ),
            name="photo",
        )
        for cam in (FAR, NEAR)
    )
    made = orient_pair(exact, control=control(), site=SiteMeasures())
    assert max(misplaced(made, (FAR, NEAR))) < 1e-5


def test_standard_deviations_cover_the_errors() -> None:
    ratios = []
    for seed in range(6):
        made = orient_pair(
            photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0]),
            control=control(sigma_px=0.5, seed=seed),
            site=SiteMeasures(),
        )
        sigma = np.sqrt(made.adjusted.covariance[at("Z", 1), at("Z", 1)])
        ratios.append((made.adjusted.cameras[0].centre[2] - FAR.centre[2]) / sigma)
    assert 0.2 < np.sqrt(np.mean(np.square(ratios))) < 1.6


@pytest.mark.parametrize("size", [0.05, 1.0])
def test_a_gross_error_is_named_and_left_out(size: float) -> None:
    points = control(sigma_px=0.3)
    points.xyz[5, 0] += size
    made = orient_pair(
        photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0]), control=points, site=SiteMeasures()
    )
    assert left_out(made) == ("P5",)
    assert any("P5 is a gross error" in text for text in made.remarks)
    assert max(misplaced(made, (FAR, NEAR))) < 0.25


@pytest.mark.parametrize("wrong", [0, 2, 5])
def test_one_wrong_point_of_eight_is_named_though_it_spoils_the_others(wrong: int) -> None:
    some = np.r_[:5, -3:0]
    points = control(POINTS[some], sigma_px=0.3)
    points.xyz[wrong, 0] += 0.05
    exact = photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0])
    made = orient_pair(exact, control=points, site=SiteMeasures(sigma_pick=0.3))
    assert left_out(made) == (f"P{wrong}",)


def test_a_wall_of_many_small_chances_holds_the_plane(monkeypatch) -> None:
    problem, start = everything()
    monkeypatch.setattr(
        "bifocal.orientation.tie_points.narrow_face",
        lambda xyz, *_, **__: NarrowFace(np.zeros(3), 0.001, np.full(len(xyz), 0.46)),
    )
    assert with_wall(problem, start, (1e-4, 1e-5)).wall.sum() > 40
    # All of it in a corner of the photo is none.
    corner = replace(problem, tie1=problem.tie1 / 1000)
    assert not with_wall(corner, start, (1e-4, 1e-5)).wall.any()


def test_a_wrong_pick_in_one_photo_is_named() -> None:
    points = control(sigma_px=0.3)
    points.pixels2[9] += [9.0, -4.0]
    made = orient_pair(
        photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0]), control=points, site=SiteMeasures()
    )
    assert left_out(made) == ("P9",)


def test_few_control_points_draw_the_advice_of_nine() -> None:
    made = orient_pair(photos(), control=control(POINTS[[0, 1, 2, 3, 8, 9]]), site=SiteMeasures())
    assert any("advises nine" in text for text in made.remarks)


def test_exchanged_photos_are_put_right_and_said_so() -> None:
    first, second = photos()
    made = orient_pair((second, first), control=control().exchanged(), site=SiteMeasures())
    assert made.exchanged
    assert "near.jpg is the near photo" in made.remarks[0]
    assert made.adjusted.cameras[0].centre[2] > made.adjusted.cameras[1].centre[2]


def test_control_in_millimetres_is_refused() -> None:
    points = control()
    points.xyz[:] *= 1000
    points.sigma[:] *= 1000
    with pytest.raises(InputError, match="in mm or cm"):
        orient_pair(photos(), control=points, site=SiteMeasures())


def test_control_in_millimetres_is_told_by_the_tape() -> None:
    points = control()
    points.xyz[:] *= 1000
    points.sigma[:] *= 1000
    with pytest.raises(InputError, match=r"are in mm: they put camera 1 1[56],"):
        orient_pair(photos(), control=points, site=SiteMeasures(distance1=16.0))


def far_wall(scale: float) -> Control:
    """Return the control points of a wall that is so many times as large and as far."""
    points = control()
    return replace(points, xyz=points.xyz * scale, sigma=points.sigma * scale)


@pytest.mark.parametrize(("scale", "measured"), [(22.0, False), (22.0, True), (40.0, True)])
def test_a_wall_beyond_300_m_is_taken_and_one_beyond_500_m_where_the_tape_agrees(
    scale, measured
) -> None:
    site = SiteMeasures(distance1=16 * scale, distance2=9 * scale) if measured else SiteMeasures()
    known = photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0])
    made = orient_pair(known, control=far_wall(scale), site=site)
    assert made.adjusted.cameras[0].centre[2] == pytest.approx(16 * scale, rel=0.003)


def test_a_wall_too_far_is_refused_with_the_far_distance_first() -> None:
    known = photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0])
    with pytest.raises(InputError, match=r"the cameras 6[34]\d and 3[56]\d m from the wall"):
        orient_pair(known, control=far_wall(40.0), site=SiteMeasures())


def test_a_tape_in_millimetres_is_told_by_the_control_points() -> None:
    known = photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0])
    with pytest.raises(InputError, match=r"--distance1 16000 m is too far.*\(--distance1 16\)"):
        orient_pair(known, control=control(), site=SiteMeasures(distance1=16000.0))


def test_points_in_one_line_are_refused() -> None:
    line = np.column_stack([np.linspace(-3, 3, 6), np.full(6, 0.5), np.zeros(6)])
    with pytest.raises(GeometryError, match="on one line"):
        orient_pair(photos(), control=control(line), site=SiteMeasures())


def test_a_flat_wall_square_on_with_unknown_lens_is_not_determined() -> None:
    flat = Control(
        ids=tuple("abcdefgh"),
        xyz=WALL.copy(),
        sigma=np.full((8, 3), 0.001),
        pixels1=project(camera(16.0), WALL),
        pixels2=project(camera(9.0), WALL),
    )
    with pytest.raises(GeometryError, match="distance of camera 1 is not determined"):
        orient_pair(photos(), control=flat, site=SiteMeasures())
    # One relief point of 0.5 m off the axis, or the tape, settles it.
    made = orient_pair(photos(), control=flat, site=SiteMeasures(distance1=16.0, distance2=9.0))
    assert made.adjusted.cameras[0].centre[2] == pytest.approx(16.0, abs=0.001)


def test_photos_from_one_place_are_refused_as_the_classic_mistake() -> None:
    zoomed = camera(16.0, focal=900.0, offset=(0.4, -0.2), turn_deg=(8.0, -20.0, 1.0))
    points = control()
    same = replace(points, pixels2=project(zoomed, POINTS))
    with pytest.raises(GeometryError, match="only the zoom was changed"):
        orient_pair(photos(), control=same, site=SiteMeasures())


def test_hardly_any_change_of_distance_is_refused() -> None:
    beside = camera(15.8, offset=(-3.0, 0.0), turn_deg=(5.0, 12.0, 0.0))
    points = replace(control(), pixels2=project(beside, POINTS))
    with pytest.raises(GeometryError, match="hardly any change of distance"):
        orient_pair(photos(), control=points, site=SiteMeasures())


@pytest.mark.parametrize("unknown", [0, 1])
def test_an_unknown_focal_length_follows_from_both_distances_and_the_scale(unknown: int) -> None:
    """On the wall photo 2 is (f2 / d2) / (f1 / d1) as large as photo 1."""
    xyz = np.array([[x, y, 0.0] for x in (-2, 0, 2) for y in (-1, 0, 1)])
    cameras = [camera(d, offset=(0, 0), turn_deg=(0, 0, 0), shift=(0, 0)) for d in (16.0, 9.0)]
    seen = [project(one, xyz) for one in cameras]
    ties = Ties(
        pixels1=seen[0],
        pixels2=seen[1],
        seen1=seen[0],
        seen2=seen[1],
        homography=cv2.findHomography(*seen)[0],
        on_plane=np.ones(9, bool),
        tolerance=1.0,
    )
    lenses = [replace(interior(focal=c.matrix[0, 0]), sigma_focal=1e-4) for c in cameras]
    lenses[unknown] = interior()
    site = SiteMeasures(distance1=16.0, distance2=9.0)
    found = plausible_focals((lenses[0], lenses[1]), ties, site)
    assert found[unknown].focal == pytest.approx(cameras[unknown].matrix[0, 0], rel=1e-6)


def test_common_points_alone_need_a_tilt_or_a_tape_but_give_the_ratio_of_distances() -> None:
    rng = np.random.default_rng(3)
    xyz = np.column_stack([rng.uniform(-3, 3, (300, 2)), np.zeros(300)])
    xyz[200:, 2] = rng.uniform(-0.6, 0.6, 100)
    exact = tuple(
        replace(
            interior(focal=cam.matrix[0, 0]), sigma_focal=1e-4, centre=cam.matrix[:2, 2],
            sigma_centre=0.1,
        )
        for cam in (FAR, NEAR)
    )  # fmt: skip
    problem = PairObservations(
        interiors=exact,
        tie1=project(FAR, xyz),
        tie2=project(NEAR, xyz),
        sigma_tie=0.1,
        tie_used=np.ones(300, bool),
        measured={"distance1": (16.0, 0.01)},
        free_datum=True,
    )
    problem = with_wall(problem, PairUnknowns(cameras=(FAR, NEAR)), (1e-4, 1e-5))
    # Of the hundred points off the wall a few lie within the noise of it.
    assert problem.wall[:200].all()
    assert problem.wall.sum() < 225
    start = tuple(
        cam._replace(centre=cam.centre + np.array([0.05, -0.05, 0.1])) for cam in (FAR, NEAR)
    )
    solution = adjust(problem, PairUnknowns(cameras=start))
    assert solution.cameras[0].centre[2] == pytest.approx(16.0, abs=1e-3)
    assert solution.cameras[1].centre[2] == pytest.approx(9.0, abs=2e-3)
    # The datum holds the start's origin; the offset between the cameras is what counts.
    offset = solution.cameras[1].centre - solution.cameras[0].centre
    np.testing.assert_allclose(np.linalg.norm(offset), np.linalg.norm(NEAR.centre - FAR.centre),
                               rtol=1e-3)  # fmt: skip


def everything() -> tuple[PairObservations, PairUnknowns]:
    """Return one of every kind of observation, control exact and ties not, and the truth."""
    rng = np.random.default_rng(8)
    xyz = np.column_stack([rng.uniform(-3, 3, (60, 2)), np.zeros(60)])
    xyz[40:, 2] = rng.uniform(-0.6, 0.6, 20)
    bent = tuple(replace(interior(focal=cam.matrix[0, 0]), sigma_radial=0.1) for cam in (FAR, NEAR))
    radial = np.array([[0.02, -0.01], [-0.03, 0.02]])
    seen = [
        i.radial(*k).distort(project(cam, POINTS))
        for i, k, cam in zip(bent, radial, (FAR, NEAR), strict=True)
    ]
    points = replace(
        control(), pixels1=seen[0], pixels2=seen[1], lengths=((1, 2, 3.99), (4, 10, 2.5)),
        sigma_lengths=(0.05, np.nan),
    )  # fmt: skip
    points.xyz[2, :2] = points.xyz[9] = points.xyz[10, 2] = np.nan
    points.pixels1[3] = points.pixels2[8] = np.nan
    observations = PairObservations(
        interiors=bent,
        control=points,
        pick_used=np.arange(len(POINTS)) != 6,
        tie1=project(FAR, xyz) + rng.normal(0, 2, (60, 2)),
        tie2=project(NEAR, xyz) + rng.normal(0, 2, (60, 2)),
        tie_used=np.arange(60) % 7 > 0,
        wall=xyz[:, 2] == 0,
        wall_rows=rng.uniform(0.5, 2.0, (3, 60)),
        sigma_body=3.0,
        sigma_zoom=0.01,
        measured={"distance1": (16.1, 0.01), "delta_d": (7.0, 0.02)},
        sigma_tilt=0.01,
        lines=tuple(
            FacadeDirection(camera=n, name="upright", direction=way, sigma=0.003, count=50)
            for n, way in ((1, np.array([0.1, -0.9, 0.4])), (2, np.array([0.9, 0.2, -0.4])))
        ),
    )
    return observations, PairUnknowns(cameras=(FAR, NEAR), radial=radial)


def test_a_length_weighs_by_its_own_standard_deviation() -> None:
    observations, state = everything()
    plain = replace(observations, control=replace(observations.control, sigma_lengths=()))
    own, usual = (pair_equations(one, state)[0] for one in (observations, plain))
    (row,) = np.flatnonzero(own != usual)
    # The picks' share in metres on the wall, and 3 mm where nothing is said.
    picks = 1.41 * observations.sigma_pick * FAR.centre[2] / FAR.matrix[0, 0]
    least = min(0.003, observations.control.sigma.min())
    wanted = np.hypot(least, picks) / np.hypot(0.05, picks)
    assert own[row] / usual[row] == pytest.approx(wanted, rel=1e-9)


def test_the_jacobian_is_the_derivative_by_every_name() -> None:
    observations, state = everything()
    jacobian = pair_equations(observations, state)[1]
    for column, name in enumerate(NAMES):
        step = np.zeros(len(NAMES))
        # Pixels and metres, against logarithms, radians and k.
        step[column] = 1e-4 if name.split()[0] in ("column", "row", "X", "Y", "Z") else 1e-6
        ahead, behind = (pair_equations(observations, state.stepped(s))[0] for s in (step, -step))
        slope = (ahead - behind) / (2 * step[column])
        np.testing.assert_allclose(
            jacobian[:, column], slope, atol=1e-6 * np.abs(slope).max(), err_msg=name
        )


def test_lines_feed_the_tilt_by_their_precision_and_contradictions_are_named() -> None:
    exact = tuple(
        replace(interior(focal=cam.matrix[0, 0]), sigma_focal=1e-3) for cam in (FAR, NEAR)
    )
    points = control(sigma_px=0.3)
    wide = replace(points, sigma=np.full(points.sigma.shape, 0.03))
    problem = PairObservations(interiors=exact, control=wide, pick_used=np.ones(len(POINTS), bool))
    start = PairUnknowns(cameras=(FAR, NEAR))
    before = adjust(problem, start)

    def lines(angle_deg: float) -> tuple[FacadeDirection, FacadeDirection]:
        """Return uprights that come out of the wall by an angle, in the true cameras."""
        angle = np.deg2rad(angle_deg)
        way = np.array([0.0, np.cos(angle), np.sin(angle)])
        first, second = (
            FacadeDirection(
                camera=n, name="upright", direction=cam.rotation @ way, sigma=0.0035, count=50
            )
            for n, cam in ((1, FAR), (2, NEAR))
        )
        return first, second

    after = adjust(replace(problem, lines=lines(0.0)), start)
    for number, (cam, old, new) in enumerate(
        zip((FAR, NEAR), before.cameras, after.cameras, strict=True), start=1
    ):
        assert after.sigma("turn X", number) < 0.8 * before.sigma("turn X", number)
        out = [(c.rotation.T @ cam.rotation @ [0.0, 1.0, 0.0])[2] for c in (old, new)]
        assert abs(out[1]) <= abs(out[0])
    assert line_test(lines(0.0)[0], before, before.covariance) < 3
    test = line_test(lines(6.0)[0], before, before.covariance)
    assert test > 3
    said = contradiction_in_words(lines(6.0)[0], before.cameras, test)
    assert "upright lines of the far photo" in said
    assert "°" in said


def test_lines_turn_the_plane_of_calibrated_photos_and_nothing_else() -> None:
    calibrated = tuple(
        replace(interior(focal=cam.matrix[0, 0]), sigma_focal=5e-4, is_calibrated=True)
        for cam in (FAR, NEAR)
    )
    points = control(sigma_px=0.3)
    wide = replace(points, sigma=np.full(points.sigma.shape, 0.05))
    problem = PairObservations(
        interiors=calibrated, control=wide, pick_used=np.ones(len(POINTS), bool)
    )
    start = PairUnknowns(cameras=(FAR, NEAR))
    before = adjust(problem, start)
    way = np.array([0.0, np.cos(0.01), np.sin(0.01)])
    lines = tuple(
        FacadeDirection(
            camera=n, name="upright", direction=cam.rotation @ way, sigma=0.003, count=50
        )
        for n, cam in ((1, FAR), (2, NEAR))
    )
    after = adjust(replace(problem, lines=lines), start)
    for old, new in zip(before.cameras, after.cameras, strict=True):
        np.testing.assert_allclose(new.matrix, old.matrix, rtol=0, atol=1e-6)

    def relative(cameras: tuple[Pinhole, Pinhole]) -> np.ndarray:
        far, near = cameras
        base = far.rotation @ (near.centre - far.centre)
        return np.column_stack([near.rotation @ far.rotation.T, base / np.linalg.norm(base)])

    np.testing.assert_allclose(relative(after.cameras), relative(before.cameras), atol=1e-12)
    out = [lines[0].in_frame(pair.cameras[0])[2] for pair in (before, after)]
    assert abs(out[1]) < 0.8 * abs(out[0])
    assert after.sigma("turn X", 1) < before.sigma("turn X", 1)
    assert after.sigma("column", 1) == pytest.approx(before.sigma("column", 1), rel=1e-6)
    test = family_test(lines, problem, before, pair_equations)
    level = (replace(lines[0], direction=FAR.rotation @ [0.0, np.cos(0.2), np.sin(0.2)]),)
    assert family_test(level, problem, before, pair_equations) > 3 * test


def test_points_measured_in_part_tell_less_than_measured_whole() -> None:
    # Differences of residuals once made a point of unknown X and Y look like certain knowledge.
    whole, part = control(sigma_px=0.3), control(sigma_px=0.3)
    part.xyz[5, :2] = part.xyz[9] = np.nan
    part.pixels1[3] = np.nan
    inputs = photos(far=FAR.matrix[0, 0], near=NEAR.matrix[0, 0])
    sigmas = [
        orient_pair(inputs, control=points, site=SiteMeasures()).adjusted.sigma("Z", 1)
        for points in (whole, part)
    ]
    assert sigmas[1] > sigmas[0]
