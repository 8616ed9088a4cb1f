"""The dataset of a replay: measured and simulated signals, scores, drives, impacts and fitted numbers."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.analysis.replay.replay_dataset import comparison_dataset
from vibroimpact.analysis.replay.trust import Verdict
from vibroimpact.fmus.printable import printable
from vibroimpact.orchestrator.replay.drive import DRIVEN_UNITS
from vibroimpact.orchestrator.replay.fit import ReplayFit
from vibroimpact.orchestrator.replay.replayer import Motion, Replayer, replay_table
from vibroimpact.orchestrator.run import RunnerIdentity
from vibroimpact.orchestrator.run.provenance import provenance
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.changes import text_with_values

_HEAD = "# Fitted by vibroimpact replay to"
_HEADING = re.compile(rf"\A{_HEAD} .*\n(?:# [^\n]* \+- .*\n)*\n?")
"""The lines that `fitted_scene_text` writes above a scene, to be replaced by a new fit."""


@dataclass(frozen=True, slots=True)
class Replayed:
    """One recording, replayed."""

    replayer: Replayer
    motion: Motion
    comparisons: list[Comparison]
    use: str
    """`fitted`, `scored` (not fitted), or `replayed` (without a fit)."""

    @property
    def name(self) -> str:
        """Name of the recording's file."""
        return Path(self.replayer.recording.title).name


def replay_dataset(
    replays: Sequence[Replayed], fit: ReplayFit | None = None, verdict: Verdict | None = None
) -> xr.Dataset:
    """Return the dataset of replays of one scene, ready for `write_results`.

    Signals and scores are from `comparison_dataset`, for all recordings one after the other; `recording` and `use`
    name the recording of each. `drive_K` on `drive_time_K` and `simulated_impact_K` belong to recording K (from 1).
    Fitted numbers are on `parameter`. At least one replay is needed, each with a comparison or a drive.
    """
    compared = [comparison for replay in replays for comparison in replay.comparisons]
    dataset = comparison_dataset(compared) if compared else xr.Dataset()
    for number, replay in enumerate(replays, start=1):
        dataset = dataset.assign(_of_recording(number, replay))
    owners = [replay for replay in replays for _ in replay.comparisons]
    if compared:
        dataset["recording"] = ("comparison", [r.name for r in owners], _words("recording"))
        dataset["use"] = ("comparison", [r.use for r in owners], _words("what the recording was used for"))
    if fit is not None:
        dataset = dataset.assign(_of_fit(fit))
    attrs: dict[str, Any] = {"results_kind": "replay"}
    if verdict is not None:
        attrs |= {
            "verdict": verdict.words,
            "trusted": int(verdict.trusted),
            "reasons": "\n".join(verdict.reasons),
        }
    return dataset.assign_attrs(
        dataset.attrs | _provenance(replays) | attrs | _remarks(dataset, replays, fit)
    )


def fitted_scene_text(scene: Scene, fit: ReplayFit, recordings: Sequence[str], folder: Path) -> str:
    """Return the text of a scene with the fitted numbers; comments above it name the recordings and the errors.

    Parameters
    ----------
    scene : Scene
        As it was loaded.
    fit : ReplayFit
    recordings : sequence of str
        Files of the fitted recordings.
    folder : Path
        Folder of the text: recordings in the scene get paths relative to it.
    """
    here = Path(scene.source).parent
    named = replay_table(scene).recordings
    moved = [name if Path(name).is_absolute() else os.path.relpath(here / name, folder) for name in named]
    text = text_with_values(scene.text, fit.numbers, () if here.resolve() == folder.resolve() else moved)
    files = ", ".join(printable(json.dumps(name, ensure_ascii=False)) for name in recordings)
    lines = [f"{_HEAD} {files}; +- is the standard error:"]
    for key, value, error in zip(fit.keys, fit.values, fit.standard_error, strict=True):
        lines.append(f"# {key} = {value:.6g} +- {error:.2g}")
    return "\n".join(lines) + "\n\n" + _HEADING.sub("", text)


def _words(words: str, unit: str = "1") -> dict[str, Any]:
    return {"units": unit, "long_name": words}


def _of_recording(number: int, replay: Replayed) -> dict[str, Any]:
    """Return drive and simulated impacts of one recording."""
    found: dict[str, Any] = {}
    drive, replayer = replay.replayer.drive, replay.replayer
    if drive is not None:
        name, kind = f"drive_{number}", str(replayer.replay.drive)
        where = f"drive_time_{number}"
        found[where] = (where, drive.time, _words(f"time of what drives, {replay.name}", "s"))
        words = _words(f"{kind.replace('_', ' ')}, less its offset, {replay.name}", DRIVEN_UNITS[kind])
        found[name] = (where, drive.values, words | {"offset_removed": drive.offset})
        found[f"{name}_bridged"] = (where, drive.bridged.astype(np.int8), _words("1 where a gap was bridged"))
    if len(replay.motion.impacts):
        where = f"simulated_impact_{number}"
        columns = (("time", 0, "s"), ("velocity", 2, "m s-1"), ("impulse", 3, "N s"), ("contact", 4, "1"))
        for name, column, unit in columns:
            words = _words(f"{name} of simulated impacts, {replay.name}", unit)
            found[f"{where}_{name}"] = (where, replay.motion.impacts[:, column], words)
    return found


def _of_fit(fit: ReplayFit) -> dict[str, Any]:
    on = ("parameter",)
    return {
        "parameter": (on, list(fit.keys), _words("fitted number of the scene")),
        "fitted_value": (on, fit.values, _words("value found, in the unit of its key")),
        "start_value": (on, fit.start, _words("value that the search began with")),
        "standard_error": (on, fit.standard_error, _words("standard error of the value found")),
        "correlation": (
            ("parameter", "other_parameter"),
            fit.correlation,
            _words("correlation of the errors of two fitted numbers"),
        ),
    }


def _provenance(replays: Sequence[Replayed]) -> dict[str, Any]:
    replayer = replays[0].replayer
    identity = RunnerIdentity(replayer.execution, "", replayer.hashes)
    attrs = provenance(replayer.scene, identity)
    recordings = [
        {
            "file": replay.name,
            "use": replay.use,
            "sha256": replay.replayer.recording.attrs.get("source_sha256", ""),
        }
        for replay in replays
    ]
    attrs["recordings"] = json.dumps(recordings)
    attrs["history"] = "replayed by vibroimpact"
    return {key: value for key, value in attrs.items() if value != ""}


def _remarks(dataset: xr.Dataset, replays: Sequence[Replayed], fit: ReplayFit | None) -> dict[str, str]:
    lines = [line for line in str(dataset.attrs.get("remarks", "")).splitlines() if line]
    for replay in replays:
        lines += [f"{replay.name}: {line}" for line in (*replay.replayer.remarks, *replay.motion.warnings)]
    lines += fit.remarks if fit is not None else ()
    return {"remarks": "\n".join(dict.fromkeys(lines))}
