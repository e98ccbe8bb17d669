"""Slips of the hand when a set-up is typed: named, and mended where only one thing can be meant."""

from dataclasses import replace

import numpy as np
import pytest

from bifocal import Control, GeometryError, InputError, Interior, SiteMeasures
from bifocal.orientation.absolute_orientation import _with_words
from bifocal.orientation.adjustment.pair_observations import PairObservations
from bifocal.orientation.alignment import make_alignment
from bifocal.orientation.approximate_orientation import Given
from bifocal.orientation.orientation_remarks import hopeless_shape, model_remarks
from bifocal.orientation.slips import (
    TrialOrientation,
    TypedOrientation,
    _may_be_parts,
    slip_of,
)
from bifocal.orientation.validation import check_units
from bifocal.orientation.walls.wall_shape import WallShape, shape_in_words
from tests.bifocal.orientation.layered_wall import SIZE, camera
from tests.bifocal.orientation.test_pair_adjustment import POINTS
from tests.builders.orientation import PhotoInput, orient_pair
from tests.builders.pinholes import project
from tests.cases import few_by_default

#: Turned to the wall, and square to it.
OBLIQUE = (
    camera(16.0, offset=(0.4, -0.2), turn_deg=(8.0, -20.0, 1.0)),
    camera(9.0, offset=(-0.3, 0.1), turn_deg=(-6.0, 15.0, -2.0)),
)
SQUARE = (camera(16.0, turn_deg=(0.3, -0.2, 0.1)), camera(9.0, turn_deg=(-0.2, 0.3, -0.2)))
SENSOR = 22.7
NINE = POINTS[[0, 1, 2, 3, 4, 8, 9, 10, 11]]


def control(cameras=OBLIQUE, *, xyz=NINE, seed=0, noise=0.4) -> Control:
    rng = np.random.default_rng(seed)
    picks = [project(cam, xyz) + rng.normal(0, noise, (len(xyz), 2)) for cam in cameras]
    return Control(
        ids=tuple(f"P{k}" for k in range(len(xyz))), xyz=xyz + rng.normal(0, 0.002, xyz.shape),
        sigma=np.full(xyz.shape, 0.003), pixels1=picks[0], pixels2=picks[1],
    )  # fmt: skip


def photos(cameras=OBLIQUE, *, times=(1.0, 1.0), size=SIZE) -> tuple[PhotoInput, PhotoInput]:
    """Return photos whose focal lengths are typed so many times too long."""
    interiors = [
        Interior.from_focal(
            cam.matrix[0, 0] * factor, image_size=shape, sigma=0.02, source="--focal",
            pixel_size=SENSOR / shape[0],
        )
        for cam, factor, shape in zip(cameras, times, (SIZE, size), strict=True)
    ]  # fmt: skip
    first, second = (
        PhotoInput(grey=None, interior=interior, name=name)
        for interior, name in zip(interiors, ("far.jpg", "near.jpg"), strict=True)
    )
    return first, second


def off(made, cameras=OBLIQUE) -> float:
    """Return by which share of it a distance is wrong at most."""
    found = [c.centre[2] for c in made.adjusted.cameras]
    return max(abs(a / c.centre[2] - 1) for a, c in zip(found, cameras, strict=True))


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("times", "said"),
    [
        ((36 / SENSOR, 36 / SENSOR), r"35-mm equivalent: 29.1 and 16.4 mm on this sensor"),
        pytest.param(
            (1.5, 1.5), "probably its height: 34.1 mm was taken", marks=pytest.mark.acceptance
        ),
        ((1.35, 1.0), "contradict the control points and were left out"),
    ],
)
def test_a_focal_length_that_control_contradicts_is_overruled_and_named(times, said) -> None:
    made = orient_pair(photos(times=times), control=control(), site=SiteMeasures())
    assert said.replace(r"29.1 and 16.4", focals()) in made.remarks[0]
    assert off(made) < 0.01
    assert made.observations.pick_used.all()


def focals() -> str:
    return " and ".join(f"{cam.matrix[0, 0] * SENSOR / SIZE[0]:.3g}" for cam in OBLIQUE)


@pytest.mark.acceptance
def test_a_crop_factor_left_out_of_the_sensor_is_named() -> None:
    made = orient_pair(photos(times=(1 / 1.6,) * 2), control=control(), site=SiteMeasures())
    assert "(crop factor 1.6) and was taken" in made.remarks[0]
    assert off(made) < 0.01


