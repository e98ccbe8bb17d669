"""Faces, break lines and occluders: files of them, and relief and pictures that obey them."""

from __future__ import annotations

import ezdxf
import numpy as np
import pytest

from bifocal import (
    Grid,
    InputError,
    MapSurface,
    OrthoOptions,
    Pair,
    Photo,
    Quality,
    ReliefMap,
    Source,
    orthophoto,
)
from bifocal.faces.face_planes import plane_through, robust_plane
from bifocal.faces.faced_surface import faced
from bifocal.faces.faces import BreakLine, Face, Faces, Occluder, inside
from bifocal.faces.faces_files import beside, faces_path, keep_faces, read_faces
from bifocal.faces.suggestions import suggest_faces
from tests.bifocal.orthophotos.wall_scene import make_pair, photo_of, relief_at

GSD = 0.01
#: The middle window of the wall scene, its truth in X and Y.
WINDOW = np.array([[-0.07, -0.7], [0.47, -0.7], [0.47, 0.3], [-0.07, 0.3]])
GRID = Grid.from_bounds((-0.55, -0.85, 0.65, 0.31), gsd=GSD)


def box(left, bottom, right, top):
    return (np.array([[left, bottom], [right, bottom], [right, top], [left, top]], float),)


def truth(grid: Grid) -> np.ndarray:
    return relief_at(*np.meshgrid(grid.columns_x, grid.rows_y)).astype(np.float32)


def wobbling() -> ReliefMap:
    """The relief with the window's upright edges two pixels to and fro, and wild glass."""
    rng = np.random.default_rng(5)
    relief = truth(GRID)
    pane = inside((WINDOW,), GRID)
    for row in range(GRID.height):
        relief[row] = np.roll(relief[row], rng.integers(-2, 3))
    core = inside(box(0.0, -0.6, 0.4, 0.25), GRID)
    wild = core & (rng.random(core.shape) < 0.45)
    relief[wild] = rng.uniform(-2, 1, wild.sum())
    quality = np.where(pane & (rng.random(pane.shape) < 0.3), 2, 1).astype(np.uint8)
    return ReliefMap(
        r=relief, sigma=np.full_like(relief, 0.004), quality=quality,
        plane_from_pixel=GRID.plane_from_pixel,
    )  # fmt: skip


def test_faces_go_into_geojson_and_come_back(tmp_path) -> None:
    corners = np.array([[0, 0, 0.1, 0.002], [1, 0, 0.1, np.nan], [0, 1, 0.3, 0.002]])
    drawn = Faces(
        faces=(
            Face(name="a", rings=box(0, 0, 1, 2), plane=np.array([-0.2, 0, 0.0]), sigma=0.01),
            Face(name="b", rings=(*box(0, 0, 3, 3), *box(1, 1, 2, 2)),
                 plane=np.array([0.1, 0.2, -0.3])),
            Face(name="c", rings=box(4, 0, 5, 1), points=corners),
            Face(rings=box(6, 0, 7, 1)),
        ),
        breaks=(BreakLine(name="jamb", line=np.array([[0, 0, np.nan], [0, 1, np.nan]])),
                BreakLine(line=np.array([[0, 0, 0.2], [1, 1, 0.3]]))),
        occluders=(Occluder(name="tree", rings=box(0, 0, 1, 1), relief=2.0),),
    )  # fmt: skip
    drawn.write(tmp_path / "x.faces.geojson")
    back = read_faces(tmp_path / "x.faces.geojson")
    assert back.to_dict() == drawn.to_dict()
    assert [len(face.rings) for face in back.faces] == [1, 2, 1, 1]
    np.testing.assert_array_equal(back.faces[2].points, corners)
    assert back.occluders[0].relief == 2.0


