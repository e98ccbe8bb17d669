"""Sets of photos: their file, their names, the pairs they hold; a set of two is the pair."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from bifocal import SAMPLE, GeometryError, InputError, Lens, Pair, Photo, PhotoSet
from bifocal.model.orientation_precision import CAMERA, names_of
from bifocal.model.photo_set import ray_angles

METRES = np.array([[0.004, 0, -6.0], [0, -0.004, 4.0], [0, 0, 1.0]])
SIZE = (3001, 2001)


def photo(distance, aside=0.0, **more):
    return Photo(
        plane_from_pixel=METRES, nadir=[aside, 0], distance=distance, image_size=SIZE, **more
    )


def three(**more):
    """Return near, far and mid, in this order: nothing may reorder them."""
    photos = [photo(9.5, file="a/1.jpg"), photo(17.5, name="far"), photo(14.0, 1.5, file="b/2.jpg")]
    return PhotoSet(photos=tuple(photos), **more)


def covariance(count=3, seed=1):
    root = np.random.default_rng(seed).normal(0, 1e-4, (12 * count, 12 * count))
    return root @ root.T


def test_photos_keep_their_order_and_are_called_as_told_or_as_their_file():
    assert three().names == ("1", "far", "2")
    twins = PhotoSet(photos=(photo(9.5, file="near/1.jpg"), photo(17.5, file="far/1.jpg")))
    assert twins.names == ("near/1.jpg", "far/1.jpg")
    named = PhotoSet(photos=(photo(9.5, file="1.jpg"), photo(17.5, file="1.jpg", name="far")))
    assert named.names == ("1", "far")
    assert PhotoSet(photos=(photo(9.5), photo(17.5))).names == ("photo 1", "photo 2")


def test_a_file_comes_back_whole_with_keys_it_does_not_know(tmp_path):
    photos = three(orientation=covariance(), extra={"note": "kept", "setup": {"x": 1}})
    data = photos.to_dict()
    data["photos"][1]["camera"] = "D700"
    path = tmp_path / "wall.photos.json"
    PhotoSet.from_dict(data).write(path)
    again = PhotoSet.read(path)
    assert again.to_dict()["photos"][1]["camera"] == "D700"
    assert json.loads(path.read_text())["format"] == "bifocal-photos/1"
    assert (again.extra, again.names) == (photos.extra, photos.names)
    assert np.array_equal(again.orientation, photos.orientation)
    assert again.photos[2].path == tmp_path / "b/2.jpg"
    for one, other in zip(again.photos, photos.photos, strict=True):
        assert np.array_equal(one.plane_from_pixel, other.plane_from_pixel)
        assert (one.distance, one.image_size) == (other.distance, SIZE)


def test_photos_that_name_one_lens_file_share_the_lens(tmp_path):
    matrix = [[4000, 0, 1500], [0, 4000, 1000], [0, 0, 1]]
    lens = Lens(camera_matrix=matrix, coefficients=[-0.1, 0, 0, 0], image_size=SIZE)
    lens.write(tmp_path / "lens.json")
    data = three().to_dict()
    for entry in data["photos"][:2]:
        entry["lens"] = "lens.json"
    first, second, third = PhotoSet.from_dict(data, folder=tmp_path).photos
    assert first.lens is second.lens is not None
    assert third.lens is None


def test_a_pair_file_is_a_set_of_two_and_a_set_of_two_is_a_pair(tmp_path):
    pair, photos = (kind.read(SAMPLE / "facade.pair.json") for kind in (Pair, PhotoSet))
    photos.write(tmp_path / "two.photos.json")
    for again in (photos.pair(), Pair.read(tmp_path / "two.photos.json"), PhotoSet.of(pair).pair()):
        assert again.extra == pair.extra
        assert np.array_equal(again.orientation, pair.orientation)
        for mine, own in ((again.image1, pair.image1), (again.image2, pair.image2)):
            assert np.array_equal(mine.plane_from_pixel, own.plane_from_pixel)
            assert (mine.distance, mine.file) == (own.distance, own.file)


def test_a_pair_of_the_set_has_the_far_photo_first_and_its_part_of_the_covariance():
    photos = three(orientation=covariance())
    names = names_of(None, 3)
    for first, second, far, near in ((0, 1, 1, 0), ("far", "2", 1, 2), ("1", "2", 2, 0)):
        pair = photos.pair(first, second)
        assert (pair.image1.name, pair.image2.name) == (photos.names[far], photos.names[near])
        assert not pair.remarks
        chosen = [names.index(f"{name} {k + 1}") for k in (far, near) for name in CAMERA]
        assert np.array_equal(pair.orientation, photos.orientation[np.ix_(chosen, chosen)])


def test_pairs_are_ranked_by_what_they_tell_of_relief():
    ranked = three().pairs()
    assert [(pair.far, pair.near) for pair in ranked] == [(1, 0), (2, 0), (1, 2)]
    # Two photos of one station promise nothing, nor do two that show different walls.
    moved = METRES + np.array([[0, 0, 100.0], [0, 0, 0], [0, 0, 0]])
    elsewhere = replace(photo(5.0), plane_from_pixel=moved, nadir=[100.0, 0.0])
    photos = (photo(17.5), photo(17.5, 2.0), elsewhere)
    assert PhotoSet(photos=photos).pairs() == ()


def test_a_pair_whose_rays_part_too_far_comes_after_those_that_match():
    apart = [photo(9.0, -5.0), photo(8.9, 4.0), photo(8.8, 0.0)]
    ranked = PhotoSet(photos=tuple(apart)).pairs()
    sigmas = {pair[:2]: pair.sigma_r for pair in ranked}
    assert min(sigmas, key=sigmas.get) == (0, 1)  # the most precise, if anything matched
    assert [pair[:2] for pair in ranked] == [(0, 2), (1, 2), (0, 1)]
    # 45 degrees to one side and to the other: a right angle.
    assert ray_angles(photo(5.0, -5.0), photo(5.0, 5.0), [0.0, 0.0, 0.0]) == pytest.approx(
        np.pi / 2
    )


def test_a_photo_sees_what_is_in_its_frame():
    photos = three()
    xyz = np.array([[0, 0, 0], [5.9, 3.9, 0], [7, 0, 0], [0, 0, 12.0]])
    assert photos.sees(xyz).tolist() == [
        [True, True, False, False], [True, True, False, True], [True, True, False, False]
    ]  # fmt: skip
    for mine, own in zip(photos.project(xyz), photos.photos, strict=True):
        assert np.array_equal(mine, own.project(xyz), equal_nan=True)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "bifocal-photo/1"}, '"format" must be "bifocal-photos/1"'),
        ({"photos": []}, '"photos" must list two photos or more'),
        ({"photos": {"far": 1}}, '"photos" must list two photos or more'),
        ({"photos": [1, 2]}, '"photos\\[0\\]" is missing or not an object'),
        (
            {"orientation": {"parameters": ["X 1"]}},
            '"orientation": expected .* with the 36 parameters',
        ),
        ({"layers": {"indices": [1]}}, '"layers"'),
    ],
)
def test_a_set_that_is_none_is_refused_by_name(tmp_path, change, message):
    path = tmp_path / "bad.photos.json"
    path.write_text(json.dumps({**json.loads(json.dumps(plain(three()))), **change}))
    with pytest.raises(InputError, match=f"bad.photos.json: {message}"):
        PhotoSet.read(path)


def plain(photos):
    from photocore.jsonfile import plain as made_plain

    return made_plain(photos.to_dict())


def test_what_is_wrong_with_a_photo_is_said_with_its_place(tmp_path):
    data = plain(three())
    for key, value, message in (
        ("distance", -1, r'"photos\[1\]": distance: must be above zero'),
        ("name", 5, r'"photos\[1\].name" must be text'),
        ("lens", "none.json", "none.json"),
    ):
        entries = [dict(entry) for entry in data["photos"]]
        entries[1][key] = value
        with pytest.raises(InputError, match=message):
            PhotoSet.from_dict({**data, "photos": entries}, folder=tmp_path)
    with pytest.raises(InputError, match='two photos are called "far"'):
        PhotoSet(photos=(photo(9, name="far"), photo(8, name="far")))
    with pytest.raises(InputError, match="two photos or more, found 1"):
        PhotoSet(photos=(photo(9),))


def test_a_photo_that_is_not_there_and_a_pair_that_is_none_are_refused():
    photos = three()
    with pytest.raises(InputError, match="no photo middle in this set; it has 1, far, 2"):
        photos.pair("far", "middle")
    with pytest.raises(InputError, match="no photo 3"):
        photos.pair(0, 3)
    with pytest.raises(InputError, match="far was named twice"):
        photos.pair("far", 1)
    with pytest.raises(GeometryError, match="both cameras stand 9 m"):
        PhotoSet(photos=(photo(9), photo(9, 1))).pair()
    with pytest.raises(InputError, match=r"set of 3 photos \(1, far, 2\), and a"):
        Pair.from_dict(photos.to_dict())
