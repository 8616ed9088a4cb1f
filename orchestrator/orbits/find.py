"""The study `orbit`: periodic orbits of a scene with given p and q, and the orbit on which a long run ends."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import IMPACT_COLUMNS, Outcome, RunRecord
from vibroimpact.analysis.dataset.provenance import program_attributes
from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.branches import multiplier_text
from vibroimpact.analysis.orbits.classify import RunClass, class_of
from vibroimpact.analysis.orbits.found import FoundOrbits
from vibroimpact.analysis.orbits.own_orbits import own_orbit_of_impacts
from vibroimpact.analysis.orbits.periodic import least_speed
from vibroimpact.analysis.orbits.search import STARTS, each_orbit, fastest_first, same_orbit
from vibroimpact.analysis.orbits.yielding_stops.motion import start_near
from vibroimpact.analysis.study import Study, whole
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.operations.orbit import FindOrbits
from vibroimpact.orchestrator.orbits.beginning import files_of, orbit_start, refuse_contradictions
from vibroimpact.orchestrator.orbits.bodies import impacting_body, refuse_without_energy
from vibroimpact.orchestrator.orbits.seeds import Seed
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.running.kept import opened_scene as kept_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene

HISTORY = "periodic orbits found by vibroimpact"
LONGEST = 16
"""Most forcing periods of an orbit on which a run may end."""
TRANSIENT = 2000
"""Forcing periods of a run before its orbit is read."""
RECORDED = 64
"""Forcing periods in which its orbit is read: chaos takes 40 periods to recognise, an orbit twice its own."""
SETTLING_TURNS, RECORDED_TURNS = 400, 100
"""Turns of the slowest mode of a run without a force before its orbit is read, and while it is."""
LARGEST_PHASE = 1e6
"""Largest phase of a seed, rad; a larger phase has lost digits within its turn."""
REPEATS = 1e-4
"""Difference of phases, rad, below which a run is near an orbit; Newton's method converges from there."""


@dataclass(eq=False)
class OrbitsOfScene(Study[PeriodicOrbit]):
    """Periodic orbits of a scene; a row is an orbit. See `vibroimpact.find_orbits`."""

    name = "orbit"
    nothing = "an orbit"
    history = HISTORY
    mark = ""

    scene: Scene
    impacts: int | None = None
    periods: int | None = None
    seed: Seed | None = None
    penetrating: bool = False

    def __post_init__(self) -> None:
        self.scene = self.scene.unswept()
        self._end = ""

    @classmethod
    def reads(cls, options: FindOrbits) -> Sequence[Path]:
        """Return scene and dataset."""
        return [options.scene, *files_of(options)]

    @classmethod
    def prepare(cls, options: FindOrbits, stack: ExitStack) -> Self:
        """Open the scene, at the values of the run that is on the orbit."""
        refuse_contradictions(options)
        changes = options.changes or ()
        first = orbit_start(options, opened_scene(options.scene, changes, for_orbits=True), changes)
        return cls(first.scene, first.impacts, first.periods, first.seed, options.penetrating)

    def rows(self) -> Generator[PeriodicOrbit, None, None]:
        """Yield the orbit near the seed, the orbits of given counts, or P(1,1) and the orbit of a long run."""
        body, counts = impacting_body(self.scene, all_kinds=True), (self.impacts, self.periods)
        refuse_without_energy(self.scene, body)
        if self.seed is not None:
            yield _of_seed(body, self.seed, self.impacts, 1 if self.periods is None else self.periods)
            return
        impacts, periods = (1 if count is None else count for count in counts)
        yield from each_orbit(body, impacts, periods, penetrating=self.penetrating)
        self.found.sort(key=fastest_first)
        if counts != (None, None) and self._physical:
            return
        reached, self._end = end_of_run(self.scene)
        if counts == (None, None) and reached and not any(same_orbit(reached, one) for one in self.found):
            yield reached

    @property
    def orbits(self) -> FoundOrbits:
        """All found orbits, as a list with a dataset."""
        return FoundOrbits(self.found, self.scene.units, self._attributes)

    def _attributes(self) -> dict[str, Any]:
        return scene_attributes(self.scene, HISTORY) | program_attributes()

    def made(self) -> xr.Dataset:
        """Return the physical orbits as runs."""
        return self.orbits.dataset

    @property
    def _physical(self) -> list[PeriodicOrbit]:
        return [orbit for orbit in self.found if orbit.is_physical]

    @property
    def written(self) -> xr.Dataset | None:
        """The physical orbits; None without any."""
        return self.dataset if self._physical else None

    @property
    def drawn(self) -> FoundOrbits | None:
        """All orbits; None without any."""
        return self.orbits if self.found else None

    def print_results(self) -> None:
        """Print a row for each orbit."""
        own = self.scene.period is None
        rows = table(
            f"Periodic orbits: {self.scene.title or self.scene.source}",
            *("<orbit", "<", *((">period",) if own else ()), "<phases, rad", "<stops", "<impact velocities"),
            *("<largest multipliers", ">determinant, off by", ">nearest maximum"),
            rows=map(_row, self.found),
        )
        if self.found:
            wide_terminal().print(rows)
        many = counted(len(self._physical), "physical orbit")
        say(f"{many}." if self._physical else f"No physical orbit {self._called}.")
        if self._end and not (self._physical and self._end in {orbit.name for orbit in self._physical}):
            say(f"A long run of the scene ends on {self._end}.")
        drifts = [orbit.shift for orbit in self.found if orbit.body.drift is not None]
        if drifts:
            say(
                f"Nothing ties the body to the ground: from the scene's start it drifts by {drifts[0]:.6g} over the "
                "first orbit. Any other velocity of the whole gives the same impacts."
            )
        if own and self.found:
            off = max(abs(orbit.multiplier_of_motion - 1.0) for orbit in self.found)
            say(f"Each orbit has one more multiplier, 1, of the motion along itself; found to {off:.0e}.")

    @property
    def _called(self) -> str:
        """Description of the orbits in search."""
        if self.seed is not None:
            return "near to the seed"
        if self.impacts is None and self.periods is None:
            return "P(1,1), and none that a long run ends on"
        tried = (
            ""
            if self.impacts in (None, 1) or self.scene.period is None
            else f" near {STARTS} trains of impacts"
        )
        return f"P({self.impacts or 1},{self.periods or 1}){tried}"

    def conclude(self, options: FindOrbits) -> None:
        """Say that no dataset was written."""
        if options.output is not None and not self._physical:
            say(f"{options.output} is not written: it would hold no orbit.")


