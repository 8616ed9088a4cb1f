"""What `vibroimpact fmu export` does: a component, a scene's body, or a contact law of the user's becomes an FMU."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from vibroimpact.fmus.commands.fmu import export_component, export_user_law
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.shipped import letters_of
from vibroimpact.fmus.terminal import note, say

USER_CONTACT_LAW = "user-contact-law"


def export_to_file(
    component: str,
    output: Path | None,
    counts: Mapping[str, int | None],
    changes: Sequence[str] | None,
    fmi: str,
    kinds: Mapping[str, bool],
    platform: str | None,
    law: Path | None,
) -> None:
    """Write an FMU and say where it is."""
    given = [
        f"--{name}"
        for name, value in {**counts, **kinds, "platform": platform}.items()
        if value not in (None, False)
    ]
    if letters_of(component) == letters_of(USER_CONTACT_LAW):
        say(str(export_user_law(law, output, given + ["--set"] * bool(changes))))
        return
    if law is not None:
        raise UsageError(f"--law: expected the component {USER_CONTACT_LAW} with it, got {component}.")
    if Path(component).suffix.lower() != ".toml":
        say(str(export_component(component, output, counts, changes, fmi, platform, **kinds)))
        return
    for name, count in counts.items():
        if count is not None:
            raise UsageError(f"--{name}: a scene says how many there are; leave the option out.")
    _export_scene_file(Path(component), output, changes, fmi, platform, kinds)


def _export_scene_file(
    scene_file: Path,
    output: Path | None,
    changes: Sequence[str] | None,
    fmi: str,
    platform: str | None,
    kinds: Mapping[str, bool],
) -> None:
    # half a second of libraries that a component needs none of
    from vibroimpact.analysis.dataset.outputs import refuse_outputs
    from vibroimpact.orchestrator.commands.preparing import with_modes
    from vibroimpact.orchestrator.run.export import export_scene
    from vibroimpact.orchestrator.scene import load_scene

    scene, target = (
        with_modes(load_scene(scene_file, changes or ())),
        output or Path(f"{scene_file.stem}.fmu"),
    )
    refuse_outputs([scene_file], target, ending=".fmu")
    say(str(export_scene(scene, target, fmi=fmi, platform=platform, note=note, **kinds)))
