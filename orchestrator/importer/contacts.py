"""The contacts of an importer with yielding stops (our contact ports, or any other body), and its pairs of bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.contact_impacts import ContactImpacts
from vibroimpact.orchestrator.importer.pairs.all_pairs import Pairs
from vibroimpact.orchestrator.importer.pairs.ends import PointEnd
from vibroimpact.orchestrator.importer.pairs.pair import Pair
from vibroimpact.orchestrator.importer.pairs.rigid_stops import RigidStop
from vibroimpact.orchestrator.importer.specification import (
    BodyPoint,
    ConnectionSpec,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.importer.stop_contacts.contact_bond import (
    DAMPING,
    FORCE,
    PORT_OUTPUTS,
    STIFFNESS,
    ContactBond,
)
from vibroimpact.orchestrator.importer.stop_contacts.force_input import ForceInputs
from vibroimpact.orchestrator.importer.stop_contacts.held_force import HeldForceBond
from vibroimpact.orchestrator.importer.stop_contacts.law_bond import LawBond, law_bond_of
from vibroimpact.orchestrator.importer.wiring import Transfer

#: Communication steps that a contact is divided into by default.
CONTACT_STEPS = 30


class ContactBonds:
    """All contacts of an importer whose stops may yield."""

    def __init__(
        self,
        components: dict[str, Component],
        transfers: Sequence[Transfer],
        connections: Sequence[ConnectionSpec],
        contacts: Sequence[StopContactSpec],
        pairs: Sequence[PairSpec],
        steps: float,
    ) -> None:
        if not steps > 0.0:
            raise ComponentError(f"contact_steps: expected a number > 0, got {steps!r}.")
        self._steps = steps
        _refuse_model_exchange(components, connections, contacts, pairs)
        self.ports = [
            ContactBond(components, transfers, c)
            for c in connections
            if _is_contact_force(components[c.target[0]], c.target[1])
        ]
        """Contacts of a body's contact port, which follows the force and slopes of a stop."""
        inputs: ForceInputs = {}
        self.held = [HeldForceBond(components, contact, inputs) for contact in contacts]
        """Contacts of any other body, which holds a force over a step."""
        self.pairs = Pairs(components, pairs, inputs)
        """Contacts of two bodies that hit each other."""
        self._components, self._inputs = components, inputs
        self._rigid: dict[str, RigidStop] = {}
        self._held: list[HeldForceBond] = []
        self._laws: dict[str, LawBond] = {}
        self._following: list[ContactBond | HeldForceBond | LawBond | Pair] = []
        self.met_at_start: list[Component] = []
        """Bodies without event mode whose contacts begin with the first step of a run."""
        self.active = False
        """Some contact is closed in the step under way, or its step may be repeated."""

    def _all(self) -> list[ContactBond | HeldForceBond]:
        return [*self.ports, *self.held]

    def __bool__(self) -> bool:
        """Whether there is any contact."""
        return bool(self.ports or self.held or self.pairs.pairs)

    def take_numbers(self, contacts: Sequence[StopContactSpec], pairs: Sequence[PairSpec]) -> None:
        """Take the masses of `contacts` and the numbers of `pairs` for the next run; the rest of both is unchanged."""
        for pair, spec in zip(self.pairs.specified, pairs, strict=True):
            pair.take(spec)
        for bond, contact in zip(self.held, contacts, strict=True):
            bond.given_mass = contact.mass

    @property
    def have_no_say(self) -> bool:
        """Whether all contacts of the run need only the values that connections carry."""
        return not (self._following or self.held or self.pairs.pairs)

    def begin(self, time: float) -> None:
        """Start a run at `time`, s: initialization has ended."""
        for bond in self._all():
            bond.begin()
        self.pairs.begin(time, [self._rigid_stop(bond) for bond in self.held if bond.stop.is_rigid])
        yielding = [bond for bond in self.held if not bond.stop.is_rigid]
        self._laws = self._begun_laws(yielding)
        self._held = [bond for bond in yielding if bond.name not in self._laws]
        for bond in self._held:
            bond.refuse_model_exchange()
        follows = (bond for bond in self.ports if bond.follows)
        self._following = [*follows, *self._held, *self._laws.values(), *self.pairs.pairs]
        self.active = False

    def _begun_laws(self, yielding: Sequence[HeldForceBond]) -> dict[str, LawBond]:
        """Begin the contacts whose force belongs to the derivatives, unless others write to their force inputs."""
        found = {bond.name: law for bond in yielding if (law := law_bond_of(bond)) is not None}
        others = {end.input for pair in self.pairs.pairs for end in pair.ends if isinstance(end, PointEnd)}
        others |= {bond.input for bond in yielding if bond.name not in found}
        free = {name: law for name, law in found.items() if law.input not in others}
        if all([law.begin() for law in free.values()]):
            return free
        for law in free.values():
            law.end()
        return {}

    @property
    def _yielding(self) -> list[HeldForceBond | LawBond]:
        return [*self._held, *self._laws.values()]

    def law_of(self, stop: Component) -> LawBond | None:
        """Return the contact of a stop whose force belongs to the derivatives of its body; None for others."""
        return next((law for law in self._laws.values() if law.stop is stop), None)

    def _rigid_stop(self, bond: HeldForceBond) -> RigidStop:
        found = self._rigid.get(bond.name)
        if found is None:
            found = RigidStop(self._components, bond, self.pairs, self._inputs)
            self._rigid[bond.name] = found
        return found

    def begin_step(self, time: float, target: float) -> float:
        """Prepare all contacts for a step; returns where it should end, s."""
        target = self.pairs.pulses.begin_step(time, target)
        if not self.pairs.pulses.under_way:
            for held in self._held:
                held.check_mass(time, target - time)
        for bond in self._following:
            target = bond.begin_step(time, target, self._steps)
        self.active = any(bond.active for bond in self._following)
        met = [pair.lower.body for pair in self.pairs.pairs if pair.begins_pressed]
        self.met_at_start = [*(bond.body for bond in self._yielding if bond.begins_pressed), *met]
        return target

    def apply(self) -> None:
        """Write the forces of the bodies, or the slopes that their stops do not give."""
        for bond in self._following:
            bond.apply()

    def revised_end(self, time: float, end: float) -> float | None:
        """Return the end of the step if the last one must be repeated, s; None if it is accepted."""
        open_pairs = [pair for pair in self.pairs.pairs if not pair.closed]
        pressed = [bond for bond in self._following if bond not in open_pairs]
        # free pairs are checked once all forces agree
        for bonds in (pressed, open_pairs):
            found = [e for e in (bond.revised_end(time, end) for bond in bonds) if e is not None]
            if bonds is pressed and not found and (again := self.pairs.rest_end(time, end)) is not None:
                return again
            if found:
                return min(found)
        return None

    def agree(self, time: float, end: float) -> None:
        """Adjust held forces to the end of the step, s, before the bodies without states make theirs."""
        for bond in self._held:
            bond.agree(time, end)

    def end_step(self, size: float) -> list[Component]:
        """Accept the step of `size` s; returns the bodies without event mode that have met a stop at its end."""
        for bond in self._following:
            bond.end_step(size)
        self.pairs.pulses.end_step(size)
        met = [pair.lower.body for pair in self.pairs.pairs if pair.arrived]
        return [*(bond.body for bond in self._yielding if bond.arrived), *met]

    @property
    def impacts(self) -> tuple[list[ContactImpacts], list[ContactImpacts]]:
        """Impacts of contacts with stops, and of pairs, each in the order of their specifications."""
        return [bond.impacts for bond in self.held], [pair.impacts for pair in self.pairs.specified]

    def remarks(self) -> list[str]:
        """Remarks on the errors of held forces, and on the drift of bodies at rest on each other."""
        remarks = [*(bond.remark() for bond in self.held), *(pair.remark() for pair in self.pairs.pairs)]
        return [text for text in remarks if text]

    def free(self) -> None:
        """Free their saved states."""
        for bond in self._all():
            bond.free()
        self.pairs.free()
        for stop in self._rigid.values():
            stop.free()


def _is_contact_force(body: Component, variable: str) -> bool:
    """Whether this input is the force of a contact port that can follow a yielding stop."""
    port, _, last = variable.rpartition(".")
    needed = (*PORT_OUTPUTS, "law", "side", "position", "mass", STIFFNESS, DAMPING)
    return last == FORCE and all(f"{port}.{name}" in body.variables for name in needed)


def _refuse_model_exchange(
    components: Mapping[str, Component],
    connections: Sequence[ConnectionSpec],
    contacts: Sequence[StopContactSpec],
    pairs: Sequence[PairSpec],
) -> None:
    """Raise ComponentError for a stop, or a contact port, that runs as model exchange."""
    forces = [c for c in connections if _is_contact_force(components[c.target[0]], c.target[1])]
    ports = [end for pair in pairs for end in (pair.lower, pair.upper) if not isinstance(end, BodyPoint)]
    names = [
        *(name for c in forces for name in (c.source[0], c.target[0])),
        *(c.stop for c in contacts),
        *(port[0] for port in ports),
    ]
    for name in names:
        if components[name].kind == "model_exchange":
            raise ComponentError(
                f"{name}: expected a stop or a contact port that runs as co-simulation, got model exchange, "
                "which has no laws of other components.",
                instance=name,
            )