def find_orbits(
    scene: Scene,
    impacts: int | None = None,
    periods: int | None = None,
    *,
    seed: Seed | None = None,
    penetrating: bool = False,
) -> FoundOrbits:
    """Return periodic orbits of a scene, stable and unstable: see `vibroimpact.find_orbits`."""
    return whole(OrbitsOfScene(scene, impacts, periods, seed, penetrating)).orbits


def _of_seed(body: ImpactingBody, seed: Seed, impacts: int | None, periods: int) -> PeriodicOrbit:
    if body.has_own_period:
        raise UsageError(
            "seed: expected none, by --seed or --from-dataset, of a body without a force, got one: its phases count "
            "from a force. Give the number of impacts, or a start that leads to the orbit."
        )
    if impacts not in (None, len(seed)):
        raise UsageError(f"seed: expected {impacts} impacts, as many as the orbit has, got {len(seed)}.")
    for phase, stop in seed:
        if abs(phase) > LARGEST_PHASE:
            raise UsageError(f"seed: expected phases up to {LARGEST_PHASE:g} rad, got {phase:g}.")
        if not 1 <= stop <= len(body.contacts):
            raise UsageError(f"seed: expected stops 1 to {len(body.contacts)}, got {stop}.")
    phases, contacts = [phase for phase, _ in seed], [stop - 1 for _, stop in seed]
    orbit = find_orbit(body, phases, contacts, periods)
    if not (orbit.velocities > least_speed(body)).all():
        raise OrbitError(
            "orbit: expected impacts towards the stops near to the seed, got velocities "
            f"{orbit.velocities.round(6).tolist()}. Try other phases."
        )
    return orbit.once


@contextmanager
def long_runs(scene: Scene) -> Iterator[Callable[[Mapping[str, float], State | None], RunRecord]]:
    """Yield a function that runs a scene long at values of its keys, from a carried state or from its own start."""
    kept = ("impacts",) if scene.period is None else ("extrema", "strobe", "impacts", "each_period")
    values = {f"record.{name}": True for name in kept}
    with kept_scene(scene.with_values({**_long_record(scene), **values})) as opened:
        yield opened.runner.record_of


