"""Ports that lean, as typed, along the axis or found: exact relief and honest sigmas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import (
    Interior,
    PairMedia,
    SiteMeasures,
    align,
)
from tests.bifocal.orientation.pairs_through_media import GLASS, SIZE, control_of, lens, points
from tests.builders.pinholes import camera_matrix, rotation_from_vector
from tests.scenes import SetupErrors, bifocal_cameras
from tests.scenes.refracted import seen_at
from tests.scenes.wet import under_water


@pytest.mark.parametrize("normal", ["typed", "axis"])
def test_a_port_that_leans_as_typed_or_with_the_camera_gives_exact_relief(normal):
    rng = np.random.default_rng(3)
    places = np.array([0.05, -0.02, 3.5]), np.array([-0.03, 0.04, 1.9])
    turns = [rotation_from_vector(v) for v in ([0.12, -0.08, 0.02], [-0.06, 0.1, -0.01])]
    looks = [np.diag([1.0, -1.0, -1.0]) @ turn for turn in turns]
    typed = [np.array([0.1, -0.15, 1.0]), np.array([-0.07, 0.05, 1.0])]
    matrices = [camera_matrix(f, 1.0, 1535.5, 1023.5) for f in (3500.0, 1900.0)]
    xyz, check = points(rng, 8), points(rng, 2)

    def seen(number, which):
        toward = typed[number] if normal == "typed" else -looks[number][2]
        centre = places[number]
        shown = [
            seen_at(
                point, nadir=centre[:2], distance=centre[2], z0=0.05, indices=GLASS[0],
                thicknesses=GLASS[1], normal=toward,
            )
            for point in which
        ]  # fmt: skip
        way = np.column_stack([shown, np.zeros(len(shown))]) - centre
        mapped = way @ looks[number].T @ matrices[number].T
        return mapped[:, :2] / mapped[:, 2:]

    lenses = [
        replace(
            Interior.from_focal(m[0, 0], image_size=SIZE, sigma=5e-4, source="board"),
            is_calibrated=True,
        )
        for m in matrices
    ]
    media = PairMedia.stated(
        *GLASS, ports=(0.05, None), normals=tuple(typed) if normal == "typed" else ("axis", "axis")
    )
    made = align(
        None, None, interiors=tuple(lenses), media=media, site=SiteMeasures(sigma_pick=0.01),
        control=control_of(xyz, [seen(0, xyz), seen(1, xyz)], 1e-6),
    )  # fmt: skip
    found = made.pair.intersect(seen(0, check), seen(1, check)).xyz
    np.testing.assert_allclose(found, check, atol=1e-9)


def leaning(leans=((1.5, -1.0), (-0.8, 2.0)), *, turned=0.0):
    """Return cameras of ports that lean against the wall by degrees about X and Y."""
    square = bifocal_cameras(
        size=SIZE, pixel=0.00074, d1=3.5, d2=1.9, rng=np.random.default_rng(4),
        errors=SetupErrors(tilt_deg=turned, distance=0.02, offset=0.1),
    )  # fmt: skip
    wet = under_water(square, indices=GLASS[0], thicknesses=GLASS[1], z0=(0.05, 0.06), leans=leans)
    return wet.far, wet.near


def aligned_leaning(taken, xyz, picks, *, sigma=0.01, known=1e-6, **media):
    return align(
        None, None, interiors=tuple(lens(c) for c in taken),
        control=control_of(xyz, picks, known), site=SiteMeasures(sigma_pick=sigma),
        media=PairMedia.stated(*GLASS, ports=(0.05, 0.06), **media),
    )  # fmt: skip


@pytest.mark.parametrize("from_axis", [False, True])
def test_how_ports_lean_is_found_where_the_points_carry_it(from_axis):
    """Nothing is typed but that they may lean; rays are shot by tests/scenes/wet.py."""
    taken = leaning(turned=2.0)
    xyz, check = (points(np.random.default_rng(k), count) for k, count in ((1, 14), (5, 20)))
    made = aligned_leaning(
        taken, xyz, [c.view_of(xyz) for c in taken], sigma=1e-4, known=1e-8,
        normals=("axis", "axis") if from_axis else (None, None),
        priors={"lean1": np.radians(2.0), "lean2": np.inf},
    )  # fmt: skip
    for photo, camera in zip((made.pair.image1, made.pair.image2), taken, strict=True):
        assert np.abs(photo.interface_normal - camera.axes[2]).max() < 1e-5
    found = made.pair.intersect(*(c.view_of(check) for c in taken)).xyz
    np.testing.assert_allclose(found, check, atol=1e-6)
    assert set(made.deviations) > {"lean X 1", "lean Y 1", "lean X 2", "lean Y 2"}
    stated = " ".join(made.words)
    if not from_axis:
        assert "lean X 1 came out 1.50°" in stated
        assert "(given 0.00° ± 2.00°)" in stated
        assert "(given 0.00° ± anything)" in stated
    # Taken as parallel to the wall the same picks are wrong by millimetres.
    dull = aligned_leaning(taken, xyz, [c.view_of(xyz) for c in taken], known=1e-3, sigma=0.5)
    off = dull.pair.intersect(*(c.view_of(check) for c in taken)).xyz - check
    assert np.abs(off).max() > 0.001
    assert made.pair.orientation.shape == (36, 36)


def test_a_lean_that_points_do_not_carry_is_said_to_rest_on_the_prior():
    """A lean turns all rays nearly alike, as the camera's own turn does."""
    taken, rng = leaning(), np.random.default_rng(1)
    xyz = points(rng, 12, 0.02) * [0.3, 0.3, 1.0]
    picks = [c.view_of(xyz) + rng.normal(0, 0.5, (12, 2)) for c in taken]
    made = aligned_leaning(taken, xyz, picks, sigma=0.5, known=0.003, estimate=["lean1"])
    assert any(
        r.startswith("lean X 1 [degrees]: the data hardly carry it; it rests on what was given, 0")
        for r in made.remarks
    )
    assert made.deviations["lean X 1"] == pytest.approx(np.radians(1.0), rel=0.1)


