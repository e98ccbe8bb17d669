"""Option types shared by the commands of both packages."""

from __future__ import annotations

import click


class Size(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """Two numbers as WIDTHxHEIGHT; decimal commas are understood."""

    name = "WxH"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, float]:
        """Return width and height."""
        if isinstance(value, tuple):
            return value
        parts = str(value).lower().replace("*", "x").replace("×", "x").replace(",", ".").split("x")
        try:
            width, height = (float(part) for part in parts)
        except ValueError:
            self.fail(f"{value!r} is not WIDTHxHEIGHT, e.g. 22.7x15.1", param, ctx)
        return width, height


class Numbers(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """So many numbers with commas between them; decimal points.

    Parameters
    ----------
    count : int, optional
        How many; any number of them when None.
    """

    def __init__(self, count: int | None = None) -> None:
        self.count, self.name = count, "numbers"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        """Return the numbers."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(float(part) for part in str(value).replace(";", ",").split(","))
        except ValueError:
            self.fail(f"{value!r} is not a list of numbers with commas between them", param, ctx)
        if self.count is not None and len(numbers) != self.count:
            self.fail(f"{value!r} is not {self.count} numbers with commas between them", param, ctx)
        return numbers


class Scale(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A scale 1:N."""

    name = "1:N"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return N."""
        text = str(value).strip().removeprefix("1:")
        try:
            return float(text)
        except ValueError:
            self.fail(f"{value!r} is not a scale, e.g. 1:500", param, ctx)


class Length(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A length in metres, or with its unit: 0.005, 5mm, 0.5 cm."""

    name = "M"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Return metres."""
        if isinstance(value, float):
            return value
        text = str(value).strip().lower().replace(",", ".")
        for unit, metres in (("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)):
            if text.endswith(unit):
                text, factor = text.removesuffix(unit), metres
                break
        else:
            factor = 1.0
        try:
            number = float(text)
        except ValueError:
            self.fail(f"{value!r} is not a length, e.g. 0.005 or 5mm", param, ctx)
        # 5 * 1e-3 is 0.005 exactly, 3.69 * 1e-3 is not 0.00369: divide instead.
        return number / (1 / factor) if factor < 1 else number
