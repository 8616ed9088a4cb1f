"""The reference of a scene, against which errors are measured, with its own error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from vibroimpact.analysis.landmarks import ImpactOscillator
from vibroimpact.fmus.errors import DatasetError, SceneError, UsageError
from vibroimpact.orchestrator.run.parameters import body_points, float_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.laws import all_rigid, integrates_contacts
from vibroimpact.orchestrator.study.errors import QUANTITIES, Scales, errors_of
from vibroimpact.orchestrator.study.observation import Floats, Observation
from vibroimpact.orchestrator.study.ways.replays import span_of
from vibroimpact.orchestrator.study.ways.span import first_part, window_of
from vibroimpact.orchestrator.study.ways.way import opened_trial, own_step

DISTURBANCE = 1e-9
"""Relative change of a number of the scene that measures the sensitivity of its motion."""
DISTURBED = (
    *("body.mass", "body.masses[1]", "body.mass_per_length", "body.stiffness", "body.frequency"),
    *(
        "body[1].mass",
        "body[1].masses[1]",
        "body[1].mass_per_length",
        "body[1].stiffness",
        "body[1].frequency",
    ),
    *("forcing.amplitude", "stop[1].position", "body.velocity_start", "body.displacement_start"),
)
"""Keys of the numbers that are disturbed, where a scene has them."""
CHAOTIC = 1e-3
"""Relative change of the motion by a change `DISTURBANCE` of a number, above which the motion counts as chaotic."""
ROUNDING = float(np.finfo(float).eps)
FINEST, NEXT = 1e-12, 1e-11
"""Tolerances of integrated contacts: of the reference, and of the run that estimates the reference's error."""
SAME_MOTION = 1e-9
"""Relative distance between a run and a closed form, below which the run has reached that motion."""
FINEST_STEP = 1.0 / 16.0
"""Macro step of the reference of a general scene, over the macro step of the scene."""
SAFETY = 64.0
"""Safety factor on the estimated rounding error, which makes it a bound in practice."""

CONTACT_SAFETY = 8.0
"""Safety factor on the rounding of the depth by which a stop is pressed in."""


@dataclass(frozen=True, slots=True)
class Reference:
    """The reference against which errors are measured."""

    observation: Observation
    name: str
    """Origin of the reference, in words."""
    error: Mapping[str, float]
    """Relative error of the reference itself, by quantity."""
    sensitivity: float
    """Relative change of the motion over the relative change of a number; NaN where no number could be changed."""
    chaotic: bool
    """Whether only statistics can be compared after the first impacts."""
    scales: Scales
    best: Scene
    """The scene of the reference run."""


def _finest_exchange(scene: Scene) -> Reference:
    """Return the reference of a general scene: iterated exchange at a macro step below all compared steps.

    Runs at twice and four times this step give the error of the reference: the first its size, both its order. Runs at
    the scene's own step decide whether the motion is chaotic.
    """
    scales, own, best = scales_of(scene), own_step(scene), best_of(scene)
    steps = [{"execution.macro_step": own * FINEST_STEP * part} for part in (4.0, 2.0)]
    coarse, middle = (observed(best.with_values(step)) for step in steps)
    finest = observed(best)
    first, second = errors_of(coarse, finest, scales).of, errors_of(middle, finest, scales).of
    error = {}
    for name, off in second.items():
        ratio = first[name] / off if off > 0.0 else math.nan
        gain = max(ratio - 1.0, 1.0) if ratio > 2.0 else 1.0
        error[name] = off / gain + SAFETY * ROUNDING
    name = f"iterated exchange at a macro step of {own * FINEST_STEP:.3g}"
    sensitivity = sensitivity_of(scene, scales)
    return Reference(finest, name, error, sensitivity, sensitivity > CHAOTIC / DISTURBANCE, scales, best)


def best_of(scene: Scene) -> Scene:
    """Return the scene of the reference run: fused, with the finest tolerance of contacts, or the finest exchange."""
    if not scene.is_one_body:
        step = own_step(scene) * FINEST_STEP
        return scene.with_values({"execution.macro_step": step, "execution.exchange": "iterated"})
    best = scene.with_values({"execution.how": "fused"})
    return (
        best.with_values({"execution.contact_tolerance": FINEST})
        if integrates_contacts(scene.stops)
        else best
    )


def sensitivity_of(scene: Scene, scales: Scales) -> float:
    """Return the largest relative change of a motion over the change of a number; NaN without such a number."""
    base = observed(scene)
    changes = [errors_of(observed(_disturbed(scene, key)), base, scales) for key in disturbed_keys(scene)]
    if any(change.failure for change in changes):
        return math.inf
    return max((change.worst() for change in changes), default=math.nan) / DISTURBANCE


def scales_of(scene: Scene, part: float = 1.0) -> Scales:
    """Return the scales of the errors of a scene over the first part of its time, by default over all of it."""
    if not scene.is_lone_body:
        scene = first_part(scene, part)
    if not scene.is_one_body:
        begin = scene.record.transient_time
        return Scales(scene.record.recorded_time, (begin, begin + scene.record.recorded_time))
    if scene.replay is not None:
        begin, end = span_of(scene)
        return Scales(end - begin, (begin, end))
    window = window_of(scene, float_parameters(scene, None), part)
    masses = tuple(body_points(scene).contact_masses().tolist()) if scene.body.HAS_MASSES else ()
    return Scales(scene.period or window[1] - window[0], window, masses)


