"""Orbits of bodies on stops that yield, for given phases of the beginnings of their contacts: equations.md 4.18."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.errors import OrbitError
from vibroimpact.analysis.orbits.yielding_stops.linear_flow import LinearFlow, value_of, zero_of
from vibroimpact.analysis.orbits.yielding_stops.passages import (
    ForcedModes,
    LinearPassage,
    Passage,
    Path,
    RigidPassage,
)
from vibroimpact.analysis.orbits.yielding_stops.power_passages import ALIKE, PowerPassage
from vibroimpact.analysis.orbits.yielding_stops.single_contacts import Guess, guesses
from vibroimpact.fmus.bodies.impacting_body import Contact, Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import Evaluation, OrbitEnd

TURN = 2.0 * np.pi
MOST_STEPS = 40
"""Number of Newton steps after which the search for a periodic state fails."""
MOST_HALVINGS = 10
"""Largest number of halvings of a Newton step until the state returns nearer to itself."""
CLOSE = 1e-14
"""Change of a periodic state by a Newton step, over its size, below which the state is found."""
QUADRATIC = 1e-8
"""Change by a Newton step, over the size of the state, below which this step is the last: its error is the square."""
RETURNS = 1e-9
"""Distance of a state from its return, over its size, above which Newton's method has found none."""
PARTS = (1.0, 0.5, 1.5, 0.25, 2.0)
"""Durations of contacts, over those without other forces, from which the search for a periodic state begins."""
FAMILY = "orbit: expected an orbit that is isolated, got a family: the body loses no energy."
MOST_OF_GAP = 0.6
"""Largest guess of the duration of a contact, over the time to the next one."""

Contacts = NDArray[np.int32]
Law = RigidPassage | LinearPassage | PowerPassage


@dataclass(frozen=True, eq=False)
class Segment:
    """A part of an orbit between two events.

    Attributes
    ----------
    begin, duration : float
        s, from the first contact on.
    path : Path
    state : array
        Vector of `ForcedModes` at its beginning.
    pressed : int
        Contact that is pressed in it, -1: none.
    left : int
        Contact whose stop the body has just left, -1: none.
    """

    begin: float
    duration: float
    path: Path
    state: Floats
    pressed: int = -1
    left: int = -1


@dataclass(frozen=True, eq=False)
class Train:
    """A motion with contacts that begin at given phases.

    Attributes
    ----------
    entries : array, shape (p, 2 modes)
        States before the contacts.
    passages : tuple of Passage
    flights : array, shape (p, 2 modes, 2 modes)
        Flow from the end of each contact to the beginning of the next.
    end : array, shape (2 modes,)
        State after the periods: that of the beginning on an orbit.
    rates : array, shape (p, 2 modes)
        Rates of the states before the contacts, 1/s; the first at the end.
    segments : tuple of Segment
    """

    entries: Floats
    passages: tuple[Passage, ...]
    flights: Floats
    end: Floats
    rates: Floats
    segments: tuple[Segment, ...]

    @cached_property
    def slope(self) -> Floats:
        """Derivative of the end by the state at the beginning, for fixed phases."""
        found = np.eye(self.end.size)
        for flight, passage in zip(self.flights, self.passages, strict=True):
            found = flight @ passage.slope @ found
        return found

    @cached_property
    def monodromy(self) -> Floats:
        """Derivative of the state before the first contact by the state q periods before."""
        found = np.eye(self.end.size)
        for flight, passage in zip(self.flights, self.passages, strict=True):
            found = flight @ passage.tangent @ found
        return found

    def values(self, name: str) -> Floats:
        """Return a number of all passages, such as `speed`."""
        return np.array([getattr(each, name) for each in self.passages])


