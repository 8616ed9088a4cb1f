"""A scene's body with its stops as an FMU for other tools: the scene's numbers are its start values."""

from __future__ import annotations

import os
from pathlib import Path

from vibroimpact.fmus.bodies.assembled import without_arrays
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.cross import Note
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.structure_file import structure_file
from vibroimpact.orchestrator.run.parameters import exported_floats, integer_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody


def export_scene(
    scene: Scene,
    output: str | os.PathLike[str],
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
    note: Note = lambda _: None,
) -> Path:
    """Write an FMU of a scene's body, stops and forcing; its default experiment ends with the scene's recording.

    Parameters
    ----------
    scene : Scene
        A scene of one body without a replay. Swept keys have the values of their own tables.
    output : path
        File to write.
    fmi : str
        `3.0` or `2.0`.
    full, external, enumerations, model_exchange, sensitivities, strobes, structural, platform, note
        See `vibroimpact.fmus.export`.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    UsageError
        The scene has components, a replay or a force that falls with the distance, or the file cannot be written.
    """
    if not scene.is_one_body:
        raise UsageError(
            f"{scene.source}: expected the scene of one body, with [body], got components. "
            "Each of them is an FMU already."
        )
    if scene.replay is not None:
        raise UsageError(
            f"{scene.source}: replay: expected a scene that drives its body by [forcing], got a recording, "
            "which an FMU of a body does not hold. Leave [replay] out, and give the signal to the input force."
        )
    if scene.falling_force:
        raise UsageError(
            f"{scene.source}: exciter.distance: expected a force that does not depend on the displacement, as an FMU "
            "of a body has it, got one that falls with the distance. Leave it out, or connect an Exciter to the FMU."
        )
    if isinstance(scene.body, StructureBody):
        scene = scene.model_copy(update={"bodies": (scene.body.observing_one(),)})
    integers = integer_parameters(scene)
    integers.pop("ends_unbounded", None)  # other tools may push the bodies back
    starts, arrays = without_arrays(exported_floats(scene))
    structure = structure_file(arrays, coupled=bool(integers["coupled"])) if arrays else None
    return export_fmu(
        scene.body.FMU,
        output,
        contacts=len(scene.stops),
        fmi=fmi,
        starts={**starts, **integers},
        structure=structure,
        full=full,
        external=external,
        enumerations=enumerations,
        model_exchange=model_exchange,
        sensitivities=sensitivities,
        strobes=strobes,
        structural=structural,
        stop_time=_duration(scene),
        platform=platform,
        note=note,
    )


def _duration(scene: Scene) -> float:
    record = scene.record
    if scene.period is None:
        return record.transient_time + record.recorded_time
    return (record.transient_periods + record.recorded_periods) * scene.period
