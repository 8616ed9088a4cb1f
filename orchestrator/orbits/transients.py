"""The study `transients`: the number of periods in which a scene forgets its start.

Motions from other starts are followed next to the scene's own, and compared at each forcing phase 0. Near a periodic
motion their distance falls by a constant factor a period. This factor is the largest Floquet multiplier of the orbit;
for the body without impacts it is exp(-zeta omega T) of its slowest mode. Further away the distance may do anything.
Starts at the size of the motion are therefore followed as well as near ones.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.classify import RunClass
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.operations.transients import TransientsOf
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.planes import beyond_stops
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_clock import signals_of
from vibroimpact.orchestrator.scene.forcing_models import Forcing, forces_in_words
from vibroimpact.orchestrator.ssp import opened_scene

HISTORY = "transients followed by vibroimpact"
TABLE = ResultTable(
    "transients",
    ("period", "period", "1", "periods since the first phase 0 of the force"),
    ("distance", "start period", "1", "distance from the scene's own motion, over the size of that motion"),
    ("first_distance", "start", "1", "distance at time 0, over the size of the scene's own motion"),
    ("forgotten_after", "start", "1", "periods after which the distance stays below the tolerance"),
    ("contraction", "start", "1", "factor by which a small distance changes in a period"),
    ("motion", "start", "1", "class of the motion in the end", "text"),
    ("end", "start", "1", "what became of the start", "text"),
)
MOST_STARTS, MOST_PERIODS = 1000, 1_000_000
SMALL, ROUNDING = 1e-2, 1e-13
"""Range of distances for the contraction: above SMALL the motion is not linear, below ROUNDING is rounding."""
FURTHER = 1e-2
"""Part of the tolerance down to which starts are followed, so that their contraction is measured."""
FEWEST = 3
"""Fewest periods for a measured contraction."""
SAME = 1e-4
"""Distance over the size of the motion, below which two states are on one orbit."""
LOOKS = (100, 200, 400, 800, 1600)
"""Periods after which the study checks whether all starts have reached their final motion."""
SINE_KEYS = ("signal", "angular_frequency", "frequency", "phase")
"""Keys of a sine that a constant force does not have."""
SURVEY = 50
"""Periods of the scene's own motion that define its size."""
DRAWS = 100
"""Draws of a start, of which at least one must be on the free side of the stops."""
FORGOTTEN, ELSEWHERE, SHIFTED, CHAOTIC, SLOW, LOST = (
    *("forgotten", "another attractor", "the same orbit, whole periods apart"),
    *("chaotic: nothing is forgotten", "not forgotten yet", "the run failed"),
)


class Verdicts(NamedTuple):
    """Classes of all motions, the scene's own first, and the end of each start."""

    motions: list[str]
    ends: list[str]


