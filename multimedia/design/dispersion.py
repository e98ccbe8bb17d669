r"""Dispersion: every colour has its own radial shift, so images through water have colour seams.

Blue is refracted more than red: seen from air, seams are red towards the nadir point and blue
outwards (Maas 2015, Sect. 6, Fig. 5).

References
----------
.. [1] Maas, "On the accuracy potential in underwater/multimedia photogrammetry", Sensors 2015.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from multimedia.refraction import (
    QUAN_FRY,
    Layers,
    Material,
    WaterFormula,
    radial_shift,
    refracted_angle,
    water_refractive_index,
)
from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_floats, as_points, positive
from photocore.errors import InputError

#: Middle of what the red, green and blue pixels of common sensors see. [nm]
RGB_NM = (610.0, 540.0, 465.0)


#: Image rows worked on at a time.
STRIP = 256


def layers_per_colour(
    *,
    wavelengths_nm: Sequence[float] = RGB_NM,
    glass: Material | float | None = None,
    thickness: float = 0.0,
    temperature_c: float = 20.0,
    salinity_percent: float = 0.0,
    depth: float = 0.0,
    formula: WaterFormula = QUAN_FRY,
) -> tuple[Layers, ...]:
    """Return air, glass and water as each colour sees them.

    Parameters
    ----------
    wavelengths_nm : sequence of float
        One per colour; by default red, green, blue. [nm]
    glass : Material, float or None
        What the port or tank is made of, a fixed index, or nothing.
    thickness : float
        Of the glass. [m]
    temperature_c, salinity_percent, depth, formula
        As in `multimedia.water_refractive_index`; Quan and Fry by default, whose dispersion is that
        of the data.

    Returns
    -------
    tuple of Layers
        Air is 1 for every colour: its own dispersion is 200 times smaller.

    Raises
    ------
    InputError
        As `multimedia.water_refractive_index`, and if the glass is not known at a wavelength.

    Examples
    --------
    >>> red, green, blue = layers_per_colour()
    >>> [round(colour.indices[-1], 4) for colour in (red, green, blue)]
    [1.3324, 1.3347, 1.3383]
    """
    colours = []
    for wavelength in wavelengths_nm:
        water = float(
            water_refractive_index(
                wavelength_nm=wavelength,
                temperature_c=temperature_c,
                salinity_percent=salinity_percent,
                depth=depth,
                formula=formula,
            )
        )
        if glass is None:
            colours.append(Layers(indices=(1.0, water)))
        else:
            pane = float(glass.index(wavelength)) if isinstance(glass, Material) else glass
            colours.append(Layers(indices=(1.0, pane, water), thicknesses=(thickness,)))
    return tuple(colours)


def shift_per_colour(
    radius: ArrayLike, *, z0: ArrayLike, zp: ArrayLike, colours: Sequence[Layers]
) -> FloatArray:
    r"""Shifted radius of the same points in every colour.

    Parameters
    ----------
    radius : array_like, shape (...)
        Horizontal distance R from the camera's nadir to the point. [m]
    z0, zp : array_like, shape (...)
        Camera centre to the first interface; depth below the last. [m]
    colours : sequence of Layers
        The media as each colour sees them, see `layers_per_colour`.

    Returns
    -------
    radius_bar : ndarray, shape (..., colours)
        [m]

    Raises
    ------
    InputError
        As `multimedia.radial_shift`.

    Examples
    --------
    Red (1.332) and blue (1.338) under 1 m of water, 1 m off, from 1 m above:

    >>> red_blue = [Layers(indices=(1.0, 1.332)), Layers(indices=(1.0, 1.338))]
    >>> shift_per_colour(1.0, z0=1.0, zp=1.0, colours=red_blue).round(4).tolist()
    [1.1766, 1.1793]
    """
    return np.stack([radial_shift(radius, z0=z0, zp=zp, layers=c) for c in colours], axis=-1)


def seam_width(
    radius: ArrayLike,
    *,
    z0: ArrayLike,
    zp: ArrayLike,
    colours: Sequence[Layers],
    principal_distance: float,
    pixel_size: float,
) -> FloatArray:
    r"""Width of the colour seam in an image taken straight through the layers.

    Parameters
    ----------
    radius, z0, zp, colours
        As in `shift_per_colour`.
    principal_distance, pixel_size : float
        Of the camera. [mm]

    Returns
    -------
    width : ndarray, shape (...)
        Distance between the innermost and the outermost colour. [px]

    Raises
    ------
    InputError
        If the camera constant or the pixel size is not positive.

    Notes
    -----
    :math:`c\,(\bar R_{max} - \bar R_{min}) / (Z_0 + t + Z_P)` for an optical
    axis at right angles to the layers; in a tilted view the seam is wider away from the nadir point
    by up to 1 / cos² of the angle.

    Examples
    --------
    >>> red_blue = [Layers(indices=(1.0, 1.332)), Layers(indices=(1.0, 1.338))]
    >>> camera = dict(principal_distance=24, pixel_size=0.004)
    >>> round(float(seam_width(1.0, z0=1.0, zp=1.0, colours=red_blue, **camera)), 1)
    8.1
    """
    scale = positive(principal_distance, "principal_distance", unit="mm") / positive(
        pixel_size, "pixel_size", unit="mm"
    )
    bars = shift_per_colour(radius, z0=z0, zp=zp, colours=colours)
    whole = as_floats(z0, "z0") + colours[0].thickness + as_floats(zp, "zp")
    return np.asarray(scale * np.ptp(bars, axis=-1) / whole)


def colour_positions(
    offsets: ArrayLike,
    *,
    z0: float,
    zp: float,
    colours: Sequence[Layers],
    principal_distance: float,
    reference: int = 1,
) -> FloatArray:
    r"""Where each colour of the reference colour's image points is found.

    Parameters
    ----------
    offsets : array_like, shape (..., 2)
        Image coordinates from the nadir point, as the reference colour shows them; optical axis at
        right angles to the layers. [mm]
    z0, zp : float
        Camera centre to the first interface; depth at which colours are brought together. [m]
    colours : sequence of Layers
        As in `shift_per_colour`.
    principal_distance : float
        Camera constant. [mm]
    reference : int
        Which colour stays; the second (green) by default.

    Returns
    -------
    offsets : ndarray, shape (..., 2, colours)
        Where to fetch each colour. [mm]

    Raises
    ------
    InputError
        If there is no such colour or the camera constant is not positive.

    Notes
    -----
    The ray of the reference colour is followed down to the depth (Eq. 1 of [1]_ read forwards),
    which gives R; from there each colour is shifted back up.

    References
    ----------
    .. [1] Maas 2015, Sensors 15(8), Sect. 2.

    Examples
    --------
    >>> media = [Layers(indices=(1.0, n)) for n in (1.332, 1.335, 1.338)]
    >>> camera = dict(z0=1.0, zp=1.0, colours=media, principal_distance=24.0)
    >>> colour_positions([12.0, 0.0], **camera)[0].round(4).tolist()
    [11.9868, 12.0, 12.0131]
    """
    if not 0 <= reference < len(colours):
        raise InputError(remark("design.reference", count=len(colours), reference=reference))
    constant = positive(principal_distance, "principal_distance", unit="mm")
    places = as_points(offsets, "offsets", dimension=2)
    tangent = np.hypot(places[..., 0], places[..., 1]) / constant
    beta = np.arctan(tangent)
    layers = colours[reference]
    radius = np.zeros(())
    for height, index in zip(layers.heights(z0=z0, zp=zp), layers.indices, strict=True):
        inner = refracted_angle(beta, n_from=layers.indices[0], n_to=index)
        radius = radius + height * np.tan(inner)
    bars = shift_per_colour(radius, z0=z0, zp=zp, colours=colours)
    depth = np.where(tangent > 0, tangent * (z0 + layers.thickness + zp), 1.0)
    scale = np.where(tangent[..., None] > 0, bars / depth[..., None], 1.0)
    return np.asarray(places[..., None] * scale[..., None, :])


def correct_dispersion(
    image: NDArray[Any],
    *,
    z0: float,
    zp: float,
    colours: Sequence[Layers],
    principal_distance: float,
    pixel_size: float,
    nadir: tuple[float, float] | None = None,
    reference: int = 1,
) -> NDArray[Any]:
    """Bring the colour channels of an image together.

    Parameters
    ----------
    image : ndarray, shape (rows, columns, channels)
        Any type of number; free of lens distortion.
    z0, zp : float
        Camera centre to the first interface; depth at which colours are brought together. [m]
    colours : sequence of Layers
        The media for each channel, in the order of the channels.
    principal_distance, pixel_size : float
        Of the camera. [mm]
    nadir : (float, float), optional
        Nadir point (column, row); by default the middle of the image. [px]
    reference : int
        Which channel stays as it is; the second (green) by default.

    Returns
    -------
    corrected : ndarray
        Shape and type of the image. What other channels lack at the border is repeated from it.

    Raises
    ------
    InputError
        If the image has not one channel per colour, or a length is not positive.

    Notes
    -----
    One lookup per pixel and channel (`colour_positions`) in a cubic spline. Off the depth zp a part
    of the seam remains: see `seam_width`.

    Examples
    --------
    >>> media = [Layers(indices=(1.0, n)) for n in (1.332, 1.335, 1.338)]
    >>> grey = np.full((4, 6, 3), 100, dtype=np.uint8)
    >>> camera = dict(z0=1.0, zp=1.0, principal_distance=24.0, pixel_size=0.004)
    >>> bool((correct_dispersion(grey, colours=media, **camera) == 100).all())
    True
    """
    from scipy.ndimage import map_coordinates, spline_filter

    if image.ndim != 3 or image.shape[2] != len(colours):
        raise InputError(remark("design.channels", count=len(colours), shape=image.shape))
    size = positive(pixel_size, "pixel_size", unit="mm")
    rows, columns = image.shape[:2]
    middle = ((columns - 1) / 2, (rows - 1) / 2) if nadir is None else nadir
    corrected = image.copy()
    whole = np.issubdtype(image.dtype, np.integer)
    for channel in (c for c in range(len(colours)) if c != reference):
        # Not cv2.remap: it rounds positions to 1/32 px, as much as a good pick is worth.
        spline = spline_filter(image[..., channel].astype(np.float64), mode="nearest")
        for top in range(0, rows, STRIP):
            row, column = np.mgrid[top : min(top + STRIP, rows), 0:columns]
            offsets = np.stack([column - middle[0], row - middle[1]], axis=-1) * size
            fetched = colour_positions(
                offsets,
                z0=z0,
                zp=zp,
                colours=(colours[reference], colours[channel]),
                principal_distance=principal_distance,
                reference=0,
            )
            places = fetched[..., 1] / size + np.asarray(middle)
            values = map_coordinates(
                spline, places[..., ::-1].transpose(2, 0, 1), mode="nearest", prefilter=False
            )
            if whole:
                limits = np.iinfo(image.dtype)
                values = np.clip(np.rint(values), limits.min, limits.max)
            corrected[top : top + STRIP, :, channel] = values
    return corrected
