"""Cameras in OpenCV's terms, which COLMAP, Metashape and AquaCal share.

OpenCV counts in pixels with y down and z forwards: x_camera = R X + t, with the distortion of
`photocore.camera.distortion` about the principal point in units of the focal length. Pixels have
integers at pixel centres; formats that count from the corner of the image are half a pixel
off, which is mended where they are read and written.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from multimedia.media import Camera, Distortion, Sensor, farthest_miss, nearest_camera, sensor_rays
from multimedia.projects import FLIP, Project
from multimedia.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import TERMS, Brown, Convention, Fisheye, LensData, nearest_rotation
from photocore.errors import InputError

#: Size of a pixel where the file does not say, as these files never do. [mm]
PITCH = 0.005
#: Beyond so many pixels a camera of another lens model is another camera.
FARTHEST = 1.0
#: Distortion terms of OpenCV's largest model.
MOST_TERMS = 14
_FISHEYE = "fisheye"
#: What another lens model may change, the camera staying where it is.
FREE = ("c", "xh", "yh", "k1", "k2", "k3", "p1", "p2", "scale")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OpencvCamera:
    """A camera in OpenCV's terms.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        fx, fy, cx, cy. [px]
    coefficients : ndarray, shape (5,) or (4,)
        k1 k2 p1 p2 k3; of a fisheye k1 k2 k3 k4.
    fisheye : bool
        Whether the lens is one.
    size : tuple of int
        Width and height. [px]
    rotation, translation : ndarray, shape (3, 3) and (3,)
        Camera from world.
    misfit : float
        Farthest that an image point of the camera it was made from moves. [px]
    """

    matrix: FloatArray
    coefficients: FloatArray
    size: tuple[int, int]
    rotation: FloatArray
    translation: FloatArray
    misfit: float = 0.0
    fisheye: bool = False


def camera_of(
    lens: LensData, rotation: FloatArray, translation: FloatArray, *, pitch: float, name: str
) -> Camera:
    """Return the camera with a lens in OpenCV's terms and its pose, camera from world.

    Parameters
    ----------
    lens : LensData
        Of the fisheye model, or without rational, thin-prism or tilted terms.
    rotation, translation : ndarray, shape (3, 3) and (3,)
        [object unit]
    pitch : float
        Width of a pixel; its height follows from fx and fy. [mm]
    name : str
        For tables and messages.

    Raises
    ------
    InputError
        If the lens has terms that the project's cameras do not have.
    """
    matrix = lens.camera_matrix
    if lens.model not in ("opencv", _FISHEYE):
        raise InputError(remark("exchange.lens_model", of=lens.source, name=name, model=lens.model))
    if abs(matrix[0, 1]) > 1e-9 * matrix[0, 0]:
        raise InputError(f"{lens.source}: camera {name} has a skew of {matrix[0, 1]:g} px.")
    fx, fy = float(matrix[0, 0]), float(matrix[1, 1])
    if not (fx > 0 and fy > 0 and np.size(translation) == 3):
        raise InputError(remark("exchange.focal_and_translation", of=lens.source, name=name))
    if lens.coefficients.size > MOST_TERMS:
        raise InputError(
            f"{lens.source}: camera {name} has {lens.coefficients.size} distortion terms; expected "
            f"at most {MOST_TERMS}."
        )
    width, height = lens.image_size
    sensor = Sensor(
        width=width, height=height, pixel_size=np.array([pitch, pitch * (fx / fy)]),  # type: ignore[arg-type]
    )  # fmt: skip
    turn = nearest_rotation(rotation)
    distortion: Distortion
    if lens.model == _FISHEYE:
        distortion = _fisheye(lens, name)
    else:
        terms = lens.coefficients.tolist()
        distortion = Brown.from_opencv(terms, principal_distance=fx * pitch)
    return Camera(
        centre=-turn.T @ translation,
        rotation=turn.T @ FLIP,
        principal_distance=fx * pitch,
        principal_point=sensor.image_from_pixel(matrix[:2, 2]),
        distortion=distortion,
        sensor=sensor,
        name=name,
    )


def _fisheye(lens: LensData, name: str) -> Fisheye:
    """Return the fisheye of four terms."""
    terms = lens.coefficients.tolist()
    if len(terms) != len(TERMS):
        raise InputError(
            f"{lens.source}: camera {name} is a fisheye with {len(terms)} terms, expected "
            f"{' '.join(TERMS)}."
        )
    return Fisheye(**dict(zip(TERMS, terms, strict=True)))


def opencv_of(camera: Camera) -> OpencvCamera:
    """Return a camera in OpenCV's terms, exactly where it has them, else as near as it can.

    Raises
    ------
    InputError
        If the camera has no sensor, or OpenCV's model comes no nearer than a pixel.
    """
    sensor = camera.described_sensor()
    misfit = 0.0
    lens = camera.distortion
    if (
        isinstance(lens, Brown)
        and not lens.is_identity
        and (lens.convention is not Convention.BROWN or lens.shear)
    ):
        points, pixels = sensor_rays(camera)
        image = sensor.image_from_pixel(pixels)
        sign = -1.0 if lens.convention is Convention.PHOTOGRAMMETRIC else 1.0
        start_terms = {name: sign * getattr(lens, name) for name in ("k1", "k2", "k3", "p1", "p2")}
        start = replace(camera, distortion=Brown(**start_terms))
        camera = nearest_camera(start, points, image, FREE)
        misfit = farthest_miss(camera, points, image)
        if misfit > FARTHEST:
            raise InputError(remark("exchange.lens_misfit", name=camera.name, misfit=misfit))
    lens, c = camera.distortion, camera.principal_distance
    matrix = np.eye(3)
    matrix[[0, 1], [0, 1]] = c / sensor.pixel_size * [lens.scale, 1.0]
    matrix[:2, 2] = sensor.pixel_from_image(camera.principal_point)
    rotation = FLIP @ camera.rotation.T
    if isinstance(lens, Fisheye):
        terms = np.array([getattr(lens, name) for name in TERMS])
    else:
        terms = np.array(
            [lens.k1 * c**2, lens.k2 * c**4, -lens.p2 * c, lens.p1 * c, lens.k3 * c**6]
        )
    return OpencvCamera(
        matrix=matrix,
        coefficients=terms + 0.0,
        fisheye=isinstance(lens, Fisheye),
        size=(sensor.width, sensor.height),
        rotation=rotation,
        translation=-rotation @ camera.centre,
        misfit=misfit,
    )


def inexact(cameras: dict[str, OpencvCamera]) -> tuple[str, ...]:
    """Return what to say of cameras whose lens the model of OpenCV only comes near."""
    moved = [f"{name} {one.misfit:.2g} px" for name, one in cameras.items() if one.misfit > 1e-9]
    if not moved:
        return ()
    return (
        "OpenCV's lens model has no terms for this distortion as it is; written with those that "
        f"come nearest. Image points move by at most: {', '.join(moved)}.",
    )


def left_out(
    project: Project, views: dict[str, OpencvCamera], program: str, files: str
) -> tuple[str, ...]:
    """Return what to say of a project written for a program whose files hold cameras alone."""
    remarks = list(inexact(views))
    if any(project.media_of):
        remarks.append(f"{program} knows no media: glass and water were not written.")
    if project.object_points.ids or project.image_points.ids:
        remarks.append(f"points are not part of {program}'s {files}; they were not written.")
    return tuple(remarks)
