"""The study `accuracy`: a scene simulated in all possible ways, each against the best reference."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
import xarray as xr

import vibroimpact.orchestrator.study.clock as clock
from vibroimpact.analysis.dataset.outputs import refuse_outputs
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.operations.accuracy import Accuracy
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.study.accuracy.budget import Budget
from vibroimpact.orchestrator.study.accuracy.choice import cheapest, refuse_unreached
from vibroimpact.orchestrator.study.accuracy.measured import Comparison, Measured
from vibroimpact.orchestrator.study.accuracy.printed import print_comparison, shown, write_tuned
from vibroimpact.orchestrator.study.accuracy.reach import (
    GUARDED_SHARE,
    RECORDING_SHARE,
    Passed,
    limited_elsewhere,
    observed_within,
    transient_passed,
    within_reach,
)
from vibroimpact.orchestrator.study.accuracy.refusals import (
    refuse_misuse,
    refuse_one_way,
    refuse_vague_reference,
)
from vibroimpact.orchestrator.study.accuracy.results import dataset_of
from vibroimpact.orchestrator.study.accuracy.trying import References, tried
from vibroimpact.orchestrator.study.balance import mean_energy_of
from vibroimpact.orchestrator.study.errors import FIRST_IMPACTS
from vibroimpact.orchestrator.study.measuring_effects import motion_alone
from vibroimpact.orchestrator.study.memory import UNKNOWN
from vibroimpact.orchestrator.study.observation import LATE
from vibroimpact.orchestrator.study.orbits import orbit_of
from vibroimpact.orchestrator.study.preparing import with_modes
from vibroimpact.orchestrator.study.references import (
    DISTURBANCE,
    Reference,
    disturbed_scenes,
    observed,
    reference_of,
    scales_of,
    sensitivity_of,
)
from vibroimpact.orchestrator.study.statistics import statistics_of
from vibroimpact.orchestrator.study.ways.all_ways import remarks_on, ways_of
from vibroimpact.orchestrator.study.ways.models import modes_reference
from vibroimpact.orchestrator.study.ways.numbers_of_modes import finest_modes, opened_with_extremes
from vibroimpact.orchestrator.study.ways.way import Trial, Way

BUDGET = 40.0
"""Default budget: processor time of a study, s."""
TRYING_SHARE = 0.45
"""Largest share of the budget for the reference and one run of each way; `LEAST_RUN` of a way may exceed it."""
ATTEMPTS = 2
"""Number of runs in the share of each way: all runs but the last are given up."""
LEAST_RUN = 0.05
"""Least processor time of a run before it can be given up, s."""
MEMORY_SHARE, LEAST_MEMORY = 0.3, 2.5
"""Share of the budget kept for the memory of the ways; and processor time left, s, below which none is measured."""
STATISTICS_SHARE = 0.25
"""Largest share of the budget for the statistics of chaotic motion."""
MOST_ROUNDS = 15
"""Largest number of timed runs of each way, in turn with the others."""
EACH_SHARE = 0.1
"""Cost of a run over the time left, above which the run is too expensive to be timed again."""
REPLICATES = 6
"""Runs of chaotic motion, each from a slightly different number, that give the sampling error of its statistics."""
MOST_HALVINGS = 24
"""Largest number of halvings of the time of a chaotic general scene, until its motion is comparable."""
COMPARABLE = 1e-6
"""Relative change of the motion by a disturbance, below which the motion is comparable."""
MOST_FIRST_PERIODS = 4096
"""Largest number of periods in which the first impacts are searched."""


@dataclass(eq=False)
class AccuracyOfScene(Study[Measured]):
    """Error and cost of each way of simulating a scene: see `vibroimpact.accuracy`. A row is a way."""

    name = "accuracy"
    nothing = "a way that had run"

    scene: Scene
    tolerance: float | None = None
    quantity: str = "all"
    budget: float = BUDGET

    def __post_init__(self) -> None:
        self._show: Callable[[Measured], None] = lambda one: None
        self._chance = math.nan

    @classmethod
    def prepare(cls, options: Accuracy, stack: ExitStack) -> Self:
        """Open the scene.

        Raises
        ------
        UsageError
            The arguments are invalid, which is found before anything runs.
        """
        refuse_misuse(options.tolerance, options.of, options.budget)
        if options.write is not None and options.tolerance is None:
            raise UsageError("--write: expected a tolerance to tune for, got none. Add --tolerance 1e-6.")
        opened = opened_scene(options.scene, options.changes or ())
        if options.write is not None:
            refuse_outputs([options.scene], options.write, ending=".toml")
        refuse_outputs(opened.files, options.output, options.figure)
        return cls(with_modes(opened), options.tolerance, options.of, options.budget)

    def rows(self) -> Generator[Measured, None, None]:
        """Run all ways once, then in turn, and last each in its own process.

        Raises
        ------
        UsageError
            The quantity is unknown, the scene has nothing to vary, or the budget is below 10 s or too small for the
            scene. Or no way can reach the tolerance: it is below double precision or the error of the reference. No
            way has run then.
        """
        refuse_misuse(self.tolerance, self.quantity, self.budget)
        self._spends = Budget(self.budget)
        self._alone = studied_scene(self.scene)
        finest = finest_modes(self.scene)
        refuse_one_way(ways_of(self._alone, finest=finest), self.scene)
        self._within = within_reach(self._alone, self._spends)
        passed = transient_passed(self._within, self._spends)
        reference = reference_of(passed.scene)
        statistical = passed.scene if reference.chaotic else None
        self._orbit = _orbit_of(reference, self._within, passed)
        if reference.chaotic:
            first = first_impacts(self._within, self._spends)
            passed = Passed(first, first)
            reference = replace(reference_of(first), chaotic=True, sensitivity=reference.sensitivity)
        refuse_vague_reference(self.tolerance, self.quantity, reference)
        self._reference, self._passed = reference, passed
        given: dict[str, Any] = {
            "speed": _typical_speed(reference),
            "rate": _rate_of(self.scene),
            "whole": passed.whole,
            "finest": finest,
            "recorded": self._within,
        }
        limited, whole, recorded = (
            limited_elsewhere(one, GUARDED_SHARE * self.budget)
            for one in (passed.scene, passed.whole, self._within)
        )
        self._ways = ways_of(limited, **given | {"whole": whole, "recorded": recorded})
        references = References(reference, passed)
        yield from _measured(self._ways, references, passed, given, self._spends, statistical)
        if reference.chaotic and any(way.as_whole for way in self._ways):
            self._chance = chance_of(recorded)

    def shown(self) -> AbstractContextManager[None]:
        """Show each way as soon as it has run once."""
        return self._shown()

    @contextmanager
    def _shown(self) -> Iterator[None]:
        with shown(self.scene.title or self.scene.source, self.quantity) as self._show:
            yield

    def take(self, row: Measured) -> None:
        """Keep and show a way."""
        super().take(row)
        self._show(row)

    @cached_property
    def comparison(self) -> Comparison:
        """All ways of the finished study, with the chosen way."""
        remarks = (*remarks_on(self.scene), *_remarks(self._alone, self._within, self._passed))
        return Comparison(
            self._passed.scene,
            self._reference,
            self.found,
            self.quantity,
            math.nan if self.tolerance is None else self.tolerance,
            cheapest(self.found, self.tolerance, self.quantity, self._reference),
            self._orbit,
            remarks,
            modes_reference(self._ways),
            self._spends.effort(),
            self._chance,
        )

    def made(self) -> xr.Dataset:
        """Return the dataset of the ways with their errors and costs."""
        return dataset_of(self.comparison)

    def print_results(self) -> None:
        """Print the ways and the advice."""
        print_comparison(self.comparison)

    def conclude(self, options: Accuracy) -> None:
        """Write the scene with the chosen way; raise UsageError unless a way has reached the tolerance."""
        if self.incomplete:
            return
        refuse_unreached(self.comparison)
        if options.write is not None:
            write_tuned(self.scene.text, self.comparison, options.write)


def _measured(
    ways: Sequence[Way],
    references: References,
    passed: Passed,
    given: Mapping[str, Any],
    spends: Budget,
    statistical: Scene | None,
) -> Generator[Measured, None, None]:
    """Yield each way when it has run once; then run all ways in turn, and last each in its own process."""
    found: list[Measured] = []
    with ExitStack() as stack:
        able: list[tuple[Measured, Trial]] = []
        for place, way in enumerate(ways):
            left = TRYING_SHARE * spends.seconds - spends.spent
            one, trial = tried(way, references, max(LEAST_RUN, left / (ATTEMPTS * (len(ways) - place))))
            if trial is not None:
                spends.note(one.first, one.first_wall)
                stack.callback(trial.close)
                able.append((one, trial))
            found.append(one)
            yield one
        if statistical is not None:
            _add_statistics(statistical, given["finest"], found, references.reference, spends)
        _time_in_turn(able, spends)
    _add_memory(passed.scene, given, ways, [one for one, _ in able], spends)


def studied_scene(scene: Scene) -> Scene:
    """Return the studied form of a scene: one point, with recorded impacts and extremes.

    A body is compared by its impacts and extremes, without a time series, which costs more than the motion. General
    scenes and replays keep their samples, as they have little else to compare. A measuring chain is left out: no
    other way has one. UsageError: the scene has an exciter whose force is not its forcing alone.
    """
    alone = scene.unswept()
    if not scene.is_lone_body:
        return alone
    alone = motion_alone(alone)
    if alone.record.time_series is not None:
        document = parse_toml(alone.text)
        del document["record"]["time_series"]
        alone = Scene.from_dict(document, scene.source)
    return alone.with_values({"record.impacts": True, "record.extrema": True})


def chance_of(scene: Scene) -> float:
    """Return the largest relative difference of range and mean energy among runs from slightly different numbers."""

    def whole(one: Scene) -> tuple[float, float]:
        trial = opened_with_extremes(one, 1.0)
        try:
            return trial.run().displacement_range, mean_energy_of(one)
        finally:
            trial.close()

    own = np.array(whole(scene))
    others = np.array([whole(one) for one in disturbed_scenes(scene, REPLICATES)]).reshape(-1, 2)
    differences = np.abs(others - own)[:, own > 0.0] / own[own > 0.0]
    return float(np.nanmax(differences, initial=0.0))


def _orbit_of(reference: Reference, whole: Scene, passed: Passed) -> str:
    """Return the class of the orbit, by the run that passed the transient; empty for components and replays.

    The run with the transient counts, since a motion that starts within a lasting contact has an extra impact.
    """
    if reference.chaotic:
        return "chaotic"
    if not whole.is_lone_body:
        return ""
    found = reference.observation
    if passed.observation is not None:
        found = replace(passed.observation, held=found.held)
    return orbit_of(found, whole.period, scales_of(whole).window)


def _remarks(alone: Scene, studied: Scene, passed: Passed) -> list[str]:
    """Return remarks on the time of a scene that is left out, with the reasons."""
    remarks = [passed.remark] if passed.remark else []
    if studied is not alone:
        end, whole = (scales_of(one).window[1] - scales_of(one).window[0] for one in (studied, alone))
        remarks.append(
            f"all but the first {end:.3g} s of the {whole:.3g} s that are recorded: one run of all of it takes too "
            "much of the budget"
        )
    return remarks


def first_impacts(scene: Scene, spends: Budget) -> Scene:
    """Return a scene from its start to its first impacts, the part that chaos leaves comparable.

    The scene ends earlier where a run takes too much of the budget, for example with rare impacts.
    """
    if not scene.is_one_body:
        return _comparable(scene)
    if scene.period is None:
        return scene
    periods = 1
    short = scene.with_values({"record.transient_periods": 0, "record.recorded_periods": periods})
    while periods < MOST_FIRST_PERIODS:
        periods *= 2
        longer = short.with_values({"record.recorded_periods": periods})
        found = observed_within(longer, RECORDING_SHARE * spends.seconds)
        if found.failure == LATE:
            break
        short = longer
        if len(found.impacts) >= FIRST_IMPACTS:
            break
    return short


def _comparable(scene: Scene) -> Scene:
    """Return a general scene from its start until a small change of a number has grown to `COMPARABLE`."""
    part = scene.record.transient_time + scene.record.recorded_time
    for _ in range(MOST_HALVINGS):
        part /= 2.0
        short = scene.with_values({"record.transient_time": 0.0, "record.recorded_time": part})
        try:
            if sensitivity_of(short, scales_of(short)) < COMPARABLE / DISTURBANCE:
                return short
        except ComponentError:  # a sampled variable has no value before the first impact
            return scene
    return scene


def _typical_speed(reference: Reference) -> float:
    """Return the median speed of the impacts of a motion, m/s; NaN without impacts."""
    speeds = np.abs(reference.observation.impacts[:, 1])
    return float(np.median(speeds)) if len(speeds) else math.nan


def _rate_of(scene: Scene) -> float:
    """Return the rate of the time series of a scene, samples per s; NaN without a time series."""
    return scene.sampling_rate or math.nan


def _add_memory(
    scene: Scene, given: Mapping[str, Any], ways: Sequence[Way], measured: Sequence[Measured], spends: Budget
) -> None:
    """Measure the memory of each way that did not fail, the cheapest first, as long as there is time."""
    if spends.left < LEAST_MEMORY:
        return
    places = {id(way): place for place, way in enumerate(ways)}
    ordered = sorted(measured, key=lambda one: one.each)
    parts = [(places[id(one.way)], one.part) for one in ordered]
    memory = clock.CLOCK.memory(scene, given, parts, spends.left)
    for one in measured:
        one.memory = memory.get(places[id(one.way)], UNKNOWN)


def _time_in_turn(measured: Sequence[tuple[Measured, Trial]], spends: Budget) -> None:
    """Run all ways with a trial in turn, again and again, until the time is over."""
    gc.collect()
    reserve = min(MEMORY_SHARE * spends.seconds, 0.5 * spends.left)
    for _ in range(MOST_ROUNDS):
        for one, trial in measured:
            if one.each <= EACH_SHARE * (spends.left - reserve):
                one.seconds.append(spends.time(trial))


def _add_statistics(
    scene: Scene,
    finest: Mapping[int, Modes],
    found: Sequence[Measured],
    reference: Reference,
    spends: Budget,
) -> None:
    """Compare the statistics of whole runs of chaotic motion, for ways that are cheap enough."""
    replicates = [observed(one) for one in disturbed_scenes(scene, REPLICATES)]
    expected = observed(scene)
    longer = scales_of(scene).window[1] / reference.scales.window[1]
    each = STATISTICS_SHARE * spends.seconds / max(len(found), 1)
    by_label = {one.way.label: one for one in found}
    for way in ways_of(scene, finest=finest):
        one = by_label.get(way.label)
        if one is None or one.errors.failure or one.cost * longer > each:
            continue
        with suppress(ComponentError):
            trial = way.open(None)
            try:
                with clock.CLOCK.limited(each):
                    shown = trial.run()
                one.statistics = None if shown.failure else statistics_of(shown, expected, replicates)
            finally:
                trial.close()