@dataclass(eq=False)
class Transients(Study[Floats]):
    """Distances of starts from a scene's own motion: see `vibroimpact.transients`. A row has those of one period."""

    name = "transients"
    nothing = "a period"
    begins = "Following starts"
    history = HISTORY

    scene: Scene
    starts: int = 8
    spread: float = 1.0
    tolerance: float = 1e-6
    periods: int = 3000

    def __post_init__(self) -> None:
        _refuse(self)
        self.scene = self.scene.unswept()
        self.is_forced = self.scene.period is not None
        if not self.is_forced and self.scene.is_lone_body:
            self.scene = _with_the_first_mode(self.scene)
        self.body = impacting_body(self.scene, yielding=True)

    @classmethod
    def prepare(cls, options: TransientsOf, stack: ExitStack) -> Self:
        """Open the scene."""
        opened = opened_scene(options.scene, options.changes or ())
        return cls(opened, options.starts, options.spread, options.tolerance, options.periods)

    def rows(self) -> Generator[Floats, None, None]:
        """Follow all starts from one phase 0 to the next, until all are near or the periods are over."""
        flow = BodyFlow(self.scene, workers=1)
        try:
            self._scale = _size(flow, self.body)
            states = self._first_states()
            self._first = self._apart(states)
            for period in range(self.periods):
                ends = flow.follow(states, 1, first=period == 0)
                states = np.where(ends.well[:, None], ends.states, np.nan)
                distances = self._apart(states)
                self.status(f"{counted(period, 'period')}, farthest start {max(distances, default=0.0):.1e}")
                yield distances
                if not (distances > FURTHER * self.tolerance).any():
                    break
                if period + 1 in LOOKS:
                    self._verdicts = self._what_became(flow, states)
                    if SLOW not in self._verdicts.ends and CHAOTIC not in self._verdicts.ends:
                        return
            self._verdicts = self._what_became(flow, states)
        finally:
            flow.close()

    def _first_states(self) -> Floats:
        """Return the scene's own start, and others around it on the free side of the stops."""
        numbers = float_parameters(self.scene, None)
        own = np.array([[numbers.get(name, 0.0) for name in self.scene.body.start_names]])
        draw = np.random.default_rng(1)
        found = [own]
        for _ in range(self.starts):
            drawn = own + self.spread * self._scale * draw.uniform(-1.0, 1.0, (DRAWS, own.shape[1]))
            free = drawn[~beyond_stops(self.scene, self.body, drawn)]
            if not len(free):
                raise UsageError(
                    "transients: spread: expected starts on the free side of the stops, got none. Try a smaller one."
                )
            found.append(free[:1])
        return np.concatenate(found)

    def _apart(self, states: Floats) -> Floats:
        apart: Floats = np.abs((states[1:] - states[0]) / self._scale).max(axis=1)
        return apart

    @property
    def linear_contraction(self) -> float:
        """Factor per period of the body without impacts, in its slowest mode."""
        return 1.0 if self.body.loose else math.exp(-self.body.slowest_decay * self.body.period)

    def made(self) -> xr.Dataset:
        """Return the distances, and the end of each start."""
        distances = np.array(self.found).T
        after = [_after(row, self.tolerance) for row in distances]
        ends = [FORGOTTEN if math.isfinite(each) else SLOW for each in after]
        verdicts = Verdicts(["unknown"] * (self.starts + 1), ends) if self.incomplete else self._verdicts
        values = {
            "period": np.arange(distances.shape[1]),
            "distance": distances,
            "first_distance": self._first,
            "forgotten_after": after,
            "contraction": [_contraction(row) for row in distances],
            "motion": verdicts.motions[1:],
            "end": verdicts.ends,
        }
        attributes = scene_attributes(self.scene, HISTORY) | {
            "units_system": self.scene.units,
            "tolerance": self.tolerance,
            "linear_contraction": self.linear_contraction,
            "motion": verdicts.motions[0],
            "period_length": self.body.period,
            "period_of": "the force" if self.is_forced else "the first mode",
        }
        return TABLE.dataset(values, attributes, units=self.scene.units)

    def _what_became(self, flow: BodyFlow, states: Floats) -> Verdicts:
        """Return the class of each motion, and the end of each start, by runs from the present states."""
        (own, *others), last = flow.classes(states, 0)
        orbit = [last[0]]
        for _ in range(1, own.periods):
            orbit.append(flow.follow(orbit[-1][None], 1).states[0])
        distances = np.array(self.found)
        ends = [
            self._end(distances[:, place], own, kind, (last[place + 1] - np.array(orbit)) / self._scale)
            for place, kind in enumerate(others)
        ]
        return Verdicts([kind.name for kind in (own, *others)], ends)

    def _end(self, distances: Floats, own: RunClass, kind: RunClass, apart: Floats) -> str:
        """Return the end of a start.

        `distances` are from the scene's own motion, period by period; `apart`, shape (period, variable), is from each
        state of the scene's orbit. `own` and `kind` are the classes of the scene's own motion and of the start.
        """
        if np.isnan(distances[-1]):
            return LOST
        if math.isfinite(_after(distances, self.tolerance)):
            return FORGOTTEN
        if OrbitClass.unknown in (own.kind, kind.kind):
            return SLOW
        if own.name != kind.name:
            return ELSEWHERE
        if own.kind is OrbitClass.chaos:
            return CHAOTIC
        if (np.abs(apart[1:]) < SAME).all(axis=1).any():
            return SHIFTED
        return ELSEWHERE if _stays(distances, max(own.periods, 1)) else SLOW

    def print_results(self) -> None:
        """Print a row for each start, and their joint result."""
        data = self.dataset
        rows = table(
            f"Transients: {self.scene.title or self.scene.source}",
            *(">start", ">first distance", ">forgotten after", ">contraction", "<motion", "<end"),
        )
        for place in range(self.starts):
            one = data.isel(start=place)
            rows.add_row(
                f"{place + 1}",
                f"{float(one.first_distance):.3g}",
                _or_dash(float(one.forgotten_after), ".0f"),
                _or_dash(float(one.contraction), ".6g"),
                str(one.motion.item()),
                str(one.end.item()),
            )
        wide_terminal().print(rows)
        for line in verdict(data):
            say(line)


def verdict(data: xr.Dataset) -> list[str]:
    """Return the result of a dataset of transients as sentences."""
    ends, after = data["end"].values.tolist(), data["forgotten_after"].values
    many, tolerance = len(ends), float(data.attrs["tolerance"])
    what = "" if data.attrs["period_of"] == "the force" else " of the first mode"
    lines = []
    if ends.count(FORGOTTEN) == many:
        lines.append(
            f"The start is forgotten to {tolerance:g} after {counted(int(after.max()), 'period')}{what}."
        )
    elif CHAOTIC in ends:
        lines.append("The motion is chaotic: its start is never forgotten, only its statistics are the same.")
    else:
        lines.append(
            f"{ends.count(FORGOTTEN)} of {counted(many, 'start')} forgotten after "
            f"{counted(data.sizes['period'], 'period')}{what}."
        )
    if other := sorted(
        {str(data["motion"].values[place]) for place in range(many) if ends[place] == ELSEWHERE}
    ):
        lines.append(
            f"{ends.count(ELSEWHERE)} of {counted(many, 'start')} end on another attractor ({', '.join(other)}): "
            "the motion hangs on the start."
        )
    if SHIFTED in ends:
        lines.append(
            f"{ends.count(SHIFTED)} of {counted(many, 'start')} end on the same orbit, whole periods apart: "
            "which period it is in is never forgotten."
        )
    if SLOW in ends:
        lines.append("Some are not there yet: follow more periods, or allow a larger tolerance.")
    known = data["contraction"].values[np.isfinite(data["contraction"].values) & (after < np.inf)]
    measured = f"{float(np.median(known)):.6g}" if known.size else "not seen"
    linear = float(data.attrs["linear_contraction"])
    lines.append(f"Contraction a period: {measured}; of the body without impacts {linear:.6g}.")
    return lines