def test_distances_tell_what_control_square_to_the_wall_hardly_does() -> None:
    site = SiteMeasures(distance1=16.0, distance2=9.0)
    typed = photos(SQUARE, times=(36 / SENSOR,) * 2)
    made = orient_pair(typed, control=control(SQUARE), site=site)
    assert "35-mm equivalent" in made.remarks[0]
    assert off(made, SQUARE) < 0.01


def test_a_cropped_photo_is_taken_as_a_part_of_one_as_large_as_the_other() -> None:
    points = control()
    points = replace(points, pixels2=points.pixels2 - [90, 40])
    size = (SIZE[0] - 150, SIZE[1] - 100)
    typed = photos(times=(1.0, size[0] / SIZE[0]), size=size)
    made = orient_pair(typed, control=points, site=SiteMeasures())
    assert "Photo 2 is 810 px wide, photo 1 960 px: the former fits as a part" in made.remarks[0]
    assert off(made) < 0.02


def from_bottom(pixels: np.ndarray) -> np.ndarray:
    return pixels * [1, -1] + [0, SIZE[1] - 1]


@pytest.mark.parametrize(
    ("slip", "said"),
    [
        (lambda c: replace(c, pixels1=from_bottom(c.pixels1), pixels2=from_bottom(c.pixels2)),
         "row1, row2 seem to count from the bottom"),
        (lambda c: replace(c, xyz=c.xyz * [1, -1, 1]), "the sign of Y changed"),
        (lambda c: replace(c, xyz=c.xyz[:, [1, 0, 2]]), "with X and Y exchanged"),
        pytest.param(
            lambda c: replace(c, xyz=c.xyz * [1, 1, -1]), "with the sign of r changed",
            marks=pytest.mark.acceptance,
        ),
    ],
)  # fmt: skip
def test_a_control_table_that_counts_otherwise_is_refused_by_name(slip, said) -> None:
    with pytest.raises(GeometryError, match=said):
        orient_pair(photos(), control=slip(control()), site=SiteMeasures())


def test_two_points_exchanged_are_put_right() -> None:
    points = control()
    order = [0, 1, 5, 3, 4, 2, 6, 7, 8]
    made = orient_pair(
        photos(), control=replace(points, xyz=points.xyz[order]), site=SiteMeasures()
    )
    assert "control points P2 and P5 are exchanged" in made.remarks[0]
    assert made.observations.pick_used.all()
    assert off(made) < 0.01


@pytest.mark.acceptance
def test_two_slips_at_once_are_both_named() -> None:
    typed, points = photos(times=(36 / SENSOR,) * 2), control()
    turned = replace(points, xyz=points.xyz[:, [1, 0, 2]])
    with pytest.raises(GeometryError, match=r"35-mm equivalent: .* with X and Y exchanged"):
        orient_pair(typed, control=turned, site=SiteMeasures())
    exchanged = replace(points, xyz=points.xyz[[0, 1, 5, 3, 4, 2, 6, 7, 8]])
    made = orient_pair(typed, control=exchanged, site=SiteMeasures())
    assert "35-mm equivalent" in made.remarks[0]
    assert "P2 and P5 are exchanged" in made.remarks[0]
    assert off(made) < 0.01


def test_distances_in_the_wrong_order_are_exchanged() -> None:
    site = SiteMeasures(distance1=9.0, distance2=16.0)
    made = orient_pair(photos(), control=control(), site=site)
    assert "the two distances were exchanged" in made.remarks[0]
    assert off(made) < 0.002
    assert not made.exchanged


def test_the_near_photo_first_takes_its_own_distance_along(monkeypatch) -> None:
    """And slips are looked for once, before the photos are exchanged."""
    asked = []
    monkeypatch.setattr(
        "bifocal.orientation.absolute_orientation.slip_of",
        lambda *given, **how: asked.append(slip_of(*given, **how)),
    )
    far, near = photos()
    site = SiteMeasures(distance1=9.0, distance2=16.0)
    made = orient_pair((near, far), control=control().exchanged(), site=site)
    assert made.exchanged
    assert "Image 1 of the pair file is far.jpg, and --distance2 means its" in made.remarks[0]
    assert off(made) < 0.002
    assert asked == [None]


