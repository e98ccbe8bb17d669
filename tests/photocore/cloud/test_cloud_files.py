"""Point clouds: whole files come back, damaged ones are refused by name."""

from __future__ import annotations

import struct
from pathlib import Path

import laspy
import numpy as np
import pytest

from bifocal import InputError
from photocore.cloud import open_cloud, write_cloud
from photocore.cloud.ply import read_ply_mesh

POINTS = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACES = "element face 1\nproperty list uchar int vertex_indices\n"
BODY = "0 0 1\n1 0 2\n0 1 3\n3 0 1 2\n"


def ply(path: Path, *, form: str = "format ascii 1.0\n", points: str = POINTS, faces: str = FACES,
        body: str | bytes = BODY) -> Path:  # fmt: skip
    data = body if isinstance(body, bytes) else body.encode()
    path.write_bytes(f"ply\n{form}{points}{faces}end_header\n".encode() + data)
    return path


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    cloud = open_cloud(path)
    return np.concatenate([piece.xyz for piece in cloud.pieces()]), read_ply_mesh(path)[1]


def test_a_mesh_by_hand_is_read(tmp_path: Path) -> None:
    xyz, faces = read(ply(tmp_path / "a.ply"))
    assert xyz.tolist() == [[0, 0, 1], [1, 0, 2], [0, 1, 3]]
    assert faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("order", ["little", "big"])
def test_binary_meshes_of_either_byte_order_are_read(tmp_path: Path, order: str) -> None:
    mark = {"little": "<", "big": ">"}[order]
    body = struct.pack(f"{mark}9fB3i", 0, 0, 1, 1, 0, 2, 0, 1, 3, 3, 2, 1, 0)
    path = ply(tmp_path / "a.ply", form=f"format binary_{order}_endian 1.0\n", body=body)
    xyz, faces = read(path)
    assert xyz.tolist() == [[0, 0, 1], [1, 0, 2], [0, 1, 3]]
    assert faces.tolist() == [[2, 1, 0]]


def test_text_faces_may_carry_more_than_their_corners(tmp_path: Path) -> None:
    faces = FACES + "property uchar red\n"
    assert read(ply(tmp_path / "a.ply", faces=faces, body=BODY[:-1] + " 255\n"))[1].tolist() == [
        [0, 1, 2]
    ]


BINARY = "format binary_little_endian 1.0\n"
DAMAGED = {
    "count 3.5": ({"points": POINTS.replace("vertex 3", "vertex 3.5")}, "line 3 of its PLY"),
    "count of 5000 digits": (
        {"points": POINTS.replace("vertex 3", "vertex " + 5000 * "9")}, "line 3 of its PLY",
    ),
    "negative count": ({"points": POINTS.replace("vertex 3", "vertex -5")}, "line 3 of its PLY"),
    "element alone": ({"points": "element\n" + POINTS}, "line 3 of its PLY heading, 'element'"),
    "format alone": ({"form": "format\n"}, "line 2 of its PLY heading, 'format'"),
    "no format": ({"form": ""}, "PLY format '' is not known"),
    "unknown format": ({"form": "format utf8 1.0\n"}, "PLY format 'utf8' is not known"),
    "property alone": ({"points": POINTS + "property\n"}, "line 7 of its PLY heading, 'property'"),
    "property before any element": ({"form": "property int a\nformat ascii 1.0\n"}, "line 2 of"),
    "half a list": ({"faces": FACES.replace(" vertex_indices", "")}, "line 8 of its PLY"),
    "unknown type": ({"points": POINTS.replace("float y", "real y")}, "type real is not known"),
    "two of one name": ({"points": POINTS + "property int x\n"}, "two properties of one name"),
    "lists in vertices": ({"points": POINTS + "property list int int a\n"}, "list properties"),
    "no z": ({"points": POINTS.replace("float z", "float w")}, "no x, y and z"),
    "no points": ({"points": POINTS.replace("vertex 3", "vertex 0")}, "holds no points"),
    "faces first": ({"points": FACES + POINTS, "faces": ""}, "first element is not 'vertex'"),
    "word for a number": ({"body": BODY.replace("2", "two")}, "points after byte .* 3 numbers"),
    "too many numbers": ({"body": BODY.replace("1 0 2", "1 0 2 5")}, "points after byte"),
    "too few lines": ({"body": "0 0 1\n1 0 2\n"}, "ends before its last point"),
    "blank line": ({"body": "\n" + BODY}, "ends before its last point"),
    "no body": ({"body": ""}, "ends before its last point"),
    "huge binary count": (
        {"form": BINARY, "points": POINTS.replace("3", "999999999999")}, "before its last point",
    ),
    "half a number": ({"form": BINARY, "body": bytes(35)}, "ends before its last point"),
    "no faces": ({"faces": ""}, "holds no faces"),
    "faces without corners": ({"faces": "element face 1\n"}, "holds no faces"),
    "huge face count": ({"faces": FACES.replace("face 1", "face 999999999999")}, "its last face"),
    "huge binary face count": (
        {"form": BINARY, "faces": FACES.replace("face 1", "face 999999999999"), "body": bytes(80)},
        "its last face",
    ),
    "binary faces with more": (
        {"form": BINARY, "faces": FACES + "property int a\n", "body": bytes(80)}, "further prop",
    ),
    "a quadrangle": ({"body": BODY.replace("3 0 1 2", "4 0 1 2 0")}, "must be a triangle"),
    "half a face": ({"body": BODY.replace("3 0 1 2", "3 0")}, "faces after byte"),
    "a binary quadrangle": ({"form": BINARY, "body": bytes(36) + b"\4" + bytes(16)}, "triangle"),
}  # fmt: skip