def test_photos_the_other_way_round_take_their_leans_along():
    taken, xyz = leaning(), points(np.random.default_rng(1), 14)
    made = align(
        None, None, interiors=(lens(taken[1]), lens(taken[0])),
        control=control_of(xyz, [taken[1].view_of(xyz), taken[0].view_of(xyz)], 1e-8),
        site=SiteMeasures(sigma_pick=1e-4),
        media=PairMedia.stated(
            *GLASS, ports=(0.06, 0.05), normals=(taken[1].axes[2], None), priors={"lean2": 0.03}
        ),
    )  # fmt: skip
    assert np.abs(made.pair.image1.interface_normal - taken[0].axes[2]).max() < 1e-5
    assert "lean X 1" in made.deviations


def noisy_leans(draw):
    """Return errors over sigmas of the leans (4,) and of 30 check points (30, 3)."""
    rng = np.random.default_rng(900 + draw)
    leans = rng.normal(0, 1.0, (2, 2))
    taken = leaning(tuple(map(tuple, leans)), turned=1.0)
    xyz, check = points(rng, 14), points(rng, 30)
    picks = [[c.view_of(p) + rng.normal(0, 0.35, (len(p), 2)) for c in taken] for p in (xyz, check)]
    lenses = [lens(c, factor=np.exp(rng.normal(0, 5e-4)), away=rng.normal(0, 5, 2)) for c in taken]
    made = align(
        None, None, interiors=tuple(lenses), site=SiteMeasures(sigma_pick=0.35),
        control=control_of(xyz + rng.normal(0, 5e-4, xyz.shape), picks[0], 5e-4),
        media=PairMedia.stated(*GLASS, ports=(0.05, 0.06), estimate=["lean1", "lean2"]),
    )  # fmt: skip
    found = made.pair.intersect(*picks[1], sigma_px=0.35)
    off = []
    for number, (photo, camera) in enumerate(
        zip((made.pair.image1, made.pair.image2), taken, strict=True), start=1
    ):
        apart = np.cross(camera.axes[2], photo.interface_normal)
        off += [apart[k] / made.deviations[f"lean {a} {number}"] for k, a in enumerate("XY")]
    return np.array(off), (found.xyz - check) / found.sigma


@pytest.mark.acceptance
def test_errors_of_leans_are_as_large_as_their_sigmas_say():
    drawn = [noisy_leans(draw) for draw in range(40)]
    leans = np.concatenate([off for off, _ in drawn])
    spread = np.concatenate([off for _, off in drawn])
    assert 0.85 < np.sqrt((leans**2).mean()) < 1.15
    assert 0.9 < np.sqrt((spread**2).mean()) < 1.1
