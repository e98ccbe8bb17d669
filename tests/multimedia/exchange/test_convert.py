"""Cameras of other programs: their own formulas, written out here, give our pixels."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.optimize import brentq

from multimedia import (
    Brown,
    Camera,
    Convention,
    FlatInterface,
    ImagePoints,
    InputError,
    Interfaces,
    Layers,
    ObjectPoints,
    Plane,
    Project,
    Sensor,
    Sphere,
    convert,
    project,
    read_project,
    write_project,
)
from tests.builders.commands import multimedia_command as main

SENSOR = Sensor(width=1936, height=1216, pixel_size=np.array([0.00345, 0.00346]))
RNG = np.random.default_rng(31)
POINTS = RNG.uniform((-0.3, -0.2, -0.5), (0.3, 0.2, -0.1), (30, 3))
LENS = Brown(k1=-2e-4, k2=3e-6, p1=2e-5, p2=-3e-5)


def cameras(**lens: float) -> tuple[Camera, ...]:
    """Return three cameras 1.3 m above the points."""
    eyes = [(-0.4, 0.1, 1.3), (0.5, 0.0, 1.2), (0.1, 0.5, 1.4)]
    return tuple(
        replace(
            Camera.looking_at(eye, (0, 0, -0.3), principal_distance=8.0 + 0.01 * k, name=f"cam{k}"),
            sensor=SENSOR, principal_point=(0.02 * k, -0.03), distortion=replace(LENS, **lens),
        )
        for k, eye in enumerate(eyes, start=1)
    )  # fmt: skip


def made(views=None, **fields) -> Project:
    """Return a project whose image points are those of the first ten points."""
    views = cameras() if views is None else views
    ids = [str(7 * k + 3) for k in range(len(POINTS))]
    media = fields.get("media", {})
    image = [
        project(c, POINTS[:10], media[n] if n else None)
        for c, n in zip(views, fields.get("media_of", [""] * len(views)), strict=True)
    ]
    images = ImagePoints(
        cameras=tuple(c.name for c in views for _ in range(10)), ids=tuple(ids[:10] * len(views)),
        image=np.concatenate(image),
    )  # fmt: skip
    objects = ObjectPoints(ids=tuple(ids), xyz=POINTS)
    return Project(cameras=tuple(views), object_points=objects, image_points=images, **fields)


def pixels(camera: Camera, points: np.ndarray = POINTS, media=None) -> np.ndarray:
    return camera.sensor.pixel_from_image(project(camera, points, media))


def brown(x: np.ndarray, y: np.ndarray, k, p) -> tuple[np.ndarray, np.ndarray]:
    """Return OpenCV's distortion: k1 k2 k3 and p1 p2."""
    r2 = x * x + y * y
    q = 1 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3
    dx = 2 * p[0] * x * y + p[1] * (r2 + 2 * x * x)
    dy = p[0] * (r2 + 2 * y * y) + 2 * p[1] * x * y
    return x * q + dx, y * q + dy


def save(tmp_path: Path, content: Project) -> Path:
    path = tmp_path / "p.toml"
    write_project(path, content)
    return path


def colmap_pixels(folder: Path, image: int, points: np.ndarray) -> np.ndarray:
    """Return COLMAP's pixels, integers at pixel centres, by its documented formats."""
    lines = [x for x in (folder / "images.txt").read_text().splitlines() if not x.startswith("#")]
    words = lines[2 * image].split()
    w, x, y, z = (float(v) for v in words[1:5])
    turn = np.array([
        [1 - 2 * y * y - 2 * z * z, 2 * x * y - 2 * w * z, 2 * x * z + 2 * w * y],
        [2 * x * y + 2 * w * z, 1 - 2 * x * x - 2 * z * z, 2 * y * z - 2 * w * x],
        [2 * x * z - 2 * w * y, 2 * y * z + 2 * w * x, 1 - 2 * x * x - 2 * y * y],
    ])  # fmt: skip
    rows = [x.split() for x in (folder / "cameras.txt").read_text().splitlines() if x[0] != "#"]
    row = next(row for row in rows if row[0] == words[8])
    fx, fy, cx, cy, *d = (float(v) for v in row[4:] if v not in ("FLATPORT", "DOMEPORT"))
    d = {"PINHOLE": [0] * 5, "OPENCV": [*d[:4], 0], "FULL_OPENCV": d[:5]}[row[1]]
    u, v, t = (points @ turn.T + [float(v) for v in words[5:8]]).T
    a, b = brown(u / t, v / t, (d[0], d[1], d[4]), d[2:4])
    return np.column_stack([fx * a + cx, fy * b + cy]) - 0.5


