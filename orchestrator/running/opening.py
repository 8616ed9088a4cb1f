"""The opening of a scene in this process, or in a child process if its components may crash or hang."""

from __future__ import annotations

from vibroimpact.orchestrator.run import Runner, open_runner
from vibroimpact.orchestrator.scene import Scene

DEFAULT_RUNNER = f"{__name__}:open_scene"
"""Function that opens a scene, as `module:name`, which a worker process can import."""


def open_scene(scene: Scene, *, execution: str | None = None) -> Runner:
    """Return the runner of a scene, in a guarded child process where the scene asks for it.

    Parameters
    ----------
    scene : Scene
    execution : str, optional
        Execution of the points; by default the scene's own.

    Raises
    ------
    SceneError, ComponentError
        The scene cannot run this way, or a component cannot be loaded.
    """
    how = scene.execution.how if execution is None else execution
    if scene.execution.guard:
        # imported only for guarded scenes
        from vibroimpact.orchestrator.guard import GuardedRunner

        return GuardedRunner(scene, execution=how)
    return open_runner(scene, how)
