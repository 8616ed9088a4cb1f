"""All pairs of a run: the impulses at one instant, and the forces of all bodies at rest on each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.pairs.ends import Scale, end_of
from vibroimpact.orchestrator.importer.pairs.pair import Pair
from vibroimpact.orchestrator.importer.specification import PairSpec
from vibroimpact.orchestrator.importer.stop_contacts.force_input import ForceInputs
from vibroimpact.orchestrator.importer.stop_contacts.pulse import Pulses

#: Most impulses at one instant; more are an error.
MOST_IMPULSES = 10_000
#: Change of the forces of bodies at rest, relative to the largest force, below which they agree.
REST_TOLERANCE = 1e-10


class Pairs:
    """All pairs of bodies of an importer that hit each other."""

    def __init__(
        self,
        components: Mapping[str, Component],
        specs: Sequence[PairSpec],
        inputs: ForceInputs,
    ) -> None:
        self.scale = Scale()
        """Largest displacement and speed of all pairs, by which others are small."""
        self.pulses = Pulses(components)
        """The impulses of other tools' bodies."""
        self.specified = []
        """All pairs, in the order of their specifications."""
        for spec in specs:
            impulses = self.pulses if spec.law == "restitution" else None
            lower, upper = (end_of(components, end, inputs, impulses) for end in (spec.lower, spec.upper))
            self.specified.append(Pair(spec, lower, upper, self.scale, self.pulses))
        self.pairs = self.specified
        """The specified pairs, and other tools' bodies at the rigid stops of the run."""

    def begin(self, time: float, stops: Sequence[Pair] = ()) -> None:
        """Start a run after initialization; `stops` are its rigid stops."""
        self.scale.displacement = self.scale.speed = 0.0
        self.pulses.begin()
        self.pairs = [*self.specified, *stops]
        bodies = {body.name: body for pair in self.pairs for body in pair.bodies}
        self._instances = [
            body.instance
            for body in bodies.values()
            if body.event_mode and isinstance(body.instance, Instance3)
        ]
        for pair in self.pairs:
            pair.look()
        for pair in self.pairs:
            pair.begin(time)

    def __bool__(self) -> bool:
        """Whether there is any pair."""
        return bool(self.pairs)

    def resolve(self, time: float) -> list[str]:
        """Give the impulses of the instant `time`, s; return the lower body of each impact.

        ComponentError: impulses do not end, or bodies are pressed together.
        """
        hit: list[str] = []
        if not any(pair.is_due(pair.look(), time) for pair in self.pairs):
            return hit
        self.pulses.measure(time)
        for instance in self._instances:
            instance.check(instance.enter_event_call(), "EnterEventMode")
        met = {pair for pair in self.pairs if pair.is_due(pair.look(), time)}
        for _ in range(MOST_IMPULSES):
            due = [(now.closing, pair, now) for pair in self.pairs if pair.is_due(now := pair.look(), time)]
            if not due:
                break
            closing, pair, now = max(due, key=lambda found: found[0])
            if pair.is_pressed(now, time):
                raise pair.pressed_error(time)
            pair.strike(now, time, is_first=pair in met)
            met.discard(pair)
            if closing > self.scale.slow:
                hit.append(pair.struck.name)
        else:
            raise self._endless(time)
        for instance in self._instances:
            instance.check(instance.enter_step_call(), "EnterStepMode")
        return hit

    def rest_end(self, time: float, end: float) -> float | None:
        """Make the forces of all bodies at rest agree; returns where to repeat the step to, s, or None."""
        resting = [pair for pair in self.pairs if pair.rests]
        if not resting or not end > time:
            return None
        size = end - time
        mobility = np.array([[a.mobility(b) for b in resting] for a in resting])
        change = np.linalg.lstsq(mobility, [pair.excess(size) for pair in resting], rcond=None)[0] / size
        largest = max(abs(pair.force) for pair in resting)
        if np.abs(change).max() > REST_TOLERANCE * largest:
            for pair, more in zip(resting, change, strict=True):
                pair.force += float(more)
            return end
        weakest = min(resting, key=lambda pair: pair.force)
        if weakest.force < 0.0:
            weakest.stop_resting()
            return end
        return None

    def _endless(self, time: float) -> ComponentError:
        names = ", ".join(pair.name for pair in self.pairs if pair.is_due(pair.look(), time))
        return ComponentError(
            f"{names}: expected impacts that end, got {MOST_IMPULSES} at time {time:.17g}. "
            "Use a law that yields: kelvin_voigt, hertz or hunt_crossley.",
            instance=self.pairs[0].lower.body.name,
            time=time,
        )

    def free(self) -> None:
        """Free the states saved for trials, before the bodies are freed."""
        self.pulses.free()
        for pair in self.specified:
            pair.lower.free()
            pair.upper.free()
