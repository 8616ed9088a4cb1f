"""Attractors without a period, from long runs on them: quasi-periodic, chaotic, or neither in doubt."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.basins import Attractor, Features, Floats, Flow
from vibroimpact.analysis.orbits.attractors.chaotic_groups import Feature
from vibroimpact.analysis.orbits.attractors.recurrence import correlation_dimension, long_period
from vibroimpact.analysis.orbits.attractors.separation import separation_of
from vibroimpact.analysis.orbits.classify import RunClass
from vibroimpact.analysis.orbits.rotation import Rotation, rotation_of

APERIODIC = (OrbitClass.chaos, OrbitClass.quasi_periodic, OrbitClass.unknown)
"""Classes of motions whose states do not repeat."""
SAME_TURN = 1e-6
"""Difference of rotation numbers up to which motions are on one attractor."""
TURNING, DRAWN = 4, 1024
"""Number of runs of a group that must all be quasi-periodic, and of states that show a motion without a period."""


class LongRuns(NamedTuple):
    """Long runs without a period: whether each is chaotic, block features, sections, extremes, and first states."""

    chaotic: NDArray[np.bool_]
    features: Floats
    sections: Floats
    extremes: Floats
    states: Floats

    def of(self, chosen: NDArray[np.bool_]) -> LongRuns:
        """Return some of the runs."""
        rows: list[NDArray[Any]] = [each[chosen] for each in self]
        return LongRuns(*rows)


def attractor_of_runs(runs: LongRuns, flow: Flow, scale: Floats) -> Attractor:
    """Return the attractor of long runs that all lie on it.

    Its motion may repeat after very many periods: a body that rests on a stop forgets how it came there.
    Its class is quasi-periodic if the first runs have one rotation number. Otherwise most classes of the runs decide.
    The exponent decides where forces do not repeat: neighbours in the strobe section then part by phases of forces.
    """
    first = runs.states[0]
    parting = separation_of(flow, first, scale)
    is_chaotic = runs.chaotic.mean() > 0.5 if flow.turns is None else parting.is_chaotic
    known = None if flow.turns is None or flow.turns.size != 1 else float(flow.turns[0])
    kind = RunClass(OrbitClass.chaos if is_chaotic else OrbitClass.unknown)
    if rotation := _common([rotation_of(each, known) for each in runs.sections[:TURNING]]):
        kind = RunClass(OrbitClass.quasi_periodic, 0, rotation.curves, rotation=rotation)
    repeats = {long_period(each) for each in runs.sections[:TURNING]}
    if len(repeats) == 1 and (periods := repeats.pop()):
        impacts = round(float(runs.features[0, :, :, Feature.impacts].mean(axis=0).sum()) * periods)
        rests = parting.exponent == -np.inf
        kind = RunClass(
            OrbitClass.sticking if rests else OrbitClass.periodic, -1 if rests else impacts, periods
        )
    extremes = np.array([runs.extremes[:, 0].min(), runs.extremes[:, 1].max()])
    features = Features(runs.features.mean(axis=(0, 1)), extremes, correlation_dimension(runs.sections[0]))
    return Attractor(
        kind,
        np.empty((0, first.size)),
        0.0,
        features,
        exponent=parting.exponent,
        exponent_error=parting.error,
    )


def are_aperiodic(kinds: list[RunClass], states: Floats) -> NDArray[np.bool_]:
    """Return a mask of the runs without a period that did not fail."""
    aperiodic = [
        kind.kind is OrbitClass.quasi_periodic or (kind.kind in APERIODIC and not kind.periods)
        for kind in kinds
    ]
    return np.array(aperiodic) & np.isfinite(states).all(axis=1)


def _common(rotations: list[Rotation | None]) -> Rotation | None:
    """Return the rotation number that is most exact if all runs have one and the same; else None."""
    found = [each for each in rotations if each is not None]
    if len(found) < len(rotations):
        return None
    best = min(found, key=lambda each: each.error)
    alike = all(
        each.curves == best.curves and abs(each.number - best.number) <= SAME_TURN + each.error + best.error
        for each in found
    )
    return best if alike else None
