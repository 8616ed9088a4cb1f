"""Which effects the numbers of a scene call for, at one of its points at least."""

from __future__ import annotations

from vibroimpact.orchestrator.scene.fields import rule_of
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY
from vibroimpact.orchestrator.scene.scene import Scene


def called_by_numbers(scene: Scene) -> set[str]:
    """Return the effects that numbers other than 0 call for."""
    return {rule_of(scene.field(key)).effect for key, largest in _largest(scene).items() if largest > 0.0}


def _largest(scene: Scene) -> dict[str, float]:
    """Return the largest magnitude that each number of a scene has over its sweep, by key."""
    numbers = [axis for axis in scene.sweep if axis.key != RECORDING_KEY]
    swept = {axis.key: max(max(axis.values), -min(axis.values)) for axis in numbers}
    return {key: abs(number) for key, number in scene.constants().items()} | swept
