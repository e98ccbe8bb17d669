"""Refraction: Snell's law, the radial shift and its derivatives, refractive indices.

`layers` are the media, `water` and `materials` their indices, `snell` the law. `shift` is the
radial shift exactly: its root is found by `tangent`, its derivatives are `shift_slopes`;
`shifting` applies it to a camera and points. Beside it the other roads to the same number:
`iteration` as the papers print it, `shift_table` as they tabulate it, `unrolled` as the
workbook's cells compute it.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