@pytest.mark.parametrize("lens", [LENS, Brown(), replace(LENS, k3=1e-8, scale=1.002)])
def test_colmap_sees_the_same_pixels_and_comes_back(tmp_path, lens):
    content = made(tuple(replace(c, distortion=lens) for c in cameras()))
    done = convert(save(tmp_path, content), tmp_path / "model")
    assert done.target == "colmap"
    assert done.remarks == ()
    for k, camera in enumerate(content.cameras):
        assert np.abs(colmap_pixels(tmp_path / "model", k, POINTS) - pixels(camera)).max() < 1e-9
    convert(tmp_path / "model", tmp_path / "back.toml", pixel_size=0.00345)
    back = read_project(tmp_path / "back.toml")
    assert back.camera_names == content.camera_names
    for got, want in zip(back.cameras, content.cameras, strict=True):
        assert np.abs(pixels(got) - pixels(want)).max() < 1e-9
        assert got.centre == pytest.approx(want.centre, abs=1e-14)
        assert np.abs(got.rotation - want.rotation).max() < 1e-14
    assert back.object_points.ids == content.object_points.ids
    assert np.array_equal(back.object_points.xyz, content.object_points.xyz)
    assert back.image_points.ids == content.image_points.ids
    places = [
        p.cameras[0].sensor.pixel_from_image(p.image_points.image[:10]) for p in (back, content)
    ]
    assert np.abs(places[0] - places[1]).max() < 1e-9


def test_colmaps_own_example_is_read(tmp_path):
    # From COLMAP's documentation of its output format.
    (tmp_path / "cameras.txt").write_text(
        "# Camera list\n1 SIMPLE_RADIAL 3072 2304 2559.69 1536 1152 -0.0218531\n"
    )
    (tmp_path / "images.txt").write_text(
        "# Image list\n"
        "1 0.851773 0.0165051 0.503764 -0.142941 -0.737434 1.02973 3.74354 1 a/P1180141.JPG\n"
        "2362.39 248.498 63390 1784.7 268.254 59027 1784.7 268.254 -1\n"
        "2 0.851773 0.0165051 0.503764 -0.142941 -0.737434 1.02973 3.74354 1 a/P1180142.JPG\n\n"
    )
    (tmp_path / "points3D.txt").write_text(
        "63390 1.67241 0.292931 0.609726 115 121 122 1.33927 1 0 2 1\n"
    )
    got = convert(tmp_path, tmp_path / "p.toml", unit="mm").project
    assert got.camera_names == ("P1180141", "P1180142")
    assert got.image_points.ids == ("63390", "59027")
    sensor = got.cameras[0].sensor
    assert sensor.pixel_from_image(got.image_points.image)[0] == pytest.approx((2361.89, 247.998))
    assert got.unit == "mm"
    # The centre is -R^T T; R from the axis and angle of the quaternion, by OpenCV.
    q = np.array([0.851773, 0.0165051, 0.503764, -0.142941])
    q /= np.linalg.norm(q)
    turn = cv2.Rodrigues(q[1:] / np.linalg.norm(q[1:]) * 2 * np.arccos(q[0]))[0]
    assert got.cameras[0].centre == pytest.approx(-turn.T @ [-0.737434, 1.02973, 3.74354])


def refracted(direction: np.ndarray, normal: np.ndarray, ratio: float) -> np.ndarray:
    """Return the direction behind a face whose normal points against the ray (vector Snell)."""
    cosine = -direction @ normal
    behind = np.sqrt(1 - ratio**2 * (1 - cosine**2))
    return ratio * direction + (ratio * cosine - behind) * normal


