"""A scene opened as it says itself: in this process, or in one of its own where its components may crash or hang."""

from __future__ import annotations

from vibroimpact.orchestrator.run import Runner, open_runner
from vibroimpact.orchestrator.scene import Scene

DEFAULT_RUNNER = f"{__name__}:open_scene"
"""What opens a scene, as `module:name`, so that a worker can find it by itself."""


def open_scene(scene: Scene, *, execution: str | None = None) -> Runner:
    """Return the runner of a scene, in a guarded child process where the scene asks for it.

    Parameters
    ----------
    scene : Scene
    execution : str, optional
        How its points run; by default as the scene says.

    Raises
    ------
    SceneError, ComponentError
        The scene cannot run this way, or a component cannot be loaded.
    """
    how = scene.execution.how if execution is None else execution
    if scene.execution.guard:
        # loaded by those whose components may crash
        from vibroimpact.orchestrator.guard import GuardedRunner

        return GuardedRunner(scene, execution=how)
    return open_runner(scene, how)
