"""Dense relief from a bifocal pair of photos.

`workflow` reads and writes, `relief_files` its files. `dense_matching` puts both photos on one
`frame`, brings them to one `exposure`, finds a first relief (`seed`) and refines it by `flow` (when
fast by `flow_refinement` too), at half the resolution where that is unsure (`coarse_level`), and
checks the `registration`. What is then done to the measurement is the list of `stages`: `evidence`,
`occluded_regions`, `second_hypothesis` (`plane_sweep`, `semi_global`), `edges`, `smoothing`, plane
patches on plain walls (`segments`, `plane_patches`, `levels`), `sides` and `between_edges` for what
nothing validates, `forward_projection` to the map, `map_completion`, `occluding_edges`, `snapping`;
`information` adds what noise leaves to sigma, `orientation_sigma` what cameras are worth.
Sets of photos: `set_relief` measures pairs (`turned_plane` where a base is parallel to the wall)
and `fusion` joins them by `photo_evidence`. Each stage's tuned numbers stand at its head.
"""

from bifocal.relief_maps.dense_matching import DenseRelief
from bifocal.relief_maps.set_relief import dense_relief

__all__ = ["DenseRelief", "dense_relief"]
