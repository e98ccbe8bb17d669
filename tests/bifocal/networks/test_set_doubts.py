"""What a set of photos oriented together says of itself: its doubts, in the numbers of its own."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bifocal import Control
from bifocal.model.orientation_precision import CAMERA
from bifocal.networks import set_alignment as set_alignment_module
from bifocal.networks.joint_adjustment import JointAdjustment, adjust_jointly
from bifocal.networks.set_alignment import SetAlignment, set_alignment
from bifocal.networks.set_orientation import OrientedSet
from bifocal.remarks import remark
from tests.bifocal.networks.test_photo_sets import simulated

Z = CAMERA.index("Z")


def alignment_of(adjusted: JointAdjustment) -> SetAlignment:
    """Return the set of adjusted cameras, begun with photos "a" and "c", its wall named."""
    pair = SimpleNamespace(remarks=(), wall_named=True, faces=())
    first = SimpleNamespace(
        far=0, near=2, interiors=adjusted.observations.cameras.interiors, pair=pair
    )
    oriented = OrientedSet(
        first=first, adjusted=adjusted, control=Control(), sigma_tie=0.3, on_wall=100,
        free_frame=False, way="site",
    )  # fmt: skip
    return set_alignment(oriented, photos=())


@pytest.fixture(autouse=True)
def _no_photo_left_out_in_turn(monkeypatch):
    """Whether a photo drags the others takes an adjustment of each and is tested with the sets."""
    monkeypatch.setattr(set_alignment_module, "dragging_photo", lambda _: None)


@pytest.fixture(scope="module")
def taped():
    """Four photos, the first one's distance taped; the same with two more tapes, one wrong."""
    seen, start, cameras, _ = simulated(np.random.default_rng(1), by_wall=True)
    height = [float(camera.centre[2]) for camera in cameras]
    tapes = (({2: 1.0}, height[2], 0.01), ({3: 1.0, 1: -1.0}, height[3] - height[1] + 0.15, 0.02))
    knowledge = seen.cameras
    more = replace(knowledge, distances=(*knowledge.distances, *tapes))
    return adjust_jointly(seen, start), adjust_jointly(replace(seen, cameras=more), start), tapes


def test_the_one_tape_that_contradicts_the_photos_is_named_by_as_many_sigmas_as_without_it(taped):
    """A tape's misfit over its sigma is what the set without this tape foretells of it."""
    without, adjusted, (_, (shares, metres, sigma)) = taped
    places = [k * len(CAMERA) + Z for k in shares]
    row = np.array(list(shares.values()))
    foretold = row @ [without.cameras[k].centre[2] for k in shares] - metres
    spread = row @ without.of_cameras[np.ix_(places, places)] @ row
    off = row @ [adjusted.cameras[k].centre[2] for k in shares] - metres
    doubts = [line for line in alignment_of(adjusted).remarks if "tape" in line]
    sigmas = abs(foretold) / np.sqrt(sigma**2 + spread)
    assert len(doubts) == 1
    named = [remark("photo_set.distance_contradicts", name="d - b", off=off, given=metres,
                    sigmas=sigmas * share) for share in (0.9, 0.95, 1.0, 1.05, 1.1)]  # fmt: skip
    assert doubts[0] in named, (doubts, named)


def test_the_file_of_a_set_states_the_sigmas_of_its_own_cameras(taped):
    without, *_ = taped
    aligned = alignment_of(without)
    variances = np.diag(without.of_cameras).reshape(4, -1)
    for k, stated in enumerate(aligned.setup["standard_deviations"]):
        assert stated["distance"] == pytest.approx(np.sqrt(variances[k, Z]))
        # Of the nadir and of the tilt both coordinates, root mean square.
        nadir = np.sqrt(variances[k, Z - 2 : Z].mean())
        assert stated["nadir"] == pytest.approx(nadir)
        tilt = np.sqrt(variances[k, CAMERA.index("turn X") : CAMERA.index("turn X") + 2].mean())
        assert stated["tilt_deg"] == pytest.approx(np.rad2deg(tilt))
    assert not [line for line in aligned.remarks if "tape" in line]


def test_a_distance_that_no_measure_holds_is_called_poor_in_its_own_metres(taped):
    without, *_ = taped
    vague = without.of_cameras.copy()
    place = 3 * len(CAMERA) + Z
    vague[place, place] = 4.0  # 2 m
    about = {"distance": float(without.cameras[3].centre[2]), "sigma": 2.0}
    words = alignment_of(replace(without, of_cameras=vague)).remarks
    assert remark("photo_set.poor_distance", name="d", **about) in words
    assert sum("poorly determined" in line for line in words) == 1
