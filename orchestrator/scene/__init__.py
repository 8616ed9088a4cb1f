"""Scene files: what is simulated, recorded and swept; read, checked, frozen. `load_scene` is the way in."""

from __future__ import annotations

from vibroimpact.orchestrator.scene.scene import Scene, load_scene, parse_scene

__all__ = [
    "Scene",
    "load_scene",
    "parse_scene",
]
