"""Exchange with other tools: scenes written as FMUs or systems (SSP), and systems read as scenes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vibroimpact.given import (
    PathLike,
    SceneLike,
    given_output,
    given_path,
    given_paths,
    given_scene,
    scene_with_modes,
)
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import export_system, import_system, load_system, say_notes


def export_fmu(
    scene: SceneLike,
    path: PathLike,
    *,
    fmi: str = "3.0",
    full: bool = False,
    external: bool = False,
    enumerations: bool = False,
    model_exchange: bool = False,
    sensitivities: str | None = None,
    strobes: bool = False,
    structural: bool = False,
    platform: str | None = None,
) -> Path:
    """Write a scene's body, stops and forcing as one FMU for another tool; `vi.fmus.export` writes one component.

    Parameters
    ----------
    scene : Scene, path or mapping
        A scene of one body. A swept key has the value in its own table, not the values of the sweep.
    path : path
        FMU file to write.
    fmi, full, external, enumerations, model_exchange, sensitivities, strobes, structural, platform
        Options of the FMU: see `vibroimpact.fmus.export`.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    SceneError
        The scene is wrong; the message lists all problems, one a line.
    UsageError
        The scene has another kind of body, or the file cannot be written.
    ComponentError
        A platform has no library, and no compiler was found to build it.

    Examples
    --------
    >>> export_fmu("rig.toml", "rig.fmu", platform="all")    # doctest: +SKIP
    """
    chosen = given_scene(scene)
    target = given_output(path, [scene, chosen])
    return export_scene(
        scene_with_modes(chosen),
        target,
        fmi=fmi,
        full=full,
        external=external,
        enumerations=enumerations,
        model_exchange=model_exchange,
        sensitivities=sensitivities,
        strobes=strobes,
        structural=structural,
        platform=platform,
    )


def export_ssp(
    scene: SceneLike,
    path: PathLike,
    *,
    ssp: str = "1.0",
    fmi: str | None = None,
    gains: str = "component",
    platform: str | None = None,
) -> Path:
    """Write a scene of components as a system (SSP) that other tools run; `import_ssp` reads the system back.

    Parameters
    ----------
    scene : Scene, path or mapping
        A scene with components.
    path : path
        Archive to write.
    ssp : str
        Version of SSP, `1.0` or `2.0`.
    fmi : str, optional
        FMI version of this package's components in the archive. The default is 2.0; in SSP 2.0, the scene's version.
    gains : str
        Form of a connection's gain: a `component` with units of its own, or a `transformation`.
    platform : str, optional
        Platform of the libraries: see `vibroimpact.fmus.export`.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    SceneError
        The scene is wrong; the message lists all problems, one a line.
    UsageError
        The scene has no components, or the file cannot be written.
    ComponentError
        A platform has no library, and no compiler was found to build it.

    Examples
    --------
    >>> export_ssp("two_oscillators.toml", "two.ssp")    # doctest: +SKIP
    """
    chosen = given_scene(scene)
    target = given_output(path, [scene, chosen])
    return export_system(chosen, target, ssp=ssp, fmi=fmi, gains=gains, platform=platform)


def import_ssp(
    path: PathLike, output: PathLike | None = None, *, parameters: PathLike | Sequence[PathLike] = ()
) -> Scene:
    """Read a system (SSP 1.0 or 2.0) as a scene; `run`, `campaign` and `cost_of` also take the path of a system.

    Notes on standard error list settings that the system leaves open, and parameters that match no component.

    Parameters
    ----------
    path : path
        Archive of the system.
    output : path, optional
        Scene file to write as well (.toml), with the FMUs in a folder next to it. Existing files with other contents
        are refused. Without `output`, the FMUs stay unpacked until this process ends.
    parameters : path or sequence of path
        Parameter sets (.ssv), as files or by their name in the archive. One set is applied, several become a sweep.

    Returns
    -------
    Scene
        The scene of the system.

    Raises
    ------
    SceneError
        The system, or the scene made from it, is wrong.
    ComponentFileError
        The archive, or an FMU in it, is unsafe or damaged.
    UsageError
        The parameter sets make no sweep, or a file cannot be written.

    Examples
    --------
    >>> import_ssp("two.ssp").with_sweep({"a.mass": [1.0, 2.0]})    # doctest: +SKIP
    """
    sets = given_paths(parameters)
    if output is None:
        imported = load_system(given_path(path), (), sets)
        say_notes(imported.notes)
        return imported.scene
    say_notes(import_system(given_path(path), given_path(output), (), sets).notes)
    return Scene.from_file(output)