def test_a_doubt_comes_first_and_leaves_nothing_called_good() -> None:
    """A wall bent by 3 px, control that fits."""
    pair = orient_pair(photos(), control=control(), site=SiteMeasures())
    given = Given(photos=photos(), control=control(), site=SiteMeasures())
    told = [
        _with_words(replace(pair, remarks=(), shape=bend), given, ("Something else.",))
        for bend in (WallShape(0.1, 0.01), WallShape(3.0, 0.1))
    ]
    fine, bent = (make_alignment(one, photos(), way="control") for one in told)
    assert "relief is good to" in " ".join(fine.words)
    assert "relief is good to" not in " ".join((*bent.words, *bent.setup["words"]))
    assert bent.remarks[0].startswith("THE MODEL DOES NOT FIT")
    assert bent.setup["doubts"] == [bent.remarks[0]]


def test_one_wrong_lens_of_two_is_told_by_what_each_would_have_to_be() -> None:
    """As two tapes and common points leave them: near 18 mm typed as 24 beside 36 mm."""
    pair, site = orient_pair(photos(), control=control(), site=SiteMeasures()), SiteMeasures()
    typed = [
        replace(interior, focal=camera.matrix[0, 0] / factor)
        for interior, camera, factor in zip(
            pair.observations.interiors, pair.adjusted.cameras, (1.1534, 0.867), strict=True
        )
    ]
    seen = replace(pair.observations, interiors=(typed[0], typed[1]))
    far, near = model_remarks(replace(pair, observations=seen), site)
    assert "photo 1 came out +15.3 %" in far
    assert far.endswith("If the other photo's is right, it is +33 % off.")
    assert near.endswith("If the other photo's is right, it is -25 % off.")


def test_a_distance_is_contradicted_beyond_three_standard_deviations_only() -> None:
    pair = orient_pair(photos(), control=control(), site=SiteMeasures())
    far, near = (float(camera.centre[2]) for camera in pair.adjusted.cameras)

    def said(distance1: float | None, distance2: float | None) -> list[str]:
        return model_remarks(
            pair, SiteMeasures(distance1=distance1, distance2=distance2, sigma=0.02)
        )

    assert not said(far - 0.059, near + 0.059)
    (only,) = said(None, near - 0.1)
    assert "The near camera's distance came out +0.100 m" in only
    assert "5 of its standard deviations" in only
    (only,) = said(far + 0.1, None)
    assert "The far camera's distance came out -0.100 m" in only


def test_a_bend_that_is_not_certain_refuses_nothing() -> None:
    """The refusal was empty then."""
    seen = PairObservations(interiors=(photos()[0].interior, photos()[1].interior))
    assert not hopeless_shape(seen, WallShape(1.2, 0.6))
    assert hopeless_shape(seen, WallShape(3.0, 0.6)).startswith("THE MODEL DOES NOT FIT")


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.acceptance) for seed in (1, 2, 3))]
)
def test_clean_control_is_charged_with_no_slip(seed) -> None:
    for cameras in (OBLIQUE, SQUARE):
        rng = np.random.default_rng(seed)
        typed = photos(cameras, times=np.exp(rng.normal(0, 0.02, 2)))
        site = SiteMeasures(distance1=16.0, distance2=9.0) if seed % 2 else SiteMeasures()
        made = orient_pair(typed, control=control(cameras, seed=seed), site=site)
        assert not [text for text in made.remarks if "taken" in text or "exchanged" in text]


def test_a_contradicted_tape_is_the_likely_reason() -> None:
    words = shape_in_words(WallShape(3.0, 0.1), with_lens=True, tape=True)
    assert "The likely reason is a distance measured on site" in words
    assert "lens" not in words
    pair = orient_pair(photos(), control=control(), site=SiteMeasures())
    rough = replace(pair, observations=replace(pair.observations, sigma_tie=9.0))
    far = float(pair.adjusted.cameras[0].centre[2])
    for off, reason in ((0.0, "lens distortion"), (2.0, "a distance measured on site")):
        said = model_remarks(rough, SiteMeasures(distance1=far + off, sigma=0.02))
        assert all(reason in text for text in said if "miss their lines" in text)


