"""Refraction correction: exact scenes, several surfaces, precision, beams, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

import multimedia as mm
from multimedia import GeometryError, InputError
from multimedia.bathymetry import refraction_correction, visible_points
from tests.cases import few_by_default

N = 1.34
SURFACES = {
    "flat": mm.Plane.level(102.5),
    "tilted": mm.Plane.tilted(102.5, slope_x=0.01, slope_y=-0.005),
    "wavy": mm.WaveSurface.sinusoid(102.5, amplitude=0.05, wavelength=4.0, direction=1.0),
}


def balanced_point(centres: np.ndarray, headings: np.ndarray, *, by_image: bool) -> np.ndarray:
    """Return where straight rays meet best: what a survey that ignores the water computes."""
    weights = np.ones(len(centres))
    for _ in range(30):
        across = np.eye(3) - headings[:, :, None] * headings[:, None, :]
        normal = np.einsum("m,mij->ij", weights, across)
        point = np.linalg.solve(normal, np.einsum("m,mij,mj->i", weights, across, centres))
        if not by_image:
            break
        weights = 1 / ((point - centres) ** 2).sum(-1)
    return point


def survey(surface, *, by_image: bool = True, seed: int = 1, count: int = 150):
    """Return true points, cameras, apparent points and who saw what: 2 to 9 cameras to 40°."""
    rng = np.random.default_rng(seed)
    true = np.column_stack(
        [rng.uniform(-40, 40, (count, 2)), 101.5 - rng.uniform(0.1, 12.6, count)]
    )
    cameras = np.column_stack([rng.uniform(-70, 70, (60, 2)), rng.uniform(150, 175, 60)])
    water = mm.Interfaces(surfaces=(surface,), indices=(1.0, N))
    apparent, visible = np.empty_like(true), np.zeros((count, 60), dtype=bool)
    for number, point in enumerate(true):
        slant = np.hypot(*(cameras - point)[:, :2].T) / (cameras - point)[:, 2]
        able = np.flatnonzero(slant < np.tan(np.radians(40)))
        seen = rng.permutation(able)[: rng.integers(2, 10)]
        visible[number, seen] = True
        rays = mm.aim_rays(cameras[seen], point, water)
        assert (rays.status == 0).all()
        apparent[number] = balanced_point(cameras[seen], rays.directions[:, 0], by_image=by_image)
    return true, cameras, apparent, visible


def share_of_depth(error: np.ndarray, true: np.ndarray) -> float:
    depth = 102.5 - true[:, 2]
    return float(np.sqrt((error**2).mean() / (depth**2).mean()))


@pytest.mark.parametrize("name", few_by_default(SURFACES, "wavy"))
def test_points_balanced_in_the_images_return_to_the_truth(name: str) -> None:
    true, cameras, apparent, visible = survey(SURFACES[name])
    result = mm.correct_bathymetry(
        apparent, water_level=SURFACES[name], refractive_index=N, cameras=cameras, visible=visible
    )
    assert (result.status == mm.BathymetryStatus.RAYS).all()
    np.testing.assert_allclose(result.xyz, true, atol=1e-9)


@pytest.mark.parametrize("name", few_by_default(SURFACES, "tilted"))
def test_points_balanced_in_space_return_within_1_percent_of_depth_and_in_plan(name: str) -> None:
    # The correction cannot know how the survey weighted its rays; this is the other usual way.
    true, cameras, apparent, visible = survey(SURFACES[name], by_image=False)
    result = mm.correct_bathymetry(
        apparent, water_level=SURFACES[name], refractive_index=N, cameras=cameras, visible=visible
    )
    error = result.xyz - true
    assert share_of_depth((apparent - true)[:, 2], true) > 0.30
    assert share_of_depth(error[:, 2], true) < 0.01
    assert share_of_depth(np.hypot(*error[:, :2].T), true) < 0.01


def test_the_nadir_correction_leaves_what_the_rays_take_away() -> None:
    true, _, apparent, _ = survey(SURFACES["flat"])
    nadir = mm.correct_bathymetry(apparent, water_level=102.5, refractive_index=N)
    assert 0.05 < share_of_depth((nadir.xyz - true)[:, 2], true) < 0.2
    assert (nadir.xyz[:, :2] == apparent[:, :2]).all()
    assert (nadir.status == mm.BathymetryStatus.NADIR).all()


@pytest.mark.parametrize("name", few_by_default(SURFACES, "wavy"))
def test_exact_rays_meet_at_the_true_point_within_1e_9_m(name: str) -> None:
    true, cameras, _, visible = survey(SURFACES[name], seed=2)
    water = mm.Interfaces(surfaces=(SURFACES[name],), indices=(1.0, N))
    origins = np.where(visible[..., None], cameras, np.nan)
    headings = mm.aim_rays(cameras, true[:, None], water).directions[..., 0, :]
    found = mm.intersect_refracted_rays(
        origins, 3.7 * headings, water_level=SURFACES[name], refractive_index=N
    )
    np.testing.assert_allclose(found.xyz, true, atol=1e-9)
    assert found.misfit.max() < 1e-9
    assert (found.rays == visible.sum(-1)).all()


def test_rays_to_a_dry_point_are_not_refracted() -> None:
    centres = np.array([[-5.0, 0, 20], [5, 0, 20]])
    rock = np.array([0.5, 1.0, 0.3])
    found = mm.intersect_refracted_rays(
        centres[None], (rock - centres)[None], water_level=0.0, refractive_index=N
    )
    np.testing.assert_allclose(found.xyz[0], rock, atol=1e-12)
    assert found.status[0] == mm.BathymetryStatus.DRY


def test_map_coordinates_cost_no_accuracy() -> None:
    true, cameras, apparent, visible = survey(SURFACES["flat"])
    shift = np.array([512_345.0, 5_278_901.0, 0.0])
    result = mm.correct_bathymetry(
        apparent + shift,
        water_level=102.5,
        refractive_index=N,
        cameras=cameras + shift,
        visible=visible,
    )
    np.testing.assert_allclose(result.xyz - shift, true, atol=3e-8)


@pytest.mark.parametrize("factor", [1000.0, 0.001])
def test_the_unit_of_length_does_not_matter(factor: float) -> None:
    true, cameras, apparent, visible = survey(SURFACES["tilted"], count=30)
    plane = SURFACES["tilted"]
    scaled = mm.Plane(point=factor * plane.point, normal=plane.normal)
    result = mm.correct_bathymetry(
        factor * apparent,
        water_level=scaled,
        refractive_index=N,
        cameras=factor * cameras,
        visible=visible,
    )
    np.testing.assert_allclose(result.xyz / factor, true, atol=1e-9)


def test_turning_the_scene_about_the_vertical_turns_the_result() -> None:
    true, cameras, apparent, visible = survey(SURFACES["wavy"], count=15)
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    wave = SURFACES["wavy"]
    turned = mm.WaveSurface(
        level=wave.level,
        amplitude=wave.amplitude,
        wave_vector=wave.wave_vector @ turn[:2, :2].T,
        phase=wave.phase,
    )
    result = mm.correct_bathymetry(
        apparent @ turn.T,
        water_level=turned,
        refractive_index=N,
        cameras=cameras @ turn.T,
        visible=visible,
    )
    np.testing.assert_allclose(result.xyz, true @ turn.T, atol=1e-9)


def test_cameras_in_one_line_of_sight_fix_no_point_and_are_not_used_to() -> None:
    result = mm.correct_bathymetry(
        [[0.0, 0.0, -1.0]],
        water_level=0.0,
        refractive_index=N,
        cameras=[[0, 0, 10.0], [0, 0, 20.0]],
    )
    assert result.status[0] == mm.BathymetryStatus.NADIR
    assert result.xyz[0].tolist() == [0.0, 0.0, -N]


def test_dry_points_stay_to_the_last_bit_and_shapes_are_kept() -> None:
    points = np.array([[[0.1, 0.2, 102.6], [0.3, 0.4, 100.1]], [[1, 2, 102.5], [3, 4, 103]]])
    result = mm.correct_bathymetry(points, water_level=102.5, refractive_index=N)
    assert result.xyz.shape == (2, 2, 3)
    assert result.status.tolist() == [[0, 1], [0, 0]]
    np.testing.assert_array_equal(result.xyz[result.status == 0], points[result.status == 0])
    assert result.depth[0, 1] == pytest.approx(N * 2.4)


def test_an_index_of_one_changes_nothing() -> None:
    _, cameras, apparent, visible = survey(SURFACES["tilted"], count=20)
    result = mm.correct_bathymetry(
        apparent,
        water_level=SURFACES["tilted"],
        refractive_index=1.0,
        cameras=cameras,
        visible=visible,
    )
    np.testing.assert_allclose(result.xyz, apparent, atol=1e-9)


def test_points_with_one_camera_get_the_nadir_correction_and_say_so() -> None:
    _, cameras, apparent, visible = survey(SURFACES["flat"], count=10)
    visible[3] = False
    visible[3, 0] = True
    result = mm.correct_bathymetry(
        apparent, water_level=102.5, refractive_index=N, cameras=cameras, visible=visible
    )
    assert result.status[3] == mm.BathymetryStatus.NADIR
    assert result.xyz[3, 2] == pytest.approx(102.5 - N * (102.5 - apparent[3, 2]))


def test_points_outside_a_modelled_surface_are_left_and_named() -> None:
    raster = mm.RasterSurface(raster=np.zeros((4, 4)), xy_from_cell=[[1, 0, 0], [0, -1, 3]])
    result = mm.correct_bathymetry(
        [[1.5, 1.5, -1.0], [9.0, 1.5, -1.0]], water_level=raster, refractive_index=N
    )
    assert result.status.tolist() == [mm.BathymetryStatus.NADIR, mm.BathymetryStatus.NO_SURFACE]
    assert result.xyz[1].tolist() == [9.0, 1.5, -1.0]


def test_the_covariance_agrees_with_finite_differences_of_the_whole_correction() -> None:
    _, cameras, apparent, visible = survey(SURFACES["tilted"], count=12)

    def corrected(points=apparent, lift=0.0, index=N):
        surface = SURFACES["tilted"].shifted([0, 0, lift])
        return mm.correct_bathymetry(
            points, water_level=surface, refractive_index=index, cameras=cameras, visible=visible
        ).xyz

    precision = mm.Precision(index=0.001, level=0.02, point=0.01)
    result = mm.correct_bathymetry(
        apparent,
        water_level=SURFACES["tilted"],
        refractive_index=N,
        cameras=cameras,
        visible=visible,
        precision=precision,
    )
    rates = [
        precision.index * (corrected(index=N + 1e-4) - corrected(index=N - 1e-4)) / 2e-4,
        precision.level * (corrected(lift=1e-3) - corrected(lift=-1e-3)) / 2e-3,
    ]
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-3
        change = corrected(apparent + step) - corrected(apparent - step)
        rates.append(precision.point * change / 2e-3)
    expected = sum(rate[:, :, None] * rate[:, None, :] for rate in rates)
    np.testing.assert_allclose(result.covariance, expected, rtol=1e-4, atol=1e-9)
    assert result.sigma.shape == (12, 3)


def test_sigma_of_the_nadir_correction_by_hand() -> None:
    # 2 m apparent depth: 2 * 0.001 from n, 0.34 * 0.01 from the level, 1.34 * 0.005 from Z.
    result = mm.correct_bathymetry(
        [0.0, 0.0, -2.0],
        water_level=0.0,
        refractive_index=N,
        precision=mm.Precision(index=0.001, level=0.01, point=0.005),
    )
    assert result.sigma[2] == pytest.approx(np.sqrt(0.002**2 + 0.0034**2 + 0.0067**2))
    assert result.sigma[0] == pytest.approx(0.005)


def test_an_oblique_lidar_beam_by_hand() -> None:
    # 45 degrees down from (0, 0, 1): surface at x = 1 after sqrt 2; then 32.03 degrees, and of the
    # remaining 2 m of air range 1.5 m of water are left.
    start = np.array([0.0, 0.0, 1.0])
    echo = start + (np.sqrt(2) + 2.0) * np.array([1.0, 0.0, -1.0]) / np.sqrt(2)
    beam = mm.correct_lidar_beams(start, echo, water_level=0.0, refractive_index=4 / 3)
    angle = np.arcsin(np.sin(np.pi / 4) * 0.75)
    expected = [1 + 1.5 * np.sin(angle), 0, -1.5 * np.cos(angle)]
    np.testing.assert_allclose(beam.xyz, expected, atol=1e-12)
    dry = mm.correct_lidar_beams(start, [0.5, 0, 0.5], water_level=0.0, refractive_index=4 / 3)
    assert dry.xyz.tolist() == [0.5, 0.0, 0.5]
    assert dry.status == mm.BathymetryStatus.DRY


def test_the_group_index_changes_the_range_only() -> None:
    beams = [
        mm.correct_lidar_beams(
            [0, 0, 10.0], [3.0, 1, -4], water_level=0.0, refractive_index=1.337, group_index=group
        ).xyz
        for group in (1.337, 1.36)
    ]
    entry = np.array([3.0, 1, 0]) * 10 / 14
    ratio = np.linalg.norm(beams[1] - entry) / np.linalg.norm(beams[0] - entry)
    assert ratio == pytest.approx(1.337 / 1.36)
    np.testing.assert_allclose(np.cross(beams[0] - entry, beams[1] - entry), 0, atol=1e-12)


def test_waves_turn_rays_by_their_slope_and_average_out() -> None:
    # Slope 2 pi a / L turns the ray in water by (1 - 1/n) slope: at the depth h an error of
    # h (1 - 1/n) 2 pi a / L at the steepest, divided by sqrt 2 for the root mean square.
    wave = mm.WaveSurface.sinusoid(0.0, amplitude=0.002, wavelength=2.0)
    effect = mm.wave_effect(
        [[0, 0, -2.0]],
        [[-0.2, 0, 30], [0.2, 0, 30]],
        water_level=0.0,
        refractive_index=N,
        wave=wave,
    )
    expected = 2 * (1 - 1 / N) * 2 * np.pi * 0.002 / 2.0 / np.sqrt(2)
    assert effect.rms[0, 1] == pytest.approx(expected, rel=0.03)
    assert abs(effect.mean[0, 1]) < 0.01 * expected
    still = mm.wave_effect(
        [[0, 0, -2.0]],
        [[-2, 0, 30], [2, 0, 30]],
        water_level=0.0,
        refractive_index=N,
        wave=mm.WaveSurface.sinusoid(0.0, amplitude=0.0, wavelength=2.0),
        phases=2,
    )
    np.testing.assert_allclose(still.errors, 0, atol=1e-12)


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"refractive_index": 0.9}, InputError, "0.9 is no refractive index of water"),
        ({"refractive_index": 133.4}, InputError, "133.4 is no refractive index"),
        ({"cameras": [[0, 0, -5.0]]}, GeometryError, "1 of 1 are not above the water surface"),
        ({"cameras": np.zeros((0, 3))}, InputError, "no camera is given"),
        ({"cameras": [[0, 0, 5.0]], "visible": [[True, True]]}, InputError, "expected shape"),
        ({"water_level": [1.0, 2.0]}, InputError, "expected one height"),
        ({"water_level": mm.Plane(point=[0, 0, 0], normal=[1, 0, 0])}, GeometryError, "steeper"),
    ],
)
def test_impossible_corrections_are_refused(options, kind, message) -> None:
    call = {"water_level": 0.0, "refractive_index": N} | options
    with pytest.raises(kind, match=message):
        mm.correct_bathymetry([[0.0, 0.0, -1.0]], **call)


def test_negative_precision_is_refused() -> None:
    with pytest.raises(InputError, match="sigma of the level"):
        mm.Precision(level=-1.0)


def many_cameras():
    """Return apparent points over a wide lake, one without position, and 96 cameras."""
    rng = np.random.default_rng(4)
    points = np.column_stack([rng.uniform(0, 400, (700, 2)), 102.5 - rng.uniform(0.2, 8, 700)])
    points[5] = np.nan
    grid = np.stack(np.meshgrid(np.linspace(0, 400, 12), np.linspace(0, 400, 8)), -1)
    return points, np.column_stack([grid.reshape(-1, 2), np.full(96, 150.0)])


def test_cameras_culled_by_angle_are_those_of_a_table_of_all_pairs(monkeypatch):
    points, cameras = many_cameras()
    offset = cameras - points[:, None]
    seen = np.hypot(offset[..., 0], offset[..., 1]) <= np.tan(0.6) * offset[..., 2]
    whole = {"water_level": 102.5, "refractive_index": N, "cameras": cameras}
    whole["precision"] = mm.Precision(index=0.001, level=0.02, point=0.01)
    table = mm.correct_bathymetry(points, visible=seen, **whole)
    monkeypatch.setattr(visible_points, "POINTS", 64)
    monkeypatch.setattr(refraction_correction, "BLOCK_RAYS", 90)
    sparse = mm.correct_bathymetry(points, visible=csr_array(seen), **whole)
    angle = mm.correct_bathymetry(points, max_angle=0.6, **whole)
    both = mm.correct_bathymetry(points, visible=np.ones_like(seen), max_angle=0.6, **whole)
    for other in (sparse, angle, both):
        np.testing.assert_array_equal(other.status, table.status)
        np.testing.assert_allclose(other.xyz, table.xyz, rtol=0, atol=1e-10)
        # The step of the numerical derivative follows the block.
        np.testing.assert_allclose(other.covariance, table.covariance, rtol=1e-6, atol=1e-12)
    wanted = {mm.BathymetryStatus.NADIR, mm.BathymetryStatus.RAYS, mm.BathymetryStatus.FAILED}
    assert set(table.status.tolist()) == wanted


def test_an_angle_that_is_none_is_refused():
    points, cameras = many_cameras()
    for angle in (0.0, 1.6, np.nan):
        with pytest.raises(InputError, match="max_angle"):
            mm.correct_bathymetry(
                points, water_level=102.5, refractive_index=N, cameras=cameras, max_angle=angle
            )
