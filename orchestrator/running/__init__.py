"""Scenes opened and run whole, in this process: the points of a sweep one after the other, without workers."""

from __future__ import annotations

from vibroimpact.orchestrator.running.opening import open_scene
from vibroimpact.orchestrator.running.whole import run_in_memory, run_scene

__all__ = ["open_scene", "run_in_memory", "run_scene"]
