"""Projects as other programs write them, from their documents, not from our readers.

COLMAP: colmap.github.io/format.html. Metashape: its manual, appendix C (camera models), and its
exported cameras. OpenSfM: opensfm.org/docs/geometry.html and dataset.html. AliceVision: version
notes in sfmDataIO. OpenMVG: its documentation of sfm_data. Bundler: its manual, Output format.
RealityCapture: Epic's "XMP Camera Math" and nerfstudio's reader of its table. NeRF: nerfstudio,
Data conventions. VisualSFM: ccwu.me/vsfm, NVM, and Multicore Bundle Adjustment's notes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

#: World from wall: neither axis upright, another unit, far from the origin.
TURN = Rotation.from_euler("xyz", [80, -25, 130], degrees=True).as_matrix()
UNIT, SHIFT = 0.4, np.array([15.0, -8.0, 3.0])


class Shot(NamedTuple):
    """A photo: lens with integers at pixel centres, OpenCV's k1 k2 p1 p2 k3; x = R (X - C)."""

    file: str
    size: tuple[int, int]
    focal: tuple[float, float]
    centre: tuple[float, float]
    terms: tuple[float, float, float, float, float]
    rotation: np.ndarray
    place: np.ndarray

    @property
    def matrix(self) -> np.ndarray:
        return np.array([[self.focal[0], 0, self.centre[0]], [0, self.focal[1], self.centre[1]],
                         [0, 0, 1.0]])  # fmt: skip

    def pixels(self, xyz: np.ndarray) -> np.ndarray:
        """Return where points are seen, by OpenCV."""
        turn = cv2.Rodrigues(self.rotation)[0]
        shift = -self.rotation @ self.place
        return cv2.projectPoints(xyz, turn, shift, self.matrix, np.array(self.terms))[0][:, 0]


def to_world(wall: np.ndarray) -> np.ndarray:
    return UNIT * wall @ TURN.T + SHIFT


def make_shots(
    *, terms: Sequence[float] = (-0.06, 0.02, 0, 0, 0), offset: Sequence[float] = (0, 0),
    squash: float = 1.0, size: tuple[int, int] = (300, 200),
) -> list[Shot]:  # fmt: skip
    """Return three photos of a wall, 12, 7 and 7.5 m before it, and one of its back."""
    shots = []
    for k, (x, y, z, yaw, pitch) in enumerate(
        [(0.4, -0.3, 12, 3, 5), (0.2, -0.5, 7, -4, 7), (1.7, -0.4, 7.5, 12, 6), (0, 0, -6, 180, 0)]
    ):
        turn = Rotation.from_euler("yx", [yaw, pitch], degrees=True).as_matrix()
        down = np.diag([1.0, -1.0, -1.0]) @ turn.T  # wall: Y up, Z towards the viewer
        f = 420.0 if k == 0 else 260.0
        middle = [(side - 1) / 2 + move for side, move in zip(size, offset, strict=True)]
        shots.append(
            Shot(f"DSC_{k}.png", size, (f, f * squash), tuple(middle), tuple(terms),
                 down @ TURN.T, to_world(np.array([x, y, z], dtype=float)))
        )  # fmt: skip
    return shots


def texture(xy: np.ndarray) -> np.ndarray:
    """Return the wall's grey value at plane positions: smooth, of upright and level lines."""
    x, y = xy[..., 0], xy[..., 1]
    rows = np.sin(5.0 * x) + np.sin(4.0 * y) + 0.6 * np.sin(2.1 * x) * np.sin(1.7 * y)
    return 128 + 38 * rows


#: Of the front, and of the wall that runs back from its right end at X = 3: about the upright edge.
FRONT, FLANK = np.eye(3), np.array([[0, 0, 1.0], [0, 1, 0], [-1, 0, 0]])


def make_flank_shots() -> list[Shot]:
    """Return three photos of the flank, 10, 7 and 7.5 m before it; it is seen from X = 3 on."""
    shots = []
    for k, (x, y, z, yaw) in enumerate([(2, -0.3, 10, 3), (2.4, -0.4, 7, -4), (1.2, -0.2, 7.5, 0)]):
        turn = Rotation.from_euler("yx", [yaw, 3], degrees=True).as_matrix()
        turn, place = FLANK @ turn, FLANK @ [x, y, z] + [3, 0, 0]
        down = np.diag([1.0, -1.0, -1.0]) @ turn.T
        shots.append(Shot(f"SIDE_{k}.png", (300, 200), (300.0, 300.0), (149.5, 99.5), (0,) * 5,
                          down @ TURN.T, to_world(place)))  # fmt: skip
    return shots


