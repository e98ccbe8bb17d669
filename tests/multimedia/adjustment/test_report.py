"""What the report of an adjustment shows is what the adjustment found."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import multimedia
from multimedia.adjustment.report import adjustment_document
from multimedia.adjustment.report_figures import (
    MOST_ARROWS,
    _thinned,
    depth_and_radial,
    draw_vectors,
)
from photocore.reports.document import Paragraph, Picture, TextTable
from photocore.reports.words import words_of

#: Words of English sentences that are neither Italian nor German.
ENGLISH = re.compile(r"\b(the|of|is|are|with|which|from|not|were|for|only|points?|measured)\b")
LAYERS = multimedia.Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))


@pytest.fixture(scope="module")
def project() -> multimedia.Project:
    """Four true cameras above a tank of 0.5 m, with an index of water 0.02 too small."""
    tank = multimedia.FlatInterface(layers=LAYERS)
    points = multimedia.object_grid((0.3, 0.2), (0.02, 0.5), count=4)
    cameras = multimedia.ring_of_cameras(
        4, 0.6, np.radians(20), interface=tank, target=points.mean(axis=0), principal_distance=25.0
    )
    ids = tuple(f"p{k}" for k in range(len(points)))
    images = [multimedia.project(camera, points, tank) for camera in cameras]
    wrong = replace(LAYERS, indices=(1.0, 1.5, 1.317))
    return multimedia.Project(
        cameras=cameras, media={"tank": multimedia.FlatInterface(layers=wrong)},
        media_of=("tank",) * 4,
        object_points=multimedia.ObjectPoints(ids=ids, xyz=points, sigma=np.zeros_like(points)),
        image_points=multimedia.ImagePoints(
            cameras=tuple(camera.name for camera in cameras for _ in ids), ids=ids * 4,
            image=np.concatenate(images),
        ),
    )  # fmt: skip


@pytest.fixture(scope="module")
def adjusted(project) -> multimedia.Adjustment:
    return multimedia.bundle_adjust(project, multimedia.Unknowns(interior=("c",)))


def test_depth_is_that_before_the_camera_and_outwards_is_positive(adjusted):
    depth, radial = depth_and_radial(adjusted)
    project = adjusted.project
    camera = project.cameras[2]
    row = project.image_points.of_camera(camera.name)[5]
    point = project.object_points.xyz[5]
    # The way from the projection centre to the point, along the direction of view.
    assert depth[row] == pytest.approx(float((point - camera.centre) @ camera.looks_along))
    place, miss = project.image_points.image[row], adjusted.residuals[row]
    longer = np.linalg.norm(place) - np.linalg.norm(place - miss)
    assert radial[row] == pytest.approx(longer, abs=1e-4 * np.linalg.norm(place))
    assert np.sign(radial[row]) == np.sign(longer)


def test_a_wrong_index_shows_over_depth_where_no_other_unknown_takes_it_up(project):
    held = multimedia.Unknowns(interior=("c",), fixed_cameras=project.camera_names)
    depth, radial = depth_and_radial(multimedia.bundle_adjust(project, held))
    lower, upper = np.quantile(depth, [0.25, 0.75])
    near, far = radial[depth < lower], radial[depth > upper]
    spread = np.hypot(near.std() / near.size**0.5, far.std() / far.size**0.5)
    assert abs(near.mean() - far.mean()) > 3 * spread


def test_the_residuals_lie_within_the_rim_of_the_sensor(adjusted):
    """The outer edges of its pixels, in the axes of the image; nothing where none is known."""
    sensor = multimedia.Sensor(
        width=400, height=300, pixel_size=[0.05, 0.05], origin=[199.5, 120.0]
    )
    cameras = [replace(adjusted.project.cameras[0], sensor=sensor), adjusted.project.cameras[1]]
    project = replace(adjusted.project, cameras=(*cameras, *adjusted.project.cameras[2:]))
    figure = Figure()
    say = words_of("multimedia.adjustment", "en")
    draw_vectors(figure, replace(adjusted, project=project), cameras, say)
    first, second = figure.axes
    (rim,) = first.patches
    assert not second.patches
    low, high = rim.get_xy().min(axis=0), rim.get_xy().max(axis=0)
    np.testing.assert_allclose([low, high], [[-10.0, -8.975], [10.0, 6.025]])


def test_the_tables_hold_media_unknowns_and_what_is_alike(adjusted):
    blocks = adjustment_document(adjusted).blocks
    tables = [block for block in blocks if isinstance(block, TextTable)]
    media = tables[0]
    assert media.rows[0][:4] == ["tank", ", ".join(adjusted.project.camera_names),
                                 "1.00000, 1.50000, 1.31700", "0.01"]  # fmt: skip
    assert "normal (0, 0, 1)" in media.rows[0][4]
    found = {row[0]: row for row in tables[1].rows}
    name = adjusted.names[0]
    assert float(found[name][1]) == pytest.approx(adjusted.rows()[0][1], rel=1e-2)
    assert found[name][3] == "m"
    (alike,) = [table for table in tables if "0.9" in table.caption]
    one, other, value, *_ = alike.rows[0]
    matrix = adjusted.correlations[adjusted.names.index(one), adjusted.names.index(other)]
    assert float(value) == pytest.approx(matrix, abs=6e-4)
    assert abs(matrix) > 0.9
    assert sum(isinstance(block, Picture) for block in blocks) == 3


@pytest.fixture(scope="module")
def remarked(project) -> multimedia.Adjustment:
    """Return an adjustment on which there is much to say."""
    swapped = multimedia.FlatInterface(layers=replace(LAYERS, indices=(1.0, 1.2, 1.337)))
    images = project.image_points
    rows = [k for k, name in enumerate(images.ids) if name not in ("p0", "p1")]
    images = multimedia.ImagePoints(
        cameras=tuple(images.cameras[k] for k in rows),
        ids=tuple(images.ids[k] for k in rows),
        image=images.image[rows],
    )
    unknowns = multimedia.Unknowns(interior=("k1",), fixed_cameras=project.camera_names)
    remarks = tuple(f"media.tank: {said}" for said in swapped.remarks)
    result = multimedia.bundle_adjust(replace(project, image_points=images), unknowns)
    return replace(result, remarks=(*remarks, *result.remarks))


@pytest.mark.parametrize("language", ["it", "de"])
def test_remarks_are_in_the_language_of_the_report(remarked, language):
    said = {"which no glass does", "left out: p0, p1", "before the camera", "neighbouring", "k1"}
    assert all(any(words in remark for remark in remarked.remarks) for words in said)
    blocks = adjustment_document(remarked, language=language).blocks
    texts = [block.text for block in blocks if isinstance(block, Paragraph)]
    assert any(text.startswith("media.tank: ") for text in texts)
    assert not [text for text in texts if ENGLISH.search(text)]


def test_of_many_vectors_each_part_of_the_image_keeps_one_of_each_plate():
    side = np.linspace(-0.99, 0.99, 60)
    place = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) * 7.0
    one = _thinned(place, np.zeros(len(place), int), 7.0)
    assert one.sum() == MOST_ARROWS == 20**2
    assert [one[(place @ sides > 0).all(axis=1)].sum() for sides in
            (np.diag([1, 1]), np.diag([1, -1]), np.diag([-1, 1]))] == [100] * 3  # fmt: skip
    two = _thinned(place, np.arange(len(place)) % 2, 7.0)
    assert two.sum() == pytest.approx(MOST_ARROWS, rel=0.15)  # cells end within the square
    few = place[:MOST_ARROWS]
    assert _thinned(few, np.zeros(len(few), int), 7.0).all()
