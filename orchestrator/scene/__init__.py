"""Scene files: the simulated system, its record and its sweep, read, checked and frozen; start with `load_scene`."""

from __future__ import annotations

from vibroimpact.orchestrator.scene.scene import Scene, load_scene, parse_scene

__all__ = [
    "Scene",
    "load_scene",
    "parse_scene",
]