def _refuse(study: Transients) -> None:
    """Raise UsageError unless the numbers are in their ranges."""
    if not 1 <= study.starts <= MOST_STARTS:
        raise UsageError(f"transients: starts: expected 1 to {MOST_STARTS}, got {study.starts}.")
    if not 1 <= study.periods <= MOST_PERIODS:
        raise UsageError(f"transients: periods: expected 1 to {MOST_PERIODS}, got {study.periods}.")
    if not (math.isfinite(study.spread) and study.spread > 0.0):
        raise UsageError(f"transients: spread: expected a finite number > 0, got {study.spread:g}.")
    if not 1e-10 <= study.tolerance < 1.0:
        raise UsageError(f"transients: tolerance: expected 1e-10 to 1, got {study.tolerance:g}.")


def _with_the_first_mode(scene: Scene) -> Scene:
    """Return a scene without a force as a scene with zero force, with the period of its first mode on a spring.

    Constant forces stay beside the force of amplitude 0.
    """
    if scene.moving_stop:
        raise UsageError(
            f"{scene.source}: {scene.moving_stop}: expected stops that stand still, got one that moves."
        )
    if signals_of(scene.forces):
        got = forces_in_words(scene.forces)
        raise UsageError(f"{scene.source}: forcing: expected sines, constant forces or no force, got {got}.")
    loads = _constant_loads(scene)

    def forced(frequency: float) -> Scene:
        record = {"transient_periods": 0, "recorded_periods": 1}
        sine = {"kind": "base_acceleration", "amplitude": 0.0, "angular_frequency": frequency}
        return scene.with_values({"record": record, "forcing": [sine, *loads]})

    body = impacting_body(forced(1.0))
    if body.loose == body.frequencies.size:
        raise UsageError(f"{scene.source}: forcing: expected one where no body has a spring, got none.")
    return forced(float(body.frequencies[body.loose]))


def _constant_loads(scene: Scene) -> list[dict[str, Any]]:
    """Return the tables of a scene's constant forces, of which one may be a sine of frequency 0."""
    written = parse_toml(scene.text).get("forcing", [])
    loads = []
    for given, force in zip(written if isinstance(written, list) else [written], scene.forces, strict=True):
        load = {key: value for key, value in given.items() if key not in SINE_KEYS}
        if isinstance(force, Forcing):
            load["amplitude"] = (np.array(force.amplitude) * math.cos(force.phase)).tolist()
        loads.append({**load, "signal": "constant"})
    return loads


def _size(flow: BodyFlow, body: ImpactingBody) -> Floats:
    """Return the size of the scene's own motion in time, for each displacement and velocity."""
    numbers = float_parameters(flow.scene, None)
    state = np.array([[numbers.get(name, 0.0) for name in flow.names]])
    seen = [state[0]]
    for period in range(SURVEY):
        state = flow.follow(state, 1, first=period == 0).states
        seen.append(state[0])
    sizes = np.nan_to_num(np.abs(np.array(seen))).max(axis=0)
    half = sizes.size // 2
    least = 1e-3 * body.scale / float(np.abs(body.contacts[0].shape).max())
    length = max(float(sizes[:half].max()), float(sizes[half:].max()) / body.angular_frequency, least)
    return np.repeat([length, length * body.angular_frequency], half)


def _after(distances: Floats, tolerance: float) -> float:
    """Return the period from which all distances are below a tolerance; infinite if the last is not."""
    above = np.flatnonzero(~(distances <= tolerance))
    if not above.size:
        return 0.0
    return math.inf if above[-1] == distances.size - 1 else float(above[-1] + 1)


def _stays(distances: Floats, periods: int) -> bool:
    """Return whether a distance is equal in the last two rounds of some periods."""
    before, last = distances[-2 * periods : -periods], distances[-periods:]
    return before.size == periods and bool((np.abs(last - before) <= SAME * before).all())


def _contraction(distances: Floats) -> float:
    """Return the factor per period of a small distance in the end; NaN if it is not seen.

    >>> round(_contraction(0.5 ** np.arange(40.0)), 12)
    0.5
    """
    large = np.flatnonzero(~(distances < SMALL))
    small = distances[large[-1] + 1 if large.size else 0 :]
    ends = np.flatnonzero(small < ROUNDING)
    small = small[: ends[0]] if ends.size else small
    if small.size < FEWEST:
        return math.nan
    return math.exp(float(np.polyfit(np.arange(small.size), np.log(small), 1)[0]))


def _or_dash(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
