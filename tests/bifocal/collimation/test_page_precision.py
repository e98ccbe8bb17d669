"""What the page says of the precision of places and of relief, and the drawing scale it chooses."""

from __future__ import annotations

import numpy as np
import pytest

from bifocal.collimation.uncertainty import PRINT, how_good, places_sigma
from tests.page_session import client_of, opened, proposed, sample_folder, two_photos


def test_places_are_known_as_well_as_noise_on_the_picks_moves_them(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        stated = float(np.median(places_sigma(session.pictures, session.results)))
        pair = session.pictures.pair
    rng = np.random.default_rng(5)
    plane = rng.uniform((-4.5, -2.5), (4.5, 2.5), (400, 2))
    picks = [pair.photo(number).pixels_from_plane(plane) for number in (1, 2)]
    moved = [pixels + rng.normal(0.0, 0.5, pixels.shape) for pixels in picks]
    off = pair.intersect(*moved, sigma_px=0.5).xyz[:, :2] - plane
    # 400 draws tell a spread to 4 %, and a quarter of the wall is near the nadir.
    assert np.hypot(*off.std(axis=0)) == pytest.approx(stated, rel=0.15)


def test_the_finest_scale_whose_tolerance_holds_the_places_is_chosen(tmp_path) -> None:
    with opened(sample_folder(tmp_path)) as session:
        good = how_good(session.pictures, session.results)
        assert PRINT.tolerance(20) < good["place"] <= PRINT.tolerance(50)
        state = client_of(session).get("/api/state").json()
        assert state["drawing_scale"] == good["scale"] == 50
        assert "1:50 holds" in state["good"]


def test_without_a_scale_no_drawing_scale_is_chosen(tmp_path) -> None:
    with opened(two_photos(tmp_path)) as session:
        proposed(session, tmp_path)
        assert client_of(session).get("/api/state").json()["drawing_scale"] is None