def test_a_drawing_gives_faces_by_layer_in_metres(tmp_path) -> None:
    drawing = ezdxf.new()
    drawing.units = 4  # mm
    model = drawing.modelspace()
    square = [(0, 0), (1000, 0), (1000, 2000), (0, 2000)]
    model.add_lwpolyline(square, close=True, dxfattribs={"layer": "A_FACE", "elevation": -240})
    model.add_lwpolyline(square, close=True, dxfattribs={"layer": "face"})
    leaning = [(0, 0, 100), (1000, 0, 200), (1000, 1000, 200), (0, 1000, 100)]
    model.add_polyline3d(leaning, close=True, dxfattribs={"layer": "FACE"})
    model.add_line((0, 0), (0, 5000), dxfattribs={"layer": "BREAK"})
    model.add_lwpolyline(square, close=True, dxfattribs={"layer": "OCCLUDER"})
    model.add_line((0, 0), (1, 1), dxfattribs={"layer": "0"})
    drawing.saveas(tmp_path / "wall.dxf")
    found = read_faces(tmp_path / "wall.dxf")
    assert (len(found.faces), len(found.breaks), len(found.occluders)) == (3, 1, 1)
    assert found.faces[0].plane.tolist() == [-0.24, 0, 0]
    assert found.faces[1].plane is None
    np.testing.assert_allclose(plane_through(found.faces[2].points)[0], [0.1, 0.1, 0], atol=1e-12)
    np.testing.assert_allclose(found.breaks[0].line[:, :2], [[0, 0], [0, 5]])
    model.add_lwpolyline(square, dxfattribs={"layer": "FACE"})
    drawing.saveas(tmp_path / "open.dxf")
    with pytest.raises(InputError, match="closed"):
        read_faces(tmp_path / "open.dxf")


