"""Tracks against simulated truth: links, velocities with their precision, odd vectors."""

from __future__ import annotations

import numpy as np
import pytest

from multimedia import InputError, track_particles
from multimedia.tracking.chance import common_drift, fitted
from multimedia.tracking.linking import LinkRules, linked, usual_step
from multimedia.tracking.velocities import differs_from_neighbours, track_velocities
from tests.cases import few_by_default
from tests.multimedia.tracking.flows import links_of, simulated, vortices

HALF = 0.5  # of the mean distance


def shares(places, whose) -> tuple[float, float]:
    """Return which share of tracks of four frames and more is whole, and of links is wrong."""
    step = usual_step(places)
    previous = linked(places, fitted(places, LinkRules(step=step, change=step, gap=2)))
    names, true = np.concatenate(whose), links_of(whose)
    has = previous >= 0
    wrong = (names[has] != names[previous[has]]).mean()
    numbers = np.unique(names, return_inverse=True)[1]
    broken = np.bincount(numbers[previous != true], minlength=numbers.max() + 1) > 0
    return float((~broken[np.bincount(numbers) >= 4]).mean()), float(wrong)


@pytest.mark.parametrize("seed", few_by_default([11, 12], 11))
@pytest.mark.parametrize("kind", ["vortices", "each its own way"])
def test_a_thousand_particles_with_steps_to_half_their_distance_are_followed(kind, seed):
    flow = vortices(HALF) if kind == "vortices" else None
    whole, wrong = shares(*simulated(flow, speed=HALF, seed=seed))
    assert whole > 0.965
    assert wrong < 0.001


@pytest.mark.parametrize(("flow", "least"), [(vortices(0.4), 0.95), (None, 0.8)])
def test_particles_among_false_ones_and_with_a_quarter_missing_are_followed(flow, least):
    """Where those around go, they tell of it; without, and for own ways, 0.88 and 0.82 of links."""
    places, whose = simulated(flow, speed=0.4, missing=0.25, count=700, frames=10, seed=14)
    rng = np.random.default_rng(15)
    for t, xyz in enumerate(places):
        false = len(xyz) // 2
        places[t] = np.vstack([xyz, rng.uniform(0, 10, (false, 3))])
        whose[t] = np.append(whose[t], -1 - 1000 * t - np.arange(false))
    tracks = track_particles(places)
    assert wrong_share(tracks, whose) < 0.006
    names, true = np.concatenate(whose), links_of(whose)
    frame = np.repeat(np.arange(10), list(map(len, whose)))
    _, number, count = np.unique(names, return_inverse=True, return_counts=True)
    # Of those that are there four times and never longer gone than the gap.
    linkable = ((true >= 0) & (frame - frame[true] <= 3) & (count[number] >= 4)).sum()
    joined = (np.diff(tracks.track) == 0).sum() * (1 - wrong_share(tracks, whose))
    assert joined / linkable > least


def wrong_share(tracks, whose) -> float:
    """Return which share of the links of tracks joins two particles."""
    names = np.array([whose[f][n] for f, n in zip(tracks.frame, tracks.number, strict=True)])
    return float((np.diff(names)[np.diff(tracks.track) == 0] != 0).mean())


@pytest.mark.parametrize(
    ("speed", "count"),
    [(1.0, 216), (1.6, 216), pytest.param(3.0, 1500, marks=pytest.mark.acceptance)],
)
def test_a_flow_faster_than_half_the_distance_is_followed_about_its_drift(speed, count):
    """Of 216 particles, 1.67 apart on the average, and of 1500, 0.87 apart."""
    way = speed * np.array([0.8, 0.0, -0.6])
    places, whose = simulated(
        lambda xyz: np.tile(way, (len(xyz), 1)), speed=speed, count=count, frames=7
    )
    tracks = track_particles(places)
    assert wrong_share(tracks, whose) < 0.002
    assert np.abs(tracks.drift - way).max() < tracks.step / 2 < speed / 2
    assert tracks.change < 0.2 * tracks.step
    assert np.abs(tracks.velocity.mean(axis=0) - way).max() < 0.01
    assert tracks.by_chance < 0.01 * len(tracks.track)
    assert not tracks.remarks