@pytest.mark.parametrize(("typed", "unit"), [(900.0, "cm"), (9430.0, "mm")])
def test_a_distance_too_far_is_taken_for_the_nearest_unit(typed, unit) -> None:
    cameras = orient_pair(photos(), control=control(), site=SiteMeasures()).adjusted.cameras
    scale = float(cameras[0].centre[2]) / 9.43
    with pytest.raises(InputError, match=f"is it in {unit}"):
        check_units(cameras, SiteMeasures(distance1=typed * scale))


def shown(pictures: tuple[PhotoInput, PhotoInput], points: Control) -> tuple[PhotoInput, ...]:
    """Return photos of noise that show one thing in both at each of the points."""
    rng = np.random.default_rng(3)
    greys = [rng.integers(0, 255, SIZE[::-1]).astype(np.uint8) for _ in pictures]
    for places in np.round(np.stack(points.picks, axis=1)).astype(int):
        board = rng.integers(0, 255, (41, 41)).astype(np.uint8)
        for grey, (column, row) in zip(greys, places, strict=True):
            grey[row - 20 : row + 21, column - 20 : column + 21] = board
    return tuple(replace(p, grey=g) for p, g in zip(pictures, greys, strict=True))


def typed_focals(pictures: tuple[PhotoInput, ...], order: int = 1) -> tuple[PhotoInput, PhotoInput]:
    """Return photos whose focal lengths were typed in this order, whatever the photos show."""
    lenses = [replace(p.interior, is_typed=True) for p in photos(SQUARE)][::order]
    first, second = (replace(p, interior=i) for p, i in zip(pictures, lenses, strict=True))
    return first, second


def sharp() -> Control:
    """Return control picked without noise: what is shown there is at the pick."""
    return control(SQUARE, noise=0.0)


@pytest.mark.parametrize(
    ("named", "focals", "turned", "said"),
    few_by_default(
        [
            (1, 1, False, ""),
            (-1, 1, False, "named in the wrong order"),
            (1, -1, False, "--focal1 16.37 and --focal2 29.1 are exchanged"),
            (-1, 1, True, "--focal1"),
            (1, 1, True, "col1, row1 of the control points belong to the second photo"),
        ],
        (1, 1, False, ""),
        (-1, 1, False, "named in the wrong order"),
    ),
)
def test_what_the_photos_show_decides_between_slips_that_fit_alike(
    named, focals, turned, said
) -> None:
    """Control and lenses fit inverted relief as well: one slip explains it, not two."""
    points = sharp()
    files = shown(photos(SQUARE), points)[::named]
    given = points.exchanged() if turned else points
    made = orient_pair(typed_focals(files, focals), control=given, site=SiteMeasures())
    first = made.remarks[0]
    assert said in first
    assert bool(said) == ("exchanged" in first or "wrong order" in first)
    assert off(made, SQUARE) < 0.03
    near_first = named == -1
    assert made.exchanged == near_first


@pytest.mark.parametrize(
    ("cuts", "said"),
    [
        (((220, 150), (220, 150)), "Both photos fit as parts cut out of larger ones"),
        # So little misses by what control may, but no camera gives such a shape.
        (((0, 0), (100, 0)), "cut out of"),
        (((0, 0), (0, 0)), ""),
    ],
)
def test_cropped_photos_are_taken_as_parts_of_larger_ones(cuts, said) -> None:
    points = control(xyz=np.concatenate([POINTS, POINTS * [0.7, 0.8, 1.0] + [0.2, 0.1, 0.12]]))
    picks = [p - cut for p, cut in zip((points.pixels1, points.pixels2), cuts, strict=True)]
    points = replace(points, pixels1=picks[0], pixels2=picks[1])
    typed = [
        replace(
            p, interior=Interior.from_focal(
                cam.matrix[0, 0], image_size=(SIZE[0] - cut[0], SIZE[1] - cut[1]), sigma=0.02,
                source="EXIF", pixel_size=SENSOR / SIZE[0],
            ),
        )
        for p, cam, cut in zip(photos(), OBLIQUE, cuts, strict=True)
    ]  # fmt: skip
    made = orient_pair((typed[0], typed[1]), control=points, site=SiteMeasures())
    parts = [text for text in made.remarks if "cut out of" in text]
    assert bool(parts) == bool(said)
    assert said in "".join(parts)
    assert made.observations.pick_used.all()
    assert off(made) < 0.02