def flank_points(count: int = 380) -> np.ndarray:
    """Return points on the flank, in the frame of the front."""
    rng = np.random.default_rng(3)
    flat = np.column_stack([rng.uniform((0, -2), (4, 2), (count, 2)), np.zeros(count)])
    flat[:, 2] += rng.normal(0, 0.0005, count)
    return flat @ FLANK.T + [3, 0, 0]


def render(shots: Sequence[Shot], folder: Path, wall: np.ndarray = FRONT) -> None:
    """Write the photos of a flat wall; of its back a grey one."""
    folder.mkdir(parents=True, exist_ok=True)
    for shot in shots:
        width, height = shot.size
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 1, 2)
        ideal = cv2.undistortPoints(
            grid.astype(float), shot.matrix, np.array(shot.terms),
            criteria=(3, 100, 1e-12),
        )[:, 0]  # fmt: skip
        rays = np.column_stack([ideal, np.ones(len(ideal))]) @ shot.rotation @ TURN @ wall
        place = ((shot.place - SHIFT) @ TURN / UNIT - [3.0 * (wall is FLANK), 0, 0]) @ wall
        xy = place[:2] - rays[:, :2] * (place[2] / rays[:, 2])[:, None]
        grey = np.clip(texture(xy).reshape(height, width), 0, 255).round().astype(np.uint8)
        Image.fromarray(np.repeat(grey[..., None], 3, 2)).save(folder / shot.file)


def wall_points(count: int = 600) -> np.ndarray:
    """Return points on the wall, in a niche, on the ground before it and astray; in its frame."""
    rng = np.random.default_rng(5)
    wall = np.column_stack([rng.uniform((-3, -2), (3, 2), (count, 2)), np.zeros(count)])
    niche = np.column_stack([rng.uniform((-1, -1), (0, 0), (60, 2)), np.full(60, -0.6)])
    ground = np.column_stack([rng.uniform(-3, 3, 500), np.full(500, -2.2), rng.uniform(0, 5, 500)])
    astray = rng.uniform((-4, -3, -2), (4, 3, 3), (80, 3))
    wall[:, 2] += rng.normal(0, 0.0005, count)
    return np.concatenate([wall, niche, ground, astray])


def _numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def write_colmap_text(folder: Path, shots: Sequence[Shot], xyz: np.ndarray) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    cameras, images = [], []
    for k, shot in enumerate(shots, start=1):
        k1, k2, p1, p2, k3 = shot.terms
        corner = [c + 0.5 for c in shot.centre]  # the corner of the photo is (0, 0)
        numbers = [*shot.focal, *corner, k1, k2, p1, p2, k3, 0, 0, 0]
        cameras.append(f"{k} FULL_OPENCV {shot.size[0]} {shot.size[1]} {_numbers(numbers)}")
        x, y, z, w = Rotation.from_matrix(shot.rotation).as_quat()
        shift = -shot.rotation @ shot.place
        images += [f"{k} {_numbers([w, x, y, z, *shift])} {k} {shot.file}", "10.5 20.5 -1"]
    points = [f"{k} {_numbers(place)} 90 90 90 0.5 1 0 2 0" for k, place in enumerate(xyz)]
    for name, lines in (("cameras", cameras), ("images", images), ("points3D", points)):
        (folder / f"{name}.txt").write_text("# COLMAP\n" + "\n".join(lines) + "\n")
    return folder


def write_colmap_binary(folder: Path, shots: Sequence[Shot], xyz: np.ndarray) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    cameras, images, points = (struct.pack("<Q", len(some)) for some in (shots, shots, xyz))
    for k, shot in enumerate(shots, start=1):
        k1, k2, p1, p2, k3 = shot.terms
        corner = [c + 0.5 for c in shot.centre]
        cameras += struct.pack("<IiQQ", k, 6, *shot.size)  # 6: FULL_OPENCV
        cameras += struct.pack("<12d", *shot.focal, *corner, k1, k2, p1, p2, k3, 0, 0, 0)
        x, y, z, w = Rotation.from_matrix(shot.rotation).as_quat()
        images += struct.pack("<I7dI", k, w, x, y, z, *(-shot.rotation @ shot.place), k)
        images += shot.file.encode() + b"\0" + struct.pack("<Qddq", 1, 10.5, 20.5, -1)
    for k, place in enumerate(xyz):
        points += struct.pack("<Q3d3Bd", k, *place, 90, 90, 90, 0.5)
        points += struct.pack("<Q4i", 2, 1, 0, 2, 0)
    for name, content in (("cameras", cameras), ("images", images), ("points3D", points)):
        (folder / f"{name}.bin").write_bytes(content)
    return folder