def flat_port_ray(ray: np.ndarray, values: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return where a ray leaves a flat port and whither, in COLMAP's camera frame."""
    normal, (distance, glass, na, ng, nw) = np.array(values[:3]), values[3:]
    inner = ray * distance / (ray @ normal)
    inside = refracted(ray, -normal, na / ng)
    outer = inner + inside * glass / (inside @ normal)
    return outer, refracted(inside, -normal, ng / nw)


def dome_ray(ray: np.ndarray, values: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """Return where a ray leaves a dome and whither, in COLMAP's camera frame."""
    centre, (radius, glass, na, ng, nw) = np.array(values[:3]), values[3:]
    place = np.zeros(3)
    for size, ratio in ((radius, na / ng), (radius + glass, ng / nw)):
        away = place - centre
        along = away @ ray
        place = place + ray * (-along + np.sqrt(along**2 - away @ away + size**2))
        ray = refracted(ray, -(place - centre) / size, ratio)
    return place, ray


PORTS = {
    "flat": FlatInterface(
        layers=Layers(indices=(1.0, 1.49, 1.337), thicknesses=(0.012,)),
        point=(0.001, 0, -0.05), normal=(0.03, -0.02, 1), moves_with_camera=True,
    ),
    "dome": Interfaces(
        surfaces=(Sphere(centre=[0.001, -0.002, 0.003], radius=0.06),
                  Sphere(centre=[0.001, -0.002, 0.003], radius=0.067)),
        indices=(1.0, 1.52, 1.34), with_camera=(True, True),
    ),
    "tank glass that stands still": FlatInterface(
        layers=Layers(indices=(1.0, 1.5, 1.333), thicknesses=(0.01,)), point=(0, 0, 0.02),
        normal=(0.01, 0.02, 1),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PORTS)
def test_colmaps_ports_bend_rays_as_ours(tmp_path, name):
    views, port = cameras(), PORTS[name]
    content = made(views, media={"port": port}, media_of=("port",) * 3)
    convert(save(tmp_path, content), tmp_path / "model", form="colmap")
    rows = [
        line.split() for line in (tmp_path / "model" / "cameras.txt").read_text().splitlines()[1:]
    ]
    convert(tmp_path / "model", tmp_path / "back.toml", pixel_size=0.00345)
    back = read_project(tmp_path / "back.toml")
    trace = dome_ray if name == "dome" else flat_port_ray
    for k, camera in enumerate(views):
        kind = "DOMEPORT" if name == "dome" else "FLATPORT"
        values = [float(v) for v in rows[k][rows[k].index(kind) + 1 :]]
        fx, fy, cx, cy, *d = (float(v) for v in rows[k][4:12])
        for ray in np.array([[0.0, 0.0, 1.0], [0.2, -0.1, 1.0], [-0.25, 0.15, 1.0]]):
            a, b = brown(ray[0], ray[1], (d[0], d[1], 0.0), d[2:4])
            place, leaves = trace(ray / np.linalg.norm(ray), values)
            there = place + 0.7 * leaves
            # Ours sees that point in the pixel the ray started from.
            turn = camera.rotation @ np.diag([1.0, -1.0, -1.0])
            point = camera.centre + turn @ there
            want = np.array([fx * a + cx, fy * b + cy]) - 0.5
            assert np.abs(pixels(camera, point, port) - want).max() < 1e-7
            again = back.cameras[k]
            assert np.abs(pixels(again, point, back.interface_of(k)) - want).max() < 1e-7


def test_media_that_colmap_lacks_are_refused(tmp_path):
    wedge = Interfaces(
        surfaces=(Plane(point=[0, 0, 0.2]), Plane(point=[0, 0, 0], normal=[0.01, 0, 1])),
        indices=(1, 1.5, 1.33),
    )
    path = save(tmp_path, made(media={"w": wedge}, media_of=("w",) * 3))
    with pytest.raises(InputError, match=r"cam1: COLMAP knows flat ports"):
        convert(path, tmp_path / "model")
    assert not (tmp_path / "model").exists()


_METASHAPE = ("f", "cx", "cy", "k1", "k2", "k3", "p1", "p2", "b1")


def metashape_pixels(path: Path, label: str, points: np.ndarray) -> np.ndarray:
    """Return Metashape's pixels, integers at centres: its manual's frame camera model."""
    root = ElementTree.parse(path).getroot()
    camera = next(c for c in root.iter("camera") if c.get("label") == label)
    matrix = np.reshape([float(v) for v in camera.findtext("transform").split()], (4, 4))
    node = next(s for s in root.iter("sensor") if s.get("id") == camera.get("sensor_id"))
    node = node.find("calibration")
    value = {key: float(node.findtext(key) or 0) for key in _METASHAPE}
    chunk = root.find("./chunk/transform")
    turn = np.reshape([float(v) for v in chunk.findtext("rotation").split()], (3, 3))
    shift = np.array([float(v) for v in chunk.findtext("translation").split()])
    local = (points - shift) @ turn / float(chunk.findtext("scale"))
    x, y, z = (np.linalg.inv(matrix) @ np.column_stack([local, np.ones(len(local))]).T)[:3]
    x, y = x / z, y / z
    r2 = x * x + y * y
    q = 1 + value["k1"] * r2 + value["k2"] * r2**2 + value["k3"] * r2**3
    xd = x * q + value["p1"] * (r2 + 2 * x * x) + 2 * value["p2"] * x * y
    yd = y * q + value["p2"] * (r2 + 2 * y * y) + 2 * value["p1"] * x * y
    size = node.find("resolution")
    u = int(size.get("width")) / 2 + value["cx"] + xd * value["f"] + xd * value["b1"]
    v = int(size.get("height")) / 2 + value["cy"] + yd * value["f"]
    return np.column_stack([u, v]) - 0.5


def test_metashape_sees_the_same_pixels_and_comes_back(tmp_path):
    content = made(cameras(scale=1.001, k3=1e-8))
    done = convert(save(tmp_path, content), tmp_path / "cameras.xml")
    assert done.target == "metashape"
    assert "points are not part" in " ".join(done.remarks)
    # A chunk that is turned, shifted and scaled, as after aligning to markers.
    turn = cv2.Rodrigues(np.array([0.3, -1.0, 2.0]))[0]
    text = (tmp_path / "cameras.xml").read_text()
    text = text.replace(
        "<rotation>1 0 0 0 1 0 0 0 1<", f"<rotation>{' '.join(map(repr, turn.ravel().tolist()))}<"
    )
    text = text.replace("<translation>0 0 0<", "<translation>10 -20 5<")
    text = text.replace("<scale>1<", "<scale>2.5<")
    (tmp_path / "turned.xml").write_text(text)
    for name, points in (("cameras", POINTS), ("turned", 2.5 * POINTS @ turn.T + [10, -20, 5])):
        convert(tmp_path / f"{name}.xml", tmp_path / f"{name}.toml")
        back = read_project(tmp_path / f"{name}.toml")
        for got, want in zip(back.cameras, content.cameras, strict=True):
            theirs = metashape_pixels(tmp_path / f"{name}.xml", got.name, points)
            assert np.abs(theirs - pixels(want)).max() < 1e-8
            assert np.abs(pixels(got, points) - theirs).max() < 1e-8


def test_xml_of_opencv_and_yaml_of_ros_are_read_and_nothing_crashes(tmp_path):
    matrix = np.array([[900.0, 0, 320.5], [0, 905.0, 239.0], [0, 0, 1]])
    storage = cv2.FileStorage(str(tmp_path / "a.xml"), cv2.FILE_STORAGE_WRITE)
    for key, value in (("image_width", 640), ("image_height", 480), ("camera_matrix", matrix),
                       ("distortion_coefficients", np.array([[-0.2, 0.05, 0, 0, 0]]))):  # fmt: skip
        storage.write(key, value)
    storage.release()
    (tmp_path / "b.yaml").write_text(
        "image_width: 640\nimage_height: 480\ncamera_name: left\ncamera_matrix:\n  rows: 3\n"
        "  cols: 3\n  data: [900., 0., 320.5, 0., 905.,\n    239., 0., 0., 1.]\n"
        "distortion_model: plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n"
        "  data: [-0.2, 0.05, 0., 0., 0.]\n"
    )
    one, two = (convert(tmp_path / n, tmp_path / f"{n}.toml").project for n in ("a.xml", "b.yaml"))
    seen = [pixels(p.cameras[0], POINTS + np.array([0, 0, 2])) for p in (one, two)]
    assert np.isfinite(seen[0]).all()
    assert np.array_equal(*seen)
    assert "has no pose" in one.remarks[0]
    text = (tmp_path / "a.xml").read_text()
    (tmp_path / "a.xml").write_text(text.replace("905", "9 05"))
    with pytest.raises(InputError, match="camera_matrix is damaged"):
        convert(tmp_path / "a.xml", tmp_path / "c.toml")


@pytest.mark.parametrize("ending", [".yml", ".json"])
def test_opencv_sees_the_same_pixels_and_comes_back(tmp_path, ending):
    content = made(cameras(k3=1e-8)[:1])
    target = tmp_path / f"lens{ending}"
    convert(save(tmp_path, content), target, form="opencv")
    storage = cv2.FileStorage(str(target), cv2.FILE_STORAGE_READ)
    turn, shift, matrix, terms = (
        storage.getNode(key).mat() for key in ("R", "T", "camera_matrix", "distortion_coefficients")
    )
    storage.release()
    theirs = cv2.projectPoints(POINTS, cv2.Rodrigues(turn)[0], shift, matrix, terms)[0][:, 0]
    assert np.abs(theirs - pixels(content.cameras[0])).max() < 1e-9
    convert(target, tmp_path / "back.toml")
    back = read_project(tmp_path / "back.toml").cameras[0]
    assert np.abs(pixels(back) - theirs).max() < 1e-9


def test_several_cameras_make_a_folder_of_opencv_files(tmp_path):
    given = cameras(k3=1e-8)
    source = save(tmp_path, made(given))
    said = convert(source, tmp_path / "lenses", form="opencv").remarks
    assert not any("exist" in remark for remark in said)
    assert {file.stem for file in (tmp_path / "lenses").iterdir()} == {c.name for c in given}
    back = convert(tmp_path / "lenses", tmp_path / "back.toml").project
    for camera in given:
        again = back.cameras[back.camera_index(camera.name)]
        assert np.abs(pixels(again) - pixels(camera)).max() < 1e-9
    with pytest.raises(InputError, match=r"holds .*\.yml already; add --overwrite"):
        convert(source, tmp_path / "lenses", form="opencv")
    (tmp_path / "odd").mkdir()
    odd = save(tmp_path / "odd", made((replace(given[0], name="dive/1"), *given[1:])))
    with pytest.raises(InputError, match="camera 'dive/1' cannot give its name to a file"):
        convert(odd, tmp_path / "other", form="opencv")
    assert not (tmp_path / "other").exists()


def test_plain_json_rodrigues_vectors_and_stereo_files_are_read(tmp_path):
    matrix = [[900.0, 0, 320.5], [0, 905.0, 239.0], [0, 0, 1]]
    terms, rvec, tvec = [-0.2, 0.05, 0.001, -0.002, 0.01], [0.1, -0.2, 0.05], [0.1, 0.2, 1.5]
    plain = {"mtx": matrix, "dist": [terms], "image_size": [640, 480], "rvec": rvec, "tvec": tvec}
    (tmp_path / "plain.json").write_text(json.dumps(plain))
    stereo = {"K1": matrix, "D1": terms, "K2": matrix, "D2": terms, "image_size": [640, 480],
              "R": cv2.Rodrigues(np.array(rvec))[0].tolist(), "T": tvec}  # fmt: skip
    (tmp_path / "stereo.json").write_text(json.dumps(stereo))
    theirs = cv2.projectPoints(
        POINTS, np.array(rvec), np.array(tvec), np.array(matrix), np.array(terms)
    )[0][:, 0]
    one = convert(tmp_path / "plain.json", tmp_path / "a.toml").project.cameras[0]
    assert np.abs(pixels(one) - theirs).max() < 1e-9
    first, second = convert(tmp_path / "stereo.json", tmp_path / "b.toml").project.cameras
    assert np.abs(pixels(second) - theirs).max() < 1e-9
    assert np.array_equal(first.centre, np.zeros(3))


WATER = FlatInterface(layers=Layers(indices=(1.0, 1.333)), point=(0, 0, 0.03))


def test_aquacal_refracts_to_the_same_pixels_and_comes_back(tmp_path):
    content = made(cameras(k3=1e-8), media={"sea": WATER}, media_of=("sea",) * 3)
    done = convert(save(tmp_path, content), tmp_path / "c.json", form="aquacal")
    assert "turned about X" in " ".join(done.remarks)
    data = json.loads((tmp_path / "c.json").read_text())
    assert data["version"] == "1.0"
    points = POINTS * [1, -1, -1]
    n = data["interface"]["n_air"] / data["interface"]["n_water"]
    for camera in content.cameras:
        node = data["cameras"][camera.name]
        turn, shift = (np.array(node["extrinsics"][key]) for key in ("R", "t"))
        centre, level = -turn.T @ shift, node["water_z"]
        for point, want in zip(points, pixels(camera, media=WATER), strict=True):
            # Where on the way from below the camera to below the point Snell's law holds.
            away = point[:2] - centre[:2]
            far = np.linalg.norm(away)

            def miss(s, far=far, up=level - centre[2], down=point[2] - level):
                return s / np.hypot(s, up) - (far - s) / np.hypot(far - s, down) / n

            s = brentq(miss, 0.0, far, xtol=1e-15)
            crossing = np.array([*(centre[:2] + away * s / far), level])
            matrix, terms = (np.array(node["intrinsics"][key]) for key in ("K", "dist_coeffs"))
            theirs = cv2.projectPoints(
                crossing[None], cv2.Rodrigues(turn)[0], shift, matrix, terms
            )[0].ravel()
            assert np.abs(theirs - want).max() < 1e-8
    convert(tmp_path / "c.json", tmp_path / "back.toml")
    back = read_project(tmp_path / "back.toml")
    assert back.unit == "m"
    for k, camera in enumerate(back.cameras):
        got = pixels(camera, points, back.interface_of(k))
        assert np.abs(got - pixels(content.cameras[k], media=WATER)).max() < 1e-9
    convert(tmp_path / "back.toml", tmp_path / "again.json", form="aquacal")
    again = json.loads((tmp_path / "again.json").read_text())
    assert again["cameras"]["cam1"]["water_z"] == data["cameras"]["cam1"]["water_z"]


def test_other_conventions_of_distortion_are_met_and_the_rest_said(tmp_path):
    views = tuple(
        replace(c, distortion=replace(c.distortion, convention=Convention.OPENPTV))
        for c in cameras()
    )
    done = convert(save(tmp_path, made(views)), tmp_path / "model")
    said = done.remarks[0]
    assert "Image points move by at most: cam1" in said
    stated = max(float(part.split()[-2]) for part in said.rstrip(".").split(", "))
    miss = [
        np.abs(colmap_pixels(tmp_path / "model", k, POINTS) - pixels(camera)).max()
        for k, camera in enumerate(views)
    ]
    assert 1e-9 < max(miss) <= stated < 0.05


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.json", '{"cameras": {"c": {}}, "interface": {"normal": [0, 0, -1], "n_air": 1, '
         '"n_water": 1.33}}', "camera c: the key 'intrinsics' is missing"),
        ("a.json", '{"K": [[1, 0], [0, 1]]}', "lacks image_width"),
        ("a.json", '{"K": [["x"]], "image_size": [9, 9]}', "matrix K is damaged"),
        ("a.xml", "<document><chunk/></document>", "holds no aligned camera"),
        ("a.xml", "<document>", "not valid XML"),
        ("a.yml", "hello", "not an OpenCV calibration"),
        ("a.doc", "hello", "is no project or calibration known here"),
    ],
)  # fmt: skip
def test_what_is_no_calibration_is_named(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        convert(tmp_path / name, tmp_path / "p.toml")
    assert not (tmp_path / "p.toml").exists()


def test_damaged_colmap_models_are_named(tmp_path):
    convert(save(tmp_path, made()), tmp_path / "model")
    for file, old, new, message in (
        ("images.txt", "cam2", "", "expected IMAGE_ID"),
        ("cameras.txt", "OPENCV", "THIN_PRISM_FISHEYE", "with 8 parameters is not read"),
        ("cameras.txt", "1936", "wide", "is not a COLMAP camera line"),
        ("points3D.txt", "3 ", "3 x", "found 'x"),
    ):
        path = tmp_path / "model" / file
        text = path.read_text()
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=message):
            convert(tmp_path / "model", tmp_path / "x.toml")
        path.write_text(text)


def test_the_command_converts_and_says_what(tmp_path):
    path = save(tmp_path, made())
    got = CliRunner().invoke(main, ["convert", str(path), str(tmp_path / "out.xml"), "--json"])
    assert got.exit_code == 0, got.output
    assert json.loads(got.stdout)["to"] == "metashape"
    again = CliRunner().invoke(main, ["convert", str(path), str(tmp_path / "out.xml")])
    assert again.exit_code == 1
    assert "--overwrite" in again.stderr
    lost = CliRunner().invoke(main, ["convert", str(path), str(tmp_path / "out.json")])
    assert lost.exit_code == 1
    assert "--to" in lost.stderr


def test_two_cameras_fit_no_single_file_of_opencv(tmp_path):
    source = save(tmp_path, made(cameras(k3=1e-8)[:2]))
    with pytest.raises(InputError, match="hold one camera, the project has 2; name a folder"):
        convert(source, tmp_path / "lens.yml", form="opencv")
    assert not (tmp_path / "lens.yml").exists()
