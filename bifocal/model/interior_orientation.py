"""What is known of a photo's interior orientation before its pair is set up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bifocal.model.lens import SIGMA_FOCAL, Lens
from bifocal.remarks import remark
from photocore.arrays import ByteArray, FloatArray, is_finite_number, positive
from photocore.camera import Pinhole, RadialDivision, camera_matrix
from photocore.errors import InputError, located

#: Standard deviation of a principal point, as shares of the diagonal: of a calibrated lens (focus,
#: stabiliser and crop move it: 5 px freed turned the wall's normal on a castle from 0.9 to 0.02
#: degrees), and of a lens of which nothing is known (15 px).
MOVED_CENTRE, UNKNOWN_CENTRE = 0.00135, 0.004

#: Standard deviation of k1 and k2 of a lens of which nothing is known.
SIGMA_RADIAL = 0.1
#: Principal distances this close (logarithm) are of one lens, unless lens files say otherwise.
SAME_FOCAL = 0.01

#: Upright pixel from stored pixel for each EXIF orientation: the linear part.
TURNS = {
    1: ((1, 0), (0, 1)), 2: ((-1, 0), (0, 1)), 3: ((-1, 0), (0, -1)), 4: ((1, 0), (0, -1)),
    5: ((0, 1), (1, 0)), 6: ((0, -1), (1, 0)), 7: ((0, -1), (-1, 0)), 8: ((0, 1), (-1, 0)),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Interior:
    """What is known of a photo's interior orientation before it is set up.

    Attributes
    ----------
    focal : float
        Principal distance in columns. [px]
    sigma_focal : float
        Its relative standard deviation, no pixels: 0.0005 for a calibration, 0.5 for "a normal
        lens".
    centre : ndarray, shape (2,)
        Principal point (column, row). [px]
    sigma_centre : float
        Standard deviation of either coordinate. [px]
    aspect, sigma_aspect : float
        fy / fx and its standard deviation.
    image_size : tuple of int
        Width and height. [px]
    source : str
        Where it comes from, for the report.
    lens : Lens or None
        Distortion of the photo's pixels.
    sigma_radial : float
        Standard deviation of the terms k1, k2 of an unknown radial distortion (relative shift at
        one principal distance off the axis); zero keeps them zero.
    pixel_size : float or None
        [mm]
    is_calibrated : bool
        Whether it comes from a lens file.
    is_typed : bool
        Whether the focal length was typed for the far or the near photo, and is not the file's own.
    is_sought : bool
        Whether the photos themselves are to tell the principal distance, one for both.
    is_part : bool
        Whether the photo may be cut out of a larger one by itself: its principal point is then not
        that of the other photo, though both are of one body.
    doubt : str
        What contradicts it, for the user; empty: nothing.
    """

    focal: float
    sigma_focal: float
    centre: FloatArray
    sigma_centre: float
    image_size: tuple[int, int]
    source: str
    aspect: float = 1.0
    sigma_aspect: float = 0.001
    lens: Lens | None = None
    sigma_radial: float = 0.0
    pixel_size: float | None = None
    is_calibrated: bool = False
    is_typed: bool = False
    is_sought: bool = False
    is_part: bool = False
    doubt: str = ""

    def __post_init__(self) -> None:
        """Refuse what is no principal distance, and a standard deviation of it in pixels."""
        positive(self.focal, "focal", unit="px")
        if not 0 < self.sigma_focal <= 1:
            raise InputError(
                "sigma_focal: must be a share of the principal distance, above 0 and no more than "
                f"1 (0.001 for 0.1 %), got {self.sigma_focal!s:.40}."
            )

    @classmethod
    def from_lens(cls, lens: Lens, *, source: str) -> Interior:
        """Return the interior orientation of a calibrated lens (already of the photo's format).

        Raises
        ------
        InputError
            If the file's ``sigma_focal`` is no share of the principal distance.
        """
        matrix = lens.camera_matrix
        distorted = bool(np.any(lens.coefficients)) or lens.model == "fisheye"
        # Straight lines give the distortion; distance and principal point are then assumed.
        assumed = lens.extra.get(SIGMA_FOCAL)
        if assumed is not None and not is_finite_number(assumed):
            raise InputError(f"{source}: {SIGMA_FOCAL}: expected a number, got {assumed!r:.40}.")
        centre = MOVED_CENTRE if assumed is None else UNKNOWN_CENTRE
        with located(source):
            return cls(
                focal=float(matrix[0, 0]),
                sigma_focal=0.0005 if assumed is None else assumed,
                centre=np.array(matrix[:2, 2]),
                sigma_centre=centre * float(np.hypot(*lens.image_size)),
                image_size=lens.image_size,
                source=source,
                aspect=float(matrix[1, 1] / matrix[0, 0]),
                sigma_aspect=0.0001,
                lens=lens if distorted else None,
                is_calibrated=True,
            )

    @classmethod
    def from_focal(
        cls,
        focal: float,
        *,
        image_size: tuple[int, int],
        sigma: float,
        source: str,
        pixel_size: float | None = None,
    ) -> Interior:
        """Return what a focal length alone tells: the principal point near the photo's middle.

        Parameters
        ----------
        focal : float
            [px]
        image_size : tuple of int
            [px]
        sigma : float
            Relative standard deviation of the focal length.
        source : str
        pixel_size : float, optional
            [mm]
        """
        width, height = image_size
        return cls(
            focal=focal,
            sigma_focal=sigma,
            centre=np.array([(width - 1) / 2, (height - 1) / 2]),
            sigma_centre=UNKNOWN_CENTRE * float(np.hypot(width, height)),
            image_size=image_size,
            source=source,
            pixel_size=pixel_size,
        )

    @classmethod
    def unknown(cls, image_size: tuple[int, int]) -> Interior:
        """Return a normal lens: 1.2 times the longer side, within a factor of 1.65."""
        return cls.from_focal(
            1.2 * max(image_size),
            image_size=image_size,
            sigma=0.5,
            source=remark("orientation.normal_lens"),
        )

    @classmethod
    def sought(cls, image_size: tuple[int, int]) -> Interior:
        """Return a lens that took both photos, of whose principal distance nothing is known."""
        lens = cls.from_focal(
            0.95 * max(image_size),
            image_size=image_size,
            sigma=0.14,
            source=remark("orientation.sought_lens"),
        )
        return replace(lens, is_sought=True)

    @property
    def is_assumed(self) -> bool:
        """Whether nothing but experience stands behind the principal distance."""
        return self.sigma_focal > 0.15

    @property
    def matrix(self) -> FloatArray:
        """Camera matrix, shape (3, 3). [px]"""
        return camera_matrix(self.focal, self.aspect, *self.centre)

    def ideal(self, pixels: FloatArray) -> FloatArray:
        """Return pixels freed of the lens's distortion. [px]"""
        return pixels.copy() if self.lens is None else self.lens.undistort(pixels)

    def raw(self, ideal: FloatArray) -> FloatArray:
        """Return where ideal pixels are seen in the photo as it is. [px]"""
        return ideal.copy() if self.lens is None else self.lens.distort(ideal)

    def raw_by_ideal(self, ideal: FloatArray) -> FloatArray:
        """Return the derivative of raw pixels by ideal ones, shape (n, 2, 2)."""
        if self.lens is None:
            return np.broadcast_to(np.eye(2), (len(ideal), 2, 2))
        return self.lens.distorted_by_ideal(ideal)

    def radial(self, k1: float, k2: float = 0.0) -> RadialDivision:
        """Return the model of an unknown radial distortion, on top of the lens's."""
        return RadialDivision(k1, self.centre, self.focal, k2)


#: What belongs to both photos of a pair, the far one first.
Interiors = tuple[Interior, Interior]
Cameras = tuple[Pinhole, Pinhole]
Images = tuple[ByteArray, ByteArray]


def with_one_lens(interiors: Interiors) -> tuple[Interiors, bool]:
    """Return interiors with a free distortion where both photos may be of one unknown lens.

    Returns
    -------
    interiors : pair of Interior
    known : bool
        Whether it is one lens for certain: principal distances are known and equal.
    """
    first, second = interiors
    if first.is_calibrated or second.is_calibrated or first.image_size != second.image_size:
        return interiors, False
    if abs(np.log(first.focal / second.focal)) > SAME_FOCAL:
        return interiors, False
    focal = float(np.sqrt(first.focal * second.focal))
    one = [replace(i, focal=focal, sigma_radial=SIGMA_RADIAL) for i in interiors]
    return (one[0], one[1]), not (first.is_assumed or second.is_assumed)


def lens_of_photo(lens: Lens, size: tuple[int, int], *, orientation: int = 1) -> Lens:
    """Return the lens for an upright photo of a given size.

    Parameters
    ----------
    lens : Lens
        Calibrated on photos as the sensor gives them, or upright ones of the same size.
    size : tuple of int
        Width and height of the upright photo. [px]
    orientation : int
        EXIF orientation of the stored photo.

    Raises
    ------
    InputError
        If the photo is not a resized or turned version of the calibrated format.
    """
    if size == lens.image_size:
        return lens
    stored = (size[1], size[0]) if orientation >= 5 else size
    factor = stored[0] / lens.image_size[0]
    if abs(stored[1] / lens.image_size[1] / factor - 1) > 0.002:
        raise InputError(
            f"the lens was calibrated on photos of {lens.image_size[0]} x {lens.image_size[1]} px, "
            f"this photo has {size[0]} x {size[1]}: it was cropped, or is of another camera. Use "
            "the uncropped photo, or calibrate with photos like this one."
        )
    matrix = np.diag([factor, factor, 1.0]) @ lens.camera_matrix
    matrix[:2, 2] += (factor - 1.0) / 2.0  # pixel centres are at integers
    turn = np.array(TURNS[orientation], dtype=np.float64)
    coefficients = np.array(lens.coefficients)
    if orientation != 1:
        matrix = _turned_matrix(matrix, turn, size)
        coefficients = _turned_coefficients(lens, coefficients, turn)
    return replace(
        lens,
        camera_matrix=matrix,
        coefficients=coefficients,
        image_size=size,
        source=f"{lens.source} (resized or turned)".strip(),
        extra={key: value for key, value in lens.extra.items() if key == SIGMA_FOCAL},
    )


def _turned_matrix(matrix: FloatArray, turn: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Return the camera matrix after turning the pixels about the photo's middle."""
    last = np.array([size[0] - 1.0, size[1] - 1.0])
    stored_last = np.abs(turn.T) @ last
    centre = turn @ (matrix[:2, 2] - stored_last / 2) + last / 2
    focal = np.abs(turn) @ np.diag(matrix)[:2]
    return camera_matrix(focal[0], focal[1] / focal[0], *centre)


def _turned_coefficients(lens: Lens, coefficients: FloatArray, turn: FloatArray) -> FloatArray:
    """Return coefficients after turning: radial ones stay, (p2, p1) turns like a vector."""
    if lens.model == "fisheye" or not len(coefficients):
        return coefficients
    if len(coefficients) > 8:
        raise InputError(remark("lens.turned_with_tilt"))
    tangential = turn @ np.array([coefficients[3], coefficients[2]])
    coefficients[2], coefficients[3] = tangential[1], tangential[0]
    return coefficients