def write_metashape(path: Path, shots: Sequence[Shot], *, scale: float | None = None) -> Path:
    """Write exported cameras; with a scale the chunk's frame is another than the world's."""
    sensors, cameras = [], []
    for k, shot in enumerate(shots):
        (width, height), (k1, k2, p1, p2, k3) = shot.size, shot.terms
        # u = w / 2 + cx + x' f + x' b1 from the corner; p1 goes with r² + 2 x².
        cx, cy = (c + 0.5 - side / 2 for c, side in zip(shot.centre, shot.size, strict=True))
        values = {"f": shot.focal[1], "cx": cx, "cy": cy, "b1": shot.focal[0] - shot.focal[1],
                  "k1": k1, "k2": k2, "k3": k3, "p1": p2, "p2": p1}  # fmt: skip
        inside = "".join(f"<{key}>{float(value)!r}</{key}>" for key, value in values.items())
        sensors.append(
            f'<sensor id="{k}" type="frame"><resolution width="{width}" height="{height}"/>'
            f'<calibration type="frame" class="adjusted"><resolution width="{width}" '
            f'height="{height}"/>{inside}</calibration></sensor>'
        )
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = shot.rotation.T, shot.place / (scale or 1.0)
        label = shot.file.partition(".")[0]
        cameras.append(f'<camera id="{k}" sensor_id="{k}" label="{label}"><transform>'
                       f"{_numbers(matrix.ravel())}</transform></camera>")  # fmt: skip
    frame = "" if scale is None else (
        f"<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>0 0 0</translation>"
        f"<scale>{scale!r}</scale></transform>"
    )  # fmt: skip
    path.write_text(
        f'<?xml version="1.0"?><document version="2.0.0"><chunk><sensors>{"".join(sensors)}'
        f'</sensors><cameras>{"".join(cameras)}<camera id="99" sensor_id="0" label="lost"/>'
        f"</cameras>{frame}</chunk></document>"
    )
    return path


def write_opensfm(path: Path, shots: Sequence[Shot], xyz: np.ndarray, *, gps: bool = False) -> Path:
    cameras, taken = {}, {}
    for k, shot in enumerate(shots):
        side, (k1, k2, p1, p2, k3) = max(shot.size), shot.terms
        cameras[f"v2 cam {k}"] = {
            "projection_type": "brown", "width": shot.size[0], "height": shot.size[1],
            "focal_x": shot.focal[0] / side, "focal_y": shot.focal[1] / side,
            # normalised = (pixel + 0.5 - side / 2) / longer side
            "c_x": (shot.centre[0] + 0.5 - shot.size[0] / 2) / side,
            "c_y": (shot.centre[1] + 0.5 - shot.size[1] / 2) / side,
            "k1": k1, "k2": k2, "p1": p1, "p2": p2, "k3": k3,
        }  # fmt: skip
        taken[shot.file] = {
            "rotation": Rotation.from_matrix(shot.rotation).as_rotvec().tolist(),
            "translation": (-shot.rotation @ shot.place).tolist(), "camera": f"v2 cam {k}",
        }  # fmt: skip
    points = {str(k): {"color": [9, 9, 9], "coordinates": row.tolist()}
              for k, row in enumerate(xyz)}  # fmt: skip
    lla = {"latitude": 48.1 if gps else 0.0, "longitude": 8.2 if gps else 0.0, "altitude": 0.0}
    whole = {"cameras": cameras, "shots": taken, "points": points, "reference_lla": lla}
    part = {"cameras": {}, "shots": {}, "points": {}}
    path.write_text(json.dumps([part, whole]))
    return path