@pytest.mark.parametrize(("damage", "message"), DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_ply_is_refused_by_name(tmp_path: Path, damage: dict, message: str) -> None:
    path = ply(tmp_path / "bad.ply", **damage)
    with pytest.raises(InputError, match=message) as told:
        read(path)
    assert str(told.value).startswith(f"{path}: ")


def write_las(path: Path) -> bytearray:
    header = laspy.LasHeader(point_format=3, version="1.2")
    las = laspy.LasData(header)
    las.x, las.y, las.z = np.arange(30.0).reshape(3, 10)
    las.write(path)
    return bytearray(path.read_bytes())


@pytest.mark.parametrize("version", [(9, 9), (1, 9), (1, 4)])
def test_a_las_of_another_version_than_it_says_is_refused(
    tmp_path: Path, version: tuple[int, int]
) -> None:
    path = tmp_path / "bad.las"
    data = write_las(path)
    data[24:26] = version
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"cannot be read as LAS|holds no points") as told:
        [piece.xyz for piece in open_cloud(path).pieces()]
    assert str(told.value).startswith(f"{path}: ")


@pytest.mark.parametrize("ending", [".ply", ".las", ".laz"])
def test_a_new_cloud_comes_back_with_its_attributes(tmp_path: Path, ending: str) -> None:
    rng = np.random.default_rng(2)
    xyz = np.round(rng.uniform(-50, 50, (40, 3)), 4)
    red = rng.integers(0, 256, 40).astype(np.uint8)
    doubt = np.arange(40) % 3 == 0
    attributes = {
        "red": red, "green": red // 2, "blue": red // 3, "sigma": np.linspace(0, 1, 40, dtype="f4"),
        "quality": np.arange(40, dtype=np.uint8), "uncertain": doubt.astype(np.uint8),
    }  # fmt: skip
    path = tmp_path / f"a{ending}"
    write_cloud(path, xyz, attributes, comment="by hand", descriptions={"sigma": "of z, m"})
    wanted = ("red", "sigma", "quality", "uncertain", "classification", "user_data")
    (piece,) = open_cloud(path).pieces(numbers=wanted)
    np.testing.assert_allclose(piece.xyz, xyz, rtol=0, atol=1e-12 if ending == ".ply" else 5.1e-5)
    np.testing.assert_array_equal(piece.numbers["sigma"], attributes["sigma"])
    if ending == ".ply":
        assert b"comment by hand\n" in path.read_bytes()
        assert piece.numbers["red"].tolist() == red.tolist()
        assert piece.numbers["uncertain"].tolist() == doubt.tolist()
    else:
        # White is 65535 in LAS: 255 times 257.
        assert piece.numbers["red"].tolist() == (257 * red.astype(int)).tolist()
        assert piece.numbers["user_data"].tolist() == list(range(40))
        assert piece.numbers["classification"].tolist() == np.where(doubt, 7, 1).tolist()
        (extra,) = laspy.read(path).point_format.extra_dimensions
        assert (extra.name, extra.description) == ("sigma", "of z, m")


@pytest.mark.parametrize("far", [1e300, 5e5, np.inf])
def test_points_too_far_apart_for_las_are_refused(tmp_path: Path, far: float) -> None:
    path = tmp_path / "a.laz"
    with pytest.raises(InputError, match=r"a\.laz: the points span .* LAS holds 215 km to 0.1 mm"):
        write_cloud(path, np.array([[0.0, 0, 0], [far, 0, 0]]), {})
    assert not path.exists()


def test_another_ending_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.ply, \.las or \.laz"):
        write_cloud(tmp_path / "a.e57", np.zeros((1, 3)), {})


@pytest.mark.parametrize("ending", [".csv", ".ply", ".las"])
def test_a_copy_moves_only_what_moved(tmp_path: Path, ending: str) -> None:
    source, target = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    if ending == ".csv":
        source.write_text("N;E;note;H\n1,50;2;kept;3,0\n 4;5;;6\n", encoding="utf-8")
    else:
        write_cloud(source, np.array([[2.0, 1.5, 3], [5, 4, 6]]), {})
    cloud = open_cloud(source)
    (piece,) = cloud.pieces()
    assert piece.xyz.tolist() == [[2, 1.5, 3], [5, 4, 6]]
    moved = piece.xyz + np.array([[0, 0, 0.25], [0, 0, 0]])
    with cloud.copy(target, {"depth": ("f4", "")}, overwrite=False) as write:
        write(piece, moved, {"depth": np.array([0.5, 0.0])})
    (again,) = open_cloud(target).pieces(numbers=["depth"])
    assert again.xyz.tolist() == moved.tolist()
    if ending == ".csv":
        lines = target.read_text(encoding="utf-8").splitlines()
        assert lines == ["N;E;note;H;depth", "1,50;2;kept;3,25;0,5", " 4;5;;6;0,0"]
    else:
        assert again.numbers["depth"].tolist() == [0.5, 0.0]


def test_numbers_without_end_are_blank_in_a_copied_text(tmp_path: Path) -> None:
    source, target = tmp_path / "a.csv", tmp_path / "b.csv"
    source.write_text("X,Y,Z\n1,2,3\n4,5,6\n7,8,9\n")
    cloud = open_cloud(source)
    (piece,) = cloud.pieces()
    depth = np.array([1.5, np.inf, np.nan])
    with cloud.copy(target, {"depth": ("f8", "")}, overwrite=False) as write:
        write(piece, piece.xyz, {"depth": depth})
    assert target.read_text().splitlines() == ["X,Y,Z,depth", "1,2,3,1.5", "4,5,6,", "7,8,9,"]
