"""Measured points to relief, coordinates, precision and flags: exactly the workbook's formulas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bifocal import rays
from bifocal.model.pair import SIGMA_PIXEL, UNCERTAIN_SHARE, Pair
from bifocal.survey.observations import PointObservations
from bifocal.survey.relief_table import ReliefTable
from bifocal.survey.setup import OFF_RADIAL_SIGMAS, ON_PLANE_SIGMAS, SurveySetup
from photocore.arrays import BoolArray, FloatArray


def solve_ideal(setup: SurveySetup, points: PointObservations) -> ReliefTable:
    """Solve an ideal pair from image coordinates or radial distances.

    Parameters
    ----------
    setup : SurveySetup
        Distances, principal distances, unit.
    points : PointObservations
        With ``xy1, xy2`` or ``polar``.

    Returns
    -------
    ReliefTable
        NaN where undefined: relief at the nadir and where the rays do not meet before the near
        camera; X, Y where no direction or no principal distance is known.

    Notes
    -----
    Midulla's Eqs. (5)-(7) in closed form, one workbook column after the other:
    ``r = (s2 - s1) / (s2/d2 - s1/d1)``, ``e = s r / d``, ``s' = s1 - e1``, ``X = s' sin(theta)
    m_1 / 1000``. Image 2 is first brought to the scale of image 1 by ``k_12``. First-order
    precision: ``sigma_r = sigma_s sqrt((1 - r/d1)^2 + (k_12 (1 - r/d2))^2) / |den|``.

    Examples
    --------
    A point 1 m before the wall and 2 m right of the nadir, 35 mm / 17.5 m and 19 mm / 9.5 m:

    >>> points = PointObservations(ids=("P1",), xy1=[[35 * 2 / 16.5, 0]], xy2=[[19 * 2 / 8.5, 0]])
    >>> table = solve_ideal(SurveySetup(d1=17.5, d2=9.5, c1=35, c2=19), points)
    >>> table.xyz.round(9).tolist(), table.flags
    ([[2.0, 0.0, 1.0]], ('OK',))
    """
    d1, d2, k12 = setup.d1, setup.d2, setup.scale_ratio
    xy1, xy2 = setup.image_mm(points.xy1, 1), setup.image_mm(points.xy2, 2)
    cartesian = points.is_cartesian
    s1 = np.where(cartesian, np.sqrt(xy1[:, 0] ** 2 + xy1[:, 1] ** 2), points.polar[:, 0])
    s2 = np.where(cartesian, np.sqrt(xy2[:, 0] ** 2 + xy2[:, 1] ** 2), points.polar[:, 1]) * k12
    incomplete = np.isnan(s1) | np.isnan(s2)
    s1, s2 = np.where(incomplete, np.nan, s1), np.where(incomplete, np.nan, s2)
    bearing = np.degrees(np.arctan2(xy1[:, 0], xy1[:, 1]))
    theta = np.where(cartesian, np.where(s1 == 0, 0.0, bearing), points.polar[:, 2])
    theta = np.where(incomplete, np.nan, theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        across = (xy1[:, 0] * xy2[:, 1] - xy1[:, 1] * xy2[:, 0]) * k12 / s1
        q = np.where(s1 > 0, across, np.where(cartesian & ~incomplete, 0.0, np.nan))
        spread = setup.precision * np.sqrt(1.0 + (s2 / s1) ** 2)
        standardised = q / np.where(s1 > 0, spread, np.nan)
    columns = _relief_columns(s1, s2, d1, d2)
    r = columns["r"]
    scale = np.nan if setup.scale_number is None else setup.scale_number
    angle = np.radians(theta)
    with np.errstate(divide="ignore", invalid="ignore"):
        e1 = s1 * r / d1
        s_c = s1 - e1
        sigma_r = (
            setup.precision
            * np.sqrt((1 - r / d1) ** 2 + (k12 * (1 - r / d2)) ** 2)
            / np.abs(columns["den"])
        )
    columns |= {
        "theta_used": theta,
        "q": q,
        "e1": e1,
        "e2": s2 * r / d2,
        "s_c": s_c,
        "X": s_c * np.sin(angle) * scale / 1000,
        "Y": s_c * np.cos(angle) * scale / 1000,
        "Z": r,
        "sigma_r": sigma_r,
    }
    return ReliefTable(
        ids=points.ids,
        columns=columns,
        flags=_flags(
            s1,
            standardised,
            incomplete,
            r,
            sigma_r,
            setup.relief_limit,
            (setup.off_radial_sigmas, setup.on_plane_sigmas),
        ),
        standardised=standardised,
        carried={},
        image_scale=setup.scale_number,
    )


def solve_pair(
    pair: Pair,
    points: PointObservations,
    *,
    sigma_px: float | None = None,
    sigma_r_max: float | None = None,
    principal_distance: float | None = None,
    flag_sigmas: tuple[float, float] = (OFF_RADIAL_SIGMAS, ON_PLANE_SIGMAS),
) -> ReliefTable:
    """Solve points measured in raw pixels of any pair, tilted or offset.

    Parameters
    ----------
    pair : Pair
        The pair.
    points : PointObservations
        With ``pixels1`` and ``pixels2``.
    sigma_px : float, optional
        Measuring precision; default the pair's own, else 0.5. [px]
    sigma_r_max : float, optional
        Points of less precise relief are UNCERTAIN; default 2 % of d2. [m]
    principal_distance : float, optional
        Of image 1, for columns in image millimetres; default the pair's own. Without one the scale
        is 1:1000, so that image millimetres read as metres on the wall. [mm]
    flag_sigmas : tuple of float
        Beyond how many sigma a point is OFF-RADIAL, below how many ON-PLANE.

    Returns
    -------
    ReliefTable
        Equal to `Pair.intersect`; ``e1``, ``e2`` and ``s_c`` are counted from each camera's own
        nadir, ``s1_used`` and ``s2_used`` from the zoom centre.

    Notes
    -----
    For any pair ``q2 - e = k(r) (q1 - e)`` about the zoom centre e, so Eq. (5) gives r exactly
    from radii about e. The picks are first moved onto one radial line by least squares; the
    movement is kept as gains (movement per millimetre of misfit q), which lets the workbook's
    formulas follow a changed pick.
    """
    far, near = pair.image1, pair.image2
    solved = pair.intersect(
        points.pixels1, points.pixels2, sigma_px=sigma_px, sigma_r_max=sigma_r_max
    )
    d1, d2, centre = far.distance, near.distance, pair.zoom_centre
    own = principal_distance or far.extra.get("principal_distance")
    scale_number = 1000.0 * d1 / float(own) if own else 1000.0
    to_mm = 1000.0 / scale_number
    sigmas = [sigma_px or photo.sigma_pixel or SIGMA_PIXEL for photo in (far, near)]
    positions, spreads = [], []
    for photo, pixels, sigma in (
        (far, points.pixels1, sigmas[0]),
        (near, points.pixels2, sigmas[1]),
    ):
        jacobian = photo.metres_per_pixel(pixels)
        positions.append(photo.plane_from_pixels(pixels))
        spreads.append(jacobian @ jacobian.transpose(0, 2, 1) * sigma**2)
    a1, a2, _ = rays.adjust_onto_epipolar_line(
        positions[0], positions[1], spreads[0], spreads[1], centre
    )
    x1, x2 = ((p - centre) * to_mm for p in positions)
    radius = np.hypot(x1[:, 0], x1[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        q = np.where(radius > 0, (x1[:, 0] * x2[:, 1] - x1[:, 1] * x2[:, 0]) / radius, 0.0)
        q = np.where(np.isnan(x1[:, 0]) | np.isnan(x2[:, 0]), np.nan, q)
        gain1, gain2 = (
            np.where((q != 0)[:, None], (x - (a - centre) * to_mm) / q[:, None], 0.0)
            for x, a in ((x1, a1), (x2, a2))
        )
        k_q = _misfit_spread(x1, x2, spreads, to_mm) / solved.sigma_px
    moved1, moved2 = x1 - q[:, None] * gain1, x2 - q[:, None] * gain2
    s1, s2 = np.sqrt((moved1**2).sum(axis=1)), np.sqrt((moved2**2).sum(axis=1))
    columns = _relief_columns(s1, s2, d1, d2)
    r = columns["r"]
    from1, from2 = (moved1 - (far.nadir - centre) * to_mm, moved2 - (near.nadir - centre) * to_mm)
    with np.errstate(divide="ignore", invalid="ignore"):
        radius1, radius2 = np.sqrt((from1**2).sum(axis=1)), np.sqrt((from2**2).sum(axis=1))
        e1, k_r = radius1 * r / d1, solved.sigma[:, 2] / solved.sigma_px
    k_r = np.where(np.isnan(r), np.nan, k_r)
    xy = centre + (moved1 - from1 * (r / d1)[:, None]) * scale_number / 1000
    theta = np.where(s1 == 0, 0.0, np.degrees(np.arctan2(moved1[:, 0], moved1[:, 1])))
    sigma_r = solved.sigma_px * k_r
    columns |= {
        "theta_used": np.where(np.isnan(s1), np.nan, theta),
        "q": q,
        "e1": e1,
        "e2": radius2 * r / d2,
        "s_c": radius1 - e1,
        "X": xy[:, 0],
        "Y": xy[:, 1],
        "Z": r,
        "sigma_r": sigma_r,
    }
    with np.errstate(divide="ignore", invalid="ignore"):
        standardised = q / (solved.sigma_px * k_q)
    limit = sigma_r_max or UNCERTAIN_SHARE * d2
    names = ("x1", "y1", "x2", "y2", "g1x", "g1y", "g2x", "g2y")
    values = np.hstack([x1, x2, gain1, gain2]).T
    return ReliefTable(
        ids=points.ids,
        columns=columns,
        flags=_flags(radius, standardised, np.isnan(q), r, sigma_r, limit, flag_sigmas),
        standardised=standardised,
        carried=dict(zip(names, values, strict=True))
        | {"k_q": k_q, "k_r": k_r, "misfit_px": solved.misfit},
        image_scale=scale_number if own else None,
    )


def _relief_columns(s1: FloatArray, s2: FloatArray, d1: float, d2: float) -> dict[str, FloatArray]:
    """Return s1, s2, ds, den and r; r is NaN unless the rays meet before the near camera."""
    ds, den = s2 - s1, s2 / d2 - s1 / d1
    with np.errstate(divide="ignore", invalid="ignore"):
        # den > 0 is the same as r < d2: r - d2 = -s1 (d1 - d2) / (d1 den).
        r = np.where((s1 > 0) & (den * (d1 - d2) > 0), ds / den, np.nan)
    return {"s1_used": s1, "s2_used": s2, "ds": ds, "den": den, "r": r}


def _misfit_spread(
    x1: FloatArray, x2: FloatArray, spreads: Sequence[FloatArray], to_mm: float
) -> FloatArray:
    """Return the standard deviation of q. [mm]"""
    g1 = np.stack([x2[:, 1], -x2[:, 0]], axis=-1)
    g2 = np.stack([-x1[:, 1], x1[:, 0]], axis=-1)
    variance = sum(
        np.einsum("ni,nij,nj->n", g, cov, g) for g, cov in ((g1, spreads[0]), (g2, spreads[1]))
    )
    radius = np.sqrt((x1**2).sum(axis=1))
    spread: FloatArray = np.sqrt(variance) * to_mm / radius
    return spread


def _flags(
    s1: FloatArray,
    standardised: FloatArray,
    incomplete: BoolArray,
    r: FloatArray,
    sigma_r: FloatArray,
    limit: float,
    sigmas: tuple[float, float],
) -> tuple[str, ...]:
    """Return the first flag that applies, in the order of the workbook's formula."""
    with np.errstate(invalid="ignore"):
        conditions = [
            s1 == 0,
            np.abs(standardised) > sigmas[0],
            incomplete,
            np.isnan(r) | (sigma_r > limit),
            sigma_r > limit / 2,
            np.abs(r) < sigmas[1] * sigma_r,
        ]
    names = ["NADIR", "OFF-RADIAL", "CHECK", "UNCERTAIN", "WEAK", "ON-PLANE"]
    return tuple(np.select(conditions, names, default="OK").tolist())
