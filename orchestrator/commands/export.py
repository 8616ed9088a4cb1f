"""The command `vibroimpact fmu export`: a component, a scene's body, or a user's contact law becomes an FMU."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vibroimpact.fmus.commands.fmu import export_component, export_user_law
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.shipped import letters_of
from vibroimpact.fmus.terminal import note, say
from vibroimpact.orchestrator.operations.fmu_export import ExportFmu

USER_CONTACT_LAW = "user-contact-law"


def export_to_file(options: ExportFmu) -> None:
    """Write an FMU and print its path."""
    component, platform, law, output = options.component, options.platform, options.law, options.output
    counts = {name: getattr(options, name) for name in ("contacts", "modes", "masses", "sensors")}
    kinds = {
        "full": options.full,
        "external": options.ports == "external",
        "enumerations": options.enumerations,
        "model_exchange": options.model_exchange,
        "sensitivities": options.sensitivities,
        "strobes": options.strobes,
        "structural": options.structural,
    }
    given = [
        f"--{name.replace('_', '-')}"
        for name, value in {**counts, **kinds, "platform": platform}.items()
        if value not in (None, False)
    ]
    if letters_of(component) == letters_of(USER_CONTACT_LAW):
        say(str(export_user_law(law, output, given + ["--set"] * bool(options.changes))))
        return
    if law is not None:
        raise UsageError(f"--law: expected the component {USER_CONTACT_LAW} with it, got {component}.")
    if Path(component).suffix.lower() != ".toml":
        say(str(export_component(component, output, counts, options.changes, options.fmi, platform, **kinds)))
        return
    for name, count in counts.items():
        if count is not None:
            raise UsageError(f"--{name}: a scene says how many there are; leave the option out.")
    _export_scene_file(options, kinds)


def _export_scene_file(options: ExportFmu, kinds: Mapping[str, Any]) -> None:
    # these libraries take half a second to load, and a component needs none
    from vibroimpact.analysis.dataset.outputs import refuse_outputs
    from vibroimpact.orchestrator.run.export import export_scene
    from vibroimpact.orchestrator.scene import load_scene
    from vibroimpact.orchestrator.study.preparing import with_modes

    file = Path(options.component)
    scene = with_modes(load_scene(file, options.changes or ()))
    target = options.output or Path(f"{file.stem}.fmu")
    refuse_outputs([file], target, ending=".fmu")
    say(str(export_scene(scene, target, fmi=options.fmi, platform=options.platform, note=note, **kinds)))
