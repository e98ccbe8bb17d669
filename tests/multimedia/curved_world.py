"""Images through domes, tubes and graded water from conserved quantities: no ray is traced.

Concentric spheres conserve n times the distance of the ray from the centre (Bouguer), coaxial
cylinders that of its part across the axis and the part along it, level layers n sin(beta). One
unknown (two for cylinders) is halved into an interval; scipy turns into the camera frame. Nothing
of the package is used.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

HALVINGS = 60


def image_of(directions: np.ndarray, angles: np.ndarray, c: float) -> np.ndarray:
    """Return image coordinates of world directions for omega, phi, kappa."""
    turned = Rotation.from_euler("XYZ", angles).inv().apply(directions)
    return -c * turned[:, :2] / turned[:, 2:]


def through_dome(centre, points, dome, radii, indices):
    """Return the directions from a camera inside concentric spheres to points outside."""
    arm = np.asarray(centre, dtype=float) - dome
    a = np.linalg.norm(arm)
    if a == 0:
        return points - centre
    up = arm / a
    far = points - dome
    b = np.linalg.norm(far, axis=1)
    aside = far - (far @ up)[:, None] * up
    whole = np.arctan2(np.linalg.norm(aside, axis=1), far @ up)
    aside /= np.linalg.norm(aside, axis=1)[:, None]

    def angle(alpha):
        distance = a * np.sin(alpha)
        total = alpha - np.arcsin(distance / radii[0])
        for k, (before, after) in enumerate(pairwise(indices)):
            distance = distance * before / after
            outer = radii[k + 1] if k + 1 < len(radii) else b
            total = total + np.arcsin(distance / radii[k]) - np.arcsin(distance / outer)
        return total

    low, high = np.zeros(len(points)), np.full(len(points), np.pi)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        small = angle(middle) < whole
        low, high = np.where(small, middle, low), np.where(small, high, middle)
    return np.cos(low)[:, None] * up + np.sin(low)[:, None] * aside


def through_tube(centre, points, axis_point, axis, radii, indices):
    """Return the directions from a camera outside coaxial cylinders to points inside.

    ``radii`` from the camera on: the outer one first. The points must be nearer to the axis than
    ``min(radii)`` over the index of the water, else some hide behind the wall.
    """
    axis = np.asarray(axis) / np.linalg.norm(axis)
    arm, far = centre - axis_point, points - axis_point
    along = (far - arm) @ axis
    arm, far = arm - (arm @ axis) * axis, far - (far @ axis)[:, None] * axis
    a, b = np.linalg.norm(arm), np.linalg.norm(far, axis=1)
    down = -arm / a
    side = np.cross(axis, down)
    whole = np.arctan2(far @ side, -(far @ down))  # polar angle from the camera's bearing
    sign = np.where(whole < 0, -1.0, 1.0)
    whole = np.abs(whole)

    def path(share, axial):
        """Return polar angle and axial travel for n d = share of the largest, n d_axis = axial.

        A share beyond 1: the point lies behind the nearest approach to the axis, n d = 2 - share.
        """
        m = np.sqrt(np.array(indices)[:, None] ** 2 - axial**2)
        beyond = share > 1
        momentum = np.where(beyond, 2 - share, share) * b * m[-1]
        total, travel, outer = np.zeros(len(points)), np.zeros(len(points)), a
        for k, radius in enumerate((*radii, b)):
            d = momentum / m[k]
            down_to = np.sqrt(np.maximum(radius**2 - d**2, 0))
            last = np.where(beyond & (k == len(radii)), -1.0, 1.0)
            total = total + np.arccos(d / outer) - last * np.arccos(np.minimum(d / radius, 1))
            travel = travel + (np.sqrt(outer**2 - d**2) - last * down_to) * axial / m[k]
            outer = radius
        return total, travel

    def impact(axial):
        low, high = np.zeros(len(points)), np.full(len(points), 2.0)
        for _ in range(HALVINGS):
            middle = (low + high) / 2
            small = path(middle, axial)[0] < whole
            low, high = np.where(small, middle, low), np.where(small, high, middle)
        return low

    low, high = np.full(len(points), -0.95), np.full(len(points), 0.95)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        small = path(impact(middle), middle)[1] < along
        low, high = np.where(small, middle, low), np.where(small, high, middle)
    share = impact(low)
    momentum = np.minimum(share, 2 - share) * b * np.sqrt(indices[-1] ** 2 - low**2)
    across = np.sqrt(indices[0] ** 2 - low**2)
    sine = momentum / across / a
    flat = np.sqrt(1 - sine**2)[:, None] * down + (sign * sine)[:, None] * side
    return across[:, None] * flat + low[:, None] * axis


NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


def through_graded_water(centre, points, index, gradient, glass=0.0, glass_index=1.5):
    """Return the directions to points under the plane Z = 0, the index growing with depth.

    The integral over the depth is Gauss's, with no closed form of the path.
    """
    offset = points[:, :2] - centre[:2]
    radius, depth = np.hypot(*offset.T), -points[:, 2]
    places = depth[:, None] * (NODES + 1) / 2

    def reach(p):
        n = index + gradient * places
        wet = (p[:, None] / np.sqrt(n**2 - p[:, None] ** 2)) @ WEIGHTS * depth / 2
        pane = glass * p / np.sqrt(glass_index**2 - p**2)
        return (centre[2] - glass) * p / np.sqrt(1 - p**2) + pane + wet

    low, high = np.zeros(len(points)), np.ones(len(points))
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        small = reach(middle) < radius
        low, high = np.where(small, middle, low), np.where(small, high, middle)
    bearing = offset / np.where(radius > 0, radius, 1)[:, None]
    return np.column_stack([bearing * low[:, None], -np.sqrt(1 - low**2)])
