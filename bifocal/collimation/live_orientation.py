"""The orientation while control points are picked: residuals, precision, what would help most."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bifocal.collimation.records import PickedControl, SurveyState
from bifocal.collimation.stated_media import lacking, media_of
from bifocal.collimation.wording import say, without_options
from bifocal.model import Interior, Pair, rates_of
from bifocal.orientation import (
    CONTROL,
    Control,
    KnownLens,
    OrientedPair,
    PhotoInput,
    SiteMeasures,
    at,
    interior_of_photo,
    orient_pair,
    standard_deviations,
    views_of,
)
from photocore.arrays import FloatArray
from photocore.errors import PhotogrammetryError
from photocore.images import ImageInfo

#: Points that stand out or lie back by this part of the near distance are thought of.
DEPTH = 0.05
#: A point that betters the distances by less than this share is not worth a walk.
WORTH = 0.05
#: A misfit beyond so many standard deviations is spoken of.
SUSPECT = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveOrientation:
    """What the control points alone tell of both cameras.

    Attributes
    ----------
    error : str
        Why they tell nothing yet; empty where they do.
    deviations : dict of str to float
        Standard deviations: ``distance1``, ``nadir1`` ... [m]
    distances : tuple of float
        Of the cameras to the wall. [m]
    residuals : dict of str to tuple of float
        Observed minus computed column 1, row 1, column 2, row 2. [px]
    advice : tuple of str
        What would help most next.
    """

    error: str = ""
    deviations: dict[str, float]
    distances: tuple[float, ...] = ()
    residuals: dict[str, tuple[float, ...]]
    advice: tuple[str, ...] = ()


def site_of(state: SurveyState) -> SiteMeasures:
    """Return the distances that were measured on site."""
    setup = state.setup
    sigmas = [setup.get(f"sigma_{name}") for name in ("d", "d1", "d2", "delta_d")]
    typed = [sigma for sigma in sigmas if sigma]
    spot = state.wall.get("spot")
    site = SiteMeasures(
        distance1=setup.get("d1"), distance2=setup.get("d2"), delta_d=setup.get("delta_d"),
        ordered=state.ordered, wall=None if spot is None else spot.pixel,
    )  # fmt: skip
    if all((site.distance1, site.distance2, site.delta_d)):
        site = replace(site, delta_d=None)
    return replace(site, sigma=max(typed)) if typed else site


def lenses_of(state: SurveyState) -> tuple[KnownLens, KnownLens]:
    """Return what was typed of both lenses."""
    first, second = (state.lenses.get(image, {}) for image in (1, 2))
    return (
        KnownLens(focal=first.get("focal_mm"), sensor_width=first.get("sensor_width_mm")),
        KnownLens(focal=second.get("focal_mm"), sensor_width=second.get("sensor_width_mm")),
    )


def control_of(state: SurveyState) -> Control:
    """Return the control points and tapes as `bifocal align` takes them."""
    points = [p for p in state.sorted_control() if p.use and p.picks != (None, None)]
    site, nowhere = SiteMeasures(), (np.nan, np.nan)
    xyz = np.array([_known(point) for point in points]).reshape(-1, 3)
    sigma = np.full((len(points), 3), site.sigma_control)
    on_wall = np.isfinite(xyz[:, :2]).all(axis=1) & np.isnan(xyz[:, 2])
    xyz[on_wall, 2], sigma[on_wall, 2] = 0.0, CONTROL.sigma_on_wall
    index = {point.name: number for number, point in enumerate(points)}
    tapes = [tape for tape in state.tapes.values() if tape.start in index and tape.end in index]
    return Control(
        ids=tuple(index),
        xyz=xyz,
        sigma=sigma,
        pixels1=np.array([p.picks[0] or nowhere for p in points], dtype=float).reshape(-1, 2),
        pixels2=np.array([p.picks[1] or nowhere for p in points], dtype=float).reshape(-1, 2),
        lengths=tuple((index[tape.start], index[tape.end], tape.length) for tape in tapes),
        sigma_lengths=tuple(tape.sigma or np.nan for tape in tapes),
    )


def _known(point: PickedControl) -> list[float]:
    return [np.nan if value is None else value for value in point.known]


def live_orientation(
    state: SurveyState, infos: list[ImageInfo], language: str, pair: Pair | None = None
) -> LiveOrientation:
    """Return what the control points tell, without a look at the photos' content.

    Parameters
    ----------
    state : SurveyState
    infos : list of ImageInfo
        Of both photos.
    language : str
    pair : Pair, optional
        The pair that is shown; what it looks through counts where nothing else was typed.
    """
    control = control_of(state)
    complete = [
        point for point in state.control.values()
        if point.use and None not in point.picks and None not in point.known[:2]
    ]  # fmt: skip
    hints = _to_complete(state, len(complete), language)
    if len(complete) < 4:
        return LiveOrientation(deviations={}, residuals={}, advice=tuple(hints))
    try:
        interiors = [
            interior_of_photo(info, lens, number)
            for number, (info, lens) in enumerate(
                zip(infos, lenses_of(state), strict=True), start=1
            )
        ]
        oriented = orient_pair(
            (_unseen(interiors[0], infos[0]), _unseen(interiors[1], infos[1])),
            control=control,
            site=site_of(state),
            media=media_of(state.setup, pair),
        )
    except PhotogrammetryError as error:
        message = without_options(str(error), language)
        return LiveOrientation(error=message, deviations={}, residuals={}, advice=(*hints, message))
    adjusted = oriented.adjusted
    residuals = adjusted.control_residuals
    if oriented.exchanged:
        residuals = residuals[:, [2, 3, 0, 1]]
    return LiveOrientation(
        deviations=standard_deviations(adjusted),
        distances=tuple(float(camera.centre[2]) for camera in adjusted.cameras),
        residuals={
            name: tuple(row) for name, row in zip(control.ids, residuals.tolist(), strict=True)
        },
        advice=(*_suspects(oriented, language), *hints, *_most_help(oriented, language)),
    )


def _unseen(interior: Interior, info: ImageInfo) -> PhotoInput:
    return PhotoInput(grey=None, interior=interior, name=info.path.name)


def _to_complete(state: SurveyState, complete: int, language: str) -> list[str]:
    """Return what is missing of the control points, the nearest step first."""
    missing = lacking(state.setup)
    hints = [say("media", missing, language)] if missing else []
    if not state.control:
        return [*hints, say("advice", "none", language)]
    for point in state.sorted_control():
        if None in point.picks and point.picks != (None, None):
            hints.append(say("advice", "other", language, name=point.name))
        if None in point.known[:2] and None not in point.picks and not state.tapes:
            hints.append(say("advice", "place", language, name=point.name))
    if complete < 4:
        hints.append(say("advice", "more", language, count=4 - complete))
    return hints[:3]


def _suspects(oriented: OrientedPair, language: str) -> list[str]:
    """Name the control point that fits worst, where it fits badly."""
    test = np.nan_to_num(oriented.adjusted.control_test)
    if not len(test) or test.max() < SUSPECT:
        return []
    row = int(test.argmax())
    name = oriented.observations.control.ids[row]
    return [say("advice", "worst", language, name=name, test=float(test[row]))]


def _most_help(oriented: OrientedPair, language: str) -> list[str]:
    """Say which further control point would better the distances most."""
    cameras, covariance = oriented.adjusted.cameras, oriented.adjusted.covariance
    width, height = oriented.observations.interiors[0].image_size
    watched = [at("Z", number) for number in (1, 2)]
    before = float(np.sqrt(np.mean(np.diag(covariance)[watched])))
    depth = DEPTH * float(cameras[1].centre[2])
    offers: list[tuple[float, str, str, float]] = []
    for kind, relief in (("wall", 0.0), ("out", depth), ("back", -depth)):
        for across in range(3):
            for down in range(3):
                pixel = np.array([[width * (0.1 + 0.4 * across), height * (0.1 + 0.4 * down)]])
                place = oriented.adjusted.media.on_plane(0, cameras[0], pixel)
                place[:, 2] = relief
                design, noise = _control_rows(oriented, place)
                after = _sigma_with(covariance, design, noise, watched)
                offers.append((after, kind, f"{across}{down}", abs(relief)))
    measured = oriented.observations.measured
    for number in (1, 2):
        if f"distance{number}" not in measured:
            design = np.zeros((1, len(covariance)))
            design[0, at("Z", number)] = 1.0
            noise = np.array([[SiteMeasures().sigma ** 2]])
            after = _sigma_with(covariance, design, noise, watched)
            offers.append((after, "tape", str(number), 0.0))
    after, kind, where, relief = min(offers, key=lambda offer: np.nan_to_num(offer[0], nan=np.inf))
    if not after < (1.0 - WORTH) * before:
        return [say("advice", "enough", language)]
    if kind == "tape":
        return [say("advice", "tape", language, photo=say("photo", where, language))]
    return [
        say(
            "advice", "next", language, depth=say("depth", kind, language, r=relief),
            where=say("where", where, language), before=1000 * before, after=1000 * after,
        )
    ]  # fmt: skip


def _control_rows(oriented: OrientedPair, place: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rates of a control point's four pixels by all `names_of`, and their covariance."""
    rows, by_points = [], []
    for number, point_view in enumerate(views_of(oriented.adjusted, place)):
        rows.append(rates_of(point_view, np.zeros((1, 2, 2)), number)[0])
        by_points.append(point_view.by_point[0])
    by_point = np.concatenate(by_points)
    noise = np.eye(4) * oriented.observations.sigma_pick**2
    noise += by_point @ by_point.T * SiteMeasures().sigma_control ** 2
    return np.concatenate(rows), noise


def _sigma_with(
    covariance: FloatArray, design: FloatArray, noise: FloatArray, watched: list[int]
) -> float:
    """Return the mean standard deviation of the distances with more observations; or NaN. [m]"""
    gain = covariance @ design.T
    if not np.isfinite(gain).all():
        return float("nan")
    smaller = covariance - gain @ np.linalg.solve(design @ gain + noise, gain.T)
    return float(np.sqrt(np.mean(np.diag(smaller)[watched])))
