"""Which detected target is which control point, from an approximate orientation."""

from __future__ import annotations

import numpy as np

from multimedia.media import Camera, Media, project
from multimedia.orientation import resect
from photocore.arrays import FloatArray, IntArray
from photocore.errors import ConvergenceError, GeometryError, InputError

#: Search radius with the given orientation; afterwards so many median misfits, but not less than
#: two pixels. [px]
FIRST_RADIUS, WIDEST_MISFIT, LEAST_RADIUS = 25.0, 4.0, 2.0
_ROUNDS = 4
#: Real matches are more than so many times as many as chance would bring.
_BEYOND_CHANCE = 2.0


def match_targets(
    camera: Camera,
    control: FloatArray,
    targets: FloatArray,
    interface: Media,
    *,
    radius: float = FIRST_RADIUS,
) -> IntArray:
    """Return the target of each control point, -1 where there is none, shape (n,).

    Parameters
    ----------
    camera : Camera
        Approximate orientation, with its sensor.
    control : ndarray, shape (n, 3)
        Control points.
    targets : ndarray, shape (m, 2)
        Detected targets. [px]
    interface : FlatInterface, Interfaces or None
        What the camera looks through.
    radius : float
        Largest distance from the place expected with the given orientation. [px]

    Notes
    -----
    Nearest neighbours in both directions, then a resection, then again within a radius that
    follows the misfits: a start that is some pixels off does not end in wrong partners.
    """
    sensor = camera.described_sensor("matching targets needs its sensor.")
    state = camera
    partner = _nearest(state, control, targets, interface, radius)
    for _ in range(_ROUNDS):
        paired = partner >= 0
        if paired.sum() < 4:
            return partner
        image = np.full((len(control), 2), np.nan)
        image[paired] = sensor.image_from_pixel(targets[partner[paired]])
        try:
            result = resect(state, control, image, interface)
        except (GeometryError, ConvergenceError, InputError):
            return partner
        miss = np.linalg.norm(result.residuals[paired] / sensor.pixel_size, axis=1)
        state = result.camera
        limit = min(radius, max(LEAST_RADIUS, WIDEST_MISFIT * float(np.median(miss))))
        again = _nearest(state, control, targets, interface, limit)
        if np.array_equal(again, partner):
            return partner
        partner = again
    return partner


def is_chance(
    camera: Camera,
    control: FloatArray,
    targets: FloatArray,
    partner: IntArray,
    interface: Media,
) -> bool:
    """Whether as many matches would be found among targets that have nothing to do with the body.

    Parameters
    ----------
    camera, control, targets, interface
        As for `match_targets`.
    partner : ndarray, shape (n,)
        What `match_targets` returned, at least one of it a match.

    Notes
    -----
    Targets a distance s apart lie within a radius q of any place with the probability
    pi q^2 / s^2. Points matched by chance miss their places by as much as the search allows, so q
    is then half of s and that probability near 1; true ones miss them by a pixel.
    """
    from scipy.spatial import cKDTree

    paired = partner >= 0
    if camera.sensor is None or paired.sum() < 4 or len(targets) < 2:
        return True
    image = camera.sensor.image_from_pixel(targets[partner[paired]])
    try:
        resected = resect(camera, control[paired], image, interface)
        visible = project(resected.camera, control, interface)
    except (GeometryError, ConvergenceError, InputError):
        return True
    miss = float(np.median(np.linalg.norm(resected.residuals / camera.sensor.pixel_size, axis=1)))
    radius = max(LEAST_RADIUS, WIDEST_MISFIT * miss)
    apart = float(np.median(cKDTree(targets).query(targets, k=2)[0][:, 1]))
    share = min(1.0, np.pi * radius**2 / apart**2) if apart > 0 else 1.0
    half = np.array([camera.sensor.width, camera.sensor.height]) * camera.sensor.pixel_size / 2
    inside = (np.abs(visible) <= half).all(axis=1)
    return bool(paired.sum() <= _BEYOND_CHANCE * share * inside.sum())


def _nearest(
    camera: Camera, control: FloatArray, targets: FloatArray, interface: Media, radius: float
) -> IntArray:
    """Return mutual nearest neighbours within a radius."""
    from scipy.spatial import cKDTree

    partner = np.full(len(control), -1, dtype=np.int64)
    image = project(camera, control, interface)
    rows = np.flatnonzero(np.isfinite(image).all(axis=1))
    if camera.sensor is None or not len(rows) or not len(targets):
        return partner
    expected = camera.sensor.pixel_from_image(image[rows])
    distance, nearest = cKDTree(targets).query(expected)
    _, back = cKDTree(expected).query(targets)
    mutual = (back[nearest] == np.arange(len(rows))) & (distance < radius)
    partner[rows[mutual]] = nearest[mutual]
    return partner
