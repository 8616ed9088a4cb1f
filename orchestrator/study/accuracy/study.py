"""What accuracy costs in time: a scene, simulated in all ways that it can be, each against the best reference."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace

import numpy as np

import vibroimpact.orchestrator.study.clock as clock
from vibroimpact.fmus.errors import ComponentError, DatasetError, SceneError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy.choice import cheapest
from vibroimpact.orchestrator.study.accuracy.measured import Measured, Study
from vibroimpact.orchestrator.study.accuracy.refusals import (
    refuse_misuse,
    refuse_one_way,
    refuse_vague_reference,
)
from vibroimpact.orchestrator.study.balance import balance_of
from vibroimpact.orchestrator.study.errors import FIRST_IMPACTS, errors_of, no_errors
from vibroimpact.orchestrator.study.measuring_effects import motion_alone
from vibroimpact.orchestrator.study.memory import UNKNOWN
from vibroimpact.orchestrator.study.orbits import orbit_of
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
from vibroimpact.orchestrator.study.ways.models import told_by
from vibroimpact.orchestrator.study.ways.trials import far_off
from vibroimpact.orchestrator.study.ways.way import Trial, Way

BUDGET = 40.0
"""Wall time of a study, s, where nobody says another."""
LEAST_ROUNDS, MOST_ROUNDS = 3, 15
"""How often each way is timed, in turn with the others."""
EACH_SHARE = 0.1
"""Of the time that is left, what one way may have taken and still be timed again."""
LATE_SHARE, LEAST_LATE = 0.04, 0.5
"""Of the budget, after which one run is given up; and no earlier than that, s."""
COUNTED = 0.25
"""Wall time of a run, s, above which its calls are not counted: that takes several times as long."""
REPLICATES = 6
"""Runs of chaotic motion, each from a slightly different number, that tell the sampling error of its statistics."""
MOST_HALVINGS = 24
"""Of the time that a chaotic general scene records, until its motion is comparable."""
COMPARABLE = 1e-6
"""Relative change of the motion that a disturbance leads to, below which it is."""
MOST_FIRST_PERIODS = 4096
"""Periods within which the first impacts are looked for."""


def study_accuracy(
    scene: Scene,
    *,
    tolerance: float | None = None,
    quantity: str = "all",
    budget: float = BUDGET,
    told: Callable[[Measured], None] = lambda measured: None,
) -> Study:
    """Simulate a scene in all ways that it can be, and measure the error and the cost of each.

    Parameters
    ----------
    scene : Scene
        Its sweep is left out: each swept number has the value of its own table.
    tolerance : float, optional
        Relative error that is asked for.
    quantity : str
        One of `errors.QUANTITIES`, or `all`, the worst of those.
    budget : float
        Wall time that the study takes, about, s.
    told : callable
        Given each way as soon as it has run once.

    Returns
    -------
    Study

    Raises
    ------
    UsageError
        There is no such quantity, nothing to vary, a budget that is no time, or a tolerance that no way can reach:
        double precision or the reference of the scene does not tell it. No way has run then.
    """
    refuse_misuse(tolerance, quantity, budget)
    end = clock.CLOCK.now() + budget
    whole, late = studied_scene(scene), max(LEAST_LATE, LATE_SHARE * budget)
    refuse_one_way(ways_of(whole), scene)
    reference = reference_of(whole)
    orbit = "chaotic" if reference.chaotic else ""
    if not reference.chaotic and whole.general is None and whole.replay is None:
        orbit = orbit_of(reference.observation, whole.period, reference.scales.window)
    studied = first_impacts(whole, reference) if reference.chaotic else whole
    if reference.chaotic:
        reference = replace(reference_of(studied), chaotic=True, sensitivity=reference.sensitivity)
    refuse_vague_reference(tolerance, quantity, reference)
    found: list[Measured] = []
    finest: dict[Scene, Reference] = {}
    with ExitStack() as stack:
        measured: list[tuple[Measured, Trial]] = []
        given = {"speed": _typical_speed(reference), "rate": _rate_of(scene)}
        ways = ways_of(given_up_after(studied, late), **given)
        for way in ways:
            one, trial = _tried(way, _told_by(way, reference, finest))
            if trial is not None:
                stack.callback(trial.close)
                measured.append((one, trial))
            told(one)
            found.append(one)
        _add_memory(given_up_after(studied, late), given, ways, [one for one, _ in measured])
        _time_in_turn(measured, end)
    if reference.chaotic:
        _add_statistics(whole, given_up_after(whole, late), found)
    wanted = math.nan if tolerance is None else tolerance
    chosen = cheapest(found, tolerance, quantity, reference)
    return Study(
        studied, reference, found, quantity, wanted, chosen, orbit, tuple(remarks_on(scene)), told_by(ways)
    )


def studied_scene(scene: Scene) -> Scene:
    """Return a scene as it is studied: one point, impacts and extremes recorded.

    A time series is left out where impacts tell more, since it costs more than the motion; a general scene and a free
    motion have nothing else to be compared by. A measuring chain is left out: no other way has one.

    Raises
    ------
    UsageError
        The scene has an exciter whose force is not its forcing alone.
    """
    alone = scene.unswept()
    if scene.general is not None or scene.replay is not None:
        return alone
    alone = motion_alone(alone)
    if alone.record.time_series is not None:
        document = parse_toml(alone.text)
        del document["record"]["time_series"]
        alone = Scene.from_dict(document, scene.source)
    return alone.with_values({"record.impacts": True, "record.extrema": True})


def given_up_after(scene: Scene, seconds: float) -> Scene:
    """Return a scene whose runs are given up after some wall time, or earlier where it says so."""
    own = scene.execution.deadline
    return scene.with_values({"execution.deadline": seconds if own is None else min(own, seconds)})


def first_impacts(scene: Scene, reference: Reference) -> Scene:
    """Return a scene that ends after its first impacts, from its start: all that chaos leaves comparable."""
    if scene.general is not None:
        return _comparable(scene)
    if scene.period is None:
        return scene
    periods = 1
    while periods < MOST_FIRST_PERIODS:
        periods *= 2
        short = scene.with_values({"record.transient_periods": 0, "record.recorded_periods": periods})
        if len(observed(short).impacts) >= FIRST_IMPACTS:
            break
    return short


def _comparable(scene: Scene) -> Scene:
    """Return a general scene from its start to where a small change of a number has not grown to that of a motion."""
    part = scene.record.transient_time + scene.record.recorded_time
    for _ in range(MOST_HALVINGS):
        part /= 2.0
        short = scene.with_values({"record.transient_time": 0.0, "record.recorded_time": part})
        try:
            if sensitivity_of(short, scales_of(short)) < COMPARABLE / DISTURBANCE:
                return short
        except ComponentError:  # it samples what has no value before a first impact
            return scene
    return scene


def _typical_speed(reference: Reference) -> float:
    """Return the median speed of the impacts of a motion, m/s; NaN without one."""
    speeds = np.abs(reference.observation.impacts[:, 1])
    return float(np.median(speeds)) if len(speeds) else math.nan


def _rate_of(scene: Scene) -> float:
    """Return the rate of the time series that a scene asks for, samples per s; NaN without one."""
    return scene.sampling_rate or math.nan


def _tried(way: Way, reference: Reference) -> tuple[Measured, Trial | None]:
    """Run a way once, counting calls, and compare what it shows; no trial where it failed."""
    try:
        trial = way.open(None)
    except (ComponentError, SceneError, DatasetError) as error:
        return Measured(way, no_errors(_first_line(error))), None
    try:
        found = trial.run()
    except ComponentError as error:
        trial.close()
        return Measured(way, no_errors(_first_line(error))), None
    if way.scene is not None and not found.failure:
        found = replace(found, energy_balance=balance_of(way.scene))
    errors = errors_of(found, reference.observation, reference.scales)
    if not found.failure and far_off(found, reference.observation):
        errors = no_errors("fell through")
    one = Measured(
        way,
        errors,
        impacts=len(found.impacts),
        energy_residual=found.energy_residual,
        variance=found.variance,
    )
    if found.failure:
        trial.close()
        one.seconds.append(found.seconds)
        return one, None
    if found.seconds < COUNTED:
        one.calls = clock.CLOCK.calls(way)
    return one, trial


def _told_by(way: Way, reference: Reference, finest: dict[Scene, Reference]) -> Reference:
    """Return what the errors of a way are measured against; the finest model of a kind runs once."""
    if way.against is None:
        return reference
    if way.against not in finest:
        finest[way.against] = replace(reference, observation=observed(way.against))
    return finest[way.against]


def _add_memory(
    scene: Scene, given: Mapping[str, float], ways: Sequence[Way], measured: Sequence[Measured]
) -> None:
    """Find what memory each way takes that did not fail."""
    places = {id(way): place for place, way in enumerate(ways)}
    memory = clock.CLOCK.memory(scene, given, [places[id(one.way)] for one in measured])
    for one in measured:
        one.memory = memory.get(places[id(one.way)], UNKNOWN)


def _time_in_turn(measured: Sequence[tuple[Measured, Trial]], end: float) -> None:
    """Run all ways in turn, again and again, until the time is over; a way that failed is timed as well."""
    gc.collect()
    for round_number in range(MOST_ROUNDS):
        if round_number >= LEAST_ROUNDS and clock.CLOCK.now() > end:
            break
        for one, trial in measured:
            left = end - clock.CLOCK.now()
            if round_number >= LEAST_ROUNDS and sum(one.seconds) > EACH_SHARE * left:
                continue
            one.seconds.append(clock.CLOCK.wall_time(trial))


def _add_statistics(scene: Scene, limited: Scene, found: Sequence[Measured]) -> None:
    """Compare the statistics of whole runs where nothing else can be compared."""
    replicates = [observed(one) for one in disturbed_scenes(scene, REPLICATES)]
    reference = observed(scene)
    by_label = {one.way.label: one for one in found}
    for way in ways_of(limited):
        one = by_label.get(way.label)
        if one is None or one.errors.failure:
            continue
        with suppress(ComponentError):
            trial = way.open(None)
            try:
                one.statistics = statistics_of(trial.run(), reference, replicates)
            finally:
                trial.close()


def _first_line(error: Exception) -> str:
    said = str(error).splitlines()[0]
    return "grew without bound" if "expected finite numbers" in said else said