def write_alicevision(
    path: Path, shots: Sequence[Shot], xyz: np.ndarray, version: tuple[int, int, int] = (1, 2, 11)
) -> Path:
    """Write a .sfm file; numbers are texts, matrices column by column."""
    views, intrinsics, poses = [], [], []
    for k, shot in enumerate(shots):
        (width, height), (k1, k2, p1, p2, k3), sensor = shot.size, shot.terms, 23.5
        centre = np.array(shot.centre)  # whole numbers at pixel centres
        lens = {"intrinsicId": str(700 + k), "width": str(width), "height": str(height),
                "sensorWidth": str(sensor), "sensorHeight": "15.6", "serialNumber": "",
                "type": "brown", "locked": "false",
                "distortionParams": [repr(float(v)) for v in (k1, k2, k3, p1, p2)]}  # fmt: skip
        if version >= (1, 2, 1):
            centre = centre - np.array(shot.size) / 2
        if version < (1, 2, 0):
            lens["pxFocalLength"] = repr(shot.focal[0])
        elif version < (1, 2, 2):
            lens["pxFocalLength"] = [repr(f) for f in shot.focal]
        else:
            ratio = shot.focal[1] / shot.focal[0]
            lens["focalLength"] = repr(shot.focal[0] * sensor / width)
            lens["pixelRatio"] = repr(ratio if version >= (1, 2, 5) else 1 / ratio)
        if version >= (1, 2, 8):
            lens |= {"type": "pinhole", "distortionType": "brown", "undistortionParams": ""}
        lens["principalPoint"] = [repr(float(v)) for v in centre]
        intrinsics.append(lens)
        views.append({"viewId": str(40 + k), "poseId": str(50 + k), "intrinsicId": str(700 + k),
                      "path": f"D:\\somewhere\\{shot.file}", "width": str(width),
                      "height": str(height), "metadata": ""})  # fmt: skip
        turn = [repr(float(v)) for v in shot.rotation.ravel(order="F")]
        where = [repr(float(v)) for v in shot.place]
        poses.append({"poseId": str(50 + k), "pose": {
            "transform": {"rotation": turn, "center": where}, "locked": "false"}})  # fmt: skip
    views.append(views[0] | {"viewId": "99", "poseId": "99"})
    structure = [{"landmarkId": str(k), "X": [repr(float(v)) for v in row], "observations": ""}
                 for k, row in enumerate(xyz)]  # fmt: skip
    whole = {"version": [str(v) for v in version], "views": views, "intrinsics": intrinsics,
             "poses": poses, "structure": structure}  # fmt: skip
    path.write_text(json.dumps(whole))
    return path


def write_openmvg(path: Path, shots: Sequence[Shot], xyz: np.ndarray, *, nested: bool) -> Path:
    """Write a sfm_data.json; nested: the base class' values in value0, as later versions do."""
    views, intrinsics, extrinsics = [], [], []
    for k, shot in enumerate(shots):
        (width, height), (k1, k2, p1, p2, k3) = shot.size, shot.terms
        view = {"local_path": "", "filename": shot.file, "width": width, "height": height,
                "id_view": k, "id_intrinsic": k, "id_pose": k}  # fmt: skip
        base = {"width": width, "height": height, "focal_length": shot.focal[0],
                "principal_point": list(shot.centre)}  # fmt: skip
        lens = {"value0": base} if nested else base
        lens = lens | {"disto_t2": [k1, k2, k3, p1, p2]}
        for rows, content in ((views, view), (intrinsics, lens)):
            wrapped = {"polymorphic_id": 1, "ptr_wrapper": {"id": 2147483649 + k, "data": content}}
            rows.append({"key": k, "value": wrapped})
        extrinsics.append({"key": k, "value": {
            "rotation": shot.rotation.tolist(), "center": shot.place.tolist()}})  # fmt: skip
    structure = [{"key": k, "value": {"X": row.tolist(), "observations": []}}
                 for k, row in enumerate(xyz)]  # fmt: skip
    whole = {"sfm_data_version": "0.3", "root_path": "/data", "views": views,
             "intrinsics": intrinsics, "extrinsics": extrinsics, "structure": structure,
             "control_points": []}  # fmt: skip
    path.write_text(json.dumps(whole))
    return path


def write_bundler(path: Path, shots: Sequence[Shot], xyz: np.ndarray) -> Path:
    """Write bundle.out and list.txt; y up, z backwards, from the middle of the photo."""
    lines, flip = ["# Bundle file v0.3", f"{len(shots) + 1} {len(xyz)}"], np.diag([1, -1, -1])
    for shot in shots:
        rotation = flip @ shot.rotation
        lines.append(_numbers([shot.focal[0], *shot.terms[:2]]))
        lines += [_numbers(row) for row in rotation]
        lines.append(_numbers(-rotation @ shot.place))
    lines += ["0 0 0"] * 5  # one that is not registered
    for place in xyz:
        lines += [_numbers(place), "80 80 80", "2 0 11 3.5 -4.5 1 12 1.5 2.5"]
    path.write_text("\n".join(lines) + "\n")
    names = "\n".join([*(shot.file for shot in shots), "lost.png 0 400"])
    path.with_name("list.txt").write_text(names + "\n")
    return path


