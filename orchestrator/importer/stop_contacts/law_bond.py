"""A contact of a body in model exchange with an ImpactStop that yields: the stop's law is part of the derivatives.

The integration finds touch-down and separation as roots, and the force in between from displacement and velocity at
every evaluation. No step is short for a contact or repeated, and no force is held: the energy residual is 0.
"""

from __future__ import annotations

from vibroimpact.fmus.core.contact_laws import contact_laws
from vibroimpact.fmus.core.model_exchange import WatchedLaw
from vibroimpact.orchestrator.fmi.exchange import ExchangeInstance
from vibroimpact.orchestrator.fmi.watched_points import ContactWatch
from vibroimpact.orchestrator.importer.stop_contacts.held_force import HeldForceBond

#: Distance below which a body touches its stop, relative to its displacement plus the position of the stop.
TOUCHING = 1e-14
#: Trial force, N: a displacement or a velocity that follows it at once does not depend on the states alone.
TRIAL_FORCE = 1.0
#: Parameters of the stop's law, as an ImpactStop names them.
NUMBERS = ("stiffness", "damping", "exponent")


class LawBond:
    """One contact whose force belongs to the derivatives of its body; it stands for a `HeldForceBond` in a run.

    `arrived`: the step just made has ended at the surface. `begins_pressed`: the step under way is the first, and the
    contact begins with it.
    """

    active = False

    def __init__(self, bond: HeldForceBond, watch: ContactWatch) -> None:
        self._bond, self._watch = bond, watch
        self.body, self.stop = bond.body, bond.stop.component
        self.impacts, self.input = bond.impacts, bond.input
        assert isinstance(bond.body.instance, ExchangeInstance)
        self.instance = bond.body.instance
        self._law = bond.stop.component.group("Int64", ["law"])
        self._numbers = bond.stop.component.group("Float64", list(NUMBERS))
        self.arrived = self.begins_pressed = False

    def begin(self) -> bool:
        """Start a run; returns whether the derivatives can have the force, which moves no displacement or velocity."""
        if not self._is_of_states():
            return False
        stop, numbers = self._bond.stop, dict(zip(NUMBERS, map(float, self._numbers.get()), strict=True))
        assert self._bond.contact.force is not None
        force = self.body.variables[self._bond.contact.force].valueReference
        self._watch.put(stop.position * stop.sign, stop.sign)
        self._watch.press_by(WatchedLaw(law=int(self._law.get()[0]), **numbers), force)
        displacement, velocity = self._bond.motion()
        is_inside = displacement > stop.position and stop.force(displacement, velocity, 0.0) > 0.0
        self._watch.is_pressed = is_inside
        self._is_new, self._was_pressed, self._impulse = True, False, 0.0
        self.arrived = self.begins_pressed = False
        return True

    def _is_of_states(self) -> bool:
        free = self._bond.motion()
        self.input.write(TRIAL_FORCE)
        pushed = self._bond.motion()
        self.input.write()
        return pushed == free

    def end(self) -> None:
        """Take the force out of the derivatives: the bond has no part in the run."""
        self._watch.disarm()

    def begin_step(self, time: float, target: float, steps: float) -> float:
        """Prepare the contact for a step; returns where the step should end, s: where it is."""
        displacement, velocity = self._bond.motion()
        self._watch.arm(TOUCHING * (abs(displacement) + abs(self._bond.stop.position)))
        self.begins_pressed = self._is_new and self._watch.is_pressed
        if self._watch.is_pressed and not self._was_pressed:
            self.impacts.touch(time, velocity)
        self._is_new, self._was_pressed, self._end = False, self._watch.is_pressed, time
        return target

    def apply(self) -> None:
        """Do nothing: the derivatives have the force."""

    def revised_end(self, time: float, end: float) -> float | None:
        """Return None: no step is repeated."""
        return None

    def end_step(self, size: float) -> None:
        """Accept the step of `size` s: note its impulse, and the end of the contact."""
        velocity = self._bond.motion()[1]
        self._end += size
        if self._was_pressed:
            self.impacts.press(self._watch.impulse - self._impulse, self._watch.largest)
            if not self._watch.is_pressed:
                self.impacts.part(self._end, -velocity)
                self._was_pressed = False
        self._impulse = self._watch.impulse
        self.arrived = self._watch.is_pressed and not self._was_pressed
        self.show()

    def show(self) -> None:
        """Show the stop the present motion of its body: it has no memory, and its outputs follow."""
        self._bond.stop.show(*self._bond.motion())


def law_bond_of(bond: HeldForceBond) -> LawBond | None:
    """Return a bond whose force belongs to the derivatives; None for another body or stop of this run."""
    stop = bond.stop
    if bond.watch is None or bond.contact.force is None or stop.law not in _own_yielding_laws():
        return None
    if stop.surface is None or not set(NUMBERS) <= set(stop.component.variables):
        return None
    return LawBond(bond, bond.watch)


def _own_yielding_laws() -> set[int]:
    laws = contact_laws().values()
    return {law.number for law in laws if law.stop == "yielding" and not law.external}
