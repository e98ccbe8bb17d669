"""What may be said of a pair, by groups of ``options.toml``.

An option there is at once the command's, a key of survey files and of `bifocal facade`, and what
the step behind is given by its name.
"""

from __future__ import annotations

from photocore.options import options_of

#: Every option of a pair, by the key that survey files know it by.
OF_PAIR = options_of("bifocal", "of_pair")
#: Files of a pair besides its photos.
FILES = tuple(name for name, option in OF_PAIR.items() if option.is_file)

#: How a pair is set up, its relief measured, its orthophoto made and drawn, all pairs adjusted.
SET_UP, MAP, PICTURE, DRAWING, JOINT = (
    tuple(options_of("bifocal", group))
    for group in ("set_up", "map", "picture", "drawing", "joint")
)
