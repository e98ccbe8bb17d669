"""Distance and tilt of a flat port from boards under water, on images of vectors and bisection."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from multimedia import (
    Brown,
    Camera,
    FlatInterface,
    ImagePoints,
    Layers,
    ObjectPoints,
    Project,
    Unknowns,
    bundle_adjust,
)

INDICES, GLASS, DISTANCE, TILT = (1.0, 1.5, 1.337), 8.0, 46.0, (0.012, -0.009)
C, CENTRE, K1 = 8.0, (0.05, -0.03), -4e-4
NOISE = 0.0003
PRIORS = {"port:offset": 1.0, "port:tilt1": 0.01, "port:tilt2": 0.01, "index3": 0.001}
#: Of the outer face, from the water towards the camera; x right, y up, z backwards.
NORMAL = np.array([TILT[0], TILT[1], 1.0]) / math.hypot(*TILT, 1.0)


def images_of(points: np.ndarray) -> np.ndarray:
    """Return images [mm] of points in the camera frame: Snell's law, the sine in air bisected."""
    depth = -points @ NORMAL  # along the normal, from the centre into the water
    aside = points + depth[:, None] * NORMAL
    far = np.linalg.norm(aside, axis=1)
    low, high = np.zeros(len(far)), np.ones(len(far))
    ways = (DISTANCE - GLASS, GLASS)
    for _ in range(80):
        sine = (low + high) / 2
        reach = sum(
            way * sine / n / np.sqrt(1 - (sine / n) ** 2)
            for way, n in zip((*ways, depth - DISTANCE), INDICES, strict=True)
        )
        low, high = np.where(reach < far, sine, low), np.where(reach < far, high, sine)
    air = (sine / np.maximum(far, 1e-300))[:, None] * aside - np.sqrt(1 - sine**2)[:, None] * NORMAL
    ideal = -C * air[:, :2] / air[:, 2:]
    return ideal * (1 + K1 * (ideal**2).sum(1, keepdims=True)) + CENTRE


def boards(count: int, near: float, far: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the corners of a board, and where they are in the camera frame for each photo."""
    x, y = np.meshgrid(np.arange(9.0), np.arange(6.0))
    corners = 24.0 * np.column_stack([x.ravel() - 4, y.ravel() - 2.5, 0 * x.ravel()])
    rng, placed = np.random.default_rng(12), []
    for k in range(count):
        away = near + (far - near) * k / max(count - 1, 1)
        angles = [*np.radians(rng.uniform(-30, 30, 2)), rng.uniform(-3, 3)]
        aside = 0.25 * away * rng.uniform(-1, 1, 2)
        placed.append(Rotation.from_euler("XYZ", angles).apply(corners) + np.array([*aside, -away]))
    return corners, placed


def a_project(seed: int, *, count: int = 12, near: float = 200.0, far: float = 700.0) -> Project:
    """Return boards with noise, and a port that starts off by draws of its priors (seed 0: not)."""
    rng = np.random.default_rng(seed)
    corners, placed = boards(count, near, far)
    off = rng.normal(size=4) * (seed > 0)
    leaning = np.array([off[1] * PRIORS["port:tilt1"], off[2] * PRIORS["port:tilt2"], 0.0])
    away = DISTANCE + off[0] * PRIORS["port:offset"]
    index = INDICES[2] + off[3] * PRIORS["index3"]
    port = FlatInterface(
        layers=Layers(indices=(*INDICES[:2], index), thicknesses=(GLASS,)),
        point=-away * NORMAL, normal=NORMAL + leaning, moves_with_camera=True,
    )  # fmt: skip
    names = [f"p{k}" for k in range(count)]
    ids = tuple(f"{name}_{i}" for name in names for i in range(len(corners)))
    image = np.concatenate([images_of(p) for p in placed])
    camera = Camera.from_angles(
        (0, 0, 0), 0, 0, 0, principal_distance=C, principal_point=CENTRE, distortion=Brown(k1=K1),
        name="cam1",
    )  # fmt: skip
    return Project(
        cameras=(camera,), media={"port": port}, media_of=("port",), unit="mm",
        object_points=ObjectPoints(
            ids=ids, xyz=np.tile(corners, (count, 1)),
            groups=tuple(name for name in names for _ in corners),
        ),
        image_points=ImagePoints(
            cameras=("cam1",) * len(ids), ids=ids,
            image=image + NOISE * rng.normal(size=image.shape) * (seed > 0),
        ),
        sigma_image=NOISE,
    )  # fmt: skip


def unknowns_of(project: Project, **more: object) -> Unknowns:
    return Unknowns(
        fixed_cameras=("cam1",), plates=tuple(dict.fromkeys(project.object_points.groups)),
        interior=("c", "xh", "yh", "k1"), media=("offset", "tilt1", "tilt2", "index3"),
        **{"priors": PRIORS} | more,
    )  # fmt: skip


def errors_of(seed: int, count: int = 12) -> dict[str, float]:
    """Return errors over sigmas of lens, index and port; the port's tilt along its directions."""
    project = a_project(seed, count=count)
    found = bundle_adjust(project, unknowns_of(project))
    truth = {"cam1:c": C, "cam1:xh": CENTRE[0], "cam1:yh": CENTRE[1], "cam1:k1": K1,
             "index3": INDICES[2]}  # fmt: skip
    pulls = {name: (found.value(name) - true) / found.sigma(name) for name, true in truth.items()}
    port = found.project.media["port"]
    away = float(-port.point @ port.normal)
    pulls["port:offset"] = (away - DISTANCE) / found.sigma("port:offset")
    turned = port.normal - NORMAL  # both of length one: what is left are the two tilts
    rows = [found.names.index(f"port:tilt{k}") for k in (1, 2)]
    values = np.linalg.eigvalsh(found.covariance[np.ix_(rows, rows)])
    assert values[0] > 0
    pulls["tilt"] = float(np.linalg.norm(turned) / np.sqrt(values.sum()))
    return pulls


def test_exact_images_give_the_port_to_rounding() -> None:
    project = a_project(0)
    found = bundle_adjust(project, unknowns_of(project, priors={}))
    port = found.project.media["port"]
    assert abs(float(-port.point @ port.normal) - DISTANCE) < 1e-7
    np.testing.assert_allclose(port.normal, NORMAL, atol=1e-10)
    assert found.value("cam1:c") == pytest.approx(C, abs=1e-8)


@pytest.mark.acceptance
def test_what_the_images_carry_of_a_port_is_said() -> None:
    project = a_project(3)
    near = " ".join(bundle_adjust(project, unknowns_of(project)).remarks)
    carried = near.split("Carried by the images")[1]
    assert "port:offset (" in carried
    assert "mm, given 1 mm)" in carried
    assert "deg, given 0.57 deg)" in carried
    # Far boards, few of them: the port's distance rests on what was measured with callipers.
    project = a_project(3, count=4, near=900.0, far=1400.0)
    far = bundle_adjust(project, unknowns_of(project, priors=PRIORS | {"port:offset": 0.1}))
    assert any(
        line.startswith("port:offset: the data hardly carry it; it rests on what was given, ± 0.1")
        for line in far.remarks
    )


@pytest.mark.acceptance
def test_errors_of_draws_scatter_by_their_sigmas() -> None:
    """Ten draws of what the docs count in forty: chi-square of all errors at 0.1 %."""
    pulls = [list(errors_of(seed, count=6).values()) for seed in range(1, 11)]
    free = np.size(pulls)
    low, high = chi2.ppf((0.0005, 0.9995), free) / free
    assert low < np.mean(np.square(pulls)) < high
