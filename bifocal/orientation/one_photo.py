"""One photo alone: its camera before a plane, from control points, a rectangle or its lines."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from bifocal.files import is_odd
from bifocal.model import Interior, Photo, PhotoAlone
from bifocal.orientation.adjustment.pair_adjustment import ROUNDING, as_one
from bifocal.orientation.control_points import Control, SiteMeasures
from bifocal.orientation.facade_lines import facing_wall
from bifocal.orientation.slips import TrialOrientation, TypedOrientation, slip_of
from bifocal.orientation.starts.space_resection import refuse_line, resect
from bifocal.orientation.tuning import SLIPS
from bifocal.remarks import remark
from photocore.adjustment import OUTLIER_LIMIT
from photocore.adjustment.network import Network, NetworkState, Rows
from photocore.arrays import BoolArray, ByteArray, FloatArray, positive
from photocore.camera import PARAMETERS, Pinhole, pinhole, ray_on_plane
from photocore.errors import ConvergenceError, GeometryError, InputError
from photocore.remarks import keys_in

#: Steps for derivatives: of logarithms, pixels, radians, shares of the distance.
_STEPS = np.array([1e-6, 1e-6, 1e-3, 1e-3, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6])
#: A photo cut out of a larger one has its principal point within this share of its diagonal.
_CUT_OUT = 0.15
#: A displacement known worse than this, relative, is given as a range.
_ROUGH = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OrientedPhoto:
    """A photo before the plane of its wall.

    Attributes
    ----------
    interior : Interior
        What was known of the lens.
    camera : Pinhole
    covariance : ndarray, shape (10, 10)
        Of the camera's `PARAMETERS`.
    sigma0 : float
        How large the misfits are against what they may be; at least 1.
    ids : tuple of str
        Of the control points used.
    left_out, sigma_left_out : ndarray, shape (n, 2)
        By how much each misses X, Y where all others put it, and the standard deviation of that;
        NaN where nothing is left over to tell. [m]
    test : ndarray, shape (n,)
        The one over the other, as one value.
    remarks : tuple of str
        With the points left out as gross.
    """

    interior: Interior
    camera: Pinhole
    covariance: FloatArray
    sigma0: float
    ids: tuple[str, ...] = ()
    left_out: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    sigma_left_out: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    test: FloatArray = field(default_factory=lambda: np.zeros(0))
    remarks: tuple[str, ...] = ()

    def as_pair(self, file: str = "") -> PhotoAlone:
        """Return it where orthophotos take a pair."""
        photo = Photo(
            plane_from_pixel=pinhole.plane_from_pixel(self.camera), nadir=self.camera.centre[:2],
            distance=float(self.camera.centre[2]), lens=self.interior.lens, file=file,
            image_size=self.interior.image_size,
        )  # fmt: skip
        return PhotoAlone(image1=photo, image2=photo)

    def sigma_at(self, positions: FloatArray) -> FloatArray:
        """Return the standard deviation of places on the plane, the worse coordinate, (n,). [m]"""
        flat = np.column_stack([positions, np.zeros(len(positions))])
        pixels = pinhole.project(self.camera, flat)
        by = _by_camera(lambda camera: ray_on_plane(camera, pixels)[:, :2].ravel(), self.camera)
        variance = np.einsum("nk,kl,nl->n", by, self.covariance, by)
        return np.asarray(np.sqrt(variance.reshape(-1, 2).max(axis=1)))

    def displacement(self, relief: float, positions: FloatArray) -> tuple[float, float]:
        """Return by how much relief moves what is seen at worst, and the sigma of that. [m]

        Parameters
        ----------
        relief : float
            What stands out, or lies back where it is negative. [m]
        positions : ndarray, shape (n, 2)
            Places of the orthophoto. [m]

        Notes
        -----
        ``e = r R / (d - r)`` at the distance R from the nadir, Midulla Eq. (1) on the plane.
        """
        distance = float(self.camera.centre[2])
        if not (relief < distance and relief):
            raise InputError(remark("rectify.stands_out", relief=relief, distance=distance))

        def moved(camera: Pinhole) -> FloatArray:
            away = np.linalg.norm(positions - camera.centre[:2], axis=1)
            return np.asarray(abs(relief) * away / (camera.centre[2] - relief))

        worst = int(moved(self.camera).argmax())
        by = _by_camera(moved, self.camera)[worst]
        return float(moved(self.camera)[worst]), float(np.sqrt(by @ self.covariance @ by))

    def bound_in_words(self, relief: float, positions: FloatArray) -> str:
        """Return what relief does to the orthophoto at worst; a range where the lens is unknown."""
        value, sigma = self.displacement(relief, positions)
        about = {"relief": 100 * relief, "most": 1000 * (value + 2 * sigma)}
        if sigma > _ROUGH * value:
            return remark("rectify.rough_bound", least=1000 * max(value - 2 * sigma, 0), **about)
        return remark("rectify.bound", **about)


def by_rectangle(
    sides: tuple[float, float], corners: FloatArray, interior: Interior, *, sigma_pick: float,
    sigma: float,
) -> OrientedPhoto:  # fmt: skip
    """Return a photo oriented by a rectangle: width and height, corners from the upper left one on.

    Raises
    ------
    InputError, GeometryError
        If there are not four corners, or they do not fit; a slip is named.
    """
    if len(corners) != 4:
        raise InputError(f"--rectangle: {len(corners)} corners; a rectangle has four.")

    begun, start = _begun_at(corners), ""

    def cornered(width: float, height: float) -> Control:
        xyz = np.array([[0, height, 0], [width, height, 0], [width, 0, 0], [0.0, 0, 0]])
        return Control(
            ids=("upper left", "upper right", "lower right", "lower left"), xyz=xyz,
            sigma=np.full((4, 3), sigma), pixels1=corners, pixels2=np.full((4, 2), np.nan),
        )  # fmt: skip

    def fitted(width: float, height: float) -> OrientedPhoto:
        return by_control(cornered(width, height), interior, sigma_pick=sigma_pick)

    def misfit(width: float, height: float) -> float:
        try:
            return fitted(width, height).sigma0
        except (GeometryError, ConvergenceError):
            return SLIPS.most

    width, height = (positive(side, "--rectangle", unit="m") for side in sides)
    if misfit(height, width) < min(SLIPS.fits, misfit(width, height) / SLIPS.better):
        if begun % 2:  # clockwise from another corner, the sides are then as typed
            corners, start = np.roll(corners, begun, axis=0), remark("rectify.begun_aside")
        else:
            raise GeometryError(remark("rectify.sides", width=width, height=height))

    def proportions() -> str:
        def misfits(factors: FloatArray) -> FloatArray:
            out = np.full(len(factors), SLIPS.most)
            for k, times in enumerate(factors):
                control = replace(cornered(width * times, height), pixels1=interior.ideal(corners))
                with suppress(GeometryError, ConvergenceError):
                    out[k] = _by_points(control, interior, sigma_pick).sigma0
            return out

        near = np.exp(np.linspace(-0.5, 0.5, 41))
        close = near[misfits(near).argmin()] * np.exp(np.linspace(-0.025, 0.025, 21))
        rest = misfits(close)
        focal = ""
        with suppress(GeometryError, ConvergenceError):
            control = replace(cornered(width, height), pixels1=interior.ideal(corners))
            free = _by_points(control, replace(interior, sigma_focal=0.5), sigma_pick)
            if free.sigma0 < SLIPS.doubted:
                times = float(free.camera.matrix[0, 0]) / interior.focal
                focal = remark("rectify.other_focal", times=times)
        texts = [focal, _by_one_corner(cornered(width, height), interior, sigma_pick)]
        if rest.min() <= SLIPS.doubted:
            best = float(close[rest == rest.min()].mean())
            about = {"width": width * best, "height": height / best, "at": height, "by": width}
            texts.insert(0, remark("rectify.proportions", **about))
        return " ".join(text for text in texts if text)

    try:
        photo = fitted(width, height)
    except GeometryError as error:
        words = proportions()
        if not words and "resection.no_camera" in keys_in(str(error)):
            words = remark("rectify.no_rectangle", width=width, height=height)
        if words:
            raise GeometryError(words) from None
        raise
    words = proportions() if photo.sigma0 > SLIPS.doubted else ""
    if begun == 2:
        start = remark("rectify.begun_below")
    remarks = [text for text in (start, words) if text]
    return replace(photo, remarks=(*remarks, *photo.remarks)) if remarks else photo


def _by_one_corner(control: Control, interior: Interior, sigma_pick: float) -> str:
    """Return by how many pixels each corner would be off, were it the one that is wrong."""
    control, moves = replace(control, pixels1=interior.ideal(control.pixels1)), list[str]()
    for k in range(len(control.ids)):
        sigma = control.sigma.copy()
        sigma[k] = np.ptp(control.xyz, axis=0).max()  # it may lie anywhere on the wall
        with suppress(GeometryError, ConvergenceError):
            photo = _by_points(replace(control, sigma=sigma), interior, sigma_pick)
            if photo.sigma0 < SLIPS.doubted:
                off = pinhole.project(photo.camera, control.xyz[[k]]) - control.pixels1[[k]]
                moves.append(f"{k + 1}: {float(np.linalg.norm(off)):.0f} px")
    return remark("rectify.one_corner", moves=", ".join(moves)) if moves else ""


def _begun_at(corners: FloatArray) -> int:
    """Return by how many corners a rectangle was begun after its upper left one, as seen."""
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    flat = (corners - corners.mean(axis=0)) / np.ptp(corners, axis=0).clip(1e-9)
    return int(np.argmax([(np.roll(flat, k, axis=0) * square).sum() for k in range(4)]))


def by_control(control: Control, interior: Interior, *, sigma_pick: float) -> OrientedPhoto:
    """Return a photo oriented by control points, picked in it as it is.

    Raises
    ------
    GeometryError
        If there are fewer than four, they lie on one line, or do not fit; a slip is named.
    """
    whole = np.isfinite(np.column_stack([control.xyz, control.pixels1])).all(axis=1)
    # Several points at one pixel, often 0, 0 or -1, -1, are what programs write for "not seen".
    places, count = np.unique(control.pixels1[whole], axis=0, return_counts=True)
    unseen = (control.pixels1[:, None] == places[count > 1]).all(axis=2).any(axis=1)
    unseen &= (whole & ~unseen).sum() > 2  # points all of one pixel lie on a line, which is refused
    names = ", ".join(np.array(control.ids)[unseen][:10])
    before = (remark("rectify.one_pixel", names=names),) if names else ()
    control = _of_points(control, whole & ~unseen)
    control = replace(control, pixels1=interior.ideal(control.pixels1))

    def fitted(typed: TypedOrientation) -> TrialOrientation | None:
        if not np.isfinite(typed.control.pixels1).all():
            return None  # the picks of a second photo
        try:
            photo = _by_points(typed.control, interior, sigma_pick)
        except (GeometryError, ConvergenceError):
            return None
        lost = np.nan_to_num(photo.test, nan=OUTLIER_LIMIT) >= OUTLIER_LIMIT
        return TrialOrientation(misfit=photo.sigma0, cameras=(photo.camera,) * 2, lost=lost)

    calibrated = replace(interior, is_calibrated=True)  # the points' own slips alone are looked for
    typed = TypedOrientation(
        interiors=(calibrated, calibrated), control=control, site=SiteMeasures()
    )
    slip = slip_of(typed, fitted, by_control=True)
    if slip is not None and not slip.mended:
        raise GeometryError(slip.words)
    notes = before if slip is None else (*before, slip.words)
    control = control if slip is None else slip.meant.control
    first = _by_points(control, interior, sigma_pick)
    photo, gross = _without_gross(control, interior, sigma_pick, first)
    if first.sigma0 > SLIPS.doubted and not interior.is_calibrated:
        wide = _CUT_OUT * float(np.hypot(*interior.image_size))
        loose = replace(interior, sigma_centre=wide)
        cut = _by_points(control, loose, sigma_pick)
        # The fewest slips: a crop beside one wrong point, whichever leaves less. Four points fit
        # any crop.
        fewer = len(gross) != 1 or cut.sigma0 < photo.sigma0
        if cut.sigma0 < first.sigma0 / SLIPS.better and fewer:
            if len(control.ids) > 4 and is_odd(interior.image_size):
                photo, gross = _without_gross(control, loose, sigma_pick, cut)
                gross = [remark("rectify.cut_out"), *gross]
            else:
                gross = [remark("rectify.cut_out_perhaps"), *gross]
    if photo.sigma0 > SLIPS.doubted:
        gross = [remark("rectify.misfit", times=photo.sigma0), *gross]
    return replace(photo, remarks=(*notes, *gross))


def _of_points(control: Control, which: BoolArray) -> Control:
    """Return some of the points alone."""
    return Control(
        ids=tuple(np.array(control.ids)[which].tolist()), xyz=control.xyz[which],
        sigma=control.sigma[which], pixels1=control.pixels1[which], pixels2=control.pixels2[which],
    )  # fmt: skip


def _without_gross(
    control: Control, interior: Interior, sigma_pick: float, photo: OrientedPhoto
) -> tuple[OrientedPhoto, list[str]]:
    """Return the photo without gross points, the worst first, and remarks that name them.

    Where the others fit no better, the points are not to blame (a lens that bends, relief): all
    stay.
    """
    named: list[str] = []
    whole, most = photo, max(len(control.ids) // 4, 1)
    while len(photo.ids) > 5 and len(named) < most:
        test = np.nan_to_num(photo.test)
        worst = int(test.argmax())
        if test[worst] < OUTLIER_LIMIT:
            break
        keep = np.arange(len(control.ids)) != worst
        control = _of_points(control, keep)
        error = 1000 * float(np.hypot(*photo.left_out[worst]))
        about = {"name": photo.ids[worst], "error": error, "times": float(test[worst])}
        photo = _by_points(control, interior, sigma_pick)
        named.append(remark("rectify.gross", **about))
    fits = np.nan_to_num(photo.test).max() < OUTLIER_LIMIT
    if fits or photo.sigma0 < whole.sigma0 / SLIPS.better:
        return photo, named
    return whole, []


def _by_points(control: Control, interior: Interior, sigma_pick: float) -> OrientedPhoto:
    """Return a photo oriented by points as they are, each held against all others.

    Notes
    -----
    With a point's misfit w, its Jacobian A, both in standard deviations, and the cofactor Q of the
    camera, ``(I - A Q Aᵀ)⁻¹ w`` is its misfit had it been left out, and the inverse its covariance.
    """
    refuse_line(control.pixels1)
    start, _ = resect(control.xyz, control.pixels1, interior)
    spread = pinhole.project_with_jacobian(start, control.xyz).by_point * control.sigma[:, None, :]
    root = np.linalg.cholesky(spread @ np.swapaxes(spread, 1, 2) + sigma_pick**2 * np.eye(2))

    def misfit(camera: Pinhole) -> FloatArray:
        pixels = pinhole.project(camera, control.xyz) - control.pixels1
        return np.asarray(np.linalg.solve(root, pixels[..., None])).ravel()

    def by_camera(camera: Pinhole) -> FloatArray:
        by = pinhole.project_with_jacobian(camera, control.xyz).by_camera
        return np.asarray(np.linalg.solve(root, by).reshape(-1, len(PARAMETERS)))

    photo = _adjusted(interior, start, misfit, by_camera)
    count, cofactor = len(control.ids), photo.covariance / photo.sigma0**2
    by = by_camera(photo.camera).reshape(count, 2, -1)
    spare = np.eye(2) - by @ cofactor @ np.swapaxes(by, 1, 2)
    determined = np.linalg.eigvalsh(spare)[:, 0] > 0.02  # else the point alone determines something
    loose = np.linalg.inv(np.where(determined[:, None, None], spare, np.nan))
    errors = (loose @ misfit(photo.camera).reshape(count, 2, 1))[..., 0]
    metres = pinhole.project_with_jacobian(photo.camera, control.xyz).by_point[:, :, :2]
    metres = np.linalg.solve(metres, root)
    square = np.einsum("ni,nij,nj->n", errors, spare, errors)
    return replace(
        photo, ids=control.ids, left_out=-(metres @ errors[..., None])[..., 0],
        sigma_left_out=np.sqrt(
            np.diagonal(metres @ loose @ np.swapaxes(metres, 1, 2), axis1=1, axis2=2)
        ),
        test=np.array([as_one(value, 2) if np.isfinite(value) else np.nan for value in square]),
    )  # fmt: skip


def by_lines(
    image: ByteArray, interior: Interior, ends: FloatArray, length: float, *,
    sigma_pick: float, sigma: float,
) -> OrientedPhoto:  # fmt: skip
    """Return a photo oriented by its upright and level lines and one length on the wall.

    Parameters
    ----------
    image : ndarray, shape (h, w)
    interior : Interior
    ends : ndarray, shape (2, 2)
        Picks of the length's ends, as the photo shows them; the first becomes X = Y = 0. [px]
    length : float
        [m]
    sigma_pick, sigma : float
        Standard deviations of picks [px] and length [m].

    Raises
    ------
    GeometryError
        If the photo shows too few lines.
    """
    length = positive(length, "--length", unit="m")
    turn, lines = facing_wall(image, interior)
    picks, camera = interior.ideal(ends), Pinhole(interior.matrix, turn, np.array([0.0, 0.0, 1.0]))
    first, second = ray_on_plane(camera, picks)
    apart = float(np.linalg.norm(second - first))
    if not apart > 0:
        raise GeometryError(remark("rectify.no_length"))
    distance = length / apart
    start = camera._replace(centre=distance * (camera.centre - first))
    sigma = float(np.hypot(sigma, 1.41 * sigma_pick * distance / interior.focal))

    def misfit(camera: Pinhole) -> FloatArray:
        origin, end = ray_on_plane(camera, picks)[:, :2]
        out = [origin / 1e-6, [(np.linalg.norm(end - origin) - length) / sigma]]
        for line in lines:
            ray = np.linalg.solve(camera.matrix, interior.matrix @ line.direction)
            along, axis = camera.rotation.T @ ray, int(line.name == "upright")
            out.append(along[[1 - axis, 2]] / along[axis] / line.sigma)
        return np.concatenate(out)

    return _adjusted(interior, start, misfit, lambda camera: _by_camera(misfit, camera))


def _adjusted(
    interior: Interior, start: Pinhole, misfit: Callable[[Pinhole], FloatArray],
    by_camera: Callable[[Pinhole], FloatArray],
) -> OrientedPhoto:  # fmt: skip
    """Return the camera of least squares: misfits in standard deviations, and the lens as known."""
    prior = np.array([np.log(interior.focal), np.log(interior.aspect), *interior.centre])
    sigma = np.array([interior.sigma_focal, interior.sigma_aspect, *[interior.sigma_centre] * 2])
    columns, by_lens = np.arange(len(PARAMETERS)), np.eye(4, len(PARAMETERS)) / sigma[:, None]

    def values(camera: Pinhole) -> FloatArray:
        focals = np.log(np.diag(camera.matrix)[:2])
        lens = np.array([focals[0], focals[1] - focals[0], *camera.matrix[:2, 2]])
        return np.concatenate([(lens - prior) / sigma, misfit(camera)])

    def everything(state: NetworkState, rows: Rows) -> bool:
        camera = state.blocks["camera"][0]
        by = np.concatenate([by_lens, by_camera(camera)])
        rows.by_label(rows.add(values(camera))[:, None], columns, by)
        return bool(np.isfinite(rows.residuals[-1]).all())

    network = Network(
        labels=PARAMETERS, columns={"camera": {0: dict(zip(columns, columns, strict=True))}},
        terms=[everything], step=lambda camera, _, step: camera.stepped(step),
        what="the photo", rounding=ROUNDING,
    )  # fmt: skip
    fit = network.solve(NetworkState(blocks={"camera": {0: start}}))
    camera: Pinhole = fit.state.blocks["camera"][0]
    if not camera.centre[2] > 0:
        raise GeometryError(remark("rectify.behind"))
    sigma0 = float(np.nanmax([fit.sigma0, 1.0]))
    covariance = fit.linear.cofactor * sigma0**2
    return OrientedPhoto(interior=interior, camera=camera, covariance=covariance, sigma0=sigma0)


def _by_camera(function: Callable[[Pinhole], FloatArray], camera: Pinhole) -> FloatArray:
    """Return the derivatives of values by a camera's `PARAMETERS`, shape (n, 10)."""
    steps = _STEPS * np.where(np.arange(10) < 7, 1.0, camera.centre[2])
    ahead, behind = (
        np.array([function(camera.stepped(sign * step)) for step in np.diag(steps)])
        for sign in (1.0, -1.0)
    )
    return np.asarray((ahead - behind).T / (2.0 * steps))
