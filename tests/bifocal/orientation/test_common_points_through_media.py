"""Pairs that look through glass and water, set up by what both photos show and one distance.

Pixels come from rays shot by Snell's law (tests/scenes/wet.py), which know nothing of the package.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from bifocal import Control, GeometryError, Pair, PairMedia, SiteMeasures
from bifocal.demo import WATER_SAMPLE
from bifocal.matching.features import Features
from bifocal.media import interface_axes
from bifocal.orientation.absolute_orientation import orient_pair
from bifocal.orientation.alignment import make_alignment
from bifocal.orientation.orientation_stages import PhotoInput
from tests.bifocal.orientation.pairs_through_media import SIZE, cameras, lens, points
from tests.builders.commands import bifocal_command as main


def pair_of_features(monkeypatch, kind, draw, *, known=None, **site):
    """Return a pair made of features of 0.2 px alone, and errors of 60 points, shape (60, 3). [m]

    Ports are square to the axes of tilted cameras; of the wall 840 points, two fifths of them on
    patches that stand out by up to 0.3 m. X, Y and their turn, which nothing gives, are fitted.
    """
    taken, (indices, thicknesses), placed = cameras(kind, draw)
    axis = kind == "port"
    if axis:
        taken = tuple(replace(c, axes=interface_axes(-c.rotation[2])) for c in taken)
    rng = np.random.default_rng(700 + draw)
    xyz, check = points(rng, 840) * [1.2, 1.2, 0.0], points(rng, 60)
    patch = tuple(np.floor(xyz[:, :2] / 0.35).astype(int).T)
    xyz[:, 2] = np.where(rng.random((9, 9)) < 0.4, rng.uniform(-0.3, 0.3, (9, 9)), 0.0)[patch]
    pixels = [c.view_of(xyz) + rng.normal(0, 0.2, (840, 2)) for c in taken]
    inside = np.all([((p > 0) & (p < SIZE)).all(axis=1) for p in pixels], axis=0)
    codes = np.abs(rng.normal(size=(840, 128))).astype(np.float32)
    codes = (codes / np.linalg.norm(codes, axis=1, keepdims=True))[inside]
    ones = np.ones(len(codes))
    found = tuple(
        Features(pixels=p[inside], size=ones, direction=ones, descriptors=codes, reduction=1.0)
        for p in pixels
    )
    monkeypatch.setattr("bifocal.orientation.absolute_orientation.features_of", lambda _: found)
    lenses = [replace(lens(c, factor=np.exp(rng.normal(0, 5e-4))), **known or {}) for c in taken]
    photos = [PhotoInput(grey=None, name=n, interior=i) for n, i in zip("ab", lenses, strict=True)]
    distance = float(taken[0].centre[2]) + rng.normal(0, 0.005)
    stated = PairMedia.stated(
        indices, thicknesses, **placed, normals=("axis", "axis") if axis else (None, None)
    )
    made = orient_pair(
        (photos[0], photos[1]), control=Control(), media=stated,
        site=SiteMeasures(**(site or {"distance1": distance, "sigma": 0.005})),
    )  # fmt: skip
    alignment = make_alignment(made, (photos[0], photos[1]), way="auto")
    solved = alignment.pair.intersect(*(c.view_of(check) for c in taken), sigma_px=1e-6)
    aside = [places[:, :2] - places[:, :2].mean(axis=0) for places in (solved.xyz, check)]
    left, _, right = np.linalg.svd(aside[0].T @ aside[1])
    error = np.column_stack([aside[0] @ left @ right - aside[1], solved.xyz[:, 2] - check[:, 2]])
    return alignment, error, solved.sigma


@pytest.mark.parametrize(
    ("kind", "draw"),
    [
        ("port", 1),
        ("surface", 2),
        *(pytest.param("port", k, marks=pytest.mark.acceptance) for k in range(2, 7)),
        *(pytest.param("tank", k, marks=pytest.mark.acceptance) for k in range(1, 4)),
    ],
)
def test_common_points_and_one_distance_set_up_a_pair_through_media(monkeypatch, kind, draw):
    made, error, sigma = pair_of_features(monkeypatch, kind, draw)
    assert np.sqrt((error[:, 2] ** 2).mean()) < 0.0014
    assert np.sqrt((error[:, :2] ** 2).mean()) < 0.0015
    # Ties count as 100 independent ones, for errors common to stretches; these have none.
    assert 0.1 < np.sqrt(((error / sigma)[:, 2] ** 2).mean()) < 1.5
    assert made.setup["common_points"]["count"] > 600
    assert made.deviations["tilt1_deg"] < 0.4


@pytest.mark.acceptance
def test_the_sample_under_water_is_set_up_by_the_command_and_one_distance(tmp_path):
    """20 targets to 4 mm, as with the exact cameras: one pixel at 3.5 m is 3 mm."""
    out = tmp_path / "reef.pair.json"
    words = ["--auto", "--distance1", "3.5", "--focal1", "41.784", "--focal2", "22.769"]
    words += ["--sensor-width", "36", "--indices", "1,1.49,1.337", "--thicknesses", "0.01"]
    words += ["--port", "0.05", "--port-normal", "axis", "--no-picture"]
    photos = [str(WATER_SAMPLE / name) for name in ("far.jpg", "near.jpg")]
    result = CliRunner().invoke(main, ["align", *photos, *words, "--out", str(out)])
    assert result.exit_code == 0, result.output
    table = np.genfromtxt(WATER_SAMPLE / "targets.csv", delimiter=",", skip_header=1)
    pair = Pair.read(out)
    off = pair.intersect(table[:, 1:3], table[:, 3:5]).xyz[:, 2] - table[:, 5]
    assert np.isfinite(off).sum() == 20
    assert np.sqrt(np.nanmean(off**2)) < 0.006
    assert pair.image1.z0 == 0.05


@pytest.mark.parametrize(
    ("known", "site", "message"),
    [
        ({}, {"sigma": 0.005}, "nothing gives the scale"),
        ({"sigma_focal": 0.5}, {"distance1": 3.5}, "looks like a wrong refractive index"),
    ],
)
def test_what_common_points_leave_open_through_media_is_refused(monkeypatch, known, site, message):
    with pytest.raises(GeometryError, match=message):
        pair_of_features(monkeypatch, "port", 1, known=known, **site)


@pytest.mark.parametrize(("kind", "refused"), [("surface", True), ("port", False)])
def test_a_depth_that_may_count_from_another_plane_is_refused(monkeypatch, kind, refused):
    """Of a port only the zero of relief hangs on the plane, and a remark says so."""
    monkeypatch.setattr(
        "bifocal.orientation.absolute_orientation.rivals_in_words", lambda *_: "CHECK THE WALL"
    )
    if not refused:
        pair_of_features(monkeypatch, kind, 1)
        return
    with pytest.raises(GeometryError, match=r"--depth counts from the wall.*CHECK.*--wall"):
        pair_of_features(monkeypatch, kind, 1)
