"""Synthetic façades with exact truth, ray cast: for tests, benchmarks and the demo's sample."""

from tests.scenes.cameras import CameraPair, SceneCamera, SetupErrors, bifocal_cameras
from tests.scenes.facade import POOR, RICH, Palette, demo_scene, facade
from tests.scenes.rendering import Exposure, NamedPoint, Rendering, render
from tests.scenes.shapes import Material, Scene, Target

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
