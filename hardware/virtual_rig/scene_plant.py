"""A scene as the plant of a virtual rig."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import message
from vibroimpact.hardware.virtual_rig.plant import TICK, Floats, Plant, Ticks
from vibroimpact.hardware.virtual_rig.playback import Playback
from vibroimpact.hardware.virtual_rig.settings import RigSettings
from vibroimpact.orchestrator.run.measuring.session import MeasuredSession
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.scene.execution_model import MOST_IMPACTS_PER_POINT
from vibroimpact.orchestrator.scene.measuring_models import DRIVE

MOST_STEPS = 100_000
"""Maximum rows held in memory, of one call of the session."""


class ScenePlant:
    """A scene that runs for as long as the rig is served.

    The time reached is `now`, in ticks, and `state` the voltages of its channels then. A wrong scene raises
    SceneError. A scene that cannot be a plant raises UsageError: a chain, components, a replay, a moving base, or one
    without a wired channel.
    """

    def __init__(self, settings: RigSettings) -> None:
        scene = plant_scene(settings)
        try:
            self._session = MeasuredSession(scene, settings.wiring.signals)
        except UsageError as error:
            raise UsageError(message(f"{settings.source}: rig.scene: ", error.message)) from None
        self._noise = scene.noise
        self.seed = scene.noise.seed if scene.noise is not None else 0
        self._session.begin()
        self.now = 0
        self.state: dict[str, float] = {}
        self.fineness = self._session.fineness
        self.advance(np.array([1]), np.zeros(1))

    def truth(self, volts: float) -> dict[str, float]:
        """Return the present displacement (m), velocity (m/s) and forces (N)."""
        return {**self._session.truth, "exciter_force": self._session.exciter_force(volts)}

    def noise_of(self, signal: str) -> float:
        """Return the rms of the noise on a channel; the wire of an output has that of the drive."""
        return 0.0 if self._noise is None else self._noise.of(signal or DRIVE)

    def advance(self, instants: Ticks, volts: Floats) -> dict[str, Floats]:
        """Advance to instants, with a voltage held before each; return the channels there, V before noise and ADC."""
        times = np.concatenate([[self.now], instants]) * TICK
        # after months some ticks round to the same time: the plant does not advance
        later = np.diff(times) > 0.0
        rows = {name: [np.array([value])] for name, value in self.state.items()}
        if later.any():
            for block in self._blocks(times[np.append(True, later)], volts[later]):
                for name, values in block.items():
                    rows.setdefault(name, [np.zeros(1)]).append(values)
        found = {name: np.concatenate(parts)[np.cumsum(later)] for name, parts in rows.items()}
        self.now = int(instants[-1])
        self.state = {name: float(values[-1]) for name, values in found.items()}
        return found

    def _blocks(self, times: Floats, volts: Floats) -> Iterator[dict[str, Floats]]:
        steps = np.cumsum(self._session.instants_in(times))
        begin = 0
        while begin < len(volts):
            done = steps[begin - 1] if begin else 0
            end = max(int(np.searchsorted(steps, done + MOST_STEPS)), begin + 1)
            yield self._session.advance(times[begin : end + 1], volts[begin:end])
            begin = end

    def restart(self, tick: int) -> None:
        """Do nothing: the plant runs on when a measurement begins."""

    def close(self) -> None:
        """Release the components."""
        self._session.close()


def plant_scene(settings: RigSettings) -> Scene:
    """Return the scene of a rig as its plant: without its sweep, and without an end."""
    assert settings.rig.scene is not None
    scene = load_scene(settings.beside(settings.rig.scene))
    if not scene.is_lone_body:
        raise UsageError(
            f"{settings.source}: rig.scene: expected an oscillator or a beam, got a scene of another kind."
        )
    try:
        return scene.unswept().with_values({"execution.impact_limit": MOST_IMPACTS_PER_POINT})
    except SceneError as error:
        raise UsageError(message(f"{settings.source}: rig.scene: ", error.message)) from None


def opened_plant(settings: RigSettings) -> Plant:
    """Return the plant of a rig: its scene or its recording."""
    return Playback(settings) if settings.rig.recording is not None else ScenePlant(settings)
