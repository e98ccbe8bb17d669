"""Fisheye cameras against cv2.fisheye and 40 digits: projection, rays, adjustment, files."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree

import cv2
import mpmath as mp
import numpy as np
import pytest
from click.testing import CliRunner

from multimedia import (
    Brown,
    Camera,
    Fisheye,
    FlatInterface,
    ImagePoints,
    InputError,
    Layers,
    ObjectPoints,
    Project,
    Sensor,
    Unknowns,
    bundle_adjust,
    convert,
    image_rays,
    intersect,
    project,
    projection_status,
    read_project,
    resect,
    write_experiment,
    write_project,
)
from multimedia.media.camera import EXTERIOR
from multimedia.media.projection import project_with_jacobian
from tests.builders.commands import multimedia_command as main
from tests.rounding import EPS

mp.mp.dps = 40
TERMS = {"k1": -0.02, "k2": 0.006, "k3": -0.003, "k4": 0.0005}
LENS = Fisheye(**TERMS, scale=1.002)
SENSOR = Sensor(width=1600, height=1200, pixel_size=np.array([0.003, 0.0031]))
WATER = FlatInterface(layers=Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,)))
INTERIOR = ("c", "xh", "yh", "k1", "k2", "k3", "k4", "scale")


def camera(eye=(0.1, -0.2, 0.5), name="eye", **fields) -> Camera:
    """Return a fisheye of 1.6 mm that looks down and a little aside."""
    fields = {"distortion": LENS, "principal_point": (0.03, -0.02)} | fields
    view = Camera.looking_at(eye, (0.0, 0.0, -0.4), principal_distance=1.6, name=name)
    return replace(view, sensor=SENSOR, **fields)


def by_formula(values, vector):
    """Image coordinates of a vector in the camera frame, typed from the definition, 40 digits."""
    x, y, z = vector
    across = mp.sqrt(x * x + y * y)
    theta = mp.atan2(across, -z)
    bent = theta * (1 + sum(values[f"k{i}"] * theta ** (2 * i) for i in (1, 2, 3, 4)))
    return (
        values["xh"] + values["c"] * values["scale"] * bent * x / across,
        values["yh"] + values["c"] * bent * y / across,
    )


def test_cv2_sees_the_same_pixels_up_to_89_degrees() -> None:
    rng = np.random.default_rng(3)
    theta, turn = rng.uniform(0, np.radians(89), 200), rng.uniform(0, 2 * np.pi, 200)
    rays = np.stack([np.sin(theta) * np.cos(turn), np.sin(theta) * np.sin(turn), np.cos(theta)])
    view = Camera(
        centre=np.zeros(3), rotation=np.eye(3), principal_distance=1.6, distortion=LENS,
        principal_point=np.array([0.03, -0.02]), sensor=SENSOR,
    )  # fmt: skip
    ours = SENSOR.pixel_from_image(project(view, rays.T * (1, -1, -1)))
    matrix = np.diag([1.6 * 1.002 / 0.003, 1.6 / 0.0031, 1.0])
    matrix[:2, 2] = [799.5 + 0.03 / 0.003, 599.5 + 0.02 / 0.0031]
    terms = np.array(list(TERMS.values()))
    theirs, _ = cv2.fisheye.projectPoints(rays.T[None], np.zeros(3), np.zeros(3), matrix, terms)
    assert np.abs(ours - theirs[0]).max() < 1e-9
    back = view.measured(view.ideal(project(view, rays.T * (1, -1, -1))))
    assert np.abs(SENSOR.pixel_from_image(back) - ours).max() < 1e-9
    _, directions = image_rays(view, SENSOR.image_from_pixel(ours))
    assert np.abs(directions - rays.T * (1, -1, -1)).max() < 1e-12


def test_image_and_derivatives_equal_40_digits() -> None:
    view = camera()
    points = np.array([(0.3, 0.1, -0.2), (-1.5, 0.4, -0.3), (0.1, -0.2, -0.9)])
    names = (*EXTERIOR, *INTERIOR)
    seen = project_with_jacobian(view, points, camera_names=names)
    values = {name: mp.mpf(view.value(name)) for name in INTERIOR}
    for k, vector in enumerate(view.vectors_to(points)):
        exact = [mp.mpf(float(v)) for v in vector]
        for axis in (0, 1):
            want = by_formula(values, exact)[axis]
            assert abs(seen.image[k, axis] - want) < 64 * EPS * abs(want)
            for name in INTERIOR:
                slope = mp.diff(
                    lambda v, n=name, a=axis, e=exact: by_formula({**values, n: v}, e)[a],
                    values[name],
                )
                found = seen.by_camera[k, axis, names.index(name)]
                assert abs(found - slope) < 1e-12 * max(1, abs(slope)), name
    step = 1e-6 * np.eye(6)
    for j, change in enumerate(step):  # the pose by differences of the tested image
        up, down = (view.stepped(EXTERIOR, s * change) for s in (1, -1))
        slope = (project(up, points) - project(down, points)) / 2e-6
        assert np.abs(seen.by_camera[:, :, j] - slope).max() < 1e-8
    on_axis = view.centre + view.looks_along
    here = project_with_jacobian(view, on_axis[None], camera_names=names)
    assert np.abs(here.image - view.principal_point).max() < 1e-15
    assert np.isfinite(here.by_camera).all()


def test_the_model_ends_at_90_degrees_or_where_it_turns_back() -> None:
    view = camera(rotation=np.eye(3))
    points = view.centre + np.array([(1, 0, -0.01), (1, 0, 0.0), (1, 0, 0.2)])
    assert np.isfinite(project(view, points)).all(axis=1).tolist() == [True, False, False]
    beyond = "90 degrees or more off the axis"
    assert projection_status(view, points)[1:] == [beyond, beyond]
    # theta (1 - theta^2 / 3) grows up to theta = 1 rad, to 2/3 there.
    short = replace(view, distortion=Fisheye(k1=-1 / 3))
    assert short.distortion.farthest == pytest.approx(1.0, abs=4 * EPS)
    rays = [(np.sin(t), 0, -np.cos(t)) for t in (0.99, 1.01)]
    assert np.isnan(project(short, view.centre + rays)).all(axis=1).tolist() == [False, True]
    assert projection_status(short, view.centre + rays)[1] == "outside the lens model"
    edge = np.array([(1.6 * 0.66, 0.0), (1.6 * 0.67, 0.0)]) + short.principal_point
    assert np.isnan(short.ideal(edge)).all(axis=1).tolist() == [False, True]


def tank(noise=0.0, **fields) -> tuple[Project, np.ndarray]:
    """Return three fisheyes above a calibration body in water, and its points."""
    rng = np.random.default_rng(8)
    body = rng.uniform((-0.9, -0.7, -0.8), (0.9, 0.7, -0.05), (60, 3))
    eyes = [(-0.5, 0.1, 0.5), (0.5, 0.2, 0.55), (0.0, -0.5, 0.45)]
    cameras = tuple(camera(e, name=f"c{k}", **fields) for k, e in enumerate(eyes))
    ids = tuple(f"p{k}" for k in range(len(body)))
    image = np.concatenate([project(c, body, WATER) for c in cameras])
    return Project(
        cameras=cameras, media={"tank": WATER}, media_of=("tank",) * 3,
        object_points=ObjectPoints(ids=ids, xyz=body),
        image_points=ImagePoints(
            cameras=tuple(c.name for c in cameras for _ in ids), ids=ids * 3,
            image=image + noise * rng.standard_normal(image.shape),
        ),
    ), body  # fmt: skip


def test_resection_and_intersection_through_water() -> None:
    given, body = tank()
    image = given.image_points.image[:60]
    start = replace(given.cameras[0], centre=np.array([0.0, 0.0, 1.0]), rotation=np.eye(3))
    rough = replace(start, distortion=Fisheye(), principal_distance=1.65)
    found = resect(rough, body, image, WATER, estimate=INTERIOR).camera
    assert np.abs(found.centre - given.cameras[0].centre).max() < 1e-9
    assert [found.value(n) for n in INTERIOR] == pytest.approx(
        [given.cameras[0].value(n) for n in INTERIOR], abs=1e-8
    )
    images = given.image_points.image.reshape(3, 60, 2)
    assert np.abs(intersect(given.cameras, images, WATER).xyz - body).max() < 1e-10
    with pytest.raises(InputError, match="p1 is no camera parameter of its lens model"):
        resect(rough, body, image, WATER, estimate=("p1",))


def test_bundle_adjustment_finds_interior_and_index_within_their_sigmas() -> None:
    given, _ = tank(noise=0.0003)
    wrong = {"distortion": Fisheye(k1=-0.01), "principal_distance": 1.62}
    start = replace(
        given, cameras=tuple(replace(c, **wrong) for c in given.cameras), sigma_image=0.0003
    )
    wanted = Unknowns(interior=INTERIOR[:-1], shared_interior=True, media=("index3",))
    truth = {n: given.cameras[0].value(n) for n in INTERIOR[:-1]} | {"index3": 1.337}
    fixed = {"distortion": Fisheye(k1=-0.01, scale=LENS.scale)}
    start = replace(start, cameras=tuple(replace(c, **fixed) for c in start.cameras))
    result = bundle_adjust(start, wanted)
    for name, value in truth.items():
        label = name if name == "index3" else f"interior:{name}"
        assert abs(result.value(label) - value) < 4 * result.sigma(label), name
    assert result.sigma0 == pytest.approx(0.0003, rel=0.15)
    units = {name: unit for name, _, _, unit in result.rows()}
    assert (units["interior:k1"], units["interior:c"]) == ("", "mm")


def test_interior_names_are_those_of_the_lens_and_sets_of_one_kind() -> None:
    given, _ = tank()
    with pytest.raises(InputError, match="no camera's lens model has p1; camera c0 has c, xh"):
        bundle_adjust(given, Unknowns(interior=("p1",)))
    central = replace(given.cameras[0], distortion=Brown())
    mixed = replace(given, cameras=(central, *given.cameras[1:]))
    with pytest.raises(InputError, match="c0 and c1 have different lens models"):
        bundle_adjust(mixed, Unknowns(interior=("c",), shared_interior=True))


def test_project_file_holds_a_fisheye_and_names_strange_keys(tmp_path) -> None:
    given, _ = tank()
    write_project(tmp_path / "tank.toml", given)
    again = read_project(tmp_path / "tank.toml")
    assert again.cameras[0].distortion == LENS
    text = (tmp_path / "tank.toml").read_text()
    assert 'convention = "fisheye"' in text
    (tmp_path / "tank.toml").write_text(text.replace("k4 =", "p1 =", 1))
    with pytest.raises(InputError, match=r"camera c0, distortion: unknown key 'p1'.*k4"):
        read_project(tmp_path / "tank.toml")
    (tmp_path / "tank.toml").write_text(text)
    command = ["resect", str(tmp_path / "tank.toml"), "--estimate", "c,k1,k4", "--json"]
    assert CliRunner().invoke(main, command).exit_code == 0


@pytest.mark.parametrize("target", ["model", "cameras.xml", "rig", "one.json"])
def test_other_programs_give_the_same_pixels_back(target, tmp_path) -> None:
    given, body = tank()
    straight = replace(given, media_of=("",) * 3, media={})
    straight = straight if target != "one.json" else replace(
        straight, cameras=given.cameras[:1], media_of=("",), image_points=ImagePoints()
    )  # fmt: skip
    write_project(tmp_path / "tank.toml", straight)
    if target == "rig":
        (tmp_path / target).mkdir()
    form = {"model": "colmap", "cameras.xml": "metashape"}.get(target, "opencv")
    convert(tmp_path / "tank.toml", tmp_path / target, form=form)
    convert(tmp_path / target, tmp_path / "back.toml", pixel_size=0.003)
    for old, new in zip(
        straight.cameras, read_project(tmp_path / "back.toml").cameras, strict=True
    ):
        assert isinstance(new.distortion, Fisheye)
        one, two = (c.sensor.pixel_from_image(project(c, body)) for c in (old, new))
        assert np.abs(one - two).max() < 1e-9
    if target == "model":
        words = (tmp_path / "model/cameras.txt").read_text().splitlines()[1].split()
        assert words[1] == "OPENCV_FISHEYE"
        assert [float(w) for w in words[8:]] == list(TERMS.values())
        numbers = np.array(words[4:8], float)
        place = given.cameras[0].vectors_to(body) * (1, -1, -1)
        matrix = np.array([[numbers[0], 0, numbers[2]], [0, numbers[1], numbers[3]], [0, 0, 1]])
        seen, _ = cv2.fisheye.projectPoints(
            place[None], np.zeros(3), np.zeros(3), matrix, np.array(list(TERMS.values()))
        )
        ours = SENSOR.pixel_from_image(project(given.cameras[0], body))
        assert np.abs(seen[0] - 0.5 - ours).max() < 1e-9  # COLMAP counts from the corner
    if target == "cameras.xml":
        sensor = ElementTree.parse(tmp_path / target).find(".//sensor")
        assert sensor is not None
        assert sensor.get("type") == "fisheye"
        assert float(sensor.findtext("calibration/k4") or 0) == TERMS["k4"]
        text = (tmp_path / target).read_text()
        bad = tmp_path / "bad.xml"
        bad.write_text(text.replace("<k4>", "<p1>0.1</p1><k4>", 1))
        with pytest.raises(InputError, match="no lens model of OpenCV's comes nearer"):
            convert(bad, tmp_path / "no.toml")
        bad.write_text(text.replace("<k4>", "<b2>0.5</b2><k4>", 1))
        with pytest.raises(InputError, match=r"has a skew of 0\.(5|49999)"):
            convert(bad, tmp_path / "no.toml")


def test_opencv_and_ros_say_in_their_own_way_that_a_lens_is_a_fisheye(tmp_path) -> None:
    head = "%YAML:1.0\nimage_width: 1600\nimage_height: 1200\n"
    matrix = (
        "rows: 3\n   cols: 3\n   dt: d\n   data: [500., 0., 800., 0., 500., 600., 0., 0., 1.]\n"
    )
    terms = "rows: 1\n   cols: 4\n   dt: d\n   data: [-0.02, 0.006, -0.003, 0.0005]\n"
    body = f"camera_matrix: !!opencv-matrix\n   {matrix}distortion_coefficients: !!opencv-matrix\n"
    for number, said in enumerate(("fisheye_model: 1\n", "distortion_model: equidistant\n", "")):
        file = tmp_path / f"lens{number}.yml"
        file.write_text(f"{head}{said}{body}   {terms}")
        convert(file, tmp_path / f"lens{number}.toml")
        lens = read_project(tmp_path / f"lens{number}.toml").cameras[0].distortion
        assert isinstance(lens, Fisheye if said else Brown)
    assert lens.k2 != TERMS["k2"]  # four terms without a name are k1 k2 p1 p2


def test_openptv_cannot_hold_a_fisheye(tmp_path) -> None:
    given, _ = tank()
    with pytest.raises(InputError, match="camera c0: has a fisheye lens, for which OpenPTV has no"):
        write_experiment(tmp_path / "experiment", given)
    assert not (tmp_path / "experiment").exists()
