"""The media between camera and object: plane-parallel layers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from multimedia.remarks import remark
from photocore.arrays import FloatArray, as_floats
from photocore.errors import GeometryError, InputError, located

#: Diamond; nothing in front of a camera for visible light bends it more.
DIAMOND = 2.42

#: Germanium, for infrared, is the last at 4.0: beyond this an index is a typing error.
HIGHEST_INDEX = 4.1

#: Anything above this is a liquid or a solid, not a gas (xenon at 10 bar: 1.007).
THINNEST_LIQUID = 1.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Layers:
    """Plane-parallel media, from the camera to the object.

    Parameters
    ----------
    indices : sequence of float
        Refractive index of each medium, the camera's first, the object's last; at least two. Any
        order: a camera in water may look into air.
    thicknesses : sequence of float
        Thickness of the media between the first and the last. [m, or the unit of all lengths]

    Raises
    ------
    InputError
        If an index is below 1, a thickness negative, or their numbers do not match.

    Examples
    --------
    A camera in air before an aquarium with 10 mm of glass:

    >>> layers = Layers(indices=(1.0, 1.5, 1.337), thicknesses=(0.01,))
    >>> [float(h) for h in layers.heights(z0=0.5, zp=0.2)]
    [0.5, 0.01, 0.2]
    """

    indices: tuple[float, ...]
    thicknesses: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        indices = checked_indices(self.indices)
        thicknesses = _numbers(self.thicknesses, "thicknesses")
        object.__setattr__(self, "indices", indices)
        object.__setattr__(self, "thicknesses", thicknesses)
        if len(indices) < 2:
            raise InputError(remark("layers.few_media", count=len(indices)))
        for place, thickness in enumerate(thicknesses, start=1):
            if not (np.isfinite(thickness) and thickness >= 0):
                raise InputError(remark("layers.negative", place=place, thickness=thickness))
        if len(thicknesses) != len(indices) - 2:
            raise InputError(
                f"thicknesses: {len(indices)} media have {len(indices) - 2} layers between the "
                f"first and the last, found {len(thicknesses)} thicknesses. The camera's and the "
                "object's medium have none: their heights are z0 and zp."
            )

    @classmethod
    def from_dict(cls, value: Mapping[str, Any], *, where: str = "layers") -> Self:
        """Return layers from the object that JSON files hold.

        Parameters
        ----------
        value : mapping
            ``{"indices": [1.0, 1.5, 1.337], "thicknesses": [0.01]}``.
        where : str
            Place in the file, for the message.

        Raises
        ------
        InputError
            If a key is missing or a value impossible; the message starts with ``where``.
        """
        if not isinstance(value, Mapping) or "indices" not in value:
            raise InputError(
                f'{where}: expected {{"indices": [1.0, 1.5, 1.337], "thicknesses": [0.01]}}.'
            )
        with located(where):
            return cls(indices=value["indices"], thicknesses=value.get("thicknesses", ()))

    def as_dict(self) -> dict[str, list[float]]:
        """Return the object that JSON files hold."""
        return {"indices": list(self.indices), "thicknesses": list(self.thicknesses)}

    @property
    def thickness(self) -> float:
        """Thickness of everything between the first and the last medium, t. [m]"""
        return sum(self.thicknesses)

    def heights(self, *, z0: ArrayLike, zp: ArrayLike) -> tuple[FloatArray, ...]:
        """Return the heights of all layers from the camera to points: z0, thicknesses, zp.

        Parameters
        ----------
        z0 : array_like, shape (...)
            Camera centre to the first interface, not negative. [m]
        zp : array_like, shape (...)
            Depth of the points below the last interface, not negative. [m]

        Raises
        ------
        GeometryError
            If a camera or point is on the wrong side of its interface.
        """
        z0, zp = as_floats(z0, "z0"), as_floats(zp, "zp")
        _refuse_negative(
            z0,
            "z0: {what} on the object's side of the first interface ({value:g}). z0 is the "
            "distance from the camera centre to the first interface, positive.",
            "the camera is",
        )
        _refuse_negative(
            zp,
            "zp: {what} on the camera's side of the last interface ({value:g}). zp is the depth "
            "below it, positive; dry points are not refracted, leave them out.",
            "the point is",
        )
        return (z0, *(np.asarray(t) for t in self.thicknesses), zp)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What looks like a slip though it is possible; empty when nothing does."""
        doubts = []
        outer = max(self.indices[0], self.indices[-1])
        for place, index in enumerate(self.indices[1:-1], start=2):
            if THINNEST_LIQUID < index < outer:
                doubts.append(remark("layers.swapped", place=place, index=index, liquid=outer))
        for place, index in enumerate(self.indices, start=1):
            if index > DIAMOND:
                about = {"place": place, "index": index, "most": DIAMOND}
                doubts.append(remark("layers.beyond_diamond", **about))
        if len(set(self.indices)) == 1:
            doubts.append(remark("layers.all_alike"))
        return tuple(doubts)

    def remarks_about(self, *, z0: ArrayLike, zp: ArrayLike) -> tuple[str, ...]:
        """Return `remarks` and what looks like millimetres mixed with metres.

        Parameters
        ----------
        z0, zp : array_like
            As in `heights`. [m]
        """
        distance = float(np.nanmax(as_floats(z0, "z0"), initial=0.0))
        distance += float(np.nanmax(as_floats(zp, "zp"), initial=0.0))
        doubts = list(self.remarks)
        thick = max(self.thicknesses, default=0.0)
        if thick > 10 * distance > 0:
            doubts.append(remark("layers.thick_in_mm", thick=thick, distance=distance))
        if 0 < thick < 2e-6 * distance:
            about = {"thick": thick, "distance": distance, "share": distance / thick}
            doubts.append(remark("layers.thick_in_m", **about))
        return tuple(doubts)


def checked_indices(value: Sequence[float]) -> tuple[float, ...]:
    """Return the refractive indices of media in their order, as floats.

    Raises
    ------
    InputError
        If one is impossible; see `checked_index`.
    """
    return tuple(
        checked_index(n, f"indices: medium {place} has refractive index {n:g}")
        for place, n in enumerate(_numbers(value, "indices"), start=1)
    )


def checked_index(value: float, complaint: str) -> float:
    """Return a refractive index that a transparent medium may have.

    Parameters
    ----------
    value : float
        The index.
    complaint : str
        What the message begins with.

    Raises
    ------
    InputError
        If it is below 1 (nothing is optically thinner than vacuum) or beyond every material.
    """
    if not 1.0 <= value <= HIGHEST_INDEX:
        raise InputError(
            f"{complaint}; possible are 1 (vacuum, air) to {HIGHEST_INDEX:g} (germanium). Water "
            "has about 1.33 to 1.35 (`multimedia index` computes it), glass 1.45 to 1.9. Is a "
            "decimal point missing (1.337, not 13.37)?"
        )
    return value


def _numbers(value: Sequence[float], name: str) -> tuple[float, ...]:
    """Return a sequence, or a single number, as a tuple of floats."""
    array = np.atleast_1d(as_floats(value, name))
    if array.ndim != 1:
        raise InputError(f"{name}: expected a plain list of numbers.")
    return tuple(array.tolist())


def _refuse_negative(values: FloatArray, message: str, what: str) -> None:
    """Raise GeometryError when any value is negative, naming the first."""
    if not (values < 0).any():
        return
    wrong = np.flatnonzero(values < 0)
    if values.size > 1:
        what = f"{len(wrong)} of {values.size} values (first: number {wrong[0] + 1}) are"
    raise GeometryError(message.format(what=what, value=values.flat[wrong[0]]))
