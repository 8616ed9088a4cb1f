"""What `vibroimpact ssp` does: a scene of components becomes an SSP archive, an archive becomes a scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from vibroimpact.analysis.dataset.outputs import refuse_outputs
from vibroimpact.fmus.terminal import note, say
from vibroimpact.orchestrator.scene import load_scene
from vibroimpact.orchestrator.ssp import export_system, import_system, say_notes


def export_to_archive(
    scene: Path,
    output: Path | None,
    changes: Sequence[str],
    ssp: str,
    fmi: str | None,
    gains: str,
    platform: str | None,
) -> None:
    """Write an archive and say where it is."""
    target = output or Path(f"{scene.stem}.ssp")
    refuse_outputs([scene], target, ending=".ssp")
    loaded = load_scene(scene, changes)
    say(str(export_system(loaded, target, ssp=ssp, fmi=fmi, gains=gains, platform=platform, note=note)))


def import_to_scene(
    archive: Path, output: Path | None, changes: Sequence[str], parameters: Sequence[Path], force: bool
) -> None:
    """Write a scene with its FMUs, and say where it is and what the archive left open."""
    target = output or Path(f"{archive.stem}.toml")
    refuse_outputs([archive, *parameters], target, ending=".toml")
    say_notes(import_system(archive, target, changes, parameters, force=force).notes)
    say(str(target))
