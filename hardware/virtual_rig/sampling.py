"""Outputs, plant and inputs from one tick to another."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.hardware.virtual_rig.inputs import Inputs
from vibroimpact.hardware.virtual_rig.plant import Floats, Plant, Ticks
from vibroimpact.hardware.virtual_rig.profiles import Profile
from vibroimpact.hardware.virtual_rig.settings import RigSettings
from vibroimpact.hardware.virtual_rig.tasks import INPUT, OUTPUT, Channel, Task

Levels = Callable[[int, Ticks], Floats]
"""Voltages of an output, by its number, just after ticks."""
Seen = Callable[[str, Ticks], Floats]
"""Values of a signal of the plant, by its name, at ticks."""


class Sampling:
    """The analog side of a device; `held` are the present voltages of the outputs, V, shape (output,)."""

    def __init__(self, settings: RigSettings, profile: Profile, plant: Plant) -> None:
        self._wiring, self._plant = settings.wiring, plant
        self.held = np.zeros(profile.outputs)
        noise = {number: plant.noise_of(wire.signal) for number, wire in settings.wiring.inputs.items()}
        self.inputs = Inputs(profile.bits, noise, plant.seed, settings.rig.clock_error)

    @property
    def driving(self) -> float:
        """The present voltage of the driving output."""
        return 0.0 if self._wiring.driver is None else float(self.held[self._wiring.driver])

    def advance(self, running: Sequence[Task], target: int) -> set[str]:
        """Advance tasks and plant to a tick; return the names of the tasks whose output ran empty."""
        updates = {task.name: task.generated(target) for task in running if task.kind == OUTPUT}
        edges = {task.name: task.samples_until(target) for task in running if task.kind == INPUT}
        parts = [ticks for ticks, _, _ in updates.values()]
        parts += [ticks for channels in edges.values() for ticks in channels]
        instants = np.unique(np.concatenate([*parts, [target]]))
        instants = instants[instants > self._plant.now].astype(np.int64)
        levels = self._levels(running, updates)
        befores = np.concatenate([[self._plant.now], instants[:-1]])
        driver = self._wiring.driver
        volts = np.zeros(len(befores)) if driver is None else levels(driver, befores)
        for task in running:
            if task.kind == INPUT and task.count == 0 and edges[task.name][0].size:
                self._plant.restart(int(task.edge(0)))
        found = self._plant.advance(instants, volts)
        for task in running:
            if task.kind == INPUT:
                self._take_in(
                    task,
                    edges[task.name],
                    levels,
                    lambda signal, at: found[signal][np.searchsorted(instants, at)],
                )
        for task in running:
            if task.kind == OUTPUT:
                self._put_out(task, *updates[task.name][:2])
        return {name for name, (_, _, starved) in updates.items() if starved}

    def _levels(self, running: Sequence[Task], updates: dict[str, tuple[Ticks, Floats, bool]]) -> Levels:
        changes = {
            channel.number: (updates[task.name][0], updates[task.name][1][place])
            for task in running
            if task.kind == OUTPUT
            for place, channel in enumerate(task.channels)
        }

        def levels(number: int, ticks: Ticks) -> Floats:
            at, values = changes.get(number, (np.empty(0, dtype=np.int64), np.empty(0)))
            known = np.concatenate([[self.held[number]], values])
            found: Floats = known[np.searchsorted(at, ticks, side="right")]
            return found

        return levels

    def _take_in(self, task: Task, edges: Sequence[Ticks], levels: Levels, seen: Seen) -> None:
        for place, (channel, ticks) in enumerate(zip(task.channels, edges, strict=True)):
            if ticks.size:
                task.keep(place, self._codes(channel, ticks, levels, seen))
        task.report(task.sampled[-1])

    def _codes(self, channel: Channel, ticks: Ticks, levels: Levels, seen: Seen) -> NDArray[np.int16]:
        wire = self._wiring.inputs.get(channel.number)
        if channel.output is not None:
            volts = levels(channel.output, ticks - 1)
        elif wire is None:
            volts = np.zeros(ticks.shape)
        else:
            # an edge of a shared clock samples the output value before that edge
            seen_there = seen(wire.signal, ticks) if wire.output is None else levels(wire.output, ticks - 1)
            volts = seen_there if wire.amplification is None else wire.amplification * seen_there
        return self.inputs.codes(channel, volts)

    def _put_out(self, task: Task, ticks: Ticks, samples: Floats) -> None:
        if ticks.size:
            for place, channel in enumerate(task.channels):
                self.held[channel.number] = samples[place, -1]
        task.report(task.count + ticks.size)

    def now(self, channels: Sequence[Channel]) -> NDArray[np.int16]:
        """Return the present codes of inputs, without a clock; shape (channel,)."""
        ticks = np.array([self._plant.now])
        levels = self._levels((), {})
        state = self._plant.state
        found = [
            self._codes(channel, ticks, levels, lambda signal, at: np.array([state[signal]]))
            for channel in channels
        ]
        return np.concatenate(found)