def test_vortices_that_drift_by_more_than_the_distance_of_particles_are_followed():
    """By 1.2 mean distances, the vortices 0.3: 1.5 % of links wrong, 5 to 10 without the drift."""
    apart = 10.0 / np.cbrt(600)
    way, turning = 1.2 * apart * np.array([0.6, 0.8, 0.0]), vortices(0.3 * apart)
    places, whose = simulated(
        lambda xyz: turning(xyz) + way, speed=apart, count=600, frames=7, seed=3
    )
    tracks = track_particles(places)
    assert wrong_share(tracks, whose) < 0.03
    assert np.abs(tracks.drift - way).max() < tracks.step / 2


def test_fast_streams_against_each_other_have_no_drift_and_widen_the_step():
    rng = np.random.default_rng(2)
    xyz, names, places, whose = rng.uniform(0, 10, (216, 3)), np.arange(216), [], []
    way = rng.choice([-1.0, 1.0], 216)[:, None] * np.array([1.0, 0.0, 0.0])
    for _ in range(8):
        places.append(xyz + 0.005 * rng.standard_normal(xyz.shape))
        whose.append(names)
        gone = ((xyz + way < 0) | (xyz + way > 10)).any(axis=1)
        xyz = np.where(gone[:, None], rng.uniform(0, 10, xyz.shape), xyz + way)
        names = names + 1000 * gone
    tracks = track_particles(places)
    assert wrong_share(tracks, whose) < 0.005
    assert not tracks.drift.any()
    assert tracks.step > 1.0


@pytest.mark.parametrize("count", [100, 800])
def test_particles_that_share_no_displacement_have_no_drift(count):
    rng = np.random.default_rng(count)
    for _ in range(3):
        # Denser in a corner.
        places = [10 * rng.beta(1, 2, (count, 3)) for _ in range(6)]
        assert common_drift(places, usual_step(places)) is None
    assert common_drift([np.empty((0, 3))] * 3, 1.0) is None
    flat = [np.column_stack([rng.uniform(0, 9, (count, 2)), np.zeros(count)])]
    flat += [flat[0] + [k * 1.5, 0, 0] for k in range(1, 4)]
    drift = common_drift(flat, 0.4)
    assert drift == pytest.approx((1.5, 0, 0), abs=0.2)


def test_particles_that_go_nowhere_are_chance_and_refused_with_the_way_out():
    rng = np.random.default_rng(3)
    with pytest.raises(InputError, match=r"these are chance.*--step"):
        track_particles([rng.uniform(0, 10, (100, 3)) for _ in range(7)])


def test_tracks_that_may_be_chance_in_part_say_how_many():
    # Each goes its own way anew in every frame, a tenth of their distance.
    rng = np.random.default_rng(4)
    places = [rng.uniform(0, 7, (300, 3))]
    for _ in range(7):
        places.append(places[-1] + 0.1 * rng.standard_normal((300, 3)))
    tracks = track_particles(places)
    assert 0.1 < tracks.by_chance / len(tracks.track) < 0.5
    assert f"{tracks.by_chance} of {len(tracks.track)} points" in tracks.remarks[0]


@pytest.mark.acceptance
def test_particles_that_are_missing_in_some_frames_are_found_again():
    places, whose = simulated(vortices(0.3), speed=0.3, missing=0.03, frames=20, seed=13)
    whole, wrong = shares(places, whose)
    assert whole > 0.93
    assert wrong < 0.002
    tracks = track_particles(places, gap=2)
    assert (np.diff(tracks.frame)[np.diff(tracks.track) == 0] == 2).sum() > 300
    none = track_particles(places, gap=0)
    assert (np.diff(none.frame)[np.diff(none.track) == 0] == 1).all()


