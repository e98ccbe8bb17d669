"""What a bundle adjustment estimates, and what it returns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from multimedia.media import ANY_INTERIOR, EXTERIOR
from multimedia.projects import Project
from multimedia.remarks import remark
from photocore.adjustment import OUTLIER_LIMIT, correlations, standardised
from photocore.arrays import FloatArray, positive
from photocore.camera import TERMS, Fisheye
from photocore.errors import InputError

#: How control points enter: error-free, with their sigmas, or as a free network.
CONTROL = ("fixed", "weighted", "free")
#: Interior parameters chosen by what the data determine and need.
AUTO = ("auto",)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleBar:
    """A known distance between two object points.

    Attributes
    ----------
    first, second : str
        Ids of the points.
    length, sigma : float
        [object unit]
    """

    first: str
    second: str
    length: float
    sigma: float

    def __post_init__(self) -> None:
        positive(self.length, f"scale bar {self.first}-{self.second}: length")
        positive(self.sigma, f"scale bar {self.first}-{self.second}: sigma")
        if self.first == self.second:
            raise InputError(f"scale bar: {self.first} is named at both ends.")


@dataclass(frozen=True, slots=True, kw_only=True)
class Unknowns:
    """What an adjustment estimates.

    Attributes
    ----------
    fixed_cameras : tuple of str
        Cameras whose exterior orientation is kept.
    interior : tuple of str
        Of c, xh, yh, k1, k2, k3, p1, p2, scale, shear, for a fisheye k4 too; for every camera
        whose lens model has them. ``("auto",)``: those
        that the data determine and need.
    shared_interior : bool or mapping of str to str
        One set for all cameras (the same camera moved), one for each, or camera name to the name
        of a set.
    media : tuple of str
        Unknowns of the media. ``index3``, ``thickness1`` or ``gradient``: one value common to all
        media; ``offset``, ``tilt1``, ``tilt2``, ``radius``, ``centreX``... (see
        `Interfaces.parameter_names`): one for each; ``wall:index3``: of the media ``wall`` only.
    control : str
        ``fixed``: control points are error-free unless they have a sigma; ``weighted``: all
        need a sigma; ``free``: their coordinates are start values, the datum is that of a free
        network.
    plates : tuple of str
        Groups of object points that are rigid plates: their coordinates are in the plate's own
        frame, the pose of each is unknown.
    scale_bars : tuple of ScaleBar
        ``@a`` to ``@b``: a wand seen in many places, its ends named 1a, 1b, 2a, 2b...
    priors : mapping of str to float
        Label of an unknown to the standard deviation of its start value: a water level read to
        2 mm is ``{"water:offset": 0.002}``; ``c`` alone means that of every camera. Infinite:
        nothing is known, any value that physics allows is taken.
    typical_priors : bool
        Give indices (0.005), thicknesses and radii (a tenth), centres and axes (a tenth of the
        radius) and gradients (0.005 over the depth of the points) a prior where ``priors`` has
        none.
    robust : float or None
        Huber's bound in standard deviations; observations beyond it lose weight, and image points
        that contradict the others by far are left out and named. None: plain least squares.
    """

    fixed_cameras: tuple[str, ...] = ()
    interior: tuple[str, ...] = ()
    shared_interior: bool | Mapping[str, str] = False
    media: tuple[str, ...] = ()
    control: str = "fixed"
    plates: tuple[str, ...] = ()
    scale_bars: tuple[ScaleBar, ...] = ()
    priors: Mapping[str, float] = field(default_factory=dict)
    typical_priors: bool = False
    robust: float | None = None

    def __post_init__(self) -> None:
        unknown = [name for name in self.interior if name not in ANY_INTERIOR]
        unknown = [] if self.interior == AUTO else unknown
        if unknown:
            raise InputError(
                f"interior: {', '.join(unknown)} is not one of {', '.join(ANY_INTERIOR)}; auto "
                "stands alone."
            )
        if self.control not in CONTROL:
            raise InputError(f"control: {self.control!r} is not one of {', '.join(CONTROL)}.")
        if self.robust is not None:
            positive(self.robust, "robust")
        for label, sigma in self.priors.items():
            if sigma != np.inf:
                positive(sigma, f"prior of {label}")


def bars_of(bars: Sequence[ScaleBar], names: Sequence[str]) -> tuple[ScaleBar, ...]:
    """Return scale bars with those of a wand, ``@a`` to ``@b``, for each of its places.

    Parameters
    ----------
    bars : sequence of ScaleBar
    names : sequence of str
        Points that were measured.

    Raises
    ------
    InputError
        If no place of a wand has both ends, or only one end of a bar says where its names differ.

    Examples
    --------
    >>> wand = ScaleBar(first="@a", second="@b", length=0.5, sigma=1e-4)
    >>> [(bar.first, bar.second) for bar in bars_of([wand], ["1a", "1b", "2a", "7b"])]
    [('1a', '1b')]
    """
    measured, found = dict.fromkeys(names), []
    for bar in bars:
        if "@" not in bar.first + bar.second:
            found.append(bar)
            continue
        heads = (bar.first.split("@"), bar.second.split("@"))
        if not all(len(head) == 2 for head in heads):
            raise InputError(remark("adjust.scale_bar_names", first=bar.first, second=bar.second))
        (start, end), (further, last) = heads
        shortest = len(start + end)
        places = [
            name[len(start) : len(name) - len(end)] for name in measured
            if name.startswith(start) and name.endswith(end) and len(name) > shortest
        ]  # fmt: skip
        pairs = [(start + place + end, further + place + last) for place in places]
        both = [pair for pair in pairs if pair[1] in measured]
        if not both:
            raise InputError(f"scale bar {bar.first}, {bar.second}: no two points have such names.")
        found += [replace(bar, first=one, second=two) for one, two in both]
    return tuple(found)


def is_angle(label: str) -> bool:
    """Tell whether an unknown is an angle: radians in arrays, degrees for the user."""
    parameter = label.rpartition(":")[2]
    return parameter in EXTERIOR[3:] or parameter.startswith("tilt")


#: Beginnings of the names of lengths among the parameters of media.
_LENGTHS = ("offset", "thickness", "radius", "centre", "shift")
#: Units of interior parameters.
_INTERIOR_UNITS = {
    "c": "mm", "xh": "mm", "yh": "mm", "k1": "mm^-2", "k2": "mm^-4", "k3": "mm^-6",
    "p1": "mm^-1", "p2": "mm^-1",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Adjustment:
    """An adjusted project with its precision.

    Attributes
    ----------
    project : Project
        Adjusted cameras, media and object points (new points added).
    names : tuple of str
        Labels of the unknowns that are not object points: ``cam1:X0``, ``interior:c``,
        ``index3``, ``wall:offset``, ``plate A:X0``.
    values : ndarray, shape (u,)
        Their adjusted values; offsets, shifts and tilts count from the start. [object unit, rad,
        mm]
    covariance : ndarray, shape (u, u)
        Of those, with the a-posteriori sigma0.
    point_covariance : ndarray, shape (p, 3, 3)
        Of the object points of ``project``; 0 where fixed, NaN where not measured. [object unit²]
    residuals : ndarray, shape (n, 2)
        Measured minus computed, per row of the image points. [mm]
    standardised : ndarray, shape (n, 2)
        Residuals over their own standard deviations; beyond 3.5 a gross error.
    redundancy_numbers : ndarray, shape (n, 2)
        Share of an error that shows in its own residual.
    weights : ndarray, shape (n, 2)
        Robust weights, 1 for plain least squares.
    sigma_image : ndarray, shape (n, 2)
        A-posteriori standard deviation of each image coordinate, with its own weight. [mm]
    sigma0 : float
        The same of an image coordinate of mean weight. [mm]
    model_error : float
        Factor that all standard deviations of unknowns and points contain because residuals of
        neighbouring points are alike; 1 where they are not.
    redundancy : int
    iterations : int
    sigma0_of : mapping of str to float
        The same per camera: root of the square sum over the sum of redundancy numbers. [mm]
    remarks : tuple of str
        What the user should be told.
    """

    project: Project
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    point_covariance: FloatArray
    residuals: FloatArray
    standardised: FloatArray
    redundancy_numbers: FloatArray
    weights: FloatArray
    sigma_image: FloatArray
    sigma0: float
    redundancy: int
    iterations: int
    sigma0_of: Mapping[str, float]
    model_error: float = 1.0
    remarks: tuple[str, ...] = ()

    def value(self, name: str) -> float:
        """Return one adjusted unknown by its label."""
        return float(self.values[self.names.index(name)])

    def sigma(self, name: str) -> float:
        """Return the standard deviation of one unknown by its label."""
        row = self.names.index(name)
        return float(np.sqrt(self.covariance[row, row]))

    def rows(self) -> list[tuple[str, float, float, str]]:
        """Return name, value, sigma and unit of every unknown; angles in degrees."""
        table = []
        for k, name in enumerate(self.names):
            unit = self.unit(name)
            factor = float(np.degrees(1.0)) if unit == "deg" else 1.0
            table.append((name, float(self.values[k]) * factor, self.sigma(name) * factor, unit))
        return table

    def unit(self, label: str) -> str:
        """Return the unit of an unknown; empty for numbers without one."""
        owner, _, parameter = label.rpartition(":")
        if is_angle(label):
            return "deg"
        if parameter == "gradient":
            return f"1/{self.project.unit}"
        if parameter in EXTERIOR or parameter.startswith(_LENGTHS):
            return self.project.unit
        cameras = self.project.cameras
        cameras = tuple(camera for camera in cameras if camera.name == owner) or cameras
        if parameter in TERMS and any(isinstance(c.distortion, Fisheye) for c in cameras):
            return ""
        return _INTERIOR_UNITS.get(parameter, "")

    @property
    def correlations(self) -> FloatArray:
        """Correlation matrix of the unknowns, shape (u, u)."""
        return correlations(self.covariance)

    @property
    def smallest_detectable(self) -> FloatArray:
        """Error of an image coordinate found with 80 % power at 0.1 % risk, shape (n, 2). [mm]

        Baarda's internal reliability: 4.13 sigma / sqrt(redundancy number), with each
        coordinate's own sigma; NaN where nothing controls it.
        """
        return standardised(4.13 * self.sigma_image, self.redundancy_numbers)

    def gross_errors(self) -> list[tuple[int, float]]:
        """Return rows of image points that look like gross errors and their tests, worst first."""
        worst = np.abs(np.nan_to_num(self.standardised)).max(axis=1, initial=0.0)
        order = np.argsort(-worst).tolist()
        return [(row, float(worst[row])) for row in order if worst[row] > OUTLIER_LIMIT]

    def suspects(self) -> list[str]:
        """Return a sentence for each image point that looks like a gross error, worst first."""
        points = self.project.image_points
        return [
            f"point {points.ids[row]} in camera {points.cameras[row]}: residual "
            f"{np.hypot(*self.residuals[row]) * 1000:.1f} um, {test:.1f} sigma"
            for row, test in self.gross_errors()
        ]


def decimals(sigma: float) -> int:
    """Return how many decimals a value of this standard deviation is worth: three of its digits.

    Examples
    --------
    >>> decimals(0.0123), decimals(25.0), decimals(0.0)
    (4, 1, 6)
    """
    return max(0, min(12, 2 - int(np.floor(np.log10(sigma))) if sigma > 0 else 6))
