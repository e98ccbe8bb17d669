"""Dense relief as a list of stages: from flow between the photos to the finished map.

`STAGES` is all that is done, in order. A stage takes quantities by name and gives others, or the
same ones improved; ``benchmarks/relief_ablation.py`` leaves out one at a time and tells what each
is worth (docs/dense-relief.md).

===========  =====================================================================================
quantity     meaning
===========  =====================================================================================
frame        both photos on one grid; half: at half the resolution, for plain walls, else None
matched      flow between the photos, with its errors
distance     d2 [m]
backing      pixels that half the resolution validates, or None
grid         of the relief map
relief       of the pixels of photo 1 [m]
sigma        its standard deviation [m]
typical      precision of matching, typical of the frame [px]
valid        pixels matched there and back, on the radius, precisely enough
support      pixels to be believed
swept        pixels whose relief a sweep found, for flow could not
side_face    pixels that see the side face of a step
misfit       how badly the photos fit at the relief that was measured [grey levels]
unpatched    relief before plane patches [m]
measured     pixels that count as measured
source       relief, sigma and quality of the pixels of photo 1
behind       pixels that were given the surface behind what hides them
bands        the map: relief, sigma, quality
===========  =====================================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from bifocal.model.grid import Grid
from bifocal.model.relief_map import Quality
from bifocal.relief_maps import (
    between_edges,
    edges,
    evidence,
    flow,
    forward_projection,
    information,
    levels,
    map_completion,
    occluded_regions,
    occluding_edges,
    plane_patches,
    second_hypothesis,
    seed,
    sides,
    smoothing,
    snapping,
)
from bifocal.relief_maps.forward_projection import PROJECTION, MapBands
from bifocal.relief_maps.frame import Frame
from photocore.arrays import BoolArray, Float32Array


class Stage(NamedTuple):
    """A step of dense relief.

    Attributes
    ----------
    name : str
    run : callable
        Takes quantities by their names and returns those given, in order.
    takes, gives : str
        Names of quantities, with blanks between.
    needed : bool
        Whether there is no map without it.
    """

    name: str
    run: Callable[..., Any]
    takes: str
    gives: str
    needed: bool = False


def relief_map(
    frame: Frame,
    matched: flow.Measurement,
    relief_range: tuple[float, float] | None,
    grid: Grid,
    *,
    backing: BoolArray | None = None,
    half: Frame | None = None,
) -> MapBands:
    """Return the relief map of a measurement.

    Parameters
    ----------
    frame : Frame
    matched : Measurement
        Flow between the photos.
    relief_range : tuple of float, optional
        Least and greatest relief to expect. [m]
    grid : Grid
        Of the map.
    backing : ndarray of bool, optional
        Pixels whose relief another level validates: to be believed, if not called measured.
    half : Frame, optional
        At half the resolution, for plain walls: there relief is put on plane patches.
    """
    distance = frame.distances[1]
    values: dict[str, Any] = {
        "frame": frame, "matched": matched, "grid": grid, "backing": backing, "half": half,
        "distance": distance, "relief_range": relief_range or seed.usual_range(distance),
        "side_face": np.False_, "swept": np.zeros(matched.r.shape, bool), "behind": np.False_,
        "misfit": np.zeros_like(matched.r), "unpatched": np.float32(np.nan),
    }  # fmt: skip
    for stage in STAGES:
        results = stage.run(**{name: values[name] for name in stage.takes.split()})
        names = stage.gives.split()
        values.update(zip(names, results if len(names) > 1 else (results,), strict=True))
    return values["bands"]


def _believed(
    frame: Frame, matched: flow.Measurement, relief_range: tuple[float, float],
    backing: BoolArray | None,
) -> tuple[Float32Array, Float32Array, BoolArray, BoolArray, float]:  # fmt: skip
    """Return relief within the range, its sigma, what is valid, support, typical error."""
    low, high = relief_range
    margin = 0.1 * (high - low)
    relief = np.clip(np.nan_to_num(matched.r), low - margin, high + margin).astype(np.float32)
    sigma = flow.sigma_of_relief(frame, relief, matched.sigma_px)
    valid = evidence.validated(matched.across, matched.loop, sigma, frame.distances[1])
    support = valid if backing is None else valid | backing
    return relief, sigma, valid, support, float(np.median(matched.sigma_px[::8, ::8]))


def _of_photo_1(
    frame: Frame, relief: Float32Array, matched: flow.Measurement, measured: BoolArray
) -> MapBands:
    """Return relief, sigma and quality of the pixels of photo 1."""
    quality = np.where(measured, Quality.MEASURED, Quality.INTERPOLATED).astype(np.uint8)
    return MapBands(relief, flow.sigma_of_relief(frame, relief, matched.sigma_px), quality)


def _to_plane(
    frame: Frame, grid: Grid, source: MapBands, valid: BoolArray, behind: BoolArray,
    side_face: BoolArray,
) -> MapBands:  # fmt: skip
    """Return the pixels of photo 1 on the map, but for ramps over strips that nobody sees."""
    steep = forward_projection.stretch(frame, source.r) > PROJECTION.stretch
    usable = flow.is_inside(frame, source.r) & ~(steep & ~behind & ~valid) & ~side_face
    return forward_projection.to_plane(frame, source, usable, grid)


# fmt: off
STAGES = (
    # In photo 1.
    Stage("second hypothesis", second_hypothesis.with_swept,
          "frame matched", "matched swept"),
    Stage("evidence", _believed,
          "frame matched relief_range backing", "relief sigma valid support typical", needed=True),
    Stage("single pixels not believed", evidence.supported,
          "support", "support"),
    Stage("unsupported relief held back", evidence.held_back,
          "relief support distance", "relief"),
    Stage("occluded regions", occluded_regions.put_behind,
          "frame relief matched support", "relief"),
    Stage("side faces left out", forward_projection.side_faces,
          "frame relief swept", "side_face"),
    Stage("steps sharpened", edges.sharpen,
          "frame relief swept typical", "relief misfit"),
    Stage("noise taken out", smoothing.without_noise,
          "frame relief matched typical half", "relief"),
    Stage("plane patches", plane_patches.on_plain_walls,
          "frame relief half", "relief unpatched"),
    Stage("sides of steps", sides.settled,
          "frame relief support swept", "relief"),
    Stage("smoothed between edges", between_edges.smoothed,
          "frame relief support swept", "relief"),
    Stage("sigma", lambda frame, relief, matched, valid: (
              flow.sigma_of_relief(frame, relief, matched.sigma_px), valid),
          "frame relief matched valid", "sigma measured", needed=True),
    Stage("loops pardoned", evidence.with_pardoned,
          "frame matched sigma misfit measured backing", "measured"),
    Stage("falling relief doubted", evidence.without_falling,
          "frame relief misfit typical swept measured", "measured"),
    Stage("small finds doubted", second_hypothesis.without_small,
          "swept measured", "measured"),
    Stage("relief off its patch doubted", evidence.without_unpatched,
          "relief unpatched sigma measured", "measured"),
    Stage("pixels of photo 1", _of_photo_1,
          "frame relief matched measured", "source", needed=True),
    Stage("occluded in photo 2", forward_projection.put_behind,
          "frame source valid support", "source behind"),
    # On the map.
    Stage("forward projection", _to_plane,
          "frame grid source valid behind side_face", "bands", needed=True),
    Stage("strips filled from behind", map_completion.filled_from_behind,
          "frame bands grid", "bands"),
    Stage("holes filled", map_completion.filled,
          "frame bands grid", "bands"),
    Stage("steps straightened", smoothing.straightened,
          "bands", "bands"),
    Stage("occluding edges", occluding_edges.drawn_in,
          "frame bands grid", "bands"),
    Stage("noise of the map", map_completion.without_noise,
          "frame bands grid matched", "bands"),
    Stage("levels of plain walls", levels.of_plain_walls,
          "bands matched", "bands"),
    Stage("steps at edges of photo 1", snapping.snapped,
          "frame bands grid", "bands"),
    Stage("hidden from camera 2", map_completion.guarded,
          "frame bands grid", "bands"),
    Stage("sigma at steps", map_completion.with_sigma_of_steps,
          "frame bands grid", "bands"),
    Stage("outside forgotten", forward_projection.forget_outside,
          "bands matched", "bands"),
    Stage("outline tidied", map_completion.tidied,
          "bands", "bands"),
    Stage("sigma of noise", information.with_sigma_of_noise,
          "frame source valid bands grid", "bands"),
)
# fmt: on