def test_a_new_particle_is_told_by_its_fourth_frame():
    # Two ways out of the origin: one that bends a little and goes on, one straight that ends.
    ways = [[[0, 0, 0]], [[1, 0, 0], [0, 1, 0]], [[2.05, 0, 0], [0, 2, 0]], [[3.05, 0, 0]]]
    places = [np.array(frame, dtype=float) for frame in ways]
    previous = linked(places, LinkRules(step=1.5, change=0.5, gap=0))
    assert previous.tolist() == [-1, 0, -1, 1, -1, 3]


def test_the_mean_distance_comes_from_nearest_neighbours():
    places, _ = simulated(None, speed=0.1, frames=2, count=1000)
    assert usual_step(places) == pytest.approx(0.5, rel=0.05)


def test_velocities_have_the_errors_that_their_sigmas_say():
    rng = np.random.default_rng(5)
    count, points = 400, 12
    track, times = np.repeat(np.arange(count), points), np.tile(np.arange(points) / 50.0, count)
    true = np.repeat(rng.uniform(-3, 3, (count, 3)), points, axis=0)
    root = 0.01 * np.array([[1.0, 0.0, 0.0], [0.3, 1.0, 0.0], [0.5, -0.2, 3.0]])
    xyz = true * times[:, None] + rng.standard_normal((len(track), 3)) @ root.T
    covariance = np.broadcast_to(root @ root.T, (len(track), 3, 3))
    velocity, own = track_velocities(xyz, covariance, times, track)
    sigma = np.sqrt(np.diagonal(own, axis1=1, axis2=2))
    ratio = np.sqrt((((velocity - true) / sigma) ** 2).mean(axis=0))
    assert np.abs(ratio - 1).max() < 0.08
    # The middle of five points: sigma over sqrt(10) frames of 1/50 s.
    assert np.median(sigma[5::points, 0]) == pytest.approx(0.01 / np.sqrt(10) * 50, rel=0.02)


@pytest.mark.parametrize("omega", [0.1, 0.2, 0.25, 0.4])
def test_what_a_parabola_leaves_out_of_a_turning_motion_is_in_the_sigma(omega: float) -> None:
    """On circles, their velocities by calculus; at the ends of tracks as in their middle."""
    rng = np.random.default_rng(6)
    count, points = 200, 16
    track, times = np.repeat(np.arange(count), points), np.tile(np.arange(points) * 1.0, count)
    angle = omega * times + np.repeat(rng.uniform(0, 6, count), points)
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    true = omega * np.column_stack([-np.sin(angle), np.cos(angle), 0 * angle])
    for noise in (0.001, 0.002, 0.02):
        xyz = circle + noise * rng.standard_normal(circle.shape)
        covariance = np.broadcast_to(noise**2 * np.eye(3), (len(xyz), 3, 3))
        velocity, own = track_velocities(xyz, covariance, times, track)
        sigma = np.sqrt(np.diagonal(own, axis1=1, axis2=2))
        error = ((velocity - true) / sigma)[:, :2].reshape(count, points, 2)
        for place in (slice(0, 2), slice(2, -2), slice(-2, None)):
            assert 0.8 < np.sqrt((error[:, place] ** 2).mean()) < 1.4, place


def test_a_short_track_has_a_line_and_one_point_has_none():
    xyz = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 5, 5]])
    velocity, _ = track_velocities(
        xyz, np.tile(np.eye(3), (4, 1, 1)), np.array([0.0, 1, 3, 0]), np.array([0, 0, 0, 1])
    )
    slope = np.polyfit([0.0, 1, 3], [0.0, 1, 2], 1)[0]
    assert velocity[:3, 0] == pytest.approx([slope] * 3)
    assert np.isnan(velocity[3]).all()