@pytest.mark.parametrize(
    ("feature", "told"),
    [
        ({"kind": "window", "type": "Polygon", "coordinates": []}, "kind"),
        ({"properties": {}, "geometry": {"type": "Polygon", "coordinates": []}}, "kind"),
        ({"kind": "face", "type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}, "coordinates"),
        ({"kind": "face", "relief": "deep", "type": "Polygon",
          "coordinates": [[[0, 0], [1, 1], [0, 1]]]}, "deep"),
        ({"kind": "face", "plane": [1, 2], "type": "Polygon",
          "coordinates": [[[0, 0], [1, 1], [0, 1]]]}, "plane"),
        ({"kind": "break", "type": "Polygon", "coordinates": [[[0, 0], [1, 1]]]}, "LineString"),
        ({"kind": "face", "relief": 0, "sigma": -0.01, "type": "Polygon",
          "coordinates": [[[0, 0], [1, 1], [0, 1]]]}, "sigma"),
        ({"kind": "face", "plane": [1e308, 0, 0], "type": "Polygon",
          "coordinates": [[[0, 0], [1, 1], [0, 1]]]}, "plane"),
        ({"kind": "face", "type": "Polygon",
          "coordinates": [[[0, 0], [1e308, 1], [0, 1]]]}, "coordinates"),
        (7, "geometry"),
    ],
)  # fmt: skip
def test_a_feature_that_is_none_of_these_is_named(feature, told) -> None:
    fine = {"kind": "face", "type": "Polygon", "coordinates": [[[0, 0], [1, 1], [0, 1]]]}
    with pytest.raises(InputError, match=f"feature 2.*{told}|feature 2: geometry"):
        Faces.from_dict({"features": [fine, feature]})


def test_faces_are_kept_beside_the_pair_and_found_again(tmp_path) -> None:
    pair, drawn = tmp_path / "wall.pair.json", tmp_path / "mine.geojson"
    pair.write_text("{}")
    Faces(faces=(Face(name="door", rings=box(0, 0, 1, 2)),)).write(drawn)
    assert faces_path(None, pair) is None
    assert "wall.faces.geojson" in keep_faces(drawn, pair)[0]
    assert faces_path(None, pair) == beside(pair)
    assert faces_path(drawn, pair) == drawn
    assert faces_path(tmp_path / "none", pair) is None
    assert keep_faces(beside(pair), pair) == ()
    assert "stays as it is" in keep_faces(drawn, pair)[0]
    beside(pair).unlink()
    beside(pair).mkdir()  # faces that cannot be read are no reason to go on without them
    assert faces_path(None, pair) == beside(pair)


def test_a_pixel_is_within_an_outline_where_its_centre_is() -> None:
    grid = Grid.from_bounds((0, 0, 8, 8), gsd=1.0)
    triangle = (np.array([[0.0, 0.0], [8.0, 0.0], [0.0, 8.0]]),)
    x, y = np.meshgrid(grid.columns_x, grid.rows_y)
    np.testing.assert_array_equal(inside(triangle, grid), x + y < 8)
    holed = (*box(0, 0, 8, 8), *box(2, 2, 5, 5))
    assert inside(holed, grid).sum() == 64 - 9


def test_planes_come_from_points_and_robustly_from_relief() -> None:
    rng = np.random.default_rng(2)
    xy = rng.uniform(0, 2, (400, 2))
    r = -0.3 + 0.05 * xy[:, 0] + rng.normal(0, 0.002, 400)
    r[:200] = rng.uniform(-2, 1, 200)  # half of it mirrors the street
    plane, covariance = robust_plane(np.column_stack([xy, r]), 0.1)
    np.testing.assert_allclose(plane, [-0.3, 0.05, 0.0], atol=0.003)
    assert 0 < covariance[0, 0] ** 0.5 < 0.005
    assert np.isnan(plane_through(np.array([[0, 0, 1, 1], [1, 1, 1, 1], [2, 2, 1, 1.0]]))[0]).all()


def test_a_drawn_window_is_plane_to_its_very_edges_and_nothing_else_changes() -> None:
    before = wobbling()
    after, surface = faced(before, Faces(faces=(Face(name="w", rings=(WINDOW,)),)))
    pane = inside((WINDOW,), GRID)
    np.testing.assert_allclose(after.r[pane], -0.35, atol=0.002)
    assert (after.quality[pane] == Quality.DRAWN).all()
    assert np.isfinite(after.sigma[pane]).all()
    # Beside it the wall, straight to half a pixel of the map on a grid four times finer.
    fine = Grid.from_bounds((-0.2, -0.6, 0.6, 0.2), gsd=GSD / 4)
    wrong = np.abs(surface.window(fine) - truth(fine)) > 0.01
    x = np.meshgrid(fine.columns_x, fine.rows_y)[0]
    beside_edge = np.minimum(np.abs(x - WINDOW[0, 0]), np.abs(x - WINDOW[1, 0])) < 0.06
    assert not (wrong & beside_edge).any()
    old = MapSurface.of_array(before.r, GRID).window(fine)
    assert (np.abs(old - truth(fine)) > 0.01)[beside_edge].mean() > 0.1
    # Farther out every bit is as it was.
    far = ~inside(box(-0.14, -0.77, 0.54, 0.37), GRID)
    for band in ("r", "sigma", "quality"):
        np.testing.assert_array_equal(getattr(after, band)[far], getattr(before, band)[far])
    assert faced(before, None)[0] is before


def test_typed_planes_lean_and_points_give_sigma() -> None:
    before = wobbling()
    leaning = Face(rings=(WINDOW,), plane=np.array([-0.2, 0.1, -0.05]))
    picked = np.array([[0, 0, -0.3, 0.004], [0.4, 0, -0.3, 0.004], [0, -0.6, -0.3, 0.004]])
    pane = inside((WINDOW,), GRID)
    x, y = np.meshgrid(GRID.columns_x, GRID.rows_y)
    first, _ = faced(before, Faces(faces=(leaning,)))
    np.testing.assert_allclose(first.r[pane], (-0.2 + 0.1 * x - 0.05 * y)[pane], atol=1e-6)
    second, _ = faced(before, Faces(faces=(Face(rings=(WINDOW,), points=picked),)))
    np.testing.assert_allclose(second.r[pane], -0.3, atol=1e-6)
    near = np.abs(x) + np.abs(y) < 0.02
    np.testing.assert_allclose(second.sigma[near & pane], 0.004, rtol=0.1)


def test_a_break_line_keeps_its_sides_apart() -> None:
    relief = np.where(GRID.columns_x[None, :] < 0.05, 0.0, 0.25) * np.ones(GRID.shape)
    ramp = np.clip((GRID.columns_x - 0.02) / 0.06, 0, 1) * 0.25
    smeared = ReliefMap.from_relief(
        np.tile(ramp, (GRID.height, 1)), plane_from_pixel=GRID.plane_from_pixel
    )
    edge = BreakLine(line=np.array([[0.05, -0.9, np.nan], [0.05, 0.4, np.nan]]))
    after, _ = faced(smeared, Faces(breaks=(edge,)))
    np.testing.assert_allclose(after.r, relief, atol=0.022)  # a tenth of the step is no ramp
    changed = np.abs(GRID.columns_x - 0.05) < 0.07
    np.testing.assert_array_equal(after.r[:, ~changed], smeared.r[:, ~changed])


def test_an_occluder_has_no_relief_and_is_painted_by_the_other_photo() -> None:
    pair = make_pair(GSD, (130, 130), (0.05, -0.3))
    far, near = photo_of(pair.image1, (130, 130)), photo_of(pair.image2, (130, 130))
    clean = orthophoto(
        pair,
        (far, near),
        ReliefMap.from_relief(truth(GRID), plane_from_pixel=GRID.plane_from_pixel),
    )
    cable = box(0.0, -0.6, 0.05, 0.2)
    crossed = far.copy()
    column = pair.image1.project([[0.025, 0.0, -0.35]])[0, 0]
    crossed[:, int(column) - 2 : int(column) + 3] = 0
    relief, _ = faced(
        ReliefMap.from_relief(truth(GRID), plane_from_pixel=GRID.plane_from_pixel),
        Faces(occluders=(Occluder(rings=cable, relief=0.5),)),
    )
    hidden = inside(cable, GRID)
    assert np.isnan(relief.r[hidden]).all()
    assert (relief.quality[hidden] == Quality.UNKNOWN).all()
    drawn = Faces(occluders=(Occluder(rings=cable, relief=0.5),))
    whole = orthophoto(pair, (crossed, near), relief, faces=drawn)
    core = inside(box(0.01, -0.55, 0.04, 0.15), GRID)
    assert (whole.source[core] != Source.IMAGE_1).all()
    assert np.abs(whole.image[core].astype(float) - clean.image[core]).mean() < 12
    only = orthophoto(pair, crossed, relief, faces=drawn, options=OrthoOptions(measured_only=True))
    assert not only.valid[core].any()


def test_windows_that_were_not_measured_are_suggested_where_they_stand() -> None:
    rng = np.random.default_rng(8)
    gsd, size = 0.005, (400, 400)
    grid = Grid.from_bounds((0, 0, 2, 2), gsd=gsd)
    matrix = [[gsd, 0, gsd / 2], [0, -gsd, 2 - gsd / 2], [0, 0, 1]]
    pair = Pair(image1=Photo(plane_from_pixel=matrix, nadir=(1.0, 0.2), distance=10.0),
                image2=Photo(plane_from_pixel=matrix, nadir=(1.0, 0.2), distance=5.0))  # fmt: skip
    ring = box(0.9, 0.9, 1.4, 1.5)
    noise = np.kron(rng.uniform(60, 220, (200, 200)), np.ones((4, 4)))

    def seen(photo: Photo) -> np.ndarray:
        image = np.zeros(size, np.uint8)
        rows, columns = np.mgrid[: size[0], : size[1]]
        for level in (0.0, -0.2):
            q = photo.plane_from_pixels(np.stack([columns, rows], -1).reshape(-1, 2))
            xy = photo.nadir + (q - photo.nadir) * (1 - level / photo.distance)
            x, y = xy.reshape(*size, 2).transpose(2, 0, 1)
            tone = noise[
                np.clip((y * 300).astype(int), 0, 799), np.clip((x * 300).astype(int), 0, 799)
            ]
            pane = (x > 0.9) & (x < 1.4) & (y > 0.9) & (y < 1.5)
            image = np.where(pane, 0.3 * tone, image) if level else np.asarray(tone)
        return image.astype(np.uint8)

    relief, lost = np.zeros(grid.shape, np.float32), inside(ring, grid)
    relief[lost] = rng.uniform(-0.4, 0.1, lost.sum())
    known = ReliefMap(
        r=relief, sigma=np.full_like(relief, 0.01), quality=np.where(lost, 2, 1).astype(np.uint8),
        plane_from_pixel=grid.plane_from_pixel,
    )  # fmt: skip
    found = suggest_faces(known, (pair.image1, pair.image2), (seen(pair.image1), seen(pair.image2)))
    assert len(found.faces) == 1
    (window,) = found.faces
    assert window.plane[0] == pytest.approx(-0.2, abs=0.011)
    np.testing.assert_allclose(window.rings[0], ring[0], atol=0.016)
    assert window.mends == pytest.approx(0.075, abs=0.005)
