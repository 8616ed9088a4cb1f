"""FMUs and systems (SSP) of scenes, for other tools, and scenes of theirs: thin over the functions of the commands."""

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
    platform: str | None = None,
) -> Path:
    """Write an FMU of a scene's body, stops and forcing, for another tool; components alone: `vi.fmus.export`.

    Parameters
    ----------
    scene : Scene, path or mapping
        Of one body. What it sweeps has the value that it has in its own table.
    path : path
        The file to write.
    fmi, full, external, enumerations, platform
        As `vibroimpact.fmus.export` has them.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        The scene has another kind of body, or the file cannot be written.
    ComponentError
        There is no library for a platform, and nothing to compile it with.

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
    """Write a scene of components as a system (SSP) that other tools run; `import_ssp` gives it back.

    Parameters
    ----------
    scene : Scene, path or mapping
        With components.
    path : path
        The file to write.
    ssp : str
        `1.0` or `2.0`.
    fmi : str, optional
        Version of FMI of this package's components in the archive; by default 2.0, in SSP 2.0 that of the scene.
    gains : str
        How a connection has its gain: as a `component` with units of its own, or as a `transformation`.
    platform : str, optional
        As `vibroimpact.fmus.export` has it.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    SceneError
        With all problems of the scene, each on one line.
    UsageError
        The scene has no components, or the file cannot be written.
    ComponentError
        There is no library for a platform, and nothing to compile it with.

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
    """Read a system (SSP 1.0 or 2.0) as a scene; `run`, `campaign` and `cost_of` take its path as it is.

    What the system leaves open, and parameters that nothing has, are said on standard error.

    Parameters
    ----------
    path : path
        The archive.
    output : path, optional
        The scene file to write as well (.toml), with the FMUs in a folder beside it; files that are there and hold
        something else are refused. Without one the FMUs lie unpacked until this process ends.
    parameters : path or sequence of path
        Parameter sets (.ssv), files or ones in the archive: one is applied, several become a sweep.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        What is wrong with the system, or with the scene that it makes.
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
