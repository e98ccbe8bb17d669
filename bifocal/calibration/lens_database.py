"""The lensfun database: camera and lens from EXIF, distortion as a radial profile.

The database's maps also change the scale on the optical axis (3 % at 19 mm for a kit zoom). Between
the two photos of a pair that reads as half a metre of false relief, so the profile is divided by
its value on the axis: what is left is distortion alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bifocal.model import Lens
from bifocal.remarks import remark
from photocore.arrays import FloatArray
from photocore.camera import camera_matrix
from photocore.errors import InputError, MissingExtraError
from photocore.images import ImageInfo, image_info

#: Nodes of the tabulated profile; with 65 a cubic spline follows the map to 0.001 px.
NODES = 65
#: Largest scale error on the axis that may remain, relative: 4 mm of relief at 35/19 mm.
AXIS_SCALE_LIMIT = 2e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class DatabaseLens:
    """A lens of the database applied to one photo.

    Attributes
    ----------
    lens : Lens
        Model ``radial``, scale 1 on the axis.
    name : str
        As the database calls it.
    axis_scale : float
        Scale that the database's own map has on the axis; it was taken out.
    corner_shift : float
        Distortion in the corner of the photo. [px]
    """

    lens: Lens
    name: str
    axis_scale: float
    corner_shift: float

    @property
    def remark(self) -> str:
        """What the database gave and what was taken out."""
        return (
            f"{self.name}: {self.corner_shift:.1f} px in the corner; the database's scale on the "
            f"axis ({(self.axis_scale - 1) * 100:+.2f} %) was taken out"
        )


def lens_from_database(
    path: Path | str,
    *,
    camera_name: str = "",
    lens_name: str = "",
    focal_length: float | None = None,
) -> DatabaseLens:
    """Return the distortion that the lens database knows for a photo.

    Parameters
    ----------
    path : path
        The photo; its EXIF tells camera, lens and focal length.
    camera_name, lens_name : str
        Names to use instead of, or beside, EXIF's.
    focal_length : float, optional
        Instead of EXIF's. [mm]

    Raises
    ------
    MissingExtraError
        If lensfunpy is not installed.
    InputError
        If the camera is not in the database, EXIF lacks the focal length, or several lenses fit:
        the message lists them.
    """
    try:
        import lensfunpy
    except ImportError:
        raise MissingExtraError("The lens database", "lens") from None
    info = image_info(path)
    focal = focal_length or info.focal_length
    if not focal:
        raise InputError(f"{path}: EXIF has no focal length; give --focal in mm.")
    database = lensfunpy.Database()
    body = _camera(database, info, camera_name)
    glass = _lens(database, body, info, lens_name, focal)
    if not glass.min_focal - 0.5 <= focal <= glass.max_focal + 0.5:
        raise InputError(
            f"{path}: taken at {focal:g} mm, but {glass.model} covers {glass.min_focal:g} to "
            f"{glass.max_focal:g} mm; name the right lens with --lens-name."
        )
    profile, axis_scale = _profile(lensfunpy, glass, body, info, focal)
    width, height = info.size
    pixels = focal / (36.0 / body.crop_factor) * np.hypot(width, height)
    # The crop factor refers to the diagonal of 36 x 24 mm.
    pixels *= 36.0 / np.hypot(36.0, 24.0)
    centre = (width - 1) / 2, (height - 1) / 2
    lens = Lens(
        camera_matrix=camera_matrix(pixels, 1.0, *centre),
        coefficients=profile,
        model="radial",
        image_size=info.size,
        source=f"lens database: {glass.model} at {focal:g} mm on {body.model}",
        extra={"axis_scale_removed": axis_scale},
    )
    corner = np.array([[0.0, 0.0]])
    shift = float(np.linalg.norm(lens.distort(corner) - corner))
    return DatabaseLens(lens=lens, name=glass.model, axis_scale=axis_scale, corner_shift=shift)


def _camera(database: Any, info: ImageInfo, name: str) -> Any:
    """Return the one camera that EXIF or the user names."""
    maker, model = (info.make, name or info.model)
    if not model:
        raise InputError(f"{info.path}: EXIF names no camera; give --camera-name.")
    bodies = database.find_cameras(maker or None, model, loose_search=True)
    # The search is by likeness ("iPhone 12" finds an iPhone 5): only the same name is the camera.
    same = {model.lower(), f"{maker} {model}".lower()}
    exact = [item for item in bodies if item.model.lower() in same]
    if exact or (name and bodies):
        return (exact or bodies)[0]
    near = ", ".join(sorted({item.model for item in bodies[:8]})) or "nothing similar"
    raise InputError(
        f"{info.path}: the camera {maker} {model} is not in the lens database (it has: {near}). "
        "Name one with --camera-name, or calibrate the lens yourself with `bifocal calibrate`."
    )


def _lens(database: Any, body: Any, info: ImageInfo, wanted: str, focal: float) -> Any:
    """Return the one lens that EXIF or the user names; list the choice when it is ambiguous."""
    name = wanted or info.lens
    if name:
        lenses = database.find_lenses(body, None, name)
        exact = [item for item in lenses if item.model.lower() == name.lower()]
        lenses = exact or lenses
    else:
        lenses = database.find_lenses(body)
        if len({item.model for item in lenses}) == 1:
            lenses = lenses[:1]  # a compact camera or telephone: the lens is part of it
    fitting = [item for item in lenses if item.min_focal - 0.5 <= focal <= item.max_focal + 0.5]
    if not fitting:
        raise InputError(
            f"{info.path}: no lens {name or '(EXIF names none)'} for {body.model} at {focal:g} mm "
            "in the database; name it with --lens-name, or calibrate it with `bifocal calibrate`."
        )
    best = [item for item in fitting if item.score == fitting[0].score]
    if not name or len({item.model for item in best}) > 1:
        if len({item.model for item in fitting}) == 1:
            return fitting[0]
        choice = "\n  ".join(sorted({item.model for item in (best if name else fitting)})[:20])
        raise InputError(
            f"{info.path}: several lenses fit {body.model} at {focal:g} mm. "
            f'Choose one with --lens-name "...":\n  {choice}'
        )
    return best[0]


def _profile(
    lensfunpy: Any, glass: Any, body: Any, info: ImageInfo, focal: float
) -> tuple[FloatArray, float]:
    """Return the radial profile of the database's map, scale 1 on the axis, and that scale.

    The map is a fit away from exact: float32 with fast square roots. The profile's own smoothness
    (powers of the radius up to 4, which all models of the database have) averages that out.
    """
    width, height = info.size
    modifier = lensfunpy.Modifier(glass, body.crop_factor, width, height)
    modifier.initialize(focal, info.aperture or 8.0, info.subject_distance or 10.0)
    mapped = modifier.apply_geometry_distortion()
    if mapped is None:
        raise InputError(remark("calibration.no_distortion_data", of=info.path, model=glass.model))
    centre = np.array([(width - 1) / 2, (height - 1) / 2])
    # Along both diagonals, so that any half-pixel offset of the map averages out.
    steps = np.linspace(0, 1, 400)[20:]
    ideal, factor = [], []
    for corner in ((0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)):
        pixels = np.rint(centre + steps[:, None] * (np.array(corner) - centre)).astype(int)
        radius = np.linalg.norm(pixels - centre, axis=1)
        away = mapped[pixels[:, 1], pixels[:, 0]].astype(np.float64) - centre
        ideal.append(radius)
        factor.append(np.linalg.norm(away, axis=1) / radius)
    reach = float(np.hypot(*centre))
    radius, ratio = np.concatenate(ideal) / reach, np.concatenate(factor)
    # ptlens: powers 0..3 of the radius; poly3, poly5: 0, 2 and 4. Weighted by radius, since the
    # map's rounding is constant in pixels.
    powers = np.arange(5)
    design = radius[:, None] ** powers
    terms, *_ = np.linalg.lstsq(design * radius[:, None], ratio * radius, rcond=None)
    residual = np.abs((design @ terms - ratio) * radius * reach).max()
    # lensfun's fast square roots leave up to 0.1 px of jitter in its maps; more is another shape.
    if residual > 0.3:
        raise InputError(
            f"{info.path}: the database's map of {glass.model} is no smooth radial distortion "
            f"({residual:.2f} px off); calibrate the lens with `bifocal calibrate`."
        )
    axis_scale = float(terms[0])
    nodes = np.linspace(0, 1.15, NODES)
    values = (nodes[:, None] ** powers) @ terms / axis_scale
    if abs(values[0] - 1) > AXIS_SCALE_LIMIT:
        raise InputError(f"{info.path}: the scale on the axis could not be matched to 0.02 %.")
    return np.ravel(np.column_stack([nodes * reach, values])), axis_scale