def _long_record(scene: Scene) -> dict[str, float]:
    """Return the keys of a long record: of forcing periods, or of turns of the slowest mode without a force."""
    names = ("record.transient_periods", "record.recorded_periods")
    if scene.period is not None:
        return dict(zip(names, (TRANSIENT, RECORDED), strict=True))
    turn = 2.0 * np.pi / impacting_body(scene, all_kinds=True).slowest
    names = ("record.transient_time", "record.recorded_time")
    return dict(zip(names, (SETTLING_TURNS * turn, RECORDED_TURNS * turn), strict=True))


def class_of_record(record: RunRecord) -> RunClass:
    """Return the class of a run that recorded its extrema and strobes."""
    if record.periods is None:
        return RunClass(OrbitClass.unknown, reason=f"the run ended by {Outcome(record.outcome).name}")
    sticks = record.sticks is not None and len(record.sticks) > 0
    return class_of(record.periods[:, :4], record.periods[:, 4], Outcome(record.outcome), sticks)


def end_of_run(scene: Scene) -> tuple[PeriodicOrbit | None, str]:
    """Return the orbit on which a long run of a scene ends, None unless it has few periods, and the motion in words.

    Words are empty where only impacts are recorded: without a force.
    """
    with long_runs(scene) as record_of:
        record = record_of({}, None)
    orbit = orbit_of_impacts(impacting_body(scene, all_kinds=True), record.impacts)
    if orbit is not None:
        return orbit, orbit.name
    return None, "" if record.periods is None else end_in_words(class_of_record(record))


def end_in_words(kind: RunClass) -> str:
    """Return the class of a run for a sentence on where runs end."""
    return "a motion of unknown class" if kind.kind is OrbitClass.unknown else kind.name


def orbit_of_impacts(
    body: ImpactingBody, rows: Floats | None, *, longest: int = LONGEST
) -> PeriodicOrbit | None:
    """Return the orbit of the last impacts of a run; None unless it has few periods."""
    if rows is None or not len(rows):
        return None
    if body.has_own_period:
        return own_orbit_of_impacts(body, rows[:, 0], rows[:, 2], rows[:, 4].astype(int) - 1, REPEATS)
    turns = np.floor(
        (rows[:, 0] - rows[0, 0] + (rows[0, 1] - rows[:, 1]) / body.angular_frequency) / body.period + 0.5
    )
    phases, contacts = rows[:, 1] + 2.0 * np.pi * turns, rows[:, 4].astype(int) - 1
    for periods in range(1, longest + 1):
        count = int(np.count_nonzero(phases < phases[0] + 2.0 * np.pi * periods - REPEATS))
        if 2 * count > phases.size:
            return None
        apart = np.abs(phases[count : 2 * count] - phases[:count] - 2.0 * np.pi * periods).max()
        if apart > REPEATS or not (contacts[count : 2 * count] == contacts[:count]).all():
            continue
        try:
            speeds, durations = rows[:count, 2], rows[:count, IMPACT_COLUMNS.index("impact_duration")]
            start = start_near(body, contacts[:count], phases[:count], periods, speeds, durations)
            orbit = find_orbit(body, phases[:count], contacts[:count].tolist(), periods, start=start)
        except (OrbitError, UsageError):  # chatter: impacts closer than phases can resolve
            return None
        return orbit if orbit.is_physical else None
    return None


def _row(orbit: PeriodicOrbit) -> tuple[str, ...]:
    off = orbit.determinant / orbit.exact_determinant - 1.0 if orbit.exact_determinant > 0.0 else np.nan
    return (
        orbit.name,
        "stable" if orbit.is_stable else "unstable",
        *([f"{orbit.period:.10g}"] if orbit.body.has_own_period else []),
        ", ".join(f"{phase:.10g}" for phase in orbit.phases),
        ", ".join(str(contact + 1) for contact in orbit.contacts),
        ", ".join(f"{speed:.10g}" for speed in orbit.velocities),
        ", ".join(multiplier_text(each) for each in orbit.multipliers[:2]),
        f"{orbit.exact_determinant:.6g}, {off:.0e}",
        _nearest(orbit),
    )


def _nearest(orbit: PeriodicOrbit) -> str:
    beyond, _, contact = orbit.highest
    if contact < 0:
        return "none"
    if orbit.is_physical:
        return f"{-beyond:.3g} below stop {contact + 1}"
    return f"penetrates stop {contact + 1} by {beyond:.3g}"
