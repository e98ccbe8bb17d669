"""`solve` holds the picks against the photos that the pair names, where these are at hand."""

import numpy as np
import pytest

from bifocal import InputError, Pair, Photo, solve
from photocore.images import write_image
from tests.bifocal.matching.test_pick_evidence import NEAR, PLACES, SIZE, walls


def pair_file(folder):
    scale = [[0.01, 0, -2.1], [0, -0.01, 1.5], [0, 0, 1]]
    photos = [
        Photo(plane_from_pixel=scale, nadir=(0, 0), distance=d, file=f"{d:g}.png", image_size=SIZE)
        for d in (17.5, 9.5)
    ]
    for photo, image in zip(photos, walls(), strict=True):
        write_image(folder / photo.file, image)
    path = folder / "wall.pair.json"
    Pair(image1=photos[0], image2=photos[1]).write(path)
    return path


def table(folder, picks1, picks2):
    rows = [
        ",".join([f"P{k}", *map(str, row)]) for k, row in enumerate(np.hstack([picks1, picks2]))
    ]
    path = folder / "picks.csv"
    path.write_text("\n".join(["id,col1 [px],row1 [px],col2 [px],row2 [px]", *rows]))
    return path


def test_picks_that_the_photos_contradict_are_refused_by_name(tmp_path):
    pair = pair_file(tmp_path)
    assert not [r for r in solve(table(tmp_path, PLACES, NEAR), pair=pair).remarks if "PICKS" in r]
    with pytest.raises(InputError, match=r"picks.csv: THE PICKS DO NOT FIT .* 2 exchanged"):
        solve(table(tmp_path, NEAR, PLACES), pair=pair)
    moved = solve(table(tmp_path, PLACES, NEAR - [20, 12]), pair=pair)
    assert "+20, +12 px added to col2, row2" in moved.remarks[0]


def test_without_the_photos_nothing_is_held_against_them(tmp_path):
    pair = pair_file(tmp_path)
    (tmp_path / "9.5.png").unlink()
    assert len(solve(table(tmp_path, NEAR, PLACES), pair=pair).table.ids) == len(PLACES)
