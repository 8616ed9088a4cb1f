"""A motion as a whole (range, speeds, energies, class), where its impacts cannot be compared one by one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset.results import TableRow
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.forcing_clock import Clock, clock_of, signals_of
from vibroimpact.orchestrator.scene.models import StopTable
from vibroimpact.orchestrator.scene.sampled_names import CONSERVATIVE
from vibroimpact.orchestrator.study.errors import Scales, errors_of
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.orbits import orbit_of
from vibroimpact.orchestrator.study.references import CHAOTIC, disturbed_scenes, observed, scales_of
from vibroimpact.orchestrator.study.statistics import Statistics

QUANTITIES = {
    "displacement_range": "m",
    "impact_velocity": "m s-1",
    "kinetic_energy": "J",
    "potential_energy": "J",
}
"""Quantities of a motion, with their SI units; the last three are means over the recording."""
OF_MOTIONS: tuple[TableRow, ...] = (
    *(
        (name, "effect motion", unit, f"{name.replace('_', ' ')}, with the effect and without it")
        for name, unit in QUANTITIES.items()
    ),
    *(
        (
            f"{name}_sampling",
            "effect",
            "1",
            f"change of the {name.replace('_', ' ')} by chance alone, relative",
        )
        for name in QUANTITIES
    ),
    ("impacts", "effect motion", "1", "impacts, with the effect and without it"),
    (
        "distribution_distance",
        "effect",
        "1",
        "distance between the distributions of impact velocity, or of what is sampled, the largest",
    ),
    ("distribution_sampling", "effect", "1", "distance that chance alone makes"),
)
"""Rows of a table of results that describe motions as a whole."""
REPLICATES = 6
"""Runs from slightly different numbers, which detect chaos and give the sampling error of its statistics."""
SAMPLES_A_PERIOD, MOST_SAMPLES = 256, 2**16
"""Samples of the energies in a forcing period, and at most in a run; an unforced run has `MOST_SAMPLES` / 16."""
CHAOS = "chaotic"
"""Class of a motion that becomes another motion by a small change of a number."""
QUASI_PERIODIC, NO_PERIOD = "quasi-periodic forcing", "forcing without a period"
"""Classes of motions under forces that never repeat: under sines alone, and beside other signals or drifting stops."""
SENSITIVE = "a small change leads to another motion"
"""Difference of a motion under such forces from its replicates."""


@dataclass(frozen=True, slots=True)
class Motion:
    """The motion of one run as a whole."""

    of: Mapping[str, float]
    """Value by quantity: m, m/s, J, J; NaN where unknown, as the impact velocity without impacts."""
    impacts: int
    """Number of recorded impacts."""
    orbit: str
    """Class of the motion: `P(p,q)`, `chaotic`, `no impacts`, ...; empty without forcing.

    Under forces without a common period it names these forces: the motion has no class.
    """
    sampling: Mapping[str, float] = field(default_factory=dict)
    """Largest relative difference among runs from slightly different numbers, by quantity; empty if they agree."""

    @property
    def chaotic(self) -> bool:
        """Whether a small change of a number leads to another motion."""
        return bool(self.sampling)

    @property
    def change(self) -> str:
        """The word for a motion that a small change of a number makes another one; empty for other motions."""
        if not self.chaotic:
            return ""
        return CHAOS if self.orbit == CHAOS else SENSITIVE


def motion_of(scene: Scene) -> Motion | None:
    """Return the motion of a scene of the short form or of a replay as a whole, by a run; None where the run fails.

    The scene has no sweep. A replay gives only its impacts.
    """
    followed, scales = _followed(scene), scales_of(scene)
    found = observed(followed)
    if found.failure:
        return None
    clock = _acting_clock(scene)
    unclassed = _without_a_period(scene, clock) if len(found.impacts) else ""
    period = None if clock is None or scene.replay else clock.period
    orbit = unclassed or orbit_of(found, period, scales.window)
    own = Motion(_quantities(found, scene), len(found.impacts), orbit)
    if orbit.startswith("P(") or not len(found.impacts):
        return own
    replicates = [observed(one) for one in disturbed_scenes(followed, REPLICATES)]
    if not is_chaotic(found, replicates, scales):
        return own
    known = [_quantities(one, scene) for one in replicates if not one.failure]
    sampling = {
        name: max((abs(_relative(one[name], own.of[name])) for one in known), default=math.nan)
        for name in QUANTITIES
    }
    return replace(own, orbit=unclassed or CHAOS, sampling=sampling)


def _acting_clock(scene: Scene) -> Clock | None:
    """Return the clock of the forces that are not 0; that of all forces where none is left."""
    acting = [force for force in scene.forces if np.any(force.amplitude)]
    return clock_of(acting, scene.stops) or scene.clock


def _without_a_period(scene: Scene, clock: Clock | None) -> str:
    """Return the class of a motion whose forces never repeat; empty for other scenes."""
    if clock is None or clock.is_common:
        return ""
    drifts = any(isinstance(stop, StopTable) and stop.drifts for stop in scene.stops)
    return NO_PERIOD if drifts or signals_of(scene.forces) else QUASI_PERIODIC


def is_chaotic(found: Observation, replicates: Sequence[Observation], scales: Scales) -> bool:
    """Whether runs from slightly different numbers come to another motion, by the criterion of `accuracy`."""
    # a body with impacts is compared by impacts and end: a sample at an impact may be on either side of its jump
    own = replace(found, samples=None) if len(found.impacts) else found
    for one in replicates:
        errors = errors_of(replace(one, samples=None) if len(found.impacts) else one, own, scales)
        if errors.failure or errors.worst() > CHAOTIC:
            return True
    return False


def changes_of_motion(full: Motion, without: Motion) -> dict[str, float]:
    """Return the relative change of each quantity from one motion to another; NaN where one of them has none."""
    return {name: _relative(without.of[name], full.of[name]) for name in QUANTITIES}


def sampling_of_change(full: Motion, without: Motion) -> dict[str, float]:
    """Return the sampling error of the change of each quantity, relative to the first motion; 0 without chaos."""
    found = {}
    for name in QUANTITIES:
        ratio = 1.0 + _relative(without.of[name], full.of[name])
        own, other = (one.sampling.get(name, 0.0) for one in (full, without))
        found[name] = own + (other * ratio if other else 0.0)
    return found


def _relative(value: float, base: float) -> float:
    return value / base - 1.0 if base > 0.0 else (0.0 if value == base else math.nan)


def _followed(scene: Scene) -> Scene:
    """Return a scene that records its impacts, its extremes and a time series of its energies; a replay unchanged."""
    if scene.replay is not None:
        return scene
    begin, end = scales_of(scene).window
    count = MOST_SAMPLES / 16.0
    if scene.period is not None:
        count = min(SAMPLES_A_PERIOD * round((end - begin) / scene.period), MOST_SAMPLES)
    series: dict[str, Any] = {"variables": ["displacement", *CONSERVATIVE]}
    if scene.daq is None:  # a converter has a rate of its own
        series["rate"] = count / (end - begin)
    changes: dict[str, Any] = {"record.impacts": True, "record.time_series": series}
    return scene.with_values(changes | ({} if scene.period is None else {"record.extrema": True}))


def _quantities(found: Observation, scene: Scene) -> dict[str, float]:
    is_followed = found.samples is not None and scene.replay is None
    samples = found.samples if is_followed and found.samples is not None else np.empty((0, 3))
    # after whole periods the last sample repeats the first one
    means = samples[:-1, 1:].mean(axis=0).tolist() if len(samples) > 1 else [math.nan, math.nan]
    span = found.displacement_range
    if math.isnan(span) and len(samples):  # an unforced motion has no extremes of periods
        span = float(np.ptp(samples[:, 0]))
    speed = float(np.abs(found.impacts[:, 1]).mean()) if len(found.impacts) else math.nan
    return dict(zip(QUANTITIES, (span, speed, *means), strict=True))


def motions_in_words(motions: tuple[Motion, Motion] | None, statistics: Statistics | None) -> str:
    """Return the difference of the second motion from the first, in words; empty where nothing is known.

    Examples
    --------
    >>> full, without = (Motion(dict.fromkeys(QUANTITIES, size), 4, f"P({n},2)") for n, size in ((2, 2.0), (1, 3.0)))
    >>> motions_in_words((full, without), None).split(", displacement")
    ['P(2,2) to P(1,2)', ' range +50 %, impact velocity +50 %, kinetic energy +50 %, potential energy +50 %']
    """
    words = []
    if motions is not None:
        full, without = motions
        classes = dict.fromkeys(one.orbit for one in motions if one.orbit)
        words += [" to ".join(classes)] if classes else []
        sampling = sampling_of_change(full, without)
        for name, change in changes_of_motion(full, without).items():
            if not math.isnan(change):
                words.append(f"{name.replace('_', ' ')} {change_in_words(change, sampling[name])}")
    if statistics is not None:
        distance, chance = statistics.distribution_distance, statistics.distribution_sampling
        by_chance = "" if math.isnan(chance) else f" (by chance {chance:.2g})"
        words.append(f"distributions up to {distance:.2g} apart{by_chance}")
    return ", ".join(words)


def change_in_words(change: float, sampling: float) -> str:
    """Return a relative change in percent, with its sampling error unless that is 0.

    >>> change_in_words(-0.25, 0.0), change_in_words(0.031, 0.05)
    ('-25 %', '+3.1 % (by chance 5 %)')
    """
    by_chance = f" (by chance {100.0 * sampling:.2g} %)" if sampling > 0.0 else ""
    return f"{100.0 * change:+.3g} %{by_chance}"


def values_of_motions(
    motions: Sequence[tuple[Motion, Motion] | None], statistics: Sequence[Statistics | None]
) -> dict[str, Any]:
    """Return the values of the rows `OF_MOTIONS` for motions with and without each effect, shape (effect,)."""
    none = Motion(dict.fromkeys(QUANTITIES, math.nan), -1, "")
    pairs = [pair or (none, none) for pair in motions]
    missing = Statistics(math.nan, math.nan, math.nan, math.nan)
    known = [one or missing for one in statistics]
    values: dict[str, Any] = {}
    for name in QUANTITIES:
        values[name] = np.reshape([[one.of[name] for one in pair] for pair in pairs], (-1, 2))
        values[f"{name}_sampling"] = [sampling_of_change(*pair)[name] for pair in pairs]
    return values | {
        "impacts": np.reshape([[one.impacts for one in pair] for pair in pairs], (-1, 2)),
        "distribution_distance": [one.distribution_distance for one in known],
        "distribution_sampling": [one.distribution_sampling for one in known],
    }
