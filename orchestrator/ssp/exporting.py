"""Export of a general scene to an SSP archive: other tools run it, and its import gives the same scene."""

from __future__ import annotations

import os
from pathlib import Path

from vibroimpact.analysis.files.scratch import ScratchFolder
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.fmus.packaging.cross import Note
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.shipped import FOLDERS
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp.members import Travel, component_members
from vibroimpact.orchestrator.ssp.names import SSD_FILE, VERSIONS
from vibroimpact.orchestrator.ssp.scene_tables import OWN_TABLES
from vibroimpact.orchestrator.ssp.writing import description, parameter_set, swept_members

ABOUT_A_RUN = ("scene", "record", "sweep", "execution")
"""Tables of a scene about its run, not about its system."""
GAINS = ("component", "transformation")


def export_system(
    scene: Scene,
    output: str | os.PathLike[str],
    *,
    ssp: str = "1.0",
    fmi: str | None = None,
    gains: str = "component",
    platform: str | None = None,
    note: Note = lambda _: None,
) -> Path:
    """Write a scene of components as an SSP archive.

    Parameters
    ----------
    scene : Scene
        With components. For other tools a swept key has the value in its tables, or its first value without one.
    output : path
        File to write.
    ssp : str
        Version of the description, `1.0` or `2.0`.
    fmi : str, optional
        Version of the FMUs of this package's components in the archive, `2.0` or `3.0`. The default is 2.0 in SSP 1.0,
        which knows no other, and the scene's version in SSP 2.0. Gain components always are of 2.0.
    gains : str
        Form of a connection's gain. A `component` has units of its own (a spring between bodies is one in N/m). A
        `transformation` changes the value; OMSimulator ignores it, Ecos and libcosim apply it without a delay.
    platform
        As in `vibroimpact.fmus.export`.
    note : callable
        Called with notes on FMUs compiled for another machine, and on parts that other tools ignore.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UsageError
        The scene has one body and no components, a connection has no form in this version of SSP, or the file cannot
        be written.
    ComponentError
        There is no library for a platform, and no compiler for it.
    """
    if scene.is_one_body:
        raise UsageError(
            f"{scene.source}: expected a scene of components, got one of a body. "
            "`vibroimpact fmu export` makes an FMU of it."
        )
    for given, known, what in (
        (ssp, VERSIONS, "ssp"),
        (fmi or "2.0", tuple(FOLDERS), "fmi"),
        (gains, GAINS, "gains"),
    ):
        if given not in known:
            raise UsageError(message(Argument(what), f": expected {' or '.join(known)}, got {given!r}."))
    duration = scene.record.transient_time + scene.record.recorded_time
    fmi = fmi or ("2.0" if ssp == "1.0" else None)
    with ScratchFolder("ssp") as folder:
        travel = Travel(Path(folder.name), fmi, duration, gains == "component", platform, note)
        parts = component_members(scene, travel)
        members = {part.member: part.content for part in parts.values()}
    for part in parts.values():
        if part.values:
            members[part.values_member] = parameter_set(part, ssp)
    try:
        members[SSD_FILE] = description(scene, parts, ssp, duration)
    except SceneError as error:
        raise UsageError(error.message) from None
    members |= swept_members(scene, parts, ssp)
    target = Path(output)
    write_fmu(target, members)
    springs = [part.name for part in parts.values() if part.gain_of is not None]
    if springs:
        note(
            message(
                f"{', '.join(springs)}: each gain is a component; a tool that exchanges values once a step answers one "
                "step later through it than with ",
                *(Argument("gains"), " transformation"),
            )
        )
    for component in scene.components:
        if component.tolerance is not None:
            note(
                f"component.{component.name}.tolerance: a system has no word for it: its FMU runs with its own"
            )
    for name in parse_toml(scene.text).keys() - {*OWN_TABLES, *ABOUT_A_RUN}:
        note(f"[[{name}]] travels in an annotation: other tools run the system without it")
    return target
