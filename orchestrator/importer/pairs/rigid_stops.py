"""A body of any tool at a rigid stop (an ImpactStop with restitution): a pair whose second body never moves."""

from __future__ import annotations

from collections.abc import Mapping

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.pairs.all_pairs import Pairs
from vibroimpact.orchestrator.importer.pairs.ends import Motion, PointEnd, SurfaceEnd
from vibroimpact.orchestrator.importer.pairs.pair import Pair
from vibroimpact.orchestrator.importer.specification import BodyPoint, PairSpec
from vibroimpact.orchestrator.importer.stop_contacts.force_input import ForceInput
from vibroimpact.orchestrator.importer.stop_contacts.held_force import HeldForceBond
from vibroimpact.orchestrator.importer.stop_contacts.pulse import UNKNOWN_MASS, Pulse


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
        inputs: dict[tuple[str, str], ForceInput],
    ) -> None:
        contact = bond.contact
        names = contact.body, contact.displacement, contact.velocity, contact.force
        point = BodyPoint(*names, contact.mass or UNKNOWN_MASS)
        self._bond = bond
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
        assert isinstance(pulse, Pulse)
        pulse.given = self._bond.given_mass
        self._face.position = stop.sign * stop.position
        is_upper = stop.sign > 0.0
        self.lower, self.upper = (self._point, self._face) if is_upper else (self._face, self._point)
        super().begin(time)

    def strike(self, now: Motion, time: float, *, is_first: bool) -> None:
        """Give the body the impulse of its impact, as `Pair` does, with the stop's restitution at this speed."""
        self.restitution = self._bond.stop.restitution(now.closing)
        super().strike(now, time, is_first=is_first)

    def free(self) -> None:
        """Free the states that trial steps have saved."""
        self._point.free()
