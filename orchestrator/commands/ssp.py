"""The commands `vibroimpact ssp`: a scene of components becomes an SSP archive, an archive becomes a scene."""

from __future__ import annotations

from pathlib import Path

from vibroimpact.analysis.dataset.outputs import refuse_outputs
from vibroimpact.fmus.messages import typed
from vibroimpact.fmus.terminal import note, say
from vibroimpact.orchestrator.operations.ssp_export import ExportSsp
from vibroimpact.orchestrator.operations.ssp_import import ImportSsp
from vibroimpact.orchestrator.scene import load_scene
from vibroimpact.orchestrator.ssp import export_system, import_system, say_notes


def export_to_archive(options: ExportSsp) -> None:
    """Write an archive and print its path."""
    target = options.output or Path(f"{options.scene.stem}.ssp")
    refuse_outputs([options.scene], target, ending=".ssp")
    loaded = load_scene(options.scene, options.changes or ())
    written = export_system(
        *(loaded, target),
        ssp=options.ssp,
        fmi=options.fmi,
        gains=options.gains,
        platform=options.platform,
        note=lambda text: note(typed(text)),
    )
    say(str(written))


def import_to_scene(options: ImportSsp) -> None:
    """Write a scene with its FMUs, and print its path and the choices made for open values."""
    archive, parameters = options.archive, options.parameters or ()
    target = options.output or Path(f"{archive.stem}.toml")
    refuse_outputs([archive, *parameters], target, ending=".toml")
    say_notes(import_system(archive, target, options.changes or (), parameters, force=options.force).notes)
    say(str(target))
