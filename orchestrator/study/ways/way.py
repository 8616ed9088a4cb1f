"""A way to simulate a scene, and its opening as a trial."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol

from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.observation import Observation, observation_of
from vibroimpact.orchestrator.study.ways.driven import DrivenTrial
from vibroimpact.orchestrator.study.ways.replays import ReplayTrial
from vibroimpact.orchestrator.study.ways.span import first_part


class Trial(Protocol):
    """An opened way to simulate a scene, which can run again and again."""

    def run(self) -> Observation:
        """Simulate the scene once."""

    def close(self) -> None:
        """Free the opened components."""


class Opener(Protocol):
    """Opens a way over all of its scene's time or over the first part."""

    def __call__(self, wrap: Wrapper | None, part: float = 1.0) -> Trial:
        """Return the trial; `wrap` wraps the functions of all FMUs."""


@dataclass(frozen=True, slots=True)
class Way:
    """A way to simulate a scene at one setting."""

    name: str
    """Kind of the way: `fused`, `coupled, FMI 2.0`, `model exchange, CVode`, ..."""
    knob: str
    """Key or number that is set; empty where there is nothing to set."""
    setting: float
    """Value of the knob; NaN without a knob."""
    changes: Mapping[str, Any]
    """Keys of the scene, with the values that make it run this way; empty where no scene can ask for it."""
    open: Opener
    """Opens the way, with a wrapper of the functions of all FMUs, or None, and the part of the time to simulate."""
    model: bool = False
    """Whether the way simulates another model (another contact law, fewer modes) instead of the same one."""
    against: Scene | None = None
    """The finest model of its kind, where errors are measured against it; None for the study's reference."""
    scene: Scene | None = None
    """The simulated scene, where its own runner simulates it."""
    is_own_model: bool = False
    """Whether the model is the scene itself: its own number of modes among others."""
    as_whole: bool = False
    """Whether range and mean energy alone are compared: impacts do not correspond one by one."""

    @property
    def label(self) -> str:
        """The way with its setting, in words."""
        return f"{self.name}, {self.knob} {self.setting:.3g}" if self.knob else self.name


class SceneTrial:
    """A scene that its own runner runs."""

    def __init__(self, scene: Scene, wrap: Wrapper | None = None) -> None:
        of = None if wrap is None else (lambda name: wrap)
        self.is_guarded = scene.execution.guard
        self._runner = open_runner(scene, scene.execution.how, wrap=of)

    def run(self) -> Observation:
        """Simulate the scene once."""
        return observation_of(self._runner.run({}))

    def close(self) -> None:
        """Free the components."""
        self._runner.close()


@lru_cache(maxsize=4)
def own_step(scene: Scene) -> float:
    """Return the macro step of a scene of components, s; the mean step of a run where an estimate chooses the steps."""
    if not scene.execution.adapts:
        return scene.macro_step
    runner = open_runner(scene, scene.execution.how)
    try:
        record = runner.run({})
    finally:
        runner.close()
    steps = 1.0 if record.chosen_steps is None else max(1.0, float(record.chosen_steps[0]))
    return scene.macro_step / steps


class CallCounter:
    """Counts calls of FMUs by function."""

    def __init__(self) -> None:
        self.calls: Counter[str] = Counter()

    def wrap(self, name: str, function: Function) -> Function:
        """Return the function with its calls counted."""

        def counted(*arguments: Any) -> Any:
            self.calls[name] += 1
            return function(*arguments)

        return counted


def opened_trial(scene: Scene, wrap: Wrapper | None = None) -> SceneTrial | ReplayTrial:
    """Open a scene with its own settings; `wrap` is not used for a replay."""
    return SceneTrial(scene, wrap) if scene.replay is None else ReplayTrial(scene)


def opened_part(scene: Scene, part: float, wrap: Wrapper | None = None) -> Trial:
    """Open a scene with its own settings, to simulate the first part of its time."""
    if part == 1.0:
        return opened_trial(scene, wrap)
    if not scene.is_lone_body:
        return opened_trial(first_part(scene, part), wrap)
    return DrivenTrial(scene, part, wrap)


def way_by_scene(
    name: str, knob: str, setting: float, scene: Scene, changes: Mapping[str, Any], *, model: bool = False
) -> Way:
    """Return the way of the scene's own runner, with other values of some keys."""
    changed = scene.with_values(changes) if changes else scene

    def opened(wrap: Wrapper | None, part: float = 1.0) -> Trial:
        return opened_part(changed, part, wrap)

    return Way(name, knob, setting, changes, opened, model, scene=changed)


def can_have(scene: Scene, changes: Mapping[str, Any]) -> bool:
    """Return whether a scene is valid with these changes."""
    try:
        scene.with_values(changes)
    except SceneError:
        return False
    return True


def time_scale(scene: Scene) -> float:
    """Return the forcing period, else the period of an unforced oscillator, else a hundredth of the whole time, s."""
    if scene.period is not None:
        return scene.period
    numbers = {} if scene.body.IS_STRUCTURE else float_parameters(scene, None)
    if numbers.get("stiffness", 0.0) > 0.0:
        return 2.0 * math.pi * math.sqrt(numbers["mass"] / numbers["stiffness"])
    return (scene.record.transient_time + scene.record.recorded_time) / 100.0
