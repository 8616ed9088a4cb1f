"""One way of simulating a scene, tried: over all of its time, or the first half, quarter, ... until it ends."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace

import vibroimpact.orchestrator.study.clock as clock
from vibroimpact.fmus.errors import ComponentError, DatasetError, SceneError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy.measured import SHORT_SHARE, Measured
from vibroimpact.orchestrator.study.accuracy.reach import Passed
from vibroimpact.orchestrator.study.balance import balance_of, mean_energy_of
from vibroimpact.orchestrator.study.errors import Errors, errors_as_a_whole, errors_of, no_errors
from vibroimpact.orchestrator.study.observation import LATE, Observation
from vibroimpact.orchestrator.study.references import Reference, best_of, scales_of
from vibroimpact.orchestrator.study.ways.numbers_of_modes import opened_with_extremes
from vibroimpact.orchestrator.study.ways.trials import far_off
from vibroimpact.orchestrator.study.ways.way import Trial, Way, opened_part

COUNTING_SHARE = 0.125
"""Share of the limit of a run, from which on its calls are not counted: counting takes several times as long."""
PART_OF_REACHED = 0.5
"""Largest next part of the time, over the part that the run reached before it was given up."""
UNKNOWN_REACHED = 0.25
"""Next part of the time over the last part, after a run that does not give the part it reached."""
SAMPLED = 4.0
"""Largest cost of a run with samples of its energies, over the limit of a run."""
LEAST_PART = 2.0**-30
"""Part of the studied time below which a way is given up for good."""


class References:
    """The reference of each way over each part of the time; each reference runs once.

    `reference` belongs to the studied scene over all of its time; `passed` has its transient.
    """

    def __init__(self, reference: Reference, passed: Passed) -> None:
        self.reference = reference
        self._passed = passed
        self._found: dict[tuple[str, float], Reference] = {(reference.best.text, 1.0): reference}
        if passed.observation is not None:
            self._own = best_of(passed.whole)
            self._keep(self._own, 1.0, passed.observation)

    def scene_for(self, way: Way) -> Scene:
        """Return the scene of the reference run of a way: the finest of its kind, with the transient of the way."""
        if way.against is not None:
            return way.against
        own_transient = way.model and way.scene is not None and self._passed.is_kept
        return self._own if own_transient else self.reference.best

    def length_of(self, way: Way) -> float:
        """Return the studied time over the time that a way simulates."""
        return self.reference.scales.window[1] / scales_of(self.scene_for(way)).window[1]

    def of(self, way: Way, part: float, most: float) -> Reference:
        """Return the reference of a way over the first part of its time.

        A run of another model is given up after `most` seconds of processor time; its observation has the failure.
        """
        scene = self.scene_for(way)
        known = self._found.get((scene.text, part))
        if known is not None:
            return known
        trial = opened_with_extremes(scene, part) if way.as_whole else opened_part(scene, part)
        try:
            with clock.CLOCK.limited(math.inf if scene is self.reference.best else most):
                found = trial.run()
                if way.as_whole and part == 1.0 and not found.failure:
                    found = replace(found, mean_energy=_mean_energy(scene, most))
                return self._keep(scene, part, found)
        finally:
            trial.close()

    def _keep(self, scene: Scene, part: float, observation: Observation) -> Reference:
        found = replace(self.reference, observation=observation, scales=scales_of(scene, part))
        if observation.failure != LATE:  # a later way with a longer limit tries again
            self._found[scene.text, part] = found
        return found


def tried(way: Way, references: References, most: float) -> tuple[Measured, Trial | None]:
    """Run a way over all of its time, a half, a quarter, ... until a run ends; return its measurements and trial.

    `most` is the processor time after which a run is given up, s. The trial is None where the way failed.
    """
    part = 1.0
    while True:
        one, trial, reached = _tried_over(way, part, references, most)
        part = shorter_part(part, reached)
        if one.errors.failure != LATE or part < LEAST_PART:
            return one, trial


def shorter_part(part: float, reached: float) -> float:
    """Return the next part to try, a power of two, after a run of `part` was given up at the share `reached` of it.

    Examples
    --------
    >>> shorter_part(1.0, 0.3), shorter_part(0.25, 0.9), shorter_part(1.0, float("nan"))
    (0.125, 0.0625, 0.25)
    """
    if not reached > 0.0:
        return UNKNOWN_REACHED * part
    return float(part * min(0.5, 2.0 ** math.floor(math.log2(PART_OF_REACHED * min(reached, 1.0)))))


def _tried_over(
    way: Way, part: float, references: References, most: float
) -> tuple[Measured, Trial | None, float]:
    """Run a way over a part; return its measurements, its trial, and the share of the part that it reached."""
    try:
        trial = way.open(None, part)
    except (ComponentError, SceneError, DatasetError) as error:
        return Measured(way, no_errors(_first_line(error)), part), None, math.nan
    try:
        with clock.CLOCK.limited(most):
            found, processor, wall = clock.CLOCK.observed(trial)
        reference = references.of(way, part, most)
    except ComponentError as error:
        trial.close()
        return Measured(way, no_errors(_first_line(error)), part), None, math.nan
    with clock.CLOCK.limited(most):
        one = _measured(way, part, found, reference, references.length_of(way), most)
    one.first, one.first_wall = processor, wall
    if one.errors.failure == LATE or found.failure:
        trial.close()
        return one, None, found.reached
    with clock.CLOCK.limited(most):
        _measure_more(one, processor, most)
    return one, trial, math.nan


def _measured(
    way: Way, part: float, found: Observation, reference: Reference, length: float, most: float
) -> Measured:
    """Return the measurements of a way from its observation and its reference."""
    whole = part == 1.0 and not (found.failure or reference.observation.failure)
    if way.scene is not None and whole:
        if way.as_whole:
            found = replace(found, mean_energy=_mean_energy(way.scene, most))
        else:
            found = replace(found, energy_balance=balance_of(way.scene))
    return Measured(
        way,
        _compared(found, reference, as_whole=way.as_whole),
        part,
        length,
        impacts=len(found.impacts),
        energy_residual=found.energy_residual,
        variance=found.variance,
    )


def _mean_energy(scene: Scene, most: float) -> float:
    """Return the mean energy of a scene whose run without samples takes at most `most` seconds of processor time."""
    with clock.CLOCK.limited(SAMPLED * most):
        return mean_energy_of(scene)


def _compared(found: Observation, reference: Reference, *, as_whole: bool) -> Errors:
    if reference.observation.failure == LATE:
        return no_errors(LATE)
    if as_whole:
        return errors_as_a_whole(found, reference.observation)
    errors = errors_of(found, reference.observation, reference.scales)
    fell = not found.failure and far_off(found, reference.observation)
    return no_errors("fell through") if fell else errors


def _measure_more(one: Measured, processor: float, most: float) -> None:
    """Count the calls of a cheap way; run a way that simulated only a part over an eighth of that part."""
    way = one.way
    if one.is_extrapolated:
        trial = way.open(None, SHORT_SHARE * one.part)
        try:
            # over so short a time an output may have no value yet, such as the last impact before the first one
            with suppress(ComponentError):
                one.short = clock.CLOCK.timed(trial)[0]
        finally:
            trial.close()
    elif processor < COUNTING_SHARE * most:
        one.calls = clock.CLOCK.calls(way)


def _first_line(error: Exception) -> str:
    said = str(error).splitlines()[0]
    return "grew without bound" if "expected finite numbers" in said else said.rstrip(".")