@pytest.mark.parametrize(
    ("sigma", "far", "doubted"), [(0.5, 13.0, True), (0.5, 16.5, False), (0.02, 13.0, False)]
)
def test_that_photos_may_be_cropped_is_a_doubt_where_points_cannot_tell(sigma, far, doubted):
    """All points fit if so, though not better by much; as whole photos one does not."""
    lenses = tuple(replace(p.interior, sigma_focal=sigma) for p in photos() if p.interior)
    typed = TypedOrientation(interiors=lenses, control=control(), site=SiteMeasures())

    def fitted(one: TypedOrientation) -> TrialOrientation | None:
        cropped = any(i.sigma_centre > 100 for i in one.interiors)
        if one.control is not typed.control or one.interiors[0].sigma_focal != sigma:
            return None
        lost = np.arange(9) == (9 if cropped else 4)
        cameras = (camera(far), OBLIQUE[1]) if cropped else OBLIQUE
        return TrialOrientation(misfit=1.1 if cropped else 2.2, cameras=cameras, lost=lost)

    slip = slip_of(typed, fitted, by_control=True)
    assert (slip is not None) == doubted
    if slip is not None:
        assert slip.meant is typed
        assert "WERE THE PHOTOS CROPPED?" in slip.words
        assert "13 and 9 m" in slip.words


@pytest.mark.parametrize(
    ("size", "near", "misfit", "asked"),
    [
        (SIZE, SIZE, 0.5, False),
        (SIZE, SIZE, 1.2, True),
        (SIZE, (SIZE[0] // 2, SIZE[1] // 2), 0.5, True),
        ((SIZE[0], SIZE[0] - 400), (SIZE[0], SIZE[0] - 400), 0.5, True),
    ],
)
def test_shape_size_or_misfit_ask_whether_photos_were_cropped(size, near, misfit, asked) -> None:
    interiors = tuple(
        replace(p.interior, image_size=s)
        for p, s in zip(photos(), (size, near), strict=True)
        if p.interior
    )
    typed = TypedOrientation(interiors=interiors, control=control(), site=SiteMeasures())
    trial = TrialOrientation(misfit=misfit, cameras=OBLIQUE, lost=np.zeros(9, bool))
    assert _may_be_parts(typed, trial) == asked


def test_a_tape_in_feet_is_named_where_lens_and_control_agree() -> None:
    with pytest.raises(InputError, match=r"--distance1 52.4934 m .* by the factor of ft"):
        orient_pair(
            photos(), control=control(), site=SiteMeasures(distance1=16 / 0.3048, distance2=9.0)
        )


def test_control_in_feet_is_named_by_a_taped_distance_alone() -> None:
    points = control()
    points = replace(points, xyz=points.xyz / 0.3048)
    with pytest.raises(InputError, match=r"are in ft: .* --distance1 says 16 m"):
        orient_pair(photos(), control=points, site=SiteMeasures(distance1=16.0))
    made = orient_pair(photos(), control=points, site=SiteMeasures())
    assert made.adjusted.cameras[0].centre[2] == pytest.approx(16 / 0.3048, rel=0.01)


def many(seed: int) -> Control:
    """Return sixteen points, half of them off the wall, as many on either side of the middle."""
    rng = np.random.default_rng(seed)
    xyz = np.column_stack([rng.uniform(0.8, 4.5, 16), rng.uniform(-2.5, 2.5, 16), np.zeros(16)])
    xyz[::2, 0] *= -1
    xyz[::4, 2], xyz[1::4, 2] = 0.35, -0.3
    return control(xyz=xyz, seed=seed, noise=0.2)


def test_two_groups_of_control_are_named_and_widen_what_is_stated() -> None:
    fine, points = many(4), many(4)
    points = replace(points, xyz=points.xyz + np.where(points.xyz[:, :1] > 0, [0.05, 0, 0], 0.0))
    clean = orient_pair(photos(), control=fine, site=SiteMeasures())
    made = orient_pair(photos(), control=points, site=SiteMeasures())
    assert not any("GROUPS" in text or "miss by" in text for text in clean.remarks)
    (words,) = [text for text in made.remarks if "TWO GROUPS" in text]
    assert "below X = " in words
    apart = float(words.partition("groups lie ")[2].partition(" mm")[0])
    assert abs(abs(apart) - 50) < 12
    assert made.adjusted.sigma("X", 1) > 1.5 * clean.adjusted.sigma("X", 1)
