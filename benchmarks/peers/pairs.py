"""Orientation of a pair without control, beside OpenCV's and COLMAP's two-view geometry."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.peers.comparison import Comparison, Task, Tool
from benchmarks.peers.images import width_of
from bifocal import Interior, SiteMeasures, align
from photocore.camera.similarity import fit_similarity
from tests.scenes import SetupErrors, bifocal_cameras, facade, render


def prepare(pixels: int, folder: Path) -> None:
    width = width_of(pixels)
    pixel = 0.00369 * 3072 / width
    rng = np.random.default_rng(62)
    cameras = bifocal_cameras(
        size=(width, width * 2 // 3), pixel=pixel, errors=SetupErrors(), rng=rng
    )
    shot = render(facade(seed=62, texel=pixel / 1.5), cameras, rng=rng)
    points = [point for point in (*shot.targets, *shot.corners) if point.seen]
    np.savez(
        folder / "pair.npz", image1=shot.image1, image2=shot.image2,
        matrix1=cameras.far.matrix, matrix2=cameras.near.matrix,
        distances=[cameras.far.centre[2], cameras.near.centre[2]],
        xyz=[point.xyz for point in points],
        pixels=[[point.pixel1, point.pixel2] for point in points],
    )  # fmt: skip


class Shot:
    """Photos, their camera matrices, and points whose places are known."""

    def __init__(self, folder: Path) -> None:
        with np.load(folder / "pair.npz") as data:
            self.images = data["image1"], data["image2"]
            self.matrices = data["matrix1"], data["matrix2"]
            self.distances = data["distances"]
            self.xyz, self.pixels = data["xyz"], data["pixels"].transpose(1, 0, 2)

    def error(self, found: np.ndarray) -> float:
        """Return the RMS distance from the truth after the similarity that fits best. [mm]"""
        good = np.isfinite(found).all(axis=1)
        if good.sum() < len(good) * 0.9:
            return float("inf")
        moved = fit_similarity(found[good], self.xyz[good])(found[good])
        away = np.linalg.norm(moved - self.xyz[good], axis=1)
        return float(1000 * np.sqrt((away**2).mean()))

    def matches(self) -> tuple[np.ndarray, np.ndarray]:
        """Return matched features of both photos: SIFT, ratio test, as a script takes them."""
        sift = cv2.SIFT.create(8000)
        points, descriptors = [], []
        for image in self.images:
            keys, found = sift.detectAndCompute(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), None)
            points.append(np.array([key.pt for key in keys]))
            descriptors.append(found)
        pairs = cv2.BFMatcher().knnMatch(*descriptors, k=2)
        kept = [a for a, b in pairs if a.distance < 0.8 * b.distance]
        first, second = [one.queryIdx for one in kept], [one.trainIdx for one in kept]
        return points[0][first], points[1][second]

    def rays(self, pixels: np.ndarray, image: int) -> np.ndarray:
        """Return pixels in the plane at unit distance."""
        flat = np.column_stack([pixels, np.ones(len(pixels))])
        return np.asarray((flat @ np.linalg.inv(self.matrices[image]).T)[:, :2])

    def triangulated(self, rotation: np.ndarray, shift: np.ndarray) -> np.ndarray:
        """Return the points in the frame of the far camera, in bases."""
        views = np.eye(3, 4), np.column_stack([rotation, shift])
        rays = [self.rays(self.pixels[k], k).T for k in (0, 1)]
        whole = cv2.triangulatePoints(*views, *rays)
        return np.asarray((whole[:3] / whole[3]).T)


def _ours(_pixels: int, folder: Path) -> Task:
    shot = Shot(folder)
    height, width = shot.images[0].shape[:2]
    interiors = tuple(
        Interior(
            focal=matrix[0, 0], sigma_focal=1e-4, centre=matrix[:2, 2], sigma_centre=0.1,
            image_size=(width, height), source="known",
        )
        for matrix in shot.matrices
    )  # fmt: skip
    site = SiteMeasures(distance1=shot.distances[0], distance2=shot.distances[1])
    return Task(
        lambda: align(*shot.images, interiors=interiors, site=site),  # type: ignore[arg-type]
        lambda found: shot.error(found.pair.intersect(*shot.pixels).xyz),
    )


def _opencv(_pixels: int, folder: Path) -> Task:
    shot = Shot(folder)

    def work() -> tuple[np.ndarray, np.ndarray]:
        rays = [shot.rays(points, k) for k, points in enumerate(shot.matches())]
        limit = 1.0 / shot.matrices[0][0, 0]
        essential, good = cv2.findEssentialMat(
            *rays, np.eye(3), method=cv2.USAC_MAGSAC, prob=0.999, threshold=limit
        )
        _, rotation, shift, _ = cv2.recoverPose(essential, *rays, np.eye(3), mask=good)
        return rotation, shift

    return Task(work, lambda found: shot.error(shot.triangulated(*found)))


def _colmap(_pixels: int, folder: Path) -> Task:
    import pycolmap

    shot = Shot(folder)
    height, width = shot.images[0].shape[:2]
    cameras = [
        pycolmap.Camera(
            model="PINHOLE", width=width, height=height,
            # COLMAP's pixels begin at the corner of the first, not in its middle.
            params=[m[0, 0], m[1, 1], m[0, 2] + 0.5, m[1, 2] + 0.5],
        )
        for m in shot.matrices
    ]  # fmt: skip

    def work() -> Any:
        first, second = (points + 0.5 for points in shot.matches())
        rows = np.arange(len(first), dtype=np.uint32)
        options = pycolmap.TwoViewGeometryOptions(compute_relative_pose=True)
        options.ransac.random_seed = 1
        options.ransac.max_error = 1.0
        return pycolmap.estimate_calibrated_two_view_geometry(
            cameras[0], first, cameras[1], second, np.column_stack([rows, rows]), options
        )

    def error(found: Any) -> float:
        pose = found.cam2_from_cam1
        if pose is None:
            return float("inf")
        return shot.error(shot.triangulated(pose.rotation.matrix(), pose.translation))

    return Task(work, error)


COMPARISONS = {
    "orientation": Comparison(
        title="Orientation of a pair, cameras known, no control",
        data="A rendered façade (seed 62), 35/19, usual set-up errors. RMS of all targets and "
        "corners after the best similarity transformation, exact picks. Ours is given both "
        "distances, to 2 cm.",
        item="pixel", error="RMS of points [mm]", sizes=(1_500_000, 6_000_000),
        tools={
            "bifocal align": Tool(_ours, "bifocal-relief"),
            "OpenCV recoverPose, MAGSAC": Tool(_opencv, "opencv-python-headless"),
            "COLMAP two-view geometry": Tool(_colmap, "pycolmap"),
        },
        prepare=prepare,
    ),
}  # fmt: skip