def write_nerf(path: Path, shots: Sequence[Shot], _: np.ndarray) -> Path:
    """Write transforms.json: OpenGL's axes, pixels from the corner."""
    frames = []
    for shot in shots:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = shot.rotation.T * [1, -1, -1], shot.place
        k1, k2, p1, p2, k3 = shot.terms
        frames.append({
            "file_path": f"./{shot.file}", "transform_matrix": matrix.tolist(),
            "fl_x": shot.focal[0], "fl_y": shot.focal[1], "cx": shot.centre[0] + 0.5,
            "cy": shot.centre[1] + 0.5, "k1": k1, "k2": k2, "k3": k3, "p1": p1, "p2": p2,
        })  # fmt: skip
    width, height = shots[0].size
    whole = {"camera_model": "OPENCV", "w": width, "h": height, "aabb_scale": 16}
    path.write_text(json.dumps(whole | {"frames": frames}))
    return path


def _reality(shot: Shot) -> tuple[float, float, float, list[float]]:
    """Return f of 35 mm film, principal point in longer sides, k1 k2 k3 k4 t1 t2."""
    longer, (k1, k2, p1, p2, k3) = max(shot.size), shot.terms
    u, v = ((c + 0.5 - side / 2) / longer for c, side in zip(shot.centre, shot.size, strict=True))
    return shot.focal[0] * 36 / longer, u, v, [k1, k2, k3, 0, p1, p2]


def write_reality_xmp(folder: Path, shots: Sequence[Shot], _: np.ndarray) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for shot in shots:
        focal, u, v, terms = _reality(shot)
        (folder / shot.file).with_suffix(".xmp").write_text(
            '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/'
            '22-rdf-syntax-ns#"><rdf:Description xcr:Version="3" xcr:PosePrior="exact" '
            'xcr:Coordinates="relative" xcr:DistortionModel="brown3t2" '
            f'xcr:FocalLength35mm="{focal!r}" xcr:Skew="0" '
            f'xcr:AspectRatio="{shot.focal[1] / shot.focal[0]!r}" xcr:PrincipalPointU="{u!r}" '
            f'xcr:PrincipalPointV="{v!r}" xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#">'
            f"<xcr:Rotation>{_numbers(shot.rotation.ravel())}</xcr:Rotation>"
            f"<xcr:Position>{_numbers(shot.place)}</xcr:Position>"
            f"<xcr:DistortionCoeficients>{_numbers(terms)}</xcr:DistortionCoeficients>"
            "</rdf:Description></rdf:RDF></x:xmpmeta>"
        )
    return folder


def write_reality_table(path: Path, shots: Sequence[Shot], _: np.ndarray) -> Path:
    """Write internal and external parameters; heading clockwise, pitch 0 looks down."""
    lines = ["#cameras 4", "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2"]
    for shot in shots:
        world = Rotation.from_matrix(shot.rotation.T * [1, -1, -1])
        turn, pitch, roll = world.as_euler("ZXY", degrees=True)  # intrinsic: Rz Rx Ry
        focal, u, v, terms = _reality(shot)
        values = [*shot.place, -turn, pitch, roll, focal, u, v, *terms]
        lines.append(",".join([shot.file, *(repr(float(value)) for value in values)]))
    path.write_text("\n".join(lines) + "\n")
    return path


def write_visualsfm(path: Path, shots: Sequence[Shot], xyz: np.ndarray) -> Path:
    lines = ["NVM_V3 ", "", str(len(shots))]
    for shot in shots:
        x, y, z, w = Rotation.from_matrix(shot.rotation).as_quat()
        numbers = _numbers([shot.focal[0], w, x, y, z, *shot.place, 0, 0])
        lines.append(f"{shot.file}\t{numbers}")
    lines += ["", str(len(xyz))]
    lines += [f"{_numbers(row)} 90 90 90 2 0 7 1.5 2.5 1 8 3.5 4.5" for row in xyz]
    path.write_text("\n".join([*lines, "", "0", "", "#the last part", "0"]) + "\n")
    return path
