"""What may be said of a pair, by groups of ``options.toml``.

An option there is at once the command's, a key of survey files and of `bifocal facade`, and what
the step behind is given by its name.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from photocore.options import options_of

#: Every option of a pair, by the key that survey files know it by.
OF_PAIR = options_of("bifocal", "of_pair")
#: Files of a pair besides its photos.
FILES = tuple(name for name, option in OF_PAIR.items() if option.is_file)

#: How a pair is set up, its relief measured, its orthophoto made and drawn, all pairs adjusted,
#: and what the report says of the project.
SET_UP, MAP, PICTURE, DRAWING, JOINT, PROJECT = (
    tuple(options_of("bifocal", group))
    for group in ("set_up", "map", "picture", "drawing", "joint", "project")
)
#: What each step of a pair asks for.
OF_STEP = {
    "align": ("control", "columns", *SET_UP),
    "relief": ("faces", *MAP, "cog"),
    "points": ("control", "check", "columns", "unit", "language"),
    "ortho": ("faces", *PICTURE, "gsd", "cog"),
    "drawing": ("control", "check", "columns", "faces", *DRAWING, *PICTURE, "language", "cog"),
    "view": ("language",),
    "report": ("control", "check", "columns", "language", "unit", "scale", *PROJECT),
}


def typed(options: Mapping[str, Any], *, in_file: bool = False) -> Iterator[str]:
    """Yield options as they are typed on the command line, or as keys of a survey file."""
    for name, value in options.items():
        if name in OF_PAIR:
            yield from OF_PAIR[name].typed_as(value, in_file=in_file)


def defaults_of(step: str, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values a step takes where nothing was said; what depends on the photos is none.

    Examples
    --------
    >>> defaults_of("relief", {}), defaults_of("relief", {"quality": "fast"})
    ({'quality': 'standard', 'cog': False}, {'cog': False})
    """
    unsaid = {name: OF_PAIR[name].fixed_default for name in OF_STEP.get(step, ())}
    return {
        name: value for name, value in unsaid.items() if value is not None and name not in options
    }
