"""What a client would send back, on façades and textures that no constant was found on.

The constants were found on `facade` (seeds 11, 12, 61 and 62) and looked at on the church; these
scenes are another façade, `loggia`, with other seeds, and a poorer plaster. One constant was found
on `loggia` 201 and 202 since: `hypothesis.least_area`. Limits leave room for
other processors, no more: `python benchmarks/bench_delivery.py` prints the figures.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bifocal import dense_relief, orthophoto
from tests.scenes import POOR, RICH, bifocal_cameras, render
from tests.scenes.delivery import bars, hidden_figures, ortho_figures, relief_figures
from tests.scenes.loggia import loggia

pytestmark = pytest.mark.acceptance

PLASTER = replace(POOR, wall=replace(POOR.wall, contrast=0.005))
SCENES = {"stone": (201, RICH), "plaster": (202, PLASTER)}


@pytest.fixture(scope="module", params=SCENES)
def delivered(request):
    seed, palette = SCENES[request.param]
    cameras = bifocal_cameras(size=(1536, 1024))
    shot = render(loggia(seed=seed, palette=palette), cameras, rng=np.random.default_rng(seed))
    relief = dense_relief(shot.pair, shot.image1, shot.image2)
    picture = orthophoto(shot.pair, shot.image1, relief)
    figures = relief_figures(relief, shot) | ortho_figures(picture, relief)
    figures |= hidden_figures(picture.hidden, shot)
    figures["bars"] = bars(picture.hidden, relief.grid.pixel_of(shot.pair.image1.nadir))
    return request.param, figures


#: The most of each figure on stone and on plaster; what the version before the tails were worked
#: on had is in brackets.
MOST = {
    "median mm": (0.55, 4.5),  # (0.54, 8.4)
    "beyond 3 cm %": (2.5, 15.5),  # (3.5, 20.6)
    "rmse off edges mm": (1.0, 27.0),  # (1.0, 31.5)
    "ortho beyond 1 px %": (1.6, 10.0),  # (2.1, 13.9)
    "measured beyond 3 cm %": (1.6, 7.0),  # (2.4, 11.6)
    "measured rmse off edges mm": (0.90, 12.0),  # (0.95, 15.4)
    "measured error/sigma": (1.3, 1.4),  # (4.0, 2.4)
    "false measured %": (3.4, 4.5),  # (14.6, 9.1)
    "phantom px": (50, 1500),  # (0, 5570)
    # Of it are truly hidden, and so rightly empty, all but what is wrongly hidden.
    "empty of known %": (3.8, 3.0),  # (3.7, 3.9)
    "wrongly hidden %": (0.3, 0.55),
    "empty of measured %": (0.02, 0.02),  # (0.11, 0.25)
    "small holes": (10, 20),  # (408, 1440)
    "specks": (10, 10),  # (29, 41)
    "scraps": (3, 6),  # (3, 3)
    "bars": (0, 0),  # (0, 0)
}
LEAST = {
    "measured %": (93.0, 53.0),  # (93.3, 62.4)
    "within 2 sigma %": (95.0, 95.0),  # (100, 96.4)
    "hidden recall": (0.68, 0.5),  # (0.70, 0.40)
    "hidden precision": (0.9, 0.8),  # (0.82, 0.39)
}


def test_the_tails_stay_short(delivered):
    name, figures = delivered
    number = list(SCENES).index(name)
    too_much = {key: figures[key] for key, most in MOST.items() if figures[key] > most[number]}
    too_little = {key: figures[key] for key, least in LEAST.items() if figures[key] < least[number]}
    assert not too_much
    assert not too_little
