"""Synthetic façades with exact truth, ray cast: for the demo, tests and benchmarks."""

from bifocal.demo.scene.cameras import CameraPair, SceneCamera, SetupErrors, bifocal_cameras
from bifocal.demo.scene.facade import POOR, RICH, Palette, demo_scene, facade
from bifocal.demo.scene.rendering import Exposure, NamedPoint, Rendering, render
from bifocal.demo.scene.shapes import Material, Scene, Target

__all__ = [
    "CameraPair",
    "Exposure",
    "Material",
    "NamedPoint",
    "POOR",
    "Palette",
    "RICH",
    "Rendering",
    "Scene",
    "SceneCamera",
    "SetupErrors",
    "Target",
    "bifocal_cameras",
    "demo_scene",
    "facade",
    "render",
]
