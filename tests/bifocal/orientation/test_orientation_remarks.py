"""What is told of an oriented pair, by numbers that are known before."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from bifocal import Control, Interior
from bifocal.model.interior_orientation import with_one_lens
from bifocal.orientation.adjustment.pair_adjustment import as_one
from bifocal.orientation.orientation_remarks import control_remarks
from bifocal.remarks import remark


def test_a_square_sum_is_as_unlikely_as_so_many_deviations_of_one_value():
    """Of two values the chance is exp(-T² / 2), of one beyond two deviations 0.0455."""
    assert as_one(9.0, 1) == pytest.approx(3.0)
    assert as_one(-2 * np.log(0.04550026), 2) == pytest.approx(2.0, abs=1e-6)
    assert as_one(1e6, 4) == 1000.0  # a chance below all floats


@pytest.mark.parametrize(
    ("count", "key"),
    [(0, ""), (3, "few_control"), (4, "cipa_nine"), (8, "cipa_nine"), (9, "")],
)
def test_control_is_asked_for_up_to_four_points_and_advised_up_to_nine(count, key):
    some = Control(
        ids=tuple(f"P{k}" for k in range(count)), xyz=np.zeros((count, 3)),
        sigma=np.full((count, 3), 0.003), pixels1=np.zeros((count, 2)),
        pixels2=np.zeros((count, 2)),
    )  # fmt: skip
    pair = SimpleNamespace(
        adjusted=SimpleNamespace(control_test=np.zeros(count)),
        observations=SimpleNamespace(pick_used=np.ones(count, dtype=bool)),
    )
    words = [remark(f"orientation.{key}", count=count)] if key else []
    assert control_remarks(some, pair) == words


def test_one_lens_is_certain_only_where_both_principal_distances_are_known():
    size = (1536, 1024)
    measured = Interior.from_focal(1.2 * 1536, image_size=size, sigma=0.02, source="--focal")
    assumed = Interior.unknown(size)
    for first, second, known in (
        (measured, measured, True), (measured, assumed, False), (assumed, measured, False),
        (assumed, assumed, False),
    ):  # fmt: skip
        interiors, certain = with_one_lens((first, second))
        assert certain == known
        assert [one.focal for one in interiors] == pytest.approx([1.2 * 1536] * 2)
        assert all(one.sigma_radial > 0 for one in interiors)
