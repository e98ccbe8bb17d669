"""Points of one photo found in the other: features, patches, targets, suggestions, corners.

What is found is `matches`. Detail is found by `features` and brought to 0.05 px by `patches`,
survey marks by `targets`; `matching` joins both for a pair, along its radial lines,
`homologous_points` offers that as `bifocal.match`, and `set_matching` follows the points into the
other photos of a set. For a person who picks: `corners` and `snapping` centre a pick,
`suggestions` offer its partner, `pick_evidence` holds picks against the photos. `tuning` keeps
the numbers of all of them.
"""

from photocore.public_names import public_names

__all__ = public_names(__name__, __file__)
