"""Effects that a scene asks for at one or more of its points, by its numbers or by its components."""

from __future__ import annotations

import re
from collections.abc import Iterator

from vibroimpact.fmus.shipped import package_folder
from vibroimpact.orchestrator.importer.specification import ComponentSpec
from vibroimpact.orchestrator.run.time_series import follow_energies
from vibroimpact.orchestrator.scene.component_numbers import component_variable
from vibroimpact.orchestrator.scene.fields import rule_of
from vibroimpact.orchestrator.scene.measuring_models import FALLING_FORCE
from vibroimpact.orchestrator.scene.models import AMPLITUDE, DAMPING, FALLING_RESTITUTION
from vibroimpact.orchestrator.scene.parts import Parts
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY

STRUCTURES = ("Chain", "Beam", "Structure")
"""Bodies that follow their energies only on request."""
BODIES = ("Oscillator", *STRUCTURES)
_PLACE = r"(\[\d+\])?"
_OF_A_BODY = {
    "forcing": re.compile(rf"forcing\.(amplitude|base_acceleration){_PLACE}|sine\[\d+\]\.amplitude"),
    DAMPING: re.compile(rf"(far_)?damping(_ratio)?{_PLACE}|rayleigh\.(mass|stiffness)"),
    AMPLITUDE: re.compile(rf"amplitude\.[a-z_]+{_PLACE}"),
    "stops": re.compile(rf"contact{_PLACE}\.law"),
    FALLING_RESTITUTION: re.compile(rf"contact{_PLACE}\.yield_velocity"),
}
"""Parameters of bodies that ask for an effect where they are not 0; the default of each is 0."""
_OF_OTHERS = {
    "ImpactStop": {FALLING_RESTITUTION: re.compile("yield_velocity")},
    "Exciter": {FALLING_FORCE: re.compile("distance")},
}
_WHOLE = {
    "ImpactStop": "stops",
    "Replay": "recorded drive",
    "Sensor": "sensor",
    "LoadCell": "load cell",
    "Exciter": "exciter",
    "Noise": "noise",
    "AnalogInput": "AD conversion",
}
"""Components that are an effect by themselves."""


def called_by_numbers(scene: Parts) -> set[str]:
    """Return the effects that numbers other than 0 ask for."""
    return {rule_of(scene.field(key)).effect for key, largest in _largest(scene).items() if largest > 0.0}


def _largest(scene: Parts) -> dict[str, float]:
    """Return the largest magnitude of each number of a scene over its sweep, by key."""
    numbers = [axis for axis in scene.sweep if axis.key != RECORDING_KEY]
    swept = {axis.key: max(axis.highest, -axis.lowest) for axis in numbers}
    return {key: abs(number) for key, number in scene.constants().items()} | swept


def called_by_components(scene: Parts) -> set[str]:
    """Return the effects that the components of a scene ask for at one or more points of its sweep."""
    swept = {axis.key: max(axis.highest, -axis.lowest) for axis in scene.sweep}
    found: set[str] = set()
    for component in scene.components:
        kind = shipped_kind(component)
        found |= {_WHOLE[kind]} if kind in _WHOLE else set()
        patterns = _OF_A_BODY if kind in BODIES else _OF_OTHERS.get(kind, {})
        given = [name for name, value in _numbers(component, swept) if value]
        found |= {effect for effect, key in patterns.items() if any(map(key.fullmatch, given))}
    if any(pair.numbers.get("yield_velocity") for pair in scene.pairs):
        found.add(FALLING_RESTITUTION)
    kinds = {component.name: shipped_kind(component) for component in scene.components}
    sampled = map(component_variable, scene.sampled)
    if follow_energies(name for owner, name in sampled if kinds.get(owner) in STRUCTURES):
        found.add("energies")
    return found


def shipped_kind(component: ComponentSpec) -> str:
    """Return the name of the package's FMU that a component uses; empty for any other FMU."""
    return component.fmu.stem if component.fmu.is_relative_to(package_folder()) else ""


def _numbers(component: ComponentSpec, swept: dict[str, float]) -> Iterator[tuple[str, bool]]:
    """Yield each parameter, and whether it differs from 0 at one or more points of the sweep."""
    for name, value in component.parameters.items():
        largest = swept.get(f"{component.name}.{name}", value)
        yield name, largest not in ("none", "", "0") and bool(largest)
