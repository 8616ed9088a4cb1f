"""A body of any tool at a rigid stop (an ImpactStop with restitution): a pair whose second body never moves."""

from __future__ import annotations

import math
from collections.abc import Mapping

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.pairs.all_pairs import Pairs
from vibroimpact.orchestrator.importer.pairs.ends import Motion, PointEnd, SurfaceEnd
from vibroimpact.orchestrator.importer.pairs.pair import Pair
from vibroimpact.orchestrator.importer.specification import BodyPoint, PairSpec
from vibroimpact.orchestrator.importer.stop_contacts.force_input import ForceInputs
from vibroimpact.orchestrator.importer.stop_contacts.held_force import HeldForceBond


class RigidStop(Pair):
    """A body of any tool, and a stop that answers the speed of each impact with a coefficient of restitution.

    The contact's stop says in each run whether it is rigid. All pairs of the importer share the scale of motion and
    the impulses of a body. `inputs` are the force inputs so far.
    """

    def __init__(
        self,
        components: Mapping[str, Component],
        bond: HeldForceBond,
        pairs: Pairs,
        inputs: ForceInputs,
    ) -> None:
        contact = bond.contact
        names = contact.body, contact.displacement, contact.velocity, contact.force
        point = BodyPoint(*names, contact.mass)
        self._bond = bond
        self._watch = bond.watch
        """Model exchange: the watch that ends the body's steps at the stop. No step is repeated."""
        self._point = PointEnd(components, point, inputs, pairs.pulses)
        self._face = SurfaceEnd(components[contact.stop])
        spec = PairSpec(point, (contact.stop, "position"), law="restitution")
        super().__init__(spec, self._point, self._face, pairs.scale, pairs.pulses)
        self.impacts = bond.impacts

    @property
    def struck(self) -> Component:
        """The body that gets the event of an impact."""
        return self._bond.body

    def begin(self, time: float) -> None:
        """Start a run with the side and the position of the stop."""
        stop, pulse = self._bond.stop, self._point.pulse
        assert pulse is not None
        pulse.given = self._bond.given_mass
        self._face.position = stop.sign * stop.position
        is_upper = stop.sign > 0.0
        self.lower, self.upper = (self._point, self._face) if is_upper else (self._face, self._point)
        super().begin(time)
        if self._watch is not None:
            self._watch.put(self._face.position, stop.sign)
            self._is_new = False  # no rate limits its steps

    def _refuse_stateless(self) -> None:
        if self._watch is None:
            super()._refuse_stateless()

    def begin_step(self, time: float, target: float, steps: float) -> float:
        """Prepare the contact for a step, as `Pair` does; returns where the step should end, s."""
        target = super().begin_step(time, target, steps)
        if self._watch is not None and self.closed:
            self._watch.disarm()
        elif self._watch is not None:
            self._watch.arm(self._room)
        return target

    def end_step(self, size: float) -> None:
        """Accept the step of `size` s, as `Pair` does."""
        if self._watch is not None:  # a body that has begun at rest on its stop has a scale by now
            self.look()
            self._room = max(self._room, self._scale.room(self._time + size))
        super().end_step(size)

    def _meeting(self, time: float, end: float) -> float | None:
        return super()._meeting(time, end) if self._watch is None else None

    def _known(self, impulse: float) -> float:
        assert self._point.pulse is not None
        return impulse if self._point.pulse.knows_mass else math.nan

    def _refuse_rest(self, time: float) -> None:
        lacks = "a force input" if self._bond.contact.force is None else "canGetAndSetFMUState"
        if self._bond.contact.force is not None and self._bond.revisable:
            return
        raise ComponentError(
            f"{self.name}: expected bounces that go on, got bounces that end in rest near time {time:.12g} (their sum "
            f"is finite: Zeno's limit). A body without {lacks} cannot be held on its stop: end the run before, or "
            "use a body that has it.",
            instance=self._bond.body.name,
            time=time,
        )

    def strike(self, now: Motion, time: float, *, is_first: bool) -> None:
        """Give the body the impulse of its impact, as `Pair` does, with the stop's restitution at this speed."""
        self.restitution = self._bond.stop.restitution(now.closing)
        super().strike(now, time, is_first=is_first)

    def free(self) -> None:
        """Free the states that trial steps have saved."""
        self._point.free()
