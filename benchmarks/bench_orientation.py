"""Orientation of real pairs from random control, beside the geometry they were published with.

    python benchmarks/bench_orientation.py --draws 30 church_1 church_2

Each draw takes six wall points and three points off the wall of a pair in $BIFOCAL_DATA as control,
with nothing known of the lens, and solves all other reference points (4 m and more from the near
nadir) with the pair found and with the published one. The run fails if an alignment fails.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from bifocal import Control, Interior, Pair, Photo, SiteMeasures
from bifocal.orientation.photo_alignment import align
from photocore.errors import PhotogrammetryError
from photocore.images import read_grey

#: Points this near to the plane serve as wall points, those this far off it as others. [m]
ON_WALL, OFF_WALL = 0.015, 0.3
#: Precision of the reference. [m]
SIGMA_REFERENCE = 0.003


def sigma_of_picks(table: np.ndarray) -> float:
    """Return the picks' precision by what the reference's adjustment of all images left. [px]

    A point of n images has 2 n observations and 3 unknowns; both photos' residuals are lengths of
    two coordinates each.
    """
    count = 2.0 * table["n_images"]
    square = (table["res_far_px"] ** 2 + table["res_near_px"] ** 2) / 4
    return float(np.sqrt(np.mean(square * count / (count - 3))))


class Comparison(NamedTuple):
    """A pair beside the published one.

    Attributes
    ----------
    median, published_median : float
        Median error of relief. [m]
    rms, published_rms : float
        Root mean square error of relief. [m]
    below : float
        Share of errors below two sigma.
    apart : float
        The same against the points as the other images alone give them, of which these picks are
        no part.
    """

    median: float
    published_median: float
    rms: float
    published_rms: float
    below: float
    apart: float


class RealPair:
    """Photos, published geometry and reference points of a pair."""

    def __init__(self, folder: Path) -> None:
        geometry = json.loads((folder / "geometry.json").read_text())
        table = np.genfromtxt(folder / "points.csv", delimiter=",", names=True)
        self.name = folder.name
        self.sigma_pick = sigma_of_picks(table)
        self.apart = np.column_stack([table["relief_indep_m"], table["sindep_m"]])
        self.xyz = np.column_stack([table["X_m"], table["Y_m"], table["relief_m"]])
        self.far = np.column_stack([table["x_far_px"], table["y_far_px"]])
        self.near = np.column_stack([table["x_near_px"], table["y_near_px"]])
        photos = [
            Photo(
                plane_from_pixel=np.linalg.inv(np.array(geometry[key]["H_wall_to_pixel"])),
                nadir=geometry[key]["nadir_wall_m"],
                distance=geometry[key]["height_over_plane_m"],
            )
            for key in ("far", "near")
        ]
        self.truth = Pair(image1=photos[0], image2=photos[1])
        self.greys = [read_grey(folder / f"{key}.jpg") for key in ("far", "near")]

    def control(self, rng: np.random.Generator, wall: int = 6, off: int = 3) -> np.ndarray:
        """Return the numbers of random control points."""
        on = np.flatnonzero(np.abs(self.xyz[:, 2]) < ON_WALL)
        others = np.flatnonzero(np.abs(self.xyz[:, 2]) > OFF_WALL)
        return np.concatenate([rng.choice(on, wall, False), rng.choice(others, off, False)])

    def compared(self, chosen: np.ndarray) -> Comparison:
        """Return how good the pair found with ``chosen`` as control is at all other points."""
        control = Control(
            ids=tuple(str(number) for number in chosen),
            xyz=self.xyz[chosen],
            sigma=np.full((len(chosen), 3), 0.003),
            pixels1=self.far[chosen],
            pixels2=self.near[chosen],
        )
        sizes = [(grey.shape[1], grey.shape[0]) for grey in self.greys]
        interiors = Interior.unknown(sizes[0]), Interior.unknown(sizes[1])
        found = align(
            self.greys[0], self.greys[1], interiors=interiors, control=control, site=SiteMeasures()
        )
        away = np.hypot(*(self.xyz[:, :2] - self.truth.image2.nadir).T) > 4
        rest = np.setdiff1d(np.flatnonzero(away), chosen)
        picks = self.far[rest], self.near[rest]
        solved = found.pair.intersect(*picks, sigma_px=self.sigma_pick)
        error = solved.xyz[:, 2] - self.xyz[rest, 2]
        best = self.truth.intersect(*picks).xyz[:, 2] - self.xyz[rest, 2]
        sigma = np.hypot(solved.sigma[:, 2], SIGMA_REFERENCE)
        relief, own = self.apart[rest].T
        apart = np.abs(solved.xyz[:, 2] - relief) / np.hypot(solved.sigma[:, 2], own)
        return Comparison(
            float(np.median(np.abs(error))),
            float(np.median(np.abs(best))),
            float(np.sqrt(np.mean(error**2))),
            float(np.sqrt(np.mean(best**2))),
            float((np.abs(error) < 2 * sigma).mean()),
            float((apart[np.isfinite(apart)] < 2).mean()),
        )

    def datum_alone(self, chosen: np.ndarray) -> float:
        """Return the published pair's error of relief in the frame of ``chosen``, over its own.

        The published cameras' own points, turned, shifted and scaled onto the control points by
        least squares: what a perfect relative orientation would reach from so few points.
        """
        solved = self.truth.intersect(self.far, self.near, sigma_px=self.sigma_pick)
        sigma = np.hypot(solved.sigma[chosen], SIGMA_REFERENCE)
        middle = solved.xyz[chosen].mean(axis=0)

        def moved(unknowns: np.ndarray, xyz: np.ndarray) -> np.ndarray:
            turned = Rotation.from_rotvec(unknowns[:3]).apply(xyz - middle)
            return np.exp(unknowns[6]) * turned + unknowns[3:6] + middle

        def misfit(unknowns: np.ndarray) -> np.ndarray:
            return ((moved(unknowns, solved.xyz[chosen]) - self.xyz[chosen]) / sigma).ravel()

        unknowns = least_squares(misfit, np.zeros(7)).x
        away = np.hypot(*(self.xyz[:, :2] - self.truth.image2.nadir).T) > 4
        rest = np.setdiff1d(np.flatnonzero(away), chosen)
        error = moved(unknowns, solved.xyz[rest])[:, 2] - self.xyz[rest, 2]
        best = solved.xyz[rest, 2] - self.xyz[rest, 2]
        return float(np.median(np.abs(error)) / np.median(np.abs(best)))


def main() -> None:
    """Run the draws and print what they give."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=5)
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("pairs", nargs="*", default=["church_1", "church_2"])
    given = parser.parse_args()
    failed = 0
    for name in given.pairs:
        pair = RealPair(Path(os.environ["BIFOCAL_DATA"]) / "facade_pairs" / name)
        rng = np.random.default_rng(given.seed)
        found, datum, spent = [], [], []
        for number in range(given.draws):
            chosen = pair.control(rng)
            start = time.process_time()
            try:
                one = pair.compared(chosen)
            except PhotogrammetryError as trouble:
                failed += 1
                print(f"{name} {number}: FAILED: {trouble}")
                continue
            spent.append(time.process_time() - start)
            found.append(one)
            datum.append(pair.datum_alone(chosen))
            print(
                f"{name} {number}: {1000 * one.median:.1f} mm, published pair "
                f"{1000 * one.published_median:.1f} mm, ratio "
                f"{one.median / one.published_median:.2f} (published in this frame "
                f"{datum[-1]:.2f}), of RMS {one.rms / one.published_rms:.2f}, "
                f"below 2 sigma {100 * one.below:.0f} %, {spent[-1]:.1f} s CPU",
                flush=True,
            )
        median, published, rms, published_rms, below, apart = np.array(found).T
        print(f"{name}: {len(found)} of {given.draws} draws, {np.median(spent):.1f} s CPU each")
        for what, ratio in (("median", median / published), ("RMS", rms / published_rms)):
            print(
                f"{name}: ratio of {what} error: median {np.median(ratio):.2f}, 90th percentile "
                f"{np.percentile(ratio, 90):.2f}, worst {ratio.max():.2f}"
            )
        print(
            f"{name}: below 2 sigma {100 * below.mean():.1f} % ({100 * below.min():.1f} to "
            f"{100 * below.max():.1f}), of other images' points {100 * apart.mean():.1f} %, picks "
            f"of {pair.sigma_pick:.2f} px; published pair in the frame of the same control: "
            f"median {np.median(datum):.2f}, worst {max(datum):.2f}"
        )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
