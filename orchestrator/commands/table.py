"""Every command of the package: the place of its operation, and its panel in `--help`.

Commands stand in the order of use. Their first lines are in `first_lines.json`, which `python -P
tests/support/public_names.py` writes: a list of commands imports no operation.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

FIRST_LINES = Path(__file__).with_name("first_lines.json")


class Group(NamedTuple):
    """Commands with a common first word; `form` is the group's own class, if it has one."""

    words: str
    commands: Mapping[str, str]
    form: str = ""


GROUPS: Mapping[str, Group] = {
    "estimate": Group(
        "Estimate damping, frequency, damping law, frequency response, or restitution from a signal.",
        {
            "decay": "analysis.operations.estimate_decay:EstimateDecay",
            "impacts": "analysis.operations.estimate_impacts:EstimateImpacts",
            "bounces": "analysis.operations.estimate_bounces:EstimateBounces",
            "response": "analysis.operations.estimate_response:EstimateResponse",
        },
        "analysis.commands.estimate_group:EstimateGroup",
    ),
    "fmu": Group(
        "List, build, check, export and serve FMUs.",
        {
            "list": "fmus.operations.fmu_list:ListFmus",
            "build": "fmus.operations.fmu_build:BuildFmus",
            "check": "fmus.operations.fmu_check:CheckFmus",
            "replay": "analysis.operations.fmu_replay:ExportReplay",
            "export": "orchestrator.operations.fmu_export:ExportFmu",
            "serve": "orchestrator.operations.fmu_serve:ServeFmu",
        },
    ),
    "ssp": Group(
        "Exchange systems of FMUs with other tools.",
        {
            "export": "orchestrator.operations.ssp_export:ExportSsp",
            "import": "orchestrator.operations.ssp_import:ImportSsp",
        },
    ),
    "rig": Group(
        "Rigs: boards of NI, and a virtual one.",
        {
            "serve": "hardware.operations.rig_serve:ServeRig",
            "devices": "hardware.operations.rig_devices:ListDevices",
            "record": "hardware.operations.rig_record:Record",
            "sine": "hardware.operations.rig_sine:DriveSine",
            "spikes": "hardware.operations.rig_spikes:RecordSpikes",
            "recover": "hardware.operations.rig_recover:Recover",
            "sweep": "hardware.operations.rig_sweep:MeasureSweep",
        },
    ),
}
COMMANDS: Mapping[str, str] = {
    "check": "orchestrator.operations.check:Check",
    "run": "orchestrator.operations.run:Run",
    "campaign": "orchestrator.operations.campaign:Campaign",
    "demo": "orchestrator.operations.demo:Demo",
    "plot": "analysis.operations.plot:Plot",
    "describe": "analysis.operations.describe:Describe",
    "convert": "analysis.operations.convert:Convert",
    "accuracy": "orchestrator.operations.accuracy:Accuracy",
    "effects": "orchestrator.operations.effects:Effects",
    "sensitivity": "analysis.operations.sensitivity:Sensitivity",
    "modes": "orchestrator.operations.modes:ShowModes",
    "hard-cases": "orchestrator.operations.hard_cases:HardCases",
    "import": "hardware.operations.import_files:ImportFiles",
    "replay": "orchestrator.operations.replay:Replay",
    "spikes": "analysis.operations.spikes:Spikes",
    "orbit": "orchestrator.operations.orbit:FindOrbits",
    "follow": "orchestrator.operations.follow:Follow",
    "diagram": "orchestrator.operations.diagram:MakeDiagram",
    "maps": "orchestrator.operations.maps:Maps",
    "classify": "analysis.operations.classify:Classify",
    "lyapunov": "orchestrator.operations.lyapunov:Lyapunov",
    "energies": "orchestrator.operations.energies:Energies",
    "resonances": "orchestrator.operations.resonances:Resonances",
    "basins": "orchestrator.operations.basins:Basins",
    "control": "orchestrator.operations.control:Control",
    "transients": "orchestrator.operations.transients:TransientsOf",
    "serve": "service.operations.serve:Serve",
    "submit": "service.operations.submit:Submit",
    "status": "service.operations.status:Status",
    "fetch": "service.operations.fetch:Fetch",
    "cancel": "service.operations.cancel:Cancel",
}
PANELS: Mapping[str, tuple[str, ...]] = {
    "Simulate": ("check", "run", "campaign", "demo"),
    "Look": ("plot", "describe", "convert"),
    "Measure and compare": (
        "accuracy",
        "effects",
        "sensitivity",
        "modes",
        "hard-cases",
        "import",
        "replay",
        "estimate",
        "spikes",
    ),
    "Orbits": (
        "orbit",
        "follow",
        "diagram",
        "maps",
        "classify",
        "lyapunov",
        "energies",
        "resonances",
        "basins",
        "control",
        "transients",
    ),
    "Exchange": ("fmu", "ssp"),
    "Rigs": ("rig",),
    "Serve": ("serve", "submit", "status", "fetch", "cancel"),
}
"""Commands and groups in the order of `--help`; other packages' commands come last."""


@functools.cache
def first_lines() -> Mapping[str, str]:
    """Return the first help line of each command, by the words of the command."""
    lines: dict[str, str] = json.loads(FIRST_LINES.read_text(encoding="utf-8"))
    return lines


def paths() -> Mapping[str, str]:
    """Return the place of each command's operation, by the words of the command."""
    inner = {
        f"{name} {word}": place for name, group in GROUPS.items() for word, place in group.commands.items()
    }
    return {**COMMANDS, **inner}
