"""The preparation of a scene before a command runs it, imported only for scenes with a tolerance.

Studies import half of scipy; a scene without a tolerance starts without that import.
"""

from __future__ import annotations

from vibroimpact.fmus.terminal import note
from vibroimpact.orchestrator.scene import Scene


def prepared(scene: Scene) -> Scene:
    """Return a scene that is ready to run, with its estimated error: see `study.preparation.prepared_scene`."""
    if scene.execution.tolerance is None:
        return scene
    from vibroimpact.orchestrator.study.preparation import prepared_scene

    return prepared_scene(scene, note)


def with_modes(scene: Scene) -> Scene:
    """Return a scene whose number of modes is known: see `study.preparation.with_found_modes`."""
    if scene.execution.tolerance is None:
        return scene
    from vibroimpact.orchestrator.study.preparation import with_found_modes

    return with_found_modes(scene, note)