@pytest.mark.parametrize(("turning", "off"), [(0.3, 0.5), (0.1, 0.15)])
def test_vectors_that_differ_from_those_around_are_marked(turning, off):
    rng = np.random.default_rng(8)
    xyz = rng.uniform(0, 10, (500, 3))
    velocity = vortices(turning)(xyz) + 0.005 * rng.standard_normal(xyz.shape)
    odd = rng.choice(500, 12, replace=False)
    velocity[odd] += rng.choice([-off, off], (12, 3))
    covariance = np.tile(0.005**2 * np.eye(3), (500, 1, 1))
    marked = differs_from_neighbours(xyz, velocity, covariance)
    assert marked[odd].all()
    assert marked.sum() - 12 <= 5


@pytest.mark.parametrize("share", [0.5, 0.2])
def test_vectors_of_streams_that_cross_do_not_differ_and_odd_ones_among_them_do(share):
    rng = np.random.default_rng(9)
    xyz, noise = rng.uniform(0, 10, (500, 3)), 0.005
    is_across = rng.uniform(size=(500, 1)) < share
    velocity = vortices(0.1)(xyz) + np.where(is_across, [0.0, 0.4, 0.0], [0.4, 0.0, 0.0])
    velocity += noise * rng.standard_normal(xyz.shape)
    odd = rng.choice(500, 12, replace=False)
    velocity[odd] += rng.choice([-0.5, 0.5], (12, 3))
    covariance = np.tile(noise**2 * np.eye(3), (500, 1, 1))
    marked = differs_from_neighbours(xyz, velocity, covariance)
    assert marked[odd].all()
    # All sixteen around are of the other stream for 2.8 % of the fifth that crosses.
    assert marked.sum() - 12 <= 500 * share * (1 - share) ** 16 + 3


def test_tracks_are_in_time_and_long_enough():
    places, whose = simulated(vortices(0.2), speed=0.2, frames=8, count=200, seed=3)
    tracks = track_particles(places, frames=range(101, 109), rate=10.0)
    same = np.diff(tracks.track) == 0
    assert (np.diff(tracks.frame)[same] > 0).all()
    assert np.bincount(tracks.track).min() >= 4
    assert tracks.count == tracks.track.max() + 1
    names = [whose[f - 101][n] for f, n in zip(tracks.frame, tracks.number, strict=True)]
    true = vortices(0.2)(np.stack([places[f - 101][n] for f, n in
                                   zip(tracks.frame, tracks.number, strict=True)]))  # fmt: skip
    assert len(set(names)) >= 190
    assert np.median(np.linalg.norm(tracks.velocity - 10.0 * true, axis=1)) < 0.06


def test_what_cannot_be_followed_is_refused():
    some = [np.zeros((1, 3))] * 4
    with pytest.raises(InputError, match="three or more in a row"):
        track_particles(some[:2])
    with pytest.raises(InputError, match="three or more in a row"):
        track_particles(some, frames=[1, 2, 4, 5])
    with pytest.raises(InputError, match="finite"):
        track_particles([np.full((1, 3), np.nan)] * 3)
    with pytest.raises(InputError, match="shortest 2"):
        track_particles(some, shortest=2)
    assert track_particles([np.empty((0, 3))] * 4).count == 0


def test_variances_of_velocities_are_none_below_zero_where_points_are_of_unequal_precision():
    rng = np.random.default_rng(3)
    track = np.repeat(np.arange(40), 8)
    times = np.tile(np.arange(8.0), 40)
    xyz = np.stack([times**3 * rng.uniform(0, 1, 320), times, 0 * times], axis=1)
    covariance = 10.0 ** rng.uniform(-4, 0, (320, 1, 1)) * np.eye(3)
    _, variances = track_velocities(xyz, covariance, times, track)
    assert (np.diagonal(variances, axis1=1, axis2=2) > 0).all()