class YieldingMotion:
    """The motions of a body whose stops yield, or yield and are rigid: equations.md 4.18.

    Parameters
    ----------
    body : ImpactingBody
    """

    def __init__(self, body: ImpactingBody) -> None:
        self.body = body
        self.forced = ForcedModes(body)
        self.beyond = np.array([self.forced.beyond(each) for each in body.contacts])
        self.approach = np.array([self.forced.approach(each) for each in body.contacts])
        self.signs = np.array([each.direction for each in body.contacts])
        self._last: tuple[object, Floats | None, Train] | None = None

    @cached_property
    def passages(self) -> tuple[Law, ...]:
        """The passages through the contacts of the body."""
        return tuple(self._passage(each) for each in self.body.contacts)

    def _passage(self, contact: Contact) -> Law:
        if contact.press is None:
            return RigidPassage(self.forced, contact)
        if contact.press.is_linear:
            return LinearPassage(self.forced, contact, contact.press.stiffness, contact.press.damping)
        return PowerPassage(self.forced, contact, contact.press)

    # ---- a train of contacts ----

    def train(self, contacts: Contacts, phases: Floats, periods: int, start: Floats) -> Train:
        """Return the motion from a state before the first contact on, with contacts that begin at given phases.

        OrbitError: a contact lasts longer than to the beginning of the next one.
        """
        forced, flow = self.forced, self.forced.free
        gaps = _gaps(phases, periods) / self.body.angular_frequency
        begins = np.append(0.0, np.cumsum(gaps)[:-1])
        entries, passages, flights, rates, segments = [start], [], [], [], []
        for contact, phase, gap, begin in zip(contacts, phases, gaps, begins, strict=True):
            before = forced.vector(entries[-1], phase)
            passage = self.passages[contact].through(before, gap)
            if passage.duration >= gap:
                raise OrbitError(
                    f"orbit: expected contacts one after the other, got one of {passage.duration:.6g} s, while the "
                    f"next one begins after {gap:.6g} s."
                )
            if passage.path is not None:
                pressed = before.copy()
                pressed[forced.offset] = self.beyond[contact] @ before
                segments.append(Segment(begin, passage.duration, passage.path, pressed, int(contact)))
            flight = gap - passage.duration
            away = forced.vector(passage.after, phase + passage.duration * self.body.angular_frequency)
            over = flow.over(flight)
            arrived = over @ away
            segments.append(Segment(begin + passage.duration, flight, flow, away, left=int(contact)))
            passages.append(passage)
            flights.append(over[forced.motion, forced.motion])
            rates.append((flow.matrix @ arrived)[forced.motion])
            entries.append(arrived[forced.motion])
        return Train(
            np.array(entries[:-1]),
            tuple(passages),
            np.array(flights),
            entries[-1],
            np.array(rates[-1:] + rates[:-1]),
            tuple(segments),
        )

    def periodic(self, contacts: Contacts, phases: Floats, periods: int, start: Floats | None) -> Train:
        """Return the motion that repeats after some periods, with contacts that begin at given phases.

        Newton's method begins at a state before the first contact, or at guesses of the durations of the contacts.
        OrbitError: there is none near to the start.
        """
        key = contacts.tobytes(), phases.tobytes(), periods
        last = self._last
        if last is not None and start is not None and last[0] == key:
            known = (each for each in (last[1], last[2].entries[0]) if each is not None)
            if any(np.array_equal(start, each) for each in known):
                return last[2]
        found = self._periodic(contacts, phases, periods, start)
        self._last = key, start, found
        return found

    def _periodic(self, contacts: Contacts, phases: Floats, periods: int, start: Floats | None) -> Train:
        starts = self.guesses(contacts, phases, periods) if start is None else iter([start])
        problem = OrbitError(
            f"orbit: expected contacts that a motion has, got phases {np.round(phases, 6).tolist()}."
        )
        for each in starts:
            try:
                return self._returning(contacts, phases, periods, each)
            except OrbitError as failed:
                problem = failed
        raise problem

    def _returning(self, contacts: Contacts, phases: Floats, periods: int, start: Floats) -> Train:
        now = self.train(contacts, phases, periods, start)
        weights = np.repeat([self.body.angular_frequency, 1.0], self.forced.modes)
        least = np.inf
        for _ in range(MOST_STEPS):
            away = now.end - now.entries[0]
            size = float(np.linalg.norm(weights * now.entries[0])) + 1e-300
            distance = float(np.linalg.norm(weights * away)) / size
            step = self._solved(np.eye(away.size) - now.slope, away)
            change = float(np.linalg.norm(weights * step)) / size
            if change < CLOSE or (distance < RETURNS and distance >= 0.5 * least):
                return now
            if change < QUADRATIC:
                return self.train(contacts, phases, periods, now.entries[0] + step)
            least = min(least, distance)
            nearer = self._nearer(
                contacts, phases, periods, now, step, (weights, float(np.linalg.norm(weights * away)))
            )
            if nearer is None:
                break
            now = nearer
        if distance < RETURNS:
            return now
        raise OrbitError(
            f"orbit: expected contacts that a motion has, got phases {np.round(phases, 6).tolist()}."
        )

    def _nearer(
        self,
        contacts: Contacts,
        phases: Floats,
        periods: int,
        now: Train,
        step: Floats,
        far: tuple[Floats, float],
    ) -> Train | None:
        """Return a motion that returns nearer to its start, a part of a step away; None if there is none."""
        weights, distance = far
        part = 1.0
        for _ in range(MOST_HALVINGS):
            try:
                tried = self.train(contacts, phases, periods, now.entries[0] + part * step)
            except OrbitError:
                tried = None
            if (
                tried is not None
                and np.linalg.norm(weights * (tried.end - tried.entries[0])) < 1.5 * distance
            ):
                return tried
            part *= 0.5
        return None

    @staticmethod
    def _solved(matrix: Floats, right: Floats) -> Floats:
        try:
            return np.asarray(np.linalg.solve(matrix, right))
        except np.linalg.LinAlgError:
            raise OrbitError(
                "orbit: expected an orbit that is isolated, got a family: the body loses no energy."
            ) from None

    def guesses(self, contacts: Contacts, phases: Floats, periods: int) -> Iterator[Floats]:
        """Yield states before the first contact of motions whose contacts last as long as without other forces."""
        gaps = _gaps(phases, periods) / self.body.angular_frequency
        usual = np.array([self.usual_duration(int(each)) for each in contacts])
        for part in PARTS:
            yield self.start_of(contacts, phases, periods, np.minimum(part * usual, MOST_OF_GAP * gaps))

    def usual_duration(self, contact: int) -> float:
        """Return the duration of a contact without other forces, s."""
        law = self.passages[contact]
        return 0.0 if isinstance(law, RigidPassage) else law.usual_duration

    def start_of(self, contacts: Contacts, phases: Floats, periods: int, durations: Floats) -> Floats:
        """Return the state before the first contact of the motion that repeats with contacts of given durations."""
        forced = self.forced
        gaps = _gaps(phases, periods) / self.body.angular_frequency
        whole, added = np.eye(2 * forced.modes), np.zeros(2 * forced.modes)
        for contact, phase, gap, duration in zip(contacts, phases, gaps, durations, strict=True):
            over = forced.free.over(gap - duration) @ self.fixed(int(contact), duration)
            none = forced.vector(np.zeros(2 * forced.modes), phase)
            whole = over[forced.motion, forced.motion] @ whole
            added = over[forced.motion, forced.motion] @ added + (over @ none)[forced.motion]
        return self._solved(np.eye(added.size) - whole, added)

    def at_stop(self, contact: int, phase: float, speed: float) -> Floats:
        """Return the state of a body of one mode before a contact with a speed towards the stop, m/s."""
        vector = self.forced.vector(np.zeros(2), phase)
        shape = self.body.contacts[contact].shape[0]
        moved = self.beyond[contact] @ vector, self.approach[contact] @ vector
        return np.array([-moved[0] / shape, (self.signs[contact] * speed - moved[1]) / shape])

    def fixed(self, contact: int, duration: float) -> Floats:
        """Return the linear map of a contact of a given duration, with the surface of the stop in its place."""
        law = self.passages[contact]
        return law.matrix if isinstance(law, RigidPassage) else law.fixed(duration)

    def single_contacts(self, contact: int, periods: int) -> Iterator[Guess]:
        """Yield guesses of the orbits with one contact."""
        law, whole = self.passages[contact], periods * self.body.period
        if isinstance(law, LinearPassage):
            yield from guesses(self.forced, law, self.beyond[contact], whole)
        elif isinstance(law, PowerPassage):
            for speed, alike in law.equivalents():
                for guess in guesses(self.forced, alike, self.beyond[contact], whole):
                    vector = self.forced.vector(guess.start, guess.phase)
                    ratio = self.signs[contact] * float(self.approach[contact] @ vector) / speed
                    if 1.0 / ALIKE < ratio < ALIKE:
                        yield guess

    # ---- what orbits need ----

    def evaluate(
        self, contacts: Contacts, phases: Floats, periods: int, start: Floats | None = None
    ) -> Evaluation:
        """Return velocities and distances for given phases of the contacts' beginnings; OrbitError without a motion."""
        found = self.periodic(contacts, phases, periods, start)
        forced, count = self.forced, phases.size
        moved, by_start = self.derivatives(found, count)
        first = np.linalg.solve(np.eye(found.end.size) - by_start[count], moved[count])
        states, by_phase, speeds_by_phase = self.at_stops(found, contacts, phases)
        signs = self.signs[contacts]
        rows, faster = self.beyond[contacts], self.approach[contacts]
        change = moved[:count] + by_start[:count] @ first
        slopes, velocity_slopes = (
            signs[:, None] * np.einsum("ki,kij->kj", each[:, forced.motion], change)
            for each in (rows, faster)
        )
        return Evaluation(
            OrbitEnd.done,
            signs * np.einsum("ij,ij->i", faster, states),
            signs * np.einsum("ij,ij->i", rows, states),
            slopes + np.diag(by_phase),
            velocity_slopes + np.diag(speeds_by_phase),
            found.entries[0],
        )

    def derivatives(self, train: Train, count: int) -> tuple[Floats, Floats]:
        """Return derivatives of the states before the contacts, and at the end, by phases and by the first state.

        Shapes (p + 1, 2 modes, p), for a fixed first state, and (p + 1, 2 modes, 2 modes).
        """
        n, w = train.end.size, self.body.angular_frequency
        moved, by_start = np.zeros((count + 1, n, count)), np.zeros((count + 1, n, n))
        by_start[0] = np.eye(n)
        for k, (flight, passage) in enumerate(zip(train.flights, train.passages, strict=True)):
            over = flight @ passage.slope
            moved[k + 1], by_start[k + 1] = over @ moved[k], over @ by_start[k]
            moved[k + 1][:, k] += flight @ passage.shift / w
            # the end moves with the first phase, q periods later
            moved[k + 1][:, (k + 1) % count] += train.rates[(k + 1) % count] / w
        return moved, by_start

    def at_stops(self, train: Train, contacts: Contacts, phases: Floats) -> tuple[Floats, Floats, Floats]:
        """Return vectors before the contacts, and rates per radian of distances and speeds by the stops' own motion."""
        forced = self.forced
        states = np.array([forced.vector(*each) for each in zip(train.entries, phases, strict=True)])
        own = states @ forced.free.matrix.T / self.body.angular_frequency
        own[:, forced.motion] = 0.0
        signs = self.signs[contacts]
        by_phase, faster = (
            signs * np.einsum("ij,ij->i", each[contacts], own) for each in (self.beyond, self.approach)
        )
        return states, by_phase, faster

    def highest(self, phases: Floats, train: Train) -> tuple[float, float, int]:
        """Return the highest maximum beside the contacts: its depth beyond the stop (m), phase, contact (-1: none).

        A stop that is pressed again before the body has left it counts with the depth at that moment.
        """
        found = (-np.inf, 0.0, -1)
        for segment in train.segments:
            for depth, time, contact in self._peaks(segment):
                if depth > found[0]:
                    phase = phases[0] + (segment.begin + time) * self.body.angular_frequency
                    found = depth, float(phase), contact
        return found

    def _peaks(self, segment: Segment) -> Iterator[tuple[float, float, int]]:
        """Yield depth, time and contact of the highest maximum of each contact in a segment."""
        flow = segment.path
        times = np.append(np.arange(0.0, segment.duration, flow.step), segment.duration)
        states = flow.along(segment.state, times)
        depths = self.signs[:, None] * (self.beyond @ states)
        rates = self.signs[:, None] * (self.approach @ states)
        for contact in range(len(self.signs)):
            if contact == segment.pressed:
                continue
            tops = np.flatnonzero((rates[contact, :-1] > 0.0) & (rates[contact, 1:] <= 0.0))
            if tops.size:
                # a cubic between two samples has its maximum below these control points
                bound = np.maximum(depths[contact, tops], depths[contact, tops + 1])
                for k in tops[np.argsort(-bound)][:2]:
                    yield self._peak(
                        flow, states[:, k], contact, float(times[k]), float(times[k + 1] - times[k])
                    )
            if contact == segment.left and (k := self._pressed_again(contact, depths[contact], states)):
                yield float(depths[contact, k]), float(times[k]), contact

    def _pressed_again(self, contact: int, depths: Floats, states: Floats) -> int:
        """Return the first sample after a contact at which its stop is pressed before it is left; 0: there is none."""
        law = self.passages[contact]
        if isinstance(law, RigidPassage):
            return 0
        inside = np.cumprod(depths > 0.0).astype(bool)
        again = (inside & law.presses(states))[1:]  # the contact has just ended at the first
        return 1 + int(np.argmax(again)) if again.any() else 0

    def _peak(
        self, flow: Path, state: Floats, contact: int, time: float, step: float
    ) -> tuple[float, float, int]:
        """Return the maximum within a step from a state."""
        rows = self.signs[contact] * np.vstack([self.beyond[contact], self.approach[contact]])
        if not isinstance(flow, LinearFlow):  # its samples are close
            return max(float(rows[0] @ state), float(rows[0] @ state + rows[1] @ state * step)), time, contact
        series = flow.polynomial(rows, state)
        top = zero_of(series[:, 1], 0.0, step)
        return value_of(series[:, 0], top), time + top, contact

    def states(self, train: Train, phases: Floats, first: float) -> Floats:
        """Return the states at phases from that of the first contact on, shape (2 modes, phases)."""
        times = (phases - first) / self.body.angular_frequency
        begins = np.array([each.begin for each in train.segments])
        own = np.clip(np.searchsorted(begins, times, side="right") - 1, 0, begins.size - 1)
        found = np.empty((2 * self.forced.modes, times.size))
        for k, segment in enumerate(train.segments):
            later = np.clip(times[own == k] - segment.begin, 0.0, None)
            if later.size:
                found[:, own == k] = segment.path.along(segment.state, later)[self.forced.motion]
        return found

    def observed(self, train: Train, phases: Floats, first: float) -> tuple[Floats, Floats]:
        """Return displacement and velocity of the observed point at phases from that of the first contact on."""
        found, modes = self.states(train, phases, first), self.forced.modes
        return self.body.observed @ found[:modes], self.body.observed @ found[modes:]


def start_near(
    body: ImpactingBody,
    contacts: NDArray[np.integer],
    phases: Floats,
    periods: int,
    speeds: Floats,
    durations: Floats | None,
) -> Floats | None:
    """Return a state before the first of recorded contacts; None where stops are rigid, or it is not known.

    Parameters
    ----------
    contacts, phases, speeds, durations : array, shape (p,)
        From 0; rad, ascending; m/s; s, NaN for a contact that is open at the end of the record.
    periods : int
        q.
    """
    if not body.yields:
        return None
    motion = yielding_motion(body)
    if body.frequencies.size == 1:
        return motion.at_stop(int(contacts[0]), float(phases[0]), float(speeds[0]))
    if durations is None or not np.isfinite(durations).all():
        return None
    return motion.start_of(contacts.astype(np.int32), phases, periods, durations)


@lru_cache(maxsize=32)
def yielding_motion(body: ImpactingBody) -> YieldingMotion:
    """Return the motions of a body with stops that yield; the same object for the same body."""
    return YieldingMotion(body)


def _gaps(phases: Floats, periods: int) -> Floats:
    """Return the phases from each contact to the next, rad."""
    return np.append(phases[1:], phases[0] + TURN * periods) - phases