def reference_of(scene: Scene) -> Reference:
    """Return the reference of a scene without a sweep."""
    if not scene.is_one_body:
        return _finest_exchange(scene)
    scales, integrated, best = scales_of(scene), integrates_contacts(scene.stops), best_of(scene)
    observation = observed(best)
    keys = disturbed_keys(best)
    disturbed = [_disturbed(best, key) for key in keys]
    changes = [errors_of(observed(one), observation, scales) for one in disturbed]
    largest = {
        name: max((change.of[name] for change in changes if change.of[name] == change.of[name]), default=0.0)
        for name in QUANTITIES
    }
    sensitivity = max(largest.values()) / DISTURBANCE if keys else math.nan
    chaotic = any(change.failure for change in changes) or max(largest.values()) > CHAOTIC
    rounding = ROUNDING * (SAFETY + CONTACT_SAFETY * _shallowness(best, observation))
    error = {name: rounding * (1.0 + value / DISTURBANCE) for name, value in largest.items()}
    name = "the fused run, exact between events" + (
        "" if scene.replay is None else " and between samples, which are joined by lines"
    )
    if integrated:
        name = f"the fused run at a contact tolerance of {FINEST:g}"
        next_best = observed(
            scene.with_values({"execution.how": "fused", "execution.contact_tolerance": NEXT})
        )
        off = errors_of(next_best, observation, scales).of
        error = {q: max(error[q], off[q]) if off[q] == off[q] else error[q] for q in QUANTITIES}
    closed = None if chaotic else _closed_form(scene, observation, scales)
    if closed is not None:
        observation, name = closed, "the closed form of the P(1,1) motion"
    return Reference(observation, name, error, sensitivity, chaotic, scales, best)


def _shallowness(scene: Scene, observation: Observation) -> float:
    """Return the largest ratio of position to depth of the Kelvin-Voigt stops; 0 without such a stop.

    The depth is the difference of two displacements of the size of the position. The rounding of the depth, times
    sqrt(stiffness / mass), is an error of the velocity after the contact, at any velocity.
    """
    if not len(observation.impacts):
        return 0.0
    fastest = float(np.abs(observation.impacts[:, 1]).max())
    rates = [
        abs(stop.position) * math.sqrt(stop.stiffness / mass)
        for stop, mass in zip(scene.stops, body_points(scene).contact_masses(), strict=True)
        if stop.law == "kelvin_voigt"
    ]
    return max(rates, default=0.0) / fastest if fastest > 0.0 else 0.0


def observed(scene: Scene) -> Observation:
    """Return the observation of a scene's run by its own runner."""
    trial = opened_trial(scene)
    try:
        return trial.run()
    finally:
        trial.close()


def disturbed_keys(scene: Scene) -> list[str]:
    """Return the keys of numbers on which the motion of a scene depends, those of the body first.

    The force comes later: with a stop at 0 it changes only the scale of the motion; a number of the body changes more.
    """
    found: list[str] = []
    if not scene.is_one_body:
        return _disturbed_parameters(scene)
    for key in DISTURBED:
        with suppress(UsageError):  # a key that the scene does not have
            if scene.value(key) != 0.0:
                found.append(key)
    return found


def _disturbed_parameters(scene: Scene) -> list[str]:
    """Return the first number of each component that is not 0, in the order of the scene."""
    found = []
    for component in scene.components:
        numbers = (
            n for n, value in component.parameters.items() if isinstance(value, float) and value != 0.0
        )
        found += [f"{component.name}.{name}" for name in islice(numbers, 1)]
    return found


def disturbed_scenes(scene: Scene, count: int) -> list[Scene]:
    """Return scenes that differ slightly in one number; none where the scene has no such number."""
    keys = disturbed_keys(scene)
    return [_disturbed(scene, key, k) for key in keys[:1] for k in range(1, count + 1)]


def _disturbed(scene: Scene, key: str, times: int = 1) -> Scene:
    """Return a scene with one number slightly larger, or smaller where a body starting on its stop forbids larger."""
    number, change = scene.value(key), times * DISTURBANCE
    if not scene.is_one_body:
        return scene.at({key: number * (1.0 + change)})
    try:
        return scene.with_values({key: number * (1.0 + change)})
    except SceneError:
        return scene.with_values({key: number * (1.0 - change)})


def _closed_form(scene: Scene, observation: Observation, scales: Scales) -> Observation | None:
    """Return the observation with impacts from the closed form of P(1,1); None where the motion is another one."""
    if scene.period is None or len(observation.impacts) < 2 or scene.lists_forces:
        return None
    if not all_rigid(scene.stops):
        return None
    try:
        oscillator = ImpactOscillator.from_scene(scene.text)
    except DatasetError:
        return None
    forcing = scene.forcing
    if forcing is None or scene.stops[0].side != "upper" or forcing.scalar_amplitude < 0.0:
        return None
    begin, period = scales.window[0], scene.period
    for velocity, phase in oscillator.single_impact_motions(forcing.angular_frequency):
        turns = phase / (2.0 * math.pi)
        periods = np.round((observation.impacts[:, 0] - begin) / period - turns)
        times: Floats = begin + (periods + turns) * period
        impacts = np.column_stack([times, np.full(len(times), velocity), np.ones(len(times))])
        off = np.abs(impacts[:, :2] - observation.impacts[:, :2]) / (period, velocity)
        if off.max() < SAME_MOTION:
            return replace(observation, impacts=impacts)
    return None
